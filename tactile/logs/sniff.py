"""Find out how the lines of a log are laid out, and propose the block `format` of the settings that reads them.

A proposal says only what shows in the lines. What does not is a guess, and is named as one: a rate, a unit, which of
several columns is the force.
"""

import io
import itertools
import re
from collections import Counter
from collections.abc import Iterator, Sequence
from datetime import datetime
from pathlib import Path
from typing import NamedTuple

import numpy as np

from tactile.base.errors import InputError
from tactile.logs import layout, units
from tactile.logs.formats import Column, Format
from tactile.logs.units import PLAUSIBLE_S
from tactile.settings.patterns import ZONE

START, LINES = 1 << 18, 600  # bytes and lines that are looked at
SHARE = 0.8  # of the lines with a number in them that have to be alike
RISES = 0.9  # share of the lines in which a clock rises
LEAST_RISES = 2  # of a clock with few digits
CONTROL = 0.02  # share of control bytes in a log that is no text
USUAL_S = (1 / 1000, 0.2)
WIDEST_STEP_S = 0.11  # of a clock with few digits, up to which lines are spread over a step
MOST_OF_A_STEP = 20  # lines
MANY_MISSING = 0.3  # share of rows without a value: columns that are read at other times
USUAL = {"N": (0.05, 1e3), "mm": (0.2, 2e3), "V": (0.01, 10.0)}  # the largest reading of a log; of places, the motion
SMALL_M = 0.2  # an arm that moves by less than 0.2 mm moves in metres
GRAMS = (1e3, 2e5)  # what a load cell shows at most where it shows grams
MOST_BESIDE = 20  # other logs of a sensor that are asked whether day or month is first
LONGEST_STAMP = 200  # characters of a line in which its date is
LEAST_ROWS = 20  # of which a column is known to be a checksum or a part of a time
FEW_WRONG = 0.01  # share of damaged lines
TRIED = 50  # lines on which a pattern of times is tried
DATES = ("%Y-%m-%d", "%Y/%m/%d", "%d.%m.%Y", "%d/%m/%Y", "%m/%d/%Y", "%d-%m-%Y", "%m-%d-%Y")
CLOCKS = ("%I:%M:%S.%f %p", "%I:%M:%S %p", "%H:%M:%S.%f", "%H:%M:%S,%f", "%H:%M:%S")
PATTERNS = (*(f"{date}{gap}{clock}" for clock in CLOCKS for date in DATES for gap in " T,;\t"), *CLOCKS)
CLOCK = r"[0-9]:[0-9]{1,2}:[0-9]"  # in the times of every pattern
CHECKSUM = r"\*[0-9A-Fa-f]{2}$"
SEPARATORS = (",", ";", "\t", "|", " ")
TIME = re.compile(r"time|stamp|millis|micros|^t(_|$)|^ts$|^sec", re.IGNORECASE)
UNITS = {
    "ms": re.compile(r"milli|(^|[^a-z])ms($|[^a-z])", re.IGNORECASE),
    "us": re.compile(r"micro|(^|[^a-z])us($|[^a-z])", re.IGNORECASE),
    "ns": re.compile(r"nano|(^|[^a-z])ns($|[^a-z])|^%time$", re.IGNORECASE),
}
ALIKE = {  # names that other devices have for a column
    "x_mm": re.compile(r"(^|[^a-z])x($|[^a-z])|(pose|position|pos)_?0$|^extension|^displacement", re.IGNORECASE),
    "y_mm": re.compile(r"(^|[^a-z])y($|[^a-z])|(pose|position|pos)_?1$", re.IGNORECASE),
    "z_mm": re.compile(r"(^|[^a-z])z($|[^a-z])|(pose|position|pos)_?2$", re.IGNORECASE),
    "fz_n": re.compile(r"f_?z|force|load|weight|^f$", re.IGNORECASE),
}
OF_ARM, OF_FORCE = re.compile(r"pos|tcp", re.IGNORECASE), re.compile(r"f(orce)?_?z", re.IGNORECASE)  # of several alike
NO_PLACE = re.compile(
    r"force|torque|moment|speed|(^|[^a-z])(acc|gyr|vel)|^f_?[xyz]", re.IGNORECASE
)  # which have axes, too
NO_FORCE = re.compile(r"(force|load|^f)_?[xy]($|[^a-z])", re.IGNORECASE)  # across the surface
ASKED_FOR = re.compile(r"set_?point|target|command|desired", re.IGNORECASE)  # and not measured
_VALUE = r"[\"']?[\s:=;,(]*(?P<value>[0-9]+(\.[0-9]*)?([eE][-+]?[0-9]+)?)\s*"
INTERVAL = re.compile(  # words of a header before the time between two frames
    r"(Delta_X|sec(ond)?s?[ _]?per[ _]?(frame|sample|scan)|(sampl(e|ing)|frame|scan)[ _]?(interval|period|time))"
    rf"(\s*[(\[]s[)\]])?{_VALUE}(?P<unit>ms|us|s\b)?",
    re.IGNORECASE,
)
RATE = re.compile(  # and before their rate
    r"((sampl(e|ing)|frame|scan|acquisition|data|output)s?[ _]?(rate|frequency)"
    r"|(frames|samples|scans)[ _]?(per|/)[ _]?s(ec(ond)?)?"
    rf"|\bfps|\brate_hz|\brate(?=[^0-9]*[0-9.]+\s*k?hz))(\s*[(\[]hz[)\]])?{_VALUE}(?P<unit>k?hz)?",
    re.IGNORECASE,
)
LABEL = "\0"  # stands for a word behind a reading that is no unit
METRES = "that places are in metres"


class Proposal(NamedTuple):
    """How a log can be read."""

    layout: dict  # for the settings; `rate_hz` is None where the log tells none
    guesses: list[str]
    said: tuple[str, ...] = ()  # what the header says of units
    named: bool = False  # the names of the columns say that they are the wanted ones


class _Table(NamedTuple):
    """The lines of a log as columns, split in one way."""

    separator: str
    decimal: str
    width: int
    numeric: list[int]  # places of the columns of numbers
    values: np.ndarray  # (rows, width); NaN where a field is no number
    share: float  # of the lines with numbers that are rows
    first: int  # line, from 0, of the first row
    texts: list[str]  # fields of the columns of numbers in the first row


class Columns(NamedTuple):
    """What the columns of a table of text are, as far as its first lines show."""

    separator: str
    decimal: str
    encoding: str
    first: int  # line, from 0, of the first row
    names: list[str]  # of all columns, '' without a header
    times: list[list[int]]  # places that are a time together, the likeliest first; two where a date has its own column
    counters: list[int]  # places of columns that count the lines
    rows: list[list[str]]  # fields of the lines that are looked at


def columns(path: Path) -> Columns | None:
    """Return the columns of a table of text; None for other text. Raises InputError as `layout.opened`."""
    with layout.opened(path) as file:
        start = file.read(START)
    encoding = _encoding(start) if start else None
    if encoding is None:
        return None
    text = start.decode(encoding, "replace").lstrip("\ufeff")
    lines = [line.strip("\r\n") for line in text.split(layout.line_end(text) or "\n")][:LINES]
    tables = [table for table in _tables(lines, 1, ends=True) if table.separator != layout.TEXT and table.share > SHARE]
    if not tables:
        return None
    table = max(tables, key=lambda table: len(table.numeric))
    split = [layout.numbers(line, table.separator, table.decimal) for line in lines[table.first :]]
    rows = [fields for fields in split if len(fields) == table.width]
    names = _names(table, lines)
    pattern = next(_patterns([line for line in lines[table.first :] if line]), None)
    stamped = _stamped_places(rows[0], table.separator, pattern) if pattern else []
    counters = [place for place in table.numeric if _counts(table, place, names)]
    left, times = table, [stamped] if stamped else []
    while (time := _time(left, names)) is not None:
        times += [[time]] if time not in counters else []
        left = left._replace(numeric=[place for place in left.numeric if place != time])
    return Columns(
        table.separator, table.decimal, encoding, table.first, names or [""] * table.width, times, counters, rows
    )


def _stamped_places(fields: list[str], separator: str, pattern: str) -> list[int]:
    """Return the places of the columns, one or two, that hold a time of a pattern."""
    stamp = re.compile(layout.expression(pattern))
    for many in (1, 2):
        for place in range(len(fields) + 1 - many):
            if stamp.match(separator.join(fields[place : place + many])):
                return list(range(place, place + many))
    return []


def proposed(path: Path, fmt: Format) -> Proposal | str | None:
    """Return how a log can be read; the sentence that says why it cannot; or None where neither shows.

    fmt: what its lines are to become.
    """
    try:
        with layout.opened(path) as file:
            start = file.read(START)
    except InputError as error:
        return str(error)
    if not start:
        return None
    encoding = _encoding(start)
    if encoding is None:
        return (
            f"{path}: holds binary data, not lines of text; write each frame as text, {fmt.shown}, before it is saved"
        )
    text = start.decode(encoding, "replace").lstrip("\ufeff")
    end = layout.line_end(text) or "\n"
    lines = [line.strip("\r\n") for line in text.split(end)]
    if len(start) == START and len(lines) > 1:
        lines.pop()
    lines = lines[:LINES]
    if len(lines) < 3 and len(re.findall(r"[0-9]+", text)) > 3 * len(fmt.columns):
        return (
            f"{path}: {len(lines)} line{'s' * (len(lines) > 1)} of {len(text) // max(len(lines), 1)} characters: the "
            "device ends no line; end each frame by a line end (println)"
        )
    try:
        found = _laid_out(lines, fmt, path)
    except InputError as error:
        return f"{path}: {error}"
    if found is None:
        return None
    first = {} if encoding == "utf-8" else {"encoding": encoding}
    return found._replace(layout=first | found.layout)


def numbers_a_line(path: Path) -> int:
    """Return how many numbers most lines of a log have, whatever is between them; 0 where none has two."""
    with path.open("rb") as file:
        lines = file.read(START).decode("utf-8", "replace").splitlines()[:LINES]
    if pattern := next(_patterns([line for line in lines if line]), None):
        lines = [re.sub(layout.expression(pattern), "0 ", line, count=1) for line in lines]  # one number
    counts = Counter(len(layout.NUMBERS["."].findall(line)) for line in lines)
    often = [(count, width) for width, count in counts.items() if width > 1]
    return max(often)[1] if often else 0


def columns_a_line(path: Path, separator: str) -> int:
    """Return how many columns most lines of a log have, of words or numbers; errors as `layout.opened`."""
    with layout.opened(path) as file:
        lines = file.read(START).decode("utf-8", "replace").splitlines()[:LINES]
    if separator == layout.TEXT:
        return numbers_a_line(path)
    counts = Counter(len(layout.divided(line, separator)) for line in lines if line.strip())
    return counts.most_common(1)[0][0] if counts else 0


def unlike_columns(path: Path) -> tuple[list[str], list[int]]:
    """Say what those columns of a log do that are unlike most: they count, are sums, rise, have decimals, stay.

    Returns the sentences' parts, and the numbers of the other columns without the time.
    """
    with layout.opened(path) as file:
        lines = file.read(START).decode("utf-8", "replace").splitlines()[:LINES]
    table = next((table for table in _tables(lines, 2) if table.share > SHARE), None)
    if table is None or len(table.values) < LEAST_ROWS:
        return [], []
    time = _time(table, None)
    kinds = {}
    for place in table.numeric:
        values = table.values[:, place][np.isfinite(table.values[:, place])]
        if place == time and not _counts(table, place, None):
            continue
        if _counts(table, place, None):
            kinds[place] = "counts the lines"
        elif said := _checksum(table, place):
            kinds[place] = f"is {said}"
        elif not np.ptp(values):
            kinds[place] = f"is {values[0]:g} throughout"
        elif len(values) and np.mean(np.diff(values) > 0) > RISES:
            kinds[place] = "rises"
        else:
            kinds[place] = "has whole numbers" if (values == np.rint(values)).all() else "has decimals"
    usual = Counter(kinds.values()).most_common(1)[0][0]
    unlike = [f"column {place + 1} {kind}" for place, kind in kinds.items() if kind != usual]
    return unlike, [place + 1 for place, kind in kinds.items() if kind == usual]


def _encoding(start: bytes) -> str | None:
    """Return the encoding of a text by its first bytes; None for what is no text."""
    if start[:2] in (b"\xff\xfe", b"\xfe\xff"):
        words = np.frombuffer(start[2 : 2 + len(start) // 4 * 2 - 2], "<u2" if start[0] == 0xFF else ">u2")
        return "utf-16" if np.mean(words < 128) > SHARE else None
    data = np.frombuffer(start, np.uint8)
    if len(data) > 3 and np.mean(data[1::2] == 0) > SHARE:
        return "utf-16-le" if np.mean((data[::2] > 31) & (data[::2] < 127)) > SHARE else None
    control = (data < 32) & ~np.isin(data, (9, 10, 13))
    if control.mean() > CONTROL or np.mean(data > 126) > 0.2:
        return None
    try:
        start[: start.rfind(b"\n") + 1 or None].decode("utf-8")
    except UnicodeDecodeError:
        return "latin-1" if control.sum() == 0 else "utf-8"
    return "utf-8"


def _laid_out(lines: list[str], fmt: Format, path: Path) -> Proposal | None:
    """Return how lines can be read; errors, as InputError, say what is wrong with them in words without the file."""
    common: dict = {}
    filled = [line for line in lines if re.search("[0-9]", line)]
    if not filled:
        return None
    if _in_most(CHECKSUM, filled):
        common["strip"] = [CHECKSUM]
        lines, filled = ([re.sub(CHECKSUM, "", line) for line in some] for some in (lines, filled))
    if patterns := list(_patterns(filled)):
        refused = []
        for pattern in patterns:  # of 12:00:00,512 the end is a fraction or a reading
            try:
                if found := _stamped(lines, fmt, common, _by_day(pattern, path)):
                    return found
            except InputError as error:
                refused.append(error)
        if refused:
            raise refused[0]
        return None
    return _of_rows(lines, fmt, common, timed=True) or _of_frames(lines, fmt, common)


def _stamped(lines: list[str], fmt: Format, common: dict, pattern: str) -> Proposal | None:
    """Return how lines can be read that have a time of a pattern; errors as `_laid_out`."""
    common = common | {"time_pattern": pattern}
    stamp = re.compile(rf"(?<![0-9]){layout.expression(pattern)}")
    if _in_most(stamp.pattern + ZONE, [line for line in lines if re.search("[0-9]", line)]):
        common = {"strip": [*common.pop("strip", []), ZONE]} | common
        lines = [re.sub(ZONE, "", line) for line in lines]
    bare = [stamp.sub("", line, count=1).replace('""', "") if stamp.search(line) else "" for line in lines]
    first, seen = next((k, seen) for k, line in enumerate(lines) if (seen := stamp.search(line)))
    bare[:first] = _without_field(lines[:first], lines[first], seen.span())
    if (found := _of_rows(bare, fmt, common, timed=False)) is None:
        return None
    moments = (layout.moment(text[0], pattern) for text in map(stamp.search, lines) if text)
    seconds = np.array([(at - datetime(1900, 1, 1)).total_seconds() for at in moments if at])
    guesses = [*found.guesses]
    return found._replace(layout=found.layout | _repeats(seconds, 1.0, guesses), guesses=guesses)


def _without_field(above: list[str], line: str, span: tuple[int, int]) -> list[str]:
    """Return the lines above the first row without the field that names a time, which a row has at `span`."""
    separator = line[span[1] :].lstrip(" '\"")[:1]
    if separator not in (",", ";", "\t", "|"):
        return [""] * len(above)
    place = line[: span[0]].count(separator)
    split = [one.split(separator) for one in above]
    return [separator.join(fields[:place] + fields[place + 1 :]) for fields in split]


def _patterns(lines: Sequence[str]) -> Iterator[str]:
    """Yield the patterns of times that most lines have, see `_is_time`."""
    if _in_most(CLOCK, lines[-TRIED:]):
        yield from (pattern for pattern in PATTERNS if _is_time(pattern, lines))


def _is_time(pattern: str, lines: Sequence[str]) -> bool:
    """Tell whether most lines have a time of this pattern, of which day and month are possible.

    One line of all has the fraction of a second that the pattern has; behind a comma it could be a column, so that the
    times have to rise with it.
    """
    stamp = re.compile(rf"(?<![0-9]){layout.expression(pattern)}")
    found = [found[0] for line in lines[-TRIED:] if (found := stamp.search(line))]
    moments = [moment for text in found if (moment := layout.moment(text, pattern))]
    if len(moments) <= SHARE * len(lines[-TRIED:]):
        return False
    if ",%f" in pattern:
        rise = np.diff(np.array(moments, "M8[us]")) > np.timedelta64(0)
        return len(moments) > 2 and bool(np.mean(rise) > RISES)
    return ".%f" not in pattern or any(layout.FRACTION.search(text[0]) for text in map(stamp.search, lines) if text)


def _by_day(pattern: str, path: Path) -> str:
    """Return a pattern with day and month in the order that the log shows, or else another log beside it.

    The day is the number beyond 12, or the one that rises by one at midnight. Where no log shows it, either order
    gives the same times.
    """
    both = re.match(r"%[dm]([-/])%[dm]\1%Y", pattern)
    if not both:
        return pattern
    date = re.compile(rf"(?<![0-9])([0-9]{{1,2}}){both[1]}([0-9]{{1,2}}){both[1]}[0-9]{{4}}")
    beside = (
        sorted(path.parent.glob("*.log")) + sorted(path.parent.parent.parent.glob(f"*/*/{path.name}"))[:MOST_BESIDE]
    )
    for log in dict.fromkeys([path, *beside]):
        seen: list[tuple[str, ...]] = [("", "")]  # the numbers of the dates, as they change
        with layout.opened(log) as file:
            for line in io.TextIOWrapper(file, encoding="latin-1"):
                if (found := date.search(line[:LONGEST_STAMP].replace("\0", ""))) and found.groups() != seen[-1]:
                    seen.append(found.groups())
        dates = np.array(seen[1:], int).reshape(-1, 2)
        steps = np.diff(dates, axis=0)
        day_first, day_second = (
            bool((dates[:, k] > 12).any() or (len(steps) > 0 and (steps == one).all()))
            for k, one in enumerate(([1, 0], [0, 1]))
        )
        if day_first != day_second:
            return f"{both[1].join(['%d', '%m'] if day_first else ['%m', '%d'])}{pattern[5:]}"
    return pattern


def _in_most(pattern: str, lines: Sequence[str]) -> bool:
    """Tell whether most lines have a pattern."""
    return sum(re.search(pattern, line) is not None for line in lines) > SHARE * len(lines)


def _tables(lines: Sequence[str], least: int, ends: bool = False) -> Iterator[_Table]:
    """Yield the tables, of `least` columns of numbers or more, that lines can be taken for.

    ends: the first and the last column count where they are empty, too.
    """
    filled = sum(bool(re.search("[0-9]", line)) for line in lines)
    for separator in (*SEPARATORS, layout.TEXT):
        blanks = "" if ends else " \t" if separator == layout.TEXT else f" \t{separator}"
        for decimal in ".,":
            if decimal == "," and separator == layout.TEXT and not _decimal_commas(lines):
                continue
            if (least > 1 and not _divides(separator, lines)) or (decimal == "," and not _divides(decimal, lines)):
                continue
            if decimal == "," == separator and not _in_pairs(lines):
                continue
            bare = [line.strip(blanks) for line in lines]
            split = [layout.numbers(line, separator, decimal) if line else [] for line in bare]
            is_number = [list(map(layout.is_number, fields)) for fields in split]
            widths = Counter(len(row) for row in is_number if sum(row) >= min(least, 2))
            if not widths:
                continue
            width, _ = widths.most_common(1)[0]
            rows = [k for k, fields in enumerate(split) if len(fields) == width]
            numbers = np.array([is_number[k] for k in rows])
            known = numbers | np.array([list(map(layout.is_missing, split[k])) for k in rows])
            numeric = [c for c in range(width) if known[:, c].mean() > 0.9 and numbers[:, c].mean() > 0.1]
            if len(numeric) < least:
                continue
            good = known[:, numeric].all(axis=1)
            values = np.full(numbers.shape, np.nan)
            values[numbers] = [float(field) for k in rows for field in itertools.compress(split[k], is_number[k])]
            first = rows[good.argmax()]
            yield _Table(separator, decimal, width, numeric, values[good], good.sum() / filled, first, split[first])


def _divides(mark: str, lines: Sequence[str]) -> bool:
    """Tell whether a separator or a decimal mark is in any line; TEXT stands for any text, a blank for every kind."""
    if mark == layout.TEXT:
        return True
    return any(len(line.split(None, 1)) > 1 if mark == " " else mark in line for line in lines)


def _decimal_commas(lines: Sequence[str]) -> bool:
    """Tell whether commas divide no numbers: another mark does, and each comma stands between two digits."""
    rows = [line for line in lines if re.search("[0-9]", line)]
    return _in_most(r"^([^,]|(?<=[0-9]),(?=[0-9]))*$", rows) and _in_most(r"[;|\t]", rows)


def _in_pairs(lines: Sequence[str]) -> bool:
    """Tell whether commas divide numbers of lines that have decimal commas: every second column is a fraction.

    Its digits are as many in every line, and some of these numbers begin with 0, as no whole number does.
    """
    rows = [layout.divided(line.strip(" ,"), ",") for line in lines if re.search("[0-9]", line)]
    width, often = Counter(map(len, rows)).most_common(1)[0] if rows else (0, 0)
    rows = [row for row in rows if len(row) == width]
    if width < 4 or width % 2 or often < SHARE * len(rows):
        return False
    fractions = [column for column in zip(*rows, strict=True)][1::2]
    alike = all(len(set(map(len, column))) == 1 and all(map(str.isdigit, column)) for column in fractions)
    return alike and any(field.startswith("0") and len(field) > 1 for column in fractions for field in column)


def _of_rows(lines: list[str], fmt: Format, common: dict, timed: bool) -> Proposal | None:
    """Return how lines can be read that are one frame each; timed: the time is among the numbers."""
    readings = len(fmt.columns) - 1
    tables = [table for table in _tables(lines, readings) if table.share > SHARE]
    for table in tables if timed and not _in_pairs(lines) else ():
        if table.separator != layout.TEXT and table.decimal != ",":
            _refuse_two_parts(table)
    if not timed:
        exact = [table for table in tables if len(table.numeric) == table.width == readings]
        if exact:
            return _in_order(exact[0], fmt, common, lines, timed)
    for table in tables:
        if timed and len(table.numeric) == table.width == readings + 1:
            return _in_order(table, fmt, common, lines, timed)
    for table in tables:
        if len(table.numeric) == table.width == readings and _time(table, None, strict=True) is None:
            return _without_time(table, fmt, common, lines)
    most = max((len(table.numeric) for table in tables if table.separator != layout.TEXT), default=0)
    for table in sorted(tables, key=lambda table: table.separator == layout.TEXT):
        if table.separator != layout.TEXT and len(table.numeric) < most:
            continue  # of 1;2,5;3 the columns that commas divide are none
        if (found := _chosen(table, fmt, common, lines, timed)) is not None:
            return found
    return None


def _time(table: _Table, names: list[str] | None, strict: bool = False) -> int | None:
    """Return the place of the column that is the time: one that is called so, else the first that rises.

    strict: in nearly every line. A column that counts the lines comes last.
    """
    rising = []
    for place in table.numeric:
        values = table.values[:, place]
        steps = np.diff(values[np.isfinite(values)])
        back = np.mean(steps < 0) if len(steps) else 1
        up = np.mean(steps > 0) if len(steps) else 0
        few_digits = not strict and back == 0 and (steps > 0).sum() >= LEAST_RISES
        if len(steps) > 2 and back < 1 - RISES and (up > RISES or few_digits):
            called = names is not None and bool(TIME.search(names[place]))
            rising.append((not called, _counts(table, place, names), up <= RISES, place))
    return min(rising)[-1] if rising else None


def _counts(table: _Table, place: int, names: list[str] | None) -> bool:
    """Tell whether a column counts lines and is no time: it rises by 1, but for lost lines and where it begins anew.

    A name that says time or holds a unit of it, or seconds since 1970, say otherwise.
    """
    values = table.values[:, place]
    values = values[np.isfinite(values)]
    steps = np.diff(values)
    if len(steps) < 3 or np.mean(steps == 1) <= RISES or (values != np.rint(values)).any():
        return False
    if names is not None and (TIME.search(names[place]) or units.named(names[place], "s")):
        return False
    return not units.absolute(float(np.median(values)), 1.0)


def _checksum(table: _Table, place: int) -> str | None:
    """Say of which columns a column is the checksum; None for one that is none."""
    values = table.values
    whole = (
        np.isfinite(values[:, : place + 1]).all() and (values[:, : place + 1] == np.rint(values[:, : place + 1])).all()
    )
    if place < 2 or len(values) < LEAST_ROWS or not whole or np.ptp(values[:, place]) < LEAST_ROWS:
        return None
    own = values[:, place].astype(np.int64)
    for first in range(min(3, place - 1)):
        part = values[:, first:place].astype(np.int64)
        for bits in (8, 16):
            total, either = part.sum(axis=1) % 2**bits, np.bitwise_xor.reduce(part % 2**bits, axis=1)
            for way, kept in (("sum", total), ("sum", -total % 2**bits), ("sum", ~total % 2**bits), ("XOR", either)):
                if np.mean(kept == own) > 1 - FEW_WRONG:
                    return f"the {way} of columns {first + 1} to {place} modulo {2**bits}"
    return None


def _refuse_two_parts(table: _Table) -> None:
    """Raise InputError where a time stands in two columns: seconds, and in the next the parts of a second."""
    for place in table.numeric[:3]:
        if place + 1 not in table.numeric:
            continue
        whole, part = table.values[:, place], table.values[:, place + 1]
        known = np.isfinite(whole) & np.isfinite(part)
        whole, part = whole[known], part[known]
        if (
            len(whole) < LEAST_ROWS
            or (whole != np.rint(whole)).any()
            or (part != np.rint(part)).any()
            or part.min() < 0
        ):
            continue
        stays, rises = np.diff(whole) == 0, np.diff(whole) == 1
        if not stays.any() or not rises.any() or (stays | rises).mean() <= RISES:
            continue
        for digits, called in ((3, "milliseconds"), (6, "microseconds"), (9, "nanoseconds")):
            steps = np.diff(whole + part / 10**digits)
            if part.max() < 10**digits and part.max() > 10**digits / 2 and np.mean(steps > 0) > RISES:
                raise InputError(
                    f"columns {place + 1} and {place + 2} are one time, {table.texts[place]} s and "
                    f"{table.texts[place + 1]} {called}; write it as one number, in seconds with decimals or in "
                    f"{called}"
                )


def _in_order(table: _Table, fmt: Format, common: dict, lines: list[str], timed: bool) -> Proposal | None:
    """Return how lines can be read that have as many columns as are wanted: in their order, unless a header says other.

    A header of which no name is known is taken for one of the usual order, which is a guess.
    """
    names = _names(table, lines) if table.separator != layout.TEXT else None
    time, guesses = _time(table, names) if timed else None, []
    if time is not None:
        words = _names(table, lines)
        if counters := [place for place in range(time + 1) if _counts(table, place, words)]:
            return _without_time(table, fmt, common, lines, counters[0])
    readings = [column.name for column in fmt.columns if column.name != fmt.time]
    if names is not None and (time is not None or not timed):
        left = [place for place in range(table.width) if place != time]
        named = _by_name(names, left, readings)
        if named is not None and named[0] != left:
            return _chosen(table, fmt, common, lines, timed)
        if named is None and len(readings) > 1:
            listed = ", ".join([names[left[0]], "...", names[left[-1]]])
            guesses = [f"that {listed} are {readings[0]}, ..., {readings[-1]}, in this order"]
        elif named is None:
            guesses = [f"that '{names[left[0]]}' is {readings[0]}"]
        found = _finished(table, fmt, common, time, None, lines, guesses)
        return found and found._replace(named=named is not None)
    return _finished(table, fmt, common, time, None, lines, guesses)


def _by_name(names: list[str], left: list[int], readings: list[str]) -> tuple[list[int], list[str]] | None:
    """Return the places of the readings among the columns `left`, by their names, and what is guessed; or None."""
    plain = [re.sub(r"[^a-z0-9]+", "_", name.lower()).strip("_") for name in names]
    called = [plain.index(name) for name in readings if name in plain]
    if len(called) == len(readings) and set(called) <= set(left):  # of `5 N` in one column the name tells no number
        return called, []
    if all(name in ALIKE for name in readings):
        fits = [place for name in readings if (place := _alike(names, left, name)) is not None]
        if len(set(fits)) == len(readings):
            said = ", ".join(f"'{names[place]}' is {name}" for place, name in zip(fits, readings, strict=True))
            return fits, [f"that {said}"]
        return None
    stems = [re.sub(r"[0-9]+", "#", name) for name in plain]
    groups = Counter(stems[place] for place in left)
    same = [stem for stem, count in groups.items() if count == len(readings) and "#" in stem]
    return ([place for place in left if stems[place] == same[0]], []) if len(same) == 1 else None


def _alike(names: list[str], left: list[int], reading: str) -> int | None:
    """Return the place of the column whose name is likest to a reading's; None where none is.

    Raises InputError where several are equally like it.
    """
    better, other = (OF_FORCE, NO_FORCE) if reading == "fz_n" else (OF_ARM, NO_PLACE)
    ranked: dict[tuple[bool, bool], list[int]] = {}
    for place in left:
        name = names[place]
        if ALIKE[reading].search(name) and not other.search(name):
            ranked.setdefault((bool(ASKED_FOR.search(name)), not better.search(name)), []).append(place)
    best = ranked[min(ranked)] if ranked else []
    if len(best) > 1:
        raise InputError(
            f"{', '.join(names[place] for place in best)} could each be {reading}; rename the others, or say by "
            "`columns` in the log's block, of ingest.format in settings.yaml or of origin.yaml, which one is"
        )
    return best[0] if best else None


def _chosen(table: _Table, fmt: Format, common: dict, lines: list[str], timed: bool) -> Proposal | None:
    """Return how lines can be read that have more columns than are wanted."""
    readings = [column.name for column in fmt.columns if column.name != fmt.time]
    names = _names(table, lines)
    time = _time(table, names) if timed else None
    if timed and time is None:
        return None
    counter = time if time is not None and _counts(table, time, names) else None
    left = [place for place in table.numeric if place != time]
    places, guesses = (_by_name(names, left, readings) if names is not None else None) or (None, [])
    named = places is not None
    if places is None:
        counts = [place for place in left if _counts(table, place, None)]
        left = [place for place in left if place not in counts]
        sums = {place: said for place in left[-1:] if (said := _checksum(table, place))}
        if len(left) > len(readings):
            left = [place for place in left if place not in sums]
        if len(left) != len(readings):
            return None
        places = left
        if counts:
            guesses.append("that a column which rises by 1 is no reading")
        guesses += [
            f"that column {place + 1}, {said}, is no reading" for place, said in sums.items() if place not in left
        ]
    if counter is not None:
        return _without_time(table, fmt, common, lines, counter, places)._replace(named=named)
    found = _finished(table, fmt, common, time, places, lines, guesses)
    if found is None:
        return None
    in_header = timed and table.separator != layout.TEXT
    if in_header and names is not None and len(set(names)) == len(names) and all(names):
        found.layout.pop("width", None)
        if time is not None:
            found.layout["time"] = names[time]
        run = places == list(range(places[0], places[-1] + 1)) and len(places) > 4
        chosen = [names[place] for place in places]
        found.layout["columns"] = f"{chosen[0]}..{chosen[-1]}" if run else chosen
    return found._replace(named=named)


def _names(table: _Table, lines: list[str]) -> list[str] | None:
    """Return what a header above the first row, or the words before the numbers, call the columns; None without."""
    if table.separator == layout.TEXT:
        line, at = lines[table.first], 0
        names: list[str] = []
        for number in layout.NUMBERS[table.decimal].finditer(line):
            before = re.findall(r"[A-Za-z_]\w*", line[at : number.start()])
            names.append(before[-1] if before else "")
            at = number.end()
        for k, name in enumerate(names):  # GRBL's MPos:1,2,3
            if re.fullmatch("[MW]Pos", name) and names[k + 1 : k + 3] == ["", ""]:
                names[k : k + 3] = ["x", "y", "z"]
        return names if any(names) else None
    place, header = _header(table, lines)
    above = _header(table, lines, place - 1)[1]
    if header is None or above is None or units.of_header(header, below=True) == header:
        return header
    return above


def _header(table: _Table, lines: list[str], last: int | None = None) -> tuple[int, list[str] | None]:
    """Return the number of the line that is the header above the first row, and its names; (0, None) without.

    last: the line from which on it is looked for, upwards; None: the one above the first row.
    """
    for number in range(table.first if last is None else last, 0, -1):
        names = layout.divided(lines[number - 1], table.separator)
        if len(names) == table.width and layout.is_header(names):
            return number, names
    return 0, None


def _finished(
    table: _Table,
    fmt: Format,
    common: dict,
    time: int | None,
    places: list[int] | None,
    lines: list[str],
    guesses: list[str],
) -> Proposal | None:
    """Return the proposal for a table; places: of the readings, None: all columns but the time."""
    found: dict = {"separator": table.separator}
    if table.decimal != ".":
        found["decimal"] = table.decimal
    found |= common
    guesses = list(guesses)
    said: list[str] = []
    if "time_pattern" not in common:
        if time is None:
            _refuse_constant(table)
            return None
        if time != 0:
            found["time"] = time + 1
        clock = next(column for column in fmt.columns if column.name == fmt.time)
        (written,) = _written(table, lines, [time], [clock])
        names = _names(table, lines)
        found |= _unit(table.values[:, time], names[time] if names else "", fmt, guesses, said, written)
    if places is None:
        places = [place for place in range(table.width) if place != time]
    elif places != [place for place in range(table.width) if place != time]:
        run = places == list(range(places[0], places[-1] + 1)) and len(places) > 4
        found["columns"] = f"{places[0] + 1}..{places[-1] + 1}" if run else [place + 1 for place in places]
        found["width"] = table.width
    readings = table.values[:, places]
    if np.mean(np.isnan(readings).any(axis=1)) > MANY_MISSING:
        found["missing"] = "previous"
        guesses.append("that a reading which is missing is the one before")
    found |= _scale(readings, table, lines, places, fmt, guesses, said)
    return Proposal(found, guesses, tuple(said))


class _Written(NamedTuple):
    """What is written with a column."""

    name: str  # in a header; '' without
    unit: str | None  # known or not; None without
    where: str  # a sentence about it begins so
    source: str  # of the unit: the header or the lines


def _written(table: _Table, lines: list[str], places: Sequence[int], columns: Sequence[Column]) -> list[_Written]:
    """Return what the header and the first row say of each of some columns, which are at `places`.

    A word that differs from row to row, and is no unit that is known, is none.
    """
    number, names = _header(table, lines) if table.separator != layout.TEXT else (0, None)
    if names:
        names = units.of_header(names, below=_header(table, lines, number - 1)[1] is not None)
    blanks = " \t" if table.separator == layout.TEXT else f" \t{table.separator}"
    split = (layout.with_words(line.strip(blanks), table.separator, table.decimal) for line in lines[table.first :])
    rows = [words for fields, words in split if len(fields) == table.width]
    said = {words: _said(words, table, places, columns) for words in set(rows)}
    found = []
    for k, column in enumerate(columns):
        beside = said[rows[0]][k]
        if beside and not units.known(beside) and len({one[k] for one in said.values()} - {None}) > 1:
            beside = LABEL
        name = names[places[k]] if names else ""
        unit, where = beside, f"line {table.first + 1} has '{beside}'"
        if not beside:
            unit, where = units.named(name, column.unit), f"line {number} names the column '{name}'"
        found.append(_Written(name, unit, where, f"line {table.first + 1}" if beside else "the header"))
    return found


def _constant_words(table: _Table, lines: list[str]) -> list[str]:
    """Return the words that are a column of their own behind a number, without a name, the same in every line."""
    if table.separator != layout.TEXT and _header(table, lines)[1]:
        return []
    rows = [
        re.findall(r"[0-9][\"']?[,;|\t][ \"']*([^\W\d_]{2,})[ \"']*(?=[,;|\t]|$)", line)
        for line in lines[table.first :]
    ]
    rows = [row for row in rows if row]
    alike = len(rows) > SHARE * (len(lines) - table.first) and all(row == rows[0] for row in rows)
    return [f"'{word}'" for word in dict.fromkeys(rows[0]) if not layout.is_missing(word)] if alike else []


def _said(words: tuple[str, ...], table: _Table, places: Sequence[int], columns: Sequence[Column]) -> list[str | None]:
    """Return the units that words of a line say of columns."""
    return units.of_columns(layout.beside(words, table.separator), places, columns) if words else [None] * len(places)


def _refuse_constant(table: _Table) -> None:
    """Raise InputError where the first column is a time with too few digits to rise."""
    values = table.values[:, 0]
    if len(values) > 2 and np.ptp(values) == 0 and abs(values[0]) > 1e8:
        raise InputError(
            f"the time, {table.texts[0]}, is the same in every line: it was written with too few digits; write all of "
            "them (in Excel, format the column as a number; in MATLAB, use writematrix or fprintf with %.6f)"
        )


def _unit(values: np.ndarray, name: str, fmt: Format, guesses: list[str], said: list[str], written: _Written) -> dict:
    """Return what the layout has to say of a time: its unit, and whether lines of one time are spread.

    written: of the unit; a unit that is not known does not matter where the times tell theirs.
    """
    values = values[np.isfinite(values)]
    steps = np.diff(values)
    up = steps[steps > 0]
    clock = next(column for column in fmt.columns if column.name == fmt.time)
    wanted = clock.unit
    second = {unit: count / layout.NANOSECONDS["s"] for unit, count in layout.NANOSECONDS.items()}
    step = float(np.median(up)) if len(up) else 1.0
    interval = (values[-1] - values[0]) / max(len(values) - 1, 1)
    interval = interval if interval > 0 else step
    absolute = units.absolute(float(np.median(values)), interval)
    if len(absolute) > 1:
        ways = " or ".join(f"{what} (time_unit: {unit})" for unit, what in absolute.items())
        raise InputError(f"the times could be {ways}; write which into the block of this log in `ingest.format`")
    try:
        unit = (
            units.of_time(written.unit)
            if written.unit is not None and units.factor(written.unit, clock, written.where)
            else None
        )
    except units.Unit:
        if not absolute:
            raise
        unit = None
    if unit and not PLAUSIBLE_S[0] <= interval * second[unit] <= PLAUSIBLE_S[1]:
        said.append(f"{written.source} says {unit}, but then lines are {interval * second[unit]:.3g} s apart")
    if unit is None and absolute:
        ((unit, what),) = absolute.items()
        if unit not in ("s", "ms", "us", "ns"):
            said.append(f"the times are {what}")
    unit = unit or next((unit for unit, called in UNITS.items() if called.search(name)), None)
    if unit is None:
        likely = [wanted, *(one for one in ("ms", "us", "s", "ns") if one != wanted)]
        apart = [(one, interval * second[one]) for one in likely]
        within = [one for low, high in (USUAL_S, PLAUSIBLE_S) for one, each_s in apart if low <= each_s <= high]
        unit = wanted if wanted in within or not within else within[0]
        if unit != wanted:
            rate = 1 / (interval * second[unit])
            guesses.append(f"the unit of the time, {unit}: then there are {rate:.3g} lines a second")
    return ({} if unit == wanted else {"time_unit": unit}) | _repeats(values, second[unit], guesses)


def _repeats(values: np.ndarray, second: float, guesses: list[str]) -> dict:
    """Return whether lines of one time are spread; InputError where there are too many of them.

    second: what one unit of the times is in seconds.
    """
    steps = np.diff(values)
    if not len(steps) or (still := float(np.mean(steps == 0))) <= 0.02:
        return {}
    wide = (float(np.median(steps[steps > 0])) if (steps > 0).any() else 1.0) * second
    if wide > WIDEST_STEP_S or 1 / max(1 - still, 1e-9) > MOST_OF_A_STEP:
        edges = np.flatnonzero(np.concatenate([[True], steps != 0, [True]]))
        raise InputError(
            f"the time has too few digits: it rises in steps of {wide:.3g} s, and up to {np.diff(edges).max()} "
            "lines have the same time; write more digits"
        )
    guesses.append(f"that lines of one time, in steps of {1e3 * wide:.3g} ms, came evenly")
    return {"repeats": "spread"}


def _scale(
    readings: np.ndarray,
    table: _Table,
    lines: list[str],
    places: Sequence[int],
    fmt: Format,
    guesses: list[str],
    said: list[str],
) -> dict:
    """Return the factor of readings with which another unit is written or, without units, that show to be in one."""
    columns = [column for column in fmt.columns if column.name != fmt.time]
    written = _written(table, lines, places, columns)
    labels = any(one.unit == LABEL for one in written)
    written = [one._replace(unit=None) if one.unit == LABEL else one for one in written]
    factors = [units.factor(one.unit, column, one.where) for one, column in zip(written, columns, strict=True)]
    if any(factors):
        return _scale_of_units(readings, written, columns, factors, guesses, said)
    if columns[0].unit not in units.NO_UNIT and (words := _constant_words(table, lines)):
        guesses.append(f"that {', '.join(words)} behind the readings {'are' if len(words) > 1 else 'is'} no unit")
    if labels and columns[0].unit not in units.NO_UNIT:
        guesses.append("that the words behind the readings, which differ from line to line, are no units")
        return {"scale": 1}
    if all(column.unit == "mm" for column in columns):
        moves = max(np.nanmax(readings, axis=0) - np.nanmin(readings, axis=0))
        if 0 < moves < SMALL_M:
            guesses.append(METRES)
            return {"scale": 1000}
    if columns[0].unit == "N" and GRAMS[0] < np.nanmax(abs(readings)) < GRAMS[1] and not _converter(readings):
        guesses.append("that the load cell shows grams")
        return {"scale": 0.00981}
    if columns[0].unit == "N" and _converter(readings):
        raise InputError(
            f"{readings[0, 0]:.0f} is a count of the load cell's converter, not a force: set scale and offset of the "
            "load cell in `format` (force in N = count * scale + offset); `tactile weigh LOG 0 1kg` finds them"
        )
    return {}


def _scale_of_units(
    readings: np.ndarray,
    written: list[_Written],
    columns: list[Column],
    factors: list[float | None],
    guesses: list[str],
    said: list[str],
) -> dict:
    """Return the factor of readings by the units that are written; what their size says against it is said."""
    first = next(size for size in factors if size)
    if bare := [
        one.name or column.name for one, column, size in zip(written, columns, factors, strict=True) if not size
    ]:
        guesses.append(f"that {', '.join(bare)} have the unit of the column beside")
    scales = [first if size is None else size for size in factors]
    unit, wanted = ", ".join(dict.fromkeys(one.unit for one in written if one.unit)), columns[0].unit
    source = next(one.source for one in written if one.unit)
    doubt = ""
    if wanted in USUAL:
        least, most = USUAL[wanted]
        scaled = readings * scales
        sizes = np.nanmax(scaled, axis=0) - np.nanmin(scaled, axis=0) if wanted == "mm" else np.nanmax(abs(scaled))
        if not least <= (largest := float(np.max(sizes))) <= most:
            what = "the places move by no more than" if wanted == "mm" else "the largest reading is"
            doubt = f", but then {what} {largest:.3g} {wanted}, which is unusual"
    if doubt or any(size != 1 for size in scales):
        said.append(f"{source} says {unit}{doubt}")
    if all(size == 1 for size in scales):
        return {}
    scales = [int(size) if float(size).is_integer() else size for size in scales]
    return {"scale": scales[0] if len(set(scales)) == 1 else scales}


def _converter(readings: np.ndarray) -> bool:
    """Tell whether forces are whole numbers beyond any force: counts of a converter of 24 bits."""
    known = readings[np.isfinite(readings)]
    return bool(len(known)) and bool((known == np.rint(known)).all()) and np.median(abs(known)) > 1e3


def _without_time(
    table: _Table,
    fmt: Format,
    common: dict,
    lines: list[str],
    counter: int | None = None,
    places: list[int] | None = None,
) -> Proposal:
    """Return the proposal for frames without times: `rate_hz` is the log's own, or None.

    counter: place of a column that counts them; places: of the readings, None: all columns but the counter.
    """
    found = {"separator": table.separator} | ({"decimal": table.decimal} if table.decimal != "." else {}) | common
    guesses: list[str] = []
    said: list[str] = []
    if places is None:
        places = [place for place in range(table.width) if place != counter]
    if len(places) < table.width:
        run = places == list(range(places[0], places[-1] + 1)) and len(places) > 4
        found["columns"] = f"{places[0] + 1}..{places[-1] + 1}" if run else [place + 1 for place in places]
        found["width"] = table.width
    if counter is not None:
        guesses.append(_of_counter(f"column {counter + 1}", table.values[:, counter]))
    found |= _rate(lines[: table.first], said)
    found |= _scale(table.values[:, places], table, lines, places, fmt, guesses, said)
    return Proposal(found, guesses, tuple(said))


def _of_counter(what: str, values: np.ndarray) -> str:
    """Return the guess that something counts frames and is no time."""
    skips = int(np.sum(np.diff(values[np.isfinite(values)]) > 1))
    lost = f"; it skips {skips} times, and lost frames are not filled" if skips else ""
    return f"that {what}, which rises by 1, counts the frames and is no time{lost}"


def _rate(lines: list[str], said: list[str]) -> dict:
    """Return the rate that the lines above the first row say, None where they say none."""
    for line in lines:
        for pattern, is_interval in ((INTERVAL, True), (RATE, False)):
            found = pattern.search(line.replace(",", "." if re.search(r"[0-9],[0-9]", line) else " "))
            if found and float(found["value"]) > 0:
                value, unit = float(found["value"]), found["unit"] or ""
                if is_interval:
                    rate = 1 / (value * layout.NANOSECONDS[units.known(unit) or "s"] / layout.NANOSECONDS["s"])
                else:
                    rate = value * (1000 if unit.lower() == "khz" else 1)
                if not found[0].startswith("Delta_X"):
                    said.append(f"the header says {found[0].strip()}")
                return {"rate_hz": float(f"{rate:.6g}")}
    return {"rate_hz": None}


def _of_frames(lines: list[str], fmt: Format, common: dict) -> Proposal | None:
    """Return how lines can be read of which several are one frame, with a line before or between the frames."""
    readings = len(fmt.columns) - 1
    if readings < 4:
        return None
    for separator in (*SEPARATORS, layout.TEXT):
        blanks = " \t" if separator == layout.TEXT else f" \t{separator}"
        split = [layout.numbers(line.strip(blanks), separator, ".") for line in lines]
        whole = [len(fields) if fields and all(map(layout.is_number, fields)) else 0 for fields in split]
        width, rows = Counter(count for count in whole if count > 1).most_common(1)[0] if max(whole) > 1 else (0, 0)
        if width < 2 or readings % width or readings == width or rows < 2 * readings // width:
            continue
        numbers = np.array([fields for fields, count in zip(split, whole, strict=True) if count == width], float)
        if np.mean(np.diff(numbers[:, 0]) > 0) > RISES:
            continue  # a time: these are whole lines of another sensor
        per_frame = readings // width
        runs: list[int] = []
        between: list[str] = []
        run = 0
        for line, count in zip(lines, whole, strict=True):
            if count == width:
                run += 1
            else:
                runs, between, run = [*runs, run], [*between, line.strip()], 0
        if not runs or np.mean([one == per_frame for one in runs[1:]] or [False]) < SHARE:
            if not runs or max(runs) > 3 * per_frame:
                raise InputError(
                    f"{width} numbers per line, {per_frame} lines a frame, and no line between the frames says where "
                    "one begins; print an empty line after each frame"
                )
            continue
        found = {"separator": separator} | common | {"lines_per_frame": per_frame}
        if separator == layout.TEXT:
            found["width"] = width
        mark, often = Counter(between).most_common(1)[0]
        if often > SHARE * len(between):
            found |= {"frame_begins": re.escape(mark), "rate_hz": None}
            return Proposal(found, [])
        number = layout.NUMBERS["."]
        shapes = Counter(number.sub("\0", line) for line in between)
        shape, often = shapes.most_common(1)[0]
        if often > SHARE * len(between) and shape.count("\0") == 1:
            before, after = map(re.escape, shape.split("\0"))
            found["frame_begins"] = f"{before}(.*){after}"
            times = np.array(
                [
                    float(layout.with_point(found_in[0], "."))
                    for line in between
                    if number.sub("\0", line) == shape
                    for found_in in number.finditer(line)
                ]
            )
            guesses: list[str] = []
            said: list[str] = []
            words = units.beside(tuple(shape.split("\0")))[0]
            clock = next(column for column in fmt.columns if column.name == fmt.time)
            one = _Table(separator, ".", 1, [0], times[:, None], 1.0, 0, [])
            if _counts(one, 0, [words.name]):
                guesses.append(_of_counter(f"the number in '{between[-1]}'", times))
                rate = _rate(lines[: whole.index(width)], said)
                return Proposal(found | {"frame_begins": f"{before}.*{after}"} | rate, guesses, tuple(said))
            unit = words.unit(clock)
            written = _Written(words.name, unit, f"'{between[-1]}' has '{unit}'", f"'{between[-1]}'")
            return Proposal(found | _unit(times, before, fmt, guesses, said, written), guesses, tuple(said))
    return None
