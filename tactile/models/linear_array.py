"""Build linear regression from the whole array: ordinary least squares on all frames of a window."""

from sklearn.linear_model import LinearRegression
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler

from tactile.learning.estimators import SklearnRegressor
from tactile.learning.spec import Spec
from tactile.settings.shared import Block


class Settings(Block):
    """There are none."""


def build(spec: Spec) -> SklearnRegressor:
    """Return the unfitted model; 200 inputs, 400 outputs and their intercepts are 80,400 fitted numbers.

    Not the paper's, which calibrates each element by itself (`linear`): a stronger baseline.
    """
    return SklearnRegressor(
        lambda seed: make_pipeline(StandardScaler(), LinearRegression()),
        spec,
        count=lambda fitted: fitted[-1].coef_.size + fitted[-1].intercept_.size,
        macs=spec.frames * spec.elements * spec.outputs,
    )
