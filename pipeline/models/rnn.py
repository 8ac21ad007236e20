"""Build the RNN of the LoMP paper (Table I, its reference 18): an LSTM over frames, read out from its last state."""

import torch
from pydantic import Field
from torch import nn

from pipeline.learning.regressors import TorchRegressor, zero_linear
from pipeline.learning.spec import Spec
from pipeline.settings.shared import Block, Width
from pipeline.settings.training import WindowTraining


class Settings(Block):
    """Settings of a model `rnn` in params.yaml."""

    layers: int = Field(ge=1, le=32, description="Layers of the LSTM")
    hidden: Width = Field(description="Units of a layer")
    training: WindowTraining = Field(description="How it is trained")


def build(spec: Spec, *, layers: int, hidden: int, training: WindowTraining) -> TorchRegressor:
    """Return the untrained network; LSTM 2 x 128 on (8, 25) and linear 128-400 are 263,056 parameters.

    Differs from paper: kind and sizes are "as in previous research"; here an LSTM of two layers of 128.
    """
    return TorchRegressor(lambda: _Lstm(spec, layers, hidden), spec, training)


class _Lstm(nn.Module):
    """Normalised windows (n, frames, elements) to normalised maps (n, outputs)."""

    def __init__(self, spec: Spec, layers: int, hidden: int):
        super().__init__()
        self.lstm = nn.LSTM(spec.elements, hidden, layers, batch_first=True)
        self.readout = zero_linear(hidden, spec.outputs)

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        states, _ = self.lstm(x)  # (n, frames, hidden)
        return self.readout(states[:, -1])
