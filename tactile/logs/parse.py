"""Read raw serial logs: every line becomes a typed row or a reject with its line number and reason.

A log is read in pieces of about 4 MiB. pyarrow parses a piece straight to typed columns; only a piece that it cannot
parse is examined line by line, at first in numpy, at last in Python. One fault cannot be seen, because serial lines
carry no checksum: a torn line that still has the right number of columns, all in range.
"""

import functools
import os
import re
import unicodedata
from bisect import bisect_left, bisect_right
from collections import deque
from collections.abc import Iterable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from itertools import chain, islice
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pyarrow as pa
import pyarrow.csv

from tactile.base.errors import InputError
from tactile.base.files import UNFINISHED
from tactile.base.params import file_of
from tactile.logs import layout as layouts
from tactile.logs import packets, units
from tactile.logs.formats import (
    COLUMNS,
    DUPLICATE,
    EMPTY,
    NOT_A_NUMBER,
    NOT_AN_INTEGER,
    OUT_OF_ORDER,
    OUT_OF_RANGE,
    REASONS,
    REPEATED,
    TEXT,
    UNREADABLE,
    Format,
    second,
)

REJECTS = pa.schema([("file", pa.string()), ("line", pa.int64()), ("reason", pa.string()), ("text", pa.string())])

PACKET = b"packet_s"  # key in the metadata of rows whose lines came in packets

TEXT_LENGTH = 200  # characters of a rejected line that are kept
TEXTS = 1000  # rejected lines per reason whose text is kept; all others keep their number and reason
PIECE = 1 << 22  # bytes parsed at once; 4 MiB was the fastest of 1 to 8 MiB
LONGEST_HEADER = 1 << 16  # bytes
LONGEST_LINE = 64 << 20  # bytes; a file without line ends must not fill the memory
HOPELESS = 100_000  # lines rejected before the first good one: the file is no log, reading stops
MOST_KNOWN = 1000  # different lines whose reason is remembered: a device that is stuck repeats itself
BLOCK = 1 << 18  # rows out of order that are examined together
MOST_RESETS = 1000  # a device that starts more often does not run
LONGEST_S = 1e5  # 28 hours; one wrong time at the end must not make a log last years
MOST_NOTED = 1000  # lines per piece that are noted because the clock does not rise; others are read again
HEAD = 200  # lines; banners and comments before the names of the columns are fewer
LISTED = 6  # names in a sentence
LONGEST_NAME = 40  # characters
MOST_STEPS = 20_000  # values of which the finest step is taken
TURN, WRAPPED_US = 2**32, 10_000_000  # us after which micros() begins anew; how near lines are to it
STRAY = 100  # lines; a clock that stays back for longer was reset, a shorter stretch is out of order


def printed(line: bytes, fmt: Format, where: str) -> Format | None:
    """Return the format with its columns in the order in which a header names them, or None for a line that is none.

    A header has as many fields as the format has columns, each of them a name: one word, or two, such as `Fz (N)`.
    Besides, it holds one of the format's names or a word for time, or has three fields or more; so `HX711, ready` is a
    banner. Capitals, blanks, quotation marks and brackets do not matter: that is fz_n. A part of the usual header,
    where a capture began or a line was torn, is a banner too; so is what follows a comment sign, unless it names all
    columns.

    Names of which the format has none are in the usual order where that shows: a time in its place, and beside it one
    name, such as `Time,Force`, or one word with numbers that rise by one, such as `Time,Ch1,Ch2`. Raises InputError, in
    a sentence that `where` begins (file and line), for other names that the format has not, for one that is there
    twice, and for one that is missing.
    """
    text, separator = _content(line).strip(), fmt.separator.encode()
    bare = text.lstrip(b"#%;/ \t")
    fields = bare.split(separator)
    if text in fmt.header.encode() and text != fmt.header.encode():
        return None
    if not all(len(field) <= LONGEST_NAME and _NAME.fullmatch(field) and len(field.split()) <= 2 for field in fields):
        return None
    names = [_plain(field.decode()) for field in fields]
    known = [name for name in names if name in fmt.names]
    if len(names) != len(fmt.columns):
        # Data lines of another width are rejected anyway; these may have the usual width.
        if len(set(known)) == len(names) > 1 and bare == text:
            raise InputError(f"{where} names {len(names)} columns without {_listed(fmt.names, known)}; {_RENAME}")
        return None
    if sorted(names) == sorted(fmt.names):
        return replace(fmt, columns=tuple(fmt.columns[fmt.names.index(name)] for name in names))
    if bare != text or not (known or len(names) > 2 or any(map(_TIME.match, names))):
        return None
    if not known and _in_turn(names, fmt):
        return fmt
    if _TIME.match(names[fmt.names.index(fmt.time)]):
        _check_units(line, fmt, where)
    if strange := [field.decode().strip() for field, name in zip(fields, names, strict=True) if name not in fmt.names]:
        raise InputError(
            f"{where} names the column{'s' * (len(strange) > 1)} {_listed(strange)}; known are "
            f"{_listed(fmt.names)}; {_RENAME}"
        )
    twice = next(name for name in names if names.count(name) > 1)
    raise InputError(f"{where} names {twice} twice and not {_listed(fmt.names, names)}; {_RENAME}")


_RENAME = "rename the columns, or remove the header line if the columns are in the usual order"
_NAME = re.compile(rb"""[ \t"']*[A-Za-z_][\w .%/-]*([\[(][\w/% .]*[\])])?[ \t"']*""", re.ASCII)
_TIME = re.compile(r"t(ime(_?stamp)?)?(_|$)")


def _plain(name: str) -> str:
    """Return a column's name in small letters, with underscores for all that is no letter or digit."""
    return re.sub(r"[^a-z0-9]+", "_", name.lower()).strip("_")


def _in_turn(names: list[str], fmt: Format) -> bool:
    """Tell whether names are a time, where the format's is, and one other, or a word with numbers that rise by one."""
    at = fmt.names.index(fmt.time)
    others = [name for k, name in enumerate(names) if k != at]
    if not _TIME.match(names[at]):
        return False
    if len(others) == 1:
        return True
    numbered = [found for name in others if (found := re.fullmatch(r"(.*?)(\d+)", name))]
    if len(numbered) < len(others):
        return False
    words, numbers = {each[1] for each in numbered}, [int(each[2]) for each in numbered]
    return len(words) == 1 and numbers == list(range(numbers[0], numbers[0] + len(numbers)))


def _listed(names: Iterable[str], without: Iterable[str] = ()) -> str:
    """Return names for a sentence, the middle ones left out where there are many."""
    names = [name for name in names if name not in set(without)]
    return ", ".join(names if len(names) <= LISTED else [*names[:2], "...", names[-1]])


def is_header(line: bytes, fmt: Format) -> bool:
    """Tell whether a line names the columns in the order of `fmt`, by these names or by others that `printed` takes."""
    try:
        found = printed(line, fmt, "")
    except InputError:  # which is the answer
        return False
    return found is not None and found.names == fmt.names


def printed_format(path: Path, fmt: Format) -> Format:
    """Return the format of a log's lines: `fmt`, its columns in the order of the log's header, where it has one.

    The header is line 1, or the first one among the first `HEAD` lines, before the first line of numbers: boot text and
    comments may stand above it. Errors as `printed`; a file that is missing or empty has no header.
    """
    if not path.is_file():
        return fmt
    found = None
    with path.open("rb") as file:
        for number in range(1, HEAD + 1):
            line = file.readline(LONGEST_HEADER)
            if number == 1:
                line = line.removeprefix(b"\xef\xbb\xbf")
            fields = _content(line).split(fmt.separator.encode())
            if not line.endswith(b"\n") or len(fields) == len(fmt.columns) and all(map(_FLOAT.fullmatch, fields)):
                break
            where = f"{path}: line {number}"
            if found is None and (found := printed(line, fmt, where)):
                _check_units(line, found, where)
            elif len(fields) == len(fmt.columns) and units.are_units(list(map(_text, fields)), below=found is not None):
                _check_units(line, found or fmt, where, below=found is not None)
    return found or fmt


def _text(field: bytes) -> str:
    """Return a name of a header as text."""
    return field.decode("utf-8", "replace").strip(" \t'\"")


def _check_units(line: bytes, fmt: Format, where: str, below: bool = False) -> None:
    """Raise InputError where a header of columns in the order of `fmt` names another unit than a column's own.

    below: it stands below the names.
    """
    names = [_text(name) for name in _content(line).lstrip(b"#%;/ \t").split(fmt.separator.encode())]
    names = units.of_header(names, below)
    for name, column in zip(names, fmt.columns, strict=True):
        units.check(units.named(name, column.unit), column, f"{where} names the column '{name}'")


class _Rejects:
    """Rejected lines by column: 10 million of them take 50 MB."""

    def __init__(self) -> None:
        self.numbers: list[np.ndarray] = []  # int32, from 1, rising within an array
        self.codes: list[np.ndarray] = []  # int8, places in REASONS
        self.texts: dict[int, str] = {}  # of the first TEXTS lines of each reason, by number
        self.counts = np.zeros(len(REASONS), np.int64)

    def add(self, numbers: np.ndarray, codes: np.ndarray) -> list[int]:
        """Take lines (n,) with their reasons (n,); return the numbers of the lines whose text is to be kept."""
        self.numbers.append(numbers.astype(np.int32))
        self.codes.append(codes)
        wanted = numbers[_first_of_each(codes, self.counts)].tolist()
        self.counts += np.bincount(codes, minlength=len(REASONS))
        return wanted

    def reasons(self) -> dict[str, int]:
        """Return the number of rejected lines per reason."""
        return {reason: count for reason, count in zip(REASONS, self.counts.tolist(), strict=True) if count}

    def lines(self, reason: str) -> np.ndarray:
        """Return the numbers of the lines rejected for one reason, int32."""
        code = REASONS.index(reason)
        chosen = [numbers[codes == code] for numbers, codes in zip(self.numbers, self.codes, strict=True)]
        return np.concatenate([np.zeros(0, np.int32), *chosen])

    def table(self, name: str) -> pa.Table:
        """Return all as REJECTS, in the order of the lines, with `name` as file; null stands for a text not kept."""
        if not self.numbers:
            return REJECTS.empty_table()
        numbers, codes = np.concatenate(self.numbers), np.concatenate(self.codes)
        rising = np.argsort(numbers, kind="stable")  # quick where they rise already
        numbers, codes = numbers[rising], codes[rising]
        kept = np.array(sorted(self.texts), np.int32)
        place = np.searchsorted(kept, numbers).clip(max=len(kept) - 1)
        texts_kept = pa.array([self.texts[number] for number in kept.tolist()], pa.string())
        columns = [
            pa.repeat(name, len(numbers)),
            numbers.astype(np.int64),
            pa.array(REASONS).take(pa.array(codes)),
            texts_kept.take(pa.array(place, mask=kept[place] != numbers)),
        ]
        return pa.table(columns, schema=REJECTS)


def _first_of_each(codes: np.ndarray, before: np.ndarray) -> np.ndarray:
    """Return the places, rising, of the first lines per reason whose text is kept; before: lines per reason so far."""
    places = [np.flatnonzero(codes == code)[: max(0, TEXTS - before[code])] for code in np.unique(codes)]
    return np.sort(np.concatenate([np.zeros(0, np.int64), *places]))


def read_log(
    path: Path, fmt: Format, name: str | None = None, limit: float = 1.0, key: str = "", layout: Mapping | None = None
) -> tuple[pa.Table, pa.Table]:
    """Read a log: `(rows, rejects)`; rows + rejects (+ 1 if line 1 is the header) = lines of the file.

    A header before the first line of numbers says in which order the columns are, see `printed`; without one they are
    in the format's. `rows` has the format's columns in the format's order, `line` (int32, from 1) and `segment` (int16,
    from 0; a new one after each reset of the device); its time rises strictly within a segment. Lines that came in
    packets have the times at which they were printed, see `packets.spread`, and `packet_s` tells it. `rejects` has the
    columns of `REJECTS` in the order of the lines, with `name` (default: the file's name) as its file; the text of a
    line is null after the first `TEXTS` lines of its reason. layout: how the lines are laid out, as of `layout.of`,
    where it is another than the format's; then lines that belong to no row, such as empty ones, are not counted.

    Raises InputError when the file is missing or empty, has a header of other names or, further on, of another order,
    has no line of this format, lasts more than `LONGEST_S`, is of a device that was reset more than `MOST_RESETS`
    times, or when more than the share `limit` of its lines is rejected (as soon as that is certain); `key`: the name of
    that limit in params.yaml.
    """
    if not path.is_file():
        raise InputError(f"{path}: log not found; name a log that is there")
    names = fmt.names
    if layout is None:
        fmt = printed_format(path, fmt)
        pieces, rejects, lines, noted = _parse_file(path, fmt, limit, key)
    else:
        pieces, rejects, lines, noted = _parse_laid_out(path, fmt, layout)
    if not pieces:
        raise InputError(_nothing_parsed(path, fmt, lines) if layout is None else _nothing_laid_out(path))

    time = np.concatenate([piece[fmt.time].to_numpy() for piece in pieces])
    line = np.concatenate([piece["line"].to_numpy() for piece in pieces])
    time, wrapped = unwrapped(time, second(fmt))
    lines = len(line) + sum(rejects.reasons().values())  # without the header
    back = np.count_nonzero(time[1:] < time[:-1])
    if back > HOPELESS:  # each is a reset, a copy of a line or a lost line, but to find out which takes minutes
        lost = {OUT_OF_ORDER: max(0, int(back) - MOST_RESETS - (len(time) - len(np.unique(time))))}
        check_rejects(path, lines, rejects.reasons() | lost, limit, key)
    if layout is None:
        _check_headers(path, fmt, rejects)
    keep, segment = order(time, line, rejects.lines(TEXT))
    _check_clock(path, fmt, time[keep], line[keep], segment[keep])
    wanted = []
    if not keep.all():
        dropped = np.flatnonzero(~keep)
        blocks = np.split(dropped, range(BLOCK, len(dropped), BLOCK))  # ordering takes 100 bytes per row
        codes = np.concatenate([_order_codes(pieces, fmt, time, block, keep, segment) for block in blocks])
        wanted = rejects.add(line[dropped], codes)
    check_rejects(path, lines, rejects.reasons(), limit, key)
    unknown = [number for number in wanted if number not in noted]
    known = noted | dict(zip(unknown, texts(path, unknown) if unknown else [], strict=True))
    rejects.texts |= {number: text for number in wanted if (text := known[number]) is not None}
    printed_at, rate = packets.spread(time[keep], segment[keep], second(fmt) * 1e-6)
    new_times = rate.packet or wrapped
    if not new_times:
        del printed_at  # of the times as they are
    del time, line  # a third of what is in memory
    start = 0
    for index, piece in enumerate(pieces):  # one by one, so that the log is never in memory twice
        rows = slice(start, start + piece.num_rows)
        start = rows.stop
        piece = piece.append_column("segment", pa.array(segment[rows], pa.int16()))
        pieces[index] = piece if keep[rows].all() else piece.filter(pa.array(keep[rows]))
    rows = pa.concat_tables(pieces).select([*names, "line", "segment"])
    if new_times:
        place = rows.column_names.index(fmt.time)
        rows = rows.set_column(place, rows.schema.field(place), pa.array(printed_at))
    if rate.packet:
        rows = rows.replace_schema_metadata({PACKET: repr(rate.packet / second(fmt))})
    return rows, rejects.table(path.name if name is None else name)


def _check_headers(path: Path, fmt: Format, rejects: _Rejects) -> None:
    """Raise InputError for a further header, as after a restart, of another order, other columns or other units.

    Words of which none is known or is a time are a banner, `array, ready, go`.
    """
    for number, text in rejects.texts.items():
        names = list(map(_plain, text.split(fmt.separator)))
        if len(text) >= TEXT_LENGTH or not any(name in fmt.names or _TIME.match(name) for name in names):
            continue  # a longer text was cut
        line, where = text.encode(), f"{path}: line {number}"
        try:
            if found := printed(line, fmt, where):
                _check_units(line, found, where)
        except InputError as error:
            raise InputError(
                f"{where} names the columns {text.strip()}, which are others than above, or in another unit; divide "
                "the log there"
            ) from error
        if found and found.names != fmt.names:
            raise InputError(f"{where} names the columns in another order than those above; divide the log there")


def finest_step(values: np.ndarray) -> float:
    """Return the least difference between two values, of the first ones of many; inf where all are alike."""
    apart = np.diff(np.unique(values[:MOST_STEPS]))
    return float(apart.min()) if len(apart) else np.inf


def unwrapped(time: np.ndarray, second: float) -> tuple[np.ndarray, bool]:
    """Return times (n,) of which microseconds of 32 bits go on after they began anew, and whether any did.

    Arduino's micros() begins anew at 0 after 2**32, or 71.6 minutes, or at -2**31 where it is printed with a sign.
    A clock that was reset starts elsewhere: both sides have to be within WRAPPED_US of the two ends.
    """
    if second != 1e6 or len(time) < 3:
        return time, False
    back = np.flatnonzero(np.diff(time[1:]) < -(2**31)) + 2
    before, after = time[back - 1], time[back]
    near = (after + TURN - before < WRAPPED_US) & (np.abs(time[back - 2] - before) < WRAPPED_US)
    ends = (abs(before - TURN) < WRAPPED_US) | (abs(before - TURN // 2) < WRAPPED_US)
    if not (begun := back[near & ends]).size:
        return time, False
    turns = np.zeros(len(time), np.int64)
    turns[begun] = TURN
    return time + np.cumsum(turns), True


def packet_s(rows: pa.Table) -> float | None:
    """Return the time in s between the packets in which the lines of a log came; None where they did not."""
    return float(rows.schema.metadata[PACKET]) if rows.schema.metadata else None


def texts(path: Path, numbers: list[int]) -> list[str | None]:
    """Return the lines with these numbers (from 1, rising) as printable text, cut to TEXT_LENGTH characters.

    None stands for the text of a line that ends in CR alone.
    """
    printable: list[str | None] = []
    first = 1  # the number of a piece's first line
    for piece in _pieces(path, packed=True):
        count = piece.count(b"\n") + (not piece.endswith(b"\n"))
        wanted = numbers[len(printable) : bisect_left(numbers, first + count)]
        if wanted:
            ends = np.flatnonzero(np.frombuffer(piece, dtype=np.uint8) == ord("\n")) + 1
            edges = [0, *ends.tolist(), len(piece)]
            printable += [_printable(piece[edges[number - first] : edges[number - first + 1]]) for number in wanted]
        first += count
        if len(printable) == len(numbers):
            break
    return printable + [None] * (len(numbers) - len(printable))


def add_rejects(rejects: pa.Table, path: Path, numbers: np.ndarray, reason: str, name: str | None = None) -> pa.Table:
    """Return the rejects of a log with further lines, which its experiment cannot use, in the order of the lines.

    rejects: as `read_log` returns them; numbers: (n,), rising, of the further lines; reason: the same for all of them;
    `name` (default: the file's name): the log's name in `rejects`.
    """
    first = numbers[:TEXTS].tolist()
    known = pa.array(texts(path, first) if first else [], pa.string())
    columns = [
        pa.repeat(path.name if name is None else name, len(numbers)),
        numbers.astype(np.int64),
        pa.repeat(reason, len(numbers)),
        pa.concat_arrays([known, pa.nulls(len(numbers) - len(first), pa.string())]),
    ]
    return pa.concat_tables([rejects, pa.table(columns, schema=REJECTS)]).sort_by("line")


def folders(source: Path, pattern: str) -> list[Path]:
    """Return the folders in `source` that match, sorted, without what systems and editors leave there."""
    found = sorted(path for path in source.glob(pattern) if path.is_dir())
    return [path for path in found if not any(_LITTER.match(name) for name in path.relative_to(source).parts)]


_LITTER = re.compile(rf"\.(?!\.)|__MACOSX$|.*{re.escape(UNFINISHED)}$")  # hidden folders, such as .ipynb_checkpoints


def check_names(recordings: Iterable[Path]) -> None:
    """Raise InputError for the first recording whose path `<source>/<condition>/<recording>` is no line of text.

    Tables and figures show these names. A name with a line break, another control character, or bytes that are no UTF-8
    cannot stand in them; any other name can. Nor can two that look alike, written with other code points.
    """
    looks: dict[str, tuple[str, ...]] = {}
    for path in recordings:
        for names in (path.parts[-2:-1], path.parts[-2:]):
            if looks.setdefault(unicodedata.normalize("NFC", "/".join(names)), names) != names:
                raise InputError(
                    f"{path}: the folder name {ascii(names[-1])} looks like another, in other Unicode "
                    "characters; rename one of them"
                )
        for name in path.parts[-3:]:
            if any(unicodedata.category(character) in ("Cc", "Cs", "Zl", "Zp") for character in name):
                raise InputError(
                    f"{ascii(str(path))[1:-1]}: the folder name {ascii(name)} has a line break, another control "
                    "character or bytes that are no UTF-8; rename the folder"
                )


def check_rejects(
    path: Path, lines: int, reasons: Mapping[str, int], limit: float, key: str, following: int = 0
) -> None:
    """Raise InputError when more than the share `limit` of the lines is rejected; `reasons`: rejected lines per reason.

    Exact copies of other lines do not count, as nothing is lost with them. key: the dotted name of the limit, a
    setting; following: how many more lines the file may have, all of them good.
    """
    lines, reasons = lines - reasons.get(DUPLICATE, 0), {name: n for name, n in reasons.items() if name != DUPLICATE}
    count = sum(reasons.values())
    if count > limit * (lines + following):
        reason = max(sorted(reasons), key=reasons.__getitem__)
        more = "; its times have too few digits: write more, or set repeats: spread in its format"
        of = f"the first {lines}" if following else f"the {lines}"
        raise InputError(
            f"{path}: {count / lines:.1%} of {of} lines cannot be used, most often '{reason}' "
            f"({reasons[reason]} lines), and the limit is {limit:.1%}"
            f"{more if reason == REPEATED else ''}; fix or remove the recording, or raise {key} in {file_of(key)}"
        )


def order(time: np.ndarray, line: np.ndarray, text_lines: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Find the rows that are in the order of time, and the places where the device was reset.

    `time`, `line`: (n,), any unit of time and the line numbers; `text_lines`: the line numbers of banners.
    Returns `keep` (n,) bool and `segment` (n,) int32. Where the clock steps back, the shorter side is out of order:
    the lines after the step, up to the first line later than all lines before it, or the lines before the step that
    are not earlier (a corrupt time far in the future). More than `STRAY` lines on both sides, or a banner in between
    and at least three lines after, are a reset. Rows after one reset more than `MOST_RESETS` are not judged.
    """
    repeated = np.concatenate([[False], time[1:] == time[:-1]])
    if repeated.any():  # all at once, because a clock that stands still repeats itself a million times
        keep, segment = ~repeated, np.zeros(len(time), dtype=np.int32)
        keep[~repeated], segment[~repeated] = order(time[~repeated], line[~repeated], text_lines)
        return keep, np.maximum.accumulate(segment)
    n = len(time)
    keep = np.ones(n, dtype=bool)
    starts = [0]
    # Lists: of 40,000 resets each asks three times for one place, which takes numpy 4 us and bisect 0.3 us.
    drops, text_lines = (np.flatnonzero(time[1:] <= time[:-1]) + 1).tolist(), text_lines.tolist()
    last, at = 0, 1  # the last row kept, the first row not yet judged
    while at < n and len(starts) <= MOST_RESETS + 1:  # after more, the log is refused
        if time[at] > time[last]:
            following = bisect_right(drops, at)
            stop = drops[following] if following < len(drops) else n
            last, at = stop - 1, stop
            continue
        window = slice(max(starts[-1], at - 10 * STRAY), at)
        kept = np.flatnonzero(keep[window])[-STRAY - 1 :] + window.start
        before = kept[time[kept] >= time[at]]
        later = time[at : at + STRAY + 1] > time[last]
        after = int(np.argmax(later)) if later.any() else len(later)
        banner = bisect_left(text_lines, int(line[at])) > bisect_left(text_lines, int(line[last]))
        if min(len(before), after) > STRAY or (banner and after >= 3):
            starts.append(at)
            last, at = at, at + 1
        elif after <= len(before):
            keep[at : at + after] = False
            at += after
        else:
            keep[before] = False
            if len(before) == len(kept) and window.start == starts[-1]:
                starts[-1] = at  # no row is left before this one: the segment starts here
            last, at = at, at + 1
    segment = np.zeros(n, dtype=np.int32)
    segment[starts[1:]] = 1
    return keep, np.cumsum(segment, dtype=np.int32)


def _check_clock(path: Path, fmt: Format, time: np.ndarray, line: np.ndarray, segment: np.ndarray) -> None:
    """Raise InputError for a log whose kept rows, (n,) each, last too long or have too many resets to be real."""
    if segment[-1] > MOST_RESETS:
        raise InputError(f"{path}: the device was reset more than {MOST_RESETS} times; check its supply, record again")
    ends = np.append(np.flatnonzero(np.diff(segment)), len(time) - 1)  # the last row of each segment
    starts = np.append(0, ends[:-1] + 1)
    lasts = float((time[ends] - time[starts]).sum()) / second(fmt)
    if lasts > LONGEST_S:
        interval = np.where(segment[1:] == segment[:-1], np.diff(time), 0) / second(fmt)
        at, remedy = int(np.argmax(interval)), "divide the log"
        if lasts - interval[at] <= LONGEST_S:
            jump = f"the clock jumps by {interval[at]:.0f} s in line {line[at + 1]}"
            remedy = f"{jump}; remove that line if it is wrong, or divide the log"
        raise InputError(f"{path}: lasts {lasts:.0f} s, more than the {LONGEST_S:.0f} s of a log; {remedy}")


class _Piece(NamedTuple):
    """One piece of a log, parsed; lines are numbered from 0 in the piece."""

    rows: pa.Table  # typed, with `line` (int32)
    bad: np.ndarray  # (rejects,) lines, rising
    codes: np.ndarray  # (rejects,) int8, places in REASONS
    texts: dict[int, str]  # of the first TEXTS lines per reason
    noted: dict[int, str]  # texts of the first MOST_NOTED rows whose time does not rise
    lines: int
    size: int  # bytes


def _parse_file(
    path: Path, fmt: Format, limit: float, key: str
) -> tuple[list[pa.Table], _Rejects, int, dict[int, str]]:
    """Parse a file: typed tables with a `line` column, rejects, the number of lines read, and lines noted.

    Noted are the texts of lines whose time does not rise, by number: as a rule they are rejected later. Raises
    InputError once more lines are rejected than the rest of the file can make up for.
    """
    tables: list[pa.Table] = []
    rejects = _Rejects()
    noted: dict[int, str] = {}
    lines, left = 0, path.stat().st_size
    pieces = _pieces(path)
    first = next(pieces, b"")
    header, _, rest = first.partition(b"\n")
    if is_header(header, fmt):
        first, lines = rest, 1
    pieces = chain([first] if first else [], pieces)
    workers = os.cpu_count() or 1
    pool = ThreadPoolExecutor(workers)
    try:
        waiting = deque(pool.submit(_parse_piece, piece, fmt) for piece in islice(pieces, 2 * workers))
        while waiting:
            piece = waiting.popleft().result()
            waiting.extend(pool.submit(_parse_piece, following, fmt) for following in islice(pieces, 1))
            if piece.rows.num_rows:
                number = pa.array(piece.rows["line"].to_numpy() + np.int32(lines + 1))
                tables.append(piece.rows.set_column(piece.rows.num_columns - 1, "line", number))
            for wanted in rejects.add(piece.bad + lines + 1, piece.codes) if len(piece.bad) else ():
                rejects.texts[wanted] = piece.texts[wanted - lines - 1]
            noted |= {lines + 1 + index: text for index, text in piece.noted.items()}
            lines, left = lines + piece.lines, left - piece.size
            if waiting and tables:
                shortest = 2 * len(fmt.columns)  # bytes of a good line: one digit per column, separators, the line end
                check_rejects(path, lines, rejects.reasons(), limit, key, following=(left + 1) // shortest)
            elif not tables and sum(rejects.reasons().values()) > HOPELESS:
                break
    finally:
        pool.shutdown(cancel_futures=True)
    return tables, rejects, lines, noted


def _parse_laid_out(path: Path, fmt: Format, layout: Mapping) -> tuple[list[pa.Table], _Rejects, int, dict[int, str]]:
    """Parse a file of another layout as `_parse_file` does; errors as `layout.Reader`."""
    tables: list[pa.Table] = []
    noted: dict[int, str] = {}
    rejects, lines = _Rejects(), 0
    for block in layouts.lines(path, layout, fmt):
        good, bad = ([line for line in block if (line.reason is None) == wanted] for wanted in (True, False))
        if bad:
            bad.sort()  # copies are known after later lines
            printed_as = {line.number: line.text for line in bad}
            codes = np.array([REASONS.index(line.reason) for line in bad], np.int8)
            for wanted in rejects.add(np.array(list(printed_as), np.int32), codes):
                rejects.texts[wanted] = _printable(printed_as[wanted].encode("utf-8", "replace"))
        if good:
            number = np.array([line.number for line in good], np.int32)
            piece = _parse_piece("".join(f"{line.text}\n" for line in good).encode("utf-8", "replace"), fmt)
            for wanted in rejects.add(number[piece.bad], piece.codes) if len(piece.bad) else ():
                rejects.texts[wanted] = piece.texts[int(np.searchsorted(number, wanted))]
            noted |= {int(number[index]): text for index, text in piece.noted.items()}
            if piece.rows.num_rows:
                place, rows = piece.rows.num_columns - 1, number[piece.rows["line"].to_numpy()]
                tables.append(piece.rows.set_column(place, "line", pa.array(rows)))
        lines += len(block)
        if not tables and lines > HOPELESS:
            break
    return tables, rejects, lines, noted


def _pieces(path: Path, packed: bool = False) -> Iterator[bytes]:
    """Yield the file in pieces of whole lines, without the byte order mark that some editors put first.

    packed: it may be compressed by gzip.
    """
    carry: list[bytes] = []
    with layouts.opened(path) if packed else path.open("rb") as file:
        if file.read(3) != b"\xef\xbb\xbf":
            file.seek(0)
        while block := file.read(PIECE):
            cut = block.rfind(b"\n") + 1
            if not cut:
                carry.append(block)
                if len(carry) * PIECE > LONGEST_LINE:
                    raise InputError(
                        f"{path}: no line end within {LONGEST_LINE >> 20} MiB, so this is no text log; "
                        "put the file that the device printed there"
                    )
                continue
            yield b"".join([*carry, block[:cut]])
            carry = [block[cut:]]
    if last := b"".join(carry):
        yield last


def _parse_piece(piece: bytes, fmt: Format) -> _Piece:
    """Return the rows and rejects of a piece of whole lines.

    Three passes, each dearer than the one before and more seldom needed: without the lines that are too short, then
    without the lines with an empty field or a byte that no number has, then without the lines that `_reason` refuses.
    """
    data = np.frombuffer(piece, dtype=np.uint8)
    ends = np.flatnonzero(data == ord("\n")) + 1
    if not piece.endswith(b"\n"):
        ends = np.append(ends, len(piece))
    starts = np.concatenate([[0], ends[:-1]])
    good = ends - starts >= 2 * len(fmt.columns) - 1  # one digit per column and the separators
    rows = _typed(piece, starts, ends, good, fmt, wide=False)
    if rows is None:
        odd = ~_number_bytes(fmt)[data]
        between = (data == ord(fmt.separator)) | (data == ord("\n"))
        odd[1:] |= between[1:] & between[:-1]  # nothing between two separators
        good[np.searchsorted(ends, np.flatnonzero(odd), side="right")] = False
        rows = _typed(piece, starts, ends, good, fmt, wide=True)
    if rows is None:
        for index in np.flatnonzero(good):
            good[index] = _reason(piece[starts[index] : ends[index]], fmt) is None
        rows = _typed(piece, starts, ends, good, fmt, wide=True)
        if rows is None:
            raise AssertionError("a piece of lines that were all found good could not be parsed")
    table, line = rows
    possible = np.ones(len(line), dtype=bool)
    for column in fmt.columns:
        values = table[column.name].to_numpy()
        if len(values) and not (values.min() >= column.low and values.max() <= column.high):  # also for NaN
            possible &= (values >= column.low) & (values <= column.high)
    if not possible.all():
        table, line = table.filter(pa.array(possible)), line[possible]
    # From wide to the smallest types; a table that was not read wide stays as it is.
    table = table.cast(pa.schema([(column.name, column.type) for column in fmt.columns]))
    is_bad = np.ones(len(ends), dtype=bool)
    is_bad[line] = False
    bad = np.flatnonzero(is_bad)
    codes = _codes(piece, starts[bad], ends[bad], fmt)
    first = bad[_first_of_each(codes, np.zeros(len(REASONS), np.int64))]
    time = table[fmt.time].to_numpy()
    back = line[1:][time[1:] <= time[:-1]][:MOST_NOTED]
    texts, noted = ({k: _printable(piece[starts[k] : ends[k]]) for k in lines.tolist()} for lines in (first, back))
    rows = table.append_column("line", pa.array(line.astype(np.int32)))
    return _Piece(rows, bad, codes, texts, noted, len(ends), len(piece))


def _codes(piece: bytes, starts: np.ndarray, ends: np.ndarray, fmt: Format) -> np.ndarray:
    """Return the places in REASONS, (n,) int8, of lines that are no rows; starts, ends: (n,), of their bytes."""

    @functools.lru_cache(MOST_KNOWN)
    def code(raw: bytes) -> int:
        return REASONS.index(_reason(raw, fmt))

    lines = (piece[start:end] for start, end in zip(starts, ends, strict=True))
    return np.fromiter(map(code, lines), np.int8, len(starts))


def _typed(
    piece: bytes, starts: np.ndarray, ends: np.ndarray, good: np.ndarray, fmt: Format, wide: bool
) -> tuple[pa.Table, np.ndarray] | None:
    """Read the good lines as typed columns, with the line (from 0) of each row; None if a line is not of the format.

    A line with another number of columns is left out. `wide`: every integer as int64, so that a count of 99999 can be
    read and then be rejected as out of range.
    """
    line = np.flatnonzero(good)
    if len(line) < len(good):
        edges = np.flatnonzero(np.diff(np.concatenate([[0], good.astype(np.int8), [0]])))
        runs = zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True)
        piece = b"".join([piece[starts[first] : ends[stop - 1]] for first, stop in runs])
    if not len(line):
        return pa.schema([(column.name, column.type) for column in fmt.columns]).empty_table(), line
    if not piece.isascii() or b"x" in piece or b"X" in piece:  # pyarrow reads 0x10 as 16
        return None
    skipped: list[int] = []

    def skip(row: pyarrow.csv.InvalidRow) -> str:
        skipped.append(row.number - 1)  # row.number is None when use_threads is on
        return "skip"

    try:
        table = pyarrow.csv.read_csv(
            pa.BufferReader(piece),
            read_options=pyarrow.csv.ReadOptions(use_threads=False, column_names=fmt.names, block_size=len(piece) + 1),
            parse_options=pyarrow.csv.ParseOptions(
                delimiter=fmt.separator,
                quote_char=False,
                ignore_empty_lines=False,
                invalid_row_handler=skip,
            ),
            convert_options=pyarrow.csv.ConvertOptions(
                column_types={
                    column.name: pa.int64() if wide and column.integer else column.type for column in fmt.columns
                },
                null_values=[],
            ),
        )
    except pa.ArrowInvalid:
        return None
    if table.num_rows + len(skipped) != len(line):  # pyarrow also ends a line at a lone carriage return
        return None
    return table, np.delete(line, skipped) if skipped else line


def _number_bytes(fmt: Format) -> np.ndarray:
    """Return (256,) bool: the bytes that a good line of this format can have."""
    allowed = np.zeros(256, dtype=bool)
    letters = "" if all(column.integer for column in fmt.columns) else ".+eE"
    allowed[[ord(c) for c in f"0123456789- \t\r\n{fmt.separator}{letters}"]] = True
    return allowed


_INTEGER = re.compile(rb"[ \t]*-?[0-9]+[ \t]*")
# Written so that each byte can match in one way only: a megabyte of digits must not take hours.
_FLOAT = re.compile(rb"[ \t]*[-+]?([0-9]+(\.[0-9]*)?|\.[0-9]+)([eE][-+]?[0-9]+)?[ \t]*")
_NOT_FINITE = re.compile(rb"[ \t]*[-+]?(nan|inf)[a-z()]*[ \t]*", re.IGNORECASE)
_CONTROL = re.compile(rb"[^\t\x20-\x7e]")


def _reason(raw: bytes, fmt: Format) -> str | None:
    """Return the reason why a line is no row of this format, or None if it is one."""
    raw = _content(raw)
    if not raw.strip():
        return EMPTY
    if _CONTROL.search(raw):
        return UNREADABLE
    fields = raw.split(fmt.separator.encode())
    if len(fields) != len(fmt.columns):
        return TEXT if re.search(rb"[A-Za-z]{2}", raw) else COLUMNS
    if not any(_FLOAT.fullmatch(field) or _NOT_FINITE.fullmatch(field) for field in fields):
        return TEXT if re.search(rb"[A-Za-z]", raw) else NOT_A_NUMBER
    for field, column in zip(fields, fmt.columns, strict=True):
        if not _FLOAT.fullmatch(field):
            return NOT_A_NUMBER
        if column.integer and not _INTEGER.fullmatch(field):
            return NOT_AN_INTEGER
    for field, column in zip(fields, fmt.columns, strict=True):
        if not column.low <= float(field) <= column.high:
            return OUT_OF_RANGE
    return None


def _content(raw: bytes) -> bytes:
    """Return a line without its line end."""
    return raw.removesuffix(b"\n").removesuffix(b"\r")


def _printable(raw: bytes) -> str:
    """Return a line as printable text, cut to TEXT_LENGTH characters."""
    text = _content(raw)[: 4 * TEXT_LENGTH].decode("utf-8", errors="backslashreplace")
    characters = (c if c.isprintable() or c == "\t" else f"\\x{ord(c):02x}" for c in text[:TEXT_LENGTH])
    return "".join(characters)[:TEXT_LENGTH]


def _order_codes(
    pieces: list[pa.Table], fmt: Format, time: np.ndarray, dropped: np.ndarray, keep: np.ndarray, segment: np.ndarray
) -> np.ndarray:
    """Return the places in REASONS, int8, of the rows `dropped` (places, rising).

    A duplicate equals a kept row of its segment; one with other values at the time of the row before repeats the time;
    any other row is out of order. pieces: all rows of the log; time,
    keep, segment: (rows,), where `keep` is False for every dropped row.
    """
    rows = pa.concat_tables(pieces)
    twin = np.full(len(dropped), -1)
    for number in np.unique(segment[dropped]):
        first, stop = np.searchsorted(segment, [number, number + 1])
        kept = first + np.flatnonzero(keep[first:stop])
        if not len(kept):
            continue
        inside = slice(*np.searchsorted(dropped, [first, stop]))
        near = kept[np.searchsorted(time[kept], time[dropped[inside]]).clip(max=len(kept) - 1)]
        twin[inside] = np.where(time[near] == time[dropped[inside]], near, -1)
    repeats = (time[dropped] == time[np.maximum(dropped - 1, 0)]) & (dropped > 0)
    equal = twin >= 0
    for column in fmt.columns:
        alike = np.flatnonzero(equal)
        values, twins = (rows[column.name].take(pa.array(at[alike])).to_numpy() for at in (dropped, twin))
        equal[alike] = values == twins
    other = np.where(repeats, np.int8(REASONS.index(REPEATED)), np.int8(REASONS.index(OUT_OF_ORDER)))
    return np.where(equal, np.int8(REASONS.index(DUPLICATE)), other)


def _nothing_laid_out(path: Path) -> str:
    """Return the sentence for a file without a line of the layout that the settings say."""
    if not path.stat().st_size:
        return f"{path}: the file is empty; put the file that the device printed there"
    return (
        f"{path}: no line is laid out as `format` in the settings says; fix or remove the block, and `tactile check "
        "FOLDER` proposes another"
    )


def _nothing_parsed(path: Path, fmt: Format, lines: int) -> str:
    """Return the sentence for a file without a single good line."""
    expected = f"expected lines of {len(fmt.names)} columns, {fmt.shown}"
    if lines == 0:
        return f"{path}: the file is empty; {expected}"
    with path.open("rb") as file:
        first = _content(file.readline(4 * TEXT_LENGTH))
    if is_header(first, fmt):
        return f"{path}: the file has a header but no line of numbers; {expected}"
    reason = _reason(first, fmt)
    count = len(first.split(fmt.separator.encode()))
    fault = f"{reason}: " if reason in (EMPTY, UNREADABLE) else f"{count} column{'s' * (count > 1)}: "
    return f"{path}: no line can be read; line 1 has {fault}{_printable(first)[:60]!r}, {expected}"
