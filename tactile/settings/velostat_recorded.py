"""Settings of velostat_recorded: touch with one element, a Velostat taxel under a load cell, as it was recorded."""

from typing import Literal

from pydantic import Field

from tactile.settings.models import Models
from tactile.settings.shared import AlignedIngest, Block, Budget, Fraction, Latency, Positive, Protocol, Text, Window


class Sensor(Block):
    rows: Literal[1] = Field(description="Rows of elements")
    cols: Literal[1] = Field(description="Columns of elements")


class TaxelIngest(AlignedIngest):
    max_touches: Literal[1] = Field(description="Most touches at once")
    highest_resistance: Positive = Field(
        description="Largest reading, which has decimals and falls when pressed; in place of the counts of touch"
    )


class Label(Block):
    """What models are asked for, a map of one cell."""

    map_rows: Literal[1] = Field(description="Rows of a map")
    map_cols: Literal[1] = Field(description="Columns of a map")


class LastPart(Block):
    validation: Fraction = Field(description="Share of each training recording, its end")


class VelostatRecorded(Block):
    sensor: Sensor = Field(description="The taxel")
    ingest: TaxelIngest = Field(description="What is asked of the recordings")
    window: Window = Field(description="How readings are cut into windows")
    label: Label = Field(description="What models are asked for")
    split: LastPart = Field(description="What of a training recording validates")
    protocols: dict[Text, Protocol] = Field(
        description="`repetition`, all recordings together, or one recording alone by its name: exp1 trains, exp2 tests"
    )
    budget: Budget
    models: Models = Field(description="The models to train, by their keys")
    latency: Latency = Field(description="How the time of a prediction is measured")
