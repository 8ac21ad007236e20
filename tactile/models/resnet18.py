"""Build ResNet-18 (He et al. 2016, table 1; SP-ResNet paper, Table 1: the network that SP-ResNet makes lighter)."""

from pydantic import Field
from torch import nn

from tactile.learning.image_classifier import ImageClassifier
from tactile.learning.residual_blocks import BasicBlock
from tactile.learning.spec import Spec
from tactile.settings.shared import Block
from tactile.settings.training import AugmentedTraining


class Settings(Block):
    """Settings of a model `resnet18` in params.yaml."""

    training: AugmentedTraining = Field(description="How it is trained")


def build(spec: Spec, *, training: AugmentedTraining) -> ImageClassifier:
    """Return the untrained network; 11,178,448 parameters on 1x32x32 images of 16 objects.

    The last block sees maps of one pixel.

    Differs from paper: the counts printed there are those of 3x224x224 images and 1000 classes; this one sees the
    same images as every other model, which the paper may have enlarged for it.
    """
    return ImageClassifier(lambda: network(1, spec.outputs), spec, training)


def network(channels: int, classes: int) -> nn.Sequential:
    """Return a network from images (n, channels, rows, cols) to scores (n, classes).

    With 3 channels and 1000 classes it has 11,689,512 parameters.
    """
    layers = [
        nn.Conv2d(channels, 64, 7, stride=2, padding=3, bias=False),
        nn.BatchNorm2d(64),
        nn.ReLU(inplace=True),
        nn.MaxPool2d(3, stride=2, padding=1),
    ]
    for inputs, outputs, stride in ((64, 64, 1), (64, 128, 2), (128, 256, 2), (256, 512, 2)):
        layers += [BasicBlock(inputs, outputs, stride), BasicBlock(outputs, outputs)]
    whole = nn.Sequential(*layers, nn.AdaptiveAvgPool2d(1), nn.Flatten(), nn.Linear(512, classes))
    for layer in whole.modules():
        if isinstance(layer, nn.Conv2d):  # as in torchvision's
            nn.init.kaiming_normal_(layer.weight, mode="fan_out", nonlinearity="relu")
    return whole
