"""Sensors that the project has never seen: their logs are checked, ingested and end as scored tables and figures."""

import json
import re
import shutil
from html import escape

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import yaml
from builders import own_logs
from builders.packets import arrived, stamps_us
from builders.project import ROOT, Project, in_this_process

from pipeline.reporting.page.hypertext import markdown
from tactile import experiments
from tactile.base import modules, params
from tactile.base.errors import InputError
from tactile.base.params_file import set_values
from tactile.commands import check, command_line
from tactile.datasets import schemas
from tactile.datasets.windowing import windows_of
from tactile.drawing import check as check_figures
from tactile.own import report as own_sensor
from tactile.own import settings as own_settings
from tactile.stages import ingest

pytestmark = pytest.mark.slow


ARRAYS = {  # rows, cols, frames a second, highest count, and a map in params.yaml that is a multiple of the array
    "3x7": ((3, 7, 40.0), 1023, (9, 21)),
    "6x4": ((6, 4, 55.0), 65535, (12, 8)),
}
FAULTS = {"column count", "duplicate", "out of order", "unreadable bytes"}


def touch_values(name):
    """params.yaml for one of ARRAYS."""
    (rows, cols, _), highest, (map_rows, map_cols) = ARRAYS[name]
    values = params.load(ROOT / "params.yaml")
    values["touch"]["sensor"] = {"rows": rows, "cols": cols, "pitch_mm": 10.0, "element_mm": 9.0}
    values["touch"]["label"] |= {"map_rows": map_rows, "map_cols": map_cols}
    values["touch"]["ingest"]["highest_count"] = highest
    values["touch"]["source"] = "data/own/sensor"
    return values


def strain_values():
    """params.yaml for four channels at 12 Hz."""
    values = params.load(ROOT / "params.yaml")
    values["strain"] |= {"sensor": {"channels": 4}, "source": "data/own/sensor"}
    values["strain"]["ingest"]["rate_hz"] = 12
    return values


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """Folder of each sensor's logs."""
    folder = tmp_path_factory.mktemp("own")
    for name, (shape, highest, _) in ARRAYS.items():
        own_logs.touch(folder / name, *shape, highest=highest, seconds=80.0)  # about 70 presses each
    own_logs.strain(folder / "strain", 4, 12.0)
    own_logs.glove(folder / "glove")
    return folder


def ingested(workspace, experiment, logs, values):
    shutil.copytree(logs, workspace.root / "data" / "own" / "sensor")
    ingest.ingest(workspace, experiment, values[experiment])
    report = json.loads(workspace.ingest_report(experiment).read_text())["recordings"]
    return pq.read_table(workspace.frames(experiment)), pq.read_table(workspace.rejects(experiment)), report


@pytest.mark.parametrize("name", ARRAYS)
def test_own_array_becomes_a_dataset(workspace, written, name):
    (rows, cols, hz), highest, (map_rows, map_cols) = ARRAYS[name]
    values = touch_values(name)
    frames, rejects, report = ingested(workspace, "touch", written / name, values)
    assert FAULTS <= set(rejects["reason"].to_pylist())
    for one in report.values():
        array = one["files"]["array.log"]
        assert array["rate_hz"] == pytest.approx(hz, rel=0.01) and array["segments"] == 2
        assert array["lines"] == array["accepted"] + sum(array["rejects"].values())
    counts = schemas.matrix(frames["v"])
    assert counts.shape[1] == rows * cols and counts.max() > highest / 2
    windows = windows_of(frames, values["touch"]["window"])
    module = experiments.module("touch")
    maps = module.labels(windows, values["touch"]).reshape(-1, map_rows, map_cols)
    parts = module.split(windows, values["touch"], "press", 0)
    assert set(parts) - {"unused"} == {"train", "validation", "test"}
    # Where the truth is highest, the elements answer most: aligned, and in the documented order.
    firm = (schemas.names(windows["condition"]) == "single") & (maps.max(axis=(1, 2)) > maps.max() / 2)
    at_row, at_col = np.unravel_index(maps[firm].reshape(firm.sum(), -1).argmax(axis=1), (map_rows, map_cols))
    last = schemas.matrix(windows["x"])[firm][:, -rows * cols :]
    strongest = (last - np.median(counts, axis=0)).argmax(axis=1)
    right = (strongest // cols == at_row * rows // map_rows) & (strongest % cols == at_col * cols // map_cols)
    assert firm.sum() > 10 and right.mean() > 0.7


def test_own_strain_sensor_becomes_a_dataset(workspace, written):
    values = strain_values()
    frames, rejects, report = ingested(workspace, "strain", written / "strain", values)
    assert FAULTS <= set(rejects["reason"].to_pylist()) and frames["v"].type.list_size == 4
    time, segment = frames["t_s"].to_numpy(), frames["segment"].to_numpy()
    assert np.median(np.diff(time)) == pytest.approx(1 / 12) and set(segment) == {0, 1}
    for one in report.values():
        # The daq starts 1.2 s and the robot 0.3 s after the recording began; the robot counts from 1970.
        assert one["files"]["robot.log"]["clock"]["offset_ms"] == pytest.approx(-1.7e12 - 1.2e3, abs=400)
    parts = experiments.module("strain").split(frames, values["strain"], "task_1", 0)
    assert set(parts) == {"train", "validation", "test", "unused"}


@pytest.mark.parametrize("name", ["3x7", "strain"])
def test_check_says_ready(workspace, written, name, capsys):
    experiment = "strain" if name == "strain" else "touch"
    values = strain_values() if name == "strain" else touch_values(name)
    assert check.check(workspace, experiment, written / name, values) is None
    said = capsys.readouterr().out
    wanted = ["3 of 3 recordings can be used", "correlation", "rejected: column count", "clock: offset", "train"]
    wanted += ["u0 .. u3", "task_2: "] if name == "strain" else ["v0 .. v20", "2 segments", "presses", "N (", "single"]
    for words in wanted:
        assert words in said, words
    assert workspace.check(experiment).stat().st_size > 20_000


def test_check_of_a_glove(workspace, written, tmp_path, capsys):
    assert check.check(workspace, "glove", written / "glove", params.load(ROOT / "params.yaml")) is None
    said = capsys.readouterr().out
    for words in ("6 of 6 recordings", "2 of 405 elements never change", "p0, s134", "15.00 Hz", "column count 1"):
        assert words in said, words
    assert workspace.check("glove").stat().st_size > 20_000
    shutil.copytree(written / "glove", tmp_path / "logs")
    shutil.rmtree(tmp_path / "logs" / "cup" / "grasp2")
    assert "object 'cup': 2 sessions; at least 3" in check.check(
        workspace, "glove", tmp_path / "logs", params.load(ROOT / "params.yaml")
    )


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


MISTAKES = {  # the files of which every whole line is edited, how, and what check says first
    "array of another size": ("array.log", numbers(lambda v: v[:5]), r"5 values per line.*touch\.sensor\.rows"),
    "rows from the top": (
        "array.log",
        numbers(lambda v: [*v[3:], *v[:3]]),
        "seem to be printed row by row from the top row, each from left to right",
    ),
    "places from the middle": ("cnc.log", numbers(lambda v: [float(v[0]) - 15, *v[1:]]), "beside the array.*shift"),
    "x for y": ("cnc.log", numbers(lambda v: [v[1], v[0], v[2]]), "none would be if x_mm and y_mm changed places"),
    "centimetres": (
        "cnc.log",
        numbers(lambda v: [float(one) / 10 for one in v]),
        "of an array of 30 x 20: write .* milli",
    ),
    "not tared": ("load_cell.log", numbers(lambda v: [float(v[0]) + 3]), "rests at 3 N, above .* write `offset: -2.9"),
    "kilonewtons": (
        "load_cell.log",
        numbers(lambda v: [float(v[0]) / 1000]),
        r"highest is 0\.03 N\): write .* newtons",
    ),
    "ounces": (
        "load_cell.log",
        numbers(lambda v: [float(v[0]) * 30]),
        "kPa under the tip .* newtons .* or fix the radius",
    ),
    "depth for height": ("cnc.log", numbers(lambda v: [*v[:2], -float(v[2])]), "z_mm is never below 0"),
    "milliseconds": (
        "array.log",
        lambda lines: [",".join([line[: line.find(",") - 3], *line.split(",")[1:]]) for line in lines if "," in line],
        "is the first column the time in microseconds.* Multiply milliseconds by 1000",
    ),
    "started late": ("load_cell.log", lambda lines: lines[1500:], "load_cell.log lasts 2. s, .* start within 5 s"),
}


@pytest.fixture(scope="module")
def small(tmp_path_factory):
    """Logs of 2 x 3 elements, and their settings: one recording, quickly read."""
    folder = tmp_path_factory.mktemp("small")
    own_logs.touch(folder, 2, 3, 40.0, seconds=40.0, recordings=1, conditions=())
    values = params.load(ROOT / "params.yaml")
    values["touch"]["sensor"] = {"rows": 2, "cols": 3, "pitch_mm": 10.0, "element_mm": 9.0}
    values["touch"]["label"] |= {"map_rows": 8, "map_cols": 9}
    return folder, values


@pytest.fixture
def undrawn(monkeypatch):
    """Without the picture, most of the time of a check."""
    monkeypatch.setattr(check_figures, "draw", lambda *arguments: None)


@pytest.mark.parametrize("mistake", MISTAKES)
def test_check_names_the_mistake(workspace, small, undrawn, mistake, tmp_path):
    pattern, edit, words = MISTAKES[mistake]
    folder, values = small
    first = check.check(workspace, "touch", changed(folder, tmp_path / "logs", edit, pattern), values)
    assert first is not None and re.search(words, first), first
    assert "\n" not in first


def wired(folder, target, order):
    """A copy of the logs of an array whose k-th element is printed in column order[k]."""
    columns = np.argsort(order)
    return changed(folder, target, numbers(lambda v: [v[k] for k in columns]))


@pytest.mark.parametrize(
    ("order", "words"),
    [
        ([3, 0, 5, 1, 4, 2], "seem to be printed in another order .* in 100 %, not"),
        ([1, 0, 2, 3, 4, 5], "v0, v1 seem to have changed places|printed in another order"),
        ([2, 1, 0, 5, 4, 3], "seem to be printed row by row from the bottom row, each from right to left"),
    ],
)
def test_check_finds_how_the_elements_are_wired(workspace, small, undrawn, order, words, tmp_path):
    folder, values = small
    logs = wired(folder, tmp_path / "logs", order)
    first = check.check(workspace, "touch", logs, values)
    assert re.search(words, first) and f"touch.sensor.order: {order}" in first, first
    mended = values | {"touch": values["touch"] | {"sensor": values["touch"]["sensor"] | {"order": order}}}
    assert check.check(workspace, "touch", logs, mended) is None
    plain = experiments.module("touch").read_recording(folder / "single" / "day1_0", values["touch"])[0]
    again = experiments.module("touch").read_recording(logs / "single" / "day1_0", mended["touch"])[0]
    assert again["v"].equals(plain["v"])


def test_check_is_not_ready_where_no_element_answers_its_place(workspace, small, undrawn, tmp_path):
    """The CNC's places are those of other presses."""
    folder, values = small
    rng = np.random.default_rng(0)
    logs = changed(folder, tmp_path / "logs", numbers(lambda v: [*rng.uniform(1, [29, 19]), v[2]]), "cnc.log")
    first = check.check(workspace, "touch", logs, values)
    assert re.search(r"strongest in \d+ % of firm contacts, and no order of the elements explains many more", first)


def test_an_order_that_is_none_is_one_sentence(small):
    folder, values = small
    settings = values["touch"] | {"sensor": values["touch"]["sensor"] | {"order": [0, 1, 2, 3, 4]}}
    with pytest.raises(InputError, match="touch.sensor.order: names 5 columns; .* each of 0 to 5 once"):
        experiments.module("touch").read_recording(folder / "single" / "day1_0", settings)


def test_one_element_needs_no_places(workspace, tmp_path, undrawn):
    own_logs.touch(tmp_path / "logs", 1, 1, 40.0, seconds=40.0, recordings=1, conditions=())
    (tmp_path / "logs" / "single" / "day1_0" / "cnc.log").unlink()
    values = params.load(ROOT / "params.yaml")
    values["touch"]["sensor"] = {"rows": 1, "cols": 1, "pitch_mm": 10.0, "element_mm": 9.0}
    values["touch"]["label"] |= {"map_rows": 3, "map_cols": 3}
    assert check.check(workspace, "touch", tmp_path / "logs", values) is None
    frames = experiments.module("touch").read_recording(tmp_path / "logs" / "single" / "day1_0", values["touch"])[0]
    assert set(schemas.matrix(frames["x_mm"])[:, 0]) == {5.0}


def test_conditions_that_train_and_their_tips(small):
    """Two tips: both train, and a label's peak is the pressure under the tip of its condition."""
    folder, values = small
    frames = experiments.module("touch").read_recording(folder / "single" / "day1_0", values["touch"])[0]
    windows = windows_of(frames, values["touch"]["window"] | {"frame_step": 2, "stride": 8})
    other = windows.set_column(0, "condition", pa.array(["tip4"] * windows.num_rows).dictionary_encode())
    both = pa.concat_tables([windows, other]).unify_dictionaries().combine_chunks()
    module, settings = experiments.module("touch"), values["touch"]
    settings = settings | {
        "label": settings["label"] | {"tip_radius_by_condition_mm": {"tip4": 4.0}},
        "split": settings["split"] | {"train_on": ["tip4"]},
    }
    peaks = module.labels(both, settings).max(axis=1).reshape(2, -1)
    assert peaks[1] == pytest.approx(peaks[0] * (settings["label"]["tip_radius_mm"] / 4) ** 2)
    part = module.split(both, settings, "press", 0).reshape(2, -1)
    assert set(part[0]) <= {"test", "unused"} and {"train", "validation", "test"} <= set(part[1])


def test_ingest_says_that_check_knows_more(workspace, small):
    folder, values = small
    logs = changed(
        folder, workspace.root / "data" / "own" / "sensor", lambda lines: [line.replace(",", ";") for line in lines]
    )
    settings = values["touch"] | {"source": "data/own/sensor"}
    with pytest.raises(InputError, match=rf"{logs}.* \(`tactile check touch data/own/sensor` says more\)$"):
        ingest.ingest(workspace, "touch", settings)


def test_check_says_that_times_come_in_packets(workspace, small, undrawn, tmp_path, capsys):
    folder, values = small
    shutil.copytree(folder, tmp_path / "logs")
    log = tmp_path / "logs" / "single" / "day1_0" / "load_cell.log"
    lines = [line.split(",", 1) for line in log.read_text().splitlines() if re.match(r"\d+,", line)]
    times_s = np.array([int(t_us) for t_us, _ in lines]) / 1e6
    stamped = stamps_us(arrived(times_s, 0.016, np.random.default_rng(0)))
    log.write_text("".join(f"{t_us},{rest}\n" for t_us, (_, rest) in zip(stamped, lines, strict=True)))
    assert check.check(workspace, "touch", tmp_path / "logs", values) is None
    said = capsys.readouterr().out
    assert "times come in packets of 16 ms" in said
    assert float(re.search(r"load_cell.log.*\n *([\d.]+) Hz", said)[1]) == pytest.approx(80, rel=0.005)


@pytest.mark.parametrize("name", ["load_cell.csv", "Load_Cell.txt", None])
def test_check_says_what_lies_there_in_place_of_a_log(workspace, small, undrawn, name, tmp_path):
    folder, values = small
    shutil.copytree(folder, tmp_path / "logs")
    log = tmp_path / "logs" / "single" / "day1_0" / "load_cell.log"
    log.rename(log.with_name(name)) if name else log.unlink()
    wanted = f"the folder has {name}: if that is it, rename it" if name else "add it, with lines of t_us,fz_n"
    assert check.check(workspace, "touch", tmp_path / "logs", values) == f"{log}: log not found; {wanted}"


@pytest.mark.parametrize(
    "file, edit, words",
    [
        ("daq.log", lambda v: [1000 * float(one) for one in v], r"u\d is .* outside -10 to 10 V; write volts"),
        ("robot.log", lambda v: [f"{float(one) / 1000:.6f}" for one in v], "moves by no more than .* in millimetres"),
    ],
    ids=["millivolts", "metres"],
)
def test_check_names_the_mistake_of_a_strain_sensor(workspace, written, undrawn, file, edit, words, tmp_path):
    logs = changed(written / "strain", tmp_path / "logs", numbers(edit), file)
    assert re.search(words, check.check(workspace, "strain", logs, strain_values()))


def test_check_names_the_keys_that_do_not_fit(workspace, written, undrawn):
    values = touch_values("3x7")
    values["touch"]["label"]["map_cols"] = 20
    first = check.check(workspace, "touch", written / "3x7", values)
    assert "touch.label.map_cols: 20 is no multiple of touch.sensor.cols (7), which lomp needs; set 21" in first
    values = strain_values()
    values["strain"]["sensor"]["channels"] = 6
    assert "4 voltages per line" in check.check(workspace, "strain", written / "strain", values)


MINIATURE = yaml.safe_load((ROOT / "tests" / "miniature.yaml").read_text())
RBF = {"rbf": {"centres": 100, "width": 2.0, "ridge": 1.0e-3}}


@pytest.fixture
def tactile(workspace, undrawn, monkeypatch, capsys):
    """`tactile("own", folder)`: what a command prints that runs, with its stages, in this process."""
    set_values(MINIATURE, workspace.params)
    in_this_process(monkeypatch)
    monkeypatch.chdir(workspace.root)
    monkeypatch.setattr(own_sensor, "MAPS", 1)  # one window of each condition is drawn

    def run(*words: str) -> str:
        capsys.readouterr()
        monkeypatch.setattr("sys.argv", ["tactile", *words])
        command_line.main()
        return capsys.readouterr().out

    return run


def settled(logs, settings):
    """Write settings.yaml beside logs."""
    (logs / "settings.yaml").write_text(yaml.safe_dump(settings))


def settings_of_array(name):
    """The settings that docs/own_sensor.md asks for, for one of ARRAYS; these presses are shorter than the scene's."""
    values = touch_values(name)["touch"]
    settings = {f"touch.{key}": values[key] for key in ("sensor", "label", "ingest")}
    models = {key: (MINIATURE["touch.models"] | RBF)[key] for key in ("constant", "rbf", "lomp")}
    return settings | {"touch.window.frame_step": 2, "touch.window.stride": 8, "touch.models": models}


def errors_in(tmp_path, name, words):
    """Mean error by (condition, model), after a look at the report of a sensor: its words and figures."""
    report = tmp_path / "reports" / "own" / name
    text = (report / "README.md").read_text()
    assert all(word in text for word in words), text
    for word in ("published", "simulated", "paper's", "nan"):
        assert word not in text, word
    figures = re.findall(r"\]\((\w+\.png)\)", text)
    assert figures and all((report / figure).stat().st_size > 10_000 for figure in figures)
    scores = pd.read_csv(report / "scores.csv")
    scores = scores[scores.metric.isin(["rmse", "error", "accuracy"])]
    return scores.groupby(["condition", "model"]).value.mean()


def test_own_array_end_to_end(tmp_path, written, tactile):
    """Logs of a 3 x 7 array at 40 Hz to a report and trained models, by the docs' commands; nothing else changes."""
    logs = tmp_path / "data" / "own" / "finger"
    shutil.copytree(written / "3x7", logs)
    settled(logs, settings_of_array("3x7"))
    settings = (tmp_path / "params.yaml").read_bytes()
    assert tactile("check", "touch", "data/own/finger").endswith(
        "ready: `tactile try data/own/finger` for a quick look, `tactile own data/own/finger` for all models\n"
        "what the sensor itself is worth, before any model: `tactile sheet data/own/finger`\n"
    )
    tactile("own", "data/own/finger")
    rmse = errors_in(
        tmp_path, "finger", ["`finger`: touch", "single/day1", "R2 of the force", "Press, double (3 runs)"]
    )
    assert rmse["single", "rbf"] < 0.8 * rmse["single", "constant"] and np.isfinite(rmse["double", "lomp"])
    assert (tmp_path / "params.yaml").read_bytes() == settings
    assert not (tmp_path / "data" / "touch" / "logs").exists() and not (tmp_path / "reports" / "touch").exists()
    weights = [path for path in (tmp_path / "build").rglob("*.safetensors") if "models" in path.parts]
    before = [path.stat().st_mtime_ns for path in weights]
    tactile("own", "data/own/finger")
    assert before and [path.stat().st_mtime_ns for path in weights] == before, "nothing is trained again"
    said = tactile("predict", "build/own/finger/trained/rbf", "data/own/finger/double")
    assert re.search(r"rmse \(kPa\) .*; held out \(test part of `press`, seed 0\)\n", said)
    said = tactile("predict", "build/own/finger/trained/rbf", "data/own/finger/single")
    assert "trained on this recording: no test; held out (test part of `press`, seed 0): rmse (kPa)" in said
    assert f"rmse (kPa) {rmse['single', 'constant']:.3g}" not in said


def test_a_mat_of_one_area_end_to_end(tmp_path, tactile):
    """16 x 16 cells of 12 bits: images of 16 x 16 pixels, one dataset, a network among the models."""
    logs = tmp_path / "data" / "own" / "mat"
    own_logs.mat(logs)
    settled(logs, {"glove.sensor.areas": {"pressure": {"rows": 16, "cols": 16, "highest": 4095}}})
    tactile("try", "data/own/mat")
    accuracy = errors_in(tmp_path, "mat", ["`mat`: glove", "Session pressure (1 run)"])
    assert accuracy["pressure", "naive_bayes"] > accuracy["pressure", "constant"]
    assert accuracy["pressure", "window_trees"] > accuracy["pressure", "constant"]
    said = tactile("predict", "build/own/mat/trained/sp_resnet", "data/own/mat/cup").splitlines()
    days = [line for line in said if " readings in " in line]
    (tested,) = (line for line in days if "no test" not in line)
    assert len(days) == 4 and re.search(r", accuracy .*; held out \(test part of `session_pressure`, seed 0\)$", tested)


def test_a_glove_of_few_channels_end_to_end(tmp_path, tactile):
    """Five sensors of pressure and five of attitude: a hand at rest is no reject, and no network sees ten pixels."""
    logs = tmp_path / "data" / "own" / "few"
    own_logs.few_channels(logs)
    areas = {"force": {"rows": 1, "cols": 5}, "motion": {"rows": 1, "cols": 5, "lowest": -180, "highest": 180}}
    settled(logs, {"glove.sensor.scale": "range", "glove.sensor.areas": areas})
    said = tactile("try", "data/own/few")
    assert (
        "fewer than 8 pixels on a side: constant, window_ridge, window_trees, naive_bayes, tree, no networks of images"
        in said
    )
    assert "12 of 12 recordings can be used" in said
    accuracy = errors_in(tmp_path, "few", ["Session force", "Session motion", "Session combined"])
    assert min(accuracy["combined", model] for model in ("tree", "window_trees")) > accuracy["combined", "constant"]
    for model in ("tree", *own_settings.YARDSTICKS["images"]):
        assert "pen/day1: 20 readings" in tactile(
            "predict", f"build/own/few/trained/{model}", "data/own/few/pen/day1", "--out", f"predictions/{model}"
        )


def test_one_strain_sensor_of_two_days_end_to_end(tmp_path, tactile):
    """One sensor on one stage that presses and holds, one clock, another day to test on."""
    logs = tmp_path / "data" / "own" / "cord"
    own_logs.pressed_and_held(logs, "stretch", {"monday": 240.0, "friday": 60.0})
    settings = {
        "strain.sensor": {"channels": 1, "unit": "ohm", "tasks": {"stretch": ["x"]}},
        "strain.ingest.rate_hz": 10,
        "strain.ingest.clock": "shared",
        "strain.ingest.average": True,
        "strain.protocols": {"stretch": {"seeds": [0]}},
        "strain.split.test_recordings": ["friday"],
    }
    settled(logs, settings)
    tactile("try", "data/own/cord")
    error = errors_in(tmp_path, "cord", ["stretch/friday", "Stretch (1 run)"])
    for model in ("ridge", *own_settings.YARDSTICKS["series"]):
        assert error["stretch", model] < error["stretch", "constant"] / 2, model


@pytest.mark.parametrize("name", own_logs.UNPRINTABLE, ids=ascii)
@pytest.mark.parametrize("place", ["condition", "recording", "source"])
def test_a_name_that_is_no_line_of_text_is_one_sentence(workspace, small, undrawn, name, place):
    folder, values = small
    logs = workspace.root / "data" / "own" / (name if place == "source" else "sensor")
    shutil.copytree(folder, logs)
    if place != "source":
        recording = logs / "single" / "day1_0"
        recording.rename(logs / "single" / name) if place == "recording" else (logs / "single").rename(logs / name)
    words = r"has a line break, another control character or bytes that are no UTF-8; rename the folder"
    with pytest.raises(InputError, match=words) as refused:
        check.check(workspace, "touch", logs, values)
    assert str(refused.value).isascii() and ascii(name) in str(refused.value)
    with pytest.raises(InputError, match=words):
        ingest.ingest(workspace, "touch", values["touch"] | {"source": f"data/own/{logs.name}"})


@pytest.mark.parametrize("experiment", ["strain", "glove"])
def test_names_of_every_experiment_are_looked_at(written, tmp_path, experiment):
    shutil.copytree(written / experiment, tmp_path / "logs")
    recordings = experiments.module(experiment).recordings
    last = recordings(tmp_path / "logs")[-1]
    last.rename(last.with_name(own_logs.UNPRINTABLE[0]))
    with pytest.raises(InputError, match="rename the folder"):
        recordings(tmp_path / "logs")


def test_any_name_of_a_touch_condition(tmp_path, tactile):
    """Conditions and recordings of all NAMES, by DVC and stage by stage, and the files that name them."""
    project = Project(tmp_path)
    logs = project.folder / "data" / "own" / "sensor"
    own_logs.touch(logs, 2, 3, 40.0, seconds=40.0, recordings=1, conditions=own_logs.NAMES)
    values = touch_values("3x7")["touch"]
    project.set(
        {f"touch.{key}": values[key] for key in ("source", "ingest")}
        | {"touch.sensor": values["sensor"] | {"rows": 2, "cols": 3}}
        | {"touch.label": values["label"] | {"map_rows": 8, "map_cols": 9}}
        | {"touch.models": {"constant": {}, "linear": {}}, "stress.touch.perturbations": {"noise": [0.01]}}
    )
    assert "ready" in tactile("check", "touch", str(logs), "--root", str(project.folder))
    project.dvc("repro", "ingest@touch")
    for stage in ("window", "dataset", "train", "evaluate"):
        modules.run(project.folder, f"tactile.stages.{stage}", "touch")
    modules.run(project.folder, "pipeline.stages.stress", "touch")
    modules.run(project.folder, "pipeline.stages.render", "touch", "look")
    accuracy = project.folder / "reports" / "look" / "touch" / "accuracy"
    for table in (project.folder / "data" / "touch" / "scores.csv", accuracy / "scores.csv"):
        rows = pd.read_csv(table, dtype=str, keep_default_na=False, encoding="utf-8")
        assert set(rows["condition"]) == {"single", *own_logs.NAMES}
    tables, _, _ = (accuracy / "README.md").read_text(encoding="utf-8").partition("## Figures")
    cells = re.findall("<td[^>]*>(.*?)</td>", markdown(tables, "Own sensor"))
    for name in own_logs.NAMES:
        assert any(f"{escape(name)}/" in cell for cell in cells), name
