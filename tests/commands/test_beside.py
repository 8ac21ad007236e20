"""Logs are predicted as the settings beside them say, and a model of another sensor is refused."""

import io
import json
import shutil
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest
import yaml
from builders import free_targets, live_models
from builders.project import ROOT

from tactile.base.errors import InputError
from tactile.base.paths import Workspace
from tactile.inference import card as cards
from tactile.inference import consistent
from tactile.own.beside import Beside
from tactile.targets import read

MODEL = ROOT / "pretrained" / "touch" / "lomp_stream"
SAMPLE = ROOT / "data" / "sample" / "double" / "two_touches"
ROWS, COLS, HIGHEST = 5, 5, 1023
LINES = 330  # of the sample, with both touches
BY_COLUMNS = np.arange(25).reshape(5, 5).T.ravel()
SHUFFLED = np.random.default_rng(3).permutation(25)
SENSOR = {"rows": 5, "cols": 5, "pitch_mm": 12.0, "element_mm": 11.5}


def order_of(printed: np.ndarray) -> list[int]:
    """Return touch.sensor.order where the k-th printed column is the element `printed[k]`."""
    return np.argsort(printed).tolist()


def sample() -> tuple[list[int], np.ndarray]:
    """Return the times and the counts of the sample's frames."""
    rows = [line.split(",") for line in (SAMPLE / "array.log").read_text().splitlines()[1:LINES]]
    rows = np.array([row for row in rows if len(row) == 26 and all(field.isdigit() for field in row)], int)
    rows = rows[np.maximum.accumulate(rows[:, 0]) == rows[:, 0]]
    rows = rows[(np.diff(rows[:, 0], prepend=0) > 0) & (rows[:, 1:] <= HIGHEST).all(axis=1)]
    return rows[:, 0].tolist(), rows[:, 1:]


def as_usual(t_us, counts):
    return [f"{t}," + ",".join(map(str, row)) for t, row in zip(t_us, counts, strict=True)]


def in_ms_with_tabs(t_us, counts):
    return [f"{t / 1000:.3f}\t" + "\t".join(map(str, row)) for t, row in zip(t_us, counts, strict=True)]


def turned(t_us, counts):
    return as_usual(t_us, HIGHEST - counts)


def named(t_us, counts):
    columns = ", ".join(f"e{k}" for k in range(25))
    return [f"t_us, {columns}", *as_usual(t_us, counts[:, ::-1])]


# The same frames as other devices print them, with the settings that say so.
PRINTED = {
    "by columns": (as_usual, BY_COLUMNS, {"touch.sensor.order": order_of(BY_COLUMNS)}),
    "by columns, a block": (as_usual, BY_COLUMNS, {"touch.sensor": SENSOR | {"order": order_of(BY_COLUMNS)}}),
    "in any order": (as_usual, SHUFFLED, {"touch.sensor.order": order_of(SHUFFLED)}),
    "tabs and ms": (
        in_ms_with_tabs,
        np.arange(25),
        {"touch.ingest.format": {"array.log": {"separator": "\t", "time_unit": "ms", "columns": "2..26", "width": 26}}},
    ),
    "tabs, ms and an order": (
        in_ms_with_tabs,
        SHUFFLED,
        {
            "touch.ingest.format": {
                "array.log": {"separator": "\t", "time_unit": "ms", "columns": "2..26", "width": 26}
            },
            "touch.sensor.order": order_of(SHUFFLED),
        },
    ),
    "turned": (turned, np.arange(25), {"touch.ingest.format": {"array.log": {"scale": -1, "offset": HIGHEST}}}),
    "other names": (
        named,
        np.arange(25),
        {
            "touch.ingest.format": {
                "array.log": {"separator": ",", "time": "t_us", "columns": [f"e{k}" for k in range(24, -1, -1)]}
            }
        },
    ),
}


def written(folder: Path, printed, order, given: dict | None) -> Path:
    """Write the sample as a device prints it, and the settings beside it; return the log."""
    t_us, counts = sample()
    log = folder / "double" / "run0" / "array.log"
    log.parent.mkdir(parents=True)
    log.write_text("\n".join(printed(t_us, counts[:, order])) + "\n")
    if given is not None:
        (folder / "settings.yaml").write_text(yaml.safe_dump(given))
    return log


def predicted(called, logs: Path, out: Path, model: Path = MODEL) -> tuple[pd.DataFrame, str]:
    """Return the table of predictions of a folder of logs or a log, and what was said."""
    said = called("predict", model, logs, "--out", out, "--no-pictures")
    return pq.read_table(out / "predictions.parquet").to_pandas(), said


def lived(called, log: Path, capsys, *further, model: Path = MODEL) -> pd.DataFrame:
    """Return what `live --csv` says of a replayed log, without the times that it took."""
    said = called("live", model, "--replay", log, "--csv", "--speed", "1e6", *further)
    return pd.read_csv(io.StringIO(said)).drop(columns="latency_ms")


@pytest.fixture(scope="module")
def usual(tmp_path_factory) -> Path:
    return written(tmp_path_factory.mktemp("usual"), as_usual, np.arange(25), None)


@pytest.mark.parametrize("name", PRINTED)
def test_frames_that_are_printed_otherwise_are_predicted_alike(name, usual, called, capsys, tmp_path):
    printed, order, given = PRINTED[name]
    log = written(tmp_path / "sensor", printed, order, given)
    expected, said = predicted(called, usual.parents[2], tmp_path / "expected")
    assert "settings.yaml" not in said
    for place in (log, log.parents[2]):
        found, said = predicted(called, place, tmp_path / "out")
        line = next(
            line for line in said.splitlines() if f"read as {tmp_path}/sensor/settings.yaml says, not as" in line
        )
        assert all(key in line for key in given if key != "touch.sensor")
        assert len(found) > 300 and found["force_n"].max() > 10
        np.testing.assert_array_equal(np.stack(found["map_kpa"]), np.stack(expected["map_kpa"]))
        assert found["force_n"].equals(expected["force_n"]) and found["t_s"].equals(expected["t_s"])
    table = lived(called, log, capsys)
    assert table.equals(lived(called, usual, capsys)) and len(table) > 250
    (log.parents[2] / "settings.yaml").rename(tmp_path / "settings.yaml")
    assert lived(called, log, capsys, "--settings", tmp_path).equals(table)


def test_the_ground_truth_is_read_as_the_settings_say(called, tmp_path):
    scores = []
    for name, order, scale, unit in (("usual", np.arange(25), 1, ""), ("grams", BY_COLUMNS, 1000 / 9.81, "g")):
        place = tmp_path / name / "double" / "run0"
        shutil.copytree(SAMPLE, place)
        lines = (place / "array.log").read_text().splitlines()
        rows = [line.split(",") for line in lines]
        rows = [[row[0], *np.array(row[1:])[order]] if len(row) == 26 else row for row in rows]
        (place / "array.log").write_text("\n".join(",".join(row) for row in rows) + "\n")
        for log in (place / "load_cell.log", place / "load_cell_2.log"):
            rows = [line.split(",") for line in log.read_text().splitlines()]
            good = [row for row in rows if len(row) == 2 and row[0].isdigit() and row[1].count(".") == 1]
            log.write_text("".join(f"{t},{float(value) * scale:.6f}{unit}\n" for t, value in good))
        if unit:
            block = {"load_cell.log": {"separator": "text", "scale": 9.81 / 1000}}
            given = {"touch.sensor.order": order_of(BY_COLUMNS), "touch.ingest.format": block}
            (tmp_path / name / "settings.yaml").write_text(yaml.safe_dump(given))
        predicted(called, tmp_path / name, tmp_path / f"{name}_out")
        summary = json.loads((tmp_path / f"{name}_out" / "summary.json").read_text())
        scores.append(summary["recordings"][0]["scores"])
    assert scores[0] and scores[1] == pytest.approx(scores[0], rel=1e-4)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"touch.ingest.highest_count": 4095}, "touch.ingest.highest_count is 4095, but .* with 1023; take a model of"),
        ({"touch.sensor.rows": 4}, "touch.sensor.rows is 4, but touch/lomp_stream was trained on a sensor with 5"),
        ({"touch.sensor": SENSOR | {"cols": 6}}, "touch.sensor.cols is 6, but .* with 5"),
        ({"touch.sensor.pitch_mm": 8.0}, "touch.sensor.pitch_mm is 8.0, but .* with 12.0"),
        (
            {"touch.ingest.format": {"array.log": {"rises_when_pressed": False}}},
            "array.log, rises_when_pressed is false, but .* readings with true; .* `scale: -1`",
        ),
        ({"touch.sensor.order": [0, 1, 2]}, "touch.sensor.order names 3 columns; it has to name each of 0 to 24 once"),
        ({"touch.sensor.order": [0] * 25}, "settings.yaml, touch.sensor.order: should be a list without repeats"),
        ({"touch.sensor.ordr": [0]}, "settings.yaml: there is no key 'touch.sensor.ordr'; did you mean 'order'"),
        ({"touch.sensor": {"rows": 4}}, "the block `touch.sensor` lacks 'cols', .* write `touch.sensor.rows: 4`"),
    ],
)
def test_settings_of_another_sensor_are_refused_with_both_values(given, words, tmp_path, called, capsys):
    log = written(tmp_path / "it", as_usual, np.arange(25), given)
    with pytest.raises(SystemExit, match=f"it/settings.yaml.*{words}|it/{words}"):
        predicted(called, log, tmp_path / "out")
    with pytest.raises(SystemExit, match=words):
        lived(called, log, capsys)


READINGS = {
    "strain": {"sensor": {"channels": 6, "unit": "V"}, "ingest": {"max_reject_fraction": 0.1, "rate_hz": 5.0}},
    "glove": {"sensor": {"reference_ohm": 1000.0, "scale": "frame"}, "ingest": {"max_reject_fraction": 0.1}},
}


@pytest.mark.parametrize(
    ("experiment", "given", "words"),
    [
        ("strain", {"strain.sensor.channels": 5}, "strain.sensor.channels is 5, but the model .* with 6"),
        ("strain", {"strain.sensor": {"channels": 6, "unit": "ohm"}}, "strain.sensor.unit is ohm, but .* with V"),
        (
            "strain",
            {"strain.ingest.format": {"daq.log": {"rises_when_pressed": False}}},
            "daq.log, rises_when_pressed is false",
        ),
        (
            "glove",
            {"glove.sensor.areas": {"palm": {"rows": 4, "cols": 5, "highest": 4095}}},
            r"glove.sensor.areas is palm 4 x 5 \(0 to 4095\), but .* with pressure 15 x 18 .*",
        ),
        ("glove", {"glove.sensor.scale": "range"}, "glove.sensor.scale is range, but .* with frame"),
        ("glove", {"glove.sensor.reference_ohm": 470.0}, "glove.sensor.reference_ohm is 470.0, but .* with 1000.0"),
    ],
)
def test_so_are_those_of_other_strands_and_gloves(experiment, given, words, tmp_path):
    (tmp_path / "settings.yaml").write_text(yaml.safe_dump(given))
    with pytest.raises(InputError, match=words):
        Beside(Workspace(ROOT), experiment, "the model", READINGS[experiment]).of_folder(tmp_path)


@pytest.mark.parametrize("experiment", ["strain", "glove"])
def test_settings_of_the_same_sensor_change_what_they_say_alone(experiment, tmp_path):
    log = {"strain": "daq.log", "glove": "scanner.log"}[experiment]
    block = {"separator": ";", "time_unit": "ms"}
    given = {f"{experiment}.ingest.format": {log: block}, f"{experiment}.ingest.max_reject_fraction": 0.3}
    given |= {"strain.sensor.channels": 6, "strain.ingest.rate_hz": 20.0} if experiment == "strain" else {}
    (tmp_path / "settings.yaml").write_text(yaml.safe_dump(given))
    reading = READINGS[experiment]
    found = Beside(Workspace(ROOT), experiment, "the model", reading)
    expected = reading["ingest"] | {"format": {log: block}, "max_reject_fraction": 0.3}
    assert found.of_folder(tmp_path) == reading | {"ingest": expected}
    assert found.said == [
        f"read as {tmp_path}/settings.yaml says, not as the model was trained: "
        f"{experiment}.ingest.max_reject_fraction, {experiment}.ingest.format ({log})"
    ]
    assert found.of_log(tmp_path / "a" / "b" / log) == found.of_folder(tmp_path) and len(found.said) == 1
    assert found.of_log(tmp_path / "a" / "b" / "c" / log) == reading, "too far above"


def test_a_model_of_logs_in_another_order_takes_theirs_where_no_settings_say_otherwise(called, tmp_path):
    """The package's own order holds without settings beside; with them theirs does, also where it is the usual one."""
    own = np.array([5, 3, 1, 0, 2, 4])  # of the columns that are printed
    folder = live_models.linear(tmp_path / "model")
    card = consistent.read(folder)
    sensor = card.reading["sensor"] | {"order": order_of(own)}
    cards.write(folder, card.model_copy(update={"reading": card.reading | {"sensor": sensor}}))
    readings, found = live_models.press(60), {}
    readings[30:, 1] = 300
    shape = {"touch.sensor.rows": 2, "touch.sensor.cols": 3}
    for name, order, given in (
        ("none", own, None),
        ("silent", own, shape),
        ("another", own[::-1], shape | {"touch.sensor.order": order_of(own[::-1])}),
        ("usual", np.arange(6), shape | {"touch.sensor.order": []}),
    ):
        log = tmp_path / name / "single" / "run0" / "array.log"
        log.parent.mkdir(parents=True)
        log.write_bytes(live_models.printed(readings[:, order]))
        if given:
            (tmp_path / name / "settings.yaml").write_text(yaml.safe_dump(given))
        table, said = predicted(called, log, tmp_path / f"{name}_out", folder)
        found[name] = np.stack(table["map_kpa"])
        assert ("does not say touch.sensor.order: taken as touch/linear was trained" in said) == (name == "silent")
        assert ("trained: touch.sensor.order" in said) == (name in ("another", "usual"))
    expected = np.stack([live_models.map_over(reading) for reading in readings]).reshape(60, -1)
    for maps in found.values():
        np.testing.assert_allclose(maps.reshape(60, -1)[10:], expected[10:], atol=0.2)


def test_columns_come_in_the_order_of_the_training():
    rng = np.random.default_rng(0)
    array, there, here = rng.normal(size=(5, 25)), rng.permutation(25), rng.permutation(25)
    readings = [{"sensor": {"order": order_of(order)}} for order in (here, there)]
    assert np.array_equal(read.as_trained(array[:, here], *readings), array[:, there])
    without = {"sensor": {}}
    assert np.array_equal(read.as_trained(array[:, here], readings[0], without), array)
    assert np.array_equal(read.as_trained(array, without, readings[1]), array[:, there])
    assert np.array_equal(read.as_trained(array, without, without), array)


def test_a_target_reads_logs_as_the_settings_beside_them_say(workspace, called, tmp_path):
    """A mat that another program prints; the model of its target says the same of it."""
    folder = free_targets.objects(workspace.root / "data" / "own" / "mat")
    asked = (folder / "settings.yaml").read_text().replace("folder: 1", "folder: 1\n  window_s: 0.1")
    (folder / "settings.yaml").write_text(asked)
    called("try", folder)
    model = workspace.root / "build" / "own" / "mat" / "trained" / "target"
    logs = free_targets.objects(tmp_path / "new", grasps=1)
    expected, _ = predicted(called, logs, tmp_path / "expected", model)
    for log in logs.rglob("scanner.log"):
        rows = [line.split(",") for line in log.read_text().splitlines() if line[0].isdigit()]
        log.write_text("".join(f"{int(row[0]) / 1000:.3f};{';'.join(row[:0:-1])}\n" for row in rows))
    block = {"separator": ";", "time_unit": "ms", "columns": [5, 4, 3, 2], "width": 5}
    given = yaml.safe_load(asked) | {"glove.ingest.format": {"scanner.log": block}}
    (logs / "settings.yaml").write_text(yaml.safe_dump(given))
    found, said = predicted(called, logs, tmp_path / "found", model)
    assert "the model of mat was trained: glove.ingest.format (scanner.log)" in said
    assert found["predicted"].equals(expected["predicted"]) and len(set(found["predicted"])) == 3
    np.testing.assert_allclose(np.stack(found["score"]), np.stack(expected["score"]), atol=1e-6)
    log = logs / "cup" / "day0_0" / "scanner.log"
    rows = log.read_text().splitlines()
    log.write_text("\n".join(row.partition(";")[0] + ";0;0;0;0" if k % 7 == 3 else row for k, row in enumerate(rows)))
    spoiled, said = predicted(called, logs, tmp_path / "spoiled", model)
    assert (
        f"cup/day0_0: {len(rows[3::7])} of {len(rows)} frames are no measurement: all channels read 0 in them" in said
    )
    of_log = (spoiled["recording"] == "cup/day0_0").to_numpy()
    assert spoiled["outside_training"][of_log][3::7].all() and spoiled["set"][of_log][3::7].isna().all()
    assert spoiled[~of_log].equals(found[~of_log]), "other recordings are as they were"
    given["glove.sensor.areas"]["pressure"]["rows"] = 3
    (logs / "settings.yaml").write_text(yaml.safe_dump(given))
    with pytest.raises(SystemExit, match="glove.sensor.areas is pressure 3 x 2 .*, but the model of mat was trained"):
        predicted(called, logs, tmp_path / "found", model)
