"""Build ridge regression on the raw voltages of the last samples: the linear floor of the strain experiments."""

from sklearn.linear_model import Ridge
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler

from pipeline.base.blocks import NotNegative
from pipeline.learning.estimators import SklearnRegressor
from pipeline.learning.regressors import Spec


def build(spec: Spec, *, ridge: NotNegative) -> SklearnRegressor:
    """Return the unfitted model.

    `ridge`: weight of the squared coefficients against the squared error summed over the training windows.
    """
    return SklearnRegressor(
        lambda seed: make_pipeline(StandardScaler(), Ridge(ridge)),
        spec,
        count=lambda fitted: fitted[-1].coef_.size + fitted[-1].intercept_.size,
        macs=spec.frames * spec.elements * spec.outputs,
    )
