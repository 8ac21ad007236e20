"""A model after training: fitted in this process, saved, or loaded again."""

import time
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np

from tactile.datasets import fits

# A run's protocol and seed, and for each part of its test rows: the rows' numbers in the dataset (n,), predictions
# (n, outputs), and scores, each with its condition.
Tested = tuple[str, int, list[tuple[np.ndarray, np.ndarray, list[tuple]]]]


class Fitted(NamedTuple):
    """A model, its history (one dictionary per epoch) and the seconds that fitting took."""

    model: object
    history: list[dict]
    seconds: float

    def save(self, target: Path, settings: Mapping) -> None:
        """Write the model's own files, history.csv and fit.json to the new folder `target`; settings: its block."""
        target.mkdir(parents=True)
        self.model.save(target)
        fits.write(target, self.model, self.history, settings)


def fitted(model, *data, **fitting) -> Fitted:
    """Fit a model to `data` and return it; fitting: further arguments of its `fit`."""
    started = time.perf_counter()
    history = model.fit(*data, **fitting)
    return Fitted(model, history, time.perf_counter() - started)


class Trained(NamedTuple):
    """A model that can predict, and whether its training diverged before any usable epoch."""

    model: object
    failed: bool

    def predict(self, x: np.ndarray) -> np.ndarray:
        """Return the model's predictions; NaN of a failed run."""
        return self.unless_failed(self.model.predict(x))

    def unless_failed(self, predicted: np.ndarray) -> np.ndarray:
        """Return predictions of the model; NaN in their place for a failed run."""
        return np.full_like(predicted, np.nan) if self.failed else predicted
