"""The lines of a data sheet: each a function of a sensor and its loading cycles, which says how it is defined.

Terms are those of ISA-S37.1 (Electrical Transducer Nomenclature and Terminology, 1975; now ANSI/ISA-37.1) and of
IEC 61298-2 (Process measurement and control devices, tests under reference conditions). Both ask for calibration cycles
at rest in every point; logs of a sensor that is pressed hold faster ones. So what a sensor does with time is in all
numbers that compare two ways: creep during a hold is part of the hysteresis, for one.

Every number is that of an element, in the direction in which it answers; the sheet has the median over elements, with
the smallest and the largest, and an interval of the median over presses (tactile/sheet/estimates.py).
"""

from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np

from tactile.sheet.cycles import (
    CREEP_S,
    FEWEST_ON_THE_WAY,
    FULL,
    LEVELS,
    SETTLED_S,
    START,
    UNLIKELY,
    Cycles,
    Sensor,
    cycles,
    extremes,
    full_scale,
)
from tactile.sheet.cycles import second_difference_squares as squares
from tactile.sheet.estimates import FEWEST, Estimate, cannot_tell, in_blocks, ratio_of_sums

PERCENT = 100.0
ALIKE = 0.05  # of the stimulus; presses that differ by less, in one place, are equal
PLACE_MM = 1.0  # the same of places
LASTS_S = 300.0  # a recording that a drift per hour is told from
DRIFT_PRESSES = 10
BLOCKS = 20  # of presses, resampled for a drift: the rests before neighbouring presses are alike
SLOWER = 2.0  # times as long as the stimulus's own change: then the time is the sensor's
UNFINISHED = 0.05  # share of presses after which a reading does not come back, above which there is no mean time
HOLD_S = 1.0  # at the end of a grasp
LIVE = 0.03  # of the highest reading of any element; a cell that never comes to it is not touched
HALF = 0.5  # of the samples of holds: an element that stands at its limit for longer is clipped there
PRESSED = ("response", "busy", "settled", "rise_s", "fall_s", "late_s")  # fields of Cycles that a limit changes
SAME = 0.99  # of the response: a reading that has come so far at 90 % of the stimulus
ANSWERS = 5.0  # times its noise: an element that answers less to full presses is dead

NO_STIMULUS = "no log says how hard the sensor was pressed"
SINGLE = "no two equal presses"
HAND = "the hand moves too, and no log tells its part from the sensor's"


class Known(NamedTuple):
    """What the functions of this file are given."""

    sensor: Sensor
    cycles: Cycles  # oriented: responses are positive
    full_scale: float  # of the stimulus; NaN without presses
    sign: np.ndarray  # (E,) 1 where an element rises when pressed, else -1
    dead: list[int]  # elements that do not answer
    untold: str  # why no cycle tells anything, or ""
    clipped: list[int]  # elements that stand at a limit
    limit: str  # the sentence on these, or ""


def known(sensor: Sensor) -> Known:
    """Return a sensor with its cycles, each turned so that the response is positive; dead elements have no values."""
    found = cycles(sensor)
    untold = ""
    if not sensor.stimulus:
        untold = NO_STIMULUS
    elif not len(found.time_s):
        untold = f"no press in one place goes from rest to {PERCENT * FULL:.0f} % of the strongest ones and back"
    noise = np.sqrt(mean(found.quiet[:, 0], found.quiet[:, 1]) / 6)
    size = mean(np.abs(found.response), np.isfinite(found.response))
    dead = size <= ANSWERS * np.nan_to_num(noise)
    response = np.where(dead, np.nan, found.response)
    turn = np.where(response < 0, -1.0, 1.0)
    oriented = found._replace(
        response=np.abs(response),
        loaded=found.loaded * turn,
        up=found.up * turn[:, None],
        down=found.down * turn[:, None],
        creep=found.creep * turn[:, None, None],
        settled=found.settled * turn[:, None],
    )
    sign = np.where(np.nansum(response, axis=0) < 0, -1.0, 1.0)
    given = Known(sensor, oriented, full_scale(sensor), sign, np.flatnonzero(dead).tolist(), untold, [], "")
    elements, limit = clipped(given)
    return given._replace(clipped=elements, limit=limit)


def mean(above: np.ndarray, below: np.ndarray) -> np.ndarray:
    """Return sum(above) / sum(below) over the first axis, NaN where that is none; NaN counts as 0."""
    sums = np.nansum(below, axis=0, dtype=float)
    return np.divide(np.nansum(above, axis=0), sums, out=np.full(np.shape(sums), np.nan), where=sums > 0)


def full_scale_output(given: Known) -> np.ndarray:
    """Return the mean response of each element to full presses, (E,); NaN for one that was not pressed."""
    response = given.cycles.response
    return mean(response, np.isfinite(response))


def clipped(given: Known) -> tuple[list[int], str]:
    """Return the elements that stand at a limit for more than half of the holds, and the sentence on them, "" for none.

    Readings that are all alike in equal presses look the same, so that a limit has to be reached at 90 % of the
    stimulus already, or by presses that differ. Without a stimulus: the highest cell, in the last second of grasps.
    """
    low, high = extremes(given.sensor)
    if given.untold == NO_STIMULUS:
        tops = [log.reading[log.time_s >= log.time_s[-1] - HOLD_S].max(axis=1) for log in given.sensor.logs]
        at_top = np.mean([np.mean(top >= high.max()) for top in tops]) > HALF and len(tops) >= FEWEST
        return [], f"the readings are clipped at {high.max():.4g}" if at_top else ""
    cycle = given.cycles
    resolved = np.isfinite(cycle.up[:, -1])
    response, early = (mean(np.where(resolved, part, np.nan), resolved) for part in (cycle.response, cycle.up[:, -1]))
    stimulus = np.where(np.isfinite(cycle.response), cycle.stimulus[:, None], np.nan)
    found = {}
    for element in np.flatnonzero(np.isfinite(stimulus).any(axis=0)):
        shares = cycle.at_limit[:, :, element]
        for k, limit in enumerate((low[element], high[element])):
            held = stimulus[shares[:, k] > HALF, element]
            if mean(shares[:, k], np.isfinite(shares[:, k])) > HALF and (
                early[element] >= SAME * response[element] or np.ptp(held) > ALIKE * given.full_scale
            ):
                found[int(element)] = limit
    if not found:
        return [], ""
    which = "the readings" if given.sensor.elements == 1 else f"the readings of {len(found)} of the elements"
    return list(found), f"{which} are clipped at {next(iter(found.values())):.4g}"


def bounded(given: Known, found: Estimate, bound: str) -> Estimate:
    """Return a line as it is, or as a bound, "at least" or "at most", where readings are clipped."""
    return found._replace(reason=given.limit, bound=bound) if found.told and given.limit else found


def unclipped(given: Known) -> Known:
    """Return what is known with the pressed readings of clipped elements left out; they are NaN."""
    cycle = given.cycles
    parts = {name: getattr(cycle, name).copy() for name in PRESSED}
    for part in parts.values():
        part[..., given.clipped] = np.nan
    return given._replace(cycles=cycle._replace(**parts))


def span(given: Known) -> Estimate:
    """Full-scale output: reading under the strongest presses less that at rest (ISA-S37.1).

    Full presses are those above 80 % of what the strongest reach; read at the end of the hold. Where no log says how
    hard the sensor was pressed: the reading of a grasp's highest element above the lowest that this element ever had.
    """
    if given.untold == NO_STIMULUS:
        highest = grasps(given.sensor).held.max(axis=1, keepdims=True)
        return bounded(given, ratio_of_sums(highest, np.ones_like(highest), given.sensor.unit), "at least")
    if given.untold:
        return cannot_tell(given.sensor.unit, given.untold)
    response = given.cycles.response
    return bounded(given, ratio_of_sums(response, ones(response), given.sensor.unit), "at least")


def sensitivity(given: Known) -> Estimate:
    """Change of the reading over the change of the stimulus from rest to full presses (ISA-S37.1).

    It is the slope of the terminal line; a sensor that is not linear has others in between.
    """
    unit = f"{given.sensor.unit}/{given.sensor.stimulus or 'N'}"
    if given.untold:
        return cannot_tell(unit, given.untold)
    return bounded(given, ratio_of_sums(given.cycles.response, given.cycles.stimulus[:, None], unit), "at least")


def non_linearity(given: Known) -> Estimate:
    """Largest deviation of the mean loading curve from the terminal line (terminal linearity, ISA-S37.1).

    The line goes from the reading at rest to that at the end of loading, before any creep. Positive: the reading rises
    first faster and then more slowly than the line.
    """
    if given.untold:
        return cannot_tell("% FS", given.untold)
    line = LEVELS[:, None] * given.cycles.loaded[:, None]
    above = PERCENT * (given.cycles.up - line)
    return ratio_of_sums(above, _in_all(given), "% FS", finish=extreme, few=unresolved({"loaded": given.cycles.up}))


def hysteresis(given: Known) -> Estimate:
    """Largest difference of the mean readings at one stimulus, unloading less loading (ISA-S37.1; IEC 61298-2).

    At 10 to 90 % of the stimulus of full cycles. Creep during the hold, and a reading that is late, are part of it, and
    so are clocks that differ: by one of five readings on a way, a fifth of the way. Positive: higher when unloading.
    """
    if given.untold:
        return cannot_tell("% FS", given.untold)
    above = PERCENT * (given.cycles.down - given.cycles.up)
    few = unresolved({"loaded": given.cycles.up, "unloaded": given.cycles.down})
    return ratio_of_sums(above, _in_all(given), "% FS", finish=extreme, few=few)


def repeatability(given: Known) -> Estimate:
    """Standard deviation of the response over equal presses (ISA-S37.1 has the largest difference in their place).

    Presses are equal in one place, within a millimetre, and of one stimulus, within 5 %, for whose rest the mean slope
    corrects. Without a log of the stimulus the spread of a grasp's total over grasps of one object is a bound.
    """
    if given.untold == NO_STIMULUS:
        held = grasps(given.sensor)
        total = held.held.sum(axis=1, keepdims=True)
        left = centred(total, held.group)
        share = np.divide(left, total - left, out=np.full(left.shape, np.nan), where=total > left)
        _, place, count = np.unique(held.group, return_inverse=True, return_counts=True)
        free = np.where(count > 1, 1 - 1 / count, np.nan)[place][:, None]
        found = ratio_of_sums(np.square(share), free, "%", finish=lambda ratio: PERCENT * np.sqrt(ratio), few=SINGLE)
        return found._replace(reason=found.reason or HAND)
    if given.untold:
        return cannot_tell("% FS", given.untold)
    equal = equal_presses(given, across=True)
    if equal is None:
        return cannot_tell("% FS", SINGLE)
    left = np.square(equal.response - equal.slope * equal.stimulus[:, None])
    free = np.where(np.isfinite(left), (1 - 1 / equal.count)[:, None], np.nan)
    output = full_scale_output(given)
    return ratio_of_sums(left, free, "% FS", finish=lambda ratio: PERCENT * np.sqrt(ratio) / output)


def drift_of_rest(given: Known) -> Estimate:
    """Slope over time of the reading at rest before a press (zero drift; ISA-S37.1: zero shift over a period).

    Least squares with one slope for all recordings of five minutes and more, each from its own mean. Positive: as if
    pressed more and more.
    """
    unit = "% FS/h"
    if given.untold:
        return cannot_tell(unit, given.untold)
    usable = long_enough(given)
    if usable.sum() < DRIFT_PRESSES:
        return cannot_tell(unit, f"no recording of {LASTS_S / 60:.0f} minutes with {DRIFT_PRESSES} full presses")
    log, hours = given.cycles.log[usable], given.cycles.time_s[usable] / 3600
    hours = centred(hours[:, None], log)
    rest = centred(given.cycles.rest[usable] * given.sign, log)
    above, below = (in_blocks(part, BLOCKS) for part in (hours * rest, np.broadcast_to(hours**2, rest.shape)))
    output = full_scale_output(given)
    found = ratio_of_sums(above, below, unit, finish=lambda slope: PERCENT * slope / output, n=int(usable.sum()))
    return bounded(given, found, "in size at most")


def spread_of_rest(given: Known) -> Estimate:
    """Standard deviation of the reading at rest before a press, within a recording: what a slope over time leaves out.

    A sensor without drift and without memory has only its noise here.
    """
    if given.untold:
        return cannot_tell("% FS", given.untold)
    log = given.cycles.log
    _, place, count = np.unique(log, return_inverse=True, return_counts=True)
    left = np.square(centred(given.cycles.rest, log))
    free = np.broadcast_to(np.where(count > 1, 1 - 1 / count, np.nan)[place][:, None], left.shape)
    left, free, output = in_blocks(left, BLOCKS), in_blocks(free, BLOCKS), full_scale_output(given)
    found = ratio_of_sums(left, free, "% FS", finish=lambda ratio: PERCENT * np.sqrt(ratio) / output, n=len(log))
    return bounded(given, found, "at most")


def drift_of_gain(given: Known) -> Estimate:
    """Slope over time of the response to equal presses, in % of the response (ISA-S37.1: sensitivity shift).

    Equal as for the repeatability, and in one recording of five minutes or more.
    """
    unit = "%/h"
    if given.untold:
        return cannot_tell(unit, given.untold)
    equal = equal_presses(given, across=False, among=long_enough(given))
    if equal is None:
        return cannot_tell(unit, f"no two equal presses in a recording of {LASTS_S / 60:.0f} minutes")
    left = equal.response - equal.slope * equal.stimulus[:, None]
    free = equal.hours - equal.follows * equal.stimulus
    weight = equal.size * free[:, None]
    order = np.argsort(equal.at_h)
    above, below = (in_blocks(part[order], BLOCKS) for part in (weight * left, weight**2))
    return ratio_of_sums(PERCENT * above, below, unit, n=len(left))


def creep_1(given: Known) -> Estimate:
    """Change of the reading from when the stimulus has settled to 1 s later, in % of the response then (ISA-S37.1)."""
    return creep(given, 0)


def creep_10(given: Known) -> Estimate:
    """Change of the reading 10 s later, as after 1 s."""
    return creep(given, 1)


def creep(given: Known, which: int) -> Estimate:
    """Return the creep after CREEP_S[which], from when twice the response time is over, if that is the sensor's."""
    if given.untold:
        return cannot_tell("%", given.untold)
    later_s, responds = CREEP_S[which], response_time(given)
    wait_s = 2e-3 * responds.value if responds.told else 0.0
    k = next((k for k, settled_s in enumerate(SETTLED_S) if settled_s >= wait_s), None)
    if k is None:
        return cannot_tell(
            "%", f"the reading takes {responds.value:.0f} ms to respond, too long to tell a creep from it"
        )
    few = f"no press is held, within 3 %, for {later_s:g} s after {SETTLED_S[k]:g} s in which it settles"
    return ratio_of_sums(PERCENT * given.cycles.creep[:, k, which], given.cycles.settled[:, k], "%", few=few)


def noise_at_rest(given: Known) -> Estimate:
    """Standard deviation of the white noise at rest, from second differences, so that drift is not in it.

    As von Neumann et al. (Annals of Mathematical Statistics 12, 153, 1941) from first ones: the mean square of second
    differences of white noise is six times its variance.
    """
    if given.untold:
        return cannot_tell(given.sensor.unit, given.untold)
    return noise(given, given.cycles.quiet, "rests have fewer than 3 readings")


def noise_pressed(given: Known) -> Estimate:
    """Standard deviation of the white noise in the hold of a full press, as at rest; tremor of the stimulus is in it.

    Without a log of the stimulus: in the last second of a grasp, whose tremor makes it a bound.
    """
    if given.untold == NO_STIMULUS:
        found = noise(given, grasps(given.sensor).quiet, "grasps have fewer than 3 readings")
        return found._replace(reason=found.reason or HAND)
    if given.untold:
        return cannot_tell(given.sensor.unit, given.untold)
    return noise(given, given.cycles.busy, "holds have fewer than 6 readings")


def noise(given: Known, sums: np.ndarray, few: str) -> Estimate:
    """Return the noise from sums of squares of second differences, and their numbers: (P, 2, E)."""
    unit = given.sensor.unit
    found = ratio_of_sums(sums[:, 0], sums[:, 1], unit, finish=lambda ratio: np.sqrt(ratio / 6), few=few)
    if found.told and found.value == 0:
        return cannot_tell(unit, "the readings are all alike: at a limit, or the converter's steps exceed the noise")
    return found


def signal_to_noise(given: Known) -> Estimate:
    """Full-scale output over the noise, at rest or pressed, whichever is larger: 20 lg of the ratio.

    The interval holds those of both. Where the noise is a bound, so is this.
    """
    signal, noises = span(given), [noise_at_rest(given), noise_pressed(unclipped(given))]
    known = [line for line in noises if np.isfinite(line.value)]
    if not signal.value > 0 or not known:
        return cannot_tell("dB", noises[-1].reason if signal.value > 0 else signal.reason)
    disturbance = max(known, key=lambda line: line.value)
    ends = (signal.low, disturbance.high), (signal.high, disturbance.low), (signal.value, disturbance.value)
    low, high, value = (float(20 * np.log10(one / other)) for one, other in ends)
    return Estimate(
        value,
        "dB",
        min(signal.n, disturbance.n),
        low,
        high,
        reason=signal.reason or disturbance.reason,
        bound="at least",
    )


def crosstalk(given: Known) -> Estimate:
    """Mean size of the response of the up to four elements beside the pressed one, over its own.

    The tip is within a quarter of the pitch of the element's middle. The circuit's crosstalk and the load that the
    cover spreads to the neighbours are both in it.
    """
    if given.sensor.elements == 1:
        return cannot_tell("%", "one element has no neighbour")
    if given.untold:
        return cannot_tell("%", given.untold)
    if given.sensor.shape is None:
        return cannot_tell("%", "every press loads all elements")
    few = "no full press is in the middle of an element"
    return ratio_of_sums(PERCENT * given.cycles.neighbours, given.cycles.response, "%", few=few)


def dead_time(given: Known) -> Estimate:
    """Time from the start of the stimulus to that of the reading, each at 5 % of its change (IEC 61298-2: dead time).

    Only a stimulus that rises faster than the delay tells it: else the shape of the loading curve looks like one.
    """
    if given.untold:
        return cannot_tell("ms", given.untold)
    if not given.sensor.one_clock:
        return cannot_tell("ms", "the clocks of the logs are aligned by the presses, which hides a delay")
    few = f"the noise is more than {PERCENT * START / UNLIKELY:.3g} % of the responses"
    late = ratio_of_sums(1e3 * given.cycles.late_s, ones(given.cycles.late_s), "ms", few=few)
    rise_ms, interval_ms = 1e3 * typical(given.cycles.stimulus_rise_s), 1e3 * given.cycles.interval_s
    if not late.told:
        return late
    if rise_ms <= 2 * interval_ms and late.value < interval_ms:
        return cannot_tell("ms", "less than the interval of the log", at_most=interval_ms, n=late.n)
    if late.value < rise_ms:
        return cannot_tell("ms", f"a press takes {rise_ms:.0f} ms from 10 to 90 %; only quicker ones show a delay")
    return late


def response_time(given: Known) -> Estimate:
    """Time of the reading from 10 to 90 % of its change when pressed (ISA-S37.1: rise time).

    It is the sensor's where it is at least twice the stimulus's own; else it is a bound.
    """
    return change_time(given, given.cycles.rise_s, given.cycles.stimulus_rise_s, "a press itself")


def recovery_time(given: Known) -> Estimate:
    """Time of the reading from 90 to 10 % of its change when released (as the response time)."""
    return change_time(given, given.cycles.fall_s, given.cycles.stimulus_fall_s, "a release itself")


def change_time(given: Known, reading_s: np.ndarray, stimulus_s: np.ndarray, what: str) -> Estimate:
    """Return a response or recovery time from those of the readings (P, E) and of the stimulus (P,)."""
    if given.untold:
        return cannot_tell("ms", given.untold)
    unfinished = np.isinf(reading_s).sum() / max((~np.isnan(reading_s)).sum(), 1)
    if unfinished > UNFINISHED:
        part = f"{PERCENT * unfinished:.0f} % of the readings"
        return cannot_tell("ms", f"{part} are not back at 10 % before the next press")
    reading_s = np.where(np.isfinite(reading_s), reading_s, np.nan)
    few = f"the noise is more than {PERCENT * 0.1 / UNLIKELY:.3g} % of the responses"
    found = ratio_of_sums(1e3 * reading_s, ones(reading_s), "ms", few=few)
    own_ms, interval_ms = 1e3 * typical(stimulus_s), 1e3 * given.cycles.interval_s
    if not found.told:
        return found
    if found.value < 2 * interval_ms:
        return cannot_tell("ms", "less than two intervals of the log", max(found.value, 2 * interval_ms), found.n)
    if not found.value >= SLOWER * own_ms:
        return cannot_tell("ms", f"{what} takes {own_ms:.0f} ms", found.value, found.n)
    return found


def spread_between_elements(given: Known) -> Estimate:
    """Standard deviation of the elements' sensitivities over their mean (coefficient of variation)."""
    if given.sensor.elements == 1:
        return cannot_tell("%", "one element")
    if given.untold:
        return cannot_tell("%", given.untold)

    def variation(values: np.ndarray) -> np.ndarray:
        count, here = np.isfinite(values).sum(axis=1), np.isfinite(values)
        middle = np.where(here, values, 0.0).sum(axis=1) / np.maximum(count, 1)
        square = np.where(here, values - middle[:, None], 0.0) ** 2
        deviation = np.sqrt(square.sum(axis=1) / np.maximum(count - 1, 1))
        return np.where(count > 2, PERCENT * deviation / np.where(middle, middle, np.nan), np.nan)

    response, stimulus = given.cycles.response, given.cycles.stimulus[:, None]
    pressed = (np.isfinite(response).sum(axis=0) >= 3).sum()
    if pressed < 3:
        return cannot_tell("%", "fewer than 3 elements were pressed 3 times")
    found = ratio_of_sums(response, stimulus, "%", summary=variation)
    return found._replace(smallest=np.nan, largest=np.nan)


BOUNDED = (span, sensitivity, drift_of_rest, spread_of_rest, noise_at_rest, signal_to_noise)  # of clipped elements, too
QUANTITIES: dict[str, Callable[[Known], Estimate]] = {
    "span": span,
    "sensitivity": sensitivity,
    "non-linearity": non_linearity,
    "hysteresis": hysteresis,
    "repeatability": repeatability,
    "drift of rest": drift_of_rest,
    "spread of rest": spread_of_rest,
    "drift of gain": drift_of_gain,
    "creep, 1 s": creep_1,
    "creep, 10 s": creep_10,
    "noise at rest": noise_at_rest,
    "noise, pressed": noise_pressed,
    "signal to noise": signal_to_noise,
    "crosstalk": crosstalk,
    "dead time": dead_time,
    "response time": response_time,
    "recovery time": recovery_time,
    "spread between elements": spread_between_elements,
}


class Sheet(NamedTuple):
    """A sensor's data sheet."""

    given: Known
    lines: Mapping[str, Estimate]  # quantity -> what the logs tell of it


def sheet(sensor: Sensor) -> Sheet:
    """Return the sheet of a sensor, every line of QUANTITIES."""
    given = known(sensor)
    left = unclipped(given)
    lines = {name: quantity(given if quantity in BOUNDED else left) for name, quantity in QUANTITIES.items()}
    for name, quantity in QUANTITIES.items():
        if given.clipped and quantity not in BOUNDED and np.isnan(lines[name].value):
            whole = quantity(given)  # which would have a value, if a wrong one
            lines[name] = cannot_tell(whole.unit, given.limit) if np.isfinite(whole.value) else whole
    return Sheet(given, lines)


def extreme(ratio: np.ndarray) -> np.ndarray:
    """Return, of values (..., levels, elements), the one of the largest size over levels, with its sign."""
    place = np.nan_to_num(np.abs(ratio)).argmax(axis=-2)[..., None, :]
    return np.take_along_axis(ratio, place, axis=-2)[..., 0, :]


def unresolved(ways: Mapping[str, np.ndarray]) -> str:
    """Return the sentence for ways (P, LEVELS, E) that no press resolves, "" where all are resolved."""
    which = " and ".join(name for name, way in ways.items() if not np.isfinite(way).any())
    few = f"the sensor is {which} within fewer than {FEWEST_ON_THE_WAY} readings: press more slowly, or log faster"
    return few if which else ""


def typical(values: np.ndarray) -> float:
    """Return the median of the finite values; NaN without one."""
    finite = values[np.isfinite(values)]
    return float(np.median(finite)) if len(finite) else np.nan


def long_enough(given: Known) -> np.ndarray:
    """Return which cycles are of a recording that lasts LASTS_S, (P,) bool."""
    lasts = np.array([np.ptp(log.time_s) if len(log.time_s) else 0.0 for log in given.sensor.logs])
    return lasts[given.cycles.log] >= LASTS_S


def centred(values: np.ndarray, group: np.ndarray) -> np.ndarray:
    """Return values (n, ...) less the mean of their group (n,)."""
    _, place = np.unique(group, return_inverse=True)
    here = np.isfinite(values).astype(float)
    sums, counts = np.zeros((2, place.max() + 1, *values.shape[1:]))
    np.add.at(sums, place, np.nan_to_num(values))
    np.add.at(counts, place, here)
    return values - (sums / np.maximum(counts, 1))[place]


class Equal(NamedTuple):
    """Presses that have equals; what has no other name is less the mean of its group."""

    count: np.ndarray  # (n,) presses of the group
    at_h: np.ndarray  # (n,) hours
    stimulus: np.ndarray  # (n,)
    hours: np.ndarray  # (n,)
    response: np.ndarray  # (n, E)
    size: np.ndarray  # (n, E) mean response of the group
    slope: np.ndarray  # (E,) of the response over the stimulus
    follows: float  # slope of the hours over the stimulus


def equal_presses(given: Known, *, across: bool, among: np.ndarray | None = None) -> Equal | None:
    """Return the presses, of those `among` (P,), that have an equal; None where none has.

    across: presses of several recordings of one group may be equal, too.
    """
    rows = np.flatnonzero(np.isfinite(given.cycles.response).any(axis=1))
    rows = rows if among is None else rows[among[rows]]
    cycle = given.cycles
    place = np.nan_to_num(np.round(cycle.place / PLACE_MM), nan=-1e6)
    level = np.round(np.log(cycle.stimulus) / ALIKE)
    within = cycle.group if across else cycle.log
    keys = np.column_stack([within, place, level])[rows]
    _, group, count = np.unique(keys, axis=0, return_inverse=True, return_counts=True)
    group = group.reshape(-1)
    several = count[group] > 1
    if not several.any():
        return None
    rows, group, count = rows[several], group[several], count[group][several]
    stimulus, hours = (centred(values[rows][:, None], group)[:, 0] for values in (cycle.stimulus, cycle.time_s / 3600))
    response = centred(cycle.response[rows], group)
    alike = float(np.square(stimulus).sum())
    slope = np.nansum(stimulus[:, None] * response, axis=0) / alike if alike else np.zeros(response.shape[1])
    follows = float((stimulus * hours).sum() / alike) if alike else 0.0
    at_h = cycle.time_s[rows] / 3600
    return Equal(count, at_h, stimulus, hours, response, cycle.response[rows] - response, slope, follows)


class Grasps(NamedTuple):
    """The last second of every recording of a sensor whose stimulus no log says, G of them."""

    group: np.ndarray  # (G,)
    held: np.ndarray  # (G, cells) mean reading above the lowest that the cell ever has, of cells that are touched
    quiet: np.ndarray  # (G, 2, cells) sum of squares of second differences, and their number


def grasps(sensor: Sensor) -> Grasps:
    """Return the last second of every recording; a cell that no recording presses is left out."""
    lowest = np.min([log.reading.min(axis=0) for log in sensor.logs], axis=0)
    held, quiet = [], []
    for log in sensor.logs:
        last = log.reading[log.time_s >= log.time_s[-1] - HOLD_S]
        held.append(last.mean(axis=0) - lowest)
        found = squares(last) if len(last) > 2 else np.full((1, len(lowest)), np.nan)
        quiet.append([found.sum(axis=0), np.where(np.isnan(found[0]), np.nan, len(found))])
    held = np.array(held)
    live = held.max(axis=0) >= LIVE * held.max()
    return Grasps(np.array([log.group for log in sensor.logs]), held[:, live], np.array(quiet)[:, :, live])


def ones(values: np.ndarray) -> np.ndarray:
    """Return 1 where values are finite, else NaN."""
    return np.where(np.isfinite(values), 1.0, np.nan)


def _in_all(given: Known) -> np.ndarray:
    """Return the response of every cycle at all levels: (P, LEVELS, E)."""
    response = given.cycles.response
    return np.broadcast_to(response[:, None], (len(response), len(LEVELS), response.shape[1]))
