"""Build SP-ResNet (SP-ResNet paper, section 2.3): separable residual blocks with attention to rows and columns."""

from pydantic import Field
from torch import nn

from tactile.learning.image_classifier import ImageClassifier
from tactile.learning.residual_blocks import separable_network
from tactile.learning.spec import Spec
from tactile.settings.shared import Block
from tactile.settings.training import AugmentedTraining

CHANNELS = 64  # of the first half of the published network


class Settings(Block):
    """Settings of a model `sp_resnet` in params.yaml."""

    reduction: int = Field(ge=1, le=64, description="Channels of a block per channel of the attention's bottleneck")
    width: float = Field(
        default=1.0, ge=0.015625, le=1, multiple_of=0.015625, description="Factor of the published channels (of 64)"
    )
    training: AugmentedTraining = Field(description="How it is trained")


def build(spec: Spec, *, reduction: int, width: float, training: AugmentedTraining) -> ImageClassifier:
    """Return the untrained network.

    On 1x32x32 images of 16 objects it has 99,224 parameters at reduction 16, 106,976 at 8 and 215,504 at 1.
    A narrower one has the reduction as far as it leaves the narrowest bottleneck a channel.
    Raises InputError for a reduction below 1 and above 64.
    Differs from paper: the text does not give the reduction, and with none of them do its counts for 1000 classes
    (16.332e6 multiply-accumulates, 3.26e5 parameters) come out: the attention as Hou et al. 2021 define it gives
    12.7e6 to 14.7e6 and 2.26e5 to 3.42e5 (reduction 16 to 1). As many classes as there are objects.
    """
    return ImageClassifier(lambda: network(1, spec.outputs, reduction, width), spec, training)


def network(channels: int, classes: int, reduction: int, width: float = 1.0) -> nn.Sequential:
    """Return a network from images (n, channels, rows, cols) to scores (n, classes)."""
    stem = int(width * CHANNELS)
    return separable_network(channels, classes, reduction if width == 1 else min(reduction, stem), stem)
