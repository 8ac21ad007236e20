"""Build the ConvLSTM of the LoMP paper (Table I, its reference 15): an LSTM whose states are images of the sensor."""

import torch
from pydantic import Field
from torch import nn

from tactile.learning.regressors import TorchRegressor, zero_linear
from tactile.learning.spec import Spec
from tactile.settings.shared import Block, Width
from tactile.settings.training import WindowTraining


class Settings(Block):
    """Settings of a model `convlstm` in params.yaml."""

    filters: Width = Field(description="Filters of the states")
    training: WindowTraining = Field(description="How it is trained")


def build(spec: Spec, *, filters: int, training: WindowTraining) -> TorchRegressor:
    """Return the untrained ConvLSTM; 32 filters 3x3 on 5x5 (38,144) and linear 800-400 are 358,544 parameters.

    Differs from paper: sizes are "as in previous research", whose sensor is another; here chosen for 5x5 elements.
    """
    return TorchRegressor(lambda: _ConvLstm(spec, filters), spec, training)


class _ConvLstm(nn.Module):
    """Normalised windows (n, frames, elements) to normalised maps (n, outputs), read out after the last frame."""

    def __init__(self, spec: Spec, filters: int):
        super().__init__()
        self.shape = (filters, spec.rows, spec.cols)
        self.gates = nn.Conv2d(1 + filters, 4 * filters, 3, padding=1)
        self.readout = zero_linear(filters * spec.elements, spec.outputs)

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        filters, rows, cols = self.shape
        images = x.view(len(x), -1, 1, rows, cols)
        state = memory = x.new_zeros(len(x), *self.shape)
        for image in images.unbind(1):
            gates = self.gates(torch.cat([image, state], 1))
            into, forget, out = torch.sigmoid(gates[:, : 3 * filters]).chunk(3, 1)
            memory = forget * memory + into * torch.tanh(gates[:, 3 * filters :])
            state = out * torch.tanh(memory)
        return self.readout(state.flatten(1))
