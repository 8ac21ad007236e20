"""Build the CNN of the LoMP paper (Table I, its reference 19): a window's frames are the channels of one image."""

from pydantic import Field
from torch import nn

from tactile.learning.regressors import TorchRegressor, perceptron
from tactile.learning.spec import Spec
from tactile.settings.shared import Block, Listed, Width
from tactile.settings.training import WindowTraining


class Settings(Block):
    """Settings of a model `cnn` in params.yaml."""

    channels: Listed[Width] = Field(description="Width of each convolution")
    hidden: Listed[Width] = Field(description="Width of each hidden linear layer")
    training: WindowTraining = Field(description="How it is trained")


def build(spec: Spec, *, channels: list[int], hidden: list[int], training: WindowTraining) -> TorchRegressor:
    """Return the untrained CNN.

    Convolutions 3x3 8-32-64-64 on 5x5 and linear 1600-256-512-400 are 804,400 parameters.

    Differs from paper: sizes are "as in previous research", whose sensors are others; here chosen for 5x5 elements.
    """
    return TorchRegressor(lambda: _network(spec, channels, hidden), spec, training)


def _network(spec: Spec, channels: list[int], hidden: list[int]) -> nn.Sequential:
    layers = [nn.Unflatten(2, (spec.rows, spec.cols))]
    width = spec.frames
    for wider in channels:
        layers += [nn.Conv2d(width, wider, 3, padding=1), nn.ReLU()]
        width = wider
    return nn.Sequential(*layers, nn.Flatten(), *perceptron(width * spec.elements, hidden, spec.outputs))
