"""Simulate touches that models were not trained for: another array, harder, faster, blunter presses, more touches.

Three conditions. `double` are the double-touch recordings of the experiment, pressed again with one thing changed;
unchanged, they are the same to the last digit. `single_anew` are single touches at places, depths and times drawn
anew: the experiment's own are mostly training data. `several` are further layouts: a number of simultaneous touches,
or two touches at a distance; they have no unchanged version. Everything else is `scenes/touch.py`.
"""

from collections.abc import Callable, Mapping

import numpy as np

from pipeline.base.errors import InputError
from pipeline.datasets import specimens
from pipeline.datasets.seeding import generator
from pipeline.scenes import touch, touch_motion
from pipeline.scenes.touch_contact import steady, tip_area_m2
from pipeline.scenes.touch_motion import Recording

# Perturbation -> the conditions in which it acts.
VARIATIONS = dict.fromkeys(("specimen", "peak_pressure", "press_speed", "tip_radius"), ("double", "single_anew"))
LAYOUTS = dict.fromkeys(("touches", "distance"), ("several",))
PRESSES = 160  # of a condition whose presses are drawn anew
DRAWS = 1000  # of places, until all touches are far enough from one another


def varied(settings: Mapping, perturbation: str, severity: float) -> dict:
    """Return the block `touch` with one thing changed.

    * peak_pressure: all pressures times 1 + severity.
    * press_speed: approach, hold and release 2^severity times as fast; the rest between two presses as before.
    * tip_radius: the CNC's tip's radius plus severity (mm), the hand's in proportion, at the same pressures; the
      labels change with the tip (eq. 1).

    Every other perturbation leaves the block as it is.
    """
    scene, label = settings["simulate"], settings["label"]
    if perturbation == "peak_pressure":
        scaled = {key: scene["pressure"][key] * (1 + severity) for key in ("lowest_kpa", "highest_kpa")}
        scene = scene | {"pressure": scene["pressure"] | scaled}
    if perturbation == "press_speed":
        scaled = {key: scene["press"][key] / 2**severity for key in ("approach_s", "hold_s", "release_s")}
        scene = scene | {"press": scene["press"] | scaled}
    if perturbation == "tip_radius":
        label = label | {"tip_radius_mm": label["tip_radius_mm"] + severity}
        if label["tip_radius_mm"] <= 0:
            raise InputError(f"params.yaml, stress.touch: tip_radius {severity:g} mm leaves no tip; take less away")
        # The hand's tip keeps its share of the CNC's: the same millimetres could leave nothing of it.
        share = label["tip_radius_mm"] / settings["label"]["tip_radius_mm"]
        scene = scene | {"hand": scene["hand"] | {"tip_radius_mm": scene["hand"]["tip_radius_mm"] * share}}
    return settings | {"simulate": scene, "label": label}


def plan(
    settings: Mapping, condition: str, perturbation: str, severity: float, specimen: int
) -> tuple[list[Recording], Callable[[Recording], dict]]:
    """Return the perturbed recordings of one condition, and the function that gives the logs of one, as `touch.plan`.

    settings: the block `touch` as params.yaml has it; specimen: the array that was trained on. The perturbation
    `specimen` takes arrays of the same make that no seed trains on, with places that differ, even where those of
    training do not, at the same presses.
    """
    changed = varied(settings, perturbation, severity)
    changed = changed | {"simulate": specimens.drawn(changed["simulate"], specimen)}
    scene, sensor, radius = changed["simulate"], changed["sensor"], changed["label"]["tip_radius_mm"]
    if condition == "double":
        recordings = touch_motion.double_recordings(scene, sensor, radius)
    elif condition == "single_anew":
        recordings = pressed(condition, *places(changed, 1), scene, radius)
    elif perturbation == "touches":
        recordings = pressed(condition, *places(changed, severity), scene, radius)
    else:
        recordings = pressed(condition, *pairs(changed, severity), scene, radius)
    read_out = scene
    if perturbation == "specimen":
        effects = scene["effects"] | ({"places": True} if severity else {})
        unknown = scene["specimen"] + settings["simulate"]["specimens"] * int(severity)
        read_out = scene | {"specimen": unknown, "effects": effects}
    recordings = [each._replace(name=specimens.named(specimen, each.name)) for each in recordings]
    return recordings, lambda recording: touch.logs_of(recording, read_out, sensor, reset=False)


def places(settings: Mapping, touches: int) -> tuple[np.ndarray, np.ndarray]:
    """Draw where and how hard `touches` tips press at once: (presses, touches, 2) in mm, (presses, touches) in kPa.

    On label cells of elements drawn at random, at least one element between any two, as in the double-touch data.
    Places are drawn for touch.ingest.max_touches tips, so that those of fewer touches are among those of more.
    """
    scene, sensor, most = settings["simulate"], settings["sensor"], settings["ingest"]["max_touches"]
    if touches != int(touches) or not 1 <= touches <= most:
        raise InputError(
            f"params.yaml, stress.touch: {touches!r} touches at once; give a whole number from 1 to {most}"
        )
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
    return places_mm[:, : int(touches)], kpa[:, : int(touches)]


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
