"""Say which readings of a log are no measurement, in words and row by row, for those who predict from them.

Frames of one number and readings of a channel that stands still are none. A frame that is printed again was measured,
only earlier: it is told, and its prediction is as good as that of the one before.
"""

from collections.abc import Iterator, Sequence

import numpy as np

from tactile.logs import no_measurement
from tactile.logs.no_measurement import Found

MOST_CHANNELS = 5  # that are told one by one


def found(t_s: np.ndarray, x: np.ndarray) -> Found:
    """Return what no_measurement finds in readings x (n, channels) at t_s (n,), of the channels without NaN."""
    known = np.flatnonzero(np.isfinite(x).all(axis=0)) if len(x) else np.empty(0, int)
    if not len(known):
        return Found(None, None, [])
    one = no_measurement.found(t_s, x[:, known])
    return one._replace(stuck=[each._replace(channel=int(known[each.channel])) for each in one.stuck])


def rows(of: Found, n: int) -> np.ndarray:
    """Return which of n readings hold no measurement, or one channel that has none, (n,) bool."""
    none = np.zeros(n, bool)
    if of.constant is not None:
        none[of.constant.rows] = True
    for each in of.stuck:
        none[each.first : each.stop] = True
    return none


def resampled(none: np.ndarray, t_s: np.ndarray, grid_s: np.ndarray) -> np.ndarray:
    """Return which readings that were interpolated at times `grid_s` (m,) rest on one that is none, (m,) bool.

    none: (n,) bool, of the readings at t_s (n,), which rise.
    """
    after = np.clip(np.searchsorted(t_s, grid_s), 0, len(t_s) - 1)
    exact = t_s[after] == grid_s
    return none[after] | (none[np.maximum(after - 1, 0)] & ~exact)


def apart(of: Found) -> Iterator[tuple[str, Found]]:
    """Yield what was found one by one, each with a name by which it is told once."""
    if of.constant is not None:
        yield "constant", Found(of.constant, None, [])
    if of.repeated is not None:
        yield "repeated", Found(None, of.repeated, [])
    for each in of.stuck:
        yield f"channel {each.channel} at {each.value}", Found(None, None, [each])


def sentences(of: Found, t_s: np.ndarray, names: Sequence[str]) -> list[str]:
    """Return what is to be said of a recording; names: of the channels."""
    said, n = [], len(t_s)
    if of.constant is not None:
        count, value = len(of.constant.rows), of.constant.value
        said.append(f"{count} of {n} frames are no measurement: all channels read {value:g} in them")
    if of.repeated is not None:
        rate = 1 / float(np.median(np.diff(t_s)))
        if of.repeated.regular:
            times = of.repeated.times
            said.append(
                f"each frame is printed {times:.0f} times: of {rate:.3g} frames a second, {rate / times:.3g} are new"
            )
        else:
            said.append(
                f"{len(of.repeated.rows)} of {n} frames are the ones before, printed again, more than chance can do: "
                "what they say is older than their time"
            )
    for each in of.stuck[:MOST_CHANNELS]:
        said.append(
            f"{names[each.channel]} stands at {each.value:g} from {t_s[each.first]:.6g} to {t_s[each.stop - 1]:.6g} s, "
            f"elsewhere for {each.elsewhere_s:.3g} s at most: no measurement"
        )
    if len(of.stuck) > MOST_CHANNELS:
        said.append(f"{len(of.stuck) - MOST_CHANNELS} more channels stand still for as long")
    return said
