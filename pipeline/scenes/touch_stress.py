"""Simulate touches that models were not trained for: another array, harder, faster, blunter presses, more touches.

Three conditions. `double` are the double-touch recordings of the experiment, pressed again with one thing changed;
unchanged, they are the same to the last digit. `single_anew` are single touches at places, depths and times drawn
anew: the experiment's own are mostly training data. `several` are further layouts: a number of simultaneous touches,
or two touches at a distance; they have no unchanged version. Everything else is `scenes/touch.py`.
"""

from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np

from pipeline.scenes import touch, touch_motion
from pipeline.scenes.touch_contact import steady, tip_area_m2
from pipeline.scenes.touch_motion import Recording
from tactile.base.errors import InputError
from tactile.base.stress_tests import of_scene, stress_test
from tactile.datasets import specimens
from tactile.datasets.seeding import generator

UNCHANGED = "unchanged"
PRESSES = 160  # of a condition whose presses are drawn anew
DRAWS = 1000  # of places, until all touches are far enough from one another


Placed = tuple[np.ndarray, np.ndarray]  # where tips press and how hard, see `places`


class Changed(NamedTuple):
    """The block `touch` after a stress test, and what the block does not say."""

    settings: dict
    of_array: dict = {}  # changes of `simulate` for the array that reads, not for the tips that press
    tips: Placed | None = None  # in place of those of the condition


@stress_test("touch", unit="other sensor, number", acts_on="scene", conditions=("double", "single_anew"))
def specimen(settings: Mapping, severity: float) -> Changed:
    """Take another array of the same make: its number from the trained.

    No seed trains on it, and its places differ, even where those of training do not. The presses are the same.
    """
    scene = settings["simulate"]
    effects = scene["effects"] | ({"places": True} if severity else {})
    unknown = scene["specimen"] + scene["specimens"] * int(severity)
    return Changed(settings, {"specimen": unknown, "effects": effects})


@stress_test("touch", unit="relative change", acts_on="scene", conditions=("double", "single_anew"))
def peak_pressure(settings: Mapping, severity: float) -> Changed:
    """Multiply all pressures by 1 + severity."""
    pressure = settings["simulate"]["pressure"]
    scaled = {key: pressure[key] * (1 + severity) for key in ("lowest_kpa", "highest_kpa")}
    return Changed(settings | {"simulate": settings["simulate"] | {"pressure": pressure | scaled}})


@stress_test("touch", unit="factor, as a power of 2", acts_on="scene", conditions=("double", "single_anew"))
def press_speed(settings: Mapping, severity: float) -> Changed:
    """Approach, hold and release 2^severity times as fast; the rest between two presses stays."""
    press = settings["simulate"]["press"]
    scaled = {key: press[key] / 2**severity for key in ("approach_s", "hold_s", "release_s")}
    return Changed(settings | {"simulate": settings["simulate"] | {"press": press | scaled}})


@stress_test("touch", unit="change in mm", acts_on="scene", conditions=("double", "single_anew"))
def tip_radius(settings: Mapping, severity: float) -> Changed:
    """Add `severity` mm to the radius of the CNC's tip, and in proportion to the hand's, at the same pressures.

    The labels change with the tip (eq. 1).
    """
    scene, radius = settings["simulate"], settings["label"]["tip_radius_mm"] + severity
    if radius <= 0:
        raise InputError(f"params.yaml, stress.touch: tip_radius {severity:g} mm leaves no tip; take less away")
    # The hand's tip keeps its share of the CNC's: the same millimetres could leave nothing of it.
    share = radius / settings["label"]["tip_radius_mm"]
    hand = scene["hand"] | {"tip_radius_mm": scene["hand"]["tip_radius_mm"] * share}
    return Changed(
        settings | {"simulate": scene | {"hand": hand}, "label": settings["label"] | {"tip_radius_mm": radius}}
    )


@stress_test("touch", unit="number of touches", acts_on="scene", conditions=("several",))
def touches(settings: Mapping, severity: float) -> Changed:
    """Press with `severity` tips at once."""
    return Changed(settings, tips=places(settings, severity))


@stress_test("touch", unit="mm", acts_on="scene", conditions=("several",))
def distance(settings: Mapping, severity: float) -> Changed:
    """Press with two tips `severity` mm apart."""
    return Changed(settings, tips=pairs(settings, severity))


def changed(settings: Mapping, name: str, severity: float) -> Changed:
    """Return the block `touch` after a stress test, as it is for UNCHANGED; InputError for an unknown name."""
    return Changed(settings) if name == UNCHANGED else of_scene("touch", name)(settings, severity)


def plan(
    settings: Mapping, condition: str, name: str, severity: float, number: int
) -> tuple[list[Recording], Callable[[Recording], dict]]:
    """Return the recordings of one condition after a test, and the function that gives the logs of one (`touch.plan`).

    settings: the block `touch` as params.yaml has it; name: of the test; number: of the array that was trained on.
    """
    scene = specimens.drawn(settings["simulate"], number)
    block, of_array, tips = changed(settings | {"simulate": scene}, name, severity)
    scene, sensor, radius = block["simulate"], block["sensor"], block["label"]["tip_radius_mm"]
    if condition == "double":
        recordings = touch_motion.double_recordings(scene, sensor, radius)
    else:
        recordings = pressed(condition, *(tips or places(block, 1)), scene, radius)
    recordings = [each._replace(name=specimens.named(number, each.name)) for each in recordings]
    return recordings, lambda recording: touch.logs_of(recording, scene | of_array, sensor, reset=False)


def places(settings: Mapping, number: float) -> tuple[np.ndarray, np.ndarray]:
    """Draw where and how hard `number` tips press at once: (presses, touches, 2) in mm, (presses, touches) in kPa.

    On label cells of elements drawn at random, at least one element between any two, as in the double-touch data.
    Places are drawn for touch.ingest.max_touches tips, so that those of fewer touches are among those of more.
    """
    scene, sensor, most = settings["simulate"], settings["sensor"], settings["ingest"]["max_touches"]
    if number != int(number) or not 1 <= number <= most:
        raise InputError(f"params.yaml, stress.touch: {number!r} touches at once; give a whole number from 1 to {most}")
    rng, presses = generator(scene["seed"], "stress", "places"), _presses(scene)
    elements = np.array([(c, r) for r in range(sensor["rows"]) for c in range(sensor["cols"])])
    pressed_elements = np.empty((presses, most, 2))
    for press in range(presses):
        for _ in range(DRAWS):
            chosen = []
            for element in rng.permutation(elements):
                if all(abs(element - other).max() >= 2 for other in chosen):
                    chosen.append(element)
            if len(chosen) >= most:
                break
        else:
            raise InputError(
                f"params/touch.yaml, touch.ingest.max_touches: {most} touches find no room on the array; lower it"
            )
        pressed_elements[press] = chosen[:most]
    cells = rng.integers(0, 4, pressed_elements.shape)  # one of the 4 x 4 label cells of the element
    places_mm = (pressed_elements + (cells + 0.5) / 4) * sensor["pitch_mm"]
    kpa = rng.uniform(scene["pressure"]["lowest_kpa"], scene["pressure"]["highest_kpa"], (presses, most))
    return places_mm[:, : int(number)], kpa[:, : int(number)]


def pairs(settings: Mapping, distance_mm: float) -> tuple[np.ndarray, np.ndarray]:
    """Draw two tips `distance_mm` apart along a row or a column: (presses, 2, 2) in mm, (presses, 2) in kPa.

    Both stay half an element inside the array. With the same draws, a smaller distance moves the tips together.
    """
    scene, sensor = settings["simulate"], settings["sensor"]
    size = np.array([sensor["cols"], sensor["rows"]]) * sensor["pitch_mm"]
    edge = sensor["pitch_mm"] / 2
    if not 0 < distance_mm <= size.min() - 2 * edge:
        raise InputError(
            f"params.yaml, stress.touch: distance {distance_mm:g} mm; give more than 0 and at most "
            f"{size.min() - 2 * edge:g} mm (the array less half an element at each edge)"
        )
    rng, presses = generator(scene["seed"], "stress", "pairs"), _presses(scene)
    along = np.eye(2)[rng.integers(0, 2, presses)]  # (presses, 2): x or y
    first = edge + rng.random((presses, 2)) * (size - 2 * edge - distance_mm * along)
    kpa = rng.uniform(scene["pressure"]["lowest_kpa"], scene["pressure"]["highest_kpa"], (presses, 2))
    return np.stack([first, first + distance_mm * along], axis=1), kpa


def pressed(
    condition: str, places_mm: np.ndarray, kpa: np.ndarray, scene: Mapping, tip_radius_mm: float
) -> list[Recording]:
    """Return recordings of presses in which all tips come and go together; arguments as `places` returns them.

    There are as many presses per recording as in the double-touch data.
    """
    rng, press = generator(scene["seed"], "stress", "timing"), scene["press"]
    newton = 1e3 * tip_area_m2(tip_radius_mm)  # per kPa
    size, recordings = scene["double"]["presses_per_recording"], []
    for number, first in enumerate(range(0, len(kpa), size)):
        pieces, before = [], None
        for places, pressures in zip(places_mm[first : first + size], kpa[first : first + size], strict=True):
            duration = touch_motion.varied(press, rng)
            rest = touch_motion.rest_steps(duration["rest_s"], places, before, press)
            profile = touch_motion.press_profile(duration)
            pieces.append(
                [
                    (rest, kilopascal * newton * profile, place)
                    for kilopascal, place in zip(pressures, places, strict=True)
                ]
            )
            before = places
        tips = [touch_motion.course(list(tip), press["cnc_mm_s"]) for tip in zip(*pieces, strict=True)]
        touches = [steady(tip.force_n, *tip.place_mm.T, tip_radius_mm) for tip in tips]
        recordings.append(Recording(condition, f"run{number:03d}", touches))
    return recordings


def _presses(scene: Mapping) -> int:
    """Return the number of presses drawn anew, at most those of the double-touch data."""
    return min(PRESSES, scene["double"]["recordings"] * scene["double"]["presses_per_recording"])
