"""Build the yardstick of the recorded strain sensors: extra trees on a hand-made difference, pressed minus at rest.

The voltages themselves say when a press began: with the largest step of the last `press` samples. The mean of the
samples after that step, minus the mean of two samples before the step (leaving one out that the step may have caught
half-way), is free of any offset. That a step happens and how long a press may last is knowledge of this experiment,
which no network is given. A prediction uses the past alone.
"""

import numpy as np
from pydantic import Field
from sklearn.base import BaseEstimator, TransformerMixin
from sklearn.ensemble import ExtraTreesRegressor
from sklearn.pipeline import make_pipeline

from tactile.base.errors import InputError
from tactile.datasets.series import Record
from tactile.learning.estimators import SklearnRegressor, tree_numbers
from tactile.learning.series_regressors import Windowed
from tactile.learning.spec import Spec
from tactile.settings.shared import Block

REST = (2, 3)  # samples before the first one after the step


class Settings(Block):
    """Settings of a model `press_difference` in params.yaml."""

    press: int = Field(
        ge=1, le=100_000, description="Samples within which the step is looked for, almost a press's length"
    )
    trees: int = Field(ge=1, le=100_000, description="Number of trees")
    min_samples_leaf: int = Field(ge=1, le=100_000, description="Fewest samples of a leaf")


def build(spec: Spec, *, press: int, trees: int, min_samples_leaf: int) -> "PressDifference":
    """Return the unfitted model.

    No multiply-accumulates: trees compare. Raises InputError where windows are too short for `press`.
    """
    needed = press + max(REST)
    if press < 1 or needed > spec.frames:
        raise InputError(
            f"press_difference: press is {press}, which needs windows of {needed} samples, but they have "
            f"{spec.frames}; raise window.frames or lower press"
        )
    estimator = SklearnRegressor(
        lambda seed: make_pipeline(
            Difference(press, spec.elements),
            ExtraTreesRegressor(trees, min_samples_leaf=min_samples_leaf, random_state=seed, n_jobs=1),
        ),
        spec,
        count=lambda fitted: tree_numbers(fitted[-1].estimators_),
        macs=None,
        trusted=("tactile.models.press_difference.Difference", "sklearn.tree._tree.Tree"),
    )
    return PressDifference(estimator, spec)


class PressDifference(Windowed):
    """Windowed trees that are fitted without the first half of every press, where the arm is still moving down."""

    def fit(self, records: list[Record], **options) -> list[dict]:
        """Fit to the second half of every press; arguments and result as for Windowed.fit."""
        late = [record._replace(counted=record.counted & ~_first_half(record.press)) for record in records]
        return super().fit(late, **options)


class Difference(TransformerMixin, BaseEstimator):
    """Mean after the largest step minus the rest level before it, (n, channels), for windows (n, frames * channels)."""

    def __init__(self, press: int, channels: int):
        self.press = press
        self.channels = channels

    def fit(self, x: np.ndarray, y=None) -> "Difference":
        """Return self: there is nothing to learn."""
        self.fitted_ = True
        return self

    def transform(self, x: np.ndarray) -> np.ndarray:
        """Return the difference (n, channels) of every window x (n, frames * channels)."""
        newest_first = x.reshape(len(x), -1, self.channels)[:, ::-1].astype(np.float64)
        steps = np.square(newest_first[:, : self.press] - newest_first[:, 1 : self.press + 1]).sum(2)
        first = steps.argmax(1)  # how long ago the first sample after the step was
        every = np.arange(len(x))
        rest = np.mean([newest_first[every, first + before] for before in REST], axis=0)
        # The first sample after the step may be half-way, too: it counts only where it is the newest.
        after = np.arange(self.press) <= np.maximum(first - 1, 0)[:, None]
        pressed = np.einsum("nk,nkc->nc", after, newest_first[:, : self.press]) / after.sum(1, keepdims=True)
        return pressed - rest


def _first_half(press: np.ndarray) -> np.ndarray:
    """Return (T,) bool: samples in the first half of a press; press (T,): number of the press, or negative."""
    first = np.zeros(len(press), dtype=bool)
    pressed = np.flatnonzero(press >= 0)
    _, starts, sizes = np.unique(press[pressed], return_index=True, return_counts=True)
    for start, size in zip(starts, sizes, strict=True):
        first[pressed[start : start + size // 2]] = True
    return first
