"""Make frames of touch that hold presses of known force."""

import numpy as np
import pyarrow as pa

from tactile.datasets import schemas


def frames(force: np.ndarray, x: float = 30.0, y: float = 30.0, gap_at: int | None = None) -> pa.Table:
    """Return frames of one recording at 50 Hz in which element 12 reads ten counts per newton."""
    n = len(force)
    t_s = np.arange(n) / 50
    if gap_at:
        t_s[gap_at:] += 0.1
        assert schemas.gaps(t_s, np.zeros(n, int)).sum() == 1
    v = np.full((n, 25), 20)
    v[:, 12] += (10 * force).astype(int)
    schema = schemas.frames(25, 2, pa.int16())
    place = np.full((n, 1), x), np.full((n, 1), y)
    zero = np.zeros(n, dtype=int)
    return schemas.frame_rows(
        schema, "single", "run", segment=zero, t_s=t_s, v=v, force_n=force[:, None], x_mm=place[0], y_mm=place[1]
    )


def press_force(count: int, steps: int = 40) -> np.ndarray:
    one = np.concatenate([np.zeros(15), np.full(steps - 30, 8.0), np.zeros(15)])
    force = np.tile(one, count)
    assert (np.diff((force > 0.5).astype(int)) == 1).sum() == count, "a press is force between two rests"
    return force
