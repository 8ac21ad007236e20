"""Shapes of a task, of which models are made."""

from typing import NamedTuple

from tactile.datasets.images import SIDE
from tactile.datasets.series import Task


class Spec(NamedTuple):
    """Shapes of a task: frames per window, rows x cols sensor elements, map_rows x map_cols pressure map."""

    frames: int
    rows: int
    cols: int
    map_rows: int
    map_cols: int

    @property
    def elements(self) -> int:
        """Number of sensor elements in a frame."""
        return self.rows * self.cols

    @property
    def outputs(self) -> int:
        """Number of values in a pressure map."""
        return self.map_rows * self.map_cols


def of_series(task: Task, frames: int) -> Spec:
    """Return a task's shapes, one row of channels and one row of outputs; `frames`: samples per window."""
    return Spec(frames, 1, len(next(iter(task.channels.values()))), 1, len(task.outputs))


def of_images(classes: int, shape: tuple[int, int] = (SIDE, SIDE)) -> Spec:
    """Return the shapes of images of `shape` pixels, windows of one frame, and of scores per class, maps of one row."""
    return Spec(1, *shape, 1, classes)
