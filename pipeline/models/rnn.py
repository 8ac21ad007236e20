"""Build the RNN of the LoMP paper (Table I, its reference 18): an LSTM over frames, read out from its last state."""

import torch
from torch import nn

from pipeline.base.blocks import Layers, Width, WindowTraining
from pipeline.learning.regressors import Spec, TorchRegressor, zero_linear


def build(spec: Spec, *, layers: Layers, hidden: Width, training: WindowTraining) -> TorchRegressor:
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
