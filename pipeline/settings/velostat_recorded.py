"""Settings of velostat_recorded: recordings of a Velostat taxel under a load cell."""

from typing import Literal

from pydantic import Field

from pipeline.settings.models import Models
from pipeline.settings.shared import Block, Budget, Fraction, Ingest, Latency, Protocol, Window


class Sensor(Block):
    rows: Literal[1] = Field(description="Rows of elements")
    cols: Literal[1] = Field(description="Columns of elements")


class Label(Block):
    """What models are asked for, a map of one cell."""

    map_rows: Literal[1] = Field(description="Rows of a map")
    map_cols: Literal[1] = Field(description="Columns of a map")


class LastPart(Block):
    validation: Fraction = Field(description="Share of each training recording, its end")


class Protocols(Block):
    """The first capture (exp1) of recordings trains, their second (exp2) tests."""

    repetition: Protocol = Field(description="All recordings together")
    pike1: Protocol = Field(description="The recording pike1 alone")
    pike1_force_1: Protocol = Field(description="The recording pike1_force_1 alone")
    pike1_force_5: Protocol = Field(description="The recording pike1_force_5 alone")
    pike1_force_10: Protocol = Field(description="The recording pike1_force_10 alone")
    pike1_force_20: Protocol = Field(description="The recording pike1_force_20 alone")
    pike1_force_30: Protocol = Field(description="The recording pike1_force_30 alone")
    pike1_force_40: Protocol = Field(description="The recording pike1_force_40 alone")
    pike5_force_20: Protocol = Field(description="The recording pike5_force_20 alone")


class VelostatRecorded(Block):
    sensor: Sensor = Field(description="The taxel")
    ingest: Ingest = Field(description="What is asked of the recordings")
    window: Window = Field(description="How readings are cut into windows")
    label: Label = Field(description="What models are asked for")
    split: LastPart = Field(description="What of a training recording validates")
    protocols: Protocols = Field(description="Which recordings train and test, and the seeds")
    budget: Budget
    models: Models = Field(description="The models to train, by their keys")
    latency: Latency = Field(description="How the time of a prediction is measured")
