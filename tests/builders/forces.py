"""Forces on a film over time."""

import numpy as np


def press(force, hold_s=1.0, rest_s=10.0):
    """1 s of rest, a ramp of 0.2 s to `force` (N), a hold, a sudden release, rest; (steps,) at 100 Hz."""
    ramp = np.linspace(0, force, 20)
    return np.concatenate([np.zeros(100), ramp, np.full(int(hold_s / 0.01), force), np.zeros(int(rest_s / 0.01))])
