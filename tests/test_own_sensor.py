"""Sensors that the project has never seen: their logs are checked, ingested and end as scored tables and figures."""

import json
import shutil
import subprocess
import sys

import numpy as np
import own_logs
import pandas as pd
import pyarrow.parquet as pq
import pytest
import yaml
from conftest import ROOT, Project

from pipeline import check, ingest, params, paths, tables
from pipeline.errors import InputError
from pipeline.window import windows_of

ARRAYS = {  # rows, cols, frames a second, highest count, and a map in params.yaml that is a multiple of the array
    "3x7": ((3, 7, 40.0), 1023, (9, 21)),
    "6x4": ((6, 4, 55.0), 65535, (12, 8)),
}
FAULTS = {"column count", "duplicate", "out of order", "unreadable bytes"}


def touch_values(name):
    """params.yaml for one of ARRAYS."""
    (rows, cols, _), highest, (map_rows, map_cols) = ARRAYS[name]
    values = params.load()
    values["touch"]["sensor"] = {"rows": rows, "cols": cols, "pitch_mm": 10.0, "element_mm": 9.0}
    values["touch"]["label"] |= {"map_rows": map_rows, "map_cols": map_cols}
    values["touch"]["ingest"]["highest_count"] = highest
    values["touch"]["source"] = "data/own/sensor"
    return values


def strain_values():
    """params.yaml for four channels at 12 Hz."""
    values = params.load()
    values["strain"] |= {"sensor": {"channels": 4}, "source": "data/own/sensor"}
    values["strain"]["ingest"]["rate_hz"] = 12
    values["stress"]["strain"]["perturbations"]["time"] = [0.3, 0.6]
    return values


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """Folder of each sensor's logs."""
    folder = tmp_path_factory.mktemp("own")
    for name, (shape, highest, _) in ARRAYS.items():
        own_logs.touch(folder / name, *shape, highest=highest, seconds=40.0)
    own_logs.strain(folder / "strain", 4, 12.0)
    own_logs.glove(folder / "glove")
    return folder


@pytest.fixture
def root(tmp_path, monkeypatch):
    """An empty repository root."""
    monkeypatch.setattr(paths, "ROOT", tmp_path)
    return tmp_path


def ingested(root, experiment, logs, values):
    shutil.copytree(logs, root / "data" / "own" / "sensor")
    ingest.ingest(experiment, values[experiment])
    report = json.loads(paths.ingest_report(experiment).read_text())["recordings"]
    return pq.read_table(paths.frames(experiment)), pq.read_table(paths.rejects(experiment)), report


@pytest.mark.parametrize("name", ARRAYS)
def test_own_array_becomes_a_dataset(root, written, name):
    (rows, cols, hz), highest, (map_rows, map_cols) = ARRAYS[name]
    values = touch_values(name)
    frames, rejects, report = ingested(root, "touch", written / name, values)
    assert FAULTS <= set(rejects["reason"].to_pylist())
    for one in report.values():
        array = one["files"]["array.log"]
        assert array["rate_hz"] == pytest.approx(hz, rel=0.01) and array["segments"] == 2
        assert array["lines"] == array["accepted"] + sum(array["rejects"].values())
    counts = tables.matrix(frames["v"])
    assert counts.shape[1] == rows * cols and counts.max() > highest / 2
    windows = windows_of(frames, values["touch"]["window"])
    module = params.experiment_module("touch")
    maps = module.labels(windows, values["touch"]).reshape(-1, map_rows, map_cols)
    parts = module.split(windows, values["touch"], "press", 0)
    assert set(parts) == {"train", "validation", "test"}
    # Where the truth is highest, the elements answer most: aligned, and in the documented order.
    firm = (tables.names(windows["condition"]) == "single") & (maps.max(axis=(1, 2)) > maps.max() / 2)
    at_row, at_col = np.unravel_index(maps[firm].reshape(firm.sum(), -1).argmax(axis=1), (map_rows, map_cols))
    last = tables.matrix(windows["x"])[firm][:, -rows * cols :]
    strongest = (last - np.median(counts, axis=0)).argmax(axis=1)
    right = (strongest // cols == at_row * rows // map_rows) & (strongest % cols == at_col * cols // map_cols)
    assert firm.sum() > 10 and right.mean() > 0.7


def test_own_strain_sensor_becomes_a_dataset(root, written):
    values = strain_values()
    frames, rejects, report = ingested(root, "strain", written / "strain", values)
    assert FAULTS <= set(rejects["reason"].to_pylist()) and frames["v"].type.list_size == 4
    time, segment = frames["t_s"].to_numpy(), frames["segment"].to_numpy()
    assert np.median(np.diff(time)) == pytest.approx(1 / 12) and set(segment) == {0, 1}
    for one in report.values():
        # The daq starts 1.2 s and the robot 0.3 s after the recording began; the robot counts from 1970.
        assert one["files"]["robot.log"]["clock"]["offset_ms"] == pytest.approx(-1.7e12 - 1.2e3, abs=400)
    parts = params.experiment_module("strain").split(frames, values["strain"], "task_1", 0)
    assert set(parts) == {"train", "validation", "test", "unused"}


def drawn(experiment):
    """Size in bytes of the picture."""
    return paths.check(experiment).stat().st_size


@pytest.mark.parametrize("name", ["3x7", "strain"])
def test_check_says_ready(root, written, name, capsys):
    experiment = "strain" if name == "strain" else "touch"
    values = strain_values() if name == "strain" else touch_values(name)
    assert check.check(experiment, written / name, values) is None
    said = capsys.readouterr().out
    wanted = ["3 of 3 recordings can be used", "correlation", "rejected: column count", "clock: offset", "train"]
    wanted += ["u0 .. u3", "task_2: "] if name == "strain" else ["v0 .. v20", "2 segments", "presses", "N (", "single"]
    for words in wanted:
        assert words in said, words
    assert drawn(experiment) > 20_000


def test_check_of_a_glove(root, written, tmp_path, capsys):
    assert check.check("glove", written / "glove", params.load()) is None
    said = capsys.readouterr().out
    for words in ("6 of 6 recordings", "2 of 405 elements never change", "p0, s134", "15.00 Hz", "column count 1"):
        assert words in said, words
    assert drawn("glove") > 20_000
    shutil.copytree(written / "glove", tmp_path / "logs")
    shutil.rmtree(tmp_path / "logs" / "cup" / "grasp2")
    assert "object 'cup': 2 sessions; at least 3" in check.check("glove", tmp_path / "logs", params.load())


def changed(folder, target, edit, pattern="array.log"):
    """A copy of a folder of logs in which `edit` has changed the lines of the files that match."""
    shutil.copytree(folder, target)
    for path in target.glob(f"*/*/{pattern}"):
        path.write_text("\n".join(edit(path.read_text().splitlines())) + "\n")
    return target


def numbers(change):
    """An edit that applies `change(values)` to the values of every whole line, the time left out."""

    def edit(lines):
        width = max(line.count(",") for line in lines)
        for line in lines:
            time, *values = line.split(",")
            whole = len(values) == width and values[0].strip("-.0123456789") == ""
            yield ",".join([time, *map(str, change(values))]) if whole else line

    return edit


MISTAKES = {
    "array of another size": ("array.log", numbers(lambda v: v[:18]), r"18 values a line.*touch\.sensor\.rows"),
    "rows from the top": (
        "array.log",
        numbers(lambda v: [*v[14:], *v[7:14], *v[:7]]),
        "seem to be printed row by row from the top row, each from left to right",
    ),
    "places from the middle": ("cnc*.log", numbers(lambda v: [float(v[0]) - 35, *v[1:]]), "beside the array.*shift"),
    "pull for push": ("load_cell*.log", numbers(lambda v: [-float(v[0])]), "makes fz_n negative; write it positive"),
    "depth for height": ("cnc*.log", numbers(lambda v: [*v[:2], -float(v[2])]), "z_mm is never below 0"),
    "milliseconds": (
        "array.log",
        lambda lines: [",".join([line[: line.find(",") - 3], *line.split(",")[1:]]) for line in lines if "," in line],
        "is the first column the time in microseconds",
    ),
    "no depth": ("cnc.log", numbers(lambda v: v[:2]), "3 columns a line; expected 4: t_us,x_mm,y_mm,z_mm"),
    "other separator": ("cnc*.log", lambda lines: [line.replace(",", ";") for line in lines], "no line can be read"),
    "empty log": ("cnc_2.log", lambda lines: [], "no line can be read|file is empty"),
}


@pytest.mark.parametrize("mistake", MISTAKES)
def test_check_names_the_mistake(root, written, mistake, tmp_path):
    pattern, edit, words = MISTAKES[mistake]
    first = check.check("touch", changed(written / "3x7", tmp_path / "logs", edit, pattern), touch_values("3x7"))
    assert first is not None and pd.Series([first]).str.contains(words).all(), first


def test_check_names_the_keys_that_do_not_fit(root, written, capsys):
    values = touch_values("3x7")
    values["touch"]["label"]["map_cols"] = 20
    values["stress"]["touch"]["perturbations"]["dead"] = [1, 22]
    check.check("touch", written / "3x7", values)
    said = capsys.readouterr().out
    assert "touch.label.map_cols: 20 is no multiple of touch.sensor.cols (7), which lomp needs; set 21" in said
    assert "stress.touch.perturbations.dead: [22] is more than the sensor has (21)" in said
    values = strain_values()
    values["strain"]["sensor"]["channels"] = 6
    assert "4 voltages a line" in check.check("strain", written / "strain", values)


def test_a_task_without_a_recording_is_one_sentence(root, written, tmp_path):
    shutil.copytree(written / "strain", tmp_path / "logs")
    shutil.rmtree(tmp_path / "logs" / "task_2")
    with pytest.raises(InputError, match=r"task_2: 0 recordings; each of task_0, task_1, task_2 needs exactly one"):
        check.check("strain", tmp_path / "logs", strain_values())


def test_command_line_of_check(written):
    command = [sys.executable, "-m", "pipeline.check"]
    for arguments, words in ((["touch"], "usage"), (["touch", "/no/folder"], "there is no such folder")):
        done = subprocess.run([*command, *arguments], cwd=ROOT, capture_output=True, text=True)
        assert done.returncode == 1 and words in done.stderr and "Traceback" not in done.stderr


MODELS = yaml.safe_load((ROOT / "tests" / "miniature.yaml").read_text())


def test_own_array_end_to_end(tmp_path):
    """Logs of a 3 x 7 array at 40 Hz to a scored table and figures, by one `dvc repro`; only params.yaml is changed."""
    project = Project(tmp_path)
    own_logs.touch(project.folder / "data" / "own" / "sensor", *ARRAYS["3x7"][0], seconds=80.0)
    values = touch_values("3x7")["touch"]
    project.set({f"touch.{key}": values[key] for key in ("source", "sensor", "label", "ingest")})
    lomp = MODELS["touch.models"]["lomp"]
    project.set(
        {"touch.models": {"constant": {}, "rbf": {"centres": 100, "width": 2.0, "ridge": 1.0e-3}, "lomp": lomp}}
    )
    project.dvc("repro", "render@touch")
    scores = pd.read_csv(project.folder / "data" / "touch" / "scores.csv")
    rmse = scores[(scores.metric == "rmse") & (scores.protocol == "press")].groupby(["condition", "model"]).value.mean()
    assert rmse["single", "rbf"] < 0.8 * rmse["single", "constant"] and np.isfinite(rmse["double", "lomp"])
    accuracy = project.folder / "reports" / "touch" / "accuracy"
    assert "double" in (accuracy / "table1.md").read_text() and (accuracy / "figure8.png").stat().st_size > 20_000


def test_own_strain_sensor_end_to_end(written, tmp_path):
    """As the array, with four channels at 12 Hz."""
    project = Project(tmp_path)
    shutil.copytree(written / "strain", project.folder / "data" / "own" / "sensor")
    values = strain_values()["strain"]
    project.set({f"strain.{key}": values[key] for key in ("source", "sensor", "ingest")})
    models = ("constant", "ridge", "lstm_direct", "lstm_transfer", "lstm_transfer_ridge")
    project.set({"strain.models": {key: MODELS["strain.models"][key] for key in models}})
    project.dvc("repro", "render_strain")
    scores = pd.read_csv(project.folder / "data" / "strain" / "scores.csv")
    error = scores[scores.metric == "error"].groupby(["protocol", "model"]).value.mean()
    assert error["task_1", "ridge"] < error["task_1", "constant"] / 2
    accuracy = project.folder / "reports" / "strain" / "accuracy"
    assert "task 2" in (accuracy / "table1.md").read_text() and (accuracy / "figure6.png").stat().st_size > 20_000
