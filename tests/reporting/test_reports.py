"""The reports of all experiments show what the files say: every model, failed runs, printed numbers, verdicts."""

import functools
import json
import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow.parquet
import pytest
from builders import made_reports
from builders.made_reports import MADE
from builders.project import ROOT
from scipy.stats import t as student

from pipeline.claims import entries, judge
from pipeline.reporting.claims import short_row
from pipeline.reporting.report import Report
from pipeline.results import glove_results, one_table, published, shards
from tactile.base.errors import InputError
from tactile.base.params_file import copied
from tactile.base.paths import Workspace
from tactile.datasets import images, schemas
from tactile.drawing.labels import model_name
from tactile.experiments import facts
from tactile.own import report as own_sensor
from tactile.scoring import estimates

SPEED = {f"speed/{name}" for name in ("table2.csv", "table2.md", "tradeoff.png", "training.png")}
OF_THE_PAGE = "answer.png"  # its first screen shows it, and the report does not
FILES = {  # of accuracy/, beside README.md
    "touch": {"table1.csv", "learning_curves.png", *(f"figure{k}.png" for k in ("2b", 4, 5, 6, 7, 8))},
    "velostat_recorded": {"table.csv", "figure.png", "learning_curves.png"},
    "array_recorded": {f"{name}.csv" for name in ("table", "pooled", "persons")}
    | {f"{name}.png" for name in ("frames", "errors", "learning_curves")},
    "strain": {f"{name}.csv" for name in ("table1", "samples", "drift", "capacity", "strands", "bases")}
    | {f"{name}.png" for name in ("figure5", "figure5_drift", "figure6", "figure7", "figure8_task_1", "figure8_task_2")}
    | {f"{name}.png" for name in ("samples", "drift", "capacity", "strands", "time", "learning_curves")},
    "strain_recorded": {"table.csv", "figure.png", "learning_curves.png"},
    "glove": {"table1.csv", "table2.csv", "figure15.csv"}
    | {f"figure{k}.png" for k in (7, 9, 10, 13, "14_pressure", "14_strain", "14_combined", 15)}
    | {"learning_curves.png"},
    "glove_recorded": {"table.csv", "learning_curves.png", *(f"confusion_{d}.png" for d in images.MODALITIES)},
}
NEVER = r"\bnan\b|- points|not counted|\b1 seeds|\{\{|\{%|\bNone\b|<built-in|jinja"
JUDGED = re.compile(r"\| +(reproduced|contradicted|undecided|matches|near|off|outside|calibrated) \|")
HALF = student.ppf(0.975, 2) / np.sqrt(3)  # of the interval of three runs, of their standard deviation


def interval_of_logs(values: np.ndarray) -> tuple[float, float, float]:
    """Return geometric mean, low and high of three errors."""
    logs = np.log(values)
    return tuple(np.exp(logs.mean() + side * HALF * logs.std(ddof=1)) for side in (0, -1, 1))


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """`written(experiment)`: a workspace with what the stages before `render` leave, made once."""

    def write(experiment: str) -> Workspace:
        made = Workspace(tmp_path_factory.mktemp(experiment))
        copied(ROOT / "params.yaml", made.root)
        made_reports.write(made, experiment, made_reports.settings_of(experiment))
        return made

    return functools.cache(write)


@pytest.fixture
def made(written, workspace):
    """`made(experiment)`: its settings, after a copy of what is written of it was put into the workspace."""

    def copy(experiment: str) -> dict:
        shutil.copytree(written(experiment).root, workspace.root, dirs_exist_ok=True)
        return made_reports.settings_of(experiment)

    return copy


@pytest.fixture(scope="module")
def shown(written, tmp_path_factory):
    """`shown(experiment)`: the folder of its report, rendered once and without figures."""

    def render(experiment: str) -> Path:
        copy = Workspace(tmp_path_factory.mktemp("shown") / experiment)
        shutil.copytree(written(experiment).root, copy.root)
        with pytest.MonkeyPatch.context() as patch:
            made_reports.unplot(patch)
            return made_reports.rendered(copy, experiment, made_reports.settings_of(experiment), patch)

    return functools.cache(render)


def cells(line: str) -> list[str]:
    return [cell.strip() for cell in line.strip().strip("|").split(" | ")]


@pytest.mark.parametrize("experiment", [name for name in FILES if not facts(name).subject])  # see test_array_report.py
def test_every_report_has_every_model_says_failed_runs_and_reads_as_text(workspace, unplotted, monkeypatch, experiment):
    settings = made_reports.settings_of(experiment)
    failed = list(settings["models"])[-1]
    made_reports.write(workspace, experiment, settings, failed)
    target = made_reports.rendered(workspace, experiment, settings, monkeypatch)
    found = {path.relative_to(target).as_posix() for path in target.rglob("*.*")}
    further = {"speed/table1_times.md"} if experiment == "strain" else set()
    accuracy = {f"accuracy/{name}" for name in FILES[experiment] | {"README.md"}}
    assert found - {f"accuracy/{OF_THE_PAGE}"} == SPEED | further | accuracy

    text = (target / "accuracy" / "README.md").read_text()
    assert not (bad := re.search(NEVER, text)), bad
    prose = [line for line in text.splitlines() if not line.startswith("|")]
    assert not [line for line in prose if "  " in line.strip() or line != line.rstrip()] and "\n\n\n" not in text
    assert len(JUDGED.findall(text)) >= 3 and "## Findings\n\n| Claim " in text and text.startswith("# ")
    assert set(re.findall(r"\]\((\w+\.png)\)", text)) == {name for name in FILES[experiment] if name.endswith(".png")}
    assert all((target / "accuracy" / link).exists() for link in re.findall(r"\]\(([^)]+)\)", text))

    names = {model_name(model) for model in settings["models"]}
    of_models = 0
    for block in re.findall(r"(?:^\|.*\n)+", text, re.MULTILINE):
        header, _, *rows = [cells(line) for line in block.splitlines()]
        shown = {row[0] for row in rows} if header[0] == "Model" else set(header[1:])
        if header[0] in ("Model", "Recording"):
            of_models += 1
            assert shown == names, block
            assert "failed (1 of" in block, block
    assert of_models > 1


@pytest.mark.parametrize("experiment", ["touch", "strain", "glove"])
def test_the_report_of_an_own_sensor_has_every_model_and_nothing_of_a_paper(
    workspace, unplotted, monkeypatch, experiment
):
    settings = made_reports.settings_of(experiment)
    made_reports.write(workspace, experiment, settings, "constant")
    settings["source"] = "data/own/my*sensor"
    if experiment == "touch":  # as the scorer of own logs writes it
        scores = pd.read_csv(workspace.scores("touch"))
        gain = scores[scores["metric"] == "rmse"].assign(metric="force_gain", unit="1", value=1.0)
        pd.concat([scores, gain]).to_csv(workspace.scores("touch"), index=False)
    said = made_reports.rendered(workspace, experiment, settings, monkeypatch) / "accuracy" / "README.md"
    assert "there is no evidence" in said.read_text() and len(list(said.parent.iterdir())) == 1
    target = made_reports.rendered(workspace, experiment, settings, monkeypatch, "look") / "accuracy"
    text = (target / "README.md").read_text()
    assert text.startswith("# `my*sensor`: ") and not re.search(NEVER + "|published|simulated|reproduced", text)
    figures = re.findall(r"\]\((\w+\.png)\)", text)
    assert set(figures) == {path.name for path in target.glob("*.png")} and len(figures) > 2
    assert "fewer than 50 test" in text or experiment == "touch"
    blocks = [block for block in re.findall(r"(?:^\|.*\n)+", text, re.MULTILINE) if block.startswith("| Model")]
    assert len(blocks) > 2
    for block in blocks:
        assert {cells(line)[0] for line in block.splitlines()[2:]} == {
            model_name(model) for model in settings["models"]
        }
        assert "failed (1 of" in block


@pytest.mark.slow
@pytest.mark.parametrize("experiment", made_reports.DATA)
def test_figures_are_drawn(workspace, monkeypatch, experiment):
    settings = made_reports.settings_of(experiment)
    made_reports.write(workspace, experiment, settings, "constant")
    target = made_reports.rendered(workspace, experiment, settings, monkeypatch) / "accuracy"
    assert min(path.stat().st_size for path in target.glob("*.png")) > 5_000


@pytest.mark.slow
def test_reports_repeat_byte_for_byte_and_measured_times_are_in_speed_alone(workspace, made, monkeypatch):
    settings = made("velostat_recorded")
    (workspace.look / "velostat_recorded").mkdir(parents=True)
    (workspace.look / "velostat_recorded" / "stale.md").write_text("of a model that was removed")
    target = made_reports.rendered(workspace, "velostat_recorded", settings, monkeypatch, "look")
    first = {path.relative_to(target).as_posix(): path.read_bytes() for path in target.rglob("*.*")}
    assert "stale.md" not in first
    latency = pd.read_csv(workspace.latency("velostat_recorded"))
    latency[["p50_ms", "p50_low_ms", "p50_high_ms", "p95_ms"]] *= 1.5
    latency.to_csv(workspace.latency("velostat_recorded"), index=False)
    made_reports.rendered(workspace, "velostat_recorded", settings, monkeypatch, "look")
    assert {name for name in first if (target / name).read_bytes() != first[name]} == SPEED - {"speed/training.png"}


@pytest.mark.parametrize("experiment", ["touch", "strain", "glove"])
def test_words_and_tables_of_accuracy_have_no_measured_time(workspace, made, shown, unplotted, monkeypatch, experiment):
    settings, timed = made(experiment), shards.study_file(workspace, experiment, "latency", 0)
    latency = pd.read_csv(timed)
    latency[["p50_ms", "p50_low_ms", "p50_high_ms", "p95_ms"]] *= 1.5
    latency.to_csv(timed, index=False)
    index, name = shards.folder(workspace) / "index.csv", f"latency_{experiment}-0-full"
    (line,) = shards.table(index, shards.INDEX).query("shard == @name").to_dict("records")
    shards.upsert(index, shards.INDEX, name, [line | {"sha256": shards.digest([timed])}])
    target = made_reports.rendered(workspace, experiment, settings, monkeypatch)
    assert (target / "speed" / "table2.csv").read_bytes() != (shown(experiment) / "speed" / "table2.csv").read_bytes()
    slower, usual = (
        {path.name: path.read_bytes() for path in (at / "accuracy").iterdir()} for at in (target, shown(experiment))
    )
    assert slower == usual


def test_numbers_of_touch(shown):
    target = shown("touch")
    text = (target / "accuracy" / "README.md").read_text()
    linear = next(line for line in text.splitlines() if line.startswith("| Linear  "))
    mean, low, high = interval_of_logs([30, 31, 32])  # kPa of the runs
    assert cells(linear)[1:3] == ["8.68", f"{mean:.2f} [{low:.2f}, {high:.2f}]"]
    csv = pd.read_csv(target / "accuracy" / "table1.csv").set_index(["protocol", "condition", "model", "metric"])
    assert csv.loc[("press", "double", "lomp", "rmse"), "published"] == 7.49
    assert csv.loc[("press", "double", "lomp", "rmse"), "mean"] == pytest.approx((100 * 110 * 120) ** (1 / 3))
    assert csv.loc[("random_window", "single", "rnn", "rmse"), "runs"] == 1
    rows = {cells(line)[0]: cells(line) for line in text.splitlines() if line.startswith("| l")}
    mean, low, high = interval_of_logs([30 / 20, 32 / 21, 34 / 22])
    wanted = f"{mean:.2f} [{low:.2f}, {high:.2f}]"
    assert rows["lomp_alpha_0"][1:5] == ["LoMP", "alpha 0.0", "2", "lomp_half"] and rows["lomp_alpha_0"][6] == wanted
    assert rows["linear_1_frame"][4] == "Linear, Table I"
    assert rows["linear_1_frame"][5:7] == [f"{np.sqrt(95 * 97):.2f}", f"{np.sqrt(95 / 31 * 97 / 32):.2f}"]
    assert (
        f"Ours is {interval_of_logs([20 / 30, 21 / 31, 22 / 32])[0]:.3f} [" in text
        and "published 0.250. `simulate" in text
    )
    speed = (target / "speed" / "table2.md").read_text()
    assert ["LoMP", "1.45", "0.500"] in [cells(line) for line in speed.splitlines()]  # Table II: 1.45 ms
    assert "Our times were measured on a core. The published ones" in speed


def test_numbers_of_strain_stand_beside_the_printed_ones(shown):
    target = shown("strain")
    text = (target / "accuracy" / "README.md").read_text()
    rows = [cells(line) for line in text.splitlines() if line.startswith("| LSTM, direct ")]
    assert [row[:4] for row in rows[:2]] == [
        ["LSTM, direct", "11,450", "17", "0.43"],
        ["LSTM, direct", "11,500", "17", "27"],
    ]
    assert (
        rows[0][4].startswith(f"{interval_of_logs([30, 31, 32])[0]:.3f} [") and len(rows[2]) == 4
    )  # the paper has no task 0
    for published_ratio, what in (
        ("0.172", "was set by one published number"),
        ("0.627", "Nothing was set by a second ratio"),
    ):
        assert re.search(rf"{what}.* Ours is [^,]*\[.*, published {published_ratio}\.", text)
    times = (target / "speed" / "table1_times.md").read_text()
    assert times.count("\n\nMeasured on a core.\n\n") == 3, "of each task"
    assert ["LSTM, transfer (Adam)", "93", "9.5"] in [cells(line) for line in times.splitlines()]


def test_numbers_of_glove(shown):
    target = shown("glove")
    text = (target / "accuracy" / "README.md").read_text()
    own = estimates.estimate([0.82, 0.83, 0.84], estimates.SHARE).percent()
    rows = [cells(line) for line in text.splitlines() if line.startswith("| SP-ResNet  ")]
    assert rows[0][3:5] == ["88.39", f"83.00 [{own.low:.2f}, {own.high:.2f}]"]
    assert [row[4] for row in rows if len(row) == 7] == [rows[0][4], "82.00"]  # by session, on random frames
    counted = [row for row in map(cells, text.splitlines()) if row[0].startswith("SP-ResNet (reduction")]
    assert [row[-2:] for row in counted] == [["30", "300"], ["", ""]]  # like with like only as trained
    assert "1,824,033,792" in text and "for research only" in text and "tactile/models/lomp.py" not in text

    table = pd.read_csv(target / "accuracy" / "table1.csv").set_index(["protocol", "model", "metric"])
    assert table.loc[("session_strain", "sp_resnet", "macro_precision"), "mean"] == pytest.approx(0.83)
    assert table.loc[("session_strain", "sp_resnet", "macro_precision"), "published"] == pytest.approx(0.8839)
    assert set(table[["runs", "failed"]].itertuples(index=False, name=None)) == {(3, 0), (1, 0)}
    table = pd.read_csv(target / "accuracy" / "table2.csv").set_index(["method", "condition", "metric"])
    assert table.loc[("all", "strain", "macro_precision"), "mean"] == pytest.approx(0.83)  # that of Table 1
    assert table.loc[("A", "pressure", "macro_precision"), "gain"] == pytest.approx(0.11)  # of 0.1, 0.11 and 0.12
    assert table.loc[("A", "pressure", "macro_precision"), "gain_low"] == pytest.approx(0.11 - HALF * 0.01)
    assert table.loc[("A", "pressure", "macro_precision"), "published_gain"] == pytest.approx(0.0011)


@pytest.mark.parametrize("experiment", ["touch", "glove"])
def test_verdicts_of_a_report_are_those_of_the_claims(workspace, made, unplotted, monkeypatch, experiment):
    settings = made(experiment)
    target = made_reports.rendered(workspace, experiment, settings, monkeypatch)
    claims = [claim for claim in entries.read(workspace)[0] if claim.experiment == experiment]
    known = one_table.results(workspace, [], experiment)
    rows = {tuple(short_row(row)) for row in judge.table(claims, known).itertuples()}
    text = (target / "accuracy" / "README.md").read_text()
    lines = text.split("## Findings\n\n")[1].split("\n\n")[0].splitlines()[2:]
    judged = {tuple(cell.strip() for cell in line.strip("|").split(" | ")) for line in lines}
    assert judged <= rows and len(judged) > 8
    assert len({row[3] for row in judged}) > 1


def test_a_run_that_is_not_there_is_said(workspace, made):
    settings = made("touch")
    scores = pd.read_csv(workspace.scores("touch"))
    gone = (scores["model"] == "rnn") | (scores["model"] == "lomp") & (scores["seed"] > 0)
    scores[~gone].to_csv(workspace.scores("touch"), index=False)
    report = Report(workspace, "touch", settings, look=True)
    rows = {cells(line)[0]: cells(line) for line in report.table({"single": ("press", "single", "rmse")}).splitlines()}
    assert rows["RNN"][1:] == ["2.16", "not run"] and rows["LoMP"][1:] == ["2.17", "10.00, of 1"]
    assert report.score("press", "single", "cnn", "rmse") == "not run"
    nothing = report.ratio(("press", "single", "rnn", "rmse"), ("press", "single", "lomp", "rmse"))
    assert report.text(nothing, "") == "not run"


def test_the_ratio_of_shares_is_that_of_what_is_missing(workspace, made):
    settings = made("glove")
    report = Report(workspace, "glove", settings)
    place = ("session_strain", "strain")
    ratio = report.ratio((*place, "sp_resnet", "accuracy"), (*place, "constant", "accuracy"))
    assert ratio.mean == pytest.approx(interval_of_logs([0.18 / 0.6, 0.17 / 0.59, 0.16 / 0.58])[0])
    printed = [100 - published.precision(model, "combined") for model in ("tree", "naive_bayes")]
    assert settings["yardstick"]["published"] == pytest.approx(printed[0] / printed[1], abs=5e-4)


@pytest.mark.parametrize(
    ("experiment", "missing"),
    [
        ("touch", "scores.csv"),
        ("touch", "kept.parquet"),
        ("touch", "speed/latency.csv"),
        ("touch", "models/rnn/press-1/fit.json"),
        ("touch", "models/rnn/press-1/history.csv"),
    ],
)
def test_a_missing_file_is_named(workspace, made, unplotted, monkeypatch, experiment, missing):
    settings = made(experiment)
    (workspace.experiment_folder(experiment) / missing).unlink()
    with pytest.raises(InputError, match=f"data/{experiment}/{missing}: not found"):
        made_reports.rendered(workspace, experiment, settings, monkeypatch, "look")
    assert not (workspace.look / experiment).exists()


@pytest.mark.parametrize("experiment", made_reports.DATA)
def test_a_committed_report_follows_from_the_evidence_and_the_look_from_what_is_here(
    workspace, made, shown, unplotted, monkeypatch, experiment
):
    settings = made(experiment)
    look = made_reports.rendered(workspace, experiment, settings, monkeypatch, "look")
    assert "is of the look" in (look / "accuracy" / "README.md").read_text()
    shutil.rmtree(workspace.root / "data")
    target = made_reports.rendered(workspace, experiment, settings, monkeypatch)
    known = shown(experiment)
    names = {path.relative_to(known) for path in known.rglob("*.*")}
    assert names == {path.relative_to(target) for path in target.rglob("*.*")}
    assert all((target / name).read_bytes() == (known / name).read_bytes() for name in names)
    text = (target / "accuracy" / "README.md").read_text()
    assert "is of the evidence" in text and "have kept no" not in text


@pytest.mark.parametrize("experiment", made_reports.DATA)
def test_what_no_shard_has_kept_is_said_and_not_drawn(workspace, made, unplotted, monkeypatch, experiment):
    settings = made(experiment)
    shards.kept_file(workspace, made_reports.MADE).unlink()
    index = shards.folder(workspace) / "index.csv"
    (line,) = [row for row in pd.read_csv(index, dtype=str).fillna("").to_dict("records") if row["shard"] == MADE]
    shards.upsert(index, shards.INDEX, MADE, [line | {"kept_sha256": ""}])
    target = made_reports.rendered(workspace, experiment, settings, monkeypatch) / "accuracy"
    text = (target / "README.md").read_text()
    assert "Some shards have kept no predictions: `tactile evidence made` computes those that figures show." in text
    assert not re.search(NEVER, text)
    left = {path.name for path in target.glob("*.png")} - {OF_THE_PAGE}
    assert set(re.findall(r"\]\((\w+\.png)\)", text)) == left < FILES[experiment]
    with pytest.raises(InputError, match="kept.parquet: not found"):
        workspace.kept(experiment).unlink()
        made_reports.rendered(workspace, experiment, settings, monkeypatch, "look")


@pytest.mark.parametrize("experiment", made_reports.DATA)
def test_without_evidence_a_report_shows_nothing_of_the_look(workspace, made, unplotted, monkeypatch, experiment):
    settings = made(experiment)
    (shards.folder(workspace) / "index.csv").unlink()
    shutil.rmtree(shards.folder(workspace) / "studies", ignore_errors=True)
    target = made_reports.rendered(workspace, experiment, settings, monkeypatch)
    text = (target / "accuracy" / "README.md").read_text()
    assert "not computed" in text and not re.search(NEVER, text) and "look of this machine" not in text
    of_scene = {"figure2b.png", "figure7.png", "figure9.png"}
    assert {path.name for path in (target / "accuracy").glob("*.png")} <= of_scene


def test_captions_say_budget_seeds_and_split(workspace, made):
    settings = made("touch")
    report = Report(workspace, "touch", settings)
    assert report.caption("press") == "full budget, first of 3 arrays, test part of press"
    assert report.caption("press", 3) == "full budget, 3 arrays together, test part of press"
    assert report.caption("press", 2) == "full budget, 2 together of 3 arrays, test part of press"
    assert report.caption("random_window") == "full budget, 1 array, test part of random window"
    look = Report(workspace, "touch", settings, look=True)
    assert look.caption("press") == "look of this machine, first of 3 arrays, test part of press"


def test_a_kept_file_that_the_index_does_not_know_is_refused(workspace, made, unplotted, monkeypatch):
    settings = made("strain")
    path = shards.kept_file(workspace, MADE)
    path.write_bytes(path.read_bytes() + b" ")
    with pytest.raises(InputError, match=f"{MADE}.parquet: not the file that .*index.csv tells of"):
        made_reports.rendered(workspace, "strain", settings, monkeypatch)


@pytest.mark.parametrize("experiment", ["touch", "strain", "glove"])
def test_a_study_that_was_not_computed_is_said_and_nothing_breaks(workspace, made, unplotted, monkeypatch, experiment):
    settings = made(experiment)
    folder = shards.folder(workspace)
    shutil.rmtree(folder / "studies", ignore_errors=True)
    index = pd.read_csv(folder / "index.csv", dtype=str)
    index[index["shard"] == MADE].to_csv(folder / "index.csv", index=False)
    path = shards.result_file(workspace, MADE)
    rows = pd.read_csv(path, dtype=str)
    rows[rows["variant"].isna()].to_csv(path, index=False)
    line = index[index["shard"] == MADE].fillna("").to_dict("records")[0] | {"sha256": shards.digest([path])}
    shards.upsert(folder / "index.csv", shards.INDEX, MADE, [line])
    target = made_reports.rendered(workspace, experiment, settings, monkeypatch) / "accuracy"
    text = (target / "README.md").read_text()
    assert re.search(r"[Ss]till to be computed with `tactile evidence`", text) and not re.search(NEVER, text)
    assert set(re.findall(r"\]\((\w+\.png)\)", text)) == {path.name for path in target.glob("*.png")}


@pytest.mark.parametrize("experiment", ["touch", "glove"])
def test_models_and_conditions_can_be_left_out(workspace, unplotted, monkeypatch, experiment):
    settings = made_reports.settings_of(experiment)
    settings["models"] = {"constant": {}, "poly_array": {}} if experiment == "touch" else {"constant": {}, "tree": {}}
    monkeypatch.setattr(made_reports, "TOUCHES", {"single": 1})
    monkeypatch.setattr(made_reports, "OBJECTS", ["cup", "pen", "a_and_b"])
    made_reports.write(workspace, experiment, settings)
    target = made_reports.rendered(workspace, experiment, settings, monkeypatch) / "accuracy"
    text = (target / "README.md").read_text()
    assert not re.search(NEVER, text)
    assert set(re.findall(r"\]\((\w+\.png)\)", text)) == {path.name for path in target.glob("*.png")}
    if experiment == "touch":
        assert "no recordings of two touches" in text and not (target / "figure6.png").exists()


def test_predictions_must_cover_the_test_windows(workspace, made):
    made("touch")
    path = workspace.predictions("touch") / "rnn.parquet"
    data = pyarrow.parquet.read_table(path)
    schemas.write(path, data.schema, [data.slice(1)])
    windows = estimates.read_windows(workspace, "touch")
    with pytest.raises(InputError, match="do not match the 56 test windows"):
        estimates.read_predictions(workspace, "touch", "rnn", "press", 0, windows)
    whole = estimates.read_predictions(workspace, "touch", "rnn", "press", 1, windows)
    assert np.isnan(whole[:4]).all() and np.isfinite(whole[4:]).all()


def test_figure_15_has_both_forms_and_networks_of_several_frames_begin_with_one(workspace, made):
    made("glove")
    both = glove_results.read_frames(workspace, "combined", ["sp_resnet"])
    assert set(both["model"]) == {"sp_resnet"}
    trained, mean = (both[both["form"] == form].drop(columns="form") for form in ("trained", "mean"))
    assert sorted(set(trained["frames"])) == sorted(set(mean["frames"])) == [1, 2, 3]
    key = ["model", "seed", "frames", "metric"]
    first = [rows[rows["frames"] == 1].set_index(key)["value"].sort_index() for rows in (trained, mean)]
    assert len(first[0]) == 6 and first[0].equals(first[1])
    assert trained.set_index(key)["value"]["sp_resnet", 1, 3, "macro_precision"] == pytest.approx(0.81)
    assert set(glove_results.read_frames(workspace, "pressure", ["sp_resnet"])["form"]) == {"mean"}


def test_published_tables_are_read():
    assert published.precision("sp_resnet", "combined") == 95.5 and published.precision("none", "strain") == 88.25
    models = (*published.PRINTED["sp_resnet"], *published.METHODS)
    assert np.isfinite([published.precision(model, dataset) for model in models for dataset in images.MODALITIES]).all()
    assert np.isnan(published.precision("constant", "strain"))


def test_velostat_without_recordings_says_why(workspace, monkeypatch):
    reason = {"run": False, "reason": "recordings not downloaded; run `tactile fetch velostat_recorded`"}
    workspace.ingest_report("velostat_recorded").parent.mkdir(parents=True)
    workspace.ingest_report("velostat_recorded").write_text(json.dumps(reason))
    settings = made_reports.settings_of("velostat_recorded")
    target = made_reports.rendered(workspace, "velostat_recorded", settings, monkeypatch, "look")
    assert "tactile fetch velostat_recorded" in (target / "accuracy" / "README.md").read_text()
    assert not list(target.rglob("*.csv")) and not list(target.rglob("*.png"))


@pytest.mark.slow
def test_render_needs_neither_torch_nor_scikit_learn(workspace):
    code = (
        "import sys, pipeline.stages.render, pipeline.stages.judge\n"
        "heavy = {'torch', 'sklearn', 'mlflow', 'tactile.learning.regressors', 'tactile.models'}\n"
        "print(sorted(heavy & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=workspace.root, capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


@pytest.mark.parametrize("count", [3, 8, 200])
def test_of_many_conditions_the_best_and_the_worst_are_drawn(count):
    class Scored:
        models = ("constant", "tree", "cnn")

        def estimate(self, protocol, condition, model, metric):
            value = abs(int(condition) - 100.2) * (1 if model == "tree" else 2)
            return estimates.Estimate(value, value, value, 3, 0)

    places = [("press", str(k)) for k in range(count)]
    drawn = own_sensor.ends(Scored(), places, "rmse")
    if count < 200:
        assert drawn == places
    else:
        assert [int(condition) for _, condition in drawn] == [0, 1, 2, 99, 100, 101, 102, 199]
