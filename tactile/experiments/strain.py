"""Read strain recordings (latent-space paper): the logs of DAQ and robot, as samples at a uniform rate."""

from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path

import numpy as np
import pyarrow as pa
from scipy.stats import theilslopes

from tactile.base.errors import InputError
from tactile.base.facts import Facts, Finding, Panel, Paper, Twin
from tactile.datasets import schemas, series
from tactile.logs import alignment, layout, parse
from tactile.logs.formats import Column, Format
from tactile.logs.report import log_report

KIND = "series"
FACTS = Facts(
    label="Strain",
    unit="V",
    output_unit="mm",
    metric="error",
    compared=("task_2",),
    score="main/task_2.error",
    first_tested=("task_1", "task_1"),
    drawn=("task_1", "task_2"),
    seeds="fingers",
    sheet="strands",
    log="daq.log",
    truth=("robot.log",),
    layout=("ingest.max_reject_fraction", "ingest.clock", "ingest.max_clock_offset_s", "ingest.min_correlation"),
    sensor=("sensor.channels", "sensor.unit"),
    panels=(Panel("Voltage (V)", r"daq", r"u\d+"), Panel("Place (mm)", r"robot", r"[xyz]_mm")),
    quick=("constant", "ridge", "window_ridge", "window_trees", "press_difference", "lstm_direct"),
    paper=Paper(
        *("latent", "error", "test error", 1),
        conditions={"task_1": "Task 1", "task_2": "Task 2"},
        splits={"{condition}": "split by time"},
        epochs=200,
    ),
    first="run000",
    twin=Twin("strain_recorded", "Strain: the recorded strands and the finger's"),
    purpose={
        "line_faults": "ingest is there for torn, doubled, missing and swapped lines and gaps",
        "jitter": "the resampling of ingest is there for uneven sampling",
    },
    shown={"relaxation": "rest_memory_near", "drift": "drift_over_response", "noise": "noise"},
)

# Ranges are what no such device can exceed: seconds since its start or since 1970, the DAQ's +-10 V, an arm of 5 m.
CLOCK = Column("t_s", "s", 0, 4e9)
AXES = "xyz"
UNITS = {"V": (-10, 10), "ohm": (0, 1e9), "any": (-1e9, 1e9)}  # of a sensor's readings, and their range

TASKS = {"task_0": (0, 1, 2), "task_1": (2,), "task_2": (0, 1)}  # columns of x, y, z that are asked for
MODEL_ZERO_TASK = "task_0"

NO_GROUND_TRUTH = "no ground truth at this time"
GRID_S = 0.1  # on which the clocks are compared: half the DAQ's interval
NEAR_S = 1.0  # reach of the search within stretches: 100 ppm are 0.6 s in 6000 s
STRETCH_S = 300.0  # about 40 strokes of the arm
STRETCHES = 4
PLAYS_MM = (0.5, 1.0, 2.0, 4.0, 6.0, 8.0, 12.0, 16.0)  # strokes over which fingers of some centimetres stick
LATE_S = 0.1  # a strand's own delay, told from the clocks' offset by its shape alone; see robot_clock
LEAST_MOVING = 0.1  # share of the time that an arm moves; of 0.025, recorded ones were placed 0.6 s beside the truth
SHORTEST_S = 10.0  # a stretch with less than one or two strokes cannot be placed
FINE_S = 0.4  # reach of the fine search: rates alone misplace simulated stretches by 0.23 s
CLIP = 95  # percentile: a slip changes voltages far more than the arm's motion
STUCK_S = 60.0  # the voltage of a working sensor changes within this time
STEP_V = 3.2e-4  # a step of a 16-bit converter for +-10 V (0.305 mV), rounded: a dead input may flicker by one
SMALL_STEPS = 100
# Offset of logs said to be of one clock that is named: simulated recordings on one clock are placed 0.11 s beside the
# truth at most, and a strand's own delay looks the same. One of more than 1 s is no delay: logs are refused then, also
# where slow strokes keep 0.9 of the correlation (simulated sliding, the robot 1.5 s early; 0.3 where it is late).
SHIFTED_S, REFUSED_S = 0.2, 1.0
LEAST_TRUTH = 0.5  # share of the DAQ's samples that must have ground truth
# Of the way of z, the share at its top in which no reading changes by more than ANSWER of its range: 0.03 to 0.10 in 24
# simulated recordings, whose arm stays on the finger, 0.4 to 0.95 where it lifts off by 3 to 40 mm after presses of 5.
IN_AIR, ANSWER = 0.25, 0.03
LEAST_MM = 0.2  # an arm that moves less is given in metres
STEPS, LEAST_OF_STEP = 40, 5  # into which that way is divided, and the readings that a step needs
STILL = 0.1  # x and y move by less than this share of z where the arm only presses


def formats(settings: Mapping, folder: Path | None = None) -> dict[str, Format]:
    """Return file -> format of its lines, of any folder; settings: the block `strain` of params.yaml."""
    unit = settings["sensor"].get("unit", "V")
    readings = (Column(f"u{k}", unit, *UNITS[unit]) for k in range(settings["sensor"]["channels"]))
    asked = sorted({column for columns in tasks(settings).values() for column in columns})
    place = (Column(f"{AXES[column]}_mm", "mm", -5e3, 5e3) for column in asked)
    return {"daq.log": Format((CLOCK, *readings), time="t_s"), "robot.log": Format((CLOCK, *place), time="t_s")}


def tasks(settings: Mapping) -> dict[str, tuple[int, ...]]:
    """Return task -> columns of x, y, z that are asked for: the paper's, or those of `strain.sensor.tasks`."""
    given = settings["sensor"].get("tasks", {})
    return {name: tuple(sorted(map(AXES.index, axes))) for name, axes in given.items()} or TASKS


def shows_loading(path: Path, settings: Mapping) -> bool:
    """Tell whether the task of a recording asks for one axis, so that the data sheet can be made of it."""
    return len(tasks(settings).get(path.parent.name, ())) == 1


def frames_schema(settings: Mapping) -> pa.Schema:
    """Return the schema of the frames table; `settings` is the block `strain` of params.yaml."""
    return series.frames(settings["sensor"]["channels"])


def recordings(folder: Path) -> list[Path]:
    """Return the folders `<task>/<recording>` in `folder`, sorted; raise InputError where there is none."""
    folders = parse.folders(folder, "*/*")
    if not folders:
        raise InputError(f"{folder}: no recordings found; expected <task>/<recording>/daq.log in it")
    parse.check_names(folders)
    return folders


def read_recording(folder: Path, settings: Mapping) -> tuple[pa.Table, pa.Table, dict]:
    """Read the two logs of a folder as samples on the DAQ's clock, at `ingest.rate_hz`: `(frames, rejects, report)`.

    `settings`: the block `strain` of params.yaml. frames: as `frames_schema`; jitter and single missing lines are
    interpolated, a gap of more than `ingest.max_gap_s` starts a new segment. Lines of a file = accepted + rejected
    (+ header). Raises InputError for a missing log, too many rejects, a clock that was set back, clocks that cannot
    be aligned or are said to be shared and are not, a depth of presses without z, ground truth for less than half of
    the samples, channels that are all dead, and a folder of no task.
    """
    if folder.parent.name not in tasks(settings):
        raise InputError(
            f"{folder}: '{folder.parent.name}' is no task; the tasks are {', '.join(tasks(settings))} (your own: "
            "strain.sensor.tasks)"
        )
    below, asked = settings["sensor"].get("pressed_below_mm"), formats(settings)["robot.log"].names
    if below is not None and "z_mm" not in asked:
        raise InputError(
            "params/strain.yaml, strain.sensor.pressed_below_mm: no task asks for z, so robot.log has no z_mm and "
            "nothing would count as pressed; add z to a task of strain.sensor.tasks, or remove pressed_below_mm"
        )
    ingest, who = settings["ingest"], f"{folder.parent.name}/{folder.name}"
    rows, rejects = {}, {}
    for name, fmt in formats(settings).items():
        limit, key = ingest["max_reject_fraction"], "strain.ingest.max_reject_fraction"
        rows[name], rejects[name] = parse.read_log(
            folder / name, fmt, limit=limit, key=key, layout=layout.of(ingest, name)
        )
        check_clock(folder / name, rows[name])
        lasts, least = (
            np.ptp(rows[name]["t_s"].to_numpy()),
            0 if ingest.get("clock") == "shared" else _shortest_s(ingest),
        )
        if lasts < least:
            raise InputError(f"{folder / name}: lasts {lasts:.1f} s; at least {least:g} s are needed, record longer")
    daq, robot = rows["daq.log"], rows["robot.log"]
    voltages = formats(settings)["daq.log"].names[1:]
    at, volts = daq["t_s"].to_numpy(), np.column_stack([daq[name].to_numpy() for name in voltages])
    place = np.zeros((robot.num_rows, len(AXES)))
    for column, axis in enumerate(AXES):
        if f"{axis}_mm" in robot.column_names:
            place[:, column] = robot[f"{axis}_mm"].to_numpy()
    channels = stuck(folder / "daq.log", at, volts, _step(volts, settings["sensor"].get("unit", "V")))
    touching = np.minimum(place, [np.inf, np.inf, np.inf if below is None else below])  # in the air nothing answers
    shared = ingest.get("clock") == "shared"
    placed = at, volts, robot["t_s"].to_numpy(), touching, ingest, who
    clock = alignment.Clock(0.0) if shared else robot_clock(*placed)
    truth, known = alignment.interpolated(at, clock(robot["t_s"].to_numpy()), place)
    if not known.any() and shared:
        raise alignment.NotOneClock(
            f"{folder / 'robot.log'}: its times, {_span(robot['t_s'].to_numpy())}, are none of daq.log's, {_span(at)}, "
            "so they do not share a clock; set strain.ingest.clock: own"
        )
    if known.mean() < LEAST_TRUTH:
        raise InputError(
            f"{folder / 'robot.log'}: covers {100 * known.mean():.0f} % of the DAQ's log; it ended early, record again"
        )
    if below is None:
        refuse_air(truth[known], volts[known], who)
    measured = shared_clock(*placed) if shared else {"clock": clock.report()}
    unknown = daq["line"].to_numpy()[~known]
    rejects["daq.log"] = parse.add_rejects(rejects["daq.log"], folder / "daq.log", unknown, NO_GROUND_TRUTH)

    frames = resampled(folder.parent.name, folder.name, at[known], volts[known], truth[known], ingest)
    if below is not None:
        press = presses(schemas.matrix(frames["y_mm"])[:, AXES.index("z")] < below)
        frames = frames.set_column(frames.column_names.index("press"), "press", pa.array(press))
    report = {}
    for name, accepted in (("daq.log", int(known.sum())), ("robot.log", robot.num_rows)):
        time = rows[name]["t_s"].to_numpy()
        report[name] = log_report(accepted, rejects[name], time, np.zeros(len(time), int))
    report["daq.log"]["channels"] = channels
    report["robot.log"] |= measured
    return frames, pa.concat_tables(rejects.values()), report


def refuse_air(place: np.ndarray, readings: np.ndarray, who: str) -> None:
    """Raise InputError where an arm that moves along z alone leaves the sensor, so that z is more than a depth.

    place (n, 3), mm; readings (n, channels). With presses of 5 mm the clock was 0.38 s beside the truth after lifts of
    3 mm, 0.79 s after lifts of 40 mm; so the quarter of a step's readings with the least response is asked, which is
    that of one way, up or down.
    """
    z, (*aside, way) = place[:, -1], np.ptp(place, axis=0)
    if way == 0 or max(aside) > STILL * way:
        return
    step = np.minimum(((z - z.min()) / way * STEPS).astype(int), STEPS - 1)
    told = [k for k in range(STEPS) if (step == k).sum() >= LEAST_OF_STEP]
    if len(told) < 2:
        return
    moving = readings.std(axis=0) > 0
    follows = [np.corrcoef(z, each)[0, 1] if moves else 0.0 for each, moves in zip(readings.T, moving, strict=True)]
    answering = int(np.abs(follows).argmax())
    response = -readings[:, answering] * np.sign(follows[answering])
    least = np.array([np.percentile(response[step == k], 25) for k in told])
    answers = np.flatnonzero(least - least[-1] > ANSWER * np.ptp(least))
    if not len(answers):
        return
    below = (told[answers[-1]] + 1) / STEPS
    if 1 - below > IN_AIR:
        surface = f"{z.min() + below * way:.3g}"
        raise InputError(
            f"{who}: no reading changes while z is above {surface} mm, in {100 * (1 - below):.0f} % of its way, where "
            f"the arm is off the sensor; set strain.sensor.pressed_below_mm: {surface}"
        )


def check_clock(path: Path, rows: pa.Table) -> None:
    """Raise InputError for a log, read as `rows`, whose clock begins anew: nobody knows how much later."""
    if rows["segment"][-1].as_py() > 0:
        line = rows["line"].to_numpy()[np.argmax(rows["segment"].to_numpy() > 0)]
        raise InputError(
            f"{path}: the time steps back for good in line {line}; the clock was set, or the device restarted: divide "
            "the recording there, or record again"
        )


def log_problems(path: Path, rows: pa.Table, settings: Mapping) -> Iterator[str]:
    """Yield problems of a log that can be read: places in metres."""
    if path.name == "robot.log":
        axes = [name for name in rows.column_names if name.endswith("_mm")]
        moves = max(np.ptp(rows[axis].to_numpy()) for axis in axes)
        if moves < LEAST_MM:
            yield f"{path}: the arm moves by no more than {moves:g} mm; write {', '.join(axes)} in millimetres"


def findings(frames: pa.Table, rows: pa.Table, settings: Mapping) -> Iterator[Finding]:
    """Yield what all recordings show: whether they are too short."""
    if frames.num_rows < 10 * settings["window"]["frames"]:
        yield Finding("the recordings are too short to learn from", wrong=True)


def resampled(
    condition: str, recording: str, at: np.ndarray, volts: np.ndarray, truth: np.ndarray, ingest: Mapping
) -> pa.Table:
    """Interpolate linearly at a uniform rate, within each segment; at (n,) s, volts (n, channels), truth (n, 3).

    With `ingest.average`, volts are means over the interval of a sample, where it holds readings.
    """
    edges = np.flatnonzero(np.diff(at) > ingest["max_gap_s"]) + 1
    schema, parts = series.frames(volts.shape[1]), []
    for number, (first, last) in enumerate(zip([0, *edges], [*edges, len(at)], strict=True)):
        inside = slice(first, last)
        grid = np.arange(at[first], at[last - 1] + 1e-9, 1 / ingest["rate_hz"])
        v, y = (
            np.column_stack([np.interp(grid, at[inside], column) for column in values[inside].T])
            for values in (volts, truth)
        )
        if ingest.get("average"):
            v = averaged(grid, at[inside], volts[inside], v)
        n = len(grid)
        columns = {
            "condition": [condition] * n,
            "recording": [recording] * n,
            "segment": np.full(n, number, np.int16),
            "t_s": grid,
            "gap_before": np.arange(n) == 0,
            "press": np.full(n, -1, np.int32),
            "v": schemas.lists(v, pa.float32()),
            "y_mm": schemas.lists(y, pa.float32()),
        }
        parts.append(pa.table(columns).select(schema.names).cast(schema))
    return pa.concat_tables(parts)


def averaged(grid: np.ndarray, at: np.ndarray, values: np.ndarray, otherwise: np.ndarray) -> np.ndarray:
    """Return the mean of `values` (n, columns), read at `at` (n,), around each time of the grid (m,): (m, columns).

    The interval of a time is as long as the grid's step, with the time in its middle. otherwise: (m, columns) where an
    interval holds no value.
    """
    half = np.median(np.diff(grid)) / 2 if len(grid) > 1 else 0.0
    first, last = np.searchsorted(at, grid - half), np.searchsorted(at, grid + half)
    sums = np.concatenate([np.zeros((1, values.shape[1])), np.cumsum(values, axis=0, dtype=float)])
    count = (last - first)[:, None]
    return np.where(count > 0, (sums[last] - sums[first]) / np.maximum(count, 1), otherwise)


def presses(pressed: np.ndarray) -> np.ndarray:
    """Return the number of the press that each sample belongs to, (n,) int32, -1 outside; pressed: (n,) bool."""
    begins = np.diff(pressed.astype(np.int8), prepend=0) == 1
    return np.where(pressed, np.cumsum(begins) - 1, -1).astype(np.int32)


def robot_clock(
    daq_s: np.ndarray, volts: np.ndarray, robot_s: np.ndarray, place: np.ndarray, ingest: Mapping, who: str
) -> alignment.Clock:
    """Return the clock that turns the robot's time into the DAQ's: while the arm moves, voltages change in proportion.

    Roughly, the offset is where the rates of the voltages explain the arm's velocity best, by least squares: over all
    of the log, then, near that, over stretches of STRETCH_S. Slips of the finger break the proportion, so rates are
    clipped. The changes of the rates explain too, because a strand answers late: m' = r' - T m''.

    That leaves -0.15 to -0.07 s where the finger slides, because it answers to the first millimetres of a stroke and
    then slips, and 0.07 to 0.10 s where it presses, because noise in what explains hides the delay. So the fine search
    explains the noisy signal by the clean one: changes of the voltages by those of the arm's place and of tips that
    follow the arm once it is PLAYS_MM away (Prandtl and Ishlinskii's play operators), which answer after LATE_S. The
    lags of stretches give offset and drift. A strand's delay has but another shape than an offset: of 0 to 0.3 s, 0.1 s
    explains most of the five simulated recordings of pressing; of those that slide, 0.15 to 0.2 s explain 0.1 % more.
    0.1 s is the scene's own time of loading too: LATE_S and PLAYS_MM were chosen with the simulated truth in sight.
    Strands that are later by some time place the robot later by as much.

    Mean error over a recording, 15 simulated ones of 100 minutes: -0.071 to 0.007 s, 0.026 s in the mean of their
    amounts (rates alone: -0.153 to 0.100 s, 0.106 s); at an end of a recording at most 0.11 s (0.23 s), where its drift
    is wrong by 18 ppm. At 1 mm/s, the fastest press, 0.017 s are 0.02 mm; at 12 mm/s, 0.07 s are 0.85 mm.

    The clocks start within `ingest.max_clock_offset_s` of each other, or the logs do. Gaps in the DAQ's
    log that are longer than a stretch are left out. daq_s (n,), volts (n, channels), robot_s (m,), place (m, 3).
    Raises InputError below `ingest.min_correlation`, and where such gaps leave too little.
    """
    if wrong := _incomparable(daq_s, robot_s, place, ingest):
        raise InputError(f"{who}: {wrong}")
    clock, _ = _placed(daq_s, volts, robot_s, place, ingest, {0.0, float(daq_s[0] - robot_s[0])})
    if not clock.correlation >= ingest["min_correlation"]:
        raise InputError(
            f"{who}: robot.log and daq.log do not follow each other (best correlation {clock.correlation:.2f}, "
            f"strain.ingest.min_correlation {ingest['min_correlation']:g}); check that they belong to one capture; if "
            "one computer stamped both, set strain.ingest.clock: shared"
        )
    return clock


def shared_clock(
    daq_s: np.ndarray, volts: np.ndarray, robot_s: np.ndarray, place: np.ndarray, ingest: Mapping, who: str
) -> dict:
    """Return what the report says of a robot's clock that is said to be the DAQ's: `clock` and `warnings`.

    No offset is applied; the one at which the logs agree best is measured as `robot_clock` does. It is not where they
    are too short, move too little or follow each other too little to tell. Arguments as there. Raises InputError for
    clocks that are not shared.
    """
    report = {"clock": {"offset_ms": 0.0, "drift_ppm": 0.0} | alignment.UNMEASURED}
    if _incomparable(daq_s, robot_s, place, ingest):
        return report
    clock, at_zero = _placed(daq_s, volts, robot_s, place, ingest, {0.0})
    if not clock.correlation >= ingest["min_correlation"]:
        return report
    found = alignment.Agreement(clock.offset_s, at_zero, clock.correlation)
    report["clock"] |= found.report()
    if abs(found.offset_s) > SHIFTED_S:
        said = found.said("robot.log", "daq.log")
        if found.refuted or abs(found.offset_s) > REFUSED_S:
            raise InputError(
                f"{who}: {said}, so they do not share a clock; set strain.ingest.clock: own, or add "
                f"{found.offset_s:+.2f} s to the times of robot.log"
            )
        report["warnings"] = [f"{said}: look at what delays one"]
    return report


def _grid(daq_s: np.ndarray) -> np.ndarray:
    """Return times GRID_S apart within the DAQ's log, those in gaps of more than a stretch left out."""
    grid = np.arange(daq_s[0], daq_s[-1], GRID_S)
    return grid[np.diff(daq_s)[np.searchsorted(daq_s, grid, side="right") - 1] <= STRETCH_S]


def _incomparable(daq_s: np.ndarray, robot_s: np.ndarray, place: np.ndarray, ingest: Mapping) -> str | None:
    """Say why two logs cannot tell how their clocks differ, or None."""
    lasts, least = len(_grid(daq_s)) * GRID_S, _shortest_s(ingest)
    if lasts < least:
        return (
            f"daq.log lasts {lasts:.1f} s without its gaps of more than {STRETCH_S:g} s; "
            f"at least {least:g} s are needed, record longer"
        )
    moving = float(np.diff(robot_s)[(np.diff(place, axis=0) != 0).any(axis=1)].sum() / np.ptp(robot_s))
    if moving < LEAST_MOVING:
        return (
            f"the arm moves in {100 * moving:.1f} % of the time, too little to tell how the clocks of robot.log "
            "and daq.log differ; if one computer stamped both, set strain.ingest.clock: shared, else record more motion"
        )
    return None


def _placed(
    daq_s: np.ndarray, volts: np.ndarray, robot_s: np.ndarray, place: np.ndarray, ingest: Mapping, centres: set[float]
) -> tuple[alignment.Clock, float]:
    """Return the robot's clock, its offset near one of `centres` (s), and the correlation of the logs as they are."""
    grid = _grid(daq_s)
    rates = _on(grid, *_rates(daq_s, volts))
    rates = np.column_stack([rates, np.gradient(rates, axis=0)])
    speed = _rates(robot_s, place)
    tried = [_best_lag(grid, rates, speed, centre, ingest["max_clock_offset_s"]) for centre in sorted(centres)]
    lag, _ = max(tried, key=lambda lag_and_score: lag_and_score[1])
    length, stretches = round(STRETCH_S / GRID_S), []
    for first in range(0, len(grid) - length // 2, length):
        stretch = slice(first, first + length)
        near, score = _best_lag(grid[stretch], rates[stretch], speed, lag, NEAR_S)
        if score >= ingest["min_correlation"]:
            stretches.append((float(grid[stretch][0]), float(grid[stretch][-1]), near))
    clock = alignment.Clock(lag)
    times, lags = _fine_lags(daq_s, volts, robot_s, place, stretches, ingest["max_gap_s"])
    if len(lags):
        times -= lag  # in the robot's time: zeros may be decades apart
        clock = alignment.Clock(float(np.median(lags)))
        if len(lags) >= STRETCHES:
            drift, offset, _, _ = theilslopes(lags, times - times.mean())  # a stretch may be far off
            clock = alignment.Clock(float(offset), float(drift), float(times.mean()))
    correlation = _explained(rates, _on(grid, clock(speed[0]), speed[1]))
    at_zero = _explained(rates, _on(grid, *speed))
    return alignment.Clock(clock.offset_s, clock.drift, clock.middle_s, correlation), at_zero


def _shortest_s(ingest: Mapping) -> float:
    """Return the time that a log must last to overlap with the other log at every offset that is tried."""
    return 4 * ingest["max_clock_offset_s"]


def _rates(time_s: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the times between samples, and the rates of `values` (n, columns) there, clipped on both sides.

    A log faster than the grid is first averaged to it: at 1 kHz half a millivolt of noise is 0.5 V/s, motion 0.1 V/s.
    """
    average = alignment.averager(time_s, GRID_S)
    time_s, values = average(time_s), average(values)
    rate = np.diff(values, axis=0) / np.diff(time_s)[:, None]
    low, high = np.percentile(rate, [100 - CLIP, CLIP], axis=0)
    for column in np.flatnonzero((low == 0) & (high == 0)):  # an arm that rests most of the time
        if (moving := rate[rate[:, column] != 0, column]).size:
            low[column], high[column] = min(0, np.percentile(moving, 100 - CLIP)), max(0, np.percentile(moving, CLIP))
    return (time_s[1:] + time_s[:-1]) / 2, np.clip(rate, low, high)


def _on(grid: np.ndarray, time_s: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Interpolate `values` (n, columns) on the grid (m,), 0 outside their time: (m, columns)."""
    return np.column_stack([np.interp(grid, time_s, column, left=0, right=0) for column in values.T])


def _explained(rates: np.ndarray, speed: np.ndarray) -> float:
    """Return the multiple correlation: the root of the share of `speed` (n, 3) that `rates` (n, channels) explain."""
    basis, _ = np.linalg.qr(np.column_stack([np.ones(len(rates)), rates]))
    speed = speed - speed.mean(axis=0)
    return float(np.linalg.norm(basis.T @ speed) / max(np.linalg.norm(speed), 1e-12))


def _best_lag(
    grid: np.ndarray, rates: np.ndarray, speed: tuple[np.ndarray, np.ndarray], centre: float, reach: float
) -> tuple[float, float]:
    """Return the lag of the robot's clock within centre +- reach (s) that explains most, and its correlation.

    A parabola places the lag between the steps. grid (n,): times whole steps of GRID_S apart, some steps left out.
    """
    basis, _ = np.linalg.qr(np.column_stack([np.ones(len(rates)), rates]))
    lags = centre + np.arange(-round(reach / GRID_S), round(reach / GRID_S) + 1) * GRID_S
    steps = np.rint((grid - grid[0]) / GRID_S).astype(int)
    wide = _on(grid[0] - lags[-1] + np.arange(steps[-1] + len(lags)) * GRID_S, *speed)
    scores = np.empty(len(lags))
    for k in range(len(lags)):
        moved = wide[steps + len(lags) - 1 - k]
        moved = moved - moved.mean(axis=0)
        scores[k] = np.linalg.norm(basis.T @ moved) / max(np.linalg.norm(moved), 1e-12)
    place, top = _peak(scores)
    return float(lags[0] + place * GRID_S), top


def _fine_lags(
    daq_s: np.ndarray,
    volts: np.ndarray,
    robot_s: np.ndarray,
    place: np.ndarray,
    stretches: list[tuple[float, float, float]],
    max_gap_s: float,
) -> tuple[np.ndarray, np.ndarray]:
    """Return the middles and the lags (n,) in s at which the finger's motion explains the voltages of n stretches best.

    stretches: first and last second of the DAQ's clock, and a lag near the one searched. Those that are mostly gaps are
    left out.
    """
    average = alignment.averager(daq_s, GRID_S)
    daq_s, volts = average(daq_s), average(volts)
    change = np.diff(volts, axis=0)
    change = np.clip(change, *np.percentile(change, [100 - CLIP, CLIP], axis=0))
    steady = np.diff(daq_s) <= max_gap_s
    average = alignment.averager(robot_s, GRID_S)
    robot_s, place = average(robot_s), average(place)
    motion = np.column_stack([place, *(_play(place[:, :2], play) for play in PLAYS_MM)])
    motion = _late(robot_s, motion, LATE_S)
    steps = np.arange(-round(FINE_S / GRID_S), round(FINE_S / GRID_S) + 1) * GRID_S
    middles, lags = [], []
    for first_s, last_s, near in stretches:
        inside = np.flatnonzero(steady & (daq_s[:-1] >= first_s) & (daq_s[1:] <= last_s))
        if len(inside) * GRID_S < SHORTEST_S:
            continue
        at, y = daq_s[inside[0] : inside[-1] + 2], change[inside]
        y = y / np.maximum(y.std(axis=0), 1e-12)
        scores = []
        for lag in near + steps:
            x = np.column_stack([np.interp(at - lag, robot_s, column) for column in motion.T])
            scores.append(_explained(np.diff(x, axis=0)[inside - inside[0]], y))
        shift, _ = _peak(np.array(scores))
        lags.append(near + steps[0] + shift * GRID_S)
        middles.append((first_s + last_s) / 2)
    return np.array(middles), np.array(lags)


def _play(place: np.ndarray, stroke_mm: float) -> np.ndarray:
    """Return how far a tip that sticks is behind the arm, (n, 2), at most `stroke_mm`, for the arm's x and y (n, 2)."""
    (tip_x, tip_y), behind = place[0].tolist(), []
    for x, y in place.tolist():
        dx, dy = x - tip_x, y - tip_y
        if (length := (dx * dx + dy * dy) ** 0.5) > stroke_mm:
            dx, dy = dx * stroke_mm / length, dy * stroke_mm / length
            tip_x, tip_y = x - dx, y - dy
        behind.append((dx, dy))
    return np.array(behind)


def _late(time_s: np.ndarray, values: np.ndarray, late_s: float) -> np.ndarray:
    """Return the answer of first order, time constant `late_s`, to values (n, columns), linear between times (n,)."""
    if not late_s:
        return values
    answer = np.empty_like(values)
    answer[0] = values[0]
    step = np.diff(time_s)
    keep = np.exp(-step / late_s)
    # A ramp's answer: it ends late_s behind the ramp, but for what is kept of the start.
    slope = np.diff(values, axis=0) / step[:, None]
    aim = values[1:] - late_s * slope
    start = values[:-1] - late_s * slope
    for k in range(len(step)):
        answer[k + 1] = aim[k] + keep[k] * (answer[k] - start[k])
    return answer


def _peak(scores: np.ndarray) -> tuple[float, float]:
    """Return where the highest of scores (n,) stands, between whole numbers by a parabola, and the highest score."""
    best = int(np.clip(np.argmax(scores), 1, len(scores) - 2))
    below, top, above = scores[best - 1 : best + 2]
    bend = below - 2 * top + above
    shift = float(np.clip((below - above) / (2 * bend), -1, 1)) if bend < 0 else 0.0
    return best + shift, float(top)


def _span(time_s: np.ndarray) -> str:
    """Return the first and the last of some times in words."""
    return f"{time_s[0]:.10g} to {time_s[-1]:.10g} s"


def _step(readings: np.ndarray, unit: str) -> float:
    """Return by how much a dead channel may change; readings: (n, channels).

    It is STEP_V of volts; but where no channel moves by SMALL_STEPS of these, as mV/V of a bridge given as volts, the
    finest step of the readings.
    """
    if unit != "V":
        return 0.0
    if np.ptp(readings, axis=0).max(initial=0) > SMALL_STEPS * STEP_V:
        return STEP_V
    return min(STEP_V, min((parse.finest_step(channel) for channel in readings.T), default=STEP_V))


def stuck(path: Path, time_s: np.ndarray, volts: np.ndarray, step: float = STEP_V) -> dict[str, dict]:
    """Find channels that change by no more than `step` in blocks of STUCK_S.

    Returns channel -> fault and share of the blocks: 'saturated' where the channel stands at an edge of its range, else
    'dead'. Blocks that lie mostly in a gap do not count. time_s (n,), volts (n, channels). Raises InputError if all
    channels are dead all the time.
    """
    starts = np.flatnonzero(np.diff((time_s - time_s[0]) // STUCK_S, prepend=-1))
    whole = time_s[np.append(starts[1:], len(time_s)) - 1] - time_s[starts] > STUCK_S / 2
    low, high = (extreme.reduceat(volts, starts)[whole] for extreme in (np.minimum, np.maximum))
    faults = {}
    for k, v in enumerate(volts.T):
        still = high[:, k] - low[:, k] <= step
        if still.any():
            at_edge = (high[still, k] >= v.max() - step) | (low[still, k] <= v.min() + step)
            saturated = at_edge.all() and np.ptp(v) > step
            faults[f"u{k}"] = {"fault": "saturated" if saturated else "dead", "share": float(still.mean())}
    if sum(fault["share"] == 1 for fault in faults.values()) == volts.shape[1]:
        raise InputError(f"{path}: all {volts.shape[1]} channels are dead; check the supply of the strands")
    return faults


def task(protocol: str, settings: Mapping) -> series.Task:
    """Return the task of a protocol, which is named like it; InputError for an unknown one.

    settings: the block `strain` of params.yaml; a model sees all its sensor.channels. Of tasks of your own the first
    takes the place of task 0, whose network transfer starts from; where `sensor.pressed_below_mm` is set, only samples
    of a press count.
    """
    known = tasks(settings)
    if protocol not in known:
        raise InputError(
            f"params/strain.yaml, strain.protocols: no task '{protocol}'; the tasks are {', '.join(known)}"
        )
    channels = list(range(settings["sensor"]["channels"]))
    base = settings.get("protocols", {}).get(protocol, {}).get("base")
    base = base or (MODEL_ZERO_TASK if MODEL_ZERO_TASK in known else next(iter(known)))
    pressed_only = settings["sensor"].get("pressed_below_mm") is not None
    return series.Task(known[protocol], {protocol: channels}, pressed_only, base)


def split(frames: pa.Table, settings: Mapping, protocol: str, seed: int) -> np.ndarray:
    """Return the part of each sample, (n,): in the order of time within the seed's recording, else 'unused'.

    See `recording_of`. The end of the training part is the validation part. Where `split.test_recordings` names
    recordings of the task, these are its test part, and all others train, each with its end as validation part. Raises
    InputError where the task has no recording to train on.
    """
    condition, recording = schemas.names(frames["condition"]), schemas.names(frames["recording"])
    part, share = np.full(frames.num_rows, "unused", dtype=object), settings["split"]
    names = np.unique(recording[condition == protocol])
    tests = [name for name in names if name in share.get("test_recordings", [])]
    if len(names) == len(tests):
        raise InputError(
            f"params/strain.yaml, strain.protocols.{protocol}: no recording of this task to train on; add one, or "
            "remove the protocol"
        )
    for name in names if tests else [recording_of(seed, names)]:
        rows = np.flatnonzero((condition == protocol) & (recording == name))
        train = 1.0 if tests else share["train"]
        part[rows] = "test" if name in tests else series.chronological(len(rows), train, share["validation"])
    return part


def recording_of(seed: int, names: Iterable[str]) -> str:
    """Return the recording of a task that a seed trains and tests on: they take turns; names: the task's recordings.

    Simulated recordings of one number are of one finger, so that model-0 of a seed has seen the finger of its task 0.
    """
    different = sorted(set(names))
    return different[seed % len(different)]
