"""Put devices with clocks of their own on one time axis.

Every device prints microseconds since its own start, from a crystal of its own. What they share is the
presses: the force rises when the array's response and the CNC's depth do. So the offset between two clocks is
where the two signals agree best:

1. roughly, the highest cross-correlation of the levels within the offsets that are possible;
2. finely, near that offset, the highest correlation of the changes of contact over `EDGES_S`, where contact is
   s / (s + c), c a small share of a strong signal. Velostat creeps and shows hysteresis, which delays its
   level by 20 to 25 ms in our scene, but not the instants when contact begins and ends;
3. the drift is the slope of the offsets of stretches of `STRETCH_S`, for segments of at least `STRETCHES` of
   them. In shorter ones a relative drift of 60 ppm moves the ends by less than 4 ms, which is left alone.

Devices that one computer stamps share a clock, and nothing is shifted. Whether they do is measured all the same:
`agreement` compares the logs as they are with the best offset, `direction` tells a reversed sign.

With several touches the array answers to their sum, so the sum of all forces takes the place of the force. A
further load cell with a clock of its own is placed where it, together with the others, fits the array best.
"""

import itertools
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.fft import irfft, next_fast_len, rfft

from tactile.base.errors import InputError

ROUGH_S = 0.05  # grid of the rough search, a quarter of what the fine one reaches
STEP_S = 0.01  # grid on which signals are compared: the interval of the fastest device
FINER = 4  # steps of the last search, and of its parabola, in one of the grid
# A change is taken over the first of these times over which changes correlate: presses rise in 0.1 to 0.5 s. Over the
# second, light and slow presses stand out of the noise (simulated tips of 3 mm: 0.8 in place of 0.5); the lags of both
# differ by 10 ms at most.
EDGES_S = (0.04, 0.12)
NEAR_S = 0.2  # reach of the fine search: shorter than a press, longer than drift and creep
STRETCH_S = 30.0  # about 30 presses; their offset is good to 1 or 2 ms
STRETCHES = 4
LONG_S = 600.0  # in a longer segment, its middle tells where its stretches are searched
SHORTEST_S = 3.0  # a segment with fewer than about three presses cannot be placed
CONTACT = 0.05  # share of the 99th percentile at which contact is half of full; noise is 0.01 of it and less
HOLE = 5.0  # intervals; ground truth is not interpolated over longer holes
# Share of the best correlation that presses on one clock keep as they are. Simulated ones, on one clock, keep 0.998 and
# more; where a device is late by a fifth of a press, 0.9 to 0.5; by half of one, 0.6 and less; by 1.5 s, 0.15 and less
# of presses of 2 s, 0.5 of presses of 1 s.
KEPT = 0.75
AMBIGUOUS = 0.97  # another offset with this share of the best correlation: presses too regular to tell


class NotOneClock(InputError):
    """Logs that are said to be of one clock have no time in common."""


@dataclass(frozen=True)
class Signal:
    """One device during one segment: rising times (n,) in s, and a strength (n,), 0 at rest."""

    time_s: np.ndarray
    value: np.ndarray

    @property
    def duration_s(self) -> float:
        """Return the time from the first to the last sample."""
        return float(self.time_s[-1] - self.time_s[0])


@dataclass(frozen=True)
class Clock:
    """A device's clock: its time t becomes reference time, t + offset_s + drift * (t - middle_s)."""

    offset_s: float
    drift: float = 0.0
    middle_s: float = 0.0
    correlation: float = 1.0

    def __call__(self, time_s: np.ndarray) -> np.ndarray:
        """Return the reference time (n,) in s of the device's times (n,) in s."""
        return time_s + self.offset_s + self.drift * (time_s - self.middle_s)

    def report(self) -> dict[str, float]:
        """Return the clock's numbers for the report of ingest."""
        return {
            "offset_ms": 1e3 * self.offset_s,
            "drift_ppm": 1e6 * self.drift,
            "correlation": self.correlation,
        }


@dataclass(frozen=True)
class Agreement:
    """How two logs of one clock agree: their correlation as they are, and the best, of the one `offset_s` later.

    without: the correlation that is left of further devices, which are compared together with the one.
    """

    offset_s: float
    correlation: float
    best: float
    without: float = 0.0

    @property
    def refuted(self) -> bool:
        """Tell whether the logs agree so much better with an offset that they cannot be of one clock."""
        return self.correlation - self.without < KEPT * (self.best - self.without)

    def said(self, one: str, other: str) -> str:
        """Return the numbers in words; one, other: the names of the two logs."""
        return (
            f"{one} and {other} agree best with {one} {abs(self.offset_s):.2f} s "
            f"{'later' if self.offset_s > 0 else 'earlier'} (correlation {self.best:.2f}, as they are "
            f"{self.correlation:.2f})"
        )

    def report(self) -> dict[str, float]:
        """Return the numbers for the report of ingest, beside the offset that is applied, 0."""
        return {
            "measured_offset_ms": 1e3 * self.offset_s,
            "correlation": self.correlation,
            "best_correlation": self.best,
        }


UNMEASURED = {"measured_offset_ms": None, "correlation": None, "best_correlation": None}


def strength_above_rest(values: np.ndarray) -> np.ndarray:
    """Return the counts of an element, or a force in N, (n,), above their rest level (10th percentile)."""
    return np.maximum(values - np.percentile(values, 10), 0)


def depth_strength(z_mm: np.ndarray) -> np.ndarray:
    """Return the depth (n,) of the CNC's tip below the surface (z = 0), in mm."""
    return np.maximum(-z_mm, 0)


def averager(time_s: np.ndarray, step_s: float) -> Callable[[np.ndarray], np.ndarray]:
    """Return a function that averages a log over steps of `step_s`, and leaves a log that is no faster as it is.

    Without it, the noise of single samples would be compared. time_s: (n,), rising. The function turns values, or the
    times themselves, (n,) or (n, columns), into (m,) or (m, columns).
    """
    if len(time_s) < 2 or np.median(np.diff(time_s)) > step_s / 2:
        return lambda values: values
    starts = np.flatnonzero(np.diff((time_s - time_s[0]) // step_s, prepend=-1))
    count = np.diff(starts, append=len(time_s))
    return lambda values: (np.add.reduceat(values, starts, axis=0, dtype=float).T / count).T


def joined(pieces: list[Signal], clocks: list[Clock | None]) -> Signal:
    """Join the pieces of one device that have a clock to one signal in reference time."""
    placed = [(clock(piece.time_s), piece.value) for piece, clock in zip(pieces, clocks, strict=True) if clock]
    return Signal(*(np.concatenate(column) for column in zip(*placed, strict=True)))


def longest_interval_s(time_s: np.ndarray) -> float:
    """Return the longest time in s between two samples at `time_s` (n,) that is no hole: `HOLE` median intervals."""
    return HOLE * float(np.median(np.diff(time_s))) if len(time_s) > 1 else 0.0


def interpolated(
    at_s: np.ndarray, time_s: np.ndarray, values: np.ndarray, held: bool = False, longest_s: float | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Interpolate `values` (n,) or (n, columns), known at `time_s` (n,), at the times `at_s` (m,).

    Returns the values, (m,) or (m, columns), and where they are known, (m,) bool: not outside the span of `time_s`
    (nowhere, if that is one sample), and not in holes of more than `longest_s`, the `longest_interval_s` if None.
    held: each value stays until the next one (targets shown to an operator), so values are known from the first on.
    """
    after = np.searchsorted(time_s, at_s, side="right")
    inside = np.clip(after, 1, len(time_s) - 1)
    if held:
        return values[np.maximum(after - 1, 0)], after > 0
    if len(time_s) < 2:
        return np.full((len(at_s), *values.shape[1:]), np.nan), np.zeros(len(at_s), dtype=bool)
    width = time_s[inside] - time_s[inside - 1]
    longest_s = longest_interval_s(time_s) if longest_s is None else longest_s
    known = (at_s >= time_s[0]) & (at_s <= time_s[-1]) & (width <= longest_s)
    part = (at_s - time_s[inside - 1]) / width
    if values.ndim == 2:
        part = part[:, None]
    return values[inside - 1] * (1 - part) + values[inside] * part, known


def place_pair(
    reference: list[Signal], other: list[Signal], *, max_offset_s: float, min_correlation: float, who: str
) -> tuple[list[Clock | None], list[Clock | None]]:
    """Return a clock per segment of each of two devices; the first segment of `reference` defines the time.

    Both started within `max_offset_s` of each other; after a reset, a segment starts between the end of the
    one before and `max_offset_s` later. Segments are placed in the order in which they can start, each
    against the segments of the other device that are placed already. A segment shorter than `SHORTEST_S` has None in
    place of a clock. Raises InputError, in a sentence that `who` begins, for signals that do not correlate and for
    offsets that fit equally well.
    """
    limits = {"max_offset_s": max_offset_s, "min_correlation": min_correlation, "who": who}
    first = next((k for k, piece in enumerate(reference) if piece.duration_s >= SHORTEST_S), None)
    if first is None:
        raise InputError(f"{who}: no uninterrupted stretch of {SHORTEST_S:g} s to align; record longer")
    skipped = sum(piece.duration_s for piece in reference[:first])
    start = reference[first].time_s[0]
    pieces = [reference, other]
    clocks: list[list[Clock | None]] = [[None] * first + [Clock(0.0)], []]
    end = start + reference[first].duration_s
    early = start - skipped - first * max_offset_s  # when the capture can have begun
    windows = [(end, end + max_offset_s), (early - max_offset_s, start - skipped + max_offset_s)]
    while any(len(clocks[k]) < len(pieces[k]) for k in (0, 1)):
        k = min((k for k in (0, 1) if len(clocks[k]) < len(pieces[k])), key=lambda k: windows[k][0])
        piece = pieces[k][len(clocks[k])]
        against = joined(pieces[1 - k][: len(clocks[1 - k])], clocks[1 - k]) if any(clocks[1 - k]) else None
        clock, windows[k] = _place(piece, against, windows[k], limits)
        clocks[k].append(clock)
    return clocks[0], _any_placed(clocks[1], who)


def place_all(
    pieces: list[Signal],
    against: Signal,
    *,
    max_offset_s: float,
    min_correlation: float,
    who: str,
    beside: Signal | None = None,
) -> list[Clock | None]:
    """Return a clock per segment of one device, placed against a signal that is in reference time already.

    The device started within `max_offset_s` of the start of `against`. `beside`, in reference time too, is
    the part of `against` that other devices contribute. Else as `place_pair`.
    """
    limits = {"max_offset_s": max_offset_s, "min_correlation": min_correlation, "who": who, "beside": beside}
    window = (against.time_s[0] - max_offset_s, against.time_s[0] + max_offset_s)
    clocks = []
    for piece in pieces:
        clock, window = _place(piece, against, window, limits)
        clocks.append(clock)
    return _any_placed(clocks, who)


def agreement(
    piece: Signal, against: Signal, *, reach_s: float, min_correlation: float, beside: Signal | None = None
) -> Agreement | None:
    """Return how a device agrees with another on the same clock; None where they overlap for less than `SHORTEST_S`.

    The best offset within `reach_s` is sought; of offsets that fit alike, as they do where presses are regular, it is
    the one nearest to 0. `beside`: as in `place_all`.
    """
    first, last = max(piece.time_s[0], against.time_s[0]), min(piece.time_s[-1], against.time_s[-1])
    if last - first < SHORTEST_S:
        return None
    steps = round(min(reach_s, (last - first) / 4) / ROUGH_S)  # of a short overlap, half is compared at every lag
    lags = np.arange(-steps, steps + 1) * ROUGH_S
    grid = np.arange(first + steps * ROUGH_S, last - steps * ROUGH_S, ROUGH_S)
    level = np.interp(grid, against.time_s, against.value)
    more = np.interp(grid, beside.time_s, beside.value) if beside is not None else 0
    scores = np.array([_correlation(np.interp(grid - lag, piece.time_s, piece.value) + more, level) for lag in lags])
    alike = np.flatnonzero(scores >= scores.max() - (1 - AMBIGUOUS) * abs(scores.max()))
    top = int(alike[np.argmin(np.abs(lags[alike]))])
    while scores[max(top - 1, 0) : top + 2].max() > scores[top]:
        top += 1 if scores[top + 1 : top + 2].max(initial=-1) > scores[top] else -1
    near = float(lags[top])
    middle = (first + last) / 2
    part = _between(piece, middle - LONG_S / 2, middle + LONG_S / 2)
    for edge_s in EDGES_S:
        lag, score = _fine_lag(part, against, near, edge_s, beside) if len(part.time_s) else (near, -1.0)
        if score >= min_correlation:
            break
    else:
        lag = near
    at_zero, best = (_level_correlation(piece, against, Clock(offset), beside) for offset in (0.0, lag))
    without = 0.0 if beside is None else _level_correlation(beside, against, Clock(0.0), None)
    return Agreement(lag, at_zero, best, without)


def direction(piece: Signal, against: Signal, *, one_clock: bool, min_correlation: float) -> int:
    """Return 1 where a device's levels rise with the other's, -1 where they fall, 0 where neither is clear.

    The sign is that of the strongest correlation, positive or negative, at any offset. Of offsets that fit alike, it is
    the nearest to 0 for devices of one clock, and else a positive one: at half a period, regular presses seem reversed.
    """
    lags, products, alike = _rough_products(piece, against)
    correlations = products / max(alike, np.finfo(float).tiny)
    strength = np.abs(correlations)
    if not strength.max() >= min_correlation:
        return 0
    best = np.flatnonzero(strength >= AMBIGUOUS * strength.max())
    if one_clock:
        best = best[[np.argmin(np.abs(lags[best]))]]
    return 1 if (correlations[best] > 0).any() else -1


def _any_placed(clocks: list[Clock | None], who: str) -> list[Clock | None]:
    """Return the clocks; raise InputError where no segment has one."""
    if not any(clocks):
        raise InputError(f"{who}: no uninterrupted stretch of {SHORTEST_S:g} s to align; record longer")
    return clocks


def _place(
    piece: Signal, against: Signal | None, window: tuple[float, float], limits: dict
) -> tuple[Clock | None, tuple[float, float]]:
    """Return the clock of a segment that starts within `window` (reference time), and the window of the next one."""
    if piece.duration_s < SHORTEST_S:
        low, high = (edge + piece.duration_s for edge in window)
        return None, (low, high + limits["max_offset_s"])
    if against is None:
        raise InputError(f"{limits['who']}: nothing to align a segment against; the logs do not overlap in time")
    lags = tuple(edge - piece.time_s[0] for edge in window)
    clock = _fit(piece, against, lags, limits)
    end = float(clock(piece.time_s[-1]))
    return clock, (end, end + limits["max_offset_s"])


def _fit(piece: Signal, against: Signal, lags: tuple[float, float], limits: dict) -> Clock:
    """Fit the offset and drift of `piece` against `against`, the offset searched within `lags`."""
    who, (rough, rival) = limits["who"], _rough_lag(piece, against, *lags)
    for edge_s in EDGES_S:
        clock = _fit_near(piece, against, rough, edge_s, limits)
        if clock.correlation >= limits["min_correlation"]:
            break
    else:
        raise InputError(
            f"{who}: the signals do not follow each other (best correlation "
            f"{max(clock.correlation, 0.0):.2f}, touch.ingest.min_correlation {limits['min_correlation']:g}); "
            "check that the logs belong to one capture"
        )
    if rival is not None:
        raise InputError(
            f"{who}: the clocks fit at {rough:+.2f} s and at {rival:+.2f} s alike, because the presses are too "
            "regular; vary their depth or timing, or lower touch.ingest.max_clock_offset_s below their period"
        )
    return clock


def _fit_near(piece: Signal, against: Signal, rough: float, edge_s: float, limits: dict) -> Clock:
    """Fit offset and drift near the offset `rough` by the changes over `edge_s`, however little they correlate."""
    beside = limits.get("beside")
    middle = (piece.time_s[0] + piece.time_s[-1]) / 2
    part = _between(piece, middle - LONG_S / 2, middle + LONG_S / 2)  # empty where the device was silent for long
    lag, score = _fine_lag(part, against, rough, edge_s, beside) if len(part.time_s) else (rough, -1.0)
    if piece.duration_s > LONG_S and not score >= limits["min_correlation"]:
        lag, _ = _fine_lag(piece, against, rough, edge_s, beside)
    stretches = int(piece.duration_s // STRETCH_S)
    edges = np.linspace(piece.time_s[0], piece.time_s[-1], stretches + 1 if stretches >= STRETCHES else 0)
    placed = []  # (time, lag) of the stretches that correlate
    for left, right in itertools.pairwise(edges):
        stretch = _between(piece, left, right)
        if len(stretch.time_s) >= 2:
            stretch_lag, score = _fine_lag(stretch, against, lag, edge_s, beside)
            if score >= limits["min_correlation"]:
                placed.append((stretch.time_s.mean(), stretch_lag))
    drift = 0.0
    if len(placed) >= STRETCHES:
        times, lags = np.array(placed).T
        drift, lag = np.polyfit(times - middle, lags, 1)
    clock = Clock(float(lag), float(drift), float(middle))
    # Short recordings follow others in level by chance, but not in their edges.
    correlation = min(
        _level_correlation(piece, against, clock, beside), _edge_correlation(piece, against, clock, edge_s, beside)
    )
    return Clock(clock.offset_s, clock.drift, clock.middle_s, correlation)


def _between(piece: Signal, first_s: float, last_s: float) -> Signal:
    """Return the samples of a segment from one time to another, both included."""
    inside = slice(np.searchsorted(piece.time_s, first_s), np.searchsorted(piece.time_s, last_s, side="right"))
    return Signal(piece.time_s[inside], piece.value[inside])


def _rough_lag(piece: Signal, against: Signal, low: float, high: float) -> tuple[float, float | None]:
    """Return the lag in s with the highest cross-correlation of levels, to the grid, and another as good, or None."""
    lags, products, _ = _rough_products(piece, against)
    possible = (lags >= low) & (lags <= high)
    if not possible.any():
        return (low + high) / 2, None
    lags, products = lags[possible], products[possible]
    best = int(np.argmax(products))
    peaks = np.flatnonzero((products[1:-1] > products[:-2]) & (products[1:-1] >= products[2:])) + 1
    rivals = peaks[(np.abs(lags[peaks] - lags[best]) > NEAR_S) & (products[peaks] > AMBIGUOUS * products[best])]
    return float(lags[best]), float(lags[rivals[0]]) if len(rivals) and products[best] > 0 else None


def _rough_products(piece: Signal, against: Signal) -> tuple[np.ndarray, np.ndarray, float]:
    """Return all lags (n,) in s, the products of the levels at each, (n,), and that of signals that are alike.

    Both signals have zero mean and are zero outside their span, so a small overlap cannot win.
    """
    levels = []
    for signal in (against, piece):
        grid = np.arange(signal.time_s[0], signal.time_s[-1] + ROUGH_S, ROUGH_S)
        levels.append(np.interp(grid, signal.time_s, signal.value))
    count = len(levels[0]) + len(levels[1]) - 1
    size = next_fast_len(count, real=True)
    first, second = levels[0] - levels[0].mean(), levels[1] - levels[1].mean()
    products = irfft(rfft(first, size) * rfft(second[::-1], size), size)[:count]
    lags = (np.arange(count) - (len(levels[1]) - 1)) * ROUGH_S + against.time_s[0] - piece.time_s[0]
    return lags, products, float(np.linalg.norm(first) * np.linalg.norm(second))


def _fine_lag(
    piece: Signal, against: Signal, centre: float, edge_s: float, beside: Signal | None
) -> tuple[float, float]:
    """Return the lag near `centre` with the highest correlation of edges, and that correlation."""
    lag = centre
    halves = [_half(level) for level in _overlap(piece, against, Clock(centre), beside)]
    for reach, step in ((NEAR_S, STEP_S), (2 * STEP_S, STEP_S / FINER)):
        lags = lag + np.arange(-round(reach / step), round(reach / step) + 1) * step
        scores = _edge_correlations(piece, against, lags, step, edge_s, beside, halves)
        best = int(np.clip(np.argmax(scores), 1, len(lags) - 2))
        lag = lags[best]
    below, top, above = scores[best - 1 : best + 2]
    bend = below - 2 * top + above
    if bend < 0:  # the peak of the parabola through the best three
        lag += step * float(np.clip((below - above) / (2 * bend), -1, 1))
    return float(lag), float(top)


def _edge_correlations(
    piece: Signal,
    against: Signal,
    lags: np.ndarray,
    step: float,
    edge_s: float,
    beside: Signal | None,
    halves: list[float],
) -> np.ndarray:
    """Return `_edge_correlation` for every offset of `lags` (n,), which rise by `step`, STEP_S or a whole part of it.

    The grid starts where the later of the two signals does, so that one is sampled at the same places for all lags, and
    the other at places that differ by steps: each is interpolated once. Interpolated for every lag, as is done with
    `beside`, the search takes 5 times as long.
    """
    if beside is not None:
        return np.array([_edge_correlation(piece, against, Clock(lag), edge_s, beside, halves) for lag in lags])
    gap, stride = round(edge_s / STEP_S), round(STEP_S / step)
    starts, stops = piece.time_s[0] + lags, np.minimum(piece.time_s[-1] + lags, against.time_s[-1])
    counts = np.ceil((stops - np.maximum(starts, against.time_s[0])) / STEP_S).astype(int)  # samples of the overlap
    scores = np.full(len(lags), -1.0)
    piece_later = starts >= against.time_s[0]
    for later in (True, False):
        rows = np.flatnonzero((piece_later == later) & (counts >= 10 * gap))
        if not len(rows):
            continue
        most = int(counts[rows].max())
        if later:
            fixed = _contacts(piece, piece.time_s[0], STEP_S, most, halves[0])
            moved = _contacts(against, starts[rows[0]], step, most * stride + len(rows), halves[1])
            places = rows - rows[0]
        else:
            fixed = _contacts(against, against.time_s[0], STEP_S, most, halves[1])
            moved = _contacts(piece, against.time_s[0] - lags[rows[-1]], step, most * stride + len(rows), halves[0])
            places = rows[-1] - rows
        fixed, moved = fixed[gap:] - fixed[:-gap], moved[gap * stride :] - moved[: -gap * stride]
        for count in np.unique(counts[rows]):
            for phase in range(stride):
                alike = np.flatnonzero((counts[rows] == count) & (places % stride == phase))
                if len(alike):
                    within = _sliding_correlations(fixed[: count - gap], moved[phase::stride], places[alike] // stride)
                    scores[rows[alike]] = within
    return scores


def _sliding_correlations(first: np.ndarray, longer: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Return Pearson's correlations of `first` (n,) with `longer` from each of `places` (m,) on, as `_correlation`."""
    n, low = len(first), places.min()
    longer, places = longer[low : places.max() + n], places - low
    first = first - first.mean()
    sums, squares = (np.concatenate([[0.0], np.cumsum(values)]) for values in (longer, longer**2))
    mean = (sums[places + n] - sums[places]) / n
    spread = squares[places + n] - squares[places] - n * mean**2
    spread[spread < 1e-12 * squares[-1]] = 0  # what rounding leaves of a signal that does not change
    size = np.sqrt((first @ first) * spread)
    products = np.correlate(longer, first)[places]
    return np.divide(products, size, out=np.zeros(len(places)), where=size > 0)


def _contacts(signal: Signal, first_s: float, step_s: float, count: int, half: float) -> np.ndarray:
    """Return the contact of a signal at `count` times, `step_s` apart from `first_s` on; half: see `_half`."""
    level = np.interp(first_s + step_s * np.arange(count), signal.time_s, signal.value)
    return level / (level + half)


def _edge_correlation(
    piece: Signal,
    against: Signal,
    clock: Clock,
    edge_s: float,
    beside: Signal | None,
    halves: list[float] | None = None,
) -> float:
    """Correlate the changes of contact over `edge_s` in the overlap; -1 where the overlap is too short.

    halves: the strengths of half contact of the two signals, if known already.
    """
    levels = _overlap(piece, against, clock, beside)
    steps = round(edge_s / STEP_S)
    if len(levels[0]) < 10 * steps:
        return -1.0
    edges = []
    for level, half in zip(levels, halves or [_half(level) for level in levels], strict=True):
        contact = level / (level + half)
        edges.append(contact[steps:] - contact[:-steps])
    return _correlation(*edges)


def _level_correlation(piece: Signal, against: Signal, clock: Clock, beside: Signal | None) -> float:
    """Correlate the levels in the overlap; -1 where the overlap is too short."""
    levels = _overlap(piece, against, clock, beside)
    return _correlation(*levels) if len(levels[0]) * STEP_S >= SHORTEST_S / 2 else -1.0


def _overlap(piece: Signal, against: Signal, clock: Clock, beside: Signal | None) -> list[np.ndarray]:
    """Return the levels of both signals, (n,) each, on a grid of STEP_S over the time that both cover."""
    time = clock(piece.time_s)
    grid = np.arange(max(time[0], against.time_s[0]), min(time[-1], against.time_s[-1]), STEP_S)
    level = np.interp(grid, time, piece.value)
    if beside is not None:
        level = level + np.interp(grid, beside.time_s, beside.value)
    return [level, np.interp(grid, against.time_s, against.value)]


def _half(level: np.ndarray) -> float:
    """Return the strength at which contact is half of full, for the strengths (n,) of a device."""
    return CONTACT * max(np.percentile(level, 99) if len(level) else 0.0, np.finfo(float).tiny)


def _correlation(first: np.ndarray, second: np.ndarray) -> float:
    """Return Pearson's correlation; 0 where one of the signals does not change."""
    first, second = first - first.mean(), second - second.mean()
    size = np.sqrt((first @ first) * (second @ second))
    return float(first @ second / size) if size > 0 else 0.0
