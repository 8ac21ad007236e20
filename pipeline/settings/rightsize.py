"""Settings of the size ladders: smaller versions of a model, down to the smallest that is as good."""

from typing import Annotated

from pydantic import Field

from pipeline.settings.shared import Block, Count, Distinct, Width


class LompSizes(Block):
    sizes: Distinct[Width] = Field(description="Hidden units; the widths of the read-out scale with them")


class WindowTraining(Block):
    """What differs from the recipe of the tables, for all sizes alike."""

    epochs: Count = Field(description="Passes through the training part")


class WindowSizes(Block):
    sizes: Distinct[Count] = Field(description="Last frames of a window that the CNN sees")
    training: WindowTraining = Field(description="What differs from the recipe of the tables")


class TouchLadders(Block):
    lomp: LompSizes = Field(description="LoMP with fewer hidden units")
    window: WindowSizes = Field(description="A CNN that sees fewer frames")


class SpResnetSizes(Block):
    sizes: Distinct[Annotated[float, Field(ge=1 / 64, le=1)]] = Field(description="Factor of the published channels")


class GloveLadders(Block):
    sp_resnet: SpResnetSizes = Field(description="SP-ResNet with fewer channels")


class Rightsize(Block):
    """Size ladders, by experiment; the LSTM's is strain.study.capacity."""

    touch: TouchLadders = Field(description="Ladders of touch")
    glove: GloveLadders = Field(description="Ladders of glove")
