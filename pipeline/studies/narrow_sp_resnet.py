"""SP-ResNet with fewer channels, for the size ladder."""

from torch import nn

from pipeline.base.blocks import AugmentedTraining
from pipeline.base.errors import InputError
from pipeline.learning.image_classifier import ImageClassifier
from pipeline.learning.regressors import Spec
from pipeline.learning.residual_blocks import separable_network

STEM = 64  # channels of the published network's first half


def build(spec: Spec, *, width: float, reduction: int, training: AugmentedTraining) -> ImageClassifier:
    """SP-ResNet with `width` times the published channels: at 1 the model `sp_resnet`, 99,224 parameters."""
    return ImageClassifier(lambda: network(1, spec.outputs, width, reduction), spec, training)


def network(channels: int, classes: int, width: float, reduction: int) -> nn.Sequential:
    """`residual.separable_network` with `width` times its channels, from (n, channels, rows, cols) to (n, classes).

    `reduction` is that of the attention, as far as it leaves the narrowest bottleneck a channel.
    Raises InputError for a width that leaves no channel or no whole number of them.
    """
    stem = width * STEM
    if stem < 1 or stem != int(stem):
        raise InputError(f"sp_resnet: a width of {width:g} leaves {stem:g} of {STEM} channels; take a multiple of 1/64")
    return separable_network(channels, classes, min(reduction, int(stem)), int(stem))
