"""Build the VGG-16 of the LoMP paper (Table I, its reference 20): a window's frames are the channels of one image."""

from collections.abc import Sequence

import torch
from pydantic import Field
from torch import nn

from tactile.base.errors import InputError
from tactile.learning.regressors import TorchRegressor, perceptron
from tactile.learning.residual_blocks import Convolution3x3
from tactile.learning.spec import Spec
from tactile.settings.shared import Block, Listed, Width, Widths
from tactile.settings.training import WindowTraining

CONVOLUTIONS = (2, 2, 3, 3, 3)  # per stage; 13 of the 16 layers


class Settings(Block):
    """Settings of a model `vgg` in params.yaml."""

    channels: Listed[Width] = Field(description="Width of the convolutions of each of the five stages")
    batch_norm: bool = Field(default=True, description="Whether batch normalisation follows every convolution")
    hidden: Widths = Field(default=[], description="Width of each linear layer before the last one")
    training: WindowTraining = Field(description="How it is trained")


def build(
    spec: Spec,
    *,
    channels: list[int],
    batch_norm: bool,
    hidden: Sequence[int],
    training: WindowTraining,
) -> TorchRegressor:
    """Return the untrained network.

    Channels 64, 128, 256, 512, 512 on 5x5 and linear 512-400 are 14,926,992 parameters.

    Differs from paper: pools round up, without which 5x5 elements would not survive five of them, so that 512 features
    are left, not 25,088.

    Differs from paper: in the tables one linear layer in place of VGG-16's three, and batch normalisation after every
    convolution, as in the later VGG-16 with it. As Simonyan and Zisserman (2015) have it, without normalisation and
    with two layers of 4096, it is a row of the variants.

    Raises InputError unless `channels` has one width per stage.
    """
    if len(channels) != len(CONVOLUTIONS):
        raise InputError(f"vgg: channels must give {len(CONVOLUTIONS)} widths, not {channels!r}")
    return TorchRegressor(lambda: _network(spec, channels, batch_norm, hidden), spec, training)


def _network(spec: Spec, channels: list[int], batch_norm: bool, hidden: Sequence[int]) -> nn.Sequential:
    layers = [nn.Unflatten(2, (spec.rows, spec.cols))]
    width, rows, cols = spec.frames, spec.rows, spec.cols
    for convolutions, wider in zip(CONVOLUTIONS, channels, strict=True):
        for _ in range(convolutions):
            layers += [Convolution3x3(width, wider), *([nn.BatchNorm2d(wider)] if batch_norm else []), nn.ReLU()]
            width = wider
        layers.append(nn.MaxPool2d(2, ceil_mode=True))
        rows, cols = (rows + 1) // 2, (cols + 1) // 2
    network = nn.Sequential(*layers, nn.Flatten(), *perceptron(width * rows * cols, hidden, spec.outputs))
    return network.to(memory_format=torch.channels_last)
