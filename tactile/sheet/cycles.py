"""Find the loading cycles of a sensor, and take from each what every element read: the one form that the sheet sees.

The stimulus is what a log of its own says: the force on a load cell, the depth of an arm. A cycle goes from a rest, or
from the lowest point between two presses, to more than 80 % of the full scale and back: the traverse by which sensors
are calibrated (ISA-S37.1, IEC 61298-2). Weaker presses are no calibration cycles. The full scale is what the strongest
presses reach.
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

REST, FULL = 0.2, 0.8  # of the strongest presses: below the first no press, and above the second a full one
STRONGEST = 95  # percentile of the peaks of presses
BRIEFEST_S = 0.05
LEVELS = np.arange(1, 10) / 10  # of a cycle's own stimulus, at which the two ways are compared
FEWEST_ON_THE_WAY = 5  # readings between 10 and 90 % of the stimulus, or a way is not resolved
QUIET = 0.01  # of a full press: so far the stimulus may be above its lowest at rest
WINDOW_S = 0.3  # over which a rest, or the end of a hold, is read
SETTLED = 0.05  # of the time of loading: so much later the stimulus no longer rises
SETTLED_S = (0.1, 0.3, 1.0)  # at least; longer for a sensor that responds slowly
START = 0.05  # of a change: there it starts
UNLIKELY = 4.0  # standard deviations of noise
HELD = 0.03  # of the stimulus: by less it changes during a hold
CREEP_S = (1.0, 10.0)
NEAR_S = 0.05  # around a time: readings that are averaged
MOVED_MM = 1.0  # a place that moves by more during a press is none
MIDDLE = 0.25  # of the pitch: so near the middle of an element it is pressed, in x and y
FEWEST_IN_A_LOG = 10
ROUNDING = 1e-6  # of the range of a reading
MOST = 3000  # presses of a sensor that are looked at, a second or three; of more, every so many
LOST = 3.0  # intervals; a cycle with a longer silence is left out


class Log(NamedTuple):
    """One uninterrupted recording."""

    name: str
    group: str  # recordings of one group repeat each other
    time_s: np.ndarray  # (n,)
    reading: np.ndarray  # (n, elements)
    stimulus: np.ndarray  # (n,) of the sensor's unit of stimulus; empty where no log says it
    place: np.ndarray  # (n, 2) mm; NaN where unknown


class Sensor(NamedTuple):
    """What a sheet is of."""

    name: str
    unit: str  # of a reading
    stimulus: str  # unit of the stimulus, "" where no log says how hard the sensor was pressed
    logs: list[Log]
    one_clock: bool = False  # readings and stimulus are stamped by one clock, not aligned by the presses themselves
    shape: tuple[int, int] | None = None  # rows and columns of an array whose pressed element is known
    pitch_mm: float = np.nan
    note: str = ""

    @property
    def elements(self) -> int:
        """Return the number of elements."""
        return self.logs[0].reading.shape[1]


class Press(NamedTuple):
    """Samples of one press: the first above the threshold, the first after it, and where it is reached and left."""

    first: int
    stop: int
    reached: int
    left: int


class Course(NamedTuple):
    """One press with what is before and after it; numbers of samples count from the first of these."""

    time_s: np.ndarray  # (n,)
    stimulus: np.ndarray  # (n,) above that at rest
    reading: np.ndarray  # (n, E) above rest
    onset: int  # the last sample at rest
    reached: int  # the first and the last of the hold
    left: int
    end: int  # the first at rest again


class Cycles(NamedTuple):
    """All cycles of a sensor, P of them; E elements; an element that a cycle does not load has NaN."""

    log: np.ndarray  # (P,) number of the log
    group: np.ndarray  # (P,) number of the log's group
    time_s: np.ndarray  # (P,) where the rest ends
    end_s: np.ndarray  # (P,) where the next one begins
    place: np.ndarray  # (P, 2) mm
    rest: np.ndarray  # (P, E) reading, of all elements
    quiet: np.ndarray  # (P, 2, E) of all elements, at rest: sum of squares of second differences, and their number
    busy: np.ndarray  # (P, 2, E) the same of loaded elements during the hold
    stimulus: np.ndarray  # (P,) held, above that at rest
    response: np.ndarray  # (P, E) reading at the end of the hold, above rest
    loaded: np.ndarray  # (P, E) reading at the end of loading, above rest
    up: np.ndarray  # (P, LEVELS, E) reading above rest on the way up, NaN where the way is not resolved
    down: np.ndarray  # (P, LEVELS, E) the same on the way down
    settled: np.ndarray  # (P, SETTLED_S, E) reading above rest once the stimulus has settled
    creep: np.ndarray  # (P, SETTLED_S, CREEP_S, E) its change after that
    neighbours: np.ndarray  # (P, E) mean size of the response of the next elements
    late_s: np.ndarray  # (P, E) from the start of the stimulus to that of the reading
    stimulus_rise_s: np.ndarray  # (P,) 10 to 90 %
    rise_s: np.ndarray  # (P, E) the same of the reading
    stimulus_fall_s: np.ndarray  # (P,) 90 to 10 %
    fall_s: np.ndarray  # (P, E) infinite where the reading does not come back before the next press
    at_limit: np.ndarray  # (P, 2, E) share of the hold in which it reads the lowest, and the highest, that it ever does
    interval_s: float  # of the logs


def presses(time_s: np.ndarray, stimulus: np.ndarray, threshold: float, briefest_s: float) -> list[Press]:
    """Return the stretches in which a stimulus (n,) is above a threshold for `briefest_s` or more."""
    if len(time_s) < 2:
        return []
    step = np.median(np.diff(time_s))
    above = np.concatenate([[False], stimulus > threshold, [False]])
    edges = np.flatnonzero(np.diff(above.astype(int))).reshape(-1, 2)
    result = []
    for first, stop in edges[(edges[:, 1] - edges[:, 0]) * step >= briefest_s]:
        full = first + np.flatnonzero(stimulus[first:stop] >= 0.9 * np.percentile(stimulus[first:stop], 90))
        result.append(Press(int(first), int(stop), int(full[0]), int(full[-1])))
    return result


def second_difference_squares(values: np.ndarray) -> np.ndarray:
    """Return the squares of second differences of values (n, ...), (n - 2, ...): six times the variance of white noise.

    A drift that is linear over three values leaves them alone.
    """
    return np.square(values[2:] - 2 * values[1:-1] + values[:-2])


def full_scale(sensor: Sensor) -> float:
    """Return what the strongest presses reach, in units of the stimulus; NaN without presses."""
    peaks = []
    for log in sensor.logs:
        if len(log.stimulus) >= FEWEST_IN_A_LOG and (highest := np.nanmax(log.stimulus)) > 0:
            found = presses(log.time_s, log.stimulus, REST * highest, BRIEFEST_S)
            peaks += [np.median(log.stimulus[press.reached : press.left + 1]) for press in found]
    return float(np.percentile(peaks, STRONGEST)) if peaks else np.nan


def cycles(sensor: Sensor) -> Cycles:
    """Return the full cycles of all logs; one that a silence interrupts, or during which the place moves, is none."""
    top, rows, groups = full_scale(sensor), [], sorted({log.group for log in sensor.logs})
    limits = extremes(sensor)
    for number, log in enumerate(sensor.logs):
        if np.isfinite(top) and len(log.stimulus):
            rows += [(number, groups.index(log.group), *row) for row in of_log(log, sensor, top, limits)]
    intervals = np.concatenate([np.diff(log.time_s) for log in sensor.logs])
    columns = [np.array(column) for column in zip(*rows, strict=True)] if rows else empty(sensor.elements)
    return Cycles(*columns, float(np.median(intervals)) if len(intervals) else np.nan)


def extremes(sensor: Sensor) -> np.ndarray:
    """Return the lowest and the highest reading of each element in all logs, (2, E); NaN without one."""
    parts = [log.reading for log in sensor.logs if len(log.reading)]
    ends = [(part.min(axis=0), part.max(axis=0)) for part in parts] or [np.full((2, sensor.elements), np.nan)]
    low, high = zip(*ends, strict=True)
    return np.array([np.min(low, axis=0), np.max(high, axis=0)])


def empty(elements: int) -> list[np.ndarray]:
    """Return the columns of no cycle."""
    by_element, ways, settled = (elements,), (len(LEVELS), elements), (len(SETTLED_S), elements)
    shapes = dict.fromkeys(("time_s", "end_s", "stimulus", "stimulus_rise_s", "stimulus_fall_s"), ())
    shapes |= {"place": (2,), "quiet": (2, elements), "busy": (2, elements), "up": ways, "down": ways}
    shapes["at_limit"] = (2, elements)
    shapes |= {"settled": settled, "creep": (len(SETTLED_S), len(CREEP_S), elements)}
    numbers = [np.empty(0, dtype=int)] * 2
    return numbers + [np.empty((0, *shapes.get(name, by_element))) for name in Cycles._fields[2:-1]]


def of_log(log: Log, sensor: Sensor, top: float, limits: np.ndarray) -> Iterator[tuple]:
    """Yield the values of every cycle of one log, in the order of Cycles, from `time_s` on.

    top: the full scale; limits: the `extremes` of the sensor.
    """
    time, stimulus, n = log.time_s, log.stimulus, len(log.time_s)
    if n < FEWEST_IN_A_LOG:
        return
    found = [press for press in presses(time, stimulus, REST * top, BRIEFEST_S) if press.first and press.stop < n]
    silence = np.concatenate([[0], np.cumsum(np.diff(time) > LOST * np.median(np.diff(time)))])
    quiet = max(QUIET * top, UNLIKELY * float(white_noise(stimulus)))
    noise = white_noise(log.reading)
    starts, ends = [0, *(press.stop for press in found)], [*(press.first for press in found[1:]), n]
    full = [
        each
        for each in zip(found, starts, ends, strict=False)
        if stimulus[each[0].reached : each[0].left + 1].max() >= FULL * top
    ]
    for press, before, after in full[:: -(-len(full) * len(sensor.logs) // MOST) or 1]:
        low = at_rest(stimulus, before, press.first, quiet)
        back = at_rest(stimulus, press.stop, after, quiet)
        if not len(low) or not len(back):
            continue
        resting = low[time[low] >= time[low[-1]] - WINDOW_S]
        place = log.place[press.reached : press.left + 1]
        moves = np.ptp(place, axis=0) > MOVED_MM  # False for NaN
        loaded = loaded_by(place.mean(axis=0), sensor)
        if len(resting) < 2 or silence[low[-1]] != silence[back[0]] or moves.any() or not loaded.any():
            continue
        rest = log.reading[resting].mean(axis=0)
        press = held_part(stimulus, press)
        course = Course(
            time[before:after],
            stimulus[before:after] - stimulus[resting].mean(),
            log.reading[before:after] - rest,
            *(int(edge) - before for edge in (low[-1], press.reached, press.left, back[0])),
        )
        still, held = middle(low), middle(np.arange(press.reached, press.left + 1))
        yield (
            course.time_s[course.onset],
            course.time_s[course.end],
            place.mean(axis=0),
            rest,
            quiet_squares(log.reading[still], still),
            quiet_squares(np.where(loaded, log.reading[held], np.nan), held),
            *of_course(course, loaded, noise, sensor),
            np.where(loaded, at_limits(log.reading[press.reached : press.left + 1], limits), np.nan),
        )


def at_limits(reading: np.ndarray, limits: np.ndarray) -> np.ndarray:
    """Return the shares (2, E) of readings (n, E) that are one and the other of `limits` (2, E), but for rounding."""
    return (np.abs(reading[:, None] - limits) <= ROUNDING * (limits[1] - limits[0])).mean(axis=0)


def white_noise(values: np.ndarray) -> np.ndarray:
    """Return the standard deviation of the white noise of values (n, ...), (...); presses are rare and count little.

    The median of a chi-square of one degree of freedom is 0.455.
    """
    return np.sqrt(np.median(second_difference_squares(values), axis=0) / 0.455 / 6)


def middle(rows: np.ndarray) -> np.ndarray:
    """Return the middle half of samples (n,), where neither a press nor a rest begins or ends."""
    return rows[len(rows) // 4 : -(len(rows) // 4) or None]


def at_rest(stimulus: np.ndarray, first: int, stop: int, quiet: float) -> np.ndarray:
    """Return the samples within [first, stop) whose stimulus is above the lowest of them by no more than `quiet`."""
    part = stimulus[first:stop]
    return first + np.flatnonzero(part <= part.min(initial=np.inf) + quiet)


def held_part(stimulus: np.ndarray, press: Press) -> Press:
    """Return a press whose hold begins and ends where the stimulus is within HELD of its median in the hold."""
    level = (1 - HELD) * np.median(stimulus[press.reached : press.left + 1])
    held = press.reached + np.flatnonzero(stimulus[press.reached : press.left + 1] >= level)
    return press._replace(reached=int(held[0]), left=int(held[-1]))


def loaded_by(place: np.ndarray, sensor: Sensor) -> np.ndarray:
    """Return which elements a press in the place (2,) mm loads, (E,) bool: of an array, the one under the tip."""
    if sensor.shape is None:
        return np.ones(sensor.elements, dtype=bool)
    loaded = np.zeros(sensor.shape, dtype=bool)
    column, row = place / sensor.pitch_mm - 0.5  # of the element's middle
    near = np.rint([row, column])
    if (np.abs(near - [row, column]) <= MIDDLE).all() and (near >= 0).all() and (near < sensor.shape).all():
        loaded[tuple(near.astype(int))] = True
    return loaded.ravel()


def of_course(course: Course, loaded: np.ndarray, noise: np.ndarray, sensor: Sensor) -> tuple:
    """Return the values of one cycle from `stimulus` on; loaded: (E,) bool; noise: (E,) of a reading."""
    time, stimulus, onset, left = course.time_s, course.stimulus, course.onset, course.left
    hold = slice(np.searchsorted(time, max(time[left] - WINDOW_S, time[course.reached])), left + 1)
    held, size = stimulus[hold].mean(), course.reading[hold].mean(axis=0)
    reading, response = np.where(loaded, course.reading, np.nan), np.where(loaded, size, np.nan)
    loading, unloading = slice(onset, course.reached + 1), slice(left, course.end + 1)
    settled, creep = crept(course, reading, held)
    # What is told by the time at which a share of the response is passed: not where noise passes it.
    clear = np.where(UNLIKELY * noise < START * np.abs(response), response, np.nan)
    clearer = np.where(UNLIKELY * noise < 0.1 * np.abs(response), response, np.nan)
    early = slice(max(onset - 1, 0), course.end)
    rising, falling = slice(onset, left + 1), slice(left, len(time))
    start_s, late_s = (
        crossing(time[early], share[early], START, rising=True)
        for share in (stimulus[:, None] / held, shares(reading, clear))
    )
    changes = [
        (span_s(time[part], stimulus[part, None] / held, up)[0], span_s(time[part], shares(reading[part], clearer), up))
        for part, up in ((rising, True), (falling, False))
    ]
    return (
        held,
        response,
        reading[course.reached] * held / stimulus[course.reached],
        on_the_way(stimulus[loading], reading[loading], held),
        on_the_way(stimulus[unloading][::-1], reading[unloading][::-1], held),
        settled,
        creep,
        of_neighbours(np.abs(size), loaded, sensor.shape),
        late_s - start_s,
        *(value for change in changes for value in change),
    )


def crept(course: Course, reading: np.ndarray, held: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the reading once the stimulus has settled (SETTLED_S, E), and later changes (SETTLED_S, CREEP_S, E)."""
    time, elements = course.time_s, reading.shape[1]
    settled, creep = (
        np.full((len(SETTLED_S), elements), np.nan),
        np.full((len(SETTLED_S), len(CREEP_S), elements), np.nan),
    )
    for k, wait_s in enumerate(SETTLED_S):
        start_s = time[course.reached] + max(SETTLED * (time[course.reached] - time[course.onset]), wait_s)
        for j, later_s in enumerate(CREEP_S):
            first, stop = np.searchsorted(time, [start_s, start_s + later_s + NEAR_S])
            if stop <= course.left and np.ptp(course.stimulus[first:stop]) < HELD * held:
                settled[k] = around(time, reading, start_s)
                creep[k, j] = around(time, reading, start_s + later_s) - settled[k]
    return settled, creep


def on_the_way(stimulus: np.ndarray, reading: np.ndarray, held: float) -> np.ndarray:
    """Return the reading (LEVELS, E) where a stimulus (n,) first comes to LEVELS of `held`; NaN if not resolved."""
    missing = np.full((len(LEVELS), reading.shape[1]), np.nan)
    if ((stimulus > 0.1 * held) & (stimulus < 0.9 * held)).sum() < FEWEST_ON_THE_WAY:
        return missing
    for k, level in enumerate(LEVELS * held):
        beyond = np.flatnonzero(stimulus >= level)
        if len(beyond) and beyond[0]:
            i = beyond[0]
            part = (level - stimulus[i - 1]) / (stimulus[i] - stimulus[i - 1])
            missing[k] = reading[i - 1] + part * (reading[i] - reading[i - 1])
    return missing


def around(time_s: np.ndarray, reading: np.ndarray, at_s: float) -> np.ndarray:
    """Return the reading (E,) at a time: the mean of those within NEAR_S, or interpolated between neighbours."""
    first, stop = np.searchsorted(time_s, [at_s - NEAR_S, at_s + NEAR_S])
    if stop - first > 1:
        return reading[first:stop].mean(axis=0)
    i = int(np.clip(np.searchsorted(time_s, at_s), 1, len(time_s) - 1))
    part = (at_s - time_s[i - 1]) / (time_s[i] - time_s[i - 1])
    return reading[i - 1] + part * (reading[i] - reading[i - 1])


def quiet_squares(reading: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """Return the sum of squares of second differences of readings (n, E), and their number: (2, E); NaN for none.

    rows: (n,) numbers of the samples; those that do not follow each other are left out.
    """
    together = rows[2:] - rows[:-2] == 2
    if not together.any():
        return np.full((2, reading.shape[1]), np.nan)
    squares = second_difference_squares(reading)[together].sum(axis=0)
    return np.array([squares, np.where(np.isfinite(squares), together.sum(), np.nan)])


def of_neighbours(size: np.ndarray, loaded: np.ndarray, shape: tuple[int, int] | None) -> np.ndarray:
    """Return the mean size of the response of the elements beside the pressed one, in its place (E,); NaN elsewhere."""
    result = np.full(len(loaded), np.nan)
    if shape is not None:
        row, col = np.divmod(int(np.flatnonzero(loaded)[0]), shape[1])
        beside = [(row + 1, col), (row - 1, col), (row, col + 1), (row, col - 1)]
        sizes = [size[r * shape[1] + c] for r, c in beside if 0 <= r < shape[0] and 0 <= c < shape[1]]
        if sizes:
            result[loaded] = np.mean(sizes)
    return result


def shares(reading: np.ndarray, full: np.ndarray) -> np.ndarray:
    """Return readings (n, E) over `full` (E,); NaN where that is NaN or 0."""
    return np.divide(reading, full, out=np.full(reading.shape, np.nan), where=np.isfinite(full) & (full != 0))


def span_s(time_s: np.ndarray, share: np.ndarray, rising: bool) -> np.ndarray:
    """Return the time between 10 and 90 % of shares (n, E), (E,) in s, infinite where they do not fall back to 10 %."""
    low, high = (crossing(time_s, share, level, rising) for level in (0.1, 0.9))
    if rising:
        return high - low
    return np.where(np.isnan(low) & np.isfinite(share[0]), np.inf, low) - high


def crossing(time_s: np.ndarray, share: np.ndarray, level: float, rising: bool) -> np.ndarray:
    """Return when shares (n, E) first come to a level, (E,) in s, interpolated; NaN where they never do."""
    beyond = share >= level if rising else share <= level
    i = beyond.argmax(axis=0)
    place = np.arange(share.shape[1])
    before = np.maximum(i - 1, 0)
    change = share[i, place] - share[before, place]
    part = np.divide(level - share[before, place], change, out=np.ones(len(i)), where=change != 0)
    at = time_s[before] + part * (time_s[i] - time_s[before])
    return np.where(beyond.any(axis=0), np.where(i > 0, at, time_s[0]), np.nan)
