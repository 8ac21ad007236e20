"""The ingest stage: faults at known lines end up in the rejects table, everything else in the frames."""

import itertools
import json
import re

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq
import pytest
from builders.project import ROOT
from builders.touch_logs import SETTINGS, lines, logs_of, presses, save

from tactile import experiments
from tactile.base import params
from tactile.base.errors import InputError
from tactile.datasets import schemas
from tactile.datasets.windowing import windows_of
from tactile.experiments import touch
from tactile.logs import alignment, sources
from tactile.stages import ingest


def run(workspace, settings=SETTINGS):
    ingest.ingest(workspace, "touch", settings)
    data = workspace.root / "data" / "touch"
    report = json.loads((data / "ingest.json").read_text())
    return pq.read_table(data / "frames.parquet"), pq.read_table(data / "rejects.parquet"), report


def test_faults_at_known_lines_are_the_rejects(workspace):
    logs = logs_of()
    array = logs["array.log"]
    array[200] = array[200][:7]  # line 201
    array[300] = array[300].rpartition(",")[0] + ",99999"
    array.insert(400, array[399])
    array[500], array[501] = array[501], array[500]
    del array[600]
    logs["load_cell.log"][1000] = "nan,1.0"
    save(workspace.root / "data/touch/logs/single/run000", logs)
    frames, rejects, report = run(workspace)
    found = [tuple(row.values())[2:5] for row in rejects.to_pylist() if row["reason"] != touch.NO_GROUND_TRUTH]
    assert sorted(found) == [
        ("array.log", 1, "banner or text"),
        ("array.log", 201, "column count"),
        ("array.log", 301, "out of range"),
        ("array.log", 401, "duplicate"),
        ("array.log", 502, "out of order"),
        ("load_cell.log", 1001, "not a number"),
    ]
    assert set(rejects["recording"].to_pylist()) == {"run000"} and rejects.schema == schemas.REJECTS
    files = report["recordings"]["single/run000"]["files"]
    for name, content in logs.items():
        assert files[name]["lines"] == len(content) == files[name]["accepted"] + sum(files[name]["rejects"].values())
    assert frames.num_rows == files["array.log"]["accepted"] == report["recordings"]["single/run000"]["frames"]
    # Missing frames: the torn one, the one out of range, the late one and the deleted one.
    assert files["array.log"]["gaps"] == 4
    assert np.flatnonzero(frames["gap_before"].to_numpy())[0] == 0
    assert frames["gap_before"].to_numpy().sum() == 1 + 4
    assert files["array.log"]["rate_hz"] == pytest.approx(50) and files["cnc.log"]["segments"] == 1


def test_frames_have_the_truth_of_their_time(workspace):
    save(workspace.root / "data/touch/logs/single/run000", logs_of(seconds=60))
    frames, _, report = run(workspace)
    assert frames.schema.equals(schemas.frames(6, 3, frames.schema.field("v").type.value_type))
    assert frames.schema.field("v").type.value_type == "int16"
    t = frames["t_s"].to_numpy()
    # The load cell prints 8 s at the true time 0.5 s; x runs as 2 t, y as 3 t.
    true = t - 7.5
    x, y, force = (np.array(frames[name].to_pylist()) for name in ("x_mm", "y_mm", "force_n"))
    assert np.abs(x[:, 0] / 2 - true).max() < 0.01 and np.abs(y[:, 0] / 3 - true).max() < 0.01
    grid, expected = presses(60, 0)
    # Up to 250 N/s between samples 10 ms apart: a corner of the press is cut by up to 0.6 N.
    assert np.abs(force[:, 0] - np.interp(true, grid, expected)).max() < 0.7
    assert np.isnan(force[:, 1:]).all() and np.isnan(x[:, 1:]).all()
    first = 1.0 + 7.5  # true start of the array's log, on the load cell's clock
    assert t[0] == pytest.approx(first, abs=0.01)
    clock = report["recordings"]["single/run000"]["files"]["array.log"]["clocks"][0]
    assert clock["offset_ms"] == pytest.approx(1e3 * (first - 3.0), abs=10)


def test_noise_of_a_fast_load_cell_does_not_hide_the_presses(workspace):
    """1000 samples a second with 2 N of noise, 5 % of the strongest press."""
    t, force = presses(60, 0)
    noise = iter(np.random.default_rng(0).normal(0, 2.0, 60_000))
    clean = [line.split(",") for line in lines(t, [force], 0.5, 60, 1000, 8_000_000, "%.3f")]
    fast = [f"{at},{float(value) + next(noise):.3f}" for at, value in clean]
    save(workspace.root / "data/touch/logs/single/run000", logs_of(seconds=60) | {"load_cell.log": fast})
    clock = run(workspace)[2]["recordings"]["single/run000"]["files"]["array.log"]["clocks"][0]
    assert clock["offset_ms"] == pytest.approx(1e3 * (1.0 + 7.5 - 3.0), abs=10)


def test_frames_without_ground_truth_are_rejects_with_their_lines(workspace):
    logs = logs_of(seconds=60)
    logs["load_cell.log"] = logs["load_cell.log"][: -3 * 100]  # stops 3 s early: within max_clock_offset_s
    del logs["cnc.log"][1500:1510]  # a hole of 0.2 s: 10 intervals
    save(workspace.root / "data/touch/logs/single/run000", logs)
    frames, rejects, _ = run(workspace)
    missed = [row["line"] for row in rejects.to_pylist() if row["reason"] == touch.NO_GROUND_TRUTH]
    late, hole = [n for n in missed if n > 2500], [n for n in missed if n <= 2500]
    assert len(late) == pytest.approx(150, abs=2) and late[-1] == len(logs["array.log"])
    assert len(hole) == pytest.approx(11, abs=2) and np.ptp(hole) == len(hole) - 1
    assert frames["gap_before"].to_numpy().sum() == 2


def test_a_load_cell_that_stops_early_is_refused(workspace):
    logs = logs_of(seconds=60)
    logs["load_cell.log"] = logs["load_cell.log"][: 30 * 100]
    save(workspace.root / "data/touch/logs/single/run000", logs)
    with pytest.raises(InputError, match="array.log: .*'no ground truth at this time'"):
        run(workspace)


def test_a_reset_gives_two_aligned_segments(workspace):
    save(workspace.root / "data/touch/logs/single/run000", logs_of(seconds=40, reset_at=15.0))
    frames, rejects, report = run(workspace)
    segment, t = frames["segment"].to_numpy(), frames["t_s"].to_numpy()
    assert np.unique(segment).tolist() == [0, 1]
    x = np.array(frames["x_mm"].to_pylist())[:, 0]
    starts = np.flatnonzero(np.diff(segment, prepend=-1))
    assert t[starts] - 7.5 == pytest.approx([1.0, 16.2], abs=0.02)
    assert np.abs(x / 2 - (t - 7.5)).max() < 0.01
    assert frames["gap_before"].to_numpy()[starts].all()
    assert len(report["recordings"]["single/run000"]["files"]["array.log"]["clocks"]) == 2


def test_a_segment_too_short_to_align_is_rejected_whole(workspace):
    save(workspace.root / "data/touch/logs/single/run000", logs_of(seconds=60, reset_at=58.0))
    frames, rejects, _ = run(workspace)
    short = [row for row in rejects.to_pylist() if row["reason"] == touch.TOO_SHORT]
    assert len(short) == 40 and short[0]["line"] == 2 + 57 * 50 + 1 and short[0]["text"].startswith("350000,")
    assert np.unique(frames["segment"].to_numpy()).tolist() == [0]


@pytest.mark.parametrize("shared", [True, False])
def test_further_touches_fill_their_columns(workspace, shared):
    logs = logs_of(seconds=60, touches=2, shared=shared)
    save(workspace.root / "data/touch/logs/double/run000", logs)
    frames, _, report = run(workspace)
    true = frames["t_s"].to_numpy() - 7.5
    force, x = (np.array(frames[name].to_pylist()) for name in ("force_n", "x_mm"))
    grid, expected = presses(60, 2)
    assert np.sqrt(np.mean((force[:, 1] - np.interp(true, grid, expected)) ** 2)) < 2.0
    # Targets are held until the next one, 20 ms later.
    assert np.abs(x[:, 1] / 2 - true).max() < 0.04
    targets = [float(line.split(",")[1]) for line in logs["cnc_2.log"]]
    assert np.isin(np.round(x[:, 1].astype(float), 3), np.round(targets, 3)).all()
    assert np.isnan(force[:, 2]).all()
    clocks = {name: file["clocks"] for name, file in report["recordings"]["double/run000"]["files"].items()}
    assert (clocks["load_cell_2.log"] == clocks["load_cell.log"]) == shared
    assert clocks["cnc_2.log"] == clocks["load_cell_2.log"]


def outputs(root):
    return [(root / "data/touch" / name).read_bytes() for name in ("frames.parquet", "rejects.parquet", "ingest.json")]


@pytest.fixture
def three_recordings(workspace, monkeypatch):
    """Recordings with faults, and what one process makes of them."""
    for k in range(3):
        logs = logs_of(seconds=20 + 10 * k, seed=k)
        logs["array.log"][200 + k] = logs["array.log"][200 + k][:7]
        save(workspace.root / f"data/touch/logs/single/run00{k}", logs)
    monkeypatch.setenv("WORKERS", "1")
    run(workspace)
    return outputs(workspace.root)


def test_the_number_of_processes_changes_no_byte(workspace, three_recordings, monkeypatch):
    read = []
    monkeypatch.setattr(ingest, "SMALL", 0)
    monkeypatch.setenv("WORKERS", "2")
    monkeypatch.setattr(ingest, "_in_turn", lambda *_: read.append("in turn"))
    run(workspace)
    assert not read
    assert outputs(workspace.root) == three_recordings


@pytest.mark.parametrize(("logs_held", "in_turn"), [(1.9, True), (2.1, False)])
def test_recordings_too_large_for_the_memory_are_read_one_by_one(
    logs_held, in_turn, workspace, three_recordings, monkeypatch
):
    """logs_held: how many times the memory has room for two recordings at once, of which half is ours."""
    sizes = sorted(
        sum(log.stat().st_size for log in run0.iterdir())
        for run0 in (workspace.root / "data/touch/logs/single").iterdir()
    )
    monkeypatch.setattr(ingest, "SMALL", 0)
    monkeypatch.setattr(ingest.processes, "memory_bytes", lambda: logs_held * ingest.MEMORY * sum(sizes[-2:]))
    monkeypatch.setenv("WORKERS", "2")
    other = "_in_processes" if in_turn else "_in_turn"
    monkeypatch.setattr(ingest, other, lambda *_: pytest.fail(f"{other} was called"))
    run(workspace)
    assert outputs(workspace.root) == three_recordings


def test_recordings_that_are_done_in_another_order_are_written_in_theirs(workspace, three_recordings, monkeypatch):
    """Also those whose frames are made in several parts, which pass through as many files."""
    run_tasks, parts = ingest.workers.run, []
    monkeypatch.setattr(touch, "PART", 600)
    run(workspace)
    in_parts = outputs(workspace.root)
    assert in_parts != three_recordings  # a part is a row group of its own

    def backwards(function, tasks, bar, folders):
        results = list(run_tasks(function, tasks, bar, folders=folders))
        parts.extend(len(list(folder.iterdir())) for folder in folders.values())
        return reversed(results)

    monkeypatch.setattr(ingest.workers, "run", backwards)
    monkeypatch.setattr(ingest, "_in_turn", ingest._in_processes)
    run(workspace)
    assert len(parts) == 3 and min(parts) > 1
    assert outputs(workspace.root) == in_parts
    assert not list((workspace.root / "data/touch").glob("*.unfinished"))


def test_a_recording_that_cannot_be_read_leaves_nothing_unfinished(workspace, three_recordings, monkeypatch):
    (workspace.root / "data/touch/logs/single/run001/cnc.log").write_text("ready\n")
    monkeypatch.setattr(ingest, "_in_turn", ingest._in_processes)
    with pytest.raises(InputError, match="no line can be read"):
        run(workspace)
    assert outputs(workspace.root) == three_recordings
    assert not list((workspace.root / "data/touch").glob("*.parts.unfinished"))


def test_frames_that_cannot_be_written_stop_the_stage(workspace, three_recordings, monkeypatch):
    """They are written in a thread beside the reading."""

    def full(self, *_, **__):
        raise OSError("no space left")

    monkeypatch.setattr(pq.ParquetWriter, "write_table", full)
    with pytest.raises(OSError, match="no space left"):
        run(workspace)
    assert outputs(workspace.root) == three_recordings


def test_own_logs_are_read_from_the_named_folder(workspace):
    save(workspace.root / "data/own/logs/single/monday", logs_of())
    frames, _, _ = run(workspace, SETTINGS | {"source": "data/own/logs"})
    assert frames["recording"].unique().to_pylist() == ["monday"]


def broken(change):
    logs = logs_of()
    change(logs)
    return logs


BAD = {
    "too many rejects": (
        lambda logs: logs["load_cell.log"].__setitem__(slice(100, 600, 2), ["12,"] * 250),
        "load_cell.log: 12.8% of the 1950 lines cannot .*'not a number'.*5.0%.*ingest.max_reject_fraction",
    ),
    "no CNC": (lambda logs: logs.pop("cnc.log"), "cnc.log: log not found"),
    "no target": (lambda logs: logs.update({"load_cell_2.log": ["1,2"]}), "cnc_2.log: log not found"),
    "strange log": (lambda logs: logs.update({"cnc_left.log": ["1,2"]}), "cnc_left.log: no such log"),
    "wrong array size": (
        lambda logs: logs.update({"array.log": ["1,2,3"] * 100}),
        "array.log: no line can be read; line 1 has 3 columns.*expected lines of 7 columns",
    ),
    "empty file": (lambda logs: logs.update({"cnc.log": []}), "cnc.log: no line can be read"),
    "logs of another recording": (
        lambda logs: logs.update({"load_cell.log": logs_of(seed=9)["load_cell.log"]}),
        "single/run000, array.log against load_cell.log: the signals do not follow",
    ),
    "too many touches": (
        lambda logs: logs.update({f"{d}_{k}.log": ["1,2"] for d in ("load_cell", "cnc") for k in (2, 3, 4)}),
        "4 touches are more than touch.ingest.max_touches \\(3\\)",
    ),
}  # fmt: skip


@pytest.mark.parametrize("fault", BAD)
def test_bad_input_is_one_sentence_and_leaves_no_table(workspace, fault):
    change, sentence = BAD[fault]
    save(workspace.root / "data/touch/logs/single/run000", broken(change))
    with pytest.raises(InputError, match=sentence):
        run(workspace)
    assert not (workspace.root / "data/touch/frames.parquet").exists()


def test_missing_folders_are_one_sentence(workspace):
    with pytest.raises(InputError, match="run `python -m pipeline.stages.simulate touch` first"):
        run(workspace)
    with pytest.raises(InputError, match="touch.source: there is no folder nowhere"):
        run(workspace, SETTINGS | {"source": "nowhere"})
    (workspace.root / "data/own/empty").mkdir(parents=True)
    with pytest.raises(InputError, match="empty: no recordings found"):
        run(workspace, SETTINGS | {"source": "data/own/empty"})


def velostat(workspace, repetition, seconds=5.0, per_n=-0.5):
    """Two small logs in the published layout; the force is 2 (t - 1.6e9), the reading 800 + `per_n` times it."""
    for device, hz, late in (("velostat_data", 143.0, 0.0), ("futek_data", 250.0, 0.1)):
        t = 1.6e9 + late + np.arange(0, seconds, 1 / hz)
        values = 2 * (t - 1.6e9)
        values = 800 + per_n * values if device == "velostat_data" else values
        folder = sources.folder(workspace, "velostat_recorded") / device / "pike1_force_5"
        path = folder / f"exp_pike1_force_5_sensor1_{repetition}.txt"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("".join(f"{v:.4f} {s:.6f}\n" for v, s in zip(values, t, strict=True)))
    return path


VALUES = params.load(ROOT / "params.yaml")
VELOSTAT_SETTINGS = VALUES["velostat_recorded"]


def test_velostat_recordings_share_a_clock(workspace, monkeypatch):
    monkeypatch.setattr(sources, "is_complete", lambda *given: True)
    cells = [velostat(workspace, repetition) for repetition in ("exp1", "exp2")]
    ingest.ingest(workspace, "velostat_recorded", VELOSTAT_SETTINGS)
    data = workspace.root / "data" / "velostat_recorded"
    frames, rejects = pq.read_table(data / "frames.parquet"), pq.read_table(data / "rejects.parquet")
    assert frames.schema.equals(schemas.frames(1, 1, pa.float32()))
    assert frames["recording"].unique().to_pylist() == ["pike1_force_5/exp1", "pike1_force_5/exp2"]
    t = frames["t_s"].to_numpy() - 1.6e9
    assert np.array(frames["force_n"].to_pylist())[:, 0] == pytest.approx(2 * t, abs=1e-3)
    printed = [np.loadtxt(str(cell).replace("futek_data", "velostat_data"))[15:, 0] for cell in cells]
    assert np.array_equal(schemas.matrix(frames["v"])[:, 0], np.concatenate(printed).astype(np.float32))
    assert np.isnan(schemas.matrix(frames["x_mm"])).all() and np.isnan(schemas.matrix(frames["y_mm"])).all()
    # The load cell starts 0.1 s late: 15 readings have no force.
    assert rejects["line"].to_pylist() == [*range(1, 16)] * 2
    names = [f"velostat_data/exp_pike1_force_5_sensor1_{repetition}.txt" for repetition in ("exp1", "exp2")]
    assert sorted(set(rejects["file"].to_pylist())) == names
    assert json.loads((data / "ingest.json").read_text())["run"] is True


@pytest.mark.parametrize(
    ("per_n", "high", "sentence"),
    [
        (0.5, 1e5, r"velostat_data/.*_exp1\.txt: the resistances seem to rise when pressed; they should fall"),
        (-0.5, 797.5, r"velostat_data/.*_exp1\.txt: .*out of range.*velostat_recorded\.ingest\.max_reject_fraction"),
    ],
)
def test_resistances_fall_when_pressed_and_are_in_their_range(workspace, monkeypatch, per_n, high, sentence):
    monkeypatch.setattr(sources, "is_complete", lambda *given: True)
    velostat(workspace, "exp1", per_n=per_n)
    asked = VELOSTAT_SETTINGS["ingest"] | {"highest_resistance": high}
    with pytest.raises(InputError, match=sentence):
        ingest.ingest(workspace, "velostat_recorded", VELOSTAT_SETTINGS | {"ingest": asked})


def test_a_velostat_log_without_its_pair_is_refused(workspace, monkeypatch):
    monkeypatch.setattr(sources, "is_complete", lambda *given: True)
    velostat(workspace, "exp1").unlink()
    with pytest.raises(InputError, match="futek_data/pike1_force_5/.*log not found"):
        ingest.ingest(workspace, "velostat_recorded", VELOSTAT_SETTINGS)


def test_without_recordings_the_stage_says_so(workspace):
    part = (
        sources.folder(workspace, "velostat_recorded") / "velostat_data" / "pike1" / "exp_pike1_sensor1_exp1.txt.part"
    )
    part.parent.mkdir(parents=True)
    part.write_text("1.0")  # of a download that was interrupted in its first file
    ingest.ingest(workspace, "velostat_recorded", VELOSTAT_SETTINGS)
    data = workspace.root / "data" / "velostat_recorded"
    assert pq.read_table(data / "frames.parquet").num_rows == 0
    assert pq.read_table(data / "rejects.parquet").schema.equals(schemas.REJECTS)
    report = json.loads((data / "ingest.json").read_text())
    assert report["run"] is False and "tactile fetch velostat_recorded" in report["reason"]


DAMAGES = {
    "one byte": lambda path: path.write_bytes(b"X" + path.read_bytes()[1:]),
    "one byte more": lambda path: path.write_bytes(path.read_bytes() + b"\n"),
    "empty": lambda path: path.write_bytes(b""),
    "missing": lambda path: path.unlink(),
    "a folder": lambda path: (path.unlink(), path.mkdir()),
}


@pytest.mark.parametrize("experiment", experiments.having("source"))
@pytest.mark.parametrize("damage", DAMAGES)
def test_one_file_of_a_source_that_is_not_right_stops_the_stage(workspace, experiment, damage, monkeypatch):
    """What an earlier run wrote stays: DVC would take an empty table for the result."""
    at, listed = sources.folder(workspace, experiment), sorted(sources.files(experiment))[:5]
    there = {name: {path: at / path for path in sources.members(name)} for name in listed}
    for path, place in itertools.chain.from_iterable(each.items() for each in there.values()):
        place.parent.mkdir(parents=True, exist_ok=True)
        place.write_text(path)
    digests = {name: sources.digest(each) for name, each in there.items()}
    monkeypatch.setattr(sources, "files", lambda name: digests)
    assert sources.is_complete(workspace, experiment)
    report = workspace.ingest_report(experiment)
    report.parent.mkdir(parents=True)
    report.write_text("of an earlier run")
    name = listed[len(listed) // 2]
    path = list(there[name].values())[len(there[name]) // 2]
    DAMAGES[damage](path)
    said = rf"{re.escape(str(path))}: is|{re.escape(str(at / name))}: are"  # the second of numbered files together
    with pytest.raises(InputError, match=rf"^({said}) .*`tactile fetch {experiment}`"):
        ingest.ingest(workspace, experiment, VALUES[experiment])
    assert report.read_text() == "of an earlier run"
    assert [one.name for one in report.parent.iterdir()] == ["ingest.json"]


SHARED = SETTINGS | {"ingest": SETTINGS["ingest"] | {"clock": "shared"}}
ZERO_US = {"array.log": -2_000_000, "load_cell.log": -7_500_000, "cnc.log": -500_000}  # its clock at the true time 0


def numbers(log, change):
    """The lines of a log, with `change(time in us, values)` applied to those of numbers."""
    result = []
    for line in log:
        time_us, *values = line.split(",")
        if values and time_us.isdigit():
            time_us, values = change(int(time_us), values)
        result.append(",".join(map(str, [time_us, *values])))
    return result


def one_clock(seconds=40.0, late_s=None, **more):
    """Logs whose devices print the true time, those of `late_s` later by as much (s)."""
    logs = logs_of(seconds=seconds, **more)
    result = {}
    for name, log in logs.items():
        zero_us = ZERO_US[name.replace("_2", "")] + round(1e6 * (late_s or {}).get(name, 0))
        result[name] = numbers(log, lambda t, v, zero_us=zero_us: (t + zero_us, v))
    return result


def read(root, logs, settings=SHARED):
    save(root / "single" / "run000", logs)
    return touch.read_recording(root / "single" / "run000", settings)


@pytest.mark.parametrize(
    "name, order", [("array.log", [0, 5, 4, 3, 2, 1, 6]), ("cnc.log", [3, 1, 0, 2]), ("load_cell.log", [1, 0])]
)
def test_a_header_in_another_order_gives_the_same_frames(tmp_path, name, order):
    logs = logs_of()
    fmt = {"array.log": touch.array_format(SETTINGS), "cnc.log": touch.CNC, "load_cell.log": touch.LOAD_CELL}[name]
    lines = [fmt.header, *logs[name]]
    swapped = [",".join(line.split(",")[k] for k in order) if "," in line else line for line in lines]
    plain, _, report = read(tmp_path / "plain", logs | {name: lines}, SETTINGS)
    frames, _, again = read(tmp_path / "swapped", logs | {name: swapped}, SETTINGS)
    assert repr(frames.to_pydict()) == repr(plain.to_pydict()) and again == report  # NaN is no NaN to equals


def test_clocks_that_are_shared_are_measured_and_not_shifted(tmp_path):
    logs = one_clock()
    frames, _, report = read(tmp_path, logs)
    assert frames.num_rows == len(logs["array.log"]) - 1
    for name in ("array.log", "cnc.log"):
        (clock,) = report[name]["clocks"]
        assert clock["offset_ms"] == 0 and abs(clock["measured_offset_ms"]) < 10, name
        assert 0.8 < clock["correlation"] <= clock["best_correlation"] + 0.01 < 1
    assert "correlation" not in report["load_cell.log"]["clocks"][0]
    assert not any("warnings" in log for log in report.values())
    assert np.abs(schemas.matrix(frames["x_mm"])[:, 0] / 2 - frames["t_s"].to_numpy()).max() < 0.01
    with pytest.raises(InputError, match="array.log: its time steps back, .* set touch.ingest.clock: own"):
        read(tmp_path / "reset", logs_of(reset_at=15.0))


@pytest.mark.parametrize("name", ["array.log", "cnc.log", "load_cell_2.log"])
@pytest.mark.parametrize("late_s", [1.5, -1.5])
def test_clocks_that_are_said_to_be_shared_and_are_not_are_refused(tmp_path, name, late_s):
    touches = 2 if "_2" in name else 1
    logs = one_clock(seconds=60.0, late_s={name: late_s}, touches=touches)
    word = "earlier" if late_s > 0 else "later"
    words = rf"and \w+.log agree best with {name} 1\.[45]\d s {word} \(correlation 0\.\d\d, as they are .*clock: own"
    with pytest.raises(InputError, match=words):
        read(tmp_path, logs)


def test_a_small_offset_of_shared_clocks_is_a_warning(tmp_path):
    _, _, report = read(tmp_path, one_clock(late_s={"array.log": 0.1}))
    assert report["array.log"]["clocks"][0]["measured_offset_ms"] == pytest.approx(-100, abs=10)
    assert re.search("array.log 0.10 s earlier .* a press lasts 0.6 s", report["array.log"]["warnings"][0])


def test_shared_clocks_are_not_measured_by_too_few_presses(tmp_path):
    logs = one_clock(seconds=5.0)
    _, _, report = read(tmp_path, logs)
    (clock,) = report["array.log"]["clocks"]
    assert clock == {"offset_ms": 0.0, "drift_ppm": 0.0} | alignment.UNMEASURED


def test_regular_presses_on_one_clock_are_no_shift(tmp_path):
    t = np.arange(0, 40, 0.005)
    force = 20 * np.clip(np.abs((t % 1.0) - 0.5) * -8 + 2.4, 0, 1)
    logs = {
        "array.log": lines(t, [20 * force**0.7 * k for k in (1, 0.5, 0.2, 0.1, 0, 0)], 1, 40, 50, 1_000_000, "%d"),
        "load_cell.log": lines(t, [force], 0.5, 40, 100, 500_000, "%.3f"),
        "cnc.log": lines(t, [2 * t, 3 * t, -(force ** (2 / 3))], 0, 40, 50, 0, "%.3f"),
    }
    _, _, report = read(tmp_path, logs)
    assert abs(report["array.log"]["clocks"][0]["measured_offset_ms"]) < 10


REVERSED = {
    "counts": (
        "array.log",
        lambda t, v: (t, [1023 - int(one) for one in v]),
        "array.log: the counts .* fall .* 1023 minus",
    ),
    "depth": (
        "cnc.log",
        lambda t, v: (t, [*v[:2], -float(v[2])]),
        "cnc.log: z_mm seems to rise when pressed; write it neg",
    ),
    "force": ("load_cell.log", lambda t, v: (t, [-float(v[0])]), "load_cell.log: pressing makes fz_n negative"),
}


@pytest.mark.parametrize("shared", [True, False])
@pytest.mark.parametrize("which", REVERSED)
def test_a_reversed_sign_is_named(tmp_path, which, shared):
    name, change, words = REVERSED[which]
    logs = one_clock() if shared else logs_of(seconds=40.0)
    with pytest.raises(InputError, match=words):
        read(tmp_path, logs | {name: numbers(logs[name], change)}, SHARED if shared else SETTINGS)


@pytest.mark.parametrize("shared", [True, False])
def test_counts_that_fall_are_named_for_a_single_element_too(tmp_path, shared):
    logs = one_clock() if shared else logs_of(seconds=40.0)
    logs["array.log"] = numbers(logs["array.log"], lambda t, v: (t, [1023 - int(v[2])]))
    del logs["cnc.log"]
    settings = (SHARED if shared else SETTINGS) | {"sensor": SETTINGS["sensor"] | {"rows": 1, "cols": 1}}
    with pytest.raises(InputError, match="the counts seem to fall when pressed"):
        read(tmp_path, logs, settings)


@pytest.mark.parametrize("reversed_", [False, True])
def test_torn_lines_are_called_torn_with_a_shared_clock_too(tmp_path, reversed_):
    logs = one_clock()
    change = (lambda t, v: (t, [1023 - int(one) for one in v])) if reversed_ else (lambda t, v: (t, v))
    logs["array.log"] = numbers(logs["array.log"], change)
    logs["array.log"][10::10] = [line[: len(line) // 2] for line in logs["array.log"][10::10]]
    with pytest.raises(InputError, match=r"array\.log: 10\.0% of the .* most often 'column count'"):
        read(tmp_path, logs)


@pytest.mark.parametrize("hz, share, spike_n", [(100, 0.01, 100), (100, 0.04, 100), (10, 0.02, 500)])
def test_spikes_of_a_load_cell_are_rejects_and_no_labels(tmp_path, hz, share, spike_n):
    t, force = presses(60, 0)
    logs = one_clock(seconds=60.0) | {"load_cell.log": lines(t, [force], 0.5, 60, hz, 500_000, "%.3f")}
    spiked, rng = list(logs["load_cell.log"]), np.random.default_rng(0)
    struck = np.flatnonzero(rng.random(len(spiked)) < share)
    struck = struck[np.diff(struck, prepend=-9) > 2]
    for k in struck:
        spiked[k] = spiked[k].partition(",")[0] + f",{spike_n}"
    clean, _, report = read(tmp_path / "clean", logs)
    frames, rejects, spiky = read(tmp_path / "spiky", logs | {"load_cell.log": spiked})
    assert touch.SPIKE not in report["load_cell.log"]["rejects"]
    found = rejects.filter(pc.equal(rejects["reason"], touch.SPIKE))["line"].to_numpy()
    assert np.array_equal(found, struck + 1) and spiky["load_cell.log"]["rejects"] == {touch.SPIKE: len(struck)}
    error = np.abs(schemas.matrix(frames["force_n"]) - schemas.matrix(clean["force_n"]))[:, 0]
    assert error.max() < (2.5 if hz == 100 else 30) and np.quantile(error, 0.95) < 0.5


def test_quick_presses_are_no_spikes():
    t = np.arange(0, 60, 0.1)
    taps = np.where(np.arange(600) % 17 == 3, 20.0, 0.0) + np.random.default_rng(0).normal(0, 0.03, 600)
    assert not touch.spikes(t, taps).any(), "of a slow log, in which each press is one reading"
    t = np.arange(0, 60, 0.0125)
    hit = np.interp(t % 2, [0.9, 0.92, 0.94], [0, 30, 0]) + np.random.default_rng(0).normal(0, 0.03, len(t))
    assert not touch.spikes(t, hit).any() and not touch.spikes(t[:4], hit[:4]).any()


def test_too_many_spikes_are_said_to_be_spikes(tmp_path):
    logs = one_clock(seconds=60.0)
    cell = logs["load_cell.log"]
    cell[10::12] = [line.partition(",")[0] + ",150.0" for line in cell[10::12]]
    with pytest.raises(InputError, match=r"load_cell\.log: 8\.3% of the \d+ lines cannot be used, most often 'spike'"):
        read(tmp_path, logs)


def test_labels_of_two_tips_at_once_come_from_the_lines_of_their_logs(tmp_path):
    """By hand, eq. 1: each tip's force as its load cell printed it, where its CNC stood, under the condition's tip."""
    places = {"single": [(10.5, 7.5)], "double": [(10.5, 7.5), (25.5, 19.5)]}
    radii, tables, wanted = {"single": 6.0, "double": 3.0}, [], []
    across, along = 1.5 + 3 * np.arange(12), 1.5 + 3 * np.arange(8)
    window = {"frames": 2, "frame_step": 1, "stride": 3, "contact_threshold_n": 0.5}
    for condition, of in places.items():
        logs = logs_of(seconds=30, seed=4, touches=len(of))
        for (x, y), suffix in zip(of, ("", "_2"), strict=False):
            moves = [line.split(",") for line in logs[f"cnc{suffix}.log"]]
            logs[f"cnc{suffix}.log"] = [f"{at},{x},{y},{z}" for at, _, _, z in moves]
        frames, _, _ = touch.read_recording(save(tmp_path / condition / "run000", logs), SETTINGS)
        tables.append(windows_of(frames, window))
        kpa = 0
        for (x, y), suffix in zip(of, ("", "_2"), strict=False):
            at, newtons = np.array([line.split(",") for line in logs[f"load_cell{suffix}.log"]], float).T
            force = np.maximum(np.interp(tables[-1]["t_s"].to_numpy(), at / 1e6, newtons), 0)
            away = (across[None, :] - x) ** 2 + (along[:, None] - y) ** 2
            spread = np.exp(-away / (2 * (radii[condition] / 2) ** 2))
            kpa = kpa + force[:, None, None] * 1000 / (np.pi * radii[condition] ** 2) * spread
        wanted.append(kpa)
    label = {"tip_radius_mm": 6.0, "tip_radius_by_condition_mm": {"double": 3.0}, "map_rows": 8, "map_cols": 12}
    found = touch.labels(pa.concat_tables(tables).unify_dictionaries(), SETTINGS | {"label": label})
    wanted = np.concatenate(wanted)
    assert wanted.max() > 500 and (wanted.max(axis=(1, 2)) > 50).mean() > 0.3
    np.testing.assert_allclose(found.reshape(wanted.shape), wanted, rtol=1e-4, atol=0.02)
