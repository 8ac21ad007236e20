"""On a machine without recordings, the committed results on them stay as they are."""

import json
import re
import shutil

import pandas as pd
import pytest
from builders.project import ROOT, run_stage

from pipeline import experiments
from pipeline.base import availability, params
from pipeline.reporting import studies
from pipeline.scoring import kept as kept_table
from pipeline.stages import collect, evaluate, latency, render, render_study, stress

RECORDED = ("velostat_recorded", "strain_recorded", "glove_recorded")
REASON = "recordings not downloaded; run `tactile fetch`"


@pytest.fixture
def clone(workspace, monkeypatch):
    """A fresh clone's reports on recordings, and what the stages before write where recordings are absent."""
    committed, reports = ROOT / "reports", workspace.reports
    for name in ("scores.csv", "latency.csv", "stress.csv", "stability", *RECORDED):
        copy = shutil.copytree if (committed / name).is_dir() else shutil.copy
        reports.mkdir(exist_ok=True)
        copy(committed / name, reports / name)
    values = params.load(ROOT / "params.yaml") | {"experiments": list(RECORDED)}
    monkeypatch.setattr(params, "load", lambda _: values)
    for name in RECORDED:
        workspace.latency(name).parent.mkdir(parents=True)
        workspace.ingest_report(name).write_text(json.dumps({"run": False, "reason": REASON}))
        for path, module in ((workspace.latency, latency), (workspace.stress, stress)):
            path(name).write_text(",".join(module.COLUMNS) + "\n")
        run_stage(monkeypatch, workspace, evaluate, name)
    return committed


def rows(path, name):
    return [line for line in path.read_text().splitlines() if line.startswith(f"{name},")]


def test_committed_results_on_recordings_stay(workspace, clone, undrawn, monkeypatch, capsys):
    run_stage(monkeypatch, workspace, collect)
    run_stage(monkeypatch, workspace, render_study, "stability")
    for name in RECORDED:
        for table in ("scores.csv", "latency.csv", "stress.csv", "stability/failures.csv"):
            kept = rows(workspace.reports / table, name)
            assert kept == rows(clone / table, name) and kept, table
        assert not kept_table.read(workspace.kept(name), name).num_rows
        assert (
            workspace.predictions(name) / "not_run.txt"
        ).read_text() == REASON + "\n"  # DVC warns of an empty folder
    assert "Recorded Velostat taxel: all recordings" in (workspace.reports / "stability" / "README.md").read_text()
    said = capsys.readouterr().out
    assert f"scores.csv: kept from the committed results: {', '.join(RECORDED)}; `tactile fetch` gets" in said


def test_without_committed_results_an_experiment_is_not_run(workspace, clone, monkeypatch):
    shutil.rmtree(workspace.reports)
    run_stage(monkeypatch, workspace, collect)
    run_stage(monkeypatch, workspace, render, "strain_recorded", "look")
    run_stage(monkeypatch, workspace, render_study, "stability")
    assert (workspace.reports / "scores.csv").read_text().count("\n") == 1
    for place in ("look/strain_recorded/accuracy", "look/strain_recorded/speed", "stability"):
        said = (workspace.reports / place / "README.md").read_text()
        assert re.search(": (not run|nothing to show)\n\nRecordings not downloaded", said)
    assert availability.why_not_shown(workspace, "strain_recorded") == REASON


def test_the_recorded_side_of_a_comparison_stays(workspace, tmp_path):
    table = pd.DataFrame([("noise", "1", "simulated", "r", 2.0, "What it is.", "")], columns=studies.TWINS)
    for experiment in experiments.having("twin"):
        workspace.twins(experiment).parent.mkdir(parents=True)
        table.to_csv(workspace.twins(experiment), index=False)
    former, folder = workspace.reports / "twins", tmp_path / "new"
    former.mkdir(parents=True)
    folder.mkdir()
    (former / "touch.png").touch()
    kept = pd.DataFrame(
        [("touch", "noise", "1", 1 / 3, 0.1, 3.0, 9.0, 9.0, 9.0, False, "", "")], columns=studies.SUMMARY
    )
    kept.to_csv(workspace.reports / "twins.csv", index=False)
    touch, strain, glove = studies.twins(workspace, folder, {}).to_dict("records")
    assert (touch["recorded"], touch["recorded_high"], touch["simulated"], touch["inside"]) == (1 / 3, 3.0, 2.0, True)
    assert pd.isna(strain["recorded"]) and pd.isna(glove["inside"])
    assert [path.name for path in folder.glob("*.png")] == ["touch.png"]
    assert "0.333 (0.1 to 3)" in (folder / "README.md").read_text()
