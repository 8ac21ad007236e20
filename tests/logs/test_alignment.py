"""Clocks: known offsets, drift and resets are found again; what cannot be aligned is said."""

import numpy as np
import pytest

from tactile.base.errors import InputError
from tactile.logs import alignment
from tactile.logs.alignment import Clock, Signal, averager, interpolated, place_all, place_pair

LIMITS = {"max_offset_s": 5.0, "min_correlation": 0.5, "who": "single/run000"}


def presses(seconds, rng, regular=False):
    """Force on a 5 ms grid: presses of 0.2 s up, 0.3 s hold, 0.2 s down, with pauses."""
    t = np.arange(0, seconds, 0.005)
    force, start = np.zeros(len(t)), 1.5
    while start < seconds - 1.5:
        stretch = 1.0 if regular else rng.uniform(0.75, 1.25)
        peak = 20.0 if regular else rng.uniform(4, 40)
        knots = start + np.cumsum([0, 0.2, 0.3, 0.2]) * stretch
        force += peak * np.interp(t, knots, [0, 1, 1, 0]) ** 1.5
        start = knots[-1] + (0.3 if regular else rng.uniform(0.2, 0.4))
    return t, force


def response(t, force, rng):
    """Counts of four elements that compress the force and creep behind it, (n, 4)."""
    held, lag = np.zeros(len(t)), 0.0
    for k in range(1, len(t)):
        lag += (force[k] ** 0.6 - lag) * 0.005 / 0.8
        held[k] = lag
    level = 60 * (force**0.6 + 0.3 * held)
    return level[:, None] * [1.0, 0.5, 0.2, 0.1] + [0, 4, 9, 1] + rng.normal(0, 0.7, (len(t), 4))


def sample(t, values, start, stop, hz, boot_s=0.0, ppm=0.0):
    """What a device prints between two true times: (true times, times on its own clock, values)."""
    at = np.arange(start, stop, 1 / hz)
    columns = np.atleast_2d(values.T)
    taken = np.stack([np.interp(at, t, column) for column in columns], axis=1)
    return at, boot_s + (at - start) * (1 + ppm * 1e-6), taken


def scene(seconds, seed, **kind):
    rng = np.random.default_rng(seed)
    t, force = presses(seconds, rng, **kind)
    return t, force, response(t, force, rng), rng


def force_signal(device):
    return Signal(device[1], alignment.strength_above_rest(device[2][:, 0]))


def array_signal(device):
    return Signal(device[1], sum(map(alignment.strength_above_rest, device[2].T)))


def rms_ms(clock, device, reference):
    """RMS over a device's samples of (reference time given by the clock) - (true reference time), in ms."""
    slope, offset = np.polyfit(reference[0], reference[1], 1)
    error = clock(device[1]) - (slope * device[0] + offset)
    return 1e3 * np.sqrt((error**2).mean())


@pytest.mark.parametrize("seed", range(4))
def test_offsets_are_found_within_10_ms(seed):
    t, force, counts, rng = scene(70, seed)
    starts = rng.uniform(0, 4, 3)
    cell = sample(t, force + rng.normal(0, 0.05, len(t)), starts[0], 70, 100, boot_s=31.0)
    array = sample(t, counts, starts[1], 69, 50, boot_s=2.5, ppm=20)
    cnc = sample(t, -0.03 * (force / 0.113) ** (2 / 3) + 2.0 * (force <= 0), starts[2], 70, 50, boot_s=700.0)
    (identity,), (clock,) = place_pair([force_signal(cell)], [array_signal(array)], **LIMITS)
    assert identity == Clock(0.0)
    assert rms_ms(clock, array, cell) < 10
    depth = Signal(cnc[1], alignment.depth_strength(cnc[2][:, 0]))
    (clock,) = place_all([depth], force_signal(cell), **LIMITS)
    assert rms_ms(clock, cnc, cell) < 10


@pytest.mark.parametrize("seed", range(3))
def test_light_and_slow_presses_are_placed_by_longer_edges(seed, monkeypatch):
    """Noise hides their changes over the shortest time: presses of 1.4 s, an eighth as strong as the others."""
    rng = np.random.default_rng(seed)
    t, force = presses(40, rng)
    force, t = force / 8, 2 * t
    cell = sample(t, force + rng.normal(0, 0.05, len(t)), 0.5, 80, 100)
    array = sample(t, response(t, force, rng), 1.5, 79, 50, boot_s=9.0)
    pair = [force_signal(cell)], [array_signal(array)]
    _, (clock,) = place_pair(*pair, **LIMITS)
    assert rms_ms(clock, array, cell) < 10
    monkeypatch.setattr(alignment, "EDGES_S", alignment.EDGES_S[:1])
    with pytest.raises(InputError, match="do not follow each other"):
        place_pair(*pair, **LIMITS)


def test_drift_of_a_long_recording_is_found():
    t, force, counts, _ = scene(300, 7)
    cell, array = sample(t, force, 0.4, 300, 100), sample(t, counts, 1.3, 300, 50, boot_s=9.0, ppm=-100)
    _, (clock,) = place_pair([force_signal(cell)], [array_signal(array)], **LIMITS)
    assert rms_ms(clock, array, cell) < 10
    assert clock.drift * 1e6 == pytest.approx(100, abs=30)


@pytest.mark.slow
@pytest.mark.parametrize("silent", [(0, 0), (300, 1000)], ids=["pressed throughout", "silent in the middle"])
def test_a_recording_longer_than_the_stretch_that_is_searched_first(silent):
    rng = np.random.default_rng(11)
    t, force = presses(1300, rng)
    force[(t > silent[0]) & (t < silent[1])] = 0
    counts = response(t, force, rng)
    cell, array = sample(t, force, 0.4, 1300, 100), sample(t, counts, 1.3, 1300, 50, boot_s=9.0, ppm=-30)
    assert 1300 > 2 * alignment.LONG_S
    _, (clock,) = place_pair([force_signal(cell)], [array_signal(array)], **LIMITS)
    assert rms_ms(clock, array, cell) < 10


@pytest.mark.parametrize("device", ["array", "cell", "both"])
def test_every_segment_after_a_reset_is_aligned(device):
    t, force, counts, _ = scene(90, 3)
    cells = [sample(t, force, 0.8, 90, 100, boot_s=5.0)]
    arrays = [sample(t, counts, 0.2, 90, 50, boot_s=3.0)]
    if device in ("array", "both"):
        arrays = [sample(t, counts, 0.2, 30, 50, boot_s=3.0), sample(t, counts, 31.7, 90, 50, boot_s=0.4)]
    if device in ("cell", "both"):
        cells = [sample(t, force, 0.8, 60, 100, boot_s=5.0), sample(t, force, 62.1, 90, 100, boot_s=0.3)]
    cell_clocks, array_clocks = place_pair(
        [force_signal(c) for c in cells], [array_signal(a) for a in arrays], **LIMITS
    )
    for clock, segment in [*zip(cell_clocks, cells, strict=True), *zip(array_clocks, arrays, strict=True)]:
        assert rms_ms(clock, segment, cells[0]) < 10


def test_a_short_segment_has_no_clock_and_the_next_one_is_found():
    t, force, counts, _ = scene(60, 5)
    cell = sample(t, force, 0.5, 60, 100)
    arrays = [sample(t, counts, 0.9, 2.0, 50), sample(t, counts, 3.5, 60, 50, boot_s=0.4)]
    _, (none, clock) = place_pair([force_signal(cell)], [array_signal(a) for a in arrays], **LIMITS)
    assert none is None
    assert rms_ms(clock, arrays[1], cell) < 10


def test_two_touches_and_a_second_cell_with_its_own_clock():
    rng = np.random.default_rng(11)
    t, first = presses(100, rng)
    _, second = presses(100, rng)
    counts = response(t, first, rng) + response(t, second, rng)[:, ::-1]
    array = sample(t, counts, 0.7, 100, 50, boot_s=3.0)
    cells = [sample(t, first, 0.2, 100, 100), sample(t, second, 1.1, 100, 100, boot_s=44.0)]
    one, two = (force_signal(cell) for cell in cells)
    _, (clock,) = place_pair([one], [array_signal(array)], **LIMITS | {"min_correlation": 0.25})
    placed = alignment.joined([array_signal(array)], [clock])
    (other,) = place_all([two], placed, beside=one, **LIMITS)
    both = Signal(one.time_s, one.value + np.interp(one.time_s, other(two.time_s), two.value))
    _, (clock,) = place_pair([both], [array_signal(array)], **LIMITS)
    assert rms_ms(clock, array, cells[0]) < 10
    assert rms_ms(other, cells[1], cells[0]) < 10


def interpolated_at_every_lag(piece, against, lags, step, edge_s, beside, halves):
    """The correlations of `alignment._edge_correlations`, every one from signals interpolated for its lag alone."""
    return np.array([alignment._edge_correlation(piece, against, Clock(lag), edge_s, beside, halves) for lag in lags])


def test_the_search_on_shared_samples_scores_every_lag_alike():
    """Also where the overlap is too short, and where one signal does not change in it."""
    t, force, counts, rng = scene(40, 9)
    long, short = force_signal(sample(t, force, 0, 40, 100)), array_signal(sample(t, counts, 10, 14, 50))
    still = Signal(long.time_s, np.where(long.time_s < 20, long.value, 0.0))
    for piece, against in ((short, long), (long, short), (short, still), (still, short)):
        for first, step in ((-15.0, 0.01), (-0.5, 0.01), (9.9, 0.0025), (20.0, 0.0025), (34.0, 0.01)):
            for sign in (1, -1):
                lags = sign * first + np.arange(0, 200) * step
                levels = alignment._overlap(piece, against, Clock(lags.mean()), None)
                arguments = piece, against, lags, step, 0.04, None, [alignment._half(level) + 1e-3 for level in levels]
                assert alignment._edge_correlations(*arguments) == pytest.approx(
                    interpolated_at_every_lag(*arguments), abs=1e-7
                )


def test_unrelated_logs_are_refused():
    cell, (t, _, counts, _) = sample(*scene(60, 1)[:2], 0, 60, 100), scene(60, 2)
    with pytest.raises(InputError, match="single/run000: the signals do not follow each other.*min_correlation"):
        place_pair([force_signal(cell)], [array_signal(sample(t, counts, 0, 60, 50))], **LIMITS)


def test_a_dead_array_is_refused():
    cell = sample(*scene(60, 1)[:2], 0, 60, 100)
    dead = Signal(np.arange(0, 60, 0.02), np.zeros(3000))
    with pytest.raises(InputError, match="best correlation 0.00"):
        place_pair([force_signal(cell)], [dead], **LIMITS)


def test_regular_presses_are_refused_unless_the_offset_is_small():
    t, force, counts, _ = scene(120, 4, regular=True)
    cell, array = sample(t, force, 0, 120, 100), sample(t, counts, 0.1, 120, 50)
    pair = [force_signal(cell)], [array_signal(array)]
    with pytest.raises(InputError, match="alike, because the presses are too regular"):
        place_pair(*pair, **LIMITS)
    _, (clock,) = place_pair(*pair, **LIMITS | {"max_offset_s": 0.4})
    assert rms_ms(clock, array, cell) < 10


def test_a_recording_without_a_long_enough_segment_is_refused():
    tiny = Signal(np.arange(0, 1, 0.01), np.ones(100))
    with pytest.raises(InputError, match="no uninterrupted stretch of 3 s"):
        place_pair([tiny], [tiny], **LIMITS)


def test_only_a_fast_log_is_averaged():
    slow = np.arange(6) * 0.01
    assert averager(slow, 0.01)(slow) is slow
    time = np.array([0.0, 0.001, 0.002, 0.011, 0.012, 0.045, 0.046]) + 1.7e9
    counts = np.array([30_000, 30_000, 30_003, 1, 2, 5, 6], dtype=np.int16)  # their sums are beyond int16
    average = averager(time, 0.01)
    assert average(counts).tolist() == [30_001, 1.5, 5.5]
    assert average(time) - 1.7e9 == pytest.approx([0.001, 0.0115, 0.0455], abs=1e-6)
    assert average(np.column_stack([counts, -counts])).tolist() == [[30_001, -30_001], [1.5, -1.5], [5.5, -5.5]]


def test_interpolation_knows_where_it_knows():
    time = np.array([0.0, 0.1, 0.2, 0.3, 1.3, 1.4, 1.5])
    values, known = interpolated(np.array([-0.01, 0.0, 0.15, 0.8, 1.5, 1.51]), time, 10 * time)
    assert known.tolist() == [False, True, True, False, True, False]
    assert values[known] == pytest.approx([0, 1.5, 15])
    values, known = interpolated(np.array([-0.1, 0.25, 9.0]), time, np.stack([time, -time], axis=1), held=True)
    assert known.tolist() == [False, True, True]
    assert values[1:].tolist() == [[0.2, -0.2], [1.5, -1.5]]


def test_regular_signals_that_seem_reversed_at_half_a_period_are_not():
    t = np.arange(0, 60, 0.01)
    wave = np.sin(2 * np.pi * t)
    for sign, one_clock, expected in ((1, True, 1), (-1, True, -1), (1, False, 1), (-1, False, 1)):
        found = alignment.direction(Signal(t, sign * wave), Signal(t, wave), one_clock=one_clock, min_correlation=0.5)
        assert found == expected
    noise = Signal(t, np.random.default_rng(0).normal(size=len(t)))
    assert alignment.direction(noise, Signal(t, wave), one_clock=True, min_correlation=0.5) == 0
