"""Say where an interval lies: the one test of equivalence, of claims, effects of scenes and sizes of models."""

import numpy as np


def inside(low: np.ndarray, high: np.ndarray, least: float, most: float) -> np.ndarray:
    """Tell which intervals lie between two bounds altogether, of the shape of `low` and `high`."""
    return (low >= least) & (high <= most)


def lies_within(low: float, high: float, least: float, most: float) -> bool | None:
    """Return True for an interval within two bounds, False for one wholly beyond a bound; None: across one, or NaN."""
    if low >= least and high <= most:
        return True
    return False if low > most or high < least else None
