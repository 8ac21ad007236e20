"""Find lines whose times came in packets, and give them the times at which they were printed.

A serial adapter hands lines on in packets, every 1 to 16 ms. A computer that stamps them gives the lines of a packet
nearly equal times, and lines slower than packets come now one, now two packets apart. Single intervals then say little
of the rate, and a long one does not mean that lines are missing. `rate` has two signs of packets: intervals that are
hardly any beside the mean over many lines; or a usual interval that is not that mean, or long intervals that do not
raise it, where stretches of lines all take as long as each other. No log whose device prints the time has either, and
where lines are lost at random, stretches differ.
"""

from typing import NamedTuple

import numpy as np
from scipy.ndimage import minimum_filter1d, uniform_filter1d

from tactile.datasets.schemas import LONG

LEAST = 32  # intervals from which packets can be told
SPANS = 100_000  # that are looked at, about, of a long log
SPAN = 256  # lines that a mean interval is taken over, or a quarter of the log
TINY, SHARE = 0.1, 0.01  # of the mean interval; where so many are shorter, lines come in packets
OFF, LINES = 0.03, 8  # of the usual interval; lines in all: by more, the mean differs from it where lines come in steps
EVEN = 64  # lines of a stretch, or a quarter of the log
FROM_LONG = 0.25  # of the long intervals; where lines are lost, each raises the mean by a whole one
WINDOW = 16, 8  # lines, packets: in the longer of the two, one line comes without delay
LOST = 0.75, 0.5  # intervals, packets: lines that stay later by more than the longer of the two follow lost ones
PACKETS = 8  # in a log, and one in SPAN lines; fewer long intervals are jumps of a clock
LATE = 4  # packets, between two lines; after longer, lines are missing


class Rate(NamedTuple):
    """How lines follow each other, in the unit of their times."""

    interval: float  # between two lines; inf where there are no two
    packet: float  # time between two packets, about; 0 where times are of single lines


def rate(time: np.ndarray, segment: np.ndarray | None = None) -> Rate:
    """Return how lines at rising times (n,) follow each other: by the median, and where they come in packets by spans.

    segment: (n,), a new number after each reset of the clock; None where there is none.
    """
    interval = np.diff(time)
    if segment is not None:
        interval = interval[segment[1:] == segment[:-1]]
    if not len(interval):
        return Rate(np.inf, 0.0)
    median = float(np.median(interval))
    if len(interval) < LEAST:
        return Rate(median, 0.0)
    ends = np.concatenate([[0], np.cumsum(interval)])

    def spans(most: int) -> np.ndarray:
        lines, step = min(most, len(interval) // 4), max(1, len(interval) // SPANS)
        return (ends[lines::step] - ends[:-lines:step]) / lines

    long = spans(SPAN)
    usual = np.quantile(long, 0.5, method="lower")  # one of them
    long_ones = interval[interval > usual / 2]
    if len(long_ones) < max(PACKETS, len(interval) // SPAN):
        return Rate(median, 0.0)
    packet = float(np.quantile(long_ones, 0.25))
    mean = float(long[abs(long - usual) <= 2 * packet / min(SPAN, len(interval) // 4)].mean())  # without silences
    if np.mean(interval < TINY * mean) >= SHARE:
        return Rate(mean, packet)
    off, gaps = abs(mean / median - 1), np.mean(interval > LONG * median)
    if off > max(OFF, LINES / len(interval)) or gaps > max(SHARE, LINES / len(interval), off / FROM_LONG):
        lines = min(EVEN, len(interval) // 4)
        low, high = np.quantile(spans(EVEN), [0.05, 0.95])
        if (high - low) * lines <= (1 + lines / 48) * median:
            return Rate(mean, min(packet, float(np.ptp(np.quantile(interval, [0.02, 0.98])))))
    return Rate(median, 0.0)


def missing_before(rate: Rate, last: float, time: float) -> int:
    """Return how many lines are missing between one at `last` and the next at `time`, by their rate so far.

    An interval of k usual ones means k - 1 lost lines, rounded; in packets, none where one packet may have come late.
    """
    apart = time - last
    if rate.packet and apart <= LATE * max(rate.packet, rate.interval):
        return 0
    return max(0, round((apart - rate.packet) / rate.interval) - (not rate.packet))


def spread(time: np.ndarray, segment: np.ndarray, least: float) -> tuple[np.ndarray, Rate]:
    """Return the times (n,) at which lines that came in packets were printed, and their rate; other times unchanged.

    Delays in the adapter come and go, so a line was printed at the latest when, at the rate, it preceded any of the
    next ones that came early. Lines from which on all stay later follow lost ones. time, segment: (n,), rising within a
    segment; least: the shortest time between two lines.
    """
    found = rate(time, segment)
    if not found.packet:
        return time, found
    parts = np.split(time, np.flatnonzero(np.diff(segment)) + 1)
    printed = np.concatenate([_printed(part, found, least) for part in parts])
    return (np.rint(printed).astype(time.dtype) if time.dtype.kind in "iu" else printed), found


def _printed(time: np.ndarray, rate: Rate, least: float) -> np.ndarray:
    """Return `spread` of one segment."""
    at_rate = rate.interval * np.arange(len(time))
    delay = (time - time[0]) - at_rate
    window = int(max(WINDOW[0], np.ceil(WINDOW[1] * rate.packet / rate.interval)))
    ahead = _least_ahead(delay, window)
    behind = np.concatenate([delay[:1], np.minimum.accumulate(delay)[: window - 1], ahead])[: len(delay)]
    rise = ahead - behind
    most = np.full(len(time), max(LOST[0] * rate.interval, LOST[1] * rate.packet))
    most[-window:] += rate.packet  # the line without delay may have come no more
    lost = np.concatenate([[0], rise > most, [0]])
    edges = np.flatnonzero(np.diff(lost)).reshape(-1, 2)
    starts = [first + int(np.argmax(rise[first:stop] >= 0.9 * rise[first:stop].max())) for first, stop in edges]
    parts = []
    for part in np.split(delay, starts):
        early = _least_ahead(part, window)
        early[-window:] = part[-window:].min()
        parts.append(uniform_filter1d(early, window, mode="nearest"))
    printed = np.concatenate(parts) + at_rate - least * np.arange(len(time))
    return time[0] + np.maximum.accumulate(printed) + least * np.arange(len(time))


def _least_ahead(values: np.ndarray, window: int) -> np.ndarray:
    """Return the least of each value and the `window` - 1 after it, (n,)."""
    return minimum_filter1d(values, window, mode="nearest", origin=-(window // 2))
