"""Simulate fingertip-like presses on a 5x5 Velostat array, as the raw logs that three devices print.

A chain of named effects, each with a switch in params.yaml (touch.simulate.effects):

    press (CNC or hand) -> contact pressure -> load on each element -> Velostat -> column circuit -> ADC -> log

Contact. The silicone-covered tip of radius r presses with force F. The mean pressure P = F / (pi r^2) is what the
load cell gives, and the label's peak. The contact pressure is taken as a Gaussian of standard deviation
s = sqrt((r/2)^2 + silicone_spread^2), so the share of the load on one square element is a product of two
differences of the normal distribution function. Load on the 0.5 mm gaps between elements is lost.
Differs from paper: the array is simulated. The tip's radius and the speed of a press are not given there: the
radius (5 mm) keeps 400 kPa within the 40 N of the recordings that the material was fitted to, the time at depth
(`press.hold_s`) was set so that linear regression comes near its published single-touch error.

Velostat. `material.py`, fitted to recordings of a Velostat taxel under a load cell.

Circuit. `readout.py`, exact for the read-out of figure 2c of the LoMP paper.
"""

from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np
from scipy.special import ndtr

from pipeline.datasets.seeding import generator
from pipeline.scenes import material, readout
from pipeline.scenes.faults import Fault, inject

STEP_S = 0.01  # the material is integrated at 100 Hz; presses rise in 0.18 s
START_S = 1.0  # rest before the first press, so that alignment sees the first rise
BOOT_S = 1.2  # silence of the array's microcontroller after a reset
DRAGON_SKIN_EXPONENT = 1.5  # force over depth of a rounded elastomer tip (Hertz)
MILLIMETRE_PER_PRESSURE_ROOT = 0.03  # 400 kPa at 1.6 mm depth: scales z in the CNC's log, nothing else


class Touch(NamedTuple):
    """One contact along a recording; arrays of shape (steps,)."""

    force_n: np.ndarray  # force that acts on the array
    x_mm: np.ndarray  # where the force acts
    y_mm: np.ndarray
    logged_force_n: np.ndarray  # force that the load cell feels along its own axis
    logged_x_mm: np.ndarray  # place according to the CNC, or to the instruction to the operator
    logged_y_mm: np.ndarray


class Recording(NamedTuple):
    """One uninterrupted capture: a condition, a name and the touches, all on one time grid of STEP_S."""

    condition: str
    name: str
    touches: list[Touch]


def plan(settings: Mapping) -> tuple[list[Recording], Callable[[Recording], dict]]:
    """Return all recordings, and the function that gives the logs of one (`logs_of`); settings: the block `touch`."""
    scene, sensor, radius = settings["simulate"], settings["sensor"], settings["label"]["tip_radius_mm"]
    recordings = [
        *single_recordings(scene, sensor, radius),
        *double_recordings(scene, sensor, radius),
        *demonstration_recordings(scene, sensor, radius),
    ]
    # Resets strike the first recordings; the others show the array undisturbed.
    resets = {recording.name for recording in recordings[: scene["faults"]["resets"]]}

    def logs(recording: Recording) -> dict:
        reset = recording.condition == "single" and recording.name in resets
        return logs_of(recording, scene, sensor, radius, reset)

    return recordings, logs


def tip_area_m2(tip_radius_mm: float) -> float:
    """Return the area of the flat tip that turns force into the pressure of the labels."""
    return np.pi * (tip_radius_mm * 1e-3) ** 2


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
        for key in ("approach_s", "hold_s", "release_s", "travel_s")
    }


def steady(force: np.ndarray, x: np.ndarray | float, y: np.ndarray | float) -> Touch:
    """Return a touch whose devices log the true force and place."""
    x, y = np.broadcast_to(x, force.shape), np.broadcast_to(y, force.shape)
    return Touch(force, x, y, force, x, y)


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
        for x, y in points:
            for level in rng.permutation(levels):
                kpa = level * (1 + pressure["location_spread"] * rng.uniform(-1, 1))
                presses.append((kpa * 1e3 * area, x, y))
    recordings = []
    size, rest = plan["presses_per_recording"], np.zeros(round(START_S / STEP_S))
    for number, first in enumerate(range(0, len(presses), size)):
        group = presses[first : first + size]
        profiles = []
        for newtons, _, _ in group:
            duration = varied(settings["press"], rng)
            travel = np.zeros(round(duration["travel_s"] / STEP_S))
            profiles.append(np.concatenate([travel, newtons * press_profile(duration)]))
        steps = [len(profile) for profile in profiles]
        steps[0] += len(rest)
        steps[-1] += len(rest)
        _, x, y = (np.repeat(column, steps) for column in zip(*group, strict=True))
        touch = steady(np.concatenate([rest, *profiles, rest]), x, y)
        recordings.append(Recording("single", f"run{number:03d}", [touch]))
    return recordings


def double_recordings(settings: Mapping, sensor: Mapping, tip_radius_mm: float) -> list[Recording]:
    """Return double-touch data: the CNC presses one element while a hand-held load cell presses another.

    The two elements are at least one element apart (the load cells would collide). The hand is slower, presses
    near the centre of its element but slightly shifted and tilted: its load cell feels F cos(tilt), the centre of
    pressure moves by r sin(tilt), and the label keeps the intended place, as in the paper (section II-B).
    """
    rng = generator(settings["seed"], "double")
    pressure, hand, pitch = settings["pressure"], settings["hand"], sensor["pitch_mm"]
    area = tip_area_m2(tip_radius_mm)
    elements = [(r, c) for r in range(sensor["rows"]) for c in range(sensor["cols"])]
    pairs = [(a, b) for a in elements for b in elements if max(abs(a[0] - b[0]), abs(a[1] - b[1])) >= 2]
    recordings = []
    for number in range(settings["double"]["recordings"]):
        pieces: list[tuple[np.ndarray, ...]] = []
        for _ in range(settings["double"]["presses_per_recording"]):
            (row, col), (row2, col2) = pairs[rng.integers(len(pairs))]
            machine_n, hand_n = rng.uniform(pressure["lowest_kpa"], pressure["highest_kpa"], 2) * 1e3 * area
            by_hand = varied(settings["press"], rng, slower=hand["slower"])
            by_machine = varied(settings["press"], rng)
            slow = hand_n * press_profile(by_hand)
            by_machine["hold_s"] = len(slow) * STEP_S * rng.uniform(0.8, 1.2)
            fast = machine_n * press_profile(by_machine)
            late = rng.integers(0, round(0.3 / STEP_S))
            lead = round(by_machine["travel_s"] / STEP_S) + round(0.2 / STEP_S)
            steps = lead + max(len(fast), late + len(slow)) + round(0.2 / STEP_S)
            first, second = np.zeros(steps), np.zeros(steps)
            first[lead : lead + len(fast)] = fast
            second[lead + late : lead + late + len(slow)] = slow
            place = rng.integers(0, 4, 2)  # one of the 4 x 4 label cells of the element
            x, y = (col + (place[0] + 0.5) / 4) * pitch, (row + (place[1] + 0.5) / 4) * pitch
            x2, y2 = (col2 + 0.5) * pitch, (row2 + 0.5) * pitch
            tilt = np.radians(abs(rng.normal(0, hand["tilt_deg"])))
            towards = rng.uniform(0, 2 * np.pi)
            slip = rng.normal(0, hand["shift_mm"], 2)
            if not settings["effects"]["hand_error"]:
                tilt, slip = 0.0, np.zeros(2)
            lean = tip_radius_mm * np.sin(tilt)
            values = (first, x, y, second, x2 + slip[0] + lean * np.cos(towards))
            values += (y2 + slip[1] + lean * np.sin(towards), second * np.cos(tilt), x2, y2)
            pieces.append(tuple(np.broadcast_to(value, steps) for value in values))
        rest = round(START_S / STEP_S)
        joined = []
        for index, column in enumerate(zip(*pieces, strict=True)):
            force = index in (0, 3, 6)
            ends = [np.full(rest, 0.0 if force else column[place][place]) for place in (0, -1)]
            joined.append(np.concatenate([ends[0], *column, ends[1]]))
        first, x, y, second, true_x, true_y, felt, x2, y2 = joined
        touches = [steady(first, x, y), Touch(second, true_x, true_y, felt, x2, y2)]
        recordings.append(Recording("double", f"run{number:03d}", touches))
    return recordings


def demonstration_recordings(settings: Mapping, sensor: Mapping, tip_radius_mm: float) -> list[Recording]:
    """Return the three demonstrations of section IV-E: three touches, two sliding touches, a rolled tape.

    The tape is a line of five contacts over neighbouring elements whose load falls from left to right (the thumb
    lifts the right side). The paper shows pictures only; the logged truth here exists because we simulate.
    """
    rng = generator(settings["seed"], "demonstrations")
    newton = 1e3 * tip_area_m2(tip_radius_mm)  # per kPa
    width, height = sensor["cols"] * sensor["pitch_mm"], sensor["rows"] * sensor["pitch_mm"]
    rest = np.zeros(round(START_S / STEP_S))

    def event(peaks_kpa: list[float], ends: list[tuple[float, float, float, float]], seconds: float):
        """Return (force, x, y), (steps,) each, of every touch of one event."""
        profile = press_profile({"approach_s": 0.25, "hold_s": seconds, "release_s": 0.25})
        profile = np.concatenate([rest, profile])
        along = np.clip(np.linspace(-len(rest) / len(profile), 1, len(profile)), 0, 1)
        return [
            (kpa * newton * profile, (x0 + (x1 - x0) * along) * width, (y0 + (y1 - y0) * along) * height)
            for kpa, (x0, y0, x1, y1) in zip(peaks_kpa, ends, strict=True)
        ]

    scenes = {
        "three": ([220, 280, 180], [(0.3, 0.3, 0.3, 0.3), (0.7, 0.3, 0.7, 0.3), (0.5, 0.7, 0.5, 0.7)], 0.6),
        "slide": ([220, 220], [(0.15, 0.2, 0.85, 0.2), (0.85, 0.8, 0.15, 0.8)], 2.0),
        "tape": (
            [180, 150, 120, 90, 60],
            [(0.26 + 0.12 * k, 0.5, 0.26 + 0.12 * k, 0.5) for k in range(5)],
            0.8,
        ),
    }
    recordings = []
    for name, (peaks, ends, seconds) in scenes.items():
        events = []
        for _ in range(settings["demonstrations"]["repetitions"]):
            scale = rng.uniform(0.9, 1.1)
            events.append(event([peak * scale for peak in peaks], ends, seconds * rng.uniform(0.8, 1.2)))
        touches = []
        for pieces in zip(*events, strict=True):
            force, x, y = (np.concatenate(column) for column in zip(*pieces, strict=True))
            touches.append(
                steady(
                    np.concatenate([force, rest]),
                    np.concatenate([x, np.full(len(rest), x[-1])]),
                    np.concatenate([y, np.full(len(rest), y[-1])]),
                )
            )
        recordings.append(Recording(name, "run000", touches))
    return recordings


def element_loads(recording: Recording, settings: Mapping, sensor: Mapping, tip_radius_mm: float) -> np.ndarray:
    """Return the force on each element, (steps, rows * cols) in N, row-major from the bottom row.

    The share of a touch at (x, y) on the element [a, b] x [c, d] is
    (Phi((b - x) / s) - Phi((a - x) / s)) (Phi((d - y) / s) - Phi((c - y) / s)).
    """
    pitch, half = sensor["pitch_mm"], sensor["element_mm"] / 2
    spread = np.hypot(tip_radius_mm / 2, settings["contact"]["silicone_spread_mm"])
    loads = 0.0
    for touch in recording.touches:
        shares = []
        for position, count in ((touch.y_mm, sensor["rows"]), (touch.x_mm, sensor["cols"])):
            centre = (np.arange(count) + 0.5) * pitch
            away = centre - position[:, None]  # (steps, count)
            if settings["effects"]["load_sharing"]:
                shares.append(ndtr((away + half) / spread) - ndtr((away - half) / spread))
            else:
                shares.append((np.abs(away) <= pitch / 2).astype(float))
        loads = loads + touch.force_n[:, None, None] * shares[0][:, :, None] * shares[1][:, None, :]
    return loads.reshape(len(loads), -1)


def array_voltage(loads: np.ndarray, settings: Mapping, sensor: Mapping) -> np.ndarray:
    """Return the voltage at the ADC for every element, (steps, elements) in V, for loads (steps, elements) in N.

    One specimen of the array per scene seed: gain and exponent of each element are drawn once.
    """
    effects, chosen, circuit = settings["effects"], settings["material"], settings["circuit"]
    elements = sensor["rows"] * sensor["cols"]
    specimen = generator(settings["seed"], "specimen")
    gain = np.exp(specimen.normal(0, chosen["gain_spread"], elements))
    exponent = 1 + specimen.normal(0, chosen["exponent_spread"], elements)
    if not effects["element_spread"]:
        gain, exponent = np.ones(elements), np.ones(elements)
    log_ohm = material.log_resistance(
        material.load_material(),
        loads,
        STEP_S,
        gain=gain,
        exponent=exponent,
        creep=effects["creep"],
        hysteresis=effects["hysteresis"],
        release=effects["release"],
    )
    conductance = np.exp(-log_ohm) / chosen["resistance_scale_ohm"]
    return readout.column_voltage(
        conductance.reshape(len(loads), sensor["rows"], sensor["cols"]),
        reference_s=1 / circuit["reference_ohm"],
        supply_v=circuit["supply_v"],
        crosstalk=effects["crosstalk"],
    ).reshape(len(loads), -1)


def sampled(values: np.ndarray, at_s: np.ndarray) -> np.ndarray:
    """Interpolate `values` on the STEP_S grid, (steps,) or (steps, n), at the times `at_s`."""
    place = np.clip(at_s / STEP_S, 0, len(values) - 1)
    below = np.minimum(place.astype(int), len(values) - 2)
    part = place - below
    if values.ndim == 2:
        part = part[:, None]
    return values[below] * (1 - part) + values[below + 1] * part


def device_clock(
    duration_s: float, rate_hz: float, devices: Mapping, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """Draw true sample times and the device's own microseconds: another start, another zero, a slow drift."""
    start = rng.uniform(0, devices["clock_offset_s"])
    times = np.arange(start, duration_s, 1 / rate_hz)
    drift = 1 + devices["clock_drift_ppm"] * 1e-6 * rng.uniform(-1, 1)
    boot_us = rng.integers(2_000_000, 60_000_000)
    return times, boot_us + np.round((times - start) * drift * 1e6).astype(np.int64)


def logs_of(
    recording: Recording, settings: Mapping, sensor: Mapping, tip_radius_mm: float, reset: bool
) -> dict[str, tuple[list[str], list[Fault]]]:
    """Return the raw logs of one recording: file name -> (lines without line ends, injected faults).

    reset: whether the array's microcontroller restarts in the middle (its clock goes back to zero).
    """
    rng = generator(settings["seed"], recording.condition, recording.name)
    devices, effects = settings["devices"], settings["effects"]
    circuit, rates = settings["circuit"], settings["faults"]
    voltage = array_voltage(element_loads(recording, settings, sensor, tip_radius_mm), settings, sensor)
    duration = (len(voltage) - 1) * STEP_S
    logs: dict[str, tuple[list[str], list[Fault]]] = {}

    def finish(name: str, banner: list[str], lines: list[str]) -> None:
        """Put faults into a log's lines, behind its banner, and keep it."""
        faults: list[Fault] = []
        if effects["line_faults"]:
            lines, faults = inject(lines, rates, rng)
        shifted = [Fault(fault.line + len(banner), fault.kind) for fault in faults]
        logs[name] = (banner + lines, [Fault(k + 1, "banner") for k in range(len(banner))] + shifted)

    times, clock = device_clock(duration, devices["array_hz"], devices, rng)
    read = sampled(voltage, times)
    noise = rng.normal(0, circuit["noise_counts"], read.shape) if effects["noise"] else 0.0
    values = readout.counts(read, supply_v=circuit["supply_v"], levels=circuit["adc_levels"], noise=noise)
    banner = [f"tactile array {sensor['rows']}x{sensor['cols']} ready"]
    whole = [f"{t}," + ",".join(map(str, row)) for t, row in zip(clock, values, strict=True)]
    if reset and effects["line_faults"]:
        cut = len(whole) // 2
        resume = cut + round(BOOT_S * devices["array_hz"])
        restarted = clock[resume:] - clock[resume] + 350_000  # the sketch prints 0.35 s after power-up
        again = [f"{t}," + ",".join(map(str, row)) for t, row in zip(restarted, values[resume:], strict=True)]
        before, faults_before = inject(whole[:cut], rates, rng)
        after, faults_after = inject(again, rates, rng)
        base = len(banner) + len(before)
        faults = [Fault(1, "banner")] + [Fault(f.line + 1, f.kind) for f in faults_before]
        faults += [Fault(base + 1, "banner"), Fault(base + 2, "reset")]
        faults += [Fault(f.line + base + 1, f.kind) for f in faults_after]
        logs["array.log"] = (banner + before + banner + after, faults)
    else:
        finish("array.log", banner, whole)

    for number, touch in enumerate(recording.touches, start=1):
        suffix = "" if number == 1 else f"_{number}"
        if number == 1:
            cell_times, cell_clock = device_clock(duration, devices["load_cell_hz"], devices, rng)
            cnc_times, cnc_clock = device_clock(duration, devices["cnc_hz"], devices, rng)
        else:  # further load cells and the targets shown to the operator share the first cell's computer
            rate = devices["load_cell_hz"] / devices["cnc_hz"]
            picks = np.unique(np.floor(np.arange(0, len(cell_times), rate)).astype(int))
            cnc_times, cnc_clock = cell_times[picks], cell_clock[picks]
        force = sampled(touch.logged_force_n, cell_times)
        if effects["noise"]:
            force = force + rng.normal(0, devices["force_noise_n"], len(force))
        finish(
            f"load_cell{suffix}.log",
            [],
            [f"{t},{value:.3f}" for t, value in zip(cell_clock, force, strict=True)],
        )
        kpa = np.maximum(sampled(touch.force_n, cnc_times), 0) / (1e3 * tip_area_m2(tip_radius_mm))
        depth = MILLIMETRE_PER_PRESSURE_ROOT * kpa ** (1 / DRAGON_SKIN_EXPONENT)
        place = (sampled(touch.logged_x_mm, cnc_times), sampled(touch.logged_y_mm, cnc_times), -depth)
        finish(
            f"cnc{suffix}.log",
            [],
            [f"{t},{x:.3f},{y:.3f},{z:.3f}" for t, x, y, z in zip(cnc_clock, *place, strict=True)],
        )
    return logs
