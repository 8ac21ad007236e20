"""Build SP-ResNet without its attention (SP-ResNet paper, section 2.3 and Table 1, "deleted GCAM")."""

from pydantic import Field
from torch import nn

from tactile.learning.image_classifier import ImageClassifier
from tactile.learning.residual_blocks import separable_network
from tactile.learning.spec import Spec
from tactile.settings.shared import Block
from tactile.settings.training import AugmentedTraining


class Settings(Block):
    """Settings of a model `sp_resnet_nogcam` in params.yaml."""

    training: AugmentedTraining = Field(description="How it is trained")


def build(spec: Spec, *, training: AugmentedTraining) -> ImageClassifier:
    """Return the untrained network; 90,704 parameters on 1x32x32 images of 16 objects.

    Differs from paper: as many classes as there are objects; figure 11a and the printed counts have 1000.
    """
    return ImageClassifier(lambda: network(1, spec.outputs), spec, training)


def network(channels: int, classes: int) -> nn.Sequential:
    """Return a network from images (n, channels, rows, cols) to scores (n, classes).

    With 1 channel and 1000 classes it has 217,640 parameters.
    """
    return separable_network(channels, classes)
