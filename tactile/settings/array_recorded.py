"""Settings of array_recorded: single frames of a capacitive array under fingers, with masks of where they touch it."""

from typing import Literal

from pydantic import Field

from tactile.settings.models import Models
from tactile.settings.shared import Block, Budget, Count, Latency, Positive, Protocol, Text


class Crop(Block):
    """The square of the array that models see; neighbouring elements are averaged where they are finer."""

    rows: int = Field(ge=1, le=41, description="Rows of elements")
    cols: int = Field(ge=1, le=72, description="Columns of elements")
    pitch_mm: Positive = Field(
        description="Distance between the centres of neighbouring elements (mm): the array's own 4.8, or a multiple"
    )


class ContactIngest(Block):
    most_contacts: Count = Field(description="Most contacts of a frame that is used")


class OneFrame(Block):
    """Frames of these recordings do not follow one another, so that windows are of one frame."""

    frames: Literal[1] = Field(description="Frames of a window")
    frame_step: Literal[1] = Field(description="Frames from one frame of a window to its next")
    stride: Literal[1] = Field(description="Frames between the starts of windows")


class Label(Block):
    map_rows: Count = Field(description="Rows of a map of contact")
    map_cols: Count = Field(description="Columns of a map of contact")


class Persons(Block):
    """How persons are divided; all others train."""

    test: Count = Field(description="Persons that a fold tests on")
    validation: Count = Field(description="Persons that it validates on, those that follow")


class ArrayRecorded(Block):
    sensor: Crop = Field(description="The part of the array that models see")
    ingest: ContactIngest = Field(description="What is asked of the recordings")
    window: OneFrame = Field(description="How frames become windows")
    label: Label = Field(description="The maps of contact that models are asked for")
    split: Persons = Field(description="How many persons test and validate")
    protocols: dict[Text, Protocol] = Field(
        description="`fold_0` and so on: one-contact frames train; `two_too_0` and so on: those with two contacts, too"
    )
    budget: Budget
    models: Models = Field(description="The models to train, by their keys")
    latency: Latency = Field(description="How the time of a prediction is measured")
