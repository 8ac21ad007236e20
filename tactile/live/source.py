"""Turn what a sensor prints into readings: its lines one by one, and a recorded log as if it were printed now."""

import time
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from tactile import experiments
from tactile.base.errors import InputError
from tactile.experiments import sensor_format
from tactile.inference.card import Card
from tactile.logs import layout, parse
from tactile.logs.formats import Format

LONGEST_LINE = 1 << 16  # bytes of a line, at least; more without a line end are thrown away: a wrong baud rate
LONGEST_COLUMN = 64  # bytes of a column, its separator, blanks and words beside it included
RESET_LINES = 3  # in order, but before the lines so far: the device was reset, as in parse.order after a banner
OTHER_ARRAY_LINES = 20  # with as many other columns, and none before that fits: the model is of another sensor
LONGEST_WAIT_S = 2.0  # of a replay, for the next line: a wrong time in a log must not stop it
WAIT_S = 0.05  # how soon a replay that waits sees that it is to end


class Reading(NamedTuple):
    """One line of the sensor."""

    t_s: float  # on its clock
    values: np.ndarray  # (columns,) in the unit of the card
    restarted: bool  # its clock started anew with this line


def line_format(card: Card) -> Format:
    """Return the format of the lines that a model's sensor prints; InputError for data that no device prints."""
    fmt = sensor_format(card.experiment, card.reading)
    if fmt is None:
        raise InputError(
            f"{card.title}: is of recordings that are no log of lines; take a model of touch, strain or glove"
        )
    return fmt


def line_layout(card: Card) -> Mapping | None:
    """Return the layout of the lines that a model's sensor prints, None for the usual one."""
    log, *_ = experiments.module(card.experiment).formats(card.reading)
    return layout.of(card.reading.get("ingest", {}), log)


class Lines:
    """Takes bytes as they come and gives readings; counts the lines that are none, by the reasons of `ingest`.

    `parse.order` looks ahead to tell a reset from a line that is late. Here nothing is known of the lines to come: a
    line that is not later than the last good one is rejected, until RESET_LINES of them follow each other in order, or
    one comes after a banner or an interruption. A header, whenever it comes, says in which order the columns are from
    there on; until then they are in the format's.
    """

    def __init__(self, fmt: Format, name: str, who: str, order: Sequence[int] = (), laid_out: Mapping | None = None):
        """fmt: of the lines; name: what they come from; who: the model, for a sentence about another sensor.

        order: numbers of the printed values in the order in which the model takes them; () where it is the same;
        laid_out: the layout of the lines, as of `layout.of`.
        """
        self._laid_out, self._reader = laid_out, laid_out and layout.Reader(laid_out, fmt, name)
        self.format, self.name, self.who, self.order = fmt, name, who, list(order)
        self._printed, self._places = fmt, list(range(len(fmt.columns)))  # as printed, and where each column is then
        self.count, self.rejects, self.rejected = 0, Counter(), ""  # rejected: the last such line
        self.longest = max(LONGEST_LINE, LONGEST_COLUMN * len(fmt.columns))  # bytes of a line
        self._rest, self._separator, self._second = b"", fmt.separator.encode(), parse.second(fmt)
        self._header = b""  # the latest line that named the columns
        self._time = fmt.names.index(fmt.time)
        self._last: float | None = None  # time of the last good line, s
        self._late: list[float] = []  # times of the latest lines, one after the other, that are not later than _last
        self._interrupted = False
        self._printed_times: list[float] = []  # of the last three good lines
        self._turns = 0  # us that the clock has gone on since it began anew
        self._columns = Counter()  # of the first lines that have another number of them

    @property
    def head(self) -> bytes | None:
        """What a log that begins now must have above its first line: the names of the columns, where a line said them.

        None where that is not known: of a layout that skips lines, or knows the columns by their names.
        """
        if self._reader is not None:
            return None if self._reader.layout.skip_lines or self._reader._wanted else b""
        return self._header.rstrip(b"\r") + b"\n" if self._header else b""

    def take(self, data: bytes | None) -> list[Reading]:
        """Return the readings that are whole with these bytes; None: the device vanished, what it had begun is lost.

        Raises InputError where the lines are those of another sensor, or name other columns.
        """
        if self._reader is not None:
            return self._take_laid_out(data)
        if data is None:
            lines, self._rest, self._interrupted = [self._rest] if self._rest else [], b"", True
        else:
            *lines, self._rest = (self._rest + data).split(b"\n")
            if len(self._rest) > self.longest:
                lines, self._rest = [*lines, self._rest], b""
        return [reading for reading in map(self._reading, lines) if reading is not None]

    def _take_laid_out(self, data: bytes | None) -> list[Reading]:
        """Return `take` for lines of another layout; a frame or a time that a break cuts is lost."""
        if data is None:
            self._reader, self._interrupted = layout.Reader(self._laid_out, self.format, self.name), True
            return []
        readings = []
        for line in self._reader.take(data):
            if line.reason is None:
                readings.append(self._reading(line.text.encode("ascii", "replace")))
            else:
                self.count += 1
                self._reject(line.reason, line.text.encode("utf-8"))
        if endless := self._reader.given_up(self.longest):
            self.count += 1
            self._reject(parse.UNREADABLE, endless.encode("utf-8"))
        return [reading for reading in readings if reading is not None]

    def _reading(self, line: bytes) -> Reading | None:
        """Return what a line says, or None for one that is counted as rejected or that names the columns."""
        # What ingest says of a line; 50 us for 26 columns.
        reason = parse._reason(line, self._printed) if len(line) <= self.longest else parse.UNREADABLE
        if reason == parse.TEXT and self._is_header(line) and self.count == 0:
            return None
        self.count += 1
        if reason is not None:
            self._check_columns(line, reason)
            self._interrupted |= reason == parse.TEXT
            return self._reject(reason, line)
        values = np.array(line.split(self._separator), np.float64)[self._places]
        t_s = self._unwrapped(values[self._time]) / self._second
        restarted = self._last is None
        if not restarted and t_s <= self._last:
            in_order = bool(self._late) and t_s > self._late[-1]
            self._late = [*self._late, t_s] if in_order else [t_s]
            restarted = (self._interrupted and t_s < self._last) or len(self._late) == RESET_LINES
            if not restarted:
                return self._reject(parse.DUPLICATE if t_s == self._last else parse.OUT_OF_ORDER, line)
        self._last, self._late, self._interrupted = t_s, [], False
        values = np.delete(values, self._time)
        return Reading(t_s, values[self.order] if self.order else values, restarted)

    def _unwrapped(self, time: float) -> float:
        """Return a time of which microseconds of 32 bits go on after they began anew, as `parse.unwrapped`."""
        self._printed_times = [*self._printed_times[-2:], time]
        self._turns += parse.TURN * parse.unwrapped(np.array(self._printed_times), self._second)[1]
        return time + self._turns

    def _is_header(self, line: bytes) -> bool:
        """Tell whether a line names the columns, and take their order from it.

        Raises InputError for a header of other names before the first reading; later, such a line is a torn one.
        """
        try:
            found = parse.printed(line, self.format, f"{self.name}: line {self.count + 1}")
        except InputError:
            if self._last is None:
                raise
            return False
        if found is not None:
            self._printed, self._header = found, line
            self._places = [found.names.index(name) for name in self.format.names]
        return found is not None

    def _reject(self, reason: str, line: bytes) -> None:
        self.rejects[reason] += 1
        self.rejected = line[:60].decode("ascii", errors="backslashreplace").strip()

    def _check_columns(self, line: bytes, reason: str) -> None:
        """Raise InputError once many lines, and none that fits, have the same wrong number of columns."""
        if self._last is not None or reason != parse.COLUMNS:
            return
        columns = line.count(self._separator) + 1
        self._columns[columns] += 1
        if self._columns[columns] >= max(OTHER_ARRAY_LINES, self.count / 2):  # else it is noise, of a wrong baud rate
            raise InputError(
                f"{self.name}: its lines have {columns} columns, but {self.who} takes "
                f"{len(self.format.names)} ({self.format.shown}); take a model of this sensor"
            )


def check_log(path: Path) -> None:
    """Raise InputError where there is no log to replay."""
    if not path.is_file():
        raise InputError(f"{path}: log not found; name a recorded log such as array.log")
    if not path.stat().st_size:
        raise InputError(f"{path}: the file is empty; name a recorded log such as array.log")


def replay(
    path: Path, fmt: Format, stop, speed: float = 1.0, loop: bool = False, laid_out: Mapping | None = None
) -> Iterator[bytes | None]:
    """Yield the lines of a recorded log when the device printed them, from now on; None where it starts again (`loop`).

    stop: true once the replay is to end; speed: 2 is twice as fast; laid_out: as of `Lines`. Raises InputError where
    there is no such log.
    """
    check_log(path)
    fmt = fmt if laid_out else parse.printed_format(path, fmt)
    place, separator = fmt.names.index(fmt.time), fmt.separator.encode()
    due = time.monotonic()
    while True:
        last, reader = None, laid_out and layout.Reader(laid_out, fmt, str(path))
        for line in layout.printed_lines(path):
            for row in (row.text.encode("ascii", "replace") for row in reader.take(line)) if reader else [line]:
                if parse._reason(row, fmt) is None:
                    t_s = float(row.split(separator)[place]) / parse.second(fmt)
                    due += min(max(0.0, t_s - (t_s if last is None else last)), LONGEST_WAIT_S) / speed
                    last = t_s
            while not stop and (wait := due - time.monotonic()) > 0:
                time.sleep(min(wait, WAIT_S))
            if stop:
                return
            yield line
        if not loop:
            return
        yield None
