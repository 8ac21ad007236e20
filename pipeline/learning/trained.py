"""The trained models of an experiment, as `train`, `train_series` and `train_images` saved them."""

import json
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from pipeline.base import params, paths
from pipeline.base.errors import InputError
from pipeline.datasets.windows import Dataset


class Trained(NamedTuple):
    """One run."""

    model: object
    failed: bool  # training diverged before any usable epoch

    def predict(self, x: np.ndarray) -> np.ndarray:
        """As the model's; NaN of a failed run."""
        return self._unless_failed(self.model.predict(x))

    def predict_windows(self, x: np.ndarray, data: Dataset, rows: np.ndarray) -> np.ndarray:
        """As the function `predict_windows`; NaN of a failed run."""
        return self._unless_failed(predict_windows(self.model, x, data, rows))

    def _unless_failed(self, predicted: np.ndarray) -> np.ndarray:
        return np.full_like(predicted, np.nan) if self.failed else predicted


def predict_windows(model, x: np.ndarray, data: Dataset, rows: np.ndarray) -> np.ndarray:
    """A model's answers to the windows x (n, frames, elements): these rows of a dataset, or what became of them.

    A model of streams carries its state from those that the others go on from.
    """
    return model.predict(x, data.previous(rows)) if model.streams else model.predict(x)


def load(values: Mapping, experiment: str, model: str, protocol: str, seed: int, spec) -> Trained:
    """The model of one run of params.yaml (`values`); spec: the shapes of the experiment's task.

    Raises InputError where the run has not been trained.
    """
    block = params.model_settings(values, experiment, model)
    built = params.build_model(model, spec, block, f"{experiment}.models.{model}")
    if experiment in params.SERIES:
        from pipeline.learning.series_regressors import adapted

        built = adapted(built, spec)
    made_by = params.training_command(experiment, model)
    folder = paths.require(paths.run_folder(experiment, model, protocol, seed), made_by)
    built.load(folder)
    try:
        failed = json.loads((folder / "fit.json").read_text(encoding="utf-8"))["best_epoch"] == 0
    except (OSError, ValueError, KeyError) as error:
        raise InputError(f"{folder / 'fit.json'}: no fit summary ({error!r}); run `{made_by}` again") from error
    return Trained(built, failed)
