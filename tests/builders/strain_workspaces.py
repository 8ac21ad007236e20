"""Make MATLAB workspaces as the robot of the recorded strain sensors saves them."""

import numpy as np
import scipy.io

from tactile.experiments.strain_recorded import CYCLE, PRESSED

CYCLES = 20


def workspace(channels=6, cycles=CYCLES, extra=0, **others):
    """Return the variables that the robot's program saves; the last cycle, of `extra` samples, is not finished."""
    assert 0 <= extra < CYCLE, "a cycle of all its samples is finished"
    rng = np.random.default_rng(0)
    n = cycles * CYCLE + extra
    pressed = np.arange(n) % CYCLE >= PRESSED
    return {
        "voltage": 1.8 + 0.1 * pressed[:, None] + 0.005 * rng.standard_normal((n, channels)),
        "tim": 0.2 + 0.07 * np.arange(n)[None],
        "pos": rng.uniform(-22.5, 22.5, (2, cycles + (extra > 0))),
        "deformation": np.uint8(5),
        "flag": 3.0,
    } | others


def save(folder, content, name="para5_long.mat", compress=True):
    path = folder / name
    path.parent.mkdir(parents=True, exist_ok=True)
    scipy.io.savemat(path, content, do_compression=compress)
    return path
