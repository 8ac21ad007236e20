"""Find where a sensor at rest begins to read something else: it was re-zeroed, or its gain was changed."""

from typing import NamedTuple

import numpy as np

from tactile.logs.parse import finest_step

LEAST = 20  # readings at rest
# Of the step, the widest interquartile range on its sides. Re-zeroed recordings have 0.01 to 0.1 (simulated arrays) and
# 0.05 to 0.35 (a Velostat taxel); creep and drift have 0.27 and more.
SETTLED = 0.2
LARGE = 0.005  # of the largest response, the least step


class Step(NamedTuple):
    """A step between two levels."""

    first: int  # the first reading of the second level
    before: float
    after: float


def step(resting: np.ndarray, readings: np.ndarray) -> Step | None:
    """Return the step between two settled levels of the mean element at rest; None where there is none.

    resting: the readings without a touch, (n, elements) in the order of time; readings: all, (m, elements).
    """
    n, levels = len(resting), resting.mean(axis=1)
    if n < LEAST:
        return None
    total, count = np.cumsum(levels), np.arange(1, n)
    apart = np.square(total[:-1] / count - (total[-1] - total[:-1]) / (n - count)) * count * (n - count)
    first = int(np.argmax(apart)) + 1  # the variance between the two sides is the largest
    sides = levels[:first], levels[first:]
    before, after = map(np.median, sides)
    spread, size = max(np.subtract(*np.percentile(side, [75, 25])) for side in sides), abs(after - before)
    response = float((readings - np.median(resting, axis=0)).max())
    if size <= max(LARGE * response, 3 * finest_step(readings.ravel()) / resting.shape[1]) or spread > SETTLED * size:
        return None
    return Step(first, float(before), float(after))
