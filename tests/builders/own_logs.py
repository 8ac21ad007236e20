"""Write logs of sensors that the project has never seen, with faults, as other people's devices would write them.

Nothing here comes from the scenes: the pressing, the elements' answer and the devices' clocks are made up anew.
"""

import os
from pathlib import Path

import numpy as np

BANNER = "tactile array v2 ready"
# Names of folders that README allows: letters beyond ASCII; what CSV, Markdown, HTML, YAML and formulas of matplotlib
# give a meaning to; what pandas takes for a missing number, or for a number.
NAMES = ("$5_{ or $x", "zwei Finger größer", "90°", "double (two fingers)", "a,b", "NA", "001", "-rf #1: {c}")
NAMES += ("双指 👍", 'a|b *c* <d> `e` [f](g.png) "h" \\')
UNPRINTABLE = ("two\nlines", "\x1b[31mred", os.fsdecode(b"gr\xf6\xdfer"))  # refused


def stamped(time_s, values, pattern, start_us=0, drift_ppm=0.0):
    """Return lines `t_us,...` on a device's own clock for true times (n,) and values (n, columns)."""
    own = start_us + np.round((time_s - time_s[0]) * (1e6 + drift_ppm)).astype(np.int64)
    return [f"{t}," + ",".join(pattern % v for v in row) for t, row in zip(own, values, strict=True)]


def spoiled(lines, rng, every=400):
    """Return the lines with one torn, one doubled, one lost, one late and one noisy line in about every `every`."""
    lines = list(lines)
    for k in range(every, len(lines) - 100, every):
        place = k + int(rng.integers(-50, 50))
        lines[place] = lines[place][: len(lines[place]) // 2]
        lines.insert(place + 2, lines[place + 2])
        del lines[place + 5]
        lines[place + 6], lines[place + 7] = lines[place + 7], lines[place + 6]
        lines[place + 9] = "\x00\x1f" + lines[place + 9][3:]
    return lines


def pressing(seconds, width, height, rng):
    """Return (t on a 2 ms grid, force in N, x, y in mm): presses of varying depth and length at random places."""
    t = np.arange(0, seconds, 0.002)
    force, start, moves, places = np.zeros(len(t)), 1.0, [0.0], [(width / 2, height / 2)]
    while start < seconds - 1.5:
        knots = start + np.cumsum([0, 0.2, 0.35, 0.2]) * rng.uniform(0.8, 1.3)
        force += rng.uniform(5, 30) * np.interp(t, knots, [0, 1, 1, 0])
        place = rng.uniform(0.1, 0.9) * width, rng.uniform(0.1, 0.9) * height
        moves += [start - 0.02, knots[-1] + 0.05]
        places += [place, place]
        start = knots[-1] + rng.uniform(0.25, 0.5)
    x, y = (np.interp(t, moves, column) for column in np.transpose(places))
    return t, force, x, y


def touch(
    folder: Path,
    rows,
    cols,
    array_hz,
    pitch_mm=10.0,
    highest=1023,
    seconds=60.0,
    recordings=2,
    conditions=("double",),
    seed=0,
):
    """Write `<condition>/<recording>/*.log` of an array of rows x cols elements with its own load cell and CNC.

    conditions: those beside `single`, of one recording each; `double` has two touches at a time.
    """
    plan = [("single", f"day1_{k}", 1) for k in range(recordings)]
    plan += [(name, f"day 2, {name}", 2 if name == "double" else 1) for name in conditions]
    width, height = cols * pitch_mm, rows * pitch_mm
    centre_x = (np.arange(rows * cols) % cols + 0.5) * pitch_mm
    centre_y = (np.arange(rows * cols) // cols + 0.5) * pitch_mm
    for number, (condition, name, touches) in enumerate(plan):
        rng = np.random.default_rng([seed, number])
        target = folder / condition / name
        target.mkdir(parents=True)
        answer = np.full((round(seconds / 0.002), rows * cols), 12.0)
        for k in range(touches):
            t, force, x, y = pressing(seconds, width, height, rng)
            near = np.exp(-((x[:, None] - centre_x) ** 2 + (y[:, None] - centre_y) ** 2) / (0.8 * pitch_mm**2))
            answer += highest / 20 * force[:, None] ** 0.8 * near
            suffix = "" if k == 0 else f"_{k + 1}"
            at = np.arange(0.4, seconds, 1 / 80)
            cell = np.interp(at, t, force)[:, None] + rng.normal(0, 0.03, (len(at), 1))
            lines = stamped(at, cell, "%.3f", start_us=7_000_000)
            (target / f"load_cell{suffix}.log").write_text("t_us,fz_n\n" + "\n".join(spoiled(lines, rng)) + "\n")
            at = np.arange(0.1, seconds, 1 / 25)
            depth = -np.sqrt(np.interp(at, t, force) / 5)
            path = np.column_stack([np.interp(at, t, x), np.interp(at, t, y), depth])
            start = 400_000 if k == 0 else 6_700_000  # the second cnc log shares its load cell's clock
            (target / f"cnc{suffix}.log").write_text("\n".join(stamped(at, path, "%.2f", start)) + "\n")
        resets = ((0.9, 0.6 * seconds), (0.6 * seconds + 1.3, seconds))
        lines = []
        for number, (start, stop) in enumerate(resets):
            at = np.arange(start, stop, 1 / array_hz) + rng.uniform(0, 0.1 / array_hz)
            counts = np.column_stack([np.interp(at, t, column) for column in answer.T])
            counts = np.clip(np.rint(counts + rng.normal(0, 1, counts.shape)), 0, highest)
            whole = stamped(at, counts, "%d", start_us=150_000 + number, drift_ppm=25.0)
            lines += [BANNER, *spoiled(whole, rng)]
        (target / "array.log").write_bytes("\r\n".join(lines).encode("ascii") + b"\r\n" + lines[-1][:9].encode())


def strain(folder: Path, channels, rate_hz, seconds=240.0, seed=0):
    """Write `<task>/<recording>/{daq,robot}.log` of a sensor with `channels` strands; each device has its own clock."""
    rng = np.random.default_rng(seed)
    mixing = rng.normal(0, 1, (3, channels))
    for number, (task, moves) in enumerate({"task_0": (1, 1, 1), "task_1": (0, 0, 1), "task_2": (1, 1, 0)}.items()):
        rng = np.random.default_rng([seed, number])
        grid = np.arange(0, seconds + 4, 0.02)
        knots = np.concatenate([[0], np.cumsum(rng.uniform(0.8, 2.5, int(seconds)))])
        place = np.column_stack([np.interp(grid, knots, rng.uniform(-1, 1, len(knots))) for _ in range(3)]) * moves
        target = folder / task / NAMES[number]
        target.mkdir(parents=True)
        at = np.arange(1.2, seconds, 1 / rate_hz) + rng.uniform(-0.2, 0.2) / rate_hz
        at = np.delete(at, slice(len(at) // 3, len(at) // 3 + round(5 * rate_hz)))  # silent for 5 s
        late = np.column_stack([np.interp(at - 0.05, grid, column) for column in place.T])
        volts = 2.5 + 0.3 * late @ mixing + 1e-3 * at[:, None] + rng.normal(0, 1e-3, (len(at), channels))
        header = ",".join(["t_s", *(f"u{k}" for k in range(channels))])
        lines = [f"{t:.4f}," + ",".join(f"{v:.5f}" for v in row) for t, row in zip(at - at[0], volts, strict=True)]
        (target / "daq.log").write_text("\n".join([header, *spoiled(lines, rng)]) + "\n")
        at = np.arange(0.3, seconds + 3, 1 / 20)
        where = np.column_stack([np.interp(at, grid, column) for column in place.T]) * [40, 25, 5] - [0, 0, 5]
        clock = 1.7e9 + at * (1 + 30e-6)  # seconds since 1970
        lines = [f"{t:.4f}," + ",".join(f"{v:.3f}" for v in row) for t, row in zip(clock, where, strict=True)]
        (target / "robot.log").write_text("\n".join(spoiled(lines, rng)) + "\n")


def pressed_and_held(folder: Path, task: str, recordings: dict[str, float], ohm=True, seed=3):
    """Write `<task>/<recording>/{daq,robot}.log` of one sensor on one stage, stamped by one computer: 1 kHz, 50 Hz.

    Every 4 s the stage steps within 0.1 s, and the sensor has 10 mV of noise. recordings: name -> seconds.
    """
    for number, (name, seconds) in enumerate(recordings.items()):
        rng = np.random.default_rng([seed, number])
        target = folder / task / name
        target.mkdir(parents=True)
        robot_s, daq_s = np.arange(0, seconds, 0.02), np.arange(0, seconds, 0.001)
        steps = rng.uniform(0, 10, int(seconds) // 4 + 1)
        knots = np.repeat(4.0 * np.arange(len(steps)), 2) + np.tile([0, 0.1], len(steps))
        place = np.interp(robot_s, knots[1:-1], np.repeat(steps, 2)[:-2])
        volts = 2 + 0.1 * np.interp(daq_s, robot_s, place) + rng.normal(0, 0.01, len(daq_s))
        readings = volts * (3e4 if ohm else 1)
        lines = [f"{t:.3f},{value:.4f}" for t, value in zip(daq_s, readings, strict=True)]
        (target / "daq.log").write_text("\n".join(lines) + "\n")
        lines = [f"{t:.2f},{x:.3f}" for t, x in zip(robot_s, place, strict=True)]
        (target / "robot.log").write_text("\n".join(lines) + "\n")


def glove(folder: Path, objects=("ball", "cup"), sessions=("grasp0", "grasp1", "grasp2"), frames=25, seed=0):
    """Write `<object>/<session>/scanner.log`: each object presses its own cells, dead: p0 and s134."""
    rng = np.random.default_rng(seed)
    for one in objects:
        pattern = rng.uniform(50, 600, 405) * (rng.random(405) < 0.4)
        for session in sessions:
            target = folder / one / session
            target.mkdir(parents=True)
            counts = np.rint(pattern * rng.uniform(0.7, 1.3, (frames, 1)) + rng.uniform(0, 20, (frames, 405)))
            counts[:, [0, -1]] = 7
            lines = stamped(np.arange(frames) / 15, counts, "%d", start_us=900_000)
            lines[8] = lines[8][:300]
            (target / "scanner.log").write_text("\n".join([BANNER, *lines]) + "\n")


def mat(folder: Path, objects=("ball", "cup", "plate"), sessions=4, frames=12, seed=0):
    """Write `<object>/<session>/scanner.log` of a mat of 16 x 16 cells with 12 bits: a disc of each object's size."""
    rng = np.random.default_rng(seed)
    row, col = np.mgrid[:16, :16]
    for size, name in enumerate(objects, start=2):
        for session in range(sessions):
            y, x = rng.uniform(5, 11, 2)
            disc = 3000 * np.clip(size - np.hypot(row - y, col - x), 0, 1).ravel()
            counts = np.rint(disc * rng.uniform(0.7, 1.0, (frames, 1)) + rng.uniform(0, 40, (frames, 256)))
            scanned(folder / name / f"day{session}", counts, "%d")


def few_channels(folder: Path, objects=("bottle", "pen", "none"), sessions=4, frames=20, seed=0):
    """Write `<object>/<session>/scanner.log` of five sensors of pressure, 0 to 1023, and five of attitude in degrees.

    The hand is open in the first frames of a session, so that all of the pressure is 0; with `none` it stays open.
    """
    rng = np.random.default_rng(seed)
    closing = np.clip(np.arange(frames) / 8 - 0.5, 0, 1)[:, None]
    for name in objects:
        grip = 0 if name == "none" else rng.uniform(200, 1000, 5)
        attitude = rng.uniform(-90, 90, 5)
        for session in range(sessions):
            force = np.clip(closing * grip * rng.uniform(0.8, 1.0, 5), 0, 1023).round()
            angle = closing * attitude + rng.normal(0, 6, 5) + rng.normal(0, 1, (frames, 5))
            assert not force[0].any() and force[-1].any() == (name != "none")
            scanned(folder / name / f"day{session}", np.hstack([force, angle]), "%.1f")


def scanned(folder: Path, readings, pattern, start_us=5_000):
    """Write scanner.log into a new folder, 20 frames a second."""
    folder.mkdir(parents=True)
    lines = stamped(np.arange(len(readings)) / 20, readings, pattern, start_us)
    (folder / "scanner.log").write_text("\n".join(lines) + "\n")
