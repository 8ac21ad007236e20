"""The models that come with the repository do what their cards say, on logs that the scenes write."""

import argparse
import functools
import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow.parquet
import pytest
from builders.project import ROOT

from pipeline import scenes
from pipeline.commands import cards as model_cards
from tactile import experiments
from tactile.base import arguments, params
from tactile.base.errors import InputError
from tactile.base.paths import Workspace
from tactile.commands import predict
from tactile.datasets import schemas, series, specimens
from tactile.inference import card as cards
from tactile.inference import consistent, packages, pictures, predictor, recordings, touches
from tactile.scoring import classification, metrics

VALUES = params.load(ROOT / "params.yaml")
PRETRAINED = ROOT / "pretrained"
TOUCH, STRAIN, GLOVE = (PRETRAINED / name for name in ("touch/lomp_stream", "strain/lstm_direct", "glove/sp_resnet"))
LINES = 40  # of a written log: a window of 36 and a few more
PACKAGES = sorted(path.parent for path in PRETRAINED.glob(f"*/*/{cards.NAME}"))


def simulated(folder: Path, experiment: str, wanted) -> list[Path]:
    """Write the logs of the recordings of the full scene that `wanted` chooses, and return the sensor's logs."""
    planned, logs_of = scenes.plan(experiment, VALUES[experiment])
    chosen = [recording for recording in planned if wanted(recording)]
    assert chosen
    scenes.write_logs(folder, chosen, logs_of)
    return recordings.logs(folder, experiment)


@pytest.fixture(scope="module")
def double(tmp_path_factory) -> list[Path]:
    """Return the logs of one recording of double presses."""
    folder = tmp_path_factory.mktemp("double")
    return simulated(folder, "touch", lambda each: each.condition == "double" and each.name == "specimen0-run000")


def score_of(card: cards.Card, condition: str, metric: str) -> float:
    (value,) = [row.value for row in card.scores if (row.condition, row.metric) == (condition, metric)]
    return value


def test_three_models_come_with_the_repository():
    assert PACKAGES == sorted([TOUCH, STRAIN, GLOVE])
    size = sum(file.stat().st_size for folder in PACKAGES for file in folder.iterdir())
    assert size < 5e6, "a few MB in all"


@functools.cache
def card_of(folder: Path) -> str:
    return model_cards.card_of(Workspace(ROOT), folder)


@pytest.mark.parametrize("folder", PACKAGES, ids=lambda folder: folder.name)
def test_the_model_card_says_what_the_results_say(folder):
    said = card_of(folder)
    assert (folder / "README.md").read_text() == said, "run `tactile cards`"
    headings = re.findall(r"^\*\*([^*]+)\*\*", said, re.MULTILINE)
    assert headings == ["What for.", "Which sensor.", "How good.", "How sure.", "Limits.", "Licence.", "Made again"]


def test_a_model_card_says_what_is_lost_on_another_specimen():
    said = card_of(STRAIN)
    stress = pd.read_csv(ROOT / "reports" / "stress.csv")
    of = stress[(stress.experiment == "strain") & (stress.perturbation == "specimen") & (stress.metric == "error")]
    mean = of[of.condition == "task_2"].groupby(["model", of.severity > 0])["value"].mean()
    (row,) = [line.split() for line in said.splitlines() if line.startswith("| task 2 ")]
    assert float(row[4]) == pytest.approx(mean["lstm_direct", False], rel=0.01)
    assert float(row[6]) == pytest.approx(mean["lstm_direct", True], rel=0.01)
    assert float(row[8]) == pytest.approx(mean["constant", True], rel=0.01)


@pytest.mark.parametrize("folder", PACKAGES, ids=lambda folder: folder.name)
def test_step_by_step_is_all_at_once(folder):
    model = predictor.load(folder)
    columns = model.card.inputs.columns
    scale = {"counts": 300, "V": 0.1, "levels": 500}[model.card.inputs.unit]
    readings = np.random.default_rng(0).uniform(1, 2, (60, columns)) * scale
    at_once = model.predict(readings)
    assert at_once.shape == (60, *model.output_shape) and at_once.dtype == np.float32
    without = {"windows": (model.card.shapes.frames - 1) * model.card.inputs.frame_step}.get(model.card.kind, 0)
    assert np.isnan(at_once[:without]).all() and np.isfinite(at_once[without:]).all()
    full_scale = max(1.0, float(np.nanmax(np.abs(at_once))))
    for _ in range(2):  # and once more after a reset
        one_by_one = np.stack([model.step(reading) for reading in readings])
        assert np.array_equal(np.isnan(one_by_one), np.isnan(at_once))
        assert np.nanmax(np.abs(at_once - one_by_one)) < 1e-3 * full_scale
        model.reset()


def test_an_untouched_sensor_has_no_touch_and_no_force():
    model = predictor.load(TOUCH)
    rest = np.full((200, 25), 32)
    stepped = np.stack([model.step(reading) for reading in rest])
    for maps in (model.predict(rest), stepped):
        assert not any(touches.touches(maps, model.card))
        assert np.nanmax(np.abs(touches.force_n(maps, model.card))) < 0.5, "N, of a load cell's 0.05 N of noise"
        assert np.isnan(touches.force_n(maps, model.card)[:35]).all()


def test_a_lost_line_makes_no_touch_and_no_force(double):
    """Lines lost in mid-press, one by one and a few in a row, against the same log with all of its lines."""
    model = predictor.load(TOUCH)
    whole = recordings.read(double[0], "double", model.card)
    whole = whole._replace(t_s=whole.t_s[:4000], x=whole.x[:4000], segment=whole.segment[:4000])
    expected = recordings.predict(model, whole).values
    rng, kept = np.random.default_rng(0), np.ones(len(whole.x), bool)
    kept[rng.choice(np.arange(100, len(kept) - 10), 40, replace=False)] = False
    kept[2500:2504] = False  # as many as are filled: one fewer than lie between two frames
    lost = whole._replace(t_s=whole.t_s[kept], x=whole.x[kept], segment=whole.segment[kept])
    predicted, _, notes = recordings.predict(model, lost)
    assert notes == [] and np.array_equal(np.isnan(predicted), np.isnan(expected[kept]))
    force, of_all = (touches.force_n(maps, model.card) for maps in (predicted, expected))
    assert np.nanmax(np.abs(force - of_all[kept])) < 0.05 * np.nanmax(of_all)
    kept[3500:3505] = False
    longer = whole._replace(t_s=whole.t_s[kept], x=whole.x[kept], segment=whole.segment[kept])
    without = np.isnan(recordings.predict(model, longer).values).any(axis=(1, 2))
    assert without.sum() == 2 * 35, "after the start, and after a gap of five lines"


@pytest.mark.parametrize(
    ("lines", "faster", "needed", "longest"), [(3, 1, 36, 3), (1, 1, 36, 1), (1000, 1000, 35001, 1000)]
)
def test_a_log_shorter_than_a_window_is_said_to_have_no_prediction(lines, faster, needed, longest, double):
    """The last has its times in milliseconds, read as microseconds."""
    model = predictor.load(TOUCH)
    whole = recordings.read(double[0], "double", model.card)
    short = whole._replace(t_s=whole.t_s[:lines] / faster, x=whole.x[:lines], segment=whole.segment[:lines])
    predicted, _, notes = recordings.predict(model, short)
    assert np.isnan(predicted).all()
    assert f" {needed} readings, and its longest stretch without a gap has {longest}: record for longer" in notes[-1]


def test_the_program_in_the_documents_runs(capsys):
    text = (ROOT / "docs" / "use.md").read_text().partition("## In a program")[2]
    program = text.partition("```python\n")[2].partition("```")[0].replace("pretrained/", f"{PRETRAINED}/")
    names = {}
    exec(program, names)
    assert names["maps"].shape == (100, 20, 20) and names["map_kpa"].shape == (20, 20)
    assert np.abs(names["maps"][-1] - names["map_kpa"]).max() < 0.1
    assert "columns=25 unit='counts'" in capsys.readouterr().out


def test_readings_of_another_sensor_are_refused():
    model = predictor.load(TOUCH)
    with pytest.raises(InputError, match=r"readings of shape \(3, 24\): touch/lomp_stream takes \(n, 25\) counts"):
        model.predict(np.zeros((3, 24)))
    assert model.predict(np.full((2, 5, 5), 32)).shape == (2, 20, 20)


def test_a_card_belongs_to_its_weights(tmp_path):
    folder = tmp_path / "model"
    shutil.copytree(STRAIN, folder)
    weights = cards.weights_file(folder)
    shutil.copy(cards.weights_file(GLOVE), weights)
    with pytest.raises(InputError, match=r"network\.safetensors: is not the file that card\.json describes"):
        predictor.load(folder)
    (folder / cards.NAME).write_text(json.dumps({"experiment": "strain"}))
    with pytest.raises(InputError, match=r"card\.json, kind: Field required"):
        predictor.load(folder)
    (folder / cards.NAME).unlink()
    with pytest.raises(InputError, match=r"card\.json: not found; make the folder with `tactile export"):
        predictor.load(folder)


@pytest.mark.parametrize(
    ("name", "problem"),
    [
        ("touch", "no such model"),
        ("feet/lomp", "no such model"),
        ("touch/lomp/press/x", "'x' is no seed"),
        ("feat/lomp", "no such model; .*"),
        ("touch/lomp_strem", "touch/lomp_strem: no such model; did you mean 'lomp_stream'"),
        ("touch/tree", r"not trained in this folder; .* the pretrained \(glove/sp_resnet, strain/lstm_direct"),
    ],
)
def test_a_model_that_is_not_there_is_named(name, problem, tmp_path):
    with pytest.raises(InputError, match=problem):
        packages.locate(Workspace(ROOT), name, VALUES, tmp_path / "draft")


def test_touches_and_force_of_a_map():
    card = consistent.read(TOUCH)
    sensor, label = card.reading["sensor"], card.reading["label"]
    from tactile.datasets import labels

    kpa = labels.pressure_kpa(np.array([[4.0, 2.0]]), label["tip_radius_mm"])
    maps = labels.pressure_maps(kpa, np.array([[13.5, 46.5]]), np.array([[13.5, 31.5]]), sensor, label)
    (of_map,) = touches.touches(maps, card)
    assert [(round(touch.x_mm, 1), round(touch.y_mm, 1)) for touch in of_map] == [(13.5, 13.5), (46.5, 31.5)]
    assert [touch.kpa for touch in of_map] == pytest.approx(kpa[0].tolist(), rel=1e-3)
    perfect = card.model_copy(update={"outputs": card.outputs.model_copy(update={"force_gain": 2.0})})
    assert touches.force_n(maps, perfect) == pytest.approx([6.0], rel=0.05), "of both together, as load cells say"
    without = card.model_copy(update={"outputs": card.outputs.model_copy(update={"force_gain": None})})
    with pytest.raises(InputError, match="touch/lomp_stream: its card has no force_gain"):
        touches.force_n(maps, without)
    assert touches.touches(np.full((1, 20, 20), np.nan), card) == [[]]


def cpu_seconds(command: list[str], said: Path) -> tuple[str, float]:
    """Run a command; its output and the seconds of a core that it took, without those of any other child."""
    with said.open("wb") as file:
        process = subprocess.Popen(
            command,
            cwd=ROOT,
            env=os.environ | {"PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1"},
            stdout=file,
            stderr=subprocess.STDOUT,
        )
        _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    text = said.read_text()
    assert process.returncode == 0, text
    return text, usage.ru_utime + usage.ru_stime


@pytest.mark.slow
def test_predict_needs_no_ground_truth(double, tmp_path):
    """A minute of a log and nothing beside it, as on a command line, takes at most six times the import of torch.

    That is 8.4 s of a core that imports torch in 1.4 s. Seconds alone tell of the host: while it was busy, the import
    took 2.9 s, and this prediction 14 s after less than 10 in an earlier run of the same code.
    """
    folder = tmp_path / "bench" / "run"
    folder.mkdir(parents=True)
    lines = double[0].read_bytes().splitlines(keepends=True)[:3000]
    (folder / "array.log").write_bytes(b"".join(lines))
    out = tmp_path / "out"
    _, importing = cpu_seconds([sys.executable, "-c", "import torch"], tmp_path / "import")
    command = [sys.executable, "-m", "tactile.commands.command_line"]
    text, predicting = cpu_seconds([*command, "predict", str(TOUCH), str(folder), "--out", str(out)], tmp_path / "said")
    assert "bench/run: 2999 readings in 59.982 s, 1 lines rejected, up to" in text
    assert predicting < 6 * importing
    assert {path.suffix for path in out.iterdir()} == {".parquet", ".json", ".png", ".gif"}
    table = pyarrow.parquet.read_table(out / "predictions.parquet")
    assert table.num_rows == 2999 and table.schema.field("map_kpa").type.list_size == 400
    (said,) = json.loads((out / "summary.json").read_text())["recordings"]
    assert said["readings"] + sum(said["rejected_lines"].values()) == len(lines)
    assert "scores" not in said


def test_a_log_is_read_as_the_card_says_that_it_is_laid_out(tmp_path):
    """As the logs were that the model was trained on."""
    log = write_log(tmp_path / "run" / "array.log")
    card = consistent.read(TOUCH)
    usual = recordings.read(log, "run", card)
    log.write_text("\n\n".join(f"<{line.replace(',', ' ; ')}>" for line in log.read_text().splitlines()))
    ingest = card.reading["ingest"] | {"format": {"array.log": {"separator": "text"}}}
    other = recordings.read(log, "run", card.model_copy(update={"reading": card.reading | {"ingest": ingest}}))
    assert np.array_equal(other.x, usual.x) and np.array_equal(other.t_s, usual.t_s) and len(other.x) == LINES


def test_a_bad_log_among_others_is_listed_and_the_others_are_predicted(workspace, undrawn, tmp_path, capsys):
    good = write_log(tmp_path / "logs" / "a" / "array.log")
    bad = tmp_path / "logs" / "b" / "array.log"
    bad.parent.mkdir()
    bad.write_text("ready\n" * 50)
    with pytest.raises(InputError, match="1 of 2 logs cannot be read; the others are predicted"):
        predicted(workspace, good.parents[1], tmp_path / "out")
    assert f"not read:\n  {bad}: " in capsys.readouterr().out
    (summary,) = json.loads((tmp_path / "out" / "summary.json").read_text())["recordings"]
    assert summary["recording"] == "a"
    with pytest.raises(InputError, match="no line"):
        predicted(workspace, bad, tmp_path / "other")


def test_a_restart_is_no_time_and_a_series_is_not_read_over_one(workspace, undrawn, tmp_path):
    """Of an array nothing is interpolated over it; of strands, times that do not rise would hide a part of the log."""
    log = write_log(tmp_path / "array" / "array.log")
    log.write_text(f"{log.read_text()}ready\n{log.read_text()}")
    predicted(workspace, log, tmp_path / "out")
    (said,) = json.loads((tmp_path / "out" / "summary.json").read_text())["recordings"]
    assert (said["readings"], said["seconds"], said["readings_per_second"]) == (2 * LINES, 2 * 0.78, 50.0)
    for later_s in (-60.0, -30.0):  # the device restarted, its clock was set
        lines = [f"{0.2 * k + later_s * (k >= 300):.1f}," + ",".join([f"{2.5 + k / 1000:.3f}"] * 6) for k in range(600)]
        (tmp_path / "daq.log").write_text("\n".join(lines) + "\n")
        with pytest.raises(InputError, match="daq.log: the time steps back for good in line 301; .* divide the rec"):
            recordings.read(tmp_path / "daq.log", "run", consistent.read(STRAIN))


def test_a_program_gets_the_summary_as_json(workspace, undrawn, tmp_path, monkeypatch):
    answers = []
    monkeypatch.setattr(arguments, "answer", lambda given, result: answers.append(result))
    predicted(workspace, write_log(tmp_path / "logs" / "a" / "array.log").parents[1], tmp_path / "out")
    (answer,) = json.loads(json.dumps(answers))
    assert answer["recordings"][0]["readings"] == LINES and answer["written_to"] == str(tmp_path / "out")
    assert answer["model"]["model"] == "lomp_stream" and answer["not_read"] == []


def test_a_folder_of_something_else_is_kept(workspace, double, tmp_path):
    (tmp_path / "notes.txt").write_text("mine")
    given = argparse.Namespace(model=str(TOUCH), logs=double[0], out=tmp_path, no_pictures=True)
    with pytest.raises(InputError, match="holds something else than predictions"):
        predict.main(workspace, given)
    assert (tmp_path / "notes.txt").read_text() == "mine"


def predicted(workspace, place, out=None) -> list[str]:
    """Predict with `tactile predict`, and return the names of the recordings in its summary."""
    predict.main(workspace, argparse.Namespace(model=str(TOUCH), logs=Path(place), out=out, no_pictures=False))
    (summary,) = Path(out or "predictions").rglob("summary.json")
    return [each["recording"] for each in json.loads(summary.read_text())["recordings"]]


@pytest.fixture
def undrawn(monkeypatch):
    """Empty files in place of pictures, which take seconds."""
    monkeypatch.setattr(pictures, "draw", lambda path, *rest: path.touch())
    monkeypatch.setattr(pictures, "animate", lambda path, *rest: path.touch())


def write_log(path: Path) -> Path:
    """Write a log of LINES frames of an array."""
    path.parent.mkdir(parents=True)
    path.write_text("".join(f"{20000 * k}," + ",".join(["20"] * 25) + "\n" for k in range(LINES)))
    return path


def test_no_two_recordings_have_one_name(workspace, undrawn, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_log(tmp_path / "day1/a b/run0/array.log")
    write_log(tmp_path / "day1/a-b/run0/array.log")
    write_log(tmp_path / "day2/a b/run0/array.log")
    everything = predicted(workspace, ".", tmp_path / "out")
    assert everything == ["day1/a b/run0", "day1/a-b/run0", "day2/a b/run0"]
    table = pyarrow.parquet.read_table(tmp_path / "out" / "predictions.parquet")
    assert schemas.names(table["recording"]).tolist() == [name for name in everything for _ in range(LINES)]
    drawn = sorted(path.name for path in (tmp_path / "out").glob("*.png"))
    assert drawn == ["day1-a-b-run0-2.png", "day1-a-b-run0.png", "day2-a-b-run0.png"]
    # A log in a folder, and beside it folders that end as the path of that folder does.
    parts = tmp_path.parts[-1], "day3"
    write_log(tmp_path / "day3/array.log")
    write_log(tmp_path.joinpath("day3", *parts, "array.log"))
    with pytest.raises(InputError, match=f"would both be called '{'/'.join(parts)}'; rename a folder"):
        predicted(workspace, "day3")


def test_a_log_named_from_its_own_folder_or_from_beside_it(workspace, undrawn, tmp_path, monkeypatch):
    log = write_log(tmp_path / "five" / "array.log")
    (tmp_path / "six").mkdir()
    for folder, place in ((log.parent, "array.log"), (tmp_path / "six", "../five/array.log"), (tmp_path, "five")):
        monkeypatch.chdir(folder)
        assert predicted(workspace, place, tmp_path / "out") == [f"{tmp_path.name}/five"]
        assert [path.name for path in (tmp_path / "out").glob("*.png")] == [f"{tmp_path.name}-five.png"]
    assert recordings.names(Path("/array.log"), [Path("/array.log")], "touch") == ["array"]


def test_predictions_of_other_logs_are_not_replaced(workspace, undrawn, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for day in ("day1", "day2"):
        write_log(tmp_path / day / "run" / "array.log")
    assert predicted(workspace, "day1/run/array.log") == predicted(workspace, "day1/run/array.log") == ["day1/run"]
    before = (tmp_path / "predictions" / "run" / "summary.json").read_text()
    with pytest.raises(InputError, match=r"predictions/run: holds predictions of touch/lomp.*day1/run.*give .* --out"):
        predicted(workspace, "day2/run/array.log")
    assert (tmp_path / "predictions" / "run" / "summary.json").read_text() == before
    assert predicted(workspace, "day2/run", tmp_path / "predictions" / "run") == ["day2/run"], "as --out says"


@pytest.mark.slow
def test_the_score_of_touch_is_what_the_file_gives(tmp_path):
    model = predictor.load(TOUCH)
    logs = simulated(
        tmp_path, "touch", lambda each: each.condition == "double" and specimens.number(each.name) == model.card.seed
    )
    scores = [{row[0]: row for row in recordings.scores(model, log)} for log in logs]
    squared = sum(rows["rmse"][2] ** 2 * rows["rmse"][3] for rows in scores)
    count = sum(rows["rmse"][3] for rows in scores)
    assert np.sqrt(squared / count) == pytest.approx(score_of(model.card, "double", "rmse"), rel=1e-3)


@pytest.mark.slow
def test_the_score_of_strain_is_what_the_file_gives(tmp_path):
    model = predictor.load(STRAIN)
    settings, module = VALUES["strain"], experiments.module("strain")
    protocol = model.card.protocol
    (log,) = simulated(
        tmp_path, "strain", lambda each: each.condition == protocol and each.name == f"run{model.card.seed:03d}"
    )
    frames, _, _ = module.read_recording(log.parent, settings)
    part = module.split(frames, settings, protocol, model.card.seed) == "test"
    outputs = module.task(protocol, settings).outputs
    y, press = schemas.matrix(frames["y_mm"])[:, list(outputs)], frames["press"].to_numpy()
    predicted = model.predict(schemas.matrix(frames["v"]))
    record = series.Record(predicted[part], y[part], np.ones(part.sum(), bool), part[part], press[part])
    rows = {metric: value for metric, _, value, _ in metrics.series(record, predicted[part], outputs)}
    assert rows["error"] == pytest.approx(score_of(model.card, protocol, "error"), rel=1e-3)


@pytest.mark.slow
def test_the_score_of_glove_is_what_the_file_gives(tmp_path):
    model = predictor.load(GLOVE)
    settings, module = VALUES["glove"], experiments.module("glove")
    logs = simulated(tmp_path, "glove", lambda each: specimens.number(each.name) == model.card.seed)
    tables = [module.read_recording(log.parent, settings)[0] for log in logs]
    tables = [table.take(module.chosen(table, settings)) for table in tables]
    frames = schemas.pa.concat_tables([table.unify_dictionaries() for table in tables], promote_options="permissive")
    test = module.split(frames, settings, model.card.protocol, model.card.seed) == "test"
    cells = np.concatenate([schemas.matrix(frames[name]) for name in ("pressure", "strain")], axis=1)[test]
    names = schemas.names(frames["condition"])[test]
    truth = np.eye(len(model.card.outputs.names))[[model.card.outputs.names.index(name) for name in names]]
    ((_, _, accuracy, _), _) = classification.scores(truth, model.predict(cells))
    assert accuracy == pytest.approx(score_of(model.card, "combined", "accuracy"), abs=0.006), "of 160 images, one"
