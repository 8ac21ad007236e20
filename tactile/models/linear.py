"""Build linear regression (LoMP paper, Table I): one per element, from its last reading to its block."""

from tactile.learning import per_element
from tactile.learning.estimators import SklearnRegressor
from tactile.learning.spec import Spec
from tactile.settings.shared import Block


class Settings(Block):
    """There are none."""


def build(spec: Spec) -> SklearnRegressor:
    """Return the unfitted model; a weight and a constant for each of 400 outputs are 800 fitted numbers.

    Differs from paper: the paper does not say which frames its regressions see; here the last one.
    """
    return per_element.polynomials(spec, degree=1, ridge=0.0)
