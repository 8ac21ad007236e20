"""`tactile check` and `tactile try` of a sensor that has a target of its own."""

import sys

import pandas as pd
import pytest
from builders import free_targets

from pipeline.commands import command_line, targets
from pipeline.commands.targets import Effort


def called(monkeypatch, capsys, workspace, *arguments):
    """Return what a command prints."""
    monkeypatch.setattr(sys, "argv", ["tactile", *map(str, arguments), "--root", str(workspace.root)])
    command_line.main()
    return capsys.readouterr().out


def test_a_target_is_checked_and_tested_without_any_other_log(workspace, monkeypatch, capsys):
    monkeypatch.setattr(targets, "LOOK", Effort(200, 5))
    folder = free_targets.angles(workspace.root / "data" / "own" / "joint")
    said = called(monkeypatch, capsys, workspace, "check", folder)
    assert "ben: 2 recordings, 786 readings; angle: -49.8" in said and "\nready: `tactile try data/own/joint`" in said
    assert "joint: angle, 198 windows, groups: anna, ben, cleo" in called(monkeypatch, capsys, workspace, "try", folder)
    report = workspace.reports / "own" / "joint"
    page, scores = (report / "README.md").read_text(), pd.read_csv(report / "scores.csv")
    assert page.startswith("# `joint`: angle, your own logs\n") and "nan" not in page and "inf" not in page
    assert "There is no data sheet of the sensor" in page and not (report / "sheet.md").exists()
    assert set(scores["test"]) == {"anna", "ben", "cleo"} and {"RMSE", "R2", "coverage"} <= set(scores["metric"])
    row = next(line for line in page.splitlines() if line.startswith("| chosen on the other groups"))
    mean = scores[(scores["model"] == "chosen on the other groups") & (scores["metric"] == "RMSE")]["value"].mean()
    assert f"{mean:.2f} [" in row


def test_the_first_thing_to_fix_is_said(workspace, monkeypatch, capsys):
    folder = free_targets.angles(workspace.root / "data" / "own" / "joint", people=("anna",), seconds=3.0)
    (folder / "bend" / "anna_1" / "arm.log").unlink()
    with pytest.raises(SystemExit, match="fix first: .*bend/anna_1/arm.log: log not found"):
        called(monkeypatch, capsys, workspace, "check", folder)
