"""Read a dataset of windows into memory, as models of touch take it."""

from pathlib import Path
from typing import NamedTuple

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from tactile.base.errors import InputError
from tactile.datasets import schemas


class Dataset(NamedTuple):
    """A dataset in memory: x (n, frames, elements) float32, y (n, outputs) float32, the table's other columns."""

    x: np.ndarray
    y: np.ndarray
    rows: pa.Table

    def part(self, protocol: str, seed: int) -> np.ndarray:
        """Return the part that each window belongs to in one run, (n,) of names."""
        return schemas.names(self.rows[schemas.split_column(protocol, seed)])

    def windows(self, chosen: np.ndarray, streams: bool) -> tuple[np.ndarray, ...]:
        """Return x and y of the windows that `chosen` (n,) bool marks; for a model of streams also their `previous`."""
        pair = self.x[chosen], self.y[chosen]
        return (*pair, self.previous(np.flatnonzero(chosen))) if streams else pair

    def previous(self, rows: np.ndarray) -> np.ndarray:
        """Return the place in `rows` of the window that ends just before each of them starts, -1 where it is not there.

        rows: (m,) row numbers of the dataset, rising. Returns (m,).
        """
        place = np.full(len(self.x) + 1, -1)  # the last entry is for windows without a predecessor
        place[rows] = np.arange(len(rows))
        return place[self.rows["previous"].to_numpy()[rows]]


def read_dataset(path: Path, frames: int, elements: int, run: tuple[str, int] | None = None) -> Dataset:
    """Read a dataset that the stage `dataset` wrote; `frames`: how many of a window's frames, the last ones, are read.

    elements: of a frame; run: protocol and seed of the one run whose windows are wanted, without those unused in it;
    None: all windows. Raises InputError where the file is damaged, lacks x or y or has windows of fewer frames.
    """
    table = schemas.having(_of_run(path, *run) if run else schemas.read(path), ("x", "y"), path)
    for name, parts in (("x", elements), ("y", 1)):
        kind = table[name].type
        if not pa.types.is_fixed_size_list(kind) or kind.list_size % parts or table[name].null_count:
            raise InputError(
                f"{path}: column '{name}' is not what the stage dataset writes; delete it and run `dvc repro`"
            )
    if frames > (most := table["x"].type.list_size // elements):
        raise InputError(f"{path}: its windows have {most} frames, and the setting window.frames asks for {frames}")
    x = schemas.matrix(table["x"])[:, -frames * elements :].astype(np.float32)
    rows = table.drop_columns(["x", "y"])
    if frames < most and "previous" in rows.column_names:  # without its first frames a window follows on none
        at = rows.schema.get_field_index("previous")
        rows = rows.set_column(at, rows.schema.field(at), pa.array(np.full(len(x), -1, np.int32)))
    return Dataset(x.reshape(len(x), frames, elements), schemas.matrix(table["y"]), rows)


def _of_run(path: Path, protocol: str, seed: int) -> pa.Table:
    """Read the rows that are used in one run; `previous` counts these."""
    column = schemas.split_column(protocol, seed)
    used = schemas.names(schemas.read(path, columns=[column])[column]) != "unused"
    table = schemas.read(path, where=pc.field(column) != "unused")
    if "previous" not in table.column_names:
        return table
    place = np.append(np.where(used, np.cumsum(used) - 1, -1), -1)  # the last entry is for windows without one before
    previous = place[table["previous"].to_numpy()]
    at = table.schema.get_field_index("previous")
    return table.set_column(at, table.schema.field(at), pa.array(previous.astype(np.int32)))
