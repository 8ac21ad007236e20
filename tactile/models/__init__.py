"""Hold the models: one file per row of the tables, named as the model's key in params.yaml.

What a model's file provides
----------------------------
`class Settings(Block)` declares its settings, those of its block in params.yaml, as pydantic fields, each with its
limits and a description (tactile/settings; the class is made without running the rest of the file, of what
tactile/settings/models.py names). `build(spec, *, <the same names>)` returns the model, not yet trained.

* `spec` (tactile.learning.spec.Spec) gives the shapes of the task. Images are windows of one frame, and a series
  is one row of channels; `spec.frames` is then how many samples a model of windows sees.
* Every setting is keyword-only and has no default.
* `build` raises InputError for settings that do not fit each other or `spec`. It neither reads files nor needs data.
* `TRANSFER = True` stands in the file of a model of series that starts from model-0; `fit` of others gets no `base`.
* A docstring's line that starts with "Differs from paper" and a colon is printed in the reports, up to an empty line.
* Classes that scikit-learn fits (`rbf.GaussianFeatures` ...) are stored by module path: moving or renaming one makes
  saved models unreadable. Such paths, types that skops does not know, and classes of scikit-learn that no other model
  is made of, are listed in SklearnRegressor's `trusted`.

What every model provides
-------------------------
* `fit(...) -> list[dict]`: trains from the start and returns the history, one row per epoch: epoch (from 1),
  train_loss, validation_loss (NaN without a validation part) and learning_rate; closed forms have one row. Keywords:
  `seed`, which alone sets all that is drawn; `device`, `auto` or `cpu` or another of torch's names; `progress`, None or
  a function of (epoch, epochs, train_loss, validation_loss), called after every epoch (by read-outs of series that are
  solved in one step, never). Where training diverges, `fit` returns all the same, and `summary` says so.
* `summary`: how the last fit ended (tactile.learning.training.FitSummary: stop_reason, best_epoch); None before `fit`.
* `predict(x)`: float32, one row of outputs per row of x, for a fitted or loaded model; on the CPU.
* `save(folder)`: writes one file into a folder that exists (`network.safetensors` or `estimator.skops`). The same
  data, settings and seed give the same bytes.
* `load(folder)`: the inverse, on a model built with the same settings; InputError where the file is absent, damaged or
  of another model.
* `parameters() -> int`: trained numbers, scaling constants not counted; scikit-learn and reservoir models must be
  fitted first.
* `macs() -> int | None`: multiply-accumulates for one window, image or sample (streaming: frame); None for a model that
  only compares.

What depends on the kind of input
---------------------------------
* Windows: `fit(train, validation, *, seed, device="auto", progress=None)`; each part is (x, y), x (n, frames, elements)
  in ADC counts and y (n, outputs) in kPa (velostat_recorded: N). Losses are in units of y squared. `predict(x)` takes
  windows. `streams` is False.
* Windows of a streaming model, which has `streams` True: parts are (x, y, previous), previous (n,) the index of the
  window that ends just before each window starts, or -1. `predict(x, previous=None)` carries states along `previous`;
  `step(frame)` takes the next frame (n, elements) of n parallel streams and returns maps (n, outputs).
* Images: `fit`, `predict` and `streams` as for windows; x (n, 1, rows * cols) in 0 .. 255, y one-hot (n, classes),
  predictions probabilities. A network's losses are mean cross-entropy in nats (tactile/learning/image_classifier.py).
* Series: `fit(records, *, seed, device="auto", progress=None, base)`; records (tactile.datasets.series.Record) hold
  the training and the validation part; `base` is the folder of the saved model-0 that transfer starts from, or None.
  Losses are in mm squared. `predict(x)` takes a series (T, channels) in V and returns (T, outputs) in mm, where sample
  t uses nothing later than t. `step(x)` takes the next sample (n, channels) of n parallel streams; another number of
  streams starts anew. There is no `streams`.
* A model of windows that an experiment on series lists (`ridge`, `constant`) has no `step`: `adapted` in
  tactile/learning/series_regressors.py wraps it, with windows in mV.
"""

import importlib
from collections.abc import Mapping

from tactile.base import params


def build(key: str, spec, settings: Mapping, where: str):
    """Return the model of `tactile/models/<key>.py`, built for `spec` with its block of settings.

    Raises InputError when there is no such file or when the block does not fit its `Settings`.
    """
    return importlib.import_module(f"tactile.models.{key}").build(
        spec, **dict(params.check_model(key, settings, where))
    )
