"""Simulate passive fingers with conductive-elastomer strands on an arm, as the raw logs of DAQ and robot.

A chain of named effects, each with a switch in params.yaml (strain.simulate.effects):

    arm -> contact with friction -> bending of the finger -> strain -> strand -> voltage divider -> DAQ -> log

A specimen is a finger on its surface: gains and angles of its strands, friction. Recording `run<k>` of every task is of
specimen number `specimen` + k, with a motion, drift, noise and line faults of its own.

Lengths in mm, dt the step in s. a = (x, y) is the arm's place, D = -z the depth by which the finger is pressed onto
the surface (z = 0: it just touches), p the place of the finger's tip on the surface.

1. Contact. The tip sticks until the elastic force of the bent finger exceeds static friction, then slips until only
   kinetic friction is left, at once compared to dt (stick-slip of a spring-driven slider with two coefficients of
   friction, e.g. Persson, Sliding Friction, 2000):

       u = a - p;   if k |u| > mu_s N:   |u| <- mu_k N / k, direction kept, p <- a - u;   N = n D.

   So u shows how the finger is dragged, not where the arm is: absolute x and y must be summed from slips, as the
   paper says. Without `stick_slip`, mu_s = mu_k: the finger is dragged without jumps. With `friction_spread` both
   coefficients are multiplied by G(p) (1 + A cos(angle between u and a direction of the skin)): ln G is a smooth random
   field over the surface of standard deviation `friction_spread` and correlation length `friction_length_mm`, A is
   `friction_direction`.
2. Bending. Pressing bends the finger in x, for it stands at an angle, and shortens it. The arm does not hold its
   pose exactly: over the surface the finger leans by `lean` mm of bending per mm of x and y (0.02 is 1.1 degrees):

       B_x = u_x + b D + lean x,     B_y = u_y + lean y.

   Only the lean and G depend on the absolute place. Both are small: the lean has 1.4 mm at the edge, drag 7 to 12 mm.
3. Strand i at the angle phi_i around the finger, with its own length and so its own gain g_i. It lies in the finger
   with some slack b_0, and stretches by what bends it further; bent the other way it only becomes slacker:

       e_i = s g_i max(B_x cos phi_i + B_y sin phi_i - c D - b_0, 0),          relative change of resistance.

4. Relaxation. Whatever deforms a strand breaks conductive paths, which form again with two times T: resistance jumps
   up at every change of strain and falls back while nothing moves (conductive paths in carbon-filled elastomers:
   Flandin et al., Polymer 42, 2001). How many break varies by chance, by a factor F of mean 1 and a log-normal spread
   (Ornstein-Uhlenbeck, correlation time `break_time_s`):

       r = e + h_1 + h_2,     h_k <- exp(-dt / T_k) h_k + w_k F(t) |e(t) - e(t - dt)|.

5. Asymmetry. Unloading lags behind loading:

       m <- m + (1 - exp(-dt / T)) (r - m),     T = T_loading where r > m, else T_unloading.

6. Drift d_i of the resistance at rest, beside h: a stationary random process of the strand's own (Ornstein-Uhlenbeck,
   correlation time `wander_time_s`), and ageing with the logarithm of time, a_i = 0.5 to 1.5:

       d_i = wander O_i(t) + ageing a_i ln(1 + t / T_ageing).

7. Voltage divider with the reference resistor R_ref at the supply: V = supply R / (R + R_ref), R = R_0 (1 + m + d).

3, 4, 6 and the noise are fitted to strain-sensor recordings of one of the paper's authors (reports/twins; 30 and 31
July 2019). What drifts there is the voltage at rest, and it drifts because the strands are used: it is correlated by
0.8 with that before the previous press, by 0.2 with that 20 presses earlier and not at all after 200; its strand's own
earlier responses explain 0.6 of its variance, and between presses it only falls back. That takes strands that answer to
some of the presses: for those that answer to compression as to stretch it is 0.1, without slack 0.55. Means over 150 s
of two strands are hardly correlated, so that no drift is shared. A random walk, which grows for hours, is not in
the recordings, and noise that wanders within seconds would exceed the 2 mV between two readings.
`motion.press_fastest_mm_s` is then set by strain.yardstick: the paper does not give the arm's speed, and the faster the
arm, the more paths break. All other numbers are plain engineering numbers.
Differs from paper: the fingers, their surface and all their numbers are simulated; the paper gives none of them.
Differs from paper: the motion is straight strokes between random places at random speeds, with rests; the paper says
only that motions are random, within 140 x 80 x 10 mm, and that the velocity is restricted.
"""

import functools
from collections.abc import Callable, Mapping, Sequence
from itertools import accumulate
from typing import NamedTuple

import numpy as np
from scipy.signal import lfilter

from pipeline.scenes.faults import Fault, inject
from tactile.datasets.seeding import generator

STEP_S = 0.05  # the arm moves up to 0.6 mm in it, the finger slips by 5 mm at a time
TASKS = ("task_0", "task_1", "task_2")
HIGHEST_V = 10.0  # range of the DAQ
WAVES = 64  # of a random field
CELL_MM = 2.0  # of the table of a surface's friction; the finger slips by 5 mm at a time


class Recording(NamedTuple):
    """One uninterrupted capture: a condition, a name, the finger's number and the arm's path on a grid of STEP_S."""

    condition: str
    name: str
    specimen: int
    place_mm: np.ndarray  # (steps, 3): x, y, z


class Surface(NamedTuple):
    """How the friction of one specimen differs from the mean: factor = grip(place) * (1 + along . direction)."""

    grip: np.ndarray  # (cells in x, cells in y) of CELL_MM, around x = y = 0
    along: tuple[float, float]


def plan(settings: Mapping) -> tuple[list[Recording], Callable[[Recording], dict]]:
    """Return all recordings, and the function that gives the logs of one (`logs_of`); settings: the block `strain`."""
    scene, strands = settings["simulate"], settings["sensor"]["channels"]
    return recordings(scene), functools.partial(logs_of, settings=scene, strands=strands)


def recordings(settings: Mapping) -> list[Recording]:
    """Return one recording per task and specimen, run000 of all tasks first; settings: the block strain.simulate."""
    return [
        recording_of(settings, task, f"run{k:03d}", settings["specimen"] + k)
        for k in range(settings["specimens"])
        for task in TASKS
    ]


def recording_of(settings: Mapping, task: str, name: str, specimen: int) -> Recording:
    """Return one recording; settings: the block strain.simulate.

    task_0 moves in x, y and z, task_1 in z alone, task_2 in x and y at a fixed depth (section III-B).
    """
    motion, devices = settings["motion"], settings["devices"]
    # Room for the start of the devices and the samples lost in gaps, so that the DAQ takes `samples` in all.
    seconds = settings["samples"] / devices["daq_hz"] + devices["clock_offset_s"] + gap_seconds(settings) + 1
    half = np.array([motion["width_mm"], motion["height_mm"]]) / 2
    slide = motion["slide_slowest_mm_s"], motion["slide_fastest_mm_s"]
    press = motion["press_slowest_mm_s"], motion["press_fastest_mm_s"]
    place = np.zeros((round(seconds / STEP_S), 3))
    place[:, 2] = -motion["sliding_depth_mm"]
    rng = generator(settings["seed"], task, name, "motion")
    if task != "task_1":
        place[:, :2] = path(len(place), -half, half, slide, motion["rest_s"], rng)
    if task != "task_2":
        lowest = np.array([-motion["depth_mm"]])
        place[:, 2:] = path(len(place), lowest, np.zeros(1), press, motion["rest_s"], rng)
    return Recording(task, name, specimen, place)


def path(
    steps: int, low: np.ndarray, high: np.ndarray, speeds: tuple[float, float], rest_s: float, rng: np.random.Generator
) -> np.ndarray:
    """Draw straight strokes between random places in [low, high] (dims,), (steps, dims) in mm.

    Each stroke has a speed of its own within `speeds` (mm/s), and a rest of up to twice `rest_s` follows it.
    """
    place = (low + high) / 2
    time, places = [0.0], [place]
    while time[-1] < steps * STEP_S:
        following = rng.uniform(low, high)
        moved = time[-1] + np.linalg.norm(following - place) / rng.uniform(*speeds)
        time += [moved, moved + rng.uniform(0, 2 * rest_s) + 1e-9]
        places += [following, following]
        place = following
    at = np.arange(steps) * STEP_S
    return np.column_stack([np.interp(at, time, column) for column in np.transpose(places)])


def surface_of(specimen: int, half_mm: Sequence[float], finger: Mapping) -> Surface:
    """Draw the friction of a specimen over places within +-half_mm (2,)."""
    rng = generator(specimen, "surface")
    wave = rng.normal(0, 1 / finger["friction_length_mm"], (WAVES, 2))
    shift = rng.uniform(0, 2 * np.pi, WAVES)
    x, y = (np.arange(-cells, cells + 1) * CELL_MM for cells in np.ceil(np.array(half_mm) / CELL_MM).astype(int))
    field = np.zeros((len(x), len(y)))
    for (a, b), start in zip(wave, shift, strict=True):
        field += np.cos(a * x[:, None] + b * y + start)
    grip = np.exp(finger["friction_spread"] * np.sqrt(2 / WAVES) * field)
    direction = rng.uniform(0, 2 * np.pi)
    along = finger["friction_direction"] * np.cos(direction), finger["friction_direction"] * np.sin(direction)
    return Surface(grip, along)


EVEN = Surface(np.ones((1, 1)), (0.0, 0.0))


def deflection(place_mm: np.ndarray, finger: Mapping, stick_slip: bool, surface: Surface = EVEN) -> np.ndarray:
    """Return u of equation 1, (steps, 2) in mm, for a path (steps, 3); the finger is put down unbent."""
    depth = -place_mm[:, 2]
    most = finger["normal_n_per_mm"] * np.maximum(depth, 0) / finger["stiffness_n_per_mm"]
    kinetic = (finger["kinetic_friction"] * most).tolist()
    static = (finger["static_friction"] * most).tolist() if stick_slip else kinetic
    arm_x, arm_y = place_mm[:, 0].tolist(), place_mm[:, 1].tolist()
    tip_x, tip_y = arm_x[0], arm_y[0]
    grip, (along_x, along_y) = surface.grip.tolist(), surface.along
    last_x, last_y = len(grip) - 1, len(grip[0]) - 1
    bent = []
    for x, y, holds, left in zip(arm_x, arm_y, static, kinetic, strict=True):
        dx, dy = x - tip_x, y - tip_y
        length = (dx * dx + dy * dy) ** 0.5
        if length:
            cell_x = min(max(round(tip_x / CELL_MM + last_x / 2), 0), last_x)
            cell_y = min(max(round(tip_y / CELL_MM + last_y / 2), 0), last_y)
            factor = grip[cell_x][cell_y] * (1 + (along_x * dx + along_y * dy) / length)
            if length > holds * factor:
                dx, dy = dx * left * factor / length, dy * left * factor / length
                tip_x, tip_y = x - dx, y - dy
        bent.append((dx, dy))
    return np.array(bent)


def angles_deg(strands: int) -> np.ndarray:
    """Return phi, (strands,), before the spread of manual placement: six are 60 degrees apart.

    Fewer are the first of the six, in an order in which three are 120 degrees apart.
    """
    k = np.arange(strands)
    return 10.0 + 120 * (k % 3) + 60 * (k // 3 % 2) + 30 * (k // 6)


def strains(recording: Recording, settings: Mapping, strands: int) -> np.ndarray:
    """Return e of equation 3, (steps, strands), of a recording; settings: the block strain.simulate."""
    finger, strand, motion = settings["finger"], settings["strand"], settings["motion"]
    place_mm, depth = recording.place_mm, -recording.place_mm[:, 2]
    surface = EVEN
    if settings["effects"]["friction_spread"]:
        surface = surface_of(recording.specimen, (motion["width_mm"] / 2, motion["height_mm"] / 2), finger)
    u = deflection(place_mm, finger, settings["effects"]["stick_slip"], surface)
    bent_x = u[:, 0] + finger["press_bending"] * depth + finger["lean"] * place_mm[:, 0]
    bent_y = u[:, 1] + finger["lean"] * place_mm[:, 1]
    gain = np.exp(generator(recording.specimen, "gain").normal(0, strand["gain_spread"], strands))
    shift = generator(recording.specimen, "angle").normal(0, strand["angle_spread_deg"], strands)
    angle = np.radians(angles_deg(strands) + shift)
    bending = np.outer(bent_x, np.cos(angle)) + np.outer(bent_y, np.sin(angle))
    stretch = np.maximum(bending - finger["compression"] * depth[:, None] - strand["slack_mm"], 0)
    return strand["sensitivity_per_mm"] * gain * stretch


def relaxed(strain: np.ndarray, strand: Mapping, rng: np.random.Generator) -> np.ndarray:
    """Return r of equation 4 for e (steps, strands); nothing has moved before."""
    moved = np.abs(np.diff(strain, axis=0, prepend=strain[:1]))
    spread = strand["break_spread"]
    moved *= np.exp(spread * wander(*strain.shape, strand["break_time_s"], rng) - spread**2 / 2)
    result = strain.copy()
    for share, time in (("fast_share", "fast_time_s"), ("slow_share", "slow_time_s")):
        result += lfilter([strand[share]], [1, -np.exp(-STEP_S / strand[time])], moved, axis=0)
    return result


def asymmetric(response: np.ndarray, strand: Mapping) -> np.ndarray:
    """Return m of equation 5 for r (steps, strands), from m = r."""
    rise, fall = (1 - np.exp(-STEP_S / strand[way]) for way in ("loading_time_s", "unloading_time_s"))

    def follow(m: float, r: float) -> float:
        return m + (rise if r > m else fall) * (r - m)

    return np.column_stack([list(accumulate(column.tolist(), follow)) for column in response.T])


def wander(steps: int, strands: int, time_s: float, rng: np.random.Generator) -> np.ndarray:
    """Draw Ornstein-Uhlenbeck processes of standard deviation 1 and correlation time `time_s`, (steps, strands)."""
    keep = np.exp(-STEP_S / time_s)
    drawn = rng.standard_normal((strands, 1 + steps)).T  # strand by strand, so that fewer are the first ones
    return lfilter([1], [1, -keep], np.sqrt(1 - keep**2) * drawn[1:], axis=0, zi=keep * drawn[:1])[0]


def drifts(steps: int, strands: int, settings: Mapping, rng: np.random.Generator) -> np.ndarray:
    """Draw d of equation 6, (steps, strands)."""
    if not settings["effects"]["drift"]:
        return np.zeros((steps, strands))
    drift = settings["drift"]
    ageing, walking = rng.spawn(2)
    age = np.log1p(np.arange(steps) * STEP_S / drift["ageing_time_s"])
    aged = drift["ageing"] * np.outer(age, ageing.uniform(0.5, 1.5, strands))
    return aged + drift["wander"] * wander(steps, strands, drift["wander_time_s"], walking)


def drift_at_samples(task: str, name: str, settings: Mapping, strands: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the times (n,) in s of a recording's samples, on the DAQ's clock, and d of equation 6, (n, strands).

    It is the drift that the logs of the recording have, drawn again; settings: the block strain.simulate.
    """
    steps = len(recording_of(settings, task, name, settings["specimen"]).place_mm)
    d = drifts(steps, strands, settings, generator(settings["seed"], task, name, "drift"))
    rng = generator(settings["seed"], task, name, "daq")
    times = daq_times(settings, rng)
    return own_clock(times, settings["devices"], rng), sampled(d, np.arange(steps) * STEP_S, times)


def sampled(values: np.ndarray, time_s: np.ndarray, at_s: np.ndarray) -> np.ndarray:
    """Return values (n, columns) of times (n,) at other times (k,), (k, columns), between which they are linear."""
    return np.column_stack([np.interp(at_s, time_s, column) for column in values.T])


def voltages(change: np.ndarray, circuit: Mapping) -> np.ndarray:
    """Return V of equation 7 for the relative change of resistance m + d; `reference_share` is R_ref / R_0."""
    resistance = 1 + change
    return circuit["supply_v"] * resistance / (resistance + circuit["reference_share"])


def gap_seconds(settings: Mapping) -> float:
    """Return the time in s for which the DAQ is silent in all."""
    return settings["faults"]["gaps"] * settings["faults"]["gap_s"] if settings["effects"]["line_faults"] else 0.0


def daq_times(settings: Mapping, rng: np.random.Generator) -> np.ndarray:
    """Draw the true times (samples,) in s at which the DAQ reads: jitter around a constant rate, and gaps."""
    devices, faults, effects = settings["devices"], settings["faults"], settings["effects"]
    start = rng.uniform(0, devices["clock_offset_s"])
    times = start + np.arange(settings["samples"]) / devices["daq_hz"]
    # Less than half an interval, so that samples stay in order.
    most = 0.45 / devices["daq_hz"]
    jitter = np.clip(rng.normal(0, devices["jitter_s"], len(times)), -most, most)
    jitter[0] = 0.0
    if effects["jitter"]:
        times += jitter
    places = rng.uniform(0.05, 0.95, faults["gaps"]) * len(times)
    if effects["line_faults"]:
        for place in places.astype(int):
            times[place:] += faults["gap_s"]
    return times


def own_clock(times: np.ndarray, devices: Mapping, rng: np.random.Generator) -> np.ndarray:
    """Return a device's own seconds since its first sample, with a slow drift, for true times (n,)."""
    return (times - times[0]) * (1 + devices["clock_drift_ppm"] * 1e-6 * rng.uniform(-1, 1))


def responses(strain: np.ndarray, recording: Recording, settings: Mapping) -> np.ndarray:
    """Return m of equation 5 for e, both (steps, strands); settings: the block strain.simulate."""
    if settings["effects"]["relaxation"]:
        rng = generator(settings["seed"], recording.condition, recording.name, "breaking")
        strain = relaxed(strain, settings["strand"], rng)
    return asymmetric(strain, settings["strand"]) if settings["effects"]["asymmetry"] else strain


def logs_of(recording: Recording, settings: Mapping, strands: int) -> dict[str, tuple[list[str], list[Fault]]]:
    """Return the raw logs of one recording: file name -> (lines without line ends, injected faults).

    settings: the block strain.simulate; strands: how many the finger has.
    `truth.csv` is no log: it has what every strand adds to its strain, m + d - e, at each sample of the DAQ, on its
    clock.
    """
    devices, effects = settings["devices"], settings["effects"]
    # One generator per purpose, so that switching one effect off leaves the others as they are.
    rng = {
        name: generator(settings["seed"], recording.condition, recording.name, name)
        for name in ("drift", "daq", "noise", "robot", "faults")
    }
    grid = np.arange(len(recording.place_mm)) * STEP_S
    strain = strains(recording, settings, strands)
    change = responses(strain, recording, settings) + drifts(len(grid), strands, settings, rng["drift"])

    times = daq_times(settings, rng["daq"])
    clock = own_clock(times, devices, rng["daq"])
    volts = sampled(voltages(change, settings["circuit"]), grid, times)
    if effects["noise"]:
        volts += rng["noise"].normal(0, settings["circuit"]["noise_v"], volts.shape)
    lines = {"daq.log": rows(clock, np.clip(volts, -HIGHEST_V, HIGHEST_V), 5)}
    start = rng["robot"].uniform(0, devices["clock_offset_s"])
    moments = np.arange(start, grid[-1], 1 / devices["robot_hz"])
    lines["robot.log"] = rows(own_clock(moments, devices, rng["robot"]), sampled(recording.place_mm, grid, moments), 3)

    logs: dict[str, tuple[list[str], list[Fault]]] = {}
    for name, whole in lines.items():
        logs[name] = inject(whole, settings["faults"], rng["faults"]) if effects["line_faults"] else (whole, [])
    header = ",".join(["t_s", *(f"drift{k}" for k in range(strands))])
    logs["truth.csv"] = ([header, *rows(clock, sampled(change - strain, grid, times), 7)], [])
    return logs


def rows(time_s: np.ndarray, values: np.ndarray, decimals: int) -> list[str]:
    """Return lines `t,v0,v1,...` for times (n,), to 0.1 ms, and values (n, columns)."""
    pattern = ",".join(["%.4f", *[f"%.{decimals}f"] * values.shape[1]])
    return [pattern % (t, *row) for t, row in zip(time_s.tolist(), values.tolist(), strict=True)]
