"""The trained models of an experiment, as `train`, `train_series` and `train_images` saved them."""

import json
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from pipeline import params, paths
from pipeline.errors import InputError


class Trained(NamedTuple):
    """One run."""

    model: object
    failed: bool  # training diverged before any usable epoch

    def predict(self, x: np.ndarray) -> np.ndarray:
        """As the model's; NaN of a failed run."""
        predicted = self.model.predict(x)
        return np.full_like(predicted, np.nan) if self.failed else predicted


def load(values: Mapping, experiment: str, model: str, protocol: str, seed: int, spec) -> Trained:
    """The model of one run of params.yaml (`values`); spec: the shapes of the experiment's task.

    Raises InputError where the run has not been trained.
    """
    block = params.model_settings(values, experiment, model)
    built = params.build_model(model, spec, block, f"{experiment}.models.{model}")
    if experiment in params.SERIES:
        from pipeline.series_fitting import adapted

        built = adapted(built, spec)
    made_by = params.training_command(experiment, model)
    folder = paths.require(paths.run_folder(experiment, model, protocol, seed), made_by)
    built.load(folder)
    try:
        failed = json.loads((folder / "fit.json").read_text(encoding="utf-8"))["best_epoch"] == 0
    except (OSError, ValueError, KeyError) as error:
        raise InputError(f"{folder / 'fit.json'}: no fit summary ({error!r}); run `{made_by}` again") from error
    return Trained(built, failed)
