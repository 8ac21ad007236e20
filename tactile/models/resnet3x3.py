"""Build ResNet_3x3 (Sundaram et al. 2019, the STAG glove; SP-ResNet paper, Table 1): half of ResNet-18, 3x3 stem."""

from pydantic import Field
from torch import nn

from tactile.learning.image_classifier import ImageClassifier
from tactile.learning.residual_blocks import BasicBlock
from tactile.learning.spec import Spec
from tactile.settings.shared import Block
from tactile.settings.training import AugmentedTraining


class Settings(Block):
    """Settings of a model `resnet3x3` in params.yaml."""

    training: AugmentedTraining = Field(description="How it is trained")


def build(spec: Spec, *, training: AugmentedTraining) -> ImageClassifier:
    """Return the untrained network; 676,304 parameters on 1x32x32 images of 16 objects.

    Differs from paper: its counts are those of `trunk`. Sundaram et al. also have a dropout of channels (0.2) after
    the second block and a 1x1 convolution that joins the trunks of several frames; here there is one frame.
    """
    return ImageClassifier(lambda: network(1, spec.outputs), spec, training)


def network(channels: int, classes: int) -> nn.Sequential:
    """Return a network from images (n, channels, rows, cols) to scores (n, classes)."""
    return nn.Sequential(trunk(channels), nn.AdaptiveAvgPool2d(1), nn.Flatten(), nn.Linear(128, classes))


def trunk(channels: int) -> nn.Sequential:
    """Return a network from images (n, channels, rows, cols) to features (n, 128, rows / 4, cols / 4).

    With 1 channel it has 674,240 parameters.
    """
    return nn.Sequential(
        nn.Conv2d(channels, 64, 3, padding=1, bias=False),
        nn.BatchNorm2d(64),
        nn.ReLU(inplace=True),
        nn.MaxPool2d(3, stride=2, padding=1),  # 32x32 to 16x16
        BasicBlock(64, 64),
        BasicBlock(64, 64),
        BasicBlock(64, 128, stride=2),  # to 8x8
        BasicBlock(128, 128),
    )
