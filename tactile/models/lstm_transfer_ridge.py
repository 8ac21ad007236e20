"""Build transfer with the read-out solved in one step: ridge regression on the frozen states of model-0."""

from pydantic import Field

from tactile.learning.lstm import LstmRegressor
from tactile.learning.spec import Spec
from tactile.settings.shared import Block, NotNegative

TRANSFER = True


class Settings(Block):
    """Settings of a model `lstm_transfer_ridge` in params.yaml."""

    ridge: NotNegative = Field(description="Penalty against the mean squared error of normalised outputs")


def build(spec: Spec, *, ridge: float) -> LstmRegressor:
    """Return the model before transfer, with as many parameters as `lstm_transfer`."""
    return LstmRegressor(spec, 1, None, transfer=True, ridge=ridge)
