"""Define the contract between stages: the columns of every Parquet file that one stage writes and another reads."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.compute
import pyarrow.parquet

from tactile.base import files, foreign
from tactile.base.errors import InputError

LONG = 1.5  # median intervals; a longer one means that a frame is missing. Times are of frames, not of packets

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
    """Return the schema of aligned frames, in the order of time within a recording.

    elements: values per frame, row-major from the bottom row; touches: simultaneous touches, NaN where there
    are fewer; value: int16 for ADC counts, float32 for other readings.
    """
    per_touch = pa.list_(pa.float32(), touches)
    return pa.schema(
        {
            "condition": NAME,
            "recording": NAME,
            "segment": pa.int16(),  # of the array's log; a new one after every reset of the device
            "t_s": pa.float64(),  # on the first load cell's clock
            "gap_before": pa.bool_(),  # frames are missing before this one; also the first of a segment
            "v": pa.list_(value, elements),
            "force_n": per_touch,
            "x_mm": per_touch,
            "y_mm": per_touch,
        }
    )


def steps(time_s: np.ndarray) -> np.ndarray:
    """Return the intervals (m,) between rows at times (n,), without those over which a clock that was reset steps back.

    Their sum is how long the rows last.
    """
    interval = np.diff(time_s)
    return interval[interval > 0]


def gaps(time_s: np.ndarray, segment: np.ndarray) -> np.ndarray:
    """Return where an interval of more than LONG medians comes before a row, (n,) bool; False where a segment starts.

    time_s, segment: (n,).
    """
    interval = np.diff(time_s)
    same = segment[1:] == segment[:-1]
    median = np.median(interval[same]) if same.any() else np.inf
    return np.concatenate([[False], same & (interval > LONG * median)]) if len(time_s) else np.zeros(0, bool)


def gaps_before(t_s: np.ndarray, segment: np.ndarray) -> np.ndarray:
    """Return (n,) bool: True for a frame before which others are missing, and for the first of each segment.

    t_s, segment: (n,).
    """
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
    """Return one recording as a table of the schema `frames`, or a part of one, for which `gap_before` is given.

    segment, t_s, gap_before: (n,); v: (n, elements); force_n, x_mm, y_mm: (n, touches there are), padded with NaN.
    """
    n = len(t_s)
    columns = {
        "condition": repeated(condition, n),
        "recording": repeated(recording, n),
        "segment": segment,
        "t_s": t_s,
        "gap_before": gaps_before(t_s, segment) if gap_before is None else gap_before,
        "v": lists(v, schema.field("v").type.value_type),
    }
    for name, values in (("force_n", force_n), ("x_mm", x_mm), ("y_mm", y_mm)):
        padded = np.full((n, schema.field(name).type.list_size), np.nan)
        padded[:, : values.shape[1]] = values
        columns[name] = lists(padded, schema.field(name).type.value_type)
    return pa.table(columns).select(schema.names).cast(schema)


def repeated(name: str, n: int) -> pa.DictionaryArray:
    """Return a column that has the same name in all of its n rows."""
    return pa.DictionaryArray.from_arrays(np.zeros(n, np.int32), [name])


GROUP_ROWS = 8192  # written and read at once: 13 MB of maps, which stay in the cache


@contextmanager
def writing(path: Path, schema: pa.Schema) -> Iterator[Callable[[pa.Table], None]]:
    """Give the block a function that writes one more part of a Parquet file; `path` changes once the block has ended.

    Bytes of numbers in a list are put side by side by their place in the number: a third less to write and to read.
    """
    encoding = {
        "compression": "zstd",
        "use_dictionary": [field.name for field in schema if pa.types.is_dictionary(field.type)],
        "use_byte_stream_split": [
            f"{field.name}.list.element" for field in schema if pa.types.is_fixed_size_list(field.type)
        ],
    }
    with files.replacing(path) as draft, pyarrow.parquet.ParquetWriter(draft, schema, **encoding) as file:

        def write_part(part: pa.Table) -> None:
            file.write_table(part.select(schema.names).cast(schema), row_group_size=GROUP_ROWS)

        yield write_part


def write(path: Path, schema: pa.Schema, parts: Iterable[pa.Table]) -> None:
    """Write the parts, in order, as one Parquet file; `path` changes only once all of it is written."""
    with writing(path, schema) as write_part:
        for part in parts:
            write_part(part)


def read(path: Path, columns: Sequence[str] = (), where: pyarrow.compute.Expression | None = None) -> pa.Table:
    """Return a Parquet file of another stage, or these columns and the rows `where` something holds of it.

    Raises InputError where the file is damaged or lacks a column.
    """
    with foreign.reading(path, "a whole Parquet file", "delete it and run `dvc repro`"):
        table = pyarrow.parquet.read_table(path, columns=list(columns) or None, filters=where)
        return having(table, columns, path)


def having(table: pa.Table, columns: Sequence[str], path: Path) -> pa.Table:
    """Return the table that was read from `path`; InputError where it lacks one of the columns."""
    names = table.column_names
    if absent := [name for name in columns if name not in names]:
        raise InputError(f"{path}: has no column '{absent[0]}'; delete it and run `dvc repro`")
    return table


PARTS = ("train", "validation", "test", "unused")  # of a split


def split_column(protocol: str, seed: int) -> str:
    """Return the name of the dataset's column that says to which part a window belongs in one run."""
    return f"split_{protocol}_{seed}"


def matrix(column: pa.ChunkedArray) -> np.ndarray:
    """Return a fixed-size-list column as (n, size)."""
    size = column.type.list_size
    return column.combine_chunks().flatten().to_numpy().reshape(-1, size)


def names(column: pa.ChunkedArray) -> np.ndarray:
    """Return a dictionary column of names as (n,) strings."""
    return column.to_numpy(zero_copy_only=False).astype(str)


def lists(values: np.ndarray, kind: pa.DataType) -> pa.Array:
    """Return values (n, size) as a fixed-size-list column of `kind`."""
    flat = np.ascontiguousarray(values).ravel()
    return pa.FixedSizeListArray.from_arrays(pa.array(flat).cast(kind), type=pa.list_(kind, values.shape[1]))


def prediction_rows(protocol: str, seed: int, windows: np.ndarray, predicted: np.ndarray) -> pa.Table:
    """Return the predictions of one run as a table: protocol, seed, window (row of the dataset), prediction (outputs).

    windows: (n,) row numbers; predicted: (n, outputs).
    """
    n = len(windows)
    return pa.table(
        {
            "protocol": pa.array([protocol] * n, pa.string()).dictionary_encode().cast(NAME),
            "seed": pa.array(np.full(n, seed, np.int16)),
            "window": pa.array(windows.astype(np.int32)),
            "prediction": lists(predicted.astype(np.float32), pa.float32()),
        }
    )
