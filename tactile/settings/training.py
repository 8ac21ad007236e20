"""Recipes by which networks are trained: the block `training` of a model."""

from typing import Annotated, Literal

from pydantic import Field, model_validator

from tactile.settings.shared import Block, Count, CountOrNone, Fraction, OrAbsent, Positive, Share

LearningRate = Annotated[float, Field(ge=1e-9, le=10)]


class Faults(Block):
    """What goes wrong with the readings that a network is trained on, see learning/faults.py.

    Each window, stretch of a series, press of a stream or image of a batch has faults of its own.
    """

    dead: Fraction = Field(description="Probability that an element is dead, so their mean share")
    gain: Annotated[float, Field(ge=0, le=3)] = Field(description="Spread of log gain between elements")
    offset: Fraction = Field(description="Spread of offsets between elements, share of the range")

    @model_validator(mode="after")
    def _is_a_fault(self) -> "Faults":
        if not (self.dead or self.gain or self.offset):
            raise ValueError("dead, gain and offset are all 0; give one of them, or leave the block out")
        return self


WithFaults = Annotated[
    Faults, Field(description="Faults drawn anew in every batch; without this key, readings are as they are")
]


class ScheduledTraining(Block):
    """A set number of epochs over which the learning rate rises and falls to zero, see `training.Schedule`.

    What comes out of products in bfloat16 is bfloat16, too; weights, the optimiser's sums and all predictions are
    float32.
    """

    learning_rate: LearningRate = Field(description="Highest learning rate of Adam")
    batch_size: Count = Field(description="Inputs of an update (of a stream: presses)")
    epochs: Count = Field(description="Passes through the training part")
    precision: Literal["float32", "bfloat16"] = Field(
        default="float32",
        description="Number format of products in training; bfloat16 where the device has instructions for it",
    )
    faults: OrAbsent[WithFaults] = None


class WindowTraining(ScheduledTraining):
    """A schedule on windows, of which an epoch sees all with a touch and a share of the others, drawn anew."""

    rest_share: Share = Field(description="Share of the windows without a touch that an epoch sees")


class AugmentedTraining(ScheduledTraining):
    """A schedule on images altered anew in every epoch, see `image_classifier.ImageClassifier`."""

    flip: Fraction = Field(description="Probability that an image is mirrored (method A)")
    noise: Fraction = Field(description="Standard deviation of added noise, images being scaled to 0 .. 1 (method B)")
    affine: Fraction = Field(description="Probability that an image is shifted, turned and stretched (method C)")


class SequenceTraining(Block):
    """Training as in the latent-space paper (its authors' script): Adam on the whole series as one sequence."""

    learning_rate: LearningRate = Field(description="Learning rate of Adam at the start")
    epochs: Count = Field(description="Passes through the training part")
    drop_epoch: Count = Field(description="Epochs after which the learning rate is multiplied by `drop`")
    drop: Share = Field(description="Factor of the learning rate after `drop_epoch` epochs")
    clip: Positive = Field(description="Norm to which gradients are clipped")
    streams: Count = Field(
        description="Pieces of equal length that the series is cut into, each from a zero state; 1 in the paper, more "
        "are faster, but forget what lies before a piece"
    )
    batch: Count = Field(description="Pieces, drawn anew in every epoch, that an update sees side by side")
    faults: OrAbsent[WithFaults] = None


class StretchTraining(Block):
    """Training with Adam on random stretches of a series, each from a zero state.

    The learning rate rises and falls over the epochs (one cycle, Smith 2018). An epoch is as many stretches as cover
    the training part once.
    """

    learning_rate: LearningRate = Field(description="Highest learning rate of Adam")
    epochs: Count = Field(description="How often the stretches cover the training part")
    batch: Count = Field(description="Stretches of an update")
    length: Count = Field(description="Samples of a stretch")
    warm_up: CountOrNone = Field(description="First samples of a stretch that do not count in the loss")
    clip: Positive = Field(description="Norm to which gradients are clipped")
    faults: OrAbsent[WithFaults] = None

    @model_validator(mode="after")
    def _something_counts(self) -> "StretchTraining":
        if self.warm_up >= self.length:
            raise ValueError("warm_up should be less than length, or nothing counts")
        return self
