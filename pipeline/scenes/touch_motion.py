"""Move the tips of the touch scene: a CNC that presses a raster, a hand that presses beside it, three demonstrations.

Press. The tip's depth rises linearly, rests and falls; force goes with depth^1.5 (Hertz). The times are those of the
recorded taxel's presses (0.45 s from 5 to 90 % of the force, 1.2 s at it, 2.5 to 5.9 s between presses), but for the
release: the arm that recorded them leaves in 0.02 to 0.05 s, a CNC lifts at its feed rate. Between two presses the CNC
moves at a finite speed.

Hand. It is slower; its load cell has a tip of its own radius; it is tilted, so that it feels F cos(tilt) and its centre
of pressure lies r sin(tilt) off; it slips from the place that it was told. Its force and place tremble, with
frequencies from 0.5 Hz (drift of a force that is held by hand) to 12 Hz (physiological tremor, 8 to 12 Hz: Elble and
Koller, Tremor, 1990).
Differs from paper: neither the speed of a press nor the hand's tip are given there. The hand's pressure is its force
over the area of the CNC's tip, as labels take one radius (eq. 1).
"""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from pipeline.scenes.touch_contact import Touch, steady, tip_area_m2
from tactile.datasets.seeding import generator

STEP_S = 0.01  # the material is integrated at 100 Hz; presses rise in 0.5 s
START_S = 1.0  # rest before the first press, so that alignment sees the first rise
LIFT_S = 0.2  # a tip goes up, and down again, before and after it moves
DRAGON_SKIN_EXPONENT = 1.5  # force over depth of a rounded elastomer tip (Hertz)
TREMOR_HZ = (0.5, 12.0)
TREMOR_WAVES = 24


class Recording(NamedTuple):
    """One uninterrupted capture: a condition, a name and the touches, all on one time grid of STEP_S."""

    condition: str
    name: str
    touches: list[Touch]


def press_profile(duration: Mapping[str, float]) -> np.ndarray:
    """Return the relative force (0..1) of one press: depth rises linearly, holds, falls; F ~ depth^1.5 (Hertz).

    duration: approach_s, hold_s, release_s. Returns (steps,).
    """
    approach, hold, release = (max(2, round(duration[key] / STEP_S)) for key in ("approach_s", "hold_s", "release_s"))
    depth = np.concatenate([np.arange(approach) / approach, np.ones(hold), np.arange(release, 0, -1) / release])
    return depth**DRAGON_SKIN_EXPONENT


def varied(press: Mapping[str, float], rng: np.random.Generator, slower: float = 1.0) -> dict[str, float]:
    """Draw the durations of one press, each varied by up to +-timing_spread."""
    spread = press["timing_spread"]
    return {
        key: press[key] * slower * rng.uniform(1 - spread, 1 + spread)
        for key in ("approach_s", "hold_s", "release_s", "rest_s")
    }


def steps_of(seconds: float) -> int:
    """Return a time as a number of steps."""
    return round(seconds / STEP_S)


def rest_steps(rest_s: float, places_mm: np.ndarray, before_mm: np.ndarray | None, press: Mapping) -> int:
    """Return how long a press is waited for: `rest_s`, or longer where a tip has further to go.

    places_mm, before_mm: (tips, 2), where the tips press next and last; the first press has no place before it.
    """
    far = 0.0 if before_mm is None else np.linalg.norm(places_mm - before_mm, axis=-1).max()
    return steps_of(max(rest_s, far / press["cnc_mm_s"] + 2 * LIFT_S))


def way(start_mm: np.ndarray, goal_mm: np.ndarray, steps: int, speed_mm_s: float) -> np.ndarray:
    """Return the places on the straight way between two places, (steps, 2) in mm, that a tip ends LIFT_S early."""
    far = np.linalg.norm(goal_mm - start_mm)
    gone = (np.arange(steps) - (steps - steps_of(LIFT_S)) + far / speed_mm_s / STEP_S) * STEP_S * speed_mm_s
    return start_mm + np.clip(gone / far, 0, 1)[:, None] * (goal_mm - start_mm) if far else np.tile(goal_mm, (steps, 1))


class Course(NamedTuple):
    """Force (steps,) in N and place (steps, 2) in mm of one tip through a recording."""

    force_n: np.ndarray
    place_mm: np.ndarray


def course(presses: list[tuple[int, np.ndarray, np.ndarray]], speed_mm_s: float) -> Course:
    """Join the presses of one tip; START_S of rest before the first and after the last.

    presses: how many steps it rests before the press, its force (steps,) in N, its place (2,) in mm.
    """
    start = steps_of(START_S)
    force, place, last = [np.zeros(start)], [np.tile(presses[0][2], (start, 1))], presses[0][2]
    for rest, profile, where in presses:
        force += [np.zeros(rest), profile]
        place += [way(last, where, rest, speed_mm_s), np.tile(where, (len(profile), 1))]
        last = where
    return Course(np.concatenate([*force, np.zeros(start)]), np.concatenate([*place, np.tile(last, (start, 1))]))


def tremor(steps: int, rng: np.random.Generator) -> np.ndarray:
    """Return a random course of variance 1, (steps,): waves of equal strength, evenly spread over log TREMOR_HZ."""
    hz = np.exp(rng.uniform(*np.log(TREMOR_HZ), TREMOR_WAVES))
    phase = rng.uniform(0, 2 * np.pi, TREMOR_WAVES)
    return np.sqrt(2 / TREMOR_WAVES) * np.sin(2 * np.pi * hz * np.arange(steps)[:, None] * STEP_S + phase).sum(axis=1)


def single_recordings(settings: Mapping, sensor: Mapping, tip_radius_mm: float) -> list[Recording]:
    """Return single-touch data: every grid point x depth x repetition, grouped into recordings.

    The CNC visits the points of a square grid over the whole sensing area; at each it presses all depths in an
    order of its own. Peak pressures are evenly spaced over [lowest, highest] and vary with the place.
    """
    rng = generator(settings["seed"], "single")
    plan, pressure, side = settings["single"], settings["pressure"], settings["single"]["points_per_side"]
    width, height = sensor["cols"] * sensor["pitch_mm"], sensor["rows"] * sensor["pitch_mm"]
    points = [((c + 0.5) * width / side, (r + 0.5) * height / side) for r in range(side) for c in range(side)]
    levels = np.linspace(pressure["lowest_kpa"], pressure["highest_kpa"], plan["depths"])
    area = tip_area_m2(tip_radius_mm)
    presses = []
    for _ in range(plan["repetitions"]):
        for point in points:
            for level in rng.permutation(levels):
                kpa = level * (1 + pressure["location_spread"] * rng.uniform(-1, 1))
                presses.append((kpa * 1e3 * area, np.array(point)))
    recordings, size, press = [], plan["presses_per_recording"], settings["press"]
    for number, first in enumerate(range(0, len(presses), size)):
        pieces, before = [], None
        for newtons, where in presses[first : first + size]:
            duration = varied(press, rng)
            rest = rest_steps(duration["rest_s"], where, before, press)
            pieces.append((rest, newtons * press_profile(duration), where))
            before = where
        force, place = course(pieces, press["cnc_mm_s"])
        recordings.append(Recording("single", f"run{number:03d}", [steady(force, *place.T, tip_radius_mm)]))
    return recordings


def double_recordings(settings: Mapping, sensor: Mapping, tip_radius_mm: float) -> list[Recording]:
    """Return double-touch data: the CNC presses one element while a hand-held load cell presses another.

    The two elements are at least one element apart (the load cells would collide). Both tips aim at label cells of
    their elements; the label keeps the place that the hand aims at, as in the paper (section II-B).
    """
    rng = generator(settings["seed"], "double")
    pressure, hand, press, pitch = settings["pressure"], settings["hand"], settings["press"], sensor["pitch_mm"]
    area = tip_area_m2(tip_radius_mm)
    elements = [(r, c) for r in range(sensor["rows"]) for c in range(sensor["cols"])]
    pairs = [(a, b) for a in elements for b in elements if max(abs(a[0] - b[0]), abs(a[1] - b[1])) >= 2]
    held_by_hand = settings["effects"]["hand_error"]
    radius = hand["tip_radius_mm"] if held_by_hand else tip_radius_mm
    recordings = []
    for number in range(settings["double"]["recordings"]):
        machine, person, errors, before = [], [], [], None
        for _ in range(settings["double"]["presses_per_recording"]):
            chosen = np.array(pairs[rng.integers(len(pairs))])[:, ::-1]  # (tip, x or y) in elements
            cells = rng.integers(0, 4, (2, 2))  # one of the 4 x 4 label cells of each element
            goals = (chosen + (cells + 0.5) / 4) * pitch
            machine_n, hand_n = rng.uniform(pressure["lowest_kpa"], pressure["highest_kpa"], 2) * 1e3 * area
            by_hand, by_machine = varied(press, rng, slower=hand["slower"]), varied(press, rng)
            slow = hand_n * press_profile(by_hand)
            by_machine["hold_s"] = len(slow) * STEP_S * rng.uniform(0.8, 1.2)
            fast = machine_n * press_profile(by_machine)
            late = rng.integers(0, steps_of(0.3))
            rest = rest_steps(by_machine["rest_s"], goals, before, press)
            steps = max(len(fast), late + len(slow))
            machine.append((rest, np.pad(fast, (0, steps - len(fast))), goals[0]))
            person.append((rest, np.pad(slow, (late, steps - late - len(slow))), goals[1]))
            tilt, towards = np.radians(abs(rng.normal(0, hand["tilt_deg"]))), rng.uniform(0, 2 * np.pi)
            off = rng.normal(0, hand["shift_mm"], 2) + radius * np.sin(tilt) * np.array(
                [np.cos(towards), np.sin(towards)]
            )
            errors.append((rest + steps, tilt, off))
            before = goals
        first, second = course(machine, press["cnc_mm_s"]), course(person, press["cnc_mm_s"])
        touches = [steady(first.force_n, *first.place_mm.T, tip_radius_mm)]
        if held_by_hand:
            touches.append(held(second, errors, hand, generator(settings["seed"], "hand", number)))
        else:
            touches.append(steady(second.force_n, *second.place_mm.T, radius))
        recordings.append(Recording("double", f"run{number:03d}", touches))
    return recordings


def held(intended: Course, errors: list[tuple[int, float, np.ndarray]], hand: Mapping, rng) -> Touch:
    """Return the touch of a hand that means to follow a course.

    errors: per press its steps with the rest before it, its tilt (rad) and how far off it is (2,) in mm.
    """
    start, total = steps_of(START_S), len(intended.force_n)
    lengths = [steps for steps, _, _ in errors]
    lengths[0], lengths[-1] = lengths[0] + start, lengths[-1] + start
    tilt, off = (np.repeat(np.array(column), lengths, axis=0) for column in list(zip(*errors, strict=True))[1:])
    force = intended.force_n * np.maximum(1 + hand["tremor_share"] * tremor(total, rng), 0)
    shaken = np.column_stack([tremor(total, rng), tremor(total, rng)]) * hand["tremor_mm"]
    place = intended.place_mm + off + shaken
    return Touch(force, *place.T, force * np.cos(tilt), *intended.place_mm.T, hand["tip_radius_mm"])


def demonstration_recordings(settings: Mapping, sensor: Mapping, tip_radius_mm: float) -> list[Recording]:
    """Return the three demonstrations of section IV-E: three touches, two sliding touches, a rolled tape.

    The tape is a line of five contacts over neighbouring elements whose load falls from left to right (the thumb
    lifts the right side). The paper shows pictures only; the logged truth here exists because we simulate. Of places
    `random` each is somewhere else, after a rest of its own: touches and slides stay two elements apart, as double
    touches do.
    """
    rng = generator(settings["seed"], "demonstrations")
    newton = 1e3 * tip_area_m2(tip_radius_mm)  # per kPa
    width, height = sensor["cols"] * sensor["pitch_mm"], sensor["rows"] * sensor["pitch_mm"]
    rest = np.zeros(steps_of(2 * START_S))

    def event(peaks_kpa: list[float], ends: list[tuple[float, float, float, float]], seconds: float, rest: np.ndarray):
        """Return (force, x, y), (steps,) each, of every touch of one event, after a rest."""
        profile = press_profile({"approach_s": 0.5, "hold_s": seconds, "release_s": 0.5})
        profile = np.concatenate([rest, profile])
        along = np.clip(np.linspace(-len(rest) / len(profile), 1, len(profile)), 0, 1)
        return [
            (kpa * newton * profile, (x0 + (x1 - x0) * along) * width, (y0 + (y1 - y0) * along) * height)
            for kpa, (x0, y0, x1, y1) in zip(peaks_kpa, ends, strict=True)
        ]

    scenes = {
        "three": ([220, 280, 180], [(0.3, 0.3, 0.3, 0.3), (0.7, 0.3, 0.7, 0.3), (0.5, 0.7, 0.5, 0.7)], 0.6),
        "slide": ([220, 220], [(0.15, 0.2, 0.85, 0.2), (0.85, 0.8, 0.15, 0.8)], 2.0),
        "tape": ([180, 150, 120, 90, 60], tape(0.26, 0.5), 0.8),
    }
    elsewhere = settings["demonstrations"]["places"] == "random"
    apart = np.minimum([2 / sensor["cols"], 2 / sensor["rows"]], 0.4)  # two elements; smaller arrays have no room
    recordings = []
    for name, (peaks, ends, seconds) in scenes.items():
        events = []
        for _ in range(settings["demonstrations"]["repetitions"]):
            scale = rng.uniform(0.9, 1.1)
            ends = random_ends(name, len(peaks), apart, rng) if elsewhere else ends
            held = seconds * rng.uniform(0.8, 1.2)
            # Of many events at one pace the clocks would fit one event later as well.
            before = np.zeros(steps_of(2 * START_S * rng.uniform(0.5, 1.5))) if elsewhere else rest
            events.append(event([peak * scale for peak in peaks], ends, held, before))
        touches = []
        for pieces in zip(*events, strict=True):
            force, x, y = (np.concatenate(column) for column in zip(*pieces, strict=True))
            touches.append(
                steady(
                    np.concatenate([force, rest]),
                    np.concatenate([x, np.full(len(rest), x[-1])]),
                    np.concatenate([y, np.full(len(rest), y[-1])]),
                    tip_radius_mm,
                )
            )
        recordings.append(Recording(name, "run000", touches))
    return recordings


def tape(left: float, y: float) -> list[tuple[float, float, float, float]]:
    """Return the ends of a tape's five contacts, which do not move; left, y: of the first, shares of the array."""
    return [(left + 0.12 * k, y) * 2 for k in range(5)]


def random_ends(name: str, touches: int, apart: np.ndarray, rng: np.random.Generator) -> list[tuple[float, ...]]:
    """Draw where the touches of a demonstration begin and end, (x0, y0, x1, y1) in shares of the array's sides.

    apart: how far two touches are from each other in x or y at every time, (2,) in shares; a slide covers half of a
    side or more.
    """
    if name == "tape":
        return tape(rng.uniform(0.1, 0.42), rng.uniform(0.1, 0.9))
    moves = name == "slide"
    along = np.linspace(0, 1, 50)[:, None, None]
    while True:
        start, end = rng.uniform(0.1, 0.9, (2, touches, 2))  # (touch, x or y)
        end = end if moves else start
        places = start + (end - start) * along
        near = [
            (np.abs(places[:, i] - places[:, j]) < apart).all(axis=1).any() for i in range(touches) for j in range(i)
        ]
        if not any(near) and (not moves or (np.abs(end - start).max(axis=1) >= 0.5).all()):
            return [tuple(ends) for ends in np.hstack([start, end]).tolist()]
