"""Direct training (latent-space paper, Table I): tanh, LSTM, linear read-out, all of it trained on the task."""

from pipeline.base.blocks import SequenceTraining, Width
from pipeline.learning.regressors import Spec
from pipeline.learning.series_regressors import LstmRegressor


def build(spec: Spec, *, units: Width, training: SequenceTraining) -> LstmRegressor:
    """Six channels and 50 units: 11,450 parameters for one output, 11,500 for two."""
    return LstmRegressor(spec, units, training, transfer=False)
