"""Read a dataset of windows into memory, as models of touch take it."""

from pathlib import Path
from typing import NamedTuple

import numpy as np
import pyarrow as pa

from pipeline.base.errors import InputError
from pipeline.datasets import schemas


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


def read_dataset(path: Path, frames: int) -> Dataset:
    """Read a dataset that the stage `dataset` wrote; `frames`: number of frames in a window.

    Raises InputError where the file is damaged or lacks x or y.
    """
    table = schemas.having(schemas.read(path), ("x", "y"), path)
    for name, parts in (("x", frames), ("y", 1)):
        kind = table[name].type
        if not pa.types.is_fixed_size_list(kind) or kind.list_size % parts or table[name].null_count:
            raise InputError(
                f"{path}: column '{name}' is not what the stage dataset writes; delete it and run `dvc repro`"
            )
    x = schemas.matrix(table["x"]).astype(np.float32)
    return Dataset(x.reshape(len(x), frames, -1), schemas.matrix(table["y"]), table.drop_columns(["x", "y"]))
