"""On a machine without recordings: reports are those of the evidence, of the look there is none, twins stay."""

import json

import pandas as pd
import pytest
from builders.project import ROOT, run_stage

from pipeline.reporting import studies
from pipeline.results import shards
from pipeline.stages import collect, latency, render, stress
from tactile import experiments
from tactile.base import params
from tactile.scoring import units
from tactile.stages import evaluate

RECORDED = ("velostat_recorded", "strain_recorded", "glove_recorded")
REASON = "recordings not downloaded; run `tactile fetch`"


@pytest.fixture
def clone(workspace, monkeypatch):
    """A fresh clone, and what the stages before write where recordings are absent."""
    values = params.load(ROOT / "params.yaml") | {"experiments": list(RECORDED)}
    monkeypatch.setattr(params, "load", lambda _: values)
    monkeypatch.setenv("WORKERS", "1")
    (workspace.root / "evidence").symlink_to(ROOT / "evidence")
    for name in RECORDED:
        workspace.latency(name).parent.mkdir(parents=True)
        workspace.ingest_report(name).write_text(json.dumps({"run": False, "reason": REASON}))
        for path, module in ((workspace.latency, latency), (workspace.stress, stress)):
            path(name).write_text(",".join(module.COLUMNS) + "\n")
        run_stage(monkeypatch, workspace, evaluate, name)
    return workspace


def test_reports_on_recordings_are_made_of_the_evidence(clone, undrawn, monkeypatch):
    run_stage(monkeypatch, clone, collect)
    scores, times = (pd.read_csv(clone.reports / f"{name}.csv", low_memory=False) for name in ("scores", "latency"))
    assert set(scores["experiment"]) == set(times["experiment"]) == set(RECORDED)
    assert not scores["metric"].str.endswith(units.SUFFIX).any() and "look" not in set(scores["budget"])
    kept = shards.read(clone)
    kept = kept[kept["experiment"].isin(RECORDED) & ~kept["metric"].str.endswith(units.SUFFIX)]
    assert len(scores) == len(kept) > 1000 and sorted(scores["value"]) == sorted(kept["value"]), "to the last digit"
    run_stage(monkeypatch, clone, render, "velostat_recorded")
    folder = clone.reports / "velostat_recorded"
    assert "nothing to show" not in (folder / "accuracy" / "README.md").read_text()
    assert len(pd.read_csv(folder / "speed" / "table2.csv")) > 5


def test_of_the_look_there_is_nothing(clone, monkeypatch):
    for name in RECORDED:
        assert (clone.predictions(name) / "not_run.txt").read_text() == REASON + "\n"  # DVC warns of an empty folder
    run_stage(monkeypatch, clone, collect, "look")
    run_stage(monkeypatch, clone, render, "all", "look")
    for table in ("scores", "latency", "stress"):
        assert (clone.look / f"{table}.csv").read_text().count("\n") == 1
    for name in RECORDED:
        for part in ("accuracy", "speed"):
            text = (clone.look / name / part / "README.md").read_text()
            assert ": nothing to show\n\nRecordings not downloaded" in text
    assert [path.name for path in clone.reports.iterdir()] == ["look"]


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
    rows = {row["experiment"]: row for row in studies.twins(workspace, folder, {}).to_dict("records")}
    touch, strain, glove = (rows[name] for name in ("touch", "strain", "glove"))
    assert (touch["recorded"], touch["recorded_high"], touch["simulated"], touch["inside"]) == (1 / 3, 3.0, 2.0, True)
    assert pd.isna(strain["recorded"]) and pd.isna(glove["inside"])
    assert [path.name for path in folder.glob("*.png")] == ["touch.png"]
    assert "0.333 (0.1 to 3)" in (folder / "README.md").read_text()
