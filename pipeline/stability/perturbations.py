"""Perturb a sensor's readings as faults after training would: readings in, perturbed readings out.

Readings are float arrays (..., frames, elements) in the sensor's own units (ADC counts, volts); frames follow one
another in time along axis -2, leading axes are windows. Every function returns a new array of the same kind; severity 0
returns the readings unchanged. With the same generator, a higher severity is the same draw scaled, or the same
elements and some more, so that errors at two severities compare. Readings are not clipped to the sensor's range: the
caller knows the range and clips. What a function needs to know of the training readings are its keywords.
"""

import numpy as np

from tactile.base.errors import InputError
from tactile.base.stress_tests import stress_test


@stress_test("windows", "series", "images", unit="share of the range")
def noise(readings: np.ndarray, severity: float, rng: np.random.Generator, *, span: float) -> np.ndarray:
    """Add white noise of standard deviation severity * span; span: the sensor's range, in the readings' units."""
    return _same_kind(readings, readings + severity * span * rng.standard_normal(readings.shape))


@stress_test("windows", "series", "images", unit="spread of log gain")
def gain_drift(readings: np.ndarray, severity: float, rng: np.random.Generator, *, rest: np.ndarray) -> np.ndarray:
    """Multiply each element's response, readings - rest, by exp(severity N(0, 1)); rest: (elements,) unpressed."""
    if severity == 0:
        return readings.copy()  # (readings - rest) + rest is not exact
    gain = np.exp(severity * rng.standard_normal(readings.shape[-1]))
    return _same_kind(readings, rest + (readings - rest) * gain)


@stress_test("windows", "series", "images", unit="share of the range")
def offset_drift(readings: np.ndarray, severity: float, rng: np.random.Generator, *, span: float) -> np.ndarray:
    """Shift each element by severity * span * N(0, 1), the same in all frames; span as for `noise`."""
    return _same_kind(readings, readings + severity * span * rng.standard_normal(readings.shape[-1]))


@stress_test("windows", "series", "images", unit="number of elements")
def dead(readings: np.ndarray, severity: int, rng: np.random.Generator, *, low: float | np.ndarray) -> np.ndarray:
    """Make `severity` elements, drawn once, read `low` in all frames; low: in the readings' units."""
    result = readings.copy()
    result[..., _drawn(severity, readings.shape[-1], rng)] = low
    return result


@stress_test("series", unit="number of elements", draw="dead")
def half(readings: np.ndarray, severity: int, rng: np.random.Generator, *, low: float) -> np.ndarray:
    """Make the elements of `dead` read `low` from the middle frame on."""
    middle = readings.shape[-2] // 2
    return np.concatenate([readings[..., :middle, :], dead(readings[..., middle:, :], severity, rng, low=low)], axis=-2)


@stress_test("windows", "series", "images", unit="number of elements")
def stuck(readings: np.ndarray, severity: int, rng: np.random.Generator) -> np.ndarray:
    """Make `severity` elements repeat in all frames their reading of one frame, drawn from all windows."""
    result = readings.copy()
    elements = readings.shape[-1]
    chosen = _drawn(severity, elements, rng)
    frames = readings.reshape(-1, elements)
    result[..., chosen] = frames[rng.integers(len(frames)), chosen]
    return result


@stress_test("windows", "images", unit="number of rows or columns")
def dead_line(
    readings: np.ndarray, severity: int, rng: np.random.Generator, *, rows: int, cols: int, low: float
) -> np.ndarray:
    """Make `severity` whole rows or columns, drawn among all rows + cols, read `low`; elements are row-major."""
    result = readings.copy()
    grid = result.reshape(*result.shape[:-1], rows, cols)
    for line in _drawn(severity, rows + cols, rng):
        if line < rows:
            grid[..., line, :] = low
        else:
            grid[..., line - rows] = low
    return grid.reshape(result.shape)


@stress_test("windows", "series", "images", unit="share of frames", acts_on="frames")
def lost_frames(readings: np.ndarray, severity: float, rng: np.random.Generator) -> np.ndarray:
    """Replace each frame with probability `severity` by the last frame that was kept; a window's first frame stays."""
    lost = rng.random(readings.shape[:-1]) < severity
    lost[..., 0] = False
    kept = np.where(lost, 0, np.arange(readings.shape[-2]))
    return np.take_along_axis(readings, np.maximum.accumulate(kept, axis=-1)[..., None], axis=-2)


@stress_test("windows", "series", "images", unit="frames", acts_on="frames")
def jitter(readings: np.ndarray, severity: float, rng: np.random.Generator) -> np.ndarray:
    """Take each frame severity * N(0, 1) frames early or late: linear interpolation in time, the ends held."""
    last = readings.shape[-2] - 1
    at = np.clip(np.arange(last + 1) + severity * rng.standard_normal(readings.shape[:-1]), 0, last)
    before = np.floor(at).astype(int)
    share = (at - before)[..., None]
    first = np.take_along_axis(readings, before[..., None], axis=-2)
    second = np.take_along_axis(readings, np.minimum(before + 1, last)[..., None], axis=-2)
    return _same_kind(readings, first * (1 - share) + second * share)


def _drawn(severity: float, n: int, rng: np.random.Generator) -> np.ndarray:
    """Return the first `severity` of n in a random order: those of severity 2 contain that of severity 1."""
    if severity != int(severity) or not 0 <= severity <= n:
        raise InputError(f"params.yaml, stress: {severity!r} of {n} elements or lines cannot fail; give a whole number")
    return rng.permutation(n)[: int(severity)]


def _same_kind(readings: np.ndarray, result: np.ndarray) -> np.ndarray:
    """Return the result as floats of the readings' kind."""
    return result.astype(readings.dtype, copy=False)
