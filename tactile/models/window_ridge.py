"""Build the linear yardstick of sensors of one's own: ridge regression on the statistics of windows, or on an image.

The penalty is the one of PENALTIES with the least squared error when consecutive parts of the training windows are left
out in turn: neighbours resemble one another, and would tell of each other.
"""

import numpy as np
from pydantic import Field
from sklearn.base import BaseEstimator, RegressorMixin
from sklearn.linear_model import Ridge, RidgeCV
from sklearn.model_selection import StratifiedKFold
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler

from tactile.learning.estimators import SklearnRegressor
from tactile.learning.spec import Spec
from tactile.learning.window_statistics import KINDS, PENALTIES, Statistics
from tactile.settings.shared import Block

LEAST = 1e-9  # share of an object, so that a sum is never 0


class Settings(Block):
    """Settings of a model `window_ridge` in params.yaml."""

    parts: int = Field(ge=2, le=1000, description="Parts of the training windows that are left out in turn")
    shares: bool = Field(description="Whether outputs are shares of objects: none below 0, with the sum 1")


def build(spec: Spec, *, parts: int, shares: bool) -> SklearnRegressor:
    """Return the unfitted model; fitted numbers: coefficients and intercepts."""
    columns = spec.elements * (KINDS if spec.frames > 1 else 1)
    of_slope_and_spread = 2 * spec.frames * spec.elements * (spec.frames > 1)
    return SklearnRegressor(
        lambda seed: make_pipeline(Statistics(spec.frames), StandardScaler(), CrossValidated(parts, shares)),
        spec,
        count=lambda fitted: fitted[-1].ridge_.coef_.size + fitted[-1].ridge_.intercept_.size,
        macs=columns * spec.outputs + of_slope_and_spread,
        trusted=("tactile.learning.window_statistics.Statistics", "tactile.models.window_ridge.CrossValidated"),
    )


class CrossValidated(RegressorMixin, BaseEstimator):
    """Ridge regression (n, columns) -> (n, outputs) with a penalty that consecutive parts choose."""

    def __init__(self, parts: int, shares: bool):
        self.parts = parts
        self.shares = shares

    def fit(self, x: np.ndarray, y: np.ndarray) -> "CrossValidated":
        """Fit with the penalty that is best on parts left out; of objects, each part has some images of every one.

        Where there are too few windows, or images of an object, for two parts, the penalty is the smallest.
        """
        label = y.argmax(axis=1) if self.shares else np.zeros(len(y), int)
        parts, penalty = min(self.parts, np.unique(label, return_counts=True)[1].min()), PENALTIES[0]
        if parts > 1:
            divided = list(StratifiedKFold(parts).split(x, label))
            penalty = RidgeCV(PENALTIES, cv=divided, scoring="neg_mean_squared_error").fit(x, y).alpha_
        self.ridge_ = Ridge(penalty).fit(x, y)
        return self

    def predict(self, x: np.ndarray) -> np.ndarray:
        """Return outputs (n, outputs)."""
        guess = self.ridge_.predict(x)
        if not self.shares:
            return guess
        guess = np.clip(guess, 0, None) + LEAST
        return guess / guess.sum(axis=1, keepdims=True)
