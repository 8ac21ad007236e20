"""Build MobileNet, version 1, width 1.0 (Howard et al. 2017, table 1; a row of the SP-ResNet paper's Table 1)."""

from pydantic import Field
from torch import nn

from tactile.learning.image_classifier import ImageClassifier
from tactile.learning.spec import Spec
from tactile.settings.shared import Block
from tactile.settings.training import AugmentedTraining

# (channels, stride) of each pair of a 3x3 depthwise convolution, which has the stride, and a 1x1 one
PAIRS = ((64, 1), (128, 2), (128, 1), (256, 2), (256, 1), (512, 2), *[(512, 1)] * 5, (1024, 2), (1024, 1))
SHRINKING = 32  # an image's side over that of the last map


class Settings(Block):
    """Settings of a model `mobilenet` in params.yaml."""

    training: AugmentedTraining = Field(description="How it is trained")


def build(spec: Spec, *, training: AugmentedTraining) -> ImageClassifier:
    """Return the untrained network; 3,222,800 parameters on 1x32x32 images of 16 objects.

    The last pair sees maps of one pixel.

    Differs from paper: the counts printed there are those of 3x224x224 images and 1000 classes; this one sees the
    same images as every other model, which the paper may have enlarged for it.
    """
    return ImageClassifier(lambda: network(1, spec.outputs, (spec.rows, spec.cols)), spec, training)


def network(channels: int, classes: int, shape: tuple[int, int]) -> nn.Sequential:
    """Return a network from images (n, channels, *shape) to scores (n, classes).

    With 3 channels and 1000 classes it has 4,231,976 parameters.

    The average pool has a fixed size, as in Howard et al.: the printed count takes it for 1 per output.
    """
    layers = _convolution(channels, 32, 3, stride=2)
    width = 32
    for wider, stride in PAIRS:
        layers += _convolution(width, width, 3, stride, groups=width)
        layers += _convolution(width, wider, 1)
        width = wider
    last = tuple(-(-side // SHRINKING) for side in shape)
    return nn.Sequential(*layers, nn.AvgPool2d(last), nn.Flatten(), nn.Linear(width, classes))


def _convolution(inputs: int, outputs: int, kernel: int, stride: int = 1, groups: int = 1) -> list[nn.Module]:
    """Return a convolution without bias, its batch normalisation and ReLU; the map keeps its size / stride."""
    convolution = nn.Conv2d(inputs, outputs, kernel, stride, padding=kernel // 2, groups=groups, bias=False)
    return [convolution, nn.BatchNorm2d(outputs), nn.ReLU(inplace=True)]
