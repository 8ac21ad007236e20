"""Build direct training (latent-space paper, Table I): tanh, LSTM and linear read-out, all trained on the task."""

from pydantic import Field

from tactile.learning.lstm import LstmRegressor
from tactile.learning.spec import Spec
from tactile.settings.shared import Block, Width
from tactile.settings.training import SequenceTraining


class Settings(Block):
    """Settings of a model `lstm_direct` in params.yaml."""

    units: Width = Field(description="Units of the LSTM")
    training: SequenceTraining = Field(description="How it is trained")


def build(spec: Spec, *, units: int, training: SequenceTraining) -> LstmRegressor:
    """Return the untrained LSTM; six channels and 50 units are 11,450 parameters for one output, 11,500 for two."""
    return LstmRegressor(spec, units, training, transfer=False)
