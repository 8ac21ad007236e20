"""Types and blocks that the settings of several experiments share.

Limits keep a typing error from asking for more memory or time than a machine has; each is at least ten times the
largest value of any setting here.
"""

import codecs
import contextlib
import re
import warnings
from datetime import datetime
from typing import TYPE_CHECKING, Annotated, Any, Literal, TypeAlias, TypeVar

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, field_validator, model_validator

from tactile.settings import patterns

A_LINE = "0,1.5\n"
ANY_BYTES = bytes(range(256)) + b" +2AA- \\ud800"  # the last two are half a character in UTF-7 and as Python escapes it
HALF = re.compile("[\ud800-\udfff]")


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

if TYPE_CHECKING:
    OrAbsent: TypeAlias = Entry | None
else:

    class OrAbsent:
        """The value of a key that may be left out, which makes it None; null in a file is refused."""

        def __class_getitem__(cls, kind: Any) -> Any:
            return kind


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
Widths = Annotated[list[Width], Field(max_length=100)]  # of layers, of which there may be none
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

    seeds: Annotated[list[Seed], Field(max_length=1000), AfterValidator(without_repeats)] = Field(
        description="One run for each, so an empty list is none; a seed sets specimen, split and a network's start"
    )


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


Place = Count | Text  # of a column: its number, from 1, or its name


class Layout(Block):
    """How the lines of a log are laid out, where they are not as docs/own_sensor.md has them."""

    separator: Literal[",", ";", "\t", "|", " ", "text"] = Field(
        default=",", description="What stands between two columns; text: anything, each number of a line is a column"
    )
    decimal: Literal[".", ","] = Field(default=".", description="Decimal sign")
    strip: list[Text] = Field(default=[], description="Text to remove from a line first, as regular expressions")
    skip_lines: CountOrNone = Field(default=0, description="Lines to leave out at the beginning")
    encoding: Text = Field(default="utf-8", description="Encoding of the text, by Python's names")
    time: Place = Field(default=1, description="Column of the time")
    time_unit: OrAbsent[Literal["s", "ms", "us", "ns", "min", "h", "d", "100ns"]] = Field(
        default=None, description="Unit of the time, unless the log's; 100ns: ticks of .NET and Windows"
    )
    time_pattern: OrAbsent[Text] = Field(
        default=None,
        description="Pattern of a time that is no number, such as %H:%M:%S.%f (Python's strptime); without `time` it "
        "is found anywhere in a line, and taken out before columns are counted",
    )
    rate_hz: OrAbsent[RateHz] = Field(default=None, description="Frames per second of a log without times (Hz)")
    width: OrAbsent[Count] = Field(default=None, description="Columns of a line; lines with more or fewer are rejected")
    columns: OrAbsent[Text | Annotated[list[Place], Field(min_length=1)]] = Field(
        default=None,
        description="Columns of the readings in the log's order, as a list or as 2..17, by number or by name; without "
        "it, all but the time",
    )
    scale: Number | list[Number] = Field(default=1, description="Factor of all readings, or of each, to the log's unit")
    offset: Number | list[Number] = Field(default=0, description="Added to all readings, or to each, in the log's unit")
    rises_when_pressed: bool = Field(
        default=True, description="False where readings fall when pressed: lowest + highest - reading is taken"
    )
    lines_per_frame: Count = Field(default=1, description="Lines of one frame")
    frame_begins: OrAbsent[str] = Field(
        default=None,
        description="Line that stands before each frame, as a regular expression, '' of an empty one; what its "
        "brackets hold is the time",
    )
    repeats: Literal["refuse", "spread"] = Field(
        default="refuse", description="Lines of one time: refused, or spread up to the next time"
    )
    missing: Literal["refuse", "previous"] = Field(
        default="refuse", description="Readings that are NaN or empty: refused, or the previous one of their column"
    )

    @field_validator("strip", "frame_begins")
    @classmethod
    def _is_a_pattern(cls, given: str | list[str]) -> str | list[str]:
        for pattern in [given] if isinstance(given, str) else given:
            patterns.compiled(pattern)
        return given

    @field_validator("time_pattern")
    @classmethod
    def _is_a_time(cls, given: str) -> str:
        try:
            datetime.strptime("", given)
        except re.error as error:
            raise ValueError(f"'{given}' has one directive twice, or two that say the same ({error})") from error
        except ValueError as error:
            if "does not match format" not in str(error):  # that of an empty text
                raise ValueError(f"'{given}' is no pattern of strptime ({error})") from error
        return given

    @field_validator("encoding")
    @classmethod
    def _is_known(cls, given: str) -> str:
        try:
            decoder = codecs.getincrementaldecoder(given)
        except (LookupError, ValueError) as error:
            raise ValueError(f"no encoding is called '{given}'; utf-8, utf-16 and latin-1 are") from error
        try:
            is_text = decoder("replace").decode(A_LINE.encode(given), True) == A_LINE
            with contextlib.suppress(UnicodeError), warnings.catch_warnings(action="ignore"):  # a mark
                is_text &= not any(map(HALF.match, decoder("replace").decode(ANY_BYTES, True)))
        except Exception as error:  # codecs that are no encodings of text raise what they like
            reason = str(error) or type(error).__name__
            raise ValueError(f"'{given}' is no encoding of text ({reason}); utf-8 and latin-1 are") from error
        if not is_text:
            raise ValueError(f"'{given}' is no encoding of text; utf-8 and latin-1 are")
        return given

    @model_validator(mode="after")
    def _fits_together(self) -> "Layout":
        by_number = isinstance(self.columns, list) and any(isinstance(column, int) for column in self.columns)
        by_number |= isinstance(self.columns, str) and re.fullmatch(r"\d+\.\.\d+", self.columns) is not None
        if by_number and self.width is None:
            raise ValueError("columns by number need `width`, so that a line that is cut is noticed")
        if isinstance(self.columns, str) and ".." not in self.columns:
            raise ValueError("columns are a list such as [2, 3], or the first and the last, such as 2..17")
        if self.rate_hz is not None and {"time", "time_unit", "time_pattern"} & self.model_fields_set:
            raise ValueError("rate_hz is for logs without times; remove it, or the keys that begin with time")
        return self


class Ingest(Block):
    """What is asked of logs before they become frames."""

    max_reject_fraction: Fraction = Field(description="Largest share of a file's lines that may be rejected")
    format: dict[Text, Layout] = Field(
        default={}, description="Logs that are laid out in another way, by their names such as array.log"
    )


class AlignedIngest(Ingest):
    """What is asked of logs of several devices, each of which has its own clock."""

    max_clock_offset_s: Positive = Field(
        description="Largest offset between two devices' clocks that is looked for (s)"
    )
    min_correlation: Fraction = Field(description="Smallest correlation at which two devices count as aligned")
    clock: Literal["own", "shared"] = Field(
        default="own", description="Each device's own clock, or one computer's that stamps all lines"
    )
