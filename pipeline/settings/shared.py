"""Types and blocks that the settings of several experiments share.

Limits keep a typing error from asking for more memory or time than a machine has; each is at least ten times the
largest value of any setting here.
"""

from typing import Annotated, Literal, TypeVar

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, model_validator


class Block(BaseModel):
    """A block of settings: every key known, none missing, no value of another type, no NaN."""

    model_config = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False, frozen=True)


class SomeOf(Block):
    """A block that has one of its keys or more."""

    @model_validator(mode="after")
    def _any(self) -> "SomeOf":
        if not self.model_fields_set:
            raise ValueError(f"should have one of these keys or more: {', '.join(type(self).model_fields)}")
        return self


def without_repeats(entries: list) -> list:
    """Return the entries; ValueError where two are equal."""
    if len(set(entries)) < len(entries):
        raise ValueError("should be a list without repeats")
    return entries


Entry = TypeVar("Entry")
Listed = Annotated[list[Entry], Field(min_length=1, max_length=1000)]
Distinct = Annotated[Listed[Entry], AfterValidator(without_repeats)]

Text = Annotated[str, Field(min_length=1)]
Fraction = Annotated[float, Field(ge=0, le=1)]
Share = Annotated[float, Field(ge=1e-6, le=1)]  # a fraction above 0
Number = Annotated[float, Field(ge=-1e6, le=1e6)]
NotNegative = Annotated[float, Field(ge=0, le=1e12)]
Positive = Annotated[float, Field(ge=1e-12, le=1e12)]
RateHz = Annotated[float, Field(ge=1e-3, le=1e5)]
Count = Annotated[int, Field(ge=1, le=1_000_000)]
CountOrNone = Annotated[int, Field(ge=0, le=1_000_000)]
Frames = Annotated[int, Field(ge=1, le=10_000)]
Width = Annotated[int, Field(ge=1, le=8192)]  # units of a layer
Seed = Annotated[int, Field(ge=0, le=2**15 - 1)]  # predictions keep seeds in 16 bits
SceneNumber = Annotated[int, Field(ge=0, le=2**31)]
Specimens = Annotated[int, Field(ge=1, le=1000)]
Seeds = Distinct[Seed]


Budget = Annotated[
    Share,
    Field(description="Share of each training's epochs that is run: 1 is the recipe, less is a look at what it gives"),
]


class Protocol(Block):
    """How often one way of dividing the data is run."""

    seeds: Seeds = Field(description="One run for each; a seed sets specimen, split and a network's start")


class Split(Block):
    """Chronological shares of a recording; what is left after `train` is the test part."""

    train: Fraction = Field(description="Share before the test part")
    validation: Fraction = Field(description="Share of the training part that validates, its end")


class SplitInThree(Block):
    """Shares of all data; the rest is the test part."""

    train: Fraction = Field(description="Share that trains")
    validation: Fraction = Field(description="Share that validates")

    @model_validator(mode="after")
    def _leaves_a_test_part(self) -> "SplitInThree":
        if self.train + self.validation >= 1:
            raise ValueError("train and validation leave nothing to test on")
        return self


class Yardstick(Block):
    """The one ratio that a scene's difficulty is set by: the error of `model` over that of `over`.

    A score that is better when higher counts by what is missing to 1.
    """

    model: Text = Field(description="Model in the numerator")
    over: Text = Field(description="Model in the denominator")
    protocol: Text = Field(description="Protocol of both scores")
    condition: Text = Field(description="Condition of both scores")
    metric: Text = Field(description="Metric of both scores")
    published: Positive = Field(description="The same ratio from the paper")
    knob: Text = Field(description="Dotted key, below the experiment, of the setting that is set by it")


class Window(Block):
    """How frames are cut into windows, the inputs of the models."""

    frames: Frames = Field(description="Frames of a window")
    frame_step: Frames = Field(description="Frames from one frame of a window to its next")
    stride: Count = Field(description="Frames between the starts of windows that do not slide")
    contact_threshold_n: Positive = Field(description="Force above which the sensor is pressed (N)")


class LookBack(Block):
    """How far models of windows look back in a series."""

    frames: Frames = Field(description="Samples of a window")


class Latency(Block):
    """How the time of a prediction is measured."""

    batches: Distinct[Annotated[int, Field(ge=1, le=65_536)]] = Field(
        description="Numbers of inputs that are predicted at once"
    )
    threads: int = Field(ge=1, le=1024, description="Threads of the numerical libraries")
    warm_up: CountOrNone = Field(description="Calls before the first that counts")
    calls: Count = Field(description="Calls that count, over all rounds")
    rounds: int = Field(ge=1, le=1000, description="Rounds, in each of which all models are timed in turn")


class LineFaults(Block):
    """What goes wrong with the lines of a simulated log on a serial port."""

    torn: Fraction = Field(description="Probability that a line is cut")
    duplicated: Fraction = Field(description="Probability that a line is printed twice")
    missing: Fraction = Field(description="Probability that a line is lost")
    out_of_range: Fraction = Field(description="Probability that a line's last value is 99999")
    out_of_order: Fraction = Field(description="Probability that a line comes one place late")


class Ingest(Block):
    """What is asked of logs before they become frames."""

    max_reject_fraction: Fraction = Field(description="Largest share of a file's lines that may be rejected")


class AlignedIngest(Ingest):
    """What is asked of logs of several devices, each of which has its own clock."""

    max_clock_offset_s: Positive = Field(
        description="Largest offset between two devices' clocks that is looked for (s)"
    )
    min_correlation: Fraction = Field(description="Smallest correlation at which two devices count as aligned")
    clock: Literal["own", "shared"] = Field(
        default="own", description="Each device's own clock, or one computer's that stamps all lines"
    )
