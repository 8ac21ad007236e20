"""Read lines that are laid out in another way than the product's logs: what `ingest.format` of the settings describes.

Every line becomes the line that the device would have printed in the product's own format, or a reject; all that
follows (types, ranges, order, packets) is the same for every log. Ingest, check, predict and live read through here.
"""

import codecs
import csv
import functools
import gzip
import io
import re
import zlib
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from datetime import datetime
from decimal import Decimal, InvalidOperation
from pathlib import Path
from typing import NamedTuple

from tactile.base.errors import InputError
from tactile.logs import units
from tactile.logs.formats import COLUMNS, DUPLICATE, NOT_A_NUMBER, UNIT, UNREADABLE, Format
from tactile.settings import patterns
from tactile.settings.shared import Layout

TEXT = "text"  # the separator that stands for anything between two numbers
BLOCK = 1 << 20  # bytes read at once
ABOVE = 200  # lines, of which those above the first row are left out; banners and titles are fewer
LONGEST_LINE = 1 << 24  # characters; a log without line ends must not fill the memory
LATEST = 10**18  # in the unit of a log; a time beyond is none
MOST_DIGITS = 40  # of a time in any unit
MOST_ALIKE = 10_000  # lines of one time that are spread; a clock that stands still for longer has no times
NANOSECONDS = {unit: round(size) for unit, size in units.SIZES["time"].items()}
SEEN = 1 << 14  # fields whose kind is remembered: `check` asks it of each about ten times
MOST_SAID = 1000  # different words of lines whose units are remembered
SAME_SCALE = 0.01  # by which a scale may differ from that of a unit
GZIP = b"\x1f\x8b"
BROKEN = (EOFError, gzip.BadGzipFile, zlib.error)  # what reading a damaged file by gzip raises

_LINE_END = re.compile(r"\n|\r(?=[^\r\n])")  # CR LF and LF CR end a line once
_UNREADABLE = re.compile("[^\t\x20-\x7e\xa0-\ufffc]")  # U+FFFD stands for bytes that are no text
_WHOLE = re.compile(r"[-+]?[0-9]+")
_THOUSANDS = {
    ".": re.compile(r"[-+]?[0-9]{1,3}(,[0-9]{3})+\.[0-9]+"),
    ",": re.compile(r"[-+]?[0-9]{1,3}(\.[0-9]{3})+,[0-9]+"),
}
_FLOAT = re.compile(r"[-+]?([0-9]+(\.[0-9]*)?|\.[0-9]+)([eE][-+]?[0-9]+)?")
_NAN = re.compile(r"[-+]?nan|null|none|n/a|na", re.IGNORECASE)
_WORD = re.compile(r"[^\W\d_eE]|%")  # in a line that is not of numbers alone
FRACTION = re.compile(r":[0-9]{1,2}\.[0-9]")  # of a second
_DIRECTIVES = {"Y": "[0-9]{4}", "f": "[0-9]{1,9}", "b": "[A-Za-z]{3}", "B": "[A-Za-z]{3,9}", "p": "[AaPp][Mm]"}


def _numbers(decimal: str) -> re.Pattern:
    """Return what a number looks like that is no part of a word or of a date; a unit may follow it."""
    point = re.escape(decimal)
    digits = rf"(?:[0-9]+(?:{point}[0-9]*)?|{point}[0-9]+)(?:[eE][-+]?[0-9]+)?"
    after = rf"(?!\w|{point}[0-9])|(?=(?:{units.ATTACHED})(?!\w))"
    sign = r"(?:[-+]|(?:(?<=[,;:=|])|(?<=[,;:=|] ))[-+][ \t]+)?"  # scales print blanks behind it
    return re.compile(rf"(?<![\w{point}])(?:{sign}{digits}|[-+]?(?:nan|NaN|NAN|inf))(?:{after})")


NUMBERS = {decimal: _numbers(decimal) for decimal in ".,"}
_PARTS = {decimal: re.compile(f"({number.pattern})") for decimal, number in NUMBERS.items()}


class Line(NamedTuple):
    """What one line, or one frame of several lines, came to; for a frame the number is that of its last line."""

    number: int  # from 1, of the file
    text: str  # in the product's own format, or as printed where it is rejected
    reason: str | None  # why it is rejected


def of(ingest: Mapping, name: str) -> Mapping | None:
    """Return the layout that the settings have for a log; load_cell_2.log has that of load_cell.log. None: the usual.

    ingest: the block `ingest` of an experiment.
    """
    given = ingest.get("format", {})
    return given.get(name, given.get(re.sub(r"_\d+\.log$", ".log", name)))


@contextmanager
def opened(path: Path) -> Iterator[gzip.GzipFile | io.BufferedReader]:
    """Open a log, compressed by gzip or not, which is read in parts: what it unpacks to needs no limit.

    Raises InputError where the compression is broken.
    """
    with path.open("rb") as file:
        start = file.read(2)
        file.seek(0)
        try:
            yield gzip.open(file) if start == GZIP else file
        except BROKEN as error:
            raise InputError(f"{path}: its gzip compression is broken ({error}); compress it again") from error


def line_end(text: str) -> str | None:
    """Return the character that ends the lines of a text, LF or CR; None where none shows."""
    found = _LINE_END.search(text)
    return found[0] if found else None


def divided(line: str, separator: str) -> list[str]:
    """Return the columns of a line, without blanks and quotation marks around them."""
    if separator == " ":
        fields = line.split()
    elif '"' in line and len(line) < csv.field_size_limit():
        bare = line.replace("\r", " ").replace("\n", " ")  # which csv takes for the end of a row
        fields = next(csv.reader([bare], delimiter=separator, skipinitialspace=True))
    else:
        fields = line.split(separator)
    return [field.strip(" \t'\"") for field in fields]


def numbers(line: str, separator: str, decimal: str) -> list[str]:
    """Return the columns of a line as text with a decimal point; with TEXT as separator, the numbers in it."""
    fields = NUMBERS[decimal].findall(line) if separator == TEXT else divided(line, separator)
    if separator == "," == decimal:  # 0,5,2,46 is 0.5 and 2.46: every number has decimals
        return [".".join(fields[k : k + 2]) for k in range(0, len(fields), 2)]
    return [with_point(field, decimal) for field in fields]


def with_words(line: str, separator: str, decimal: str) -> tuple[list[str], tuple[str, ...]]:
    """Return the columns of a line as `numbers` does, and the words in it, as `beside` takes them."""
    if separator == TEXT:
        parts = _PARTS[decimal].split(line)
        return [with_point(number, decimal) for number in parts[1::2]], tuple(parts[::2])
    fields = numbers(line, separator, decimal)
    if not _WORD.search(line):
        return fields, ()
    return fields, tuple("" if is_number(field) or is_missing(field) else field for field in fields)


def beside(words: tuple[str, ...], separator: str) -> Sequence[units.Beside]:
    """Return the words beside each column of a line; words: of `with_words`, () where there are none."""
    if separator == TEXT or not words:
        return units.beside(words or ("",))
    gaps = [""]
    for word in words:  # a word that is a column stands between the numbers beside it
        gaps[-1] += f",{word}," if word else ""
        gaps += [] if word else [""]
    found = iter(units.beside(tuple(gaps)))
    return [units.NOTHING if word else next(found) for word in words]


@functools.lru_cache(SEEN)
def with_point(field: str, decimal: str) -> str:
    """Return a number's text with a decimal point and without signs between thousands."""
    if " " in field or "\t" in field:  # behind its sign
        field = field[0] + field[1:].lstrip(" \t")
    if _THOUSANDS[decimal].fullmatch(field):
        field = field.replace("," if decimal == "." else ".", "")
    return field.replace(",", ".") if decimal == "," else field


@functools.lru_cache(SEEN)
def is_number(field: str) -> bool:
    """Tell whether a field is a finite number."""
    return _FLOAT.fullmatch(field) is not None


@functools.lru_cache(SEEN)
def is_missing(field: str) -> bool:
    """Tell whether a field is empty or says that there is no value."""
    return not field or _NAN.fullmatch(field) is not None


def is_header(fields: list[str]) -> bool:
    """Tell whether the columns of a line are words, one at least, and no numbers."""
    return any(re.search("[^\\W\\d_]", field) for field in fields) and not any(map(is_number, fields))


def _bare(names: list[str]) -> set[str]:
    """Return names of columns without units in brackets."""
    return {re.sub(r"\s*[\[(].*", "", name).lower() for name in names} - {""}


def expression(pattern: str) -> str:
    """Return the regular expression of what a pattern of strptime can stand for, as `moment` reads it."""
    parts = re.split(r"%(.)", pattern)
    fixed = (re.escape(part) if k % 2 == 0 else _DIRECTIVES.get(part, "[0-9]{1,2}") for k, part in enumerate(parts))
    found = "".join(fixed).replace(rf"\.{_DIRECTIVES['f']}", rf"(?:\.{_DIRECTIVES['f']})?")
    return found if "%f" in pattern else rf"{found}(?!\.?[0-9])"  # of 10:00:05.2 also not 10:00:0


def moment(stamp: str, pattern: str) -> datetime | None:
    """Return the time that a text is by a pattern of strptime, or None where it is none.

    Behind a point the fraction of a second may be missing, as `isoformat` and workbooks have it at whole seconds.
    """
    if ".%f" in pattern and not FRACTION.search(stamp):
        pattern = pattern.replace(".%f", "")
    try:
        return datetime.strptime(without_nanoseconds(stamp), pattern)
    except ValueError:
        return None


def without_nanoseconds(stamp: str) -> str:
    """Return the text of a time with six digits of its second at most, which is what strptime takes."""
    return re.sub(r"([.,][0-9]{6})[0-9]+", r"\1", stamp)


class Copies:
    """Tells whether lines of one time that are alike are one line, printed again.

    Lines of one time follow each other as those of two times do: a sensor at rest may print equal readings as often in
    one time as in two. So they are copies where, in one time, far more lines are alike, or hardly any line changes that
    should. Without a change in the readings of a log nothing tells it, and all lines count.
    """

    FEWEST = 20  # lines that follow one of another time
    EXPECTED = 5.0  # changes within times, by those from one time to the next: by chance none comes in 1 of 150 logs
    CHANGED = 0.05  # of these; as many come where a copy was torn
    BEYOND = 5.0  # times as many lines alike as by chance

    def __init__(self) -> None:
        self._lines, self._alike = [0, 0], [0, 0]  # within a time, and from one time to the next
        self._last: list[str] | None = None

    def add(self, readings: list[list[str]]) -> None:
        """Take the readings of the lines of one time."""
        for k, (before, now) in enumerate(zip([self._last, *readings[:-1]], readings, strict=True)):
            if before is not None:
                self._lines[k == 0] += 1
                self._alike[k == 0] += before == now
        self._last = readings[-1]

    @property
    def found(self) -> bool:
        """Tell whether the lines so far show copies."""
        (within, across), (alike, alike_across) = self._lines, self._alike
        if across < self.FEWEST:
            return False
        expected = within * (1 - alike_across / across)
        none_changes = expected >= self.EXPECTED and within - alike <= self.CHANGED * expected
        return none_changes or alike > self.BEYOND * within * (alike_across + 1) / (across + 1)


class Reader:
    """Takes the bytes of one log as they come and gives its lines."""

    def __init__(self, layout: Mapping, fmt: Format, where: str):
        """layout: as of `settings.shared.Layout`; fmt: of the lines to give; where: a sentence about the log begins so.

        Raises InputError for scales or offsets that are not as many as the columns.
        """
        self.layout, self.format, self.where = Layout.model_validate(layout), fmt, where
        given = self.layout
        self._decode = codecs.getincrementaldecoder(given.encoding)("replace").decode
        self._rest, self._number, self._count, self._begun = "", 0, 0, False
        self._end: str | None = None  # of lines
        self._strip = [patterns.compiled(pattern) for pattern in given.strip]
        self._begins = None if given.frame_begins is None else patterns.compiled(given.frame_begins)
        self._blanks = " \t" if given.separator == TEXT else f" \t{given.separator}"
        self._timed = given.rate_hz is None and (self._begins is None or not self._begins.groups)  # a line has its time
        self._searched = None  # what the time looks like, where it is found anywhere in a line
        if given.time_pattern is not None and "time" not in given.model_fields_set:
            self._searched = re.compile(rf"(?<![0-9]){expression(given.time_pattern)}")
        self._time_at = fmt.names.index(fmt.time)
        self._readings = [column for column in fmt.columns if column.name != fmt.time]
        self._unit = NANOSECONDS[fmt.columns[self._time_at].unit]
        self._linear = list(zip(*map(self._of_each, (given.scale, given.offset)), strict=True))
        self._wanted = self._names()
        self._named = not self._wanted  # the places of columns with names are known
        self._places: list[int] | None = None  # of the readings; None: not known yet
        self._time_place: int | None = None
        if not self._wanted:
            self._places = self._by_number()
            self._time_place = given.time - 1 if self._field_of_time and isinstance(given.time, int) else None
        self._width = given.width
        self._above: list[tuple[int, list[str]]] = []  # number and fields of the lines above the first row, of words
        self._frame: list[tuple[int, str, list[str]]] = []  # number, text and fields of the lines of a frame so far
        self._frame_time: str | None = None
        self._frame_over = False  # a whole frame was taken, and the next has not begun
        self._previous: list[str | None] = [None] * len(self._readings)
        self._run = [0] * len(self._readings)  # rows in which each reading was missing, up to the last row
        self.filled, self.longest = self._run.copy(), self._run.copy()  # such rows in all, and in a row
        self._alike: list[tuple[int, str, Decimal, list[str]]] = []  # lines of one time, while they may be spread
        self.copies = Copies()
        self._rounded = False  # their time, which was not cut
        self._before: Decimal | None = None  # time of those before
        self._days = 0
        self._last_s: Decimal | None = None
        self._zero: int | None = None  # 1970 in the unit of the time
        self._units: tuple[str | None, ...] = ()  # that stand with the time and the readings of the first row
        self._units_line = 0
        self._said: dict[tuple[str, ...], tuple[str | None, ...]] = {}  # words of a line -> units

    @property
    def _field_of_time(self) -> bool:
        """Tell whether the time is a column of each line."""
        return self._timed and self._searched is None

    def _of_each(self, given: float | list[float]) -> list[float]:
        """Return a factor or summand for each reading."""
        each = given if isinstance(given, list) else [given] * len(self._readings)
        if len(each) != len(self._readings):
            raise InputError(
                f"{self.where}: its format in the settings has {len(each)} scales or offsets for "
                f"{len(self._readings)} readings; write one number, or one for each reading"
            )
        return each

    def _names(self) -> set[str]:
        """Return the names of columns that a header must have."""
        columns = self.layout.columns or []
        ends = columns if isinstance(columns, list) else columns.split("..")
        names = {end for end in ends if isinstance(end, str) and not (isinstance(columns, str) and end.isdecimal())}
        return names | ({self.layout.time} if isinstance(self.layout.time, str) and self._field_of_time else set())

    def _by_number(self) -> list[int] | None:
        """Return the places of the readings where the layout has numbers; None: all columns but the time."""
        columns = self.layout.columns
        if columns is None:
            return None
        if isinstance(columns, str):
            first, last = map(int, columns.split(".."))
            self._check_count(max(0, last - first + 1))
            columns = list(range(first, last + 1))
        self._check_count(len(columns))
        return [column - 1 for column in columns if isinstance(column, int)]  # none is a name

    def _check_count(self, count: int) -> None:
        if count != len(self._readings):
            raise InputError(
                f"{self.where}: its format in the settings names {count} columns, but the sensor has "
                f"{len(self._readings)} readings; name as many, or fix the sensor's size"
            )

    def take(self, data: bytes, last: bool = False) -> list[Line]:
        """Return the lines that are whole with these bytes; last: the log ends with them.

        Raises InputError where a header lacks a column that the layout names.
        """
        try:
            self._rest += self._decode(data, last)
        except UnicodeError as error:
            raise InputError(
                f"{self.where}: is not {self.layout.encoding} ({error}); fix encoding in its format"
            ) from error
        if self._end is None:
            self._end = line_end(self._rest)
            if self._end is None and not last and len(self._rest) <= LONGEST_LINE:
                return []
            self._end = self._end or "\n"
        *lines, self._rest = self._rest.split(self._end)
        if len(self._rest) > LONGEST_LINE:
            raise InputError(f"{self.where}: no line end within {LONGEST_LINE >> 20} MiB; end each frame by a line end")
        if last and self._rest:
            lines, self._rest = [*lines, self._rest], ""
        taken = [line for text in lines for line in self._line(text.strip("\r\n\ufeff"))]
        if last:
            taken += [*self._torn(), *self._spread(None)]
        return taken

    def given_up(self, longest: int) -> str:
        """Return what has come without a line end, and forget it, where it has more than `longest` characters."""
        if len(self._rest) <= longest:
            return ""
        given_up, self._rest = self._rest, ""
        return given_up

    def _line(self, text: str) -> Iterator[Line]:
        """Yield what follows from one more line."""
        self._number += 1
        if not self._begun and self._number <= ABOVE and is_header(names := self._fields(text)):
            self._above.append((self._number, names))
        if self._number <= self.layout.skip_lines:
            return
        line = text
        for pattern in self._strip:
            line = pattern.sub("", line)
        line = line.strip(" \t" if self._wanted else self._blanks)
        if self._begins is not None and (begins := self._begins.fullmatch(line)):
            yield from self._torn()
            self._frame_time = with_point(begins[1], self.layout.decimal) if self._begins.groups else None
            self._frame_over = False
            return
        if not line.strip(self._blanks):
            return
        if _UNREADABLE.search(line):
            yield from self._reject(text, UNREADABLE)
            return
        if self._wanted and self._is_header(line):
            return
        stamp = None
        if self._searched is not None:
            if (found := self._searched.search(line)) is None:
                yield from self._reject(text, NOT_A_NUMBER)
                return
            stamp = found[0]
            line = (line[: found.start()] + line[found.end() :]).replace('""', "").strip(self._blanks)
        fields, words = with_words(line, self.layout.separator, self.layout.decimal)
        if self.layout.lines_per_frame > 1:
            yield from self._of_frame(text, fields)
        else:
            yield from self._taken(self._number, text, fields, stamp, words)

    def _fields(self, text: str) -> list[str]:
        """Return the columns of a line of words; none where any text divides them."""
        if self.layout.separator == TEXT:
            return []
        for pattern in self._strip:
            text = pattern.sub("", text)
        return divided(text.strip(" \t" if self._wanted else self._blanks), self.layout.separator)

    def _check_units(self, count: int) -> None:
        """Raise InputError where the header of rows of `count` fields names another unit than that which is read.

        A factor or a unit of the time that the layout has is the user's word against that of the header.
        """
        width, given = count + (self._searched is not None), self.layout.model_fields_set
        line, names = next(((line, names) for line, names in reversed(self._above) if len(names) == width), (0, []))
        if not names or self.layout.lines_per_frame > 1:
            return
        under = any(len(above) == width and number < line for number, above in self._above)
        names, time, places = units.of_header(names, under), self._time_place, self._places
        if self._searched is not None:  # a column of its own in the header
            names.pop(next((k for k, name in enumerate(names) if units.named(name, "s") is None), 0))
        pairs = []
        if time is not None and not {"time_unit", "time_pattern"} & given:
            pairs.append((names[time], self.format.columns[self._time_at]))
        if "scale" not in given:
            places = [k for k in range(count) if k != time] if places is None else places
            pairs += [(names[place], column) for place, column in zip(places, self._readings, strict=True)]
        for name, column in pairs:
            units.check(units.named(name, column.unit), column, f"{self.where}: line {line} names the column '{name}'")

    def _units_beside(self, words: tuple[str, ...]) -> tuple[str | None, ...]:
        """Return the unit that stands with each column of a row, the time's first, as it is written; None without."""
        if words not in self._said:
            columns = [self.format.columns[self._time_at], *self._readings]
            said: list[str | None] = [None] * len(columns)
            if words:
                found = beside(words, self.layout.separator)
                places = self._places_of_readings(len(found))
                if self._time_place is not None:
                    said = units.of_columns(found, [self._time_place, *places], columns)
                else:
                    said[1:] = units.of_columns(found, places, columns[1:])
            if len(self._said) == MOST_SAID:
                self._said.clear()
            self._said[words] = tuple(said)
        return self._said[words]

    def _check_beside(self, number: int, said: tuple[str | None, ...]) -> None:
        """Raise Unit where the first row has a unit that the layout does not read it in.

        A factor of the layout stands for a unit that is not known, but has to be that of one that is.
        """
        given, kinds = self.layout.model_fields_set, set()
        for k, (text, column) in enumerate(
            zip(said, [self.format.columns[self._time_at], *self._readings], strict=True)
        ):
            if text is None:
                continue
            unit, where = units.known(text), f"{self.where}: line {number} has '{text}'"
            if k == 0 and self.layout.time_unit is None or k > 0 and "scale" not in given:
                units.check(text, column, where)
            elif k == 0 and units.quantity(text) == "time" and unit != self.layout.time_unit:
                raise units.Unit(f"{where}, but time_unit in its format is {self.layout.time_unit}; write {unit}")
            elif k > 0 and unit and units.KNOWN[unit] == units.quantity(column.unit):
                size, scale = units.factor(text, column, where), self._linear[k - 1][0]
                if size and abs(abs(scale) / size - 1) > SAME_SCALE:
                    raise units.Unit(
                        f"{where} for {column.name}, but scale in its format is {scale:g}, and of {unit} it is "
                        f"{size:.15g}; write that, or, where the word is wrong, take it out by `strip`"
                    )
            if k > 0 and column.unit in units.NO_UNIT and unit:
                kinds.add(unit)
        if len(kinds) > 1 and not isinstance(self.layout.scale, list):
            raise units.Unit(
                f"{self.where}: line {number} has readings in {' and '.join(sorted(kinds))}; write a list of `scale`, "
                "one for each reading, into the block of this log in `ingest.format`"
            )

    def _is_in_another_unit(self, said: tuple[str | None, ...]) -> bool:
        """Tell whether a row lacks a unit that the first row has; raise Unit where it has another.

        The begin of the unit is what a torn line has.
        """
        for before, now, column in zip(
            self._units, said, [self.format.columns[self._time_at], *self._readings], strict=True
        ):
            was, unit = (text and units.known(text) for text in (before, now))
            if was == unit or units.alike(was, unit) or (column.unit in units.NO_UNIT and not (was and unit)):
                continue
            if unit is None or (before and now is not None and before.startswith(now)):
                return True
            raise units.Unit(
                f"{self.where}: line {self._number} has '{now}' for {column.name}, but line {self._units_line} has "
                f"{f'{before!r}' if was else 'no unit'}; bring the readings to one unit, or divide the log there"
            )
        return False

    def _reject(self, text: str, reason: str) -> Iterator[Line]:
        """Yield a reject, but not of what stands above the first row: titles, units, the names of the columns."""
        if self._begun:
            self._check_header(self._fields(text))
        if self._begun or self._number > ABOVE:
            self._count += 1
            yield Line(self._number, text, reason)

    def _check_header(self, names: list[str]) -> None:
        """Raise InputError for a further header that shares a column with the one above the first row, and is another.

        names: the fields of a line that is no row. Columns are the same whose names are, but for what is in brackets.
        """
        if len(names) < 2 or not is_header(names):
            return
        for number, above in reversed(self._above):
            if len(above) == len(names) and above != names and _bare(above) & _bare(names):
                raise InputError(
                    f"{self.where}: line {self._number} names the columns {', '.join(names)}, but line {number} "
                    f"{', '.join(above)}; divide the log there"
                )

    def _is_header(self, line: str) -> bool:
        """Tell whether a line names the columns, and find the places of those that are wanted."""
        names = divided(line, self.layout.separator)
        if not self._wanted <= set(names):
            return False
        if twice := next((name for name in sorted(self._wanted) if names.count(name) > 1), None):
            raise InputError(f"{self.where}: line {self._number} names {twice} twice; name columns by number instead")
        columns, time = self.layout.columns, self.layout.time
        place = {name: k for k, name in enumerate(names)}
        self._time_place = (place[time] if isinstance(time, str) else time - 1) if self._field_of_time else None
        if columns is not None:
            ends = columns if isinstance(columns, list) else columns.split("..")
            places = [place[end] if end in place else int(end) - 1 for end in ends]
            self._places = places if isinstance(columns, list) else list(range(places[0], places[1] + 1))
            self._check_count(len(self._places))
        self._width, self._named = self.layout.width or len(names), True
        return True

    def check_named(self) -> None:
        """Raise InputError where no line so far named the columns that the layout has by their names."""
        if not self._named:
            names = ", ".join(sorted(self._wanted))
            raise InputError(
                f"{self.where}: no line names the column{'s' * (len(self._wanted) > 1)} {names} of its format in the "
                "settings; name them as the log does, or give their numbers"
            )

    def _of_frame(self, text: str, fields: list[str]) -> Iterator[Line]:
        """Yield the frame that a line ends, or the line where it belongs to none."""
        lines = self.layout.lines_per_frame
        width = self._width or len(self._readings) // lines
        if self._frame_over or len(fields) != width or not all(map(is_number, fields)):
            yield from self._reject(text, COLUMNS)
            return
        self._frame.append((self._number, text, fields))
        if len(self._frame) == lines:
            whole = [field for _, _, fields in self._frame for field in fields]
            self._frame, self._frame_over = [], self._begins is not None
            yield from self._taken(self._number, text, whole, self._frame_time)

    def _torn(self) -> Iterator[Line]:
        """Yield the lines of a frame that ended before it was whole."""
        self._count += bool(self._frame) and self._begun
        if self._begun:
            yield from (Line(number, text, COLUMNS) for number, text, _ in self._frame)
        self._frame = []

    def _taken(
        self, number: int, text: str, fields: list[str], stamp: str | None, words: tuple[str, ...] = ()
    ) -> Iterator[Line]:
        """Yield the row of one frame's fields; stamp: its time, where that is not among the fields; words: beside."""
        said = self._units_beside(words) if self._is_whole(fields) else None
        if self._begun and said is not None and said != self._units and self._is_in_another_unit(said):
            yield from self._reject(text, UNIT)
            return
        row = self._row(fields, stamp)
        if row is None or said is None:
            yield from self._reject(text, COLUMNS if len(fields) != self._expected() else NOT_A_NUMBER)
            return
        if not self._begun:
            self._check_units(len(fields))
            self._check_beside(number, said)
            self._units, self._units_line = said, number
        self._begun = True
        self._count += 1
        time, rounded, readings = row
        if self.layout.repeats == "refuse":
            yield Line(number, self._text(time, readings), None)
            return
        if self._alike and (time != self._alike[0][2] or len(self._alike) == MOST_ALIKE):
            yield from self._spread(time)
        self._alike.append((number, text, time, readings))
        self._rounded = rounded

    def _expected(self) -> int:
        """Return how many fields a line, or a frame, has."""
        if self.layout.lines_per_frame > 1:
            return (self._width or len(self._readings) // self.layout.lines_per_frame) * self.layout.lines_per_frame
        return self._width or len(self._readings) + self._field_of_time

    def _places_of_readings(self, count: int) -> list[int]:
        """Return the places of the readings among `count` fields."""
        return [k for k in range(count) if k != self._time_place] if self._places is None else self._places

    def _is_whole(self, fields: list[str]) -> bool:
        """Tell whether a line, or a frame, has as many fields as a row."""
        if len(fields) != self._expected() or not self._named:
            return False
        places = self._places_of_readings(len(fields))
        return len(places) == len(self._readings) and max(places) < len(fields)

    def _row(self, fields: list[str], stamp: str | None) -> tuple[Decimal, bool, list[str]] | None:
        """Return (time, whether it is rounded, readings as text) of a row, or None where the fields are no row."""
        if not self._is_whole(fields):
            return None
        values = [fields[place] for place in self._places_of_readings(len(fields))]
        for k, value in enumerate(values):
            if value and self._readings[k].words is not None:
                continue
            if is_missing(value):
                before = self._previous[k]
                if self.layout.missing != "previous" or before is None:
                    self._keep(values)
                    return None
                values[k] = before
                self.filled[k] += 1
                self._run[k] += 1
                self.longest[k] = max(self.longest[k], self._run[k])
                continue
            if not is_number(value):
                return None
            self._run[k] = 0
        if self.layout.rate_hz is not None:
            seconds = self._count / Decimal(repr(self.layout.rate_hz))
            time, rounded = self._in_unit(seconds * NANOSECONDS["s"] / self._unit), False
        else:
            stamp = stamp if self._time_place is None else fields[self._time_place]
            if stamp is None or (read := self._time(stamp)) is None or not abs(read) < LATEST:
                return None
            time = read
            rounded = "." in stamp or "e" in stamp.lower() or ".%f" in (self.layout.time_pattern or "")
        self._keep(values)
        return time, rounded, [self._reading(k, value) for k, value in enumerate(values)]

    def _keep(self, values: list[str]) -> None:
        """Keep the values of a row for gaps in the next."""
        if self.layout.missing == "previous":
            kept = zip(values, self._previous, strict=True)
            self._previous = [value if is_number(value) else before for value, before in kept]

    def _time(self, stamp: str) -> Decimal | None:
        """Return a time in the unit of the log, or None where it is none."""
        if self.layout.time_pattern is None:
            try:
                value = Decimal(stamp)
            except InvalidOperation:
                return None
            if not value.is_finite() or value.adjusted() > MOST_DIGITS:
                return None
            unit = self.layout.time_unit
            if unit is None:
                return self._in_unit(value)
            if self._zero is None:
                self._zero = units.zero(float(value), unit)
            return self._in_unit((value - self._zero) * NANOSECONDS[unit] / self._unit)
        pattern = self.layout.time_pattern
        if (read := moment(stamp, pattern)) is None:
            return None
        dated = any(directive in pattern for directive in ("%Y", "%y", "%d", "%j"))
        since = read.replace(tzinfo=None) - datetime(1970 if dated else 1900, 1, 1)
        seconds = Decimal(since.days * 86_400 + since.seconds) + Decimal(since.microseconds) / 10**6
        if not dated:  # midnight
            self._days += self._last_s is not None and seconds < self._last_s - 43_200
            self._last_s = seconds
            seconds += 86_400 * self._days
        return self._in_unit(seconds * NANOSECONDS["s"] / self._unit)

    def _in_unit(self, time: Decimal) -> Decimal:
        """Return a time as the log has it: whole, where its times are."""
        return time.to_integral_value() if self.format.columns[self._time_at].integer else time

    def _reading(self, k: int, value: str) -> str:
        """Return the text of a reading in the log's unit; of counts such as 12.0 whole, of words a number."""
        column, (scale, offset) = self._readings[k], self._linear[k]
        if column.words is not None:
            return str(column.words.setdefault(value, len(column.words)))
        falls = not self.layout.rises_when_pressed and column.name not in ("x_mm", "y_mm")
        if scale == 1 and offset == 0 and not falls:
            if column.integer and not _WHOLE.fullmatch(value) and float(value).is_integer():
                return str(int(float(value)))
            return value
        changed = float(value) * scale + offset
        changed = column.low + column.high - changed if falls else changed
        return str(round(changed)) if column.integer and abs(changed) < 2**62 else repr(changed)

    def _text(self, time: Decimal, readings: list[str]) -> str:
        """Return a row as a line of the log's format."""
        fields = [*readings[: self._time_at], format(time, "f"), *readings[self._time_at :]]
        return self.format.separator.join(fields)

    def _spread(self, following: Decimal | None) -> Iterator[Line]:
        """Yield the lines of one time, evenly over the time that they stand for; following: the next time.

        A whole number was cut, so that the lines follow it; one with decimals was rounded, so that they are around it.
        Copies are rejects.
        """
        alike, self._alike = self._alike, []
        if not alike:
            return
        time = alike[0][2]
        self.copies.add([readings for *_, readings in alike])
        if self.copies.found:
            before, copied = None, []
            for line in alike:
                if line[3] == before:
                    yield Line(line[0], line[1], DUPLICATE)
                else:
                    copied.append(line)
                before = line[3]
            alike = copied
        steps = [abs(one - time) for one in (following, self._before) if one is not None and one != time]
        step, many = min(steps, default=Decimal(0)), len(alike)
        self._before = time
        for k, (number, _, _, readings) in enumerate(alike):
            part = step * (2 * k - (many - 1) * self._rounded) / (2 * many)
            yield Line(number, self._text(self._in_unit(time + part), readings), None)


def lines(path: Path, layout: Mapping, fmt: Format) -> Iterator[list[Line]]:
    """Yield the lines of a log, block by block; errors as `Reader`."""
    yield from _read(path, Reader(layout, fmt, str(path)))


def filled(path: Path, layout: Mapping, fmt: Format) -> dict[str, tuple[int, int]]:
    """Return reading -> in how many rows it is the one before, and in how many in a row at most; errors as `Reader`."""
    reader = Reader(layout, fmt, str(path))
    for _ in _read(path, reader):
        pass
    names = (column.name for column in fmt.columns if column.name != fmt.time)
    found = zip(names, reader.filled, reader.longest, strict=True)
    return {name: (count, longest) for name, count, longest in found if count}


def _read(path: Path, reader: Reader) -> Iterator[list[Line]]:
    """Yield what a reader makes of the lines of a log, block by block; the first one tells whether lines are copies."""
    with opened(path) as file:
        if reader.layout.repeats == "spread":
            first = Reader(reader.layout.model_dump(exclude_unset=True), reader.format, reader.where)
            first.take(file.read(BLOCK))
            file.seek(0)
            reader.copies = first.copies
        while block := file.read(BLOCK):
            yield reader.take(block)
    yield reader.take(b"", last=True)
    reader.check_named()


def printed_lines(path: Path) -> Iterator[bytes]:
    """Yield the lines of a log as they are in the file, one after the other, with their ends: LF, CR, or both."""
    with opened(path) as file, io.TextIOWrapper(file, encoding="latin-1", newline="") as text:
        for line in text:
            yield line.encode("latin-1")
