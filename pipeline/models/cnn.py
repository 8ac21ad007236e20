"""Build the CNN of the LoMP paper (Table I, its reference 19): a window's frames are the channels of one image."""

from torch import nn

from pipeline.base.blocks import Widths, WindowTraining
from pipeline.learning.regressors import Spec, TorchRegressor, zero_linear


def build(spec: Spec, *, channels: Widths, hidden: Widths, training: WindowTraining) -> TorchRegressor:
    """Return the untrained CNN.

    Convolutions 3x3 8-32-64-64 on 5x5 and linear 1600-256-256-400 are 636,208 parameters.
    `channels`: width of each convolution; `hidden`: width of each hidden linear layer.

    Differs from paper: sizes are "as in previous research", whose sensors are others; here chosen for 5x5 elements.
    """
    return TorchRegressor(lambda: _network(spec, channels, hidden), spec, training)


def _network(spec: Spec, channels: list[int], hidden: list[int]) -> nn.Sequential:
    layers = [nn.Unflatten(2, (spec.rows, spec.cols))]
    width = spec.frames
    for wider in channels:
        layers += [nn.Conv2d(width, wider, 3, padding=1), nn.ReLU()]
        width = wider
    layers.append(nn.Flatten())
    width *= spec.elements
    for narrower in hidden:
        layers += [nn.Linear(width, narrower), nn.ReLU()]
        width = narrower
    return nn.Sequential(*layers, zero_linear(width, spec.outputs))
