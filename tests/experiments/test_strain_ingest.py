"""Strain logs: alignment, resampling, ground truth, dead channels and bad input."""

import copy
import json

import numpy as np
import pyarrow as pa
import pytest
from builders import own_logs
from builders.project import ROOT

from pipeline.scenes import strain as scene_of
from tactile.base import params
from tactile.base.errors import InputError
from tactile.datasets import schemas, series
from tactile.experiments import strain


@pytest.fixture(scope="module")
def settings():
    block = copy.deepcopy(params.load(ROOT / "params.yaml")["strain"])
    block["simulate"]["samples"] = 2000
    block["simulate"]["faults"] |= {"gaps": 1, "gap_s": 10}
    return block


@pytest.fixture(scope="module")
def lines(settings):
    return lines_of(settings)


def lines_of(settings, task="task_1"):
    """File -> lines of a simulated recording of a task."""
    recording = next(r for r in scene_of.recordings(settings["simulate"]) if r.condition == task)
    return {name: written for name, (written, _) in scene_of.logs_of(recording, settings["simulate"], 6).items()}


def written(folder, lines, **changes):
    target = folder / "task_1" / "run000"
    target.mkdir(parents=True, exist_ok=True)
    for name, content in (lines | changes).items():
        (target / name).write_text("\n".join(content) + "\n")
    return target


@pytest.fixture(scope="module")
def whole(settings, lines, tmp_path_factory):
    """Frames, rejects and report of the recording as it is."""
    return strain.read_recording(written(tmp_path_factory.mktemp("whole"), lines), settings)


def edited(lines, change):
    """DAQ lines with `change(number, values)` applied to the values of each whole line."""
    result = []
    for number, line in enumerate(lines["daq.log"]):
        values = line.split(",")
        result.append(",".join(change(number, values)) if len(values) == 7 else line)
    return result


def test_uniform_rate_segments_and_every_line_accounted_for(settings, lines, whole):
    frames, rejects, report = whole
    segment, time = frames["segment"].to_numpy(), frames["t_s"].to_numpy()
    assert set(segment) == {0, 1}  # one gap of 10 s
    assert np.diff(time)[np.diff(segment) == 0] == pytest.approx(0.2)
    assert frames["gap_before"].to_numpy(zero_copy_only=False).sum() == 2
    for name in strain.formats(settings):
        log = report[name]
        assert log["accepted"] + sum(log["rejects"].values()) == log["lines"] == len(lines[name])
    assert rejects.num_rows == sum(sum(log["rejects"].values()) for log in report.values())
    json.dumps(report)


@pytest.mark.parametrize(("task", "axes"), [("task_1", [2]), ("task_2", [0, 1])])
def test_robot_is_placed_to_a_fraction_of_a_sample(task, axes, settings, whole, tmp_path):
    """Its clock starts up to 4 s from the DAQ's; place at a time must be the place the voltages were made from."""
    if task == "task_1":
        frames, _, report = whole
    else:
        frames, _, report = strain.read_recording(written(tmp_path, lines_of(settings, task)), settings)
    assert abs(report["robot.log"]["clock"]["offset_ms"]) < 5000
    simulate = settings["simulate"]
    recording = next(r for r in scene_of.recordings(simulate) if r.condition == task)
    rng = scene_of.generator(simulate["seed"], task, "run000", "daq")
    times = scene_of.daq_times(simulate, rng)
    clock = scene_of.own_clock(times, simulate["devices"], rng)
    true_time = np.interp(frames["t_s"].to_numpy(), clock, times)
    grid = np.arange(len(recording.place_mm)) * scene_of.STEP_S
    lags = np.arange(-0.5, 0.5, 0.02)
    for axis in axes:
        placed, true = schemas.matrix(frames["y_mm"])[:, axis], recording.place_mm[:, axis]
        errors = [np.abs(np.interp(true_time - lag, grid, true) - placed).mean() for lag in lags]
        assert abs(lags[int(np.argmin(errors))]) <= 0.06  # s; 0.1 s is the strands' own delay


def test_a_tip_follows_the_arm_once_it_has_bent_so_far():
    there_and_back = np.column_stack([[0.0, 3, 10, 7, 0], np.zeros(5)])
    assert strain._play(there_and_back, 4.0)[:, 0] == pytest.approx([0, 3, 4, 1, -4])


def test_a_late_answer_ends_behind_a_ramp_by_its_delay():
    time = np.cumsum(np.tile([0.05, 0.15], 50))
    late = strain._late(time, np.column_stack([2 * time, np.full(100, 7.0)]), 0.3)
    assert late[-1] == pytest.approx([2 * (time[-1] - 0.3), 7])


def later(lines, seconds):
    """Lines with another zero of the clock; torn ones as they are."""
    result = []
    for line in lines:
        time, comma, rest = line.partition(",")
        result.append(f"{float(time) + seconds:.4f},{rest}" if comma else line)
    return result


def test_a_silence_of_hours_moves_no_clock(settings, lines, whole, tmp_path):
    """A capture that rests for three hours: both devices write nothing, and the robot stays placed as before."""
    clock = whole[2]["robot.log"]["clock"]
    split = {"daq.log": 1000, "robot.log": 2000}  # lines, at 5 and 10 Hz
    rested = {name: lines[name][:line] + later(lines[name][line:], 1e4) for name, line in split.items()}
    frames, _, report = strain.read_recording(written(tmp_path, rested), settings)
    assert report["robot.log"]["clock"]["offset_ms"] == pytest.approx(clock["offset_ms"], abs=20)
    assert np.diff(frames["t_s"].to_numpy()).max() == pytest.approx(1e4, rel=0.01)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["robot.log", "daq.log"])
@pytest.mark.parametrize("samples", [2000, 7000])  # without and with enough stretches to see the drift
def test_clocks_may_have_any_zero(settings, tmp_path, samples, name):
    """One log in seconds since 1970, the other since its start: only the starts of the logs are near each other."""
    lines = lines_of(settings | {"simulate": settings["simulate"] | {"samples": samples}})
    first, _, report = strain.read_recording(written(tmp_path, lines), settings)
    later_log = {name: later(lines[name], 1.7e9)}
    moved, _, moved_report = strain.read_recording(written(tmp_path, lines, **later_log), settings)
    clock, moved_clock = report["robot.log"]["clock"], moved_report["robot.log"]["clock"]
    assert abs(moved_clock["offset_ms"] - clock["offset_ms"]) == pytest.approx(1.7e12, abs=5)
    assert moved_clock["drift_ppm"] == pytest.approx(clock["drift_ppm"], abs=2)
    assert (clock["drift_ppm"] != 0) == (samples > 2000)
    assert schemas.matrix(moved["y_mm"])[50:-50] == pytest.approx(schemas.matrix(first["y_mm"])[50:-50], abs=0.05)


@pytest.mark.slow
def test_noise_of_a_fast_daq_hides_no_motion(settings, lines, whole, tmp_path):
    """400 samples a second with 0.5 mV of noise: their rates are 0.3 V/s of noise, of motion 0.03 V/s."""
    expected = whole[2]["robot.log"]["clock"]["offset_ms"]
    slow = np.array([line.split(",") for line in edited(lines, lambda _, values: values) if line.count(",") == 6])
    slow = slow[np.concatenate([[True], np.diff(slow[:, 0].astype(float)) > 0])].astype(float)
    time = np.arange(slow[0, 0], slow[-1, 0], 1 / 400)
    volts = np.column_stack([np.interp(time, slow[:, 0], column) for column in slow[:, 1:].T])
    volts += np.random.default_rng(0).normal(0, 5e-4, volts.shape)
    fast = [",".join(f"{value:.5f}" for value in row) for row in np.column_stack([time, volts])]
    _, _, report = strain.read_recording(written(tmp_path, lines, **{"daq.log": fast}), settings)
    assert report["robot.log"]["clock"]["offset_ms"] == pytest.approx(expected, abs=50)


def test_a_long_gap_is_no_dead_channel(settings, lines, tmp_path):
    daq = lines["daq.log"]
    daq = daq[:500] + later(daq[500:], 90)
    robot = lines["robot.log"]
    robot = robot[:1000] + later(robot[1000:], 90)
    _, _, report = strain.read_recording(written(tmp_path, lines, **{"daq.log": daq, "robot.log": robot}), settings)
    assert report["daq.log"]["channels"] == {}


@pytest.mark.parametrize("name", ["daq.log", "robot.log"])
@pytest.mark.parametrize("count", [1, 2, 20])
def test_a_log_too_short_to_align_is_one_sentence(name, count, settings, lines, tmp_path):
    with pytest.raises(InputError, match=rf"{name}: lasts .* s; at least 20 s are needed"):
        strain.read_recording(written(tmp_path, lines, **{name: lines[name][:count]}), settings)


def test_robot_log_that_ends_early(settings, lines, tmp_path):
    robot = lines["robot.log"]
    frames, rejects, _ = strain.read_recording(
        written(tmp_path, lines, **{"robot.log": robot[: int(0.8 * len(robot))]}), settings
    )
    assert rejects["reason"].to_pylist().count(strain.NO_GROUND_TRUTH) > 300
    assert frames["t_s"][-1].as_py() < 350
    with pytest.raises(InputError, match=r"robot\.log: covers .* % of the DAQ's log"):
        strain.read_recording(written(tmp_path, lines, **{"robot.log": robot[: len(robot) // 3]}), settings)


def test_dead_and_saturated_channels_are_named(settings, lines, tmp_path):
    flicker = ("1.25000", "1.25031")  # one step of the converter
    daq = edited(lines, lambda n, v: [*v[:4], flicker[n % 2], v[5], "9.99000" if n > 1000 else v[6]])
    _, _, report = strain.read_recording(written(tmp_path, lines, **{"daq.log": daq}), settings)
    channels = report["daq.log"]["channels"]
    assert channels["u3"] == {"fault": "dead", "share": 1.0}
    assert channels["u5"]["fault"] == "saturated" and 0.4 < channels["u5"]["share"] < 0.6
    dead = edited(lines, lambda n, v: [v[0], *["1.00000"] * 6])
    with pytest.raises(InputError, match="all 6 channels are dead"):
        strain.read_recording(written(tmp_path, lines, **{"daq.log": dead}), settings)


def test_logs_of_two_captures_are_refused(settings, lines, tmp_path):
    rng = np.random.default_rng(0)
    daq = edited(lines, lambda n, v: [v[0], *(f"{u:.5f}" for u in rng.uniform(2, 3, 6))])
    with pytest.raises(InputError, match="do not follow each other"):
        strain.read_recording(written(tmp_path, lines, **{"daq.log": daq}), settings)


def test_missing_log_clock_set_back_and_unknown_task(settings, lines, tmp_path):
    target = written(tmp_path, lines)
    (target / "robot.log").unlink()
    with pytest.raises(InputError, match=r"robot\.log: log not found"):
        strain.read_recording(target, settings)
    back = edited(lines, lambda n, v: [f"{float(v[0]) - 150:.4f}" if n > 1000 else v[0], *v[1:]])
    with pytest.raises(InputError, match="steps back"):
        strain.read_recording(written(tmp_path, lines, **{"daq.log": back}), settings)
    with pytest.raises(InputError, match="'task_9' is no task; .* task_0, task_1, task_2 .*strain.sensor.tasks"):
        strain.read_recording(tmp_path / "task_9" / "run000", settings)


def frames_of(recordings: dict[str, int]) -> pa.Table:
    """A frames table of one channel; recordings: `<task>/<recording>` -> number of samples."""
    names = [name.split("/") for name, count in recordings.items() for _ in range(count)]
    n = len(names)
    columns = {
        "condition": [task for task, _ in names],
        "recording": [recording for _, recording in names],
        "segment": np.zeros(n, np.int16),
        "t_s": np.arange(n) / 5,
        "gap_before": np.arange(n) == 0,
        "press": np.full(n, -1, np.int32),
        "v": schemas.lists(np.zeros((n, 1)), pa.float32()),
        "y_mm": schemas.lists(np.zeros((n, 3)), pa.float32()),
    }
    return pa.table(columns).cast(strain.frames_schema({"sensor": {"channels": 1}}))


def test_a_task_needs_a_recording_and_may_have_several(settings):
    frames = frames_of({"task_0/run000": 100, "task_1/run000": 100, "task_1/run001": 100})
    for seed, used in ((0, slice(100, 200)), (1, slice(200, 300))):
        part = strain.split(frames, settings, "task_1", seed)
        assert set(part[used]) == {"train", "validation", "test"} and (np.delete(part, np.r_[used]) == "unused").all()
    with pytest.raises(InputError, match="strain.protocols.task_2: no recording of this task to train on; add one"):
        strain.split(frames, settings, "task_2", 0)


def test_recordings_of_another_day_are_test_data_alone(settings):
    frames = frames_of({"task_1/day1": 100, "task_1/day2": 50, "task_1/day3": 100})
    settings = settings | {"split": settings["split"] | {"test_recordings": ["day2"]}}
    part = strain.split(frames, settings, "task_1", 0)
    counts = [
        {name: int((part[rows] == name).sum()) for name in set(part[rows])} for rows in (slice(100), slice(100, 150))
    ]
    assert counts == [{"train": 90, "validation": 10}, {"test": 50}] and set(part[150:]) == {"train", "validation"}
    settings["split"]["test_recordings"] = ["day1", "day2", "day3"]
    with pytest.raises(InputError, match="no recording of this task to train on"):
        strain.split(frames, settings, "task_1", 0)


def held(folder, settings, ohm=False):
    """A recording of one sensor on one stage that presses and holds, and its settings."""
    own_logs.pressed_and_held(folder, "stretch", {"day1": 120.0}, ohm=ohm)
    sensor = {"channels": 1, "tasks": {"stretch": ["x"]}} | ({"unit": "ohm"} if ohm else {})
    return folder / "stretch" / "day1", settings | {"sensor": sensor}


def test_one_sensor_on_one_axis_that_presses_and_holds(settings, tmp_path):
    target, settings = held(tmp_path, settings)
    with pytest.raises(InputError, match=r"the arm moves in \d\.\d % of the time, too little .*clock: shared"):
        strain.read_recording(target, settings)
    shared = settings | {"ingest": settings["ingest"] | {"clock": "shared"}}
    frames, _, report = strain.read_recording(target, shared)
    clock = report["robot.log"]["clock"]
    assert clock["offset_ms"] == 0 and clock["correlation"] is None, "not measured: the arm moves too little"
    x = schemas.matrix(frames["y_mm"])
    assert (x[:, 1:] == 0).all() and np.ptp(x[:, 0]) > 5
    assert strain.task("stretch", shared) == series.Task((0,), {"stretch": [0]}, False, "stretch")
    assert (frames["press"].to_numpy() == -1).all()


def test_readings_are_averaged_and_may_be_ohms(settings, tmp_path):
    """1 kHz with 10 mV of noise, at 5 Hz: means of 200 readings have 0.7 mV, single ones the whole noise."""
    target, settings = held(tmp_path, settings, ohm=True)
    noise = {}
    for average in (False, True):
        ingest = settings["ingest"] | {"clock": "shared", "average": average}
        frames, _, _ = strain.read_recording(target, settings | {"ingest": ingest})
        t, v = frames["t_s"].to_numpy(), schemas.matrix(frames["v"])[:, 0] / 3e4
        at_rest = (t % 4 > 0.5) & (t % 4 < 3.7)
        x = schemas.matrix(frames["y_mm"])[:, 0]
        noise[average] = np.std((v - 2 - 0.1 * x)[at_rest])
    assert 0.008 < noise[False] < 0.012 and noise[True] < 0.0015


def test_only_pressed_samples_count_where_a_depth_is_set(settings, lines, whole, tmp_path):
    z = schemas.matrix(whole[0]["y_mm"])[:, 2]
    masked = settings | {"sensor": settings["sensor"] | {"pressed_below_mm": float(np.median(z))}}
    frames = strain.read_recording(written(tmp_path, lines), masked)[0]
    press, z = frames["press"].to_numpy(), schemas.matrix(frames["y_mm"])[:, 2]  # on a clock of presses alone
    assert ((press >= 0) == (z < masked["sensor"]["pressed_below_mm"])).all()
    assert set(np.diff(press[press >= 0])) <= {0, 1} and press.max() > 2
    assert strain.task("task_1", masked).pressed_only and not strain.task("task_1", settings).pressed_only


def test_split_is_chronological(settings, whole):
    part = list(strain.split(whole[0], settings, "task_1", 0))
    order = [part.index(name) for name in ("train", "validation", "test")]
    assert order == sorted(order) and (part[-1], part[0]) == ("test", "train")
    with pytest.raises(InputError, match="no task 'task_7'"):
        strain.task("task_7", settings)


def own_strain(folder, settings, late_s=0.0):
    """A recording by four strands and a robot on one clock, the robot's times later by `late_s`, and its settings."""
    own_logs.strain(folder, 4, 12.0, seconds=120.0)
    place = next((folder / "task_1").iterdir())
    for name, true_s in (("robot.log", lambda t: (t - 1.7e9) / (1 + 30e-6) + late_s), ("daq.log", lambda t: t + 1.2)):
        lines = [line.partition(",") for line in (place / name).read_text().splitlines()]
        moved = [f"{true_s(float(t)) + 10:.4f},{rest}" for t, _, rest in lines if rest and t.replace(".", "").isdigit()]
        (place / name).write_text("\n".join(moved) + "\n")
    shared = settings["ingest"] | {"clock": "shared"}
    return place, settings | {"sensor": {"channels": 4}, "ingest": shared}


def test_a_robot_on_the_daqs_clock_is_measured(settings, tmp_path):
    place, shared = own_strain(tmp_path, settings)
    robot = strain.read_recording(place, shared)[2]["robot.log"]
    assert robot["clock"]["offset_ms"] == 0 and abs(robot["clock"]["measured_offset_ms"]) < 100
    assert 0.5 < robot["clock"]["correlation"] < 1 and "warnings" not in robot


@pytest.mark.parametrize("late_s", [1.5, -1.5])
def test_a_robot_that_does_not_share_the_daqs_clock_is_refused(settings, tmp_path, late_s):
    place, shared = own_strain(tmp_path, settings, late_s)
    word = "earlier" if late_s > 0 else "later"
    with pytest.raises(
        InputError, match=rf"agree best with robot.log 1\.[45]\d s {word} .* set strain.ingest.clock: own"
    ):
        strain.read_recording(place, shared)


def test_a_robot_that_is_a_little_late_is_a_warning(settings, tmp_path):
    place, shared = own_strain(tmp_path, settings, 0.3)
    assert "look at what delays one" in strain.read_recording(place, shared)[2]["robot.log"]["warnings"][0]


@pytest.mark.parametrize("late_s", [0.0, 2.0])
def test_an_arm_that_lifts_off_needs_a_surface(settings, tmp_path, late_s):
    """Presses of 3.5 to 5 mm, and lifts of 5 mm between them, at the true surface of 0 mm."""
    rng, time = np.random.default_rng(0), np.arange(0, 184, 0.02)
    press, phase = np.divmod(np.clip(time - 2, 0, 179.99), 6)
    deepest = rng.uniform(3.5, 5, 30)[press.astype(int)]
    depth = deepest * np.clip(np.minimum(phase, 4.5 - phase) / 1.5, 0, 1)
    z = 5 * np.clip(np.minimum(phase - 4.5, 6 - phase) / 0.5, 0, 1) - depth
    volts = 1 + np.outer(depth, (0.03, 0.07, 0.1)) + rng.normal(0, 4e-4, (len(time), 3))
    (tmp_path / "press" / "day1").mkdir(parents=True)
    for name, at, values in (("daq.log", time, volts), ("robot.log", time + late_s, z[:, None])):
        rows = [f"{t:.3f}," + ",".join(f"{value:.5f}" for value in row) for t, row in zip(at, values, strict=True)]
        (tmp_path / "press" / "day1" / name).write_text("\n".join(rows) + "\n")
    sensor = {"channels": 3, "tasks": {"press": ["z"]}}
    clock = {} if late_s else {"clock": "shared"}
    own = settings | {"sensor": sensor, "ingest": settings["ingest"] | clock}
    with pytest.raises(
        InputError, match=r"press/day1: no reading changes while z is above -?\d.\d+ mm, in [56]\d % of its way"
    ):
        strain.read_recording(tmp_path / "press" / "day1", own)
    own["sensor"] = sensor | {"pressed_below_mm": 0.0}
    report = strain.read_recording(tmp_path / "press" / "day1", own)[2]["robot.log"]["clock"]
    found = report["offset_ms"] if late_s else report["measured_offset_ms"]
    assert abs(found + 1e3 * late_s) < 150, report


def test_a_depth_of_presses_needs_z(settings, tmp_path):
    target, settings = held(tmp_path, settings)
    settings = settings | {"sensor": settings["sensor"] | {"pressed_below_mm": -1.0}}
    with pytest.raises(InputError, match="pressed_below_mm: no task asks for z, .* add z to a task"):
        strain.read_recording(target, settings)
