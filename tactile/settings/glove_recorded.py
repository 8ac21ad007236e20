"""Settings of glove_recorded: recorded grasps of a robot hand with tactile sensors."""

from pydantic import Field

from tactile.settings.models import Models
from tactile.settings.shared import Block, Budget, Count, Ingest, Latency, Protocol, SplitInThree, Text


class GraspWindow(Block):
    frames: Count = Field(description="Frames of a grasp that become images at most")
    stride: Count = Field(description="Frames from one image to the next")


class GloveRecorded(Block):
    ingest: Ingest = Field(description="What is asked of the recordings")
    window: GraspWindow = Field(description="Which frames become images")
    split: SplitInThree = Field(description="How grasps are divided")
    protocols: dict[Text, Protocol] = Field(description="<split>_<dataset of images>, and their seeds")
    budget: Budget
    models: Models = Field(description="The models to train, by their keys")
    latency: Latency = Field(description="How the time of a prediction is measured")
