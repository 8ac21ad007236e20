"""Build polynomial regression from the whole array: ridge regression on all products of the last frame's values."""

from math import comb

from pydantic import Field
from sklearn.linear_model import Ridge
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import PolynomialFeatures, StandardScaler

from tactile.learning.estimators import SklearnRegressor
from tactile.learning.spec import Spec
from tactile.settings.shared import Block, NotNegative


class Settings(Block):
    """Settings of a model `poly_array` in params.yaml."""

    degree: int = Field(ge=1, le=5, description="Highest degree of a product")
    ridge: NotNegative = Field(
        description="Weight of the squared coefficients against the squared error summed over the training windows"
    )


def build(spec: Spec, *, degree: int, ridge: float) -> SklearnRegressor:
    """Return the unfitted model; degree 2 of 25 elements gives 350 features and the intercept: 140,400 fitted numbers.

    Double touch is where it must fail: products of two elements that are not neighbours were never far from zero
    in training, so their weights are free. Clipping these products alone to their training range takes the
    double-touch RMSE of seed 0 from 57 to 16 kPa.

    Not the paper's, which calibrates each element by itself (`poly`): a stronger baseline on single touch. It sees the
    last frame alone; products of a whole window would be 20,300.
    """
    features = comb(spec.elements + degree, degree) - 1
    return SklearnRegressor(
        lambda seed: make_pipeline(
            StandardScaler(), PolynomialFeatures(degree, include_bias=False), Ridge(ridge, solver="cholesky")
        ),
        spec,
        count=lambda fitted: fitted[-1].coef_.size + fitted[-1].intercept_.size,
        macs=features - spec.elements + features * spec.outputs,  # the products, then the read-out
        last_frame=True,
    )
