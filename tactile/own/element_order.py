"""Find which printed column each element of an array is, from a log in which each was pressed once, in turn."""

from collections import Counter
from typing import NamedTuple

import numpy as np

from tactile.base.errors import InputError
from tactile.logs import parse

WEAKEST = 0.15  # of a usual press, below which none is seen: elements of one film differ by a factor of 3
USUAL = 99  # percentile of the strongest column's response; presses take a few percent of the time or more
NOISE = 8.0  # standard deviations of the noise, above which there may be a press
BRIEFEST_S = 0.1
GAP_S = 0.2  # without a press; a shorter one is a finger that wavers


class Pressed(NamedTuple):
    """One press of one element."""

    start_s: float
    end_s: float
    column: int  # the one that answers most, from 0
    share: float  # response of the second over that of the first


def pressed(time_s: np.ndarray, reading: np.ndarray) -> list[Pressed]:
    """Return the presses in a log, in turn; two of the same column one after the other are one.

    time_s (n,), reading (n, columns): at rest for most of the time, in any unit, rising or falling when pressed.
    """
    change = np.abs(reading - np.median(reading, axis=0))
    steps = np.diff(reading, axis=0)
    noise = 1.4826 * np.median(np.abs(steps - np.median(steps, axis=0)), axis=0) / np.sqrt(2)
    noise = np.maximum(noise, [parse.finest_step(column) for column in reading.T])
    most = change.max(axis=1)
    threshold = max(WEAKEST * np.percentile(most, USUAL), NOISE * noise.max())
    on = np.flatnonzero(most > threshold)
    if not len(on):
        return []
    found: list[Pressed] = []
    for inside in np.split(on, np.flatnonzero(np.diff(time_s[on]) > GAP_S) + 1):
        start, end = time_s[inside[0]], time_s[inside[-1]]
        if end - start < BRIEFEST_S:
            continue
        mean = change[inside].mean(axis=0)
        second, first = np.argsort(mean)[-2:] if len(mean) > 1 else (0, 0)
        one = Pressed(float(start), float(end), int(first), float(mean[second] / mean[first]))
        if found and found[-1].column == one.column:
            one = one._replace(start_s=found.pop().start_s)
        found.append(one)
    return found


def order(found: list[Pressed], elements: int) -> list[int]:
    """Return the column of each element in turn. Raises InputError where presses do not tell every one of them."""
    columns, times = [one.column for one in found], Counter(one.column for one in found)
    if silent := sorted(set(range(elements)) - set(columns)):
        several = "" if len(silent) == 1 else "s"
        twice = [f"{count} in column {column}" for column, count in times.items() if count > 1]
        raise InputError(
            f"{len(found)} presses of {elements} elements: no press has its strongest reading in column{several} "
            f"{', '.join(map(str, silent))} (from 0)"
            + (f", and of others more than one ({', '.join(twice)})" if twice else "")
            + "; press every element once, in turn and all alike, or mend its wire"
        )
    if len(found) > elements:
        raise InputError(
            f"{len(found)} presses of {elements} elements; some were pressed again: "
            + ", ".join(f"column {column} at {_times(found, column)}" for column, count in times.items() if count > 1)
        )
    return columns


def _times(found: list[Pressed], column: int) -> str:
    return " and ".join(f"{one.start_s - found[0].start_s:.1f} s" for one in found if one.column == column)
