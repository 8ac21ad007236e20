"""Find readings that are no measurement: frames of one number, frames printed again, and channels that stand still.

All functions take arrays without NaN in the order of time, and judge by the data alone: by what their noise and their
motion cannot do by chance. What chance can do is no finding: frames of few elements at coarse counts repeat, and a mat
without a touch may read zero everywhere.
"""

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from tactile.logs.parse import finest_step

FEW = 3  # frames; fewer are no finding
FAR = 2.0  # usual changes from one frame to the next; constant frames that are nearer to others may be measured
JUMP = 5.0  # usual changes; a constant frame between others is at least so far from them
QUARTER = 25  # percentile of the elements: of a mat that is touched in one place, most others read zero
MOST_LOST = 5  # frames on end that are taken for lost or printed again; longer rests and holds are measured
MOST_LONG = 0.2  # share of all frames, above which longer stretches of one constant are the sensor's rest
LEVELS = 20  # constants that are looked at
LEAST_SHARE = 0.01  # of the frames; recorded strands repeat 0.2 % of theirs by chance
LARGE_STEPS = 3  # levels; a change by so many is motion
LARGEST = 90  # percentile of the changes, from which on they are large
OFTEN = 0.9  # share of the large changes that equal frames follow, where each frame is printed several times
MOST_TIMES = 20
LEAST_STEPS = 4  # levels in all elements together, the least usual change at which chance can be told
BEYOND = 5.0  # times as often as frames that change by little; a recorded Velostat taxel has up to 2.4
LONGER = 5.0  # times the longest stretch without a change elsewhere; by chance alone twice is rare
LEAST_STRETCH = 50  # frames
BLOCK, QUIET = 20, 10  # changes; percentile of blocks
FLICKERS = 0.3  # share of changes in a quiet block; by chance 50 frames are alike in 1 of 10 ** 8 then
OFF_REST = 0.1  # of a channel's span, beyond which it does not rest
TOUCHED = 3  # times
SEVERAL = 1.9  # prints of a frame on average, from which on each is said to be printed several times
LISTED = 6  # names in a sentence
COMMON = 0.25  # share of the other channels that stand at a value in some frames: sensors rest, or are clipped, there


class Constant(NamedTuple):
    """Frames whose elements all have one value."""

    rows: np.ndarray  # (m,) numbers of the frames
    value: float  # of most of them
    share: float  # of all frames
    at_least: bool  # the sensor also rests at this value, where lost frames cannot be told


class Repeated(NamedTuple):
    """Frames that are the ones before, printed again."""

    rows: np.ndarray  # (m,) numbers of the frames
    share: float  # of all frames
    times: float  # how often a frame is printed, on average
    regular: bool  # each frame is printed so often


class Stuck(NamedTuple):
    """A channel that stands still."""

    channel: int
    first: int  # row of the first of equal readings
    stop: int  # row after the last
    value: float
    lasts_s: float
    elsewhere_s: float  # the longest time without a change in the rest of the recording


class Found(NamedTuple):
    """All that is no measurement in a recording."""

    constant: Constant | None
    repeated: Repeated | None
    stuck: list[Stuck]


def found(t_s: np.ndarray, x: np.ndarray) -> Found:
    """Return what is no measurement in readings x (n, channels) at times t_s (n,); of the frames of one number once."""
    constant = constant_frames(x)
    rows = np.arange(len(x))
    if constant is not None:
        rows = np.delete(rows, constant.rows)
        t_s, x = t_s[rows], x[rows]
    repeated, stuck = repeated_frames(x), stuck_channels(t_s, x)
    if repeated is not None:
        repeated = repeated._replace(rows=rows[repeated.rows])
    stuck = [one._replace(first=int(rows[one.first]), stop=int(rows[one.stop - 1]) + 1) for one in stuck]
    return Found(constant, repeated, stuck)


class Recording(NamedTuple):
    """What was found in one recording, and what says where."""

    found: Found
    line: np.ndarray  # (n,) number of each row's line
    rate_hz: float


def said(recordings: Mapping[str, Recording], names: Sequence[str]) -> list[str]:
    """Return a sentence for each kind of finding in recordings, by their names; names: of the channels."""
    sentences = []
    for kind, say in enumerate((_said_constant, _said_repeated, _said_stuck)):
        if chosen := {name: each for name, each in recordings.items() if each.found[kind]}:
            sentences.append(say(chosen, names))
    return sentences


def _where(recordings: Mapping[str, Recording], row: int) -> str:
    """Return the place of a row of the first recording, and how many more recordings have such."""
    name, first = next(iter(recordings.items()))
    more = len(recordings) - 1
    others = f", and {more} more recording{'s' * (more > 1)}" if more else ""
    return f"{name} from line {first.line[row]} on{others}"


def _said_constant(recordings: Mapping[str, Recording], names: Sequence[str]) -> str:
    each = [found for one in recordings.values() if (found := one.found.constant)]
    count, of = sum(len(one.rows) for one in each), sum(len(one.line) for one in recordings.values())
    value = Counter(one.value for one in each).most_common(1)[0][0]
    least = "at least " if any(one.at_least for one in each) else ""
    where = _where(recordings, each[0].rows[0])
    return (
        f"{least}{100 * count / of:.2g} % of the frames ({count}) read {value:g} in all {len(names)} elements, far "
        f"from the frames beside them ({where}): no measurement, but such as programs write for lost frames; remove "
        "these lines, or have nothing printed in their place"
    )


def _said_repeated(recordings: Mapping[str, Recording], names: Sequence[str]) -> str:
    found, rate_hz = next((each.found.repeated, each.rate_hz) for each in recordings.values() if each.found.repeated)
    where = _where(recordings, found.rows[0])
    if found.regular or found.times > SEVERAL:
        times = f"{found.times:.0f}" if found.regular else f"about {found.times:.2g}"
        what = f"each frame is printed {times} times"
        new_hz = rate_hz / found.times
    else:
        what = f"{100 * found.share:.2g} % of the frames are the one before, printed again while the readings move"
        new_hz = rate_hz * (1 - found.share)
    return (
        f"{what} ({where}): {new_hz:.3g} frames a second are measured, not {rate_hz:.3g}; print a frame once, when it "
        "is new"
    )


def _said_stuck(recordings: Mapping[str, Recording], names: Sequence[str]) -> str:
    first = next(iter(recordings.values()))
    stuck = first.found.stuck
    one = max(stuck, key=lambda each: each.lasts_s)
    which = names[one.channel]
    if len(stuck) == len(names) > 1:
        which = f"all {len(names)} elements stand still: {which}"
    elif len(stuck) > 1:
        others = [names[each.channel] for each in stuck if each is not one]
        which = (
            f"{', '.join(others[:LISTED])}{' and more' * (len(others) > LISTED)} stand still, and so does {which}: it"
        )
    return (
        f"{which} reads {one.value:g} for {one.lasts_s:.3g} s without a change ({_where(recordings, one.first)}), but "
        f"elsewhere for {one.elsewhere_s:.2g} s at most: it is stuck; check its wiring, and record this part again"
    )


def constant_frames(x: np.ndarray) -> Constant | None:
    """Return frames of one number, such as the zeros that stand for lost frames, of readings x (n, channels).

    Constant frames count where nearly all elements are far from them in nearly all other frames, and where they stand
    between frames that are alike and far from them. Zeros of a mat at rest are neither, as most of its elements are
    zero during a touch, too; nor are two elements that happen to be equal. None for one channel, of which every frame
    is constant.
    """
    n, channels = x.shape
    constant = (x == x[:, :1]).all(axis=1)
    if channels < 2 or constant.sum() < FEW or n - constant.sum() < 2 * FEW:
        return None
    others = np.flatnonzero(~constant)
    change, step = np.abs(np.diff(x[others], axis=0)), min(map(finest_step, x.T))
    usual, largest = (max(np.median(size), step / 2) for size in (change.mean(axis=1), change.max(axis=1)))
    edges = np.flatnonzero(np.diff(np.concatenate([[0], constant.astype(np.int8), [0]]))).reshape(-1, 2)
    lasts = np.zeros(n, int)  # constant frames on end
    lasts[constant] = np.repeat(edges[:, 1] - edges[:, 0], edges[:, 1] - edges[:, 0])
    levels, count = np.unique(x[constant, 0], return_counts=True)
    rows, at_least = [], False
    for level in levels[np.argsort(-count, kind="stable")][:LEVELS]:
        here = np.flatnonzero(constant & (x[:, 0] == level))
        short = here[lasts[here] <= MOST_LOST]
        away = np.abs(x[others] - level)
        if np.percentile(np.percentile(away, QUARTER, axis=1, method="lower"), 1) > FAR * usual:
            rows.append(here if len(here) - len(short) < MOST_LONG * n else short)
        elif level < x.max():
            rows.append(short[_between(x, short, others, away.max(axis=1), JUMP * largest)])
            at_least |= len(rows[-1]) > 0
    if (total := sum(map(len, rows))) < FEW:
        return None
    most = max(rows, key=len)
    return Constant(np.sort(np.concatenate(rows)), float(x[most[0], 0]), total / n, at_least)


def _between(x: np.ndarray, rows: np.ndarray, others: np.ndarray, away: np.ndarray, least: float) -> np.ndarray:
    """Tell which constant frames stand between two frames and two frames that are alike and far from them, (rows,).

    rows: of the frames of one constant; others: rows of the frames that are not constant; away: (others,) their largest
    distance from it; least: the distance that is far.
    """
    if len(others) < 4:
        return np.zeros(len(rows), bool)
    after = np.searchsorted(others, rows)
    at = np.clip(after, 2, len(others) - 2)
    beside = at[:, None] + np.arange(-2, 2)  # two before, two after
    apart, distance = np.ptp(x[others[beside]], axis=1).max(axis=1), away[beside].min(axis=1)
    return (after == at) & (distance > least) & (apart < distance / 2)


def repeated_frames(x: np.ndarray) -> Repeated | None:
    """Return frames that are printed again beyond chance, of readings x (n, channels).

    Each frame is printed several times where equal frames follow nearly all large changes, about as many each time.
    Else equal frames count that stand within motion, where they are far more than frames that changed by little: noise
    that makes equal frames makes about as many of those. None where changes are so small that chance cannot be told.
    """
    n = len(x)
    if n < LEAST_STRETCH:
        return None
    size, largest = np.zeros(n - 1, int), np.zeros(n - 1, int)
    for column in x.T:  # in levels that occur: a resistance that is made of counts has no even steps
        change = np.abs(np.diff(np.unique(column, return_inverse=True)[1]))
        size, largest = size + change, np.maximum(largest, change)
    new = np.flatnonzero(size)  # change k leads to frame k + 1
    if len(new) < 2 * FEW:
        return None
    equal, follow = 1 + np.flatnonzero(size == 0), np.diff(new) - 1  # equal frames after each change but the last
    again = follow[largest[new[:-1]] >= max(LARGE_STEPS, np.percentile(largest[new], LARGEST))]
    if len(again) >= 2 * FEW and np.mean(again > 0) > OFTEN:
        times = 1 + float(np.median(again))
        beside = np.abs((again + 1) - times * np.maximum(1, np.rint((again + 1) / times)))  # two alike print twice that
        if times <= MOST_TIMES and np.mean(beside <= max(1, times / 4)) > OFTEN:
            regular = bool(np.mean(beside == 0) > OFTEN)
            return Repeated(equal, len(equal) / n, times if regular else 1 + float(again.mean()), regular)
    usual = np.median(size[new])
    active = size >= usual / 2
    inside = np.flatnonzero((follow > 0) & (follow <= MOST_LOST) & active[new[:-1]] & active[new[1:]])
    within = int(follow[inside].sum())
    little = (size[1:-1] > 0) & (size[1:-1] <= max(1, usual / 8)) & active[:-2] & active[2:]
    if usual < LEAST_STEPS or within < max(FEW, LEAST_SHARE * n) or within <= BEYOND * little.sum():
        return None
    rows = np.concatenate([np.arange(new[k] + 2, new[k + 1] + 1) for k in inside])
    return Repeated(rows, within / n, n / (n - within), False)


def stuck_channels(t_s: np.ndarray, x: np.ndarray) -> list[Stuck]:
    """Return the channels that stand still for a long stretch, though they changed in the rest of the recording.

    t_s: (n,) times in s; x: (n, channels) readings. A channel that flickers with its noise even at rest is stuck where
    it does not for five times as long as ever else. One without such noise is stuck only where it stands beyond its
    rest while others are touched: stuck at its rest, it cannot be told from one that nobody touches. A channel that
    never changes is none of these. All may be stuck at once, where a program repeats its last frame.
    """
    n, channels = x.shape
    stuck: list[Stuck] = []
    if n < 2 * LEAST_STRETCH:
        return stuck
    step_s, changed = float(np.median(np.diff(t_s))), np.diff(x, axis=0) != 0
    for channel in range(channels):
        edges = np.concatenate([[0], 1 + np.flatnonzero(changed[:, channel]), [n]])
        runs, values = np.diff(edges), x[edges[:-1], channel]
        if runs.max() < LEAST_STRETCH or len(runs) < 2 * FEW:
            continue
        rest = np.median(np.repeat(values, np.minimum(runs, LEAST_STRETCH)))
        off = np.abs(values - rest) > OFF_REST * np.ptp(values)
        for chosen in (np.flatnonzero(np.full(len(runs), True)), np.flatnonzero(off)):
            if len(chosen) < 2 * FEW:
                continue
            longest = chosen[runs[chosen].argmax()]
            first, stop, elsewhere = edges[longest], edges[longest + 1], runs[chosen[chosen != longest]].max()
            if runs[longest] < max(LEAST_STRETCH, LONGER * elsewhere):
                continue
            if _flickers(np.delete(changed[:, channel], slice(first, stop - 1))):
                is_stuck = not _is_limit(x, channel, values[longest])
            else:
                is_stuck = off[longest] and _touched(x, channel, first, stop)
            if is_stuck:
                lasts_s, elsewhere_s = runs[longest] * step_s, elsewhere * step_s
                stuck.append(Stuck(channel, int(first), int(stop), float(values[longest]), lasts_s, elsewhere_s))
                break
    return stuck


def _flickers(changed: np.ndarray) -> bool:
    """Tell whether a channel changes with its noise even at rest; changed: (n,) from one reading to the next."""
    if len(changed) < LEAST_STRETCH:
        return False
    shares = [block.mean() for block in np.array_split(changed, len(changed) // BLOCK)]
    return bool(np.percentile(shares, QUIET) >= FLICKERS)


def _is_limit(x: np.ndarray, channel: int, value: float) -> bool:
    """Tell whether a value is a channel's lowest or highest, and that of many others: zero without a touch, say."""
    if x.shape[1] == 1 or x[:, channel].min() < value < x[:, channel].max():
        return False
    return np.mean((np.delete(x, channel, axis=1) == value).mean(axis=0) > LEAST_SHARE) > COMMON


def _touched(x: np.ndarray, channel: int, first: int, stop: int) -> bool:
    """Tell whether others are touched several times in rows first to stop, and the channel itself before or after."""
    elsewhere = np.delete(x, slice(first, stop), axis=0)
    rest, span = np.median(elsewhere, axis=0), np.ptp(x, axis=0)
    off = np.abs(x - rest) > OFF_REST * np.where(span > 0, span, np.inf)
    others = np.delete(off[first:stop], channel, axis=1).any(axis=1)
    comes, came = (np.count_nonzero(one[1:] & ~one[:-1]) for one in (others, off[:, channel]))
    return bool(min(comes, came) >= TOUCHED)
