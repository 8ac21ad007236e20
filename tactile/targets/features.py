"""Describe the readings before a moment by statistics: what extra trees and ridge regression see in place of a series.

The last reading, mean, slope, spread, smallest and largest of every element over a window. Models see them in one of
three VIEWS: with their level; above the start, less what the recording began with, as a sensor that is zeroed when a
session starts; or without the level, each less the window's mean, which is what a drift of the rest leaves alone.
"""

from typing import NamedTuple

import numpy as np

from tactile.base.errors import InputError
from tactile.datasets.seeding import generator
from tactile.learning.window_statistics import KINDS, described
from tactile.sheet.estimates import Estimate
from tactile.targets.read import Data

SHORTEST_S, LONGEST_S = 2.0, 10.0
START_S = 2.0  # at the start of a recording, whose median is what it began with
LEVEL, ABOVE_START, NO_LEVEL = VIEWS = ("level", "above the start", "without level")
SILENCE = 0.25  # of a window; a longer silence begins a series anew
PIECE = 5.0  # windows; so long are the pieces of a series that count as one unit of calibration


class Windows(NamedTuple):
    """What is learned from, n windows in the order of recordings and time."""

    x: np.ndarray  # (n, 6, elements) float32: last, mean, slope, spread, smallest, largest
    y: np.ndarray  # (n, 1) numbers, or (n, classes) of 0 and 1
    classes: list[str]  # of the columns of y; [] of numbers
    group: np.ndarray  # (n,) number of the group
    groups: list[str]
    recording: np.ndarray  # (n,) number of the recording
    unit: np.ndarray  # (n,) number of the press, grasp or piece of a series
    every: int  # so many readings in a row that count have one window
    start: np.ndarray  # (n, elements) float32: what the recording began with
    time_s: np.ndarray  # (n,) of the reading that a window ends with

    def columns(self, view: str) -> np.ndarray:
        """Return the statistics as columns (n, features), in one of VIEWS."""
        return columns(self.x, self.start, view)


def columns(found: np.ndarray, start: np.ndarray, view: str) -> np.ndarray:
    """Return statistics (n, 6, elements) as columns (n, features), in one of VIEWS.

    start: (n, elements), or (elements,) of a single recording, see `start`.
    """
    if view == LEVEL:
        return found.reshape(len(found), -1)
    last, mean, slope, spread, smallest, largest = np.moveaxis(found, 1, 0)
    if view == ABOVE_START:
        parts = [last - start, mean - start, slope, spread, smallest - start, largest - start]
    else:
        parts = [last - mean, slope, spread, smallest - mean, largest - mean]
    return np.concatenate(parts, axis=1)


def start(time: np.ndarray, reading: np.ndarray) -> np.ndarray:
    """Return what a recording began with, (elements,) float32; time (s): (n,); reading: (n, elements)."""
    return np.median(reading[time <= time[0] + START_S], axis=0).astype(np.float32)


def window_s(creep_1: Estimate | None, creep_10: Estimate | None) -> tuple[float, str]:
    """Return how long a window is (s), and the reason; the creep is that of the sheet, None where there is no sheet.

    Two seconds hold a press with its loading, and the creep of recorded Velostat, whose force is told from 1.8 s. The
    ratio of the creep after 10 s to that after 1 s says how much of it is slower: 1 where all is over after a second, 2
    to 3 where it goes with the logarithm of time, 10 where it goes on evenly. The window is as many times longer, up to
    10 s, over which the sheet knows the creep.
    """
    if creep_1 is None or creep_10 is None or not (creep_1.told and creep_10.told) or creep_1.value == 0:
        return SHORTEST_S, "the data sheet cannot tell the creep after 10 s; set target.window_s where it is slow"
    ratio = abs(creep_10.value / creep_1.value)
    length = float(np.clip(SHORTEST_S * ratio, SHORTEST_S, LONGEST_S))
    return round(length, 1), f"the creep after 10 s is {ratio:.1f} times that after 1 s"


def windows(data: Data, length_s: float, most: int) -> Windows:
    """Return a window for every reading that counts, or, of more than `most`, for one drawn of every so many in a row.

    A fixed step would see presses that repeat in step with it in few of their phases: on recorded strands every 25th
    reading is in 4 phases of 20, and the R2 of x differs by .2 from that of every 12th.
    Raises InputError where none counts, and for a class or event that is the same throughout.
    """
    total = sum(int((each.press >= 0).sum()) for each in data.series)
    every = -(-total // most) or 1
    names = sorted({name for each in data.series for name in np.unique(each.group)})
    rng = generator(0, "windows")
    x, truth, group, recording, unit, starts, times, units = [], [], [], [], [], [], [], 0
    for number, series in enumerate(data.series):
        counted = np.flatnonzero(series.press >= 0)
        if not len(counted):
            continue
        firsts = np.arange(0, len(counted), every)
        ends = counted[firsts + rng.integers(np.minimum(every, len(counted) - firsts))]
        x.append(statistics(series.time_s, series.segment, series.reading, ends, length_s))
        truth.append(series.truth[ends])
        group.append(np.searchsorted(names, series.group[ends]))
        recording.append(np.full(len(ends), number))
        times.append(series.time_s[ends])
        starts.append(np.tile(start(series.time_s, series.reading), (len(ends), 1)))
        piece = np.zeros(len(ends), int)
        if data.target.kind != "class" and series.press.max() == 0:
            piece = ((series.time_s[ends] - series.time_s[0]) // (PIECE * length_s)).astype(int)
        keys = np.column_stack([series.press[ends], piece, group[-1]])
        _, place = np.unique(keys, axis=0, return_inverse=True)
        unit.append(units + place.reshape(-1))
        units += place.max() + 1
    if not x:
        raise InputError(f"no reading has a truth of the target '{data.target.name}'; name a log or folder that has it")
    truth = np.concatenate(truth)
    if data.target.kind != "continuous" and len(np.unique(truth)) < 2:
        raise InputError(f"the target '{data.target.name}' is {truth[0]} throughout; record the other case, too")
    classes = [] if data.target.kind == "continuous" else np.unique(truth).tolist()
    y = truth[:, None] == np.array(classes) if classes else truth[:, None]
    return Windows(
        np.concatenate(x), y.astype(float), [str(name) for name in classes], np.concatenate(group), names,
        np.concatenate(recording), np.concatenate(unit), every, np.concatenate(starts), np.concatenate(times),
    )  # fmt: skip


def statistics(
    time: np.ndarray, segment: np.ndarray, reading: np.ndarray, ends: np.ndarray, length_s: float
) -> np.ndarray:
    """Return the statistics (m, 6, elements) of the windows that end with the readings `ends` (m,).

    time (s), segment: (n,); reading: (n, elements). A window begins no earlier than its segment, or than a silence
    ended.
    """
    reading = reading.astype(np.float32)
    found = np.empty((len(ends), KINDS, reading.shape[1]), np.float32)
    for row, (first, end) in enumerate(zip(firsts(time, segment, ends, length_s), ends, strict=True)):
        part, at = reading[first : end + 1], time[first : end + 1] - time[first : end + 1].mean()
        found[row] = described(part[None], at)[0]
    return found


def firsts(time: np.ndarray, segment: np.ndarray, ends: np.ndarray, length_s: float) -> np.ndarray:
    """Return the first readings (m,) of the windows that end with the readings `ends` (m,), as of `statistics`."""
    anew = np.concatenate([[True], (np.diff(segment) != 0) | (np.diff(time) > SILENCE * length_s)])
    begins = np.maximum.accumulate(np.where(anew, np.arange(len(time)), 0))[ends]
    return np.array(
        [
            first + np.searchsorted(time[first : end + 1], time[end] - length_s)
            for first, end in zip(begins, ends, strict=True)
        ],
        int,
    )
