"""Build polynomial regression (LoMP paper, Table I): one per element, from its last reading to its block."""

from pydantic import Field

from tactile.learning import per_element
from tactile.learning.estimators import SklearnRegressor
from tactile.learning.spec import Spec
from tactile.settings.shared import Block, NotNegative


class Settings(Block):
    """Settings of a model `poly` in params.yaml."""

    degree: int = Field(ge=1, le=5, description="Highest power of an element's last reading")
    ridge: NotNegative = Field(
        description="Weight of the squared coefficients against the squared error summed over the training windows"
    )


def build(spec: Spec, *, degree: int, ridge: float) -> SklearnRegressor:
    """Return the unfitted model; degree 3 and a constant for each of 400 outputs are 1,600 fitted numbers.

    Differs from paper: degree and regularisation are not given there; here 3 and a ridge, on the last frame alone.
    """
    return per_element.polynomials(spec, degree, ridge)
