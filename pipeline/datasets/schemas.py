"""The contract between stages: the columns of every Parquet file that one stage writes and another reads."""

from collections import Counter
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pyarrow as pa
import pyarrow.parquet

from pipeline.base import files
from pipeline.base.errors import InputError

LONG = 1.5  # median intervals; a longer one means that a frame is missing

NAME = pa.dictionary(pa.int32(), pa.string())  # few different values, many rows

REJECTS = pa.schema(
    {
        "condition": NAME,
        "recording": NAME,
        "file": NAME,
        "line": pa.int64(),  # from 1
        "reason": NAME,
        "text": pa.string(),  # the start of the line, unprintable bytes escaped
    }
)


def frames(elements: int, touches: int, value: pa.DataType) -> pa.Schema:
    """Aligned frames, in the order of time within a recording.

    elements: values a frame, row-major from the bottom row; touches: simultaneous touches, NaN where there
    are fewer; value: int16 for ADC counts, float32 for other readings.
    """
    each = pa.list_(pa.float32(), touches)
    return pa.schema(
        {
            "condition": NAME,
            "recording": NAME,
            "segment": pa.int16(),  # of the array's log; a new one after every reset of the device
            "t_s": pa.float64(),  # on the first load cell's clock
            "gap_before": pa.bool_(),  # frames are missing before this one; also the first of a segment
            "v": pa.list_(value, elements),
            "force_n": each,
            "x_mm": each,
            "y_mm": each,
        }
    )


def gaps(time_s: np.ndarray, segment: np.ndarray) -> np.ndarray:
    """(n,) bool: rows after an interval of more than LONG medians; False where a segment starts."""
    interval = np.diff(time_s)
    same = segment[1:] == segment[:-1]
    median = np.median(interval[same]) if same.any() else np.inf
    return np.concatenate([[False], same & (interval > LONG * median)]) if len(time_s) else np.zeros(0, bool)


def gaps_before(t_s: np.ndarray, segment: np.ndarray) -> np.ndarray:
    """(n,) bool: frames that others are missing before, and the first of each segment."""
    first = np.ones(len(t_s), dtype=bool)
    first[1:] = segment[1:] != segment[:-1]
    return first | gaps(t_s, segment)


def frame_rows(
    schema: pa.Schema,
    condition: str,
    recording: str,
    *,
    segment: np.ndarray,
    t_s: np.ndarray,
    v: np.ndarray,
    force_n: np.ndarray,
    x_mm: np.ndarray,
    y_mm: np.ndarray,
    gap_before: np.ndarray | None = None,
) -> pa.Table:
    """One recording as a table of the schema `frames`, or a part of one, for which `gap_before` is given.

    segment, t_s, gap_before: (n,); v: (n, elements); force_n, x_mm, y_mm: (n, touches there are), padded with NaN.
    """
    n = len(t_s)
    columns = {
        "condition": [condition] * n,
        "recording": [recording] * n,
        "segment": segment,
        "t_s": t_s,
        "gap_before": gaps_before(t_s, segment) if gap_before is None else gap_before,
        "v": _lists(v, schema.field("v").type),
    }
    for name, values in (("force_n", force_n), ("x_mm", x_mm), ("y_mm", y_mm)):
        padded = np.full((n, schema.field(name).type.list_size), np.nan)
        padded[:, : values.shape[1]] = values
        columns[name] = _lists(padded, schema.field(name).type)
    return pa.table(columns).select(schema.names).cast(schema)


def log_report(accepted: int, rejects: pa.Table, time_s: np.ndarray, segment: np.ndarray) -> dict:
    """What is known of one log: lines (without a header), rejects by reason, rate, gaps and segments.

    time_s, segment: (n,), of the lines that could be placed in time; a gap is an interval with missing lines.
    """
    interval = np.diff(time_s)[segment[1:] == segment[:-1]]
    reasons = Counter(rejects["reason"].to_pylist())
    return {
        "lines": accepted + rejects.num_rows,
        "accepted": accepted,
        "rejects": dict(sorted(reasons.items())),
        "rate_hz": 1 / float(np.median(interval)) if len(interval) else None,
        "gaps": int(gaps(time_s, segment).sum()),
        "segments": len(np.unique(segment)),
    }


def _lists(values: np.ndarray, kind: pa.DataType) -> pa.Array:
    """(n, size) as a fixed-size-list array."""
    flat = np.ascontiguousarray(values).ravel()
    return pa.FixedSizeListArray.from_arrays(pa.array(flat).cast(kind.value_type), type=kind)


GROUP_ROWS = 8192  # written and read at once: 13 MB of maps, which stay in the cache


def write(path: Path, schema: pa.Schema, parts: Iterable[pa.Table]) -> None:
    """Write the parts, in order, as one Parquet file; `path` changes only once all of it is written.

    Bytes of numbers in a list are put side by side by their place in the number: a third less to write and to read.
    """
    encoding = {
        "compression": "zstd",
        "use_dictionary": [field.name for field in schema if pa.types.is_dictionary(field.type)],
        "use_byte_stream_split": [
            f"{field.name}.list.element" for field in schema if pa.types.is_fixed_size_list(field.type)
        ],
    }
    with files.replacing(path) as draft, pyarrow.parquet.ParquetWriter(draft, schema, **encoding) as writer:
        for part in parts:
            writer.write_table(part.select(schema.names).cast(schema), row_group_size=GROUP_ROWS)


def read(path: Path, columns: Sequence[str] = ()) -> pa.Table:
    """Return a Parquet file of another stage, or these columns of it; InputError where it is damaged or lacks one."""
    try:
        return having(pyarrow.parquet.read_table(path, columns=list(columns) or None), columns, path)
    except (pa.ArrowException, OSError, UnicodeDecodeError) as error:  # the last one: names are decoded when used
        raise InputError(f"{path}: damaged ({str(error)[:200]}); delete it and run `dvc repro`") from error


def having(table: pa.Table, columns: Sequence[str], path: Path) -> pa.Table:
    """Return the table that was read from `path`; InputError where it lacks one of the columns."""
    names = table.column_names
    if absent := [name for name in columns if name not in names]:
        raise InputError(f"{path}: has no column '{absent[0]}'; delete it and run `dvc repro`")
    return table


PARTS = ("train", "validation", "test", "unused")  # of a split


def split_column(protocol: str, seed: int) -> str:
    """Name of the dataset's column that says to which part a window belongs in one run."""
    return f"split_{protocol}_{seed}"


def matrix(column: pa.ChunkedArray) -> np.ndarray:
    """A fixed-size-list column as (n, size)."""
    size = column.type.list_size
    return column.combine_chunks().flatten().to_numpy().reshape(-1, size)


def names(column: pa.ChunkedArray) -> np.ndarray:
    """A dictionary column of names as (n,) strings."""
    return column.to_numpy(zero_copy_only=False).astype(str)


def lists(values: np.ndarray, kind: pa.DataType) -> pa.Array:
    """(n, size) as a fixed-size-list column of `kind`."""
    return _lists(values, pa.list_(kind, values.shape[1]))


def windows_rows(frames: pa.Table, rows: np.ndarray, press: np.ndarray, previous: np.ndarray) -> pa.Table:
    """The windows table: the columns of the last frame, its press, `previous`, and x (frames * elements, frame-major).

    frames: a table of the schema `frames`; rows: (windows, frames) frame numbers; press: (n,) of each frame; previous:
    (windows,) the window that each one goes on from without a frame between them, -1 where there is none.
    """
    last = rows[:, -1]
    table = frames.drop_columns(["v", "gap_before"]).take(pa.array(last))
    table = table.add_column(2, "press", pa.array(press[last].astype(np.int32)))
    table = table.add_column(3, "previous", pa.array(previous.astype(np.int32)))
    kind = frames.schema.field("v").type
    x = matrix(frames["v"])[rows].reshape(len(rows), rows.shape[1] * kind.list_size)
    return table.append_column("x", lists(x, kind.value_type)).combine_chunks()


class Dataset(NamedTuple):
    """A dataset in memory: x (n, frames, elements) float32, y (n, outputs) float32, the table's other columns."""

    x: np.ndarray
    y: np.ndarray
    rows: pa.Table

    def part(self, protocol: str, seed: int) -> np.ndarray:
        """(n,) name of the part each window belongs to."""
        return names(self.rows[split_column(protocol, seed)])

    def windows(self, chosen: np.ndarray, streams: bool) -> tuple[np.ndarray, ...]:
        """x and y of the windows that `chosen` (n,) marks, and for a model of streams their `previous`."""
        found = self.x[chosen], self.y[chosen]
        return (*found, self.previous(np.flatnonzero(chosen))) if streams else found

    def previous(self, rows: np.ndarray) -> np.ndarray:
        """(len(rows),) place in `rows`, rising row numbers, of the window that each one goes on from; -1: not there."""
        place = np.full(len(self.x) + 1, -1)  # the last one is for windows that go on from none
        place[rows] = np.arange(len(rows))
        return place[self.rows["previous"].to_numpy()[rows]]


def read_dataset(path: Path, frames: int) -> Dataset:
    """The dataset that the stage of that name wrote; `frames` is the number of frames in a window."""
    table = having(read(path), ("x", "y"), path)
    for name, parts in (("x", frames), ("y", 1)):
        kind = table[name].type
        if not pa.types.is_fixed_size_list(kind) or kind.list_size % parts or table[name].null_count:
            raise InputError(
                f"{path}: column '{name}' is not what the stage dataset writes; delete it and run `dvc repro`"
            )
    x = matrix(table["x"]).astype(np.float32)
    return Dataset(x.reshape(len(x), frames, -1), matrix(table["y"]), table.drop_columns(["x", "y"]))


def prediction_rows(protocol: str, seed: int, windows: np.ndarray, predicted: np.ndarray) -> pa.Table:
    """Predictions of one run: protocol, seed, window (row of the dataset), prediction (outputs)."""
    n = len(windows)
    return pa.table(
        {
            "protocol": pa.array([protocol] * n, pa.string()).dictionary_encode().cast(NAME),
            "seed": pa.array(np.full(n, seed, np.int16)),
            "window": pa.array(windows.astype(np.int32)),
            "prediction": lists(predicted.astype(np.float32), pa.float32()),
        }
    )
