"""Build polynomial regression without products (LoMP paper, Table I): ridge regression on powers of single values."""

import numpy as np
from pydantic import Field
from sklearn.base import BaseEstimator, TransformerMixin
from sklearn.linear_model import Ridge
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler

from pipeline.learning.estimators import SklearnRegressor
from pipeline.learning.regressors import Spec
from pipeline.settings.shared import Block, NotNegative


class Settings(Block):
    """Settings of a model `poly_powers` in params.yaml."""

    degree: int = Field(ge=1, le=5, description="Highest power")
    ridge: NotNegative = Field(
        description="Weight of the squared coefficients against the squared error summed over the training windows"
    )


def build(spec: Spec, *, degree: int, ridge: float) -> SklearnRegressor:
    """Return the unfitted model; degree 2 of 8 frames of 25 elements gives 400 features: 160,400 fitted numbers.

    The paper does not say whether its polynomial has products. `poly` has them, and with them weights that single
    touches leave free; here two touches add up. The window's products would be 20,300 features, more than windows.
    """
    features = degree * spec.frames * spec.elements
    return SklearnRegressor(
        lambda seed: make_pipeline(StandardScaler(), Powers(degree), Ridge(ridge, solver="cholesky")),
        spec,
        count=lambda fitted: fitted[-1].coef_.size + fitted[-1].intercept_.size,
        macs=features - features // degree + features * spec.outputs,  # the powers, then the read-out
        trusted=("pipeline.models.poly_powers.Powers",),
    )


class Powers(TransformerMixin, BaseEstimator):
    """Powers 1 to `degree` of each value; x (n, inputs) to (n, degree * inputs)."""

    def __init__(self, degree: int):
        self.degree = degree

    def fit(self, x: np.ndarray, y=None) -> "Powers":
        """Return itself: there is nothing to fit."""
        return self

    def transform(self, x: np.ndarray) -> np.ndarray:
        """Return the powers side by side."""
        return np.concatenate([x**power for power in range(1, self.degree + 1)], axis=1)
