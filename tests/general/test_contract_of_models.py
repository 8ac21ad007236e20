"""Every model keeps the promises that stages rely on: its file, its settings, fit, predict, save and load.

Models and experiments are not listed here: the files in tactile/models and tactile/experiments are, and params.yaml.
"""

import importlib
import inspect
import math
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
import torch
from builders.project import ROOT

from tactile import experiments, models
from tactile.base import params
from tactile.datasets import series
from tactile.learning import series_regressors
from tactile.learning.spec import Spec, of_images, of_series
from tactile.own import settings as own_settings
from tactile.settings.models import Models
from tactile.tasks import windows as tasks_windows

VALUES = params.load(ROOT / "params.yaml")
for own_experiment in experiments.having("log"):
    VALUES[own_experiment]["models"] |= own_settings.YARDSTICKS[experiments.module(own_experiment).KIND]
# Sizes of training, and of what is drawn from the training part, that a few windows are enough for.
TINY = {"epochs": 2, "batch_size": 8, "streams": 4, "batch": 2, "centres": 16, "trees": 3}
SAMPLES, WINDOWS, IMAGES, OBJECTS = 400, 24, 12, 4
PRESS = 4  # windows that follow one another, as in a press of touch
STOP_REASONS = {"completed", "closed_form"}
# A read-out that lies transposed in memory until it is saved: other sums, which differ in their last bits.
TRANSPOSED = ("lstm_transfer_ridge",)


def kind_of(experiment: str) -> str:
    """Return the kind of input that an experiment's models see."""
    return experiments.module(experiment).KIND


class Given(NamedTuple):
    """What `fit` and `predict` of an experiment's models are given."""

    spec: Spec
    parts: tuple  # the training and the validation part, or the one list of records of both
    inputs: np.ndarray


def tiny(block: dict) -> dict:
    """Return a model's block of settings with the sizes of TINY."""
    return {name: tiny(value) if isinstance(value, dict) else TINY.get(name, value) for name, value in block.items()}


def given_windows(spec: Spec, count: int = WINDOWS) -> Given:
    """Return windows of counts whose maps are mixtures of their last frames, in presses of PRESS windows."""
    rng = np.random.default_rng(0)
    x = rng.uniform(0, 1000, (count, spec.frames, spec.elements)).astype(np.float32)
    y = (x[:, -1] @ rng.uniform(0, 1, (spec.elements, spec.outputs))).astype(np.float32)
    window = np.arange(count, dtype=np.int32)
    part = x, y, np.where(window % PRESS, window - 1, -1)
    return Given(spec, (part, part), x)


def given_images(classes: int = OBJECTS) -> Given:
    """Return images of objects of which each lights some rows of its own."""
    spec, rng = of_images(classes), np.random.default_rng(0)
    label = np.arange(IMAGES) % classes
    x = rng.uniform(0, 60, (IMAGES, spec.rows, spec.cols))
    x[np.arange(spec.rows) % classes == label[:, None]] += 180
    part = x.reshape(IMAGES, 1, -1).astype(np.float32), np.eye(classes, dtype=np.float32)[label]
    return Given(spec, (part, part), part[0])


def given_series(spec: Spec) -> Given:
    """Return one record: voltages that are mixtures of random walks, pressed in the second half of every 20 samples."""
    rng = np.random.default_rng(0)
    y = np.cumsum(rng.normal(size=(SAMPLES, spec.outputs)), axis=0)
    x = (
        2
        + 0.01 * y @ rng.normal(size=(spec.outputs, spec.elements))
        + 0.001 * rng.normal(size=(SAMPLES, spec.elements))
    )
    sample = np.arange(SAMPLES)
    press = np.where(sample % 20 >= 10, sample // 20, -1).astype(np.int32)
    everything = np.ones(SAMPLES, dtype=bool)
    record = series.Record(x.astype(np.float32), y.astype(np.float32), everything, sample < 0.8 * SAMPLES, press)
    return Given(spec, ([record],), record.x)


def series_spec(experiment: str, base: bool) -> Spec:
    """Return the shapes of the first protocol of an experiment on series, or of the model-0 that it starts from."""
    settings, module = VALUES[experiment], experiments.module(experiment)
    task = module.task(next(iter(settings["protocols"])), settings)
    return of_series(module.task(task.base, settings) if base else task, settings["window"]["frames"])


def given(experiment: str) -> Given:
    """Return data of an experiment's shapes."""
    if kind_of(experiment) == "series":
        return given_series(series_spec(experiment, base=False))
    if kind_of(experiment) == "images":
        return given_images()
    return given_windows(tasks_windows.spec(VALUES[experiment]))


def built(experiment: str, model: str, spec: Spec, **training):
    """Return a model with its block of settings, tiny."""
    block = tiny(VALUES[experiment]["models"][model])
    if training:
        block["training"] |= training
    regressor = models.build(model, spec, block, f"{experiment}.models.{model}")
    return series_regressors.adapted(regressor, spec) if kind_of(experiment) == "series" else regressor


@pytest.fixture(scope="module")
def fit(tmp_path_factory):
    """`fit(experiment, regressor, data, **how)`: the history of a fit, of transfer from the experiment's model-0."""
    zeros: dict[str, Path] = {}

    def model_zero(experiment: str) -> Path:
        if experiment not in zeros:
            zeros[experiment] = tmp_path_factory.mktemp("zero")
            data = given_series(series_spec(experiment, base=True))
            zero = built(experiment, VALUES[experiment]["model_zero"], data.spec)
            zero.fit(*data.parts, seed=0, device="cpu", base=None)
            zero.save(zeros[experiment])
        return zeros[experiment]

    def fit(experiment: str, regressor, data: Given, **how) -> list[dict]:
        if kind_of(experiment) == "series":
            return regressor.fit(*data.parts, device="cpu", base=model_zero(experiment), **how)
        columns = None if getattr(regressor, "streams", False) else 2
        return regressor.fit(*(part[:columns] for part in data.parts), device="cpu", **how)

    return fit


def predicted(regressor, data: Given) -> np.ndarray:
    """Return a model's answers to the inputs."""
    if getattr(regressor, "streams", False):
        return regressor.predict(data.inputs, data.parts[0][2])
    return regressor.predict(data.inputs)


def cases(in_epochs: bool = False) -> list:
    """Return every (experiment, model) of params.yaml; networks of 25 elements, and of images, are slow.

    in_epochs: those alone that are trained in epochs.
    """
    return [
        pytest.param(
            experiment,
            model,
            marks=[pytest.mark.slow]
            * ("training" in block and (experiment == "touch" or kind_of(experiment) == "images")),
            id=f"{experiment}-{model}",
        )
        for experiment in VALUES["experiments"]
        for model, block in VALUES[experiment]["models"].items()
        if "training" in block or not in_epochs
    ]


def test_every_model_is_in_params_yaml_or_of_own_sensors():
    listed = {model for experiment in VALUES["experiments"] for model in VALUES[experiment]["models"]}
    assert listed == set(Models.model_fields)


@pytest.mark.parametrize("model", Models.model_fields)
def test_build_takes_settings_by_keyword_without_defaults(model):
    module = importlib.import_module(f"tactile.models.{model}")
    spec, *settings = inspect.signature(module.build).parameters.values()
    assert spec.name == "spec" and [setting.name for setting in settings] == list(module.Settings.model_fields)
    assert all(setting.kind is setting.KEYWORD_ONLY and setting.default is setting.empty for setting in settings)


@pytest.mark.parametrize(("experiment", "model"), cases())
def test_a_saved_model_predicts_the_same_and_a_seed_gives_the_same_bytes(experiment, model, fit, tmp_path):
    data, files = given(experiment), {}
    for number, (name, seed) in enumerate((("first", 3), ("again", 3), ("other", 4))):
        torch.manual_seed(number)  # what a process has drawn before must not matter
        regressor = built(experiment, model, data.spec)
        history = fit(experiment, regressor, data, seed=seed)
        (tmp_path / name).mkdir()
        regressor.save(tmp_path / name)
        files[name] = {path.name: path.read_bytes() for path in (tmp_path / name).iterdir()}
    assert files["first"] == files["again"]
    assert files["first"] != files["other"] or "training" not in VALUES[experiment]["models"][model]
    assert [row["epoch"] for row in history] == list(range(1, len(history) + 1))
    assert set(history[0]) == {"epoch", "train_loss", "validation_loss", "learning_rate"}
    assert regressor.summary.stop_reason in STOP_REASONS and 1 <= regressor.summary.best_epoch <= len(history)
    answers = predicted(regressor, data)
    assert answers.shape == (len(data.inputs), data.spec.outputs) and answers.dtype == np.float32
    assert np.isfinite(answers).all()
    loaded = built(experiment, model, data.spec)
    loaded.load(tmp_path / "other")
    np.testing.assert_allclose(predicted(loaded, data), answers, rtol=0, atol=1e-4 * (model in TRANSPOSED))
    assert (loaded.parameters(), loaded.macs()) == (regressor.parameters(), regressor.macs())


@pytest.mark.parametrize(("experiment", "model"), cases(in_epochs=True))
def test_divergence_in_the_last_epoch_is_recorded(experiment, model, fit):
    """The weights become infinite between the last two epochs."""
    data = given(experiment)
    regressor = built(experiment, model, data.spec, epochs=2)

    def spoil(epoch: int, *others) -> None:
        if epoch == 1:
            with torch.no_grad():
                for weights in regressor.network.parameters():
                    weights.fill_(math.inf)

    history = fit(experiment, regressor, data, seed=0, progress=spoil)
    assert regressor.summary.stop_reason == "diverged" and regressor.summary.best_epoch < 2
    assert len(history) == 2 and math.isfinite(history[0]["train_loss"])
    assert not math.isfinite(history[1]["train_loss"] + history[1]["validation_loss"])
