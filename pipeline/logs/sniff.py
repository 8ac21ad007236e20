"""Find out how the lines of a log are laid out, and propose the block `format` of the settings that reads them.

A proposal says only what shows in the lines. What does not is a guess, and is named as one: a rate, a unit, which of
several columns is the force.
"""

import re
from collections import Counter
from collections.abc import Iterator, Sequence
from datetime import datetime
from pathlib import Path
from typing import NamedTuple

import numpy as np

from pipeline.base.errors import InputError
from pipeline.logs import layout, units
from pipeline.logs.formats import Column, Format

START, LINES = 1 << 18, 600  # bytes and lines that are looked at
SHARE = 0.8  # of the lines with a number in them that have to be alike
RISES = 0.9  # share of the lines in which a clock rises
LEAST_RISES = 2  # of a clock with few digits
CONTROL = 0.02  # share of control bytes in a log that is no text
PLAUSIBLE_S = (1 / 5000, 5.0)  # between two lines
USUAL_S = (1 / 1000, 0.2)
WIDEST_STEP_S = 0.11  # of a clock with few digits, up to which lines are spread over a step
MOST_OF_A_STEP = 20  # lines
EPOCHS = {"ns": 1e17, "us": 1e14, "ms": 1e11}  # since 1970, at least
MANY_MISSING = 0.3  # share of rows without a value: columns that are read at other times
USUAL = {"N": (0.05, 1e3), "mm": (0.2, 2e3), "V": (0.01, 10.0)}  # the largest reading of a log; of places, the motion
SMALL_M = 0.2  # an arm that moves by less than 0.2 mm moves in metres
GRAMS = (1e3, 2e5)  # what a load cell shows at most where it shows grams
TRIED = 50  # lines on which a pattern of times is tried
DATES = ("%Y-%m-%d", "%Y/%m/%d", "%d.%m.%Y", "%d/%m/%Y", "%m/%d/%Y", "%d-%m-%Y")
CLOCKS = ("%I:%M:%S.%f %p", "%I:%M:%S %p", "%H:%M:%S.%f", "%H:%M:%S,%f", "%H:%M:%S")
PATTERNS = (*(f"{date}{gap}{clock}" for clock in CLOCKS for date in DATES for gap in " T,;\t"), *CLOCKS)
ZONE = r"(?<=[0-9])(Z|[+-][0-9]{2}:[0-9]{2})(?![0-9:])"
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


def proposed(path: Path, fmt: Format) -> Proposal | str | None:
    """Return how a log can be read; the sentence that says why it cannot; or None where neither shows.

    fmt: what its lines are to become.
    """
    try:
        with layout.opened(path) as file:
            start = file.read(START)
    except layout.BROKEN as error:
        return f"{path}: its gzip compression is broken ({error}); compress it again"
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
        found = _laid_out(lines, fmt)
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


def _laid_out(lines: list[str], fmt: Format) -> Proposal | None:
    """Return how lines can be read; errors, as InputError, say what is wrong with them in words without the file."""
    common: dict = {}
    filled = [line for line in lines if re.search("[0-9]", line)]
    if not filled:
        return None
    if _in_most(CHECKSUM, filled):
        common["strip"] = [CHECKSUM]
        lines, filled = ([re.sub(CHECKSUM, "", line) for line in some] for some in (lines, filled))
    pattern = next((pattern for pattern in PATTERNS if _is_time(pattern, filled[-TRIED:])), None)
    if pattern is not None:
        stamp = re.compile(rf"(?<![0-9]){layout.expression(pattern)}")
        if _in_most(stamp.pattern + ZONE, filled):
            common["strip"] = [*common.get("strip", []), ZONE]
            lines = [re.sub(ZONE, "", line) for line in lines]
        bare = [stamp.sub("", line, count=1).replace('""', "") if stamp.search(line) else "" for line in lines]
        first = next(k for k, line in enumerate(lines) if stamp.search(line))
        bare[:first] = _without_field(lines[:first], lines[first], stamp.search(lines[first]).span())
        common["time_pattern"] = pattern
        return _of_rows(bare, fmt, common, timed=False)
    return _of_rows(lines, fmt, common, timed=True) or _of_frames(lines, fmt, common)


def _without_field(above: list[str], line: str, span: tuple[int, int]) -> list[str]:
    """Return the lines above the first row without the field that names a time, which a row has at `span`."""
    separator = line[span[1] :].lstrip(" '\"")[:1]
    if separator not in (",", ";", "\t", "|"):
        return [""] * len(above)
    place = line[: span[0]].count(separator)
    split = [one.split(separator) for one in above]
    return [separator.join(fields[:place] + fields[place + 1 :]) for fields in split]


def _is_time(pattern: str, lines: Sequence[str]) -> bool:
    """Tell whether most lines have a time of this pattern, of which day and month are possible."""
    stamp, good = re.compile(rf"(?<![0-9]){layout.expression(pattern)}"), 0
    for line in lines:
        if found := stamp.search(line):
            try:
                datetime.strptime(layout.without_nanoseconds(found[0]), pattern)
            except ValueError:
                continue
            good += 1
    return good > SHARE * len(lines)


def _in_most(pattern: str, lines: Sequence[str]) -> bool:
    """Tell whether most lines have a pattern."""
    return sum(re.search(pattern, line) is not None for line in lines) > SHARE * len(lines)


def _tables(lines: Sequence[str], least: int) -> Iterator[_Table]:
    """Yield the tables, of `least` columns of numbers or more, that lines can be taken for."""
    filled = sum(bool(re.search("[0-9]", line)) for line in lines)
    for separator in (*SEPARATORS, layout.TEXT):
        blanks = " \t" if separator == layout.TEXT else f" \t{separator}"
        for decimal in ".,":
            if decimal == "," and separator in (",", layout.TEXT):  # 12,13 would be one number
                continue
            bare = [line.strip(blanks) for line in lines]
            split = [layout.numbers(line, separator, decimal) if line else [] for line in bare]
            widths = Counter(len(fields) for fields in split if sum(map(layout.is_number, fields)) >= min(least, 2))
            if not widths:
                continue
            width, _ = widths.most_common(1)[0]
            rows = [(k, fields) for k, fields in enumerate(split) if len(fields) == width]
            is_number = np.array([list(map(layout.is_number, fields)) for _, fields in rows])
            known = is_number | np.array([list(map(layout.is_missing, fields)) for _, fields in rows])
            numeric = [c for c in range(width) if known[:, c].mean() > 0.9 and is_number[:, c].mean() > 0.1]
            if len(numeric) < least:
                continue
            good = known[:, numeric].all(axis=1)
            values = np.array(
                [
                    [float(f) if layout.is_number(f) else np.nan for f in fields]
                    for (_, fields), wanted in zip(rows, good, strict=True)
                    if wanted
                ]
            )
            first = next(k for (k, _), wanted in zip(rows, good, strict=True) if wanted)
            texts = split[first]
            yield _Table(separator, decimal, width, numeric, values, good.sum() / filled, first, texts)


def _of_rows(lines: list[str], fmt: Format, common: dict, timed: bool) -> Proposal | None:
    """Return how lines can be read that are one frame each; timed: the time is among the numbers."""
    readings = len(fmt.columns) - 1
    tables = [table for table in _tables(lines, readings) if table.share > SHARE]
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


def _time(table: _Table, names: list[str] | None, strict: bool = False, index: bool = False) -> int | None:
    """Return the place of the column that is the time: one that is called so, else the first that rises.

    strict: in nearly every line; index: a column that counts the lines may stand before it.
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
            rising.append((not called, index and bool((steps == 1).all()), up <= RISES, place))
    return min(rising)[-1] if rising else None


def _in_order(table: _Table, fmt: Format, common: dict, lines: list[str], timed: bool) -> Proposal | None:
    """Return how lines can be read that have as many columns as are wanted: in their order, unless a header says other.

    A header of which no name is known is taken for one of the usual order, which is a guess.
    """
    names = _names(table, lines) if table.separator != layout.TEXT else None
    time, guesses = _time(table, names) if timed else None, []
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
    if all(name in plain for name in readings):
        return [plain.index(name) for name in readings], []
    if all(name in ALIKE for name in readings):
        fits = [_alike(names, left, name) for name in readings]
        if None not in fits and len(set(fits)) == len(fits):
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
    by_name = timed and names is not None and table.separator != layout.TEXT
    time = _time(table, names, index=True) if timed else None
    if timed and time is None:
        return None
    left = [place for place in table.numeric if place != time]
    places, guesses = (_by_name(names, left, readings) if names is not None else None) or (None, [])
    named = places is not None
    if places is None:
        counts = [place for place in left if len(table.values) > 2 and (np.diff(table.values[:, place]) == 1).all()]
        left = [place for place in left if place not in counts]
        if len(left) != len(readings):
            return None
        places = left
        if len(table.numeric) > len(left) + (time is not None):
            guesses.append("that a column which rises by 1 is no reading")
    found = _finished(table, fmt, common, time, places, lines, guesses)
    if by_name and len(set(names)) == len(names) and all(names):
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
        line, names, at = lines[table.first], [], 0
        for number in layout.NUMBERS[table.decimal].finditer(line):
            before = re.findall(r"[A-Za-z_]\w*", line[at : number.start()])
            names.append(before[-1] if before else "")
            at = number.end()
        for k, name in enumerate(names):  # GRBL's MPos:1,2,3
            if re.fullmatch("[MW]Pos", name) and names[k + 1 : k + 3] == ["", ""]:
                names[k : k + 3] = ["x", "y", "z"]
        return names if any(names) else None
    return _header(table, lines)[1]


def _header(table: _Table, lines: list[str]) -> tuple[int, list[str] | None]:
    """Return the number of the line that is the header above the first row, and its names; (0, None) without."""
    for number in range(table.first, 0, -1):
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
    guesses, said = list(guesses), []
    names, where = _with_units(table, lines)
    if "time_pattern" not in common:
        if time is None:
            _refuse_constant(table)
            return None
        if time != 0:
            found["time"] = time + 1
        name = names[time] if names else ""
        found |= _unit(table.values[:, time], name, fmt, guesses, said, _unit_of_name(name, fmt, where))
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
    found |= _scale(readings, names and [names[place] for place in places], fmt, guesses, said, where)
    return Proposal(found, guesses, tuple(said))


def _with_units(table: _Table, lines: list[str]) -> tuple[list[str] | None, str]:
    """Return the names of all columns, in which units may be, and the line that has them, for a sentence."""
    number, names = _header(table, lines) if table.separator != layout.TEXT else (table.first + 1, _names(table, lines))
    return names and units.of_header(names), f"line {number}"


def _refuse_constant(table: _Table) -> None:
    """Raise InputError where the first column is a time with too few digits to rise."""
    values = table.values[:, 0]
    if len(values) > 2 and np.ptp(values) == 0 and abs(values[0]) > 1e8:
        raise InputError(
            f"the time, {table.texts[0]}, is the same in every line: it was written with too few digits; write all of "
            "them (in Excel, format the column as a number; in MATLAB, use writematrix or fprintf with %.6f)"
        )


def _unit_of_name(name: str, fmt: Format, where: str) -> str | None:
    """Return the unit that the name of a time holds; None where it holds none."""
    clock = next(column for column in fmt.columns if column.name == fmt.time)
    return units.known(units.named(name, clock.unit)) if units.factor(name, clock, where) else None


def _unit(
    values: np.ndarray, name: str, fmt: Format, guesses: list[str], said: list[str], unit: str | None = None
) -> dict:
    """Return what the layout has to say of a time: its unit, and whether lines of one time are spread.

    unit: that the header names.
    """
    values = values[np.isfinite(values)]
    steps = np.diff(values)
    up = steps[steps > 0]
    wanted = next(column.unit for column in fmt.columns if column.name == fmt.time)
    second = {unit: count / layout.NANOSECONDS["s"] for unit, count in layout.NANOSECONDS.items()}
    step = float(np.median(up)) if len(up) else 1.0
    interval = (values[-1] - values[0]) / max(len(values) - 1, 1)
    interval = interval if interval > 0 else step
    if unit and not PLAUSIBLE_S[0] <= interval * second[unit] <= PLAUSIBLE_S[1]:
        said.append(f"the header says {unit}, but then lines are {interval * second[unit]:.3g} s apart")
    unit = unit or next((unit for unit, least in EPOCHS.items() if abs(np.median(values)) > least), None)
    unit = unit or next((unit for unit, called in UNITS.items() if called.search(name)), None)
    if unit is None:
        likely = [wanted, *(one for one in ("ms", "us", "s", "ns") if one != wanted)]
        apart = [(one, interval * second[one]) for one in likely]
        within = [one for low, high in (USUAL_S, PLAUSIBLE_S) for one, each_s in apart if low <= each_s <= high]
        unit = wanted if wanted in within or not within else within[0]
        if unit != wanted:
            rate = 1 / (interval * second[unit])
            guesses.append(f"the unit of the time, {unit}: then there are {rate:.3g} lines a second")
    found = {} if unit == wanted else {"time_unit": unit}
    still = float(np.mean(steps == 0)) if len(steps) else 0.0
    if still > 0.02:
        wide = step * second[unit]
        if wide > WIDEST_STEP_S or 1 / max(1 - still, 1e-9) > MOST_OF_A_STEP:
            edges = np.flatnonzero(np.concatenate([[True], steps != 0, [True]]))
            raise InputError(
                f"the time has too few digits: it rises in steps of {wide:.3g} s, and up to {np.diff(edges).max()} "
                "lines have the same time; write more digits"
            )
        found["repeats"] = "spread"
        guesses.append(f"that lines of one time, in steps of {1e3 * wide:.3g} ms, came evenly")
    return found


def _scale(
    readings: np.ndarray, names: list[str] | None, fmt: Format, guesses: list[str], said: list[str], where: str
) -> dict:
    """Return the factor of readings whose names say another unit or, without units in them, that show to be in one."""
    columns = [column for column in fmt.columns if column.name != fmt.time]
    factors = [units.factor(name, column, where) for name, column in zip(names or (), columns, strict=bool(names))]
    if any(factors):
        return _scale_of_names(readings, names, columns, factors, guesses, said)
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
            "load cell in `format` (force in N = count * scale + offset), from two known weights"
        )
    return {}


def _scale_of_names(
    readings: np.ndarray,
    names: list[str],
    columns: list[Column],
    factors: list[float | None],
    guesses: list[str],
    said: list[str],
) -> dict:
    """Return the factor of readings by the units in their names; what their size says against it is said."""
    first = next(size for size in factors if size)
    if bare := [name for name, size in zip(names, factors, strict=True) if size is None]:
        guesses.append(f"that {', '.join(bare)} have the unit of the column beside")
    scales = [first if size is None else size for size in factors]
    named = [units.named(name, column.unit) for name, column in zip(names, columns, strict=True)]
    unit, wanted = ", ".join(dict.fromkeys(filter(None, named))), columns[0].unit
    doubt = ""
    if wanted in USUAL:
        least, most = USUAL[wanted]
        scaled = readings * scales
        sizes = np.nanmax(scaled, axis=0) - np.nanmin(scaled, axis=0) if wanted == "mm" else np.nanmax(abs(scaled))
        if not least <= (largest := float(np.max(sizes))) <= most:
            what = "the places move by no more than" if wanted == "mm" else "the largest reading is"
            doubt = f", but then {what} {largest:.3g} {wanted}, which is unusual"
    if doubt or any(size != 1 for size in scales):
        said.append(f"the header says {unit}{doubt}")
    if all(size == 1 for size in scales):
        return {}
    scales = [int(size) if float(size).is_integer() else size for size in scales]
    return {"scale": scales[0] if len(set(scales)) == 1 else scales}


def _converter(readings: np.ndarray) -> bool:
    """Tell whether forces are whole numbers beyond any force: counts of a converter of 24 bits."""
    known = readings[np.isfinite(readings)]
    return bool(len(known)) and bool((known == np.rint(known)).all()) and np.median(abs(known)) > 1e3


def _without_time(table: _Table, fmt: Format, common: dict, lines: list[str]) -> Proposal:
    """Return the proposal for frames without times: `rate_hz` is the log's own, or None."""
    found = {"separator": table.separator} | ({"decimal": table.decimal} if table.decimal != "." else {}) | common
    found["rate_hz"] = _rate_of_header(lines[: table.first])
    guesses: list[str] = []
    said: list[str] = []
    names, where = _with_units(table, lines)
    found |= _scale(table.values, names, fmt, guesses, said, where)
    return Proposal(found, guesses, tuple(said))


def _rate_of_header(lines: list[str]) -> float | None:
    """Return the rate that the header of a LabVIEW file says; None where there is none."""
    for line in lines:
        words = line.replace(",", ".").split()
        if words[:1] == ["Delta_X"] and len(words) > 1 and layout.is_number(words[1]) and float(words[1]) > 0:
            return float(f"{1 / float(words[1]):.6g}")
    return None


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
        runs, between, run = [], [], 0
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
            times = [float(number.search(line)[0]) for line in between if number.sub("\0", line) == shape]
            guesses: list[str] = []
            return Proposal(found | _unit(np.array(times), before, fmt, guesses, []), guesses)
    return None
