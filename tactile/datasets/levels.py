"""What readings were in training, which faults are measured by: in stress tests, and where networks train with faults.

The span is the unit of noise and offsets, rest is what a gain leaves as it is, low is what a dead element reads.
"""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from tactile.datasets import schemas
from tactile.datasets.series import Record
from tactile.datasets.windows import Dataset

LOOSE_V = 3.15  # what the board of the recorded sensors reads of a strand that has come loose
LOW_PERCENTILE = 5  # of what a cell of images reads in training, its rest
SIMULATED = "simulated"

Level = float | np.ndarray  # of all elements, or of each (elements,), in the readings' units


class Levels(NamedTuple):
    """Levels of the readings of a run's training part; no fault brings a reading out of lowest .. highest."""

    span: Level
    rest: Level
    low: Level
    lowest: Level
    highest: Level
    whole: bool | np.ndarray = False  # readings are counts
    wired: bool | np.ndarray = True  # the element reads something; no fault reaches others

    def times(self, factor: float) -> "Levels":
        """Return the levels of readings that are no counts in another unit."""
        span, rest, low, lowest, highest = (level * factor for level in self[:5])
        return Levels(span, rest, low, lowest, highest, self.whole, self.wired)


def of_windows(settings: Mapping, data: Dataset, train: np.ndarray) -> Levels:
    """Return the levels of training windows; train: (n of data,) bool; settings: the experiment's block.

    The range is the ADC's (touch), or what was read in training (the recorded taxel, whose readings have no unit). Rest
    is the median over the windows that end without a touch, over all where no force is known.
    """
    readings, highest_count = data.x[train], settings["ingest"].get("highest_count")
    if highest_count:
        low, high = 0.0, float(highest_count)
    else:
        low, high = float(readings.min()), float(readings.max())
    untouched = readings
    if "force_n" in data.rows.column_names:
        force_n = np.nansum(schemas.matrix(data.rows["force_n"]), axis=1)[train]
        untouched = readings[force_n < settings["window"]["contact_threshold_n"]]
    rest = np.median(untouched if len(untouched) else readings, axis=(0, 1))
    return Levels(high - low, rest, low, low, high, bool(highest_count))


def of_series(records: list[Record], settings: Mapping) -> Levels:
    """Return the levels of the training samples of records, channel by channel.

    A dead strand has come loose, and its divider reads the supply; of readings of your own, whose supply no setting
    tells, the highest of all channels. Rest is the median of samples outside presses, where presses are known.
    """
    x = np.concatenate([record.x[record.training] for record in records])
    free = np.concatenate([(record.press < 0)[record.training] for record in records])
    if settings.get("source", SIMULATED) != SIMULATED:
        loose = float(x.max())
    else:
        loose = settings["simulate"]["circuit"]["supply_v"] if "simulate" in settings else LOOSE_V
    lowest, highest = min(0.0, float(x.min())), max(loose, float(x.max()))
    return Levels(np.ptp(x, axis=0), np.median(x[free] if free.any() else x, axis=0), loose, lowest, highest)


def of_area(readings: np.ndarray, lowest: float, highest: float, whole: bool) -> Levels:
    """Return the levels of one area of images; readings: (frames, cells) of training; lowest, highest: of the device.

    A dead cell reads 0. Cells that read 0 in all training frames are not wired.
    """
    rest = np.percentile(readings, LOW_PERCENTILE, axis=0)
    return Levels(float(np.ptp(readings)), rest, 0.0, lowest, highest, whole, np.any(readings, axis=0))


def side_by_side(areas: list[Levels]) -> Levels:
    """Return the levels of areas whose cells stand one behind the other, all of them by cell."""
    cells = [np.size(area.rest) for area in areas]
    return Levels(
        *(
            np.concatenate([np.broadcast_to(value, n) for value, n in zip(values, cells, strict=True)])
            for values in zip(*areas, strict=True)
        )
    )
