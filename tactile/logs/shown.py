"""Show a few lines of a log as they were printed, and under each what the reader made of every number in it."""

import codecs
import io
from collections.abc import Iterator, Mapping, Sequence
from itertools import islice
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pyarrow as pa

from tactile.logs import layout as layouts
from tactile.logs.formats import Column, Format, second

WIDTH = 120  # columns of a terminal
NO_UNIT = ("", "1", "any")
FIRST = 3  # lines of a log that cannot be read
LINES = 4  # of a frame of more, the middle ones are left out
LONGEST = 1 << 16  # characters of a line


class Chosen(NamedTuple):
    """A row to be shown."""

    row: int
    word: str  # why
    largest: int  # place among the readings of the one that is the largest


def lines(path: Path, rows: pa.Table, rejects: pa.Table, fmt: Format, laid_out: Mapping | None) -> Iterator[str]:
    """Yield the first row, one in the middle and that of the largest reading, then a line of each reason of rejects.

    rows, rejects: as `parse.read_log` returns them; fmt: the format that they are of; laid_out: their layout, None for
    the product's own.
    """
    readings = [column for column in fmt.columns if column.name != fmt.time]
    given = dict(laid_out or {})
    per_frame = given.get("lines_per_frame", 1)
    picked = chosen(rows, [column.name for column in readings])
    last = {one.row: rows["line"][one.row].as_py() for one in picked}
    before = per_frame - 1 + ("frame_begins" in given)
    wanted = sorted({number for end in last.values() for number in range(max(1, end - before), end + 1)})
    texts = printed(path, wanted, given.get("encoding", "utf-8"))
    start_s = rows[fmt.time][0].as_py() / second(fmt)
    for one in picked:
        end = last[one.row]
        numbers = [number for number in range(end - before, end + 1) if number in texts]
        label = f"line {end}" if len(numbers) == 1 else f"lines {numbers[0]} to {end}"
        shown = [texts[number] for number in numbers]
        if len(shown) > LINES:
            shown = [*shown[: LINES - 2], "...", shown[-1]]
        yield from _under(f"{label}{one.word}", shown)
        time_s = rows[fmt.time][one.row].as_py() / second(fmt)
        unit = next(column.unit for column in fmt.columns if column.name == fmt.time)
        when = f"{fmt.time} {rows[fmt.time][one.row].as_py()} us = {time_s:.3f} s" if unit == "us" else ""
        when = when or f"{fmt.time} {f'{time_s:.6f}'.rstrip('0').rstrip('.')} s"
        when += f", {time_s - start_s:.3f} s after line {last[picked[0].row]}" if one.row else ""
        values = [rows[column.name][one.row].as_py() for column in readings]
        yield from _values(when, readings, values, one.largest, _gain(given))
    reasons = dict.fromkeys(rejects["reason"].to_pylist())
    for reason in reasons:
        place = rejects["reason"].to_pylist().index(reason)
        text = rejects["text"][place].as_py()
        yield from _under(f"line {rejects['line'][place]} left out, {reason}", ["" if text is None else text])


def first_lines(path: Path) -> Iterator[str]:
    """Yield the first lines of a log of which none can be read."""
    with layouts.opened(path) as file:
        encoding = "utf-16" if file.read(2) in (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE) else "utf-8"
    for number, text in printed(path, list(range(1, FIRST + 1)), encoding).items():
        yield from _under(f"line {number} not read", [text])


def chosen(rows: pa.Table, names: Sequence[str]) -> list[Chosen]:
    """Return the first row, the middle one and that of the reading that is the farthest from 0, each once."""
    columns = [np.abs(rows[name].to_numpy()) for name in names]
    peaks = [int(column.argmax()) for column in columns]
    most = max(range(len(names)), key=lambda k: columns[k][peaks[k]])
    words = {peaks[most]: " (largest)", rows.num_rows // 2: "", 0: ""}
    if peaks[most] in (0, rows.num_rows // 2):
        words[peaks[most]] = " (largest)"
    return [Chosen(row, words[row], max(range(len(names)), key=lambda k: columns[k][row])) for row in sorted(words)]


def printed(path: Path, numbers: Sequence[int], encoding: str) -> dict[int, str]:
    """Return number -> text of lines of a log (from 1, rising), of characters that a terminal shows."""
    with layouts.opened(path) as file, io.TextIOWrapper(file, encoding, "replace", newline="") as text:
        end = layouts.line_end(text.read(LONGEST)) or "\n"
    with layouts.opened(path) as file, io.TextIOWrapper(file, encoding, "replace", newline=end) as text:
        found, at = {}, 0
        for number in numbers:
            if (line := next(islice(text, number - at - 1, None), None)) is None:
                break
            line = line.strip("\r\n\ufeff").expandtabs(4)
            found[number] = "".join(c if c.isprintable() else ascii(c)[1:-1] for c in line)
            at = number
    return found


def _gain(laid_out: Mapping) -> str:
    """Return the words for what a layout does to every reading; "" for nothing."""
    words = []
    for key, nothing, word in (("scale", 1, "times"), ("offset", 0, "plus")):
        value = laid_out.get(key, nothing)
        if isinstance(value, list):
            words.append(f"{word} the {key} of each")
        elif value != nothing:
            words.append(f"{word} {value:g}")
    said = [f"printed {' '.join(words)}"] if words else []
    said += [] if laid_out.get("rises_when_pressed", True) else ["turned, as it falls when pressed"]
    return f" ({', '.join(said)})" if said else ""


def _values(when: str, readings: Sequence[Column], values: Sequence, largest: int, gain: str) -> Iterator[str]:
    """Yield the line of what was read; the middle readings are left out where they do not fit, but for the largest."""
    units = ["" if column.unit in NO_UNIT else f" {column.unit}" for column in readings]
    alike = len(set(units)) == 1
    each = []
    for column, value, unit in zip(readings, values, units, strict=True):
        word = next((word for word, code in (column.words or {}).items() if code == value), f"{value + 0.0:.6g}")
        each.append(f"{column.name} {word}{'' if alike else unit}")
    tail = f"{units[0] if alike else ''}{gain}"
    for head in range(len(each), -1, -1):
        kept = sorted({*range(head), largest, *range(max(len(each) - 2, head), len(each))})
        parts = []
        for k, place in enumerate(kept):
            parts += ["..."] * (place > (kept[k - 1] + 1 if k else 0)) + [each[place]]
        text = f"    -> {when}; {', '.join(parts)}{tail}"
        if len(text) <= WIDTH:
            break
    yield text


def _under(label: str, texts: Sequence[str]) -> Iterator[str]:
    """Yield lines as they were printed, the first one behind a label; of a long one the middle is left out."""
    for k, text in enumerate(texts):
        begin = f"    {label}: " if k == 0 else " " * (len(label) + 6)
        room = WIDTH - len(begin)
        if len(text) > room:
            text = f"{text[: room * 2 // 3]} ... {text[-(room - room * 2 // 3 - 5) :]}"
        yield f"{begin}{text}"
