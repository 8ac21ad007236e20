"""Find the force of a load cell's reading from a log of known weights that lay on it one after another."""

import re
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy import stats

from tactile.base.errors import InputError
from tactile.logs import parse, units
from tactile.logs.formats import Column

WEIGHT = re.compile(r"([-+]?[0-9]*\.?[0-9]+(?:[eE][-+]?[0-9]+)?)\s*([^\W\d]*)")
FORCE = Column("weight", "N", -1e6, 1e6)
WINDOW, WINDOW_S = 10, 0.5  # readings and time over which a reading is steady or not; the longer of both
HELD = 2.0  # windows that a weight has to lie at least
STEADY = 3.0  # times the usual spread over a window, of which most are steady
APART = 5.0  # times the spread of a steady stretch, by less of which two stretches are of one weight
LEVEL = 0.95  # of intervals


class Held(NamedTuple):
    """A stretch of steady readings."""

    start_s: float
    end_s: float
    reading: float  # median
    spread: float  # standard deviation


class Line(NamedTuple):
    """force in N = scale * reading + offset; half widths of 95 % intervals are NaN for two weights."""

    scale: float
    scale_half: float
    offset: float
    offset_half: float
    off_n: np.ndarray  # (weights,) force by the line less the true one


def force_n(text: str) -> float:
    """Return the force of a weight such as `200g`, `0` or `1.5 N`. Raises InputError for anything else."""
    found = WEIGHT.fullmatch(text.strip())
    value, unit = found.groups() if found else ("nan", "")
    if not np.isfinite(float(value)) or not (unit or float(value) == 0):
        raise InputError(f"'{text}': is no weight with its unit; write 0, 200g, 1.5kg or 9.8N")
    return float(value) * (units.factor(unit, FORCE, f"'{text}' is a weight") if unit else 1.0)


def held(time_s: np.ndarray, reading: np.ndarray) -> list[Held]:
    """Return the stretches in which readings (n,) are steady; a knock does not end one."""
    window = max(WINDOW, round(WINDOW_S / np.median(np.diff(time_s)))) if len(reading) > WINDOW else WINDOW
    if len(reading) < HELD * window:
        return []
    views = np.lib.stride_tricks.sliding_window_view(reading, window)
    spread = views.std(axis=1)
    usual = max(float(np.median(spread)), parse.finest_step(reading))
    edges = np.flatnonzero(np.diff(np.r_[False, spread <= STEADY * usual, False].astype(int))).reshape(-1, 2)
    found: list[Held] = []
    for first, after in edges:
        last = after + window - 2
        if last - first + 1 < HELD * window:
            continue
        own = reading[first : last + 1]
        one = Held(float(time_s[first]), float(time_s[last]), float(np.median(own)), float(max(own.std(), usual)))
        if found and abs(found[-1].reading - one.reading) < APART * max(found[-1].spread, one.spread):
            one = found.pop()._replace(end_s=one.end_s)
        found.append(one)
    return found


def line(readings: Sequence[float], forces: Sequence[float]) -> Line:
    """Return the line through readings of known forces (weights,), by least squares of the readings.

    Readings have the errors, forces are known: the line of the readings over the forces is fitted, and solved for the
    force. Intervals are by Student's t of the readings' deviations. Raises InputError where weights are all one.
    """
    reading, force = np.asarray(readings, float), np.asarray(forces, float)
    if np.ptp(force) == 0:
        raise InputError("weights are all alike; at least two different ones tell a scale")
    fit = stats.linregress(force, reading)
    if fit.slope == 0:
        raise InputError("the reading is the same for all weights; is it the column of the load cell?")
    scale, offset = 1 / fit.slope, -fit.intercept / fit.slope
    off = scale * reading + offset - force
    if len(force) < 3:
        return Line(scale, np.nan, offset, np.nan, off)
    times = stats.t.ppf((1 + LEVEL) / 2, len(force) - 2)
    error = np.sqrt(np.square(off).sum() / (len(force) - 2))  # of a force
    around = np.square(force - force.mean()).sum()
    far = np.sqrt(1 / len(force) + np.square(offset - force.mean()) / around)  # from the weights is a reading of 0
    return Line(scale, times * abs(scale) * error / np.sqrt(around), offset, times * error * far, off)
