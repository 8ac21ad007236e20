"""Build ridge regression on the raw voltages of the last samples: the linear floor of the strain experiments."""

from pydantic import Field
from sklearn.linear_model import Ridge
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler

from tactile.learning.estimators import SklearnRegressor
from tactile.learning.spec import Spec
from tactile.settings.shared import Block, NotNegative


class Settings(Block):
    """Settings of a model `ridge` in params.yaml."""

    ridge: NotNegative = Field(
        description="Weight of the squared coefficients against the squared error summed over the training windows"
    )


def build(spec: Spec, *, ridge: float) -> SklearnRegressor:
    """Return the unfitted model."""
    return SklearnRegressor(
        lambda seed: make_pipeline(StandardScaler(), Ridge(ridge)),
        spec,
        count=lambda fitted: fitted[-1].coef_.size + fitted[-1].intercept_.size,
        macs=spec.frames * spec.elements * spec.outputs,
    )
