"""What the lines of a device's log hold, column by column, and the reasons why a line is none of them."""

from dataclasses import dataclass, field

import pyarrow as pa

EMPTY = "empty line"
UNREADABLE = "unreadable bytes"  # NUL, control or non-ASCII bytes: noise on the line, a wrong baud rate
TEXT = "banner or text"
COLUMNS = "column count"
NOT_A_NUMBER = "not a number"
NOT_AN_INTEGER = "not an integer"
OUT_OF_RANGE = "out of range"
DUPLICATE = "duplicate"
OUT_OF_ORDER = "out of order"
UNIT = "another unit"  # beside a reading than in the first row, or none
REPEATED = "time repeats"  # the time of the line before, with other values
REASONS = (
    *(EMPTY, UNREADABLE, TEXT, COLUMNS, NOT_A_NUMBER, NOT_AN_INTEGER),
    *(OUT_OF_RANGE, DUPLICATE, OUT_OF_ORDER, REPEATED, UNIT),
)


@dataclass(frozen=True)
class Column:
    """One column: values outside `low` to `high` (inclusive, in `unit`) cannot come from the device.

    A column of words becomes one of their numbers.
    """

    name: str
    unit: str
    low: float
    high: float
    integer: bool = False
    words: dict[str, int] | None = field(default=None, compare=False)  # word -> number, as they are met; None: none

    @property
    def type(self) -> pa.DataType:
        """Return the smallest of int16, int64 and float64 that holds the range."""
        if not self.integer:
            return pa.float64()
        return pa.int16() if -(2**15) <= self.low and self.high < 2**15 else pa.int64()


@dataclass(frozen=True)
class Format:
    """The format of one device's lines; `time` names the column with the device's clock."""

    columns: tuple[Column, ...]
    time: str
    separator: str = ","

    @property
    def names(self) -> list[str]:
        """Return the column names in the order of the line."""
        return [column.name for column in self.columns]

    @property
    def header(self) -> str:
        """Return the line that would name the columns."""
        return self.separator.join(self.names)

    @property
    def shown(self) -> str:
        """Return the header for a sentence, its middle left out where it is long."""
        return self.separator.join(self.names if len(self.names) < 7 else [*self.names[:2], "...", self.names[-1]])


def second(fmt: Format) -> float:
    """Return what a second is in the unit of a format's time."""
    return 1e6 if next(column.unit for column in fmt.columns if column.name == fmt.time) == "us" else 1.0
