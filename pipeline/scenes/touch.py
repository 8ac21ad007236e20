"""Simulate fingertip-like presses on a 5x5 Velostat array, as the raw logs that three devices print.

A chain of named effects, each with a switch in params.yaml (touch.simulate.effects):

    press (CNC or hand) -> contact pressure -> load on each element -> Velostat -> column circuit -> ADC -> log

Motion. `touch_motion.py`. Contact. `touch_contact.py`. Velostat. `material.py`, fitted to recordings of a Velostat
taxel under a load cell. Circuit. `readout.py`, exact for the read-out of figure 2c of the LoMP paper; the elements are
read one after the other (`read_us`: 13 cycles of the ADC's 125 kHz clock and the call, Arduino's analogRead).
Two seeds: `specimen` draws the array (how the film differs from place to place), `seed` all else, so that runs with the
same motions or with the same array can be compared. There are `specimens` arrays, each with motions of its own.

Differs from paper: the array is simulated. The tip's radius is not given there: 5 mm keeps 400 kPa within the 40 N of
the recordings that the material was fitted to. The resistances of figure 2b are not printed as numbers either, and the
recorded taxel is another one (13 x 15 mm, another tip): `material.resistance_scale_ohm` matches the array to its
330 ohm resistor as a divider is laid out for the widest span: that resistor is the geometric mean of an element's
resistances at the lowest and at the highest pressure (80 and 11 ohm of the taxel, so 11 times as much).
"""

import functools
from collections.abc import Callable, Mapping, Set

import numpy as np

from pipeline.scenes import material, readout
from pipeline.scenes.faults import Fault, inject
from pipeline.scenes.touch_contact import Loads, element_loads, tip_area_m2
from pipeline.scenes.touch_motion import (
    DRAGON_SKIN_EXPONENT,
    STEP_S,
    Recording,
    demonstration_recordings,
    double_recordings,
    single_recordings,
)
from tactile.datasets import specimens
from tactile.datasets.seeding import generator

BOOT_S = 1.2  # silence of the array's microcontroller after a reset
MILLIMETRE_PER_PRESSURE_ROOT = 0.03  # 400 kPa at 1.6 mm depth: scales z in the CNC's log, nothing else


def plan(settings: Mapping) -> tuple[list[Recording], Callable[[Recording], dict]]:
    """Return all recordings, and the function that gives the logs of one (`logs_of`); settings: the block `touch`."""
    scene, sensor, radius = settings["simulate"], settings["sensor"], settings["label"]["tip_radius_mm"]
    recordings, resets = [], set()
    for specimen in range(scene["specimens"]):
        of_specimen = specimens.drawn(scene, specimen)
        planned = [
            recording._replace(name=specimens.named(specimen, recording.name))
            for make in (single_recordings, double_recordings, demonstration_recordings)
            for recording in make(of_specimen, sensor, radius)
        ]
        # Resets strike the first recordings of an array; the others show the array undisturbed.
        resets |= {recording.name for recording in planned[: scene["faults"]["resets"]]}
        recordings += planned
    return recordings, functools.partial(_planned_logs, settings=scene, sensor=sensor, resets=resets)


def _planned_logs(recording: Recording, settings: Mapping, sensor: Mapping, resets: Set[str]) -> dict:
    """Return the logs of one recording of a plan; resets: the names of the single recordings with a reset."""
    reset = recording.condition == "single" and recording.name in resets
    return logs_of(recording, specimens.drawn(settings, specimens.number(recording.name)), sensor, reset)


def array_voltage(loads: Loads, settings: Mapping, sensor: Mapping) -> np.ndarray:
    """Return the voltage at the ADC for every element, (steps, elements) in V; settings: the block touch.simulate."""
    effects, circuit = settings["effects"], settings["circuit"]
    log_ohm = material.log_resistance(
        material.load_material(),
        loads.force_n,
        STEP_S,
        gain=loads.gain,
        exponent=loads.exponent,
        creep=effects["creep"],
        slow_creep=effects["slow_creep"],
        hysteresis=effects["hysteresis"],
        release=effects["release"],
    )
    conductance = np.exp(-log_ohm) / settings["material"]["resistance_scale_ohm"]
    return readout.column_voltage(
        conductance.reshape(-1, sensor["rows"], sensor["cols"]),
        reference_s=1 / circuit["reference_ohm"],
        supply_v=circuit["supply_v"],
        crosstalk=effects["crosstalk"],
        driver_ohm=circuit["driver_ohm"] if effects["row_sag"] else 0.0,
    ).reshape(log_ohm.shape)


def sampled(values: np.ndarray, at_s: np.ndarray) -> np.ndarray:
    """Interpolate `values` on the STEP_S grid, (steps,) or (steps, n), at the times `at_s`, (m,) or (m, n)."""
    place = np.clip(at_s / STEP_S, 0, len(values) - 1)
    below = np.minimum(place.astype(int), len(values) - 2)
    part = place - below
    if values.ndim == 1:
        return values[below] * (1 - part) + values[below + 1] * part
    column = np.arange(values.shape[1])
    return values[below, column] * (1 - part) + values[below + 1, column] * part


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
    recording: Recording, settings: Mapping, sensor: Mapping, reset: bool
) -> dict[str, tuple[list[str], list[Fault]]]:
    """Return the raw logs of one recording: file name -> (lines without line ends, injected faults).

    reset: whether the array's microcontroller restarts in the middle (its clock goes back to zero).
    """
    rng = generator(settings["seed"], recording.condition, recording.name)
    devices, effects = settings["devices"], settings["effects"]
    circuit, rates = settings["circuit"], settings["faults"]
    repeats = generator(settings["seed"], recording.condition, recording.name, "repeats")
    voltage = array_voltage(element_loads(recording.touches, settings, sensor, repeats), settings, sensor)
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
    after = np.arange(voltage.shape[1]) * circuit["read_us"] * 1e-6 * effects["scan_time"]
    read = sampled(voltage, times[:, None] + after)
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
        kpa = np.maximum(sampled(touch.force_n, cnc_times), 0) / (1e3 * tip_area_m2(touch.radius_mm))
        depth = MILLIMETRE_PER_PRESSURE_ROOT * kpa ** (1 / DRAGON_SKIN_EXPONENT)
        place = (sampled(touch.logged_x_mm, cnc_times), sampled(touch.logged_y_mm, cnc_times), -depth)
        finish(
            f"cnc{suffix}.log",
            [],
            [f"{t},{x:.3f},{y:.3f},{z:.3f}" for t, x, y, z in zip(cnc_clock, *place, strict=True)],
        )
    return logs
