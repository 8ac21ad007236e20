"""Make the readings of a sensor whose every property is known, under presses of known force."""

import numpy as np

from tactile.sheet.cycles import Log, Sensor

HZ = 100.0
SPAN, FULL_N = 200.0, 20.0  # reading of a full press above rest, and its force


def force(presses, peaks=(FULL_N,), ramp_s=1.0, hold_s=2.0, rest_s=2.0, hz=HZ):
    """Return times (n,) in s and forces (n,) in N: trapezoids, whose peaks take turns; rest before and after."""
    shapes = [np.interp(np.arange(0, rest_s + 2 * ramp_s + hold_s, 1 / hz),
                        np.cumsum([rest_s, ramp_s, hold_s, ramp_s]), [0, 1, 1, 0])]  # fmt: skip
    course = np.concatenate(
        [peaks[k % len(peaks)] * shapes[0] for k in range(presses)] + [np.zeros(round(rest_s * hz))]
    )
    pressed = np.diff(course > 0, prepend=False, append=False)
    assert pressed.sum() == 2 * presses and course[0] == course[-1] == 0, "rest before, between and after the presses"
    return np.arange(len(course)) / hz, course


def reading(
    time_s, course, *, loop=0.0, bend=0.0, creep=0.0, creep_s=0.5, rest_per_h=0.0, gain_per_h=0.0, noise=0.0,
    late_s=0.0, slow_s=0.0, rest=50.0, seed=0,
):  # fmt: skip
    """Return the readings (n,) of a sensor of sensitivity SPAN / FULL_N.

    loop: hysteresis, bend: non-linearity, rest_per_h: drift, all as shares of the span; gain_per_h: as a share of the
    gain; creep: as a share of the response, with the time constant creep_s; noise: in units of the reading; late_s:
    dead time; slow_s: time constant of a lag of first order.
    """
    share, falls = course / FULL_N, np.diff(course, prepend=0.0) < 0
    bow = 4 * share * np.clip(1 - share, 0, None)
    share = share + bend * bow + loop * bow * falls
    step = time_s[1] - time_s[0]
    if creep:
        share = share + creep * _behind(share, creep_s, step)
    if slow_s:
        share = _behind(share, slow_s, step)
    if late_s:
        share = np.interp(time_s - late_s, time_s, share)
    hours = time_s / 3600
    out = rest + SPAN * (share * (1 + gain_per_h * hours) + rest_per_h * hours)
    return out + np.random.default_rng(seed).normal(0, noise, len(out)) if noise else out


def _behind(course, time_constant_s, step_s):
    """Return a course (n,) seen through a memory of first order."""
    out, keep = np.empty_like(course), np.exp(-step_s / time_constant_s)
    state = 0.0
    for k, value in enumerate(course):
        state = keep * state + (1 - keep) * value
        out[k] = state
    return out


def sensor(time_s, course, readings, **more):
    """Return a sensor of one recording; readings: (n,) or (n, elements)."""
    readings = readings[:, None] if readings.ndim == 1 else readings
    log = Log("single/run0", "single", time_s, readings, course, np.full((len(time_s), 2), np.nan))
    return Sensor("made", "counts", "N", [log], **{"one_clock": True} | more)
