"""Settings of a target of one's own, in the settings.yaml of a sensor: what to predict, and what to test it on."""

from typing import Literal

from pydantic import Field, field_validator, model_validator

from tactile.settings import patterns
from tactile.settings.shared import Block, OrAbsent, Place, Positive, Text

LONGEST_NAME = 255  # bytes of a file's name, on every system
PATTERNED = ("person", "day", "session")  # of which the path of a recording tells


class Target(Block):
    """What is to be predicted, and where its truth stands."""

    name: Text = Field(description="Its name, such as angle")
    kind: Literal["continuous", "class", "event"] = Field(
        description="A number, one of several names, or something that happens or not, such as a slip"
    )
    unit: str = Field(default="", description="Unit of a continuous target, such as deg")
    file: OrAbsent[Text] = Field(
        default=None, description="Log beside the sensor's that has the truth, stamped by the same clock"
    )
    column: OrAbsent[Place] = Field(default=None, description="Its column in that log, by number from 1 or by name")
    folder: OrAbsent[Literal[1, 2]] = Field(
        default=None,
        description="Level of the folder whose name is the truth, in <1>/<2>/<log>; of a continuous target, the one "
        "number in it",
    )
    window_s: OrAbsent[Positive] = Field(
        default=None, description="How far a prediction looks back (s), where not as the creep of the sensor asks"
    )

    @field_validator("file")
    @classmethod
    def _can_be_a_name(cls, given: str) -> str:
        if "\0" in given or any(len(part.encode(errors="replace")) > LONGEST_NAME for part in given.split("/")):
            raise ValueError(f"no file can have this name of {len(given)} characters; write that of a log")
        return given

    @model_validator(mode="after")
    def _has_one_source(self) -> "Target":
        if (self.file is None) == (self.folder is None) or (self.file is None) != (self.column is None):
            raise ValueError("the truth stands in `file` and `column`, or in the name of a `folder`: give one of both")
        if self.kind == "continuous" and not self.unit:
            raise ValueError("a continuous target has a `unit`, such as deg")
        if self.kind == "event" and self.folder is not None:
            raise ValueError("an event happens within a recording: name the `file` and `column` that tell when")
        return self


class Split(Block):
    """Which recordings are tested together, by a model that was trained on all others."""

    by: Literal["person", "day", "session", "recording", "time"] = Field(
        description="What a group is; time: each recording is cut into consecutive parts"
    )
    pattern: OrAbsent[Text] = Field(
        default=None,
        description="Regular expression that is searched in a recording's path <1>/<2>; what its brackets hold is the "
        "person, day or session",
    )

    @model_validator(mode="after")
    def _has_a_pattern(self) -> "Split":
        if (self.by in PATTERNED) != (self.pattern is not None):
            needs = "needs a `pattern` that finds it in the path of a recording"
            raise ValueError(f"`by: {self.by}` {needs if self.pattern is None else 'takes no `pattern`'}")
        if self.pattern is not None:
            brackets = patterns.compiled(self.pattern).groups
            if brackets != 1:
                raise ValueError(
                    f"'{self.pattern}' has {brackets} pairs of brackets; put one around what names a group"
                )
        return self


class Asked(Block):
    """A target and its test."""

    target: Target = Field(description="What is to be predicted")
    split: Split = Field(description="What it is tested on")
