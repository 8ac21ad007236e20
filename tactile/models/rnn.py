"""Build the RNN of the LoMP paper (Table I, its reference 18): an LSTM over frames, read out from its last state.

One linear layer from `hidden` states draws maps of that rank alone. The labels of 400 places 3 mm apart, Gaussians of
2.5 mm, keep 27 % of their rms beyond rank 128: hence hidden layers before the last one.
"""

from collections.abc import Sequence

import torch
from pydantic import Field
from torch import nn

from tactile.learning.regressors import TorchRegressor, perceptron
from tactile.learning.spec import Spec
from tactile.settings.shared import Block, Width, Widths
from tactile.settings.training import WindowTraining


class Settings(Block):
    """Settings of a model `rnn` in params.yaml."""

    layers: int = Field(ge=1, le=32, description="Layers of the LSTM")
    hidden: Width = Field(description="Units of a layer")
    readout: Widths = Field(default=[], description="Width of each hidden layer between the last state and the map")
    training: WindowTraining = Field(description="How it is trained")


def build(spec: Spec, *, layers: int, hidden: int, readout: Sequence[int], training: WindowTraining) -> TorchRegressor:
    """Return the untrained network; LSTM 2 x 128 on (8, 25) and linear 128-512-400 are 482,704 parameters.

    Differs from paper: kind and sizes are "as in previous research"; here an LSTM of two layers of 128 and a hidden
    layer of 512 behind it, as many units as a map of 400 cells needs and more.
    """
    return TorchRegressor(lambda: _Lstm(spec, layers, hidden, readout), spec, training)


class _Lstm(nn.Module):
    """Normalised windows (n, frames, elements) to normalised maps (n, outputs)."""

    def __init__(self, spec: Spec, layers: int, hidden: int, readout: Sequence[int]):
        super().__init__()
        self.lstm = nn.LSTM(spec.elements, hidden, layers, batch_first=True)
        self.readout = perceptron(hidden, readout, spec.outputs)

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        states, _ = self.lstm(x)  # (n, frames, hidden)
        return self.readout(states[:, -1])
