"""Say why a log cannot be read that `sniff` finds no layout for: quote its usual line, and what to write instead."""

import re
from collections import Counter
from collections.abc import Iterable, Mapping
from pathlib import Path

import numpy as np

from tactile.logs import layout, units
from tactile.logs.formats import OUT_OF_RANGE, Format

START = 1 << 18  # bytes of a log that are looked at: a hundred lines of the widest log
LINES = 200
FEW_LINES = 3  # with a number in them, below which words may be all that a log has
QUOTED = 60  # characters of a line that are quoted
USUAL = 0.9  # share of the lines in which the time rises
SLOW_S = 5.0  # no device prints a line in so long
ROW = re.compile(r"""[-+0-9.,;:|eETZ_/"'\t ]*[0-9][-+0-9.,;:|eETZ_/"'\t ]*""")  # numbers and dates, not words
HEXADECIMAL = re.compile(r"[0-9a-fA-FxX,;: \t]*[0-9][a-fA-FxX][0-9a-fA-FxX,;: \t]*")
BESIDE = re.compile(
    rf"(?<![\w.])[-+]?[0-9]+(?:\.[0-9]+)?(?!(?:{units.ATTACHED}|[eExX][0-9a-fA-F]+)(?!\w))([^\W\d_]+)(?!\w)"
)
CONVERSIONS = {  # unit -> advice for values that are far outside
    "us": "write microseconds, from any zero",
    "s": "write seconds, from any zero",
    "N": "write newtons (grams times 0.00981, millinewtons divided by 1000)",
    "mm": "write millimetres",
    "V": "write volts (millivolts divided by 1000), or set strain.sensor.unit: any for readings that are no voltages",
    "ohm": "write ohms, or set strain.sensor.unit: any",
    "any": "write readings of less than 1e9",
    "counts": "set touch.ingest.highest_count to 4095 for a converter of 12 bits, 65535 for 16",
    "1": "set highest and lowest of its area in glove.sensor.areas",
}


def unreadable(path: Path, fmt: Format) -> str | None:
    """Return the sentence for a log with no line, or too few lines, of the format; None where the reason is another.

    Quotes the usual line: of the lines at the log's start that consist of numbers, one with as many commas as most.
    """
    with path.open("rb") as file:
        start = file.read(START)
    lines = list(enumerate(start.decode("ascii", "replace").splitlines()[:LINES], start=1))
    filled = [(number, line) for number, line in lines if line.strip()]
    numbers = [(number, line.strip(" ")) for number, line in filled if ROW.fullmatch(line)]
    if not numbers or 2 * len(numbers) < len(filled):
        return in_words(path, filled, fmt)
    commas = Counter(line.count(",") for _, line in numbers).most_common(1)[0][0]
    alike = [(number, line) for number, line in numbers if line.count(",") == commas]
    number, line = alike[len(alike) // 2]
    wrong: str | None
    if commas == 2 * len(fmt.columns) - 2 and "." not in line:
        wrong = "decimals seem to have a comma; write them with a point"
    else:
        wrong = columns([line.split(",") for _, line in alike], line.split(","), fmt)
    return f"{path}: line {number} is {line[:QUOTED]!r}: {wrong}" if wrong else None


def in_words(path: Path, lines: list[tuple[int, str]], fmt: Format) -> str | None:
    """Return the sentence for a log whose lines are not numbers alone, or None; lines: (number, text), none empty."""
    lines = [(number, line) for number, line in lines if re.search("[0-9]", line)]
    if len(lines) < FEW_LINES:
        return None
    number, line = lines[len(lines) // 2]
    wrong = "words or units beside the numbers"
    if beside := next((found[1] for found in map(BESIDE.search, (text for _, text in lines)) if found), None):
        wrong = f"'{beside}' behind a number, which is no unit that is known here"
    if sum(bool(HEXADECIMAL.fullmatch(text)) for _, text in lines) > len(lines) / 2:
        wrong = "hexadecimal numbers; write them in decimal"
    return f"{path}: line {number} is {line[:QUOTED]!r}: {wrong}; a line is {fmt.shown} and nothing else"


def columns(rows: list[list[str]], usual: list[str], fmt: Format) -> str | None:
    """Say what is wrong with the numbers of lines that have as many as they should, or None.

    rows: the fields of each line; usual: the fields of the line to quote.
    """
    if len(usual) != len(fmt.columns):
        return None
    time = fmt.names.index(fmt.time)
    if not layout.is_number(usual[time].strip()):
        whole = "whole microseconds" if fmt.columns[time].integer else "seconds"
        return f"the time is no number; write {whole}, from any zero"
    values = [[float(field) for field in row] for row in rows if all(map(layout.is_number, map(str.strip, row)))]
    rising = np.mean(np.diff(np.array(values), axis=0) > 0, axis=0) if len(values) > 2 else np.ones(len(usual))
    if rising[time] < USUAL <= rising.max():
        return f"column {rising.argmax() + 1} seems to be the time; the order is {fmt.shown}"
    interval = np.median(np.diff([row[time] for row in values])) if len(values) > 1 else 0.0
    unit = fmt.columns[time].unit
    absolute = units.absolute(float(usual[time]), interval)
    if absolute and unit not in absolute:
        return f"the times are {' or '.join(absolute.values())}; write {unit}, from any zero"
    if interval * (1e-6 if unit == "us" else 1) > SLOW_S:
        return f"the time rises by {interval:g} {unit} per line; {CONVERSIONS[unit]}"
    for field, column in zip(usual, fmt.columns, strict=True):
        if column.integer and not re.fullmatch(r"\s*-?[0-9]+\s*", field):
            if column.name == fmt.time:
                if interval >= 1 and float(field).is_integer():
                    return f"{column.name} has decimals; write whole microseconds, {float(field):.0f}"
                return f"{column.name} is no whole number; write whole microseconds (seconds times 1,000,000)"
            high = f"{column.high:g}"
            return f"{column.name} is no whole number; write the converter's counts, {column.low:g} to {high}"
    return beyond([usual], fmt)


def beyond(rows: Iterable[list[str]], fmt: Format) -> str | None:
    """Name the first value that is outside its column's range, and what to do, or None; rows: the fields of lines."""
    for row in rows:
        for field, column in zip(row, fmt.columns, strict=False):
            if layout.is_number(field.strip()) and not column.low <= float(field) <= column.high:
                span = f"{column.low:g} to {column.high:g}{'' if column.unit == '1' else f' {column.unit}'}"
                return f"{column.name} is {float(field):g}, outside {span}; {CONVERSIONS[column.unit]}"
    return None


def without_values(path: Path, rejects: Iterable[Mapping], fmt: Format) -> str | None:
    """Return the sentence for a log of which many lines lack a value, or None; rejects: rows of `parse.REJECTS`."""
    for reject in rejects:
        fields = (reject["text"] or "").split(fmt.separator)
        lacking = [k for k, field in enumerate(fields) if layout.is_missing(field.strip())]
        if len(fields) == len(fmt.columns) and lacking:
            names = ", ".join(fmt.names[k] for k in lacking[:5])
            return (
                f"{path}: line {reject['line']} is {reject['text'][:QUOTED]!r}: no value of {names}, as in many lines; "
                f"mend the wire or the program, or, to take the value before, write {path.name}: {{missing: previous}} "
                "into the block ingest.format of settings.yaml"
            )
    return None


def out_of_range(path: Path, rejects: Iterable[Mapping], fmt: Format) -> str | None:
    """Return the sentence for a log with too many lines out of range, or None; rejects: rows of `parse.REJECTS`."""
    for reject in rejects:
        if reject["reason"] == OUT_OF_RANGE and (wrong := beyond([reject["text"].split(",")], fmt)):
            return f"{path}: line {reject['line']} is {reject['text'][:QUOTED]!r}: {wrong}"
    return None


def missing(path: Path, fmt: Format, known: Iterable[str]) -> str:
    """Return the sentence for a log that is not there; it names the folder's files whose names are not `known`."""
    others = sorted(other.name for other in path.parent.iterdir() if other.name not in set(known))
    if not others:
        return f"{path}: log not found; add it, with lines of {fmt.shown}"
    listed = ", ".join(others[:5]) + (", ..." if len(others) > 5 else "")
    return f"{path}: log not found; the folder has {listed}: if that is it, rename it"
