"""What goes wrong with a sensor after training: readings in, perturbed readings out.

Readings are float arrays (..., frames, elements) in the sensor's own units (ADC counts, volts); frames follow one
another in time along axis -2, leading axes are windows. Every function returns a new array of the same kind; severity 0
returns the readings unchanged. With the same generator, a higher severity is the same draw scaled, or the same
elements and some more, so that errors at two severities compare. Readings are not clipped to the sensor's range: that
is the caller's, who knows it.
"""

from collections.abc import Mapping, Sequence

import numpy as np

from pipeline.base import params
from pipeline.base.errors import InputError


def planned(
    experiment: str, settings: Mapping, given: Mapping[str, list], readings: Sequence[str], scenes: Sequence[str]
) -> dict[str, list]:
    """Perturbation -> severities of params.yaml, rising; those of the scene only where the scene is simulated.

    settings: the experiment's block. Recordings have no scene. Raises InputError for an unknown name.
    """
    known = (*readings, *(scenes if "simulate" in settings else ()))
    params.check_known(given, known, f"stress.{experiment}.perturbations")
    simulated = settings.get("source") == "simulated"
    return {name: sorted(own) for name, own in given.items() if simulated or name not in scenes}


def noise(readings: np.ndarray, severity: float, rng: np.random.Generator, *, span: float) -> np.ndarray:
    """White noise of standard deviation severity * span on every reading; span: the sensor's range, in its units."""
    return _same_kind(readings, readings + severity * span * rng.standard_normal(readings.shape))


def gain_drift(readings: np.ndarray, severity: float, rng: np.random.Generator, *, rest: np.ndarray) -> np.ndarray:
    """Each element's response, readings - rest, times exp(severity N(0, 1)); rest: (elements,), readings unpressed."""
    if severity == 0:
        return readings.copy()  # (readings - rest) + rest is not exact
    gain = np.exp(severity * rng.standard_normal(readings.shape[-1]))
    return _same_kind(readings, rest + (readings - rest) * gain)


def offset_drift(readings: np.ndarray, severity: float, rng: np.random.Generator, *, span: float) -> np.ndarray:
    """Each element shifted by severity * span * N(0, 1), the same in all frames."""
    return _same_kind(readings, readings + severity * span * rng.standard_normal(readings.shape[-1]))


def dead(readings: np.ndarray, severity: int, rng: np.random.Generator, *, low: float | np.ndarray) -> np.ndarray:
    """`severity` elements, drawn once, read `low` in all frames."""
    result = readings.copy()
    result[..., _drawn(severity, readings.shape[-1], rng)] = low
    return result


def stuck(readings: np.ndarray, severity: int, rng: np.random.Generator) -> np.ndarray:
    """`severity` elements read in all frames what they read in one frame, drawn at random from all windows."""
    result = readings.copy()
    elements = readings.shape[-1]
    chosen = _drawn(severity, elements, rng)
    frames = readings.reshape(-1, elements)
    result[..., chosen] = frames[rng.integers(len(frames)), chosen]
    return result


def dead_line(
    readings: np.ndarray, severity: int, rng: np.random.Generator, *, rows: int, cols: int, low: float
) -> np.ndarray:
    """`severity` whole rows or columns, drawn among all rows + cols, read `low`; elements are row-major."""
    result = readings.copy()
    grid = result.reshape(*result.shape[:-1], rows, cols)
    for line in _drawn(severity, rows + cols, rng):
        if line < rows:
            grid[..., line, :] = low
        else:
            grid[..., line - rows] = low
    return grid.reshape(result.shape)


def lost_frames(readings: np.ndarray, severity: float, rng: np.random.Generator) -> np.ndarray:
    """Every frame is lost with probability `severity`, the one before stands in; a first frame has none and stays."""
    lost = rng.random(readings.shape[:-1]) < severity
    lost[..., 0] = False
    kept = np.where(lost, 0, np.arange(readings.shape[-2]))
    return np.take_along_axis(readings, np.maximum.accumulate(kept, axis=-1)[..., None], axis=-2)


def jitter(readings: np.ndarray, severity: float, rng: np.random.Generator) -> np.ndarray:
    """Every frame is taken severity * N(0, 1) frames early or late: linear interpolation in time, the ends held."""
    last = readings.shape[-2] - 1
    at = np.clip(np.arange(last + 1) + severity * rng.standard_normal(readings.shape[:-1]), 0, last)
    before = np.floor(at).astype(int)
    share = (at - before)[..., None]
    first = np.take_along_axis(readings, before[..., None], axis=-2)
    second = np.take_along_axis(readings, np.minimum(before + 1, last)[..., None], axis=-2)
    return _same_kind(readings, first * (1 - share) + second * share)


def _drawn(severity: float, n: int, rng: np.random.Generator) -> np.ndarray:
    """The first `severity` of n in a random order: those of severity 2 contain that of severity 1."""
    if severity != int(severity) or not 0 <= severity <= n:
        raise InputError(f"params.yaml, stress: {severity!r} of {n} elements or lines cannot fail; give a whole number")
    return rng.permutation(n)[: int(severity)]


def _same_kind(readings: np.ndarray, result: np.ndarray) -> np.ndarray:
    return result.astype(readings.dtype, copy=False)
