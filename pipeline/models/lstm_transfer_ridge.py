"""Build transfer with the read-out solved in one step: ridge regression on the frozen states of model-0."""

from pipeline.base.blocks import NotNegative
from pipeline.learning.lstm import LstmRegressor
from pipeline.learning.regressors import Spec

TRANSFER = True


def build(spec: Spec, *, ridge: NotNegative) -> LstmRegressor:
    """Return the model before transfer, with as many parameters as `lstm_transfer`.

    `ridge`: penalty against the mean squared error of normalised outputs.
    """
    return LstmRegressor(spec, 1, None, transfer=True, ridge=ridge)
