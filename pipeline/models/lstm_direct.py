"""Build direct training (latent-space paper, Table I): tanh, LSTM and linear read-out, all trained on the task."""

from pipeline.base.blocks import SequenceTraining, Width
from pipeline.learning.lstm import LstmRegressor
from pipeline.learning.regressors import Spec


def build(spec: Spec, *, units: Width, training: SequenceTraining) -> LstmRegressor:
    """Return the untrained LSTM; six channels and 50 units are 11,450 parameters for one output, 11,500 for two."""
    return LstmRegressor(spec, units, training, transfer=False)
