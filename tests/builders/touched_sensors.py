"""Readings of a sensor that is touched in one place after another, as arrays."""

import numpy as np


def touched(frames=2000, channels=16, hz=50.0, noise=1.0, rest=12.0, pause_s=0.5, hold_s=0.3, highest=1023, seed=0):
    """Times in s (frames,) and counts (frames, channels): touches at random places, the neighbours answer by a third.

    noise: its standard deviation in counts; pause_s: between touches, on average.
    """
    rng, time_s = np.random.default_rng(seed), np.arange(frames) / hz
    readings, at = np.full((frames, channels), float(rest)), 1.0
    while at < time_s[-1] - hold_s - 1:
        place, knots = rng.integers(channels), at + np.cumsum([0, 0.2, hold_s, 0.2])
        touch = rng.uniform(200, 700) * np.interp(time_s, knots, [0, 1, 1, 0])
        for beside, share in ((-1, 0.3), (0, 1), (1, 0.3)):
            if 0 <= place + beside < channels:
                readings[:, place + beside] += share * touch
        at = knots[-1] + pause_s * rng.uniform(0.6, 1.4)
    return time_s, np.clip(np.rint(readings + noise * rng.normal(size=readings.shape)), 0, highest)
