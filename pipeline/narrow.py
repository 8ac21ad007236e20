"""SP-ResNet with fewer channels, for the size ladder."""

from torch import nn

from pipeline.errors import InputError
from pipeline.fitting import Spec
from pipeline.image_fitting import ImageClassifier, image_training
from pipeline.residual import SeparableBlock

STEM, LAST = 64, 128  # channels of the published network


def build(spec: Spec, *, width: float, reduction: int, training: dict) -> ImageClassifier:
    """SP-ResNet with `width` times the published channels: at 1 the model `sp_resnet`, 99,224 parameters."""
    return ImageClassifier(lambda: network(1, spec.outputs, width, reduction), spec, image_training(training))


def network(channels: int, classes: int, width: float, reduction: int) -> nn.Sequential:
    """`residual.separable_network` with `width` times its channels, from (n, channels, rows, cols) to (n, classes).

    `reduction` is that of the attention, as far as it leaves the narrowest bottleneck a channel.
    Raises InputError for a width that leaves no channel or no whole number of them.
    """
    stem, last = width * STEM, width * LAST
    if stem < 1 or stem != int(stem):
        raise InputError(f"sp_resnet: a width of {width:g} leaves {stem:g} of {STEM} channels; take a multiple of 1/64")
    stem, last = int(stem), int(last)
    reduction = min(reduction, stem)
    return nn.Sequential(
        nn.Conv2d(channels, stem, 3, padding=1, bias=False),
        nn.BatchNorm2d(stem),
        nn.Hardswish(),
        nn.MaxPool2d(3, stride=2, padding=1),  # 32x32 to 16x16
        SeparableBlock(stem, stem, reduction=reduction),
        SeparableBlock(stem, stem, reduction=reduction),
        SeparableBlock(stem, last, stride=2, reduction=reduction),  # to 8x8
        SeparableBlock(last, last, reduction=reduction),
        nn.AdaptiveAvgPool2d(1),
        nn.Flatten(),
        nn.Linear(last, classes),
    )
