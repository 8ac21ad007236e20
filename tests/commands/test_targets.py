"""`tactile check` and `tactile try` of a sensor that has a target of its own."""

import io
import json

import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest
from builders import free_targets
from scipy.stats import gmean

from tactile import experiments
from tactile.base import cards, processes
from tactile.commands import targets
from tactile.commands.targets import Effort
from tactile.targets import report as own_target


def test_a_target_is_checked_and_tested_without_any_other_log(workspace, called, monkeypatch):
    monkeypatch.setattr(targets, "LOOK", Effort(200, 5))
    folder = free_targets.angles(workspace.root / "data" / "own" / "joint")
    said = called("check", folder)
    assert "ben: 2 recordings, 786 readings; angle: -49.8" in said and "\nready: `tactile try data/own/joint`" in said
    assert "joint: angle, 198 windows, groups: anna, ben, cleo" in called("try", folder)
    report = workspace.reports / "own" / "joint"
    page, scores = (report / "README.md").read_text(), pd.read_csv(report / "scores.csv")
    assert page.startswith("# `joint`: angle, your own logs\n") and "nan" not in page and "inf" not in page
    assert "There is no data sheet of the sensor" in page and not (report / "sheet.md").exists()
    assert set(scores["test"]) == {"anna", "ben", "cleo"} and {"RMSE", "R2", "coverage"} <= set(scores["metric"])
    row = next(line for line in page.splitlines() if line.startswith("| chosen on the other groups"))
    errors = scores[(scores["model"] == "chosen on the other groups") & (scores["metric"] == "RMSE")]["value"]
    assert f"{gmean(errors):.2f} [" in row
    said = pd.read_csv(report / "predictions.csv")
    assert len(said) == 198 and said["recording"].nunique() == 6
    missed = np.sqrt(np.square(said["true"] - said["predicted"]).groupby(said["test"]).mean())
    assert missed.tolist() == pytest.approx(errors.tolist()), "predictions are those of groups that were held out"
    assert "(joint_angle.png)" in page and (report / "joint_angle.png").stat().st_size > 10_000


def test_the_first_thing_to_fix_is_said(workspace, called):
    folder = free_targets.angles(workspace.root / "data" / "own" / "joint", people=("anna",), seconds=3.0)
    (folder / "bend" / "anna_1" / "arm.log").unlink()
    with pytest.raises(SystemExit, match="fix first: .*bend/anna_1/arm.log: log not found"):
        called("check", folder)


@pytest.mark.parametrize("command", ["check", "try"])
def test_times_of_both_logs_in_milliseconds_are_said(command, workspace, called):
    folder = free_targets.angles(workspace.root / "data" / "own" / "joint", people=("anna",), seconds=30.0)
    for path in folder.rglob("*.log"):
        rows = [line.partition(",") for line in path.read_text().splitlines()]
        path.write_text("".join(f"{1000 * float(at):.0f},{rest}\n" for at, _, rest in rows))
    with pytest.raises(SystemExit, match="fix first: .*daq.log: 0.01 lines per second; .* Divide milliseconds by 1000"):
        called(command, folder)


def trained(called, monkeypatch, workspace, folder):
    """Return the folder of the model that a quick look keeps."""
    monkeypatch.setattr(targets, "LOOK", Effort(300, 10))
    monkeypatch.chdir(workspace.root)
    said = called("try", folder)
    model = workspace.root / "build" / "own" / folder.name / "trained" / "target"
    assert f"{model}: the model of all groups" in said
    return model


def test_the_model_of_a_number_predicts_a_person_who_did_not_train(workspace, called, tmp_path, monkeypatch):
    model = trained(called, monkeypatch, workspace, free_targets.angles(workspace.root / "data" / "own" / "joint"))
    logs = free_targets.angles(tmp_path / "new", people=("dora", "emil"), seconds=20.0) / "bend"
    (logs / "dora_1" / "arm.log").unlink()
    log = logs / "dora_1" / "daq.log"
    log.write_text(f"{log.read_text()}restarted\n{log.read_text()}")
    called("predict", model, logs)
    out = workspace.root / "predictions" / "bend"
    table = pq.read_table(out / "predictions.parquet").to_pandas()
    summary = json.loads((out / "summary.json").read_text())
    one = table[table["recording"] == "dora_0"]
    angle = 45 * np.sin(2 * np.pi * one["t_s"] / 3.1) + 5 * np.sin(2 * np.pi * one["t_s"] / 0.9)
    assert len(one) == 200 and np.sqrt(np.mean((one["predicted"] - angle) ** 2)) < 9
    assert np.mean((one["low"] <= angle) & (angle <= one["high"])) > 0.8
    assert np.ptp(one["high"] - one["low"]) < 1e-9 and (one["high"] - one["low"]).iloc[0] < 20
    assert [each["seconds"] for each in summary["recordings"]] == pytest.approx([19.9, 39.8, 19.9, 19.9])
    scores = {each["recording"]: each.get("scores") for each in summary["recordings"]}
    assert scores["dora_1"] is None and scores["dora_0"]["R2"] > 0.9 and scores["emil_0"]["coverage"] > 0.8
    card = json.loads((model / "target.json").read_text())
    tests = pd.read_csv(workspace.reports / "own" / "joint" / "scores.csv")
    tests = tests[(tests["model"] == "chosen on the other groups") & (tests["metric"] == "RMSE")]
    assert card["groups"] == tests["test"].tolist() and card["scores"]["RMSE"] == pytest.approx(gmean(tests["value"]))
    assert not any("notes" in each for each in summary["recordings"]) and card["interval_s"] == pytest.approx(0.1)
    rows = [line.partition(",") for line in (logs / "dora_0" / "daq.log").read_text().splitlines()]
    fast = tmp_path / "fast" / "bend" / "dora_0" / "daq.log"
    fast.parent.mkdir(parents=True)
    fast.write_text("".join(f"{float(at) / 2:.2f},{rest}\n" for at, _, rest in rows))
    said = called("predict", model, fast, "--out", tmp_path / "out")
    assert "the log has 20 readings a second by its times, the model's training 10: expect larger errors" in said
    live = pd.read_csv(
        io.StringIO(called("live", model, "--replay", logs / "dora_0" / "daq.log", "--speed", 1000, "--csv"))
    )
    assert live["t_s"].tolist() == pytest.approx(one["t_s"].tolist())
    for here, there in (("angle_deg", "predicted"), ("angle_low_deg", "low"), ("angle_high_deg", "high")):
        assert live[here].tolist() == pytest.approx(one[there].tolist(), abs=1e-3)
    with pytest.raises(SystemExit, match="only `tactile predict MODEL LOGS` and .* take the model of a target"):
        called("export", model, tmp_path / "exported")
    with open(model / "estimator.skops", "ab") as file:
        file.write(b"0")
    with pytest.raises(SystemExit, match="is not the file that target.json describes; train it again"):
        called("predict", model, logs)


def test_confusions_of_a_class_are_of_held_out_groups(workspace, called, monkeypatch):
    drawn = []
    monkeypatch.setattr(
        own_target.common, "confusion_matrix", lambda path, counts, *words: drawn.append((counts, words))
    )
    trained(called, monkeypatch, workspace, free_targets.objects(workspace.root / "data" / "own" / "mat"))
    report = workspace.reports / "own" / "mat"
    said, scores = pd.read_csv(report / "predictions.csv"), pd.read_csv(report / "scores.csv")
    chosen = scores[scores["model"] == "chosen on the other groups"].set_index(["test", "metric"])
    right = (said["true"] == said["predicted"]).groupby(said["test"], sort=False).mean()
    for test, share in right.items():
        assert share == pytest.approx(chosen.loc[(test, "right windows"), "value"])
    ((counts, (classes, title, what, items)),) = drawn
    assert classes == sorted(said["true"].unique()) and (what, items) == ("object", "votes")
    assert counts.sum() == said["recording"].nunique() and "that was held out" in title
    votes = chosen.xs("right votes", level="metric")
    assert np.trace(counts) == pytest.approx((votes["value"] * votes["n"]).sum())


def test_the_model_of_a_class_names_sets(workspace, called, tmp_path, monkeypatch):
    folder = free_targets.objects(workspace.root / "data" / "own" / "mat")
    asked = (folder / "settings.yaml").read_text()
    (folder / "settings.yaml").write_text(asked.replace("folder: 1", "folder: 1\n  window_s: 0.1"))
    model = trained(called, monkeypatch, workspace, folder)
    logs = free_targets.objects(tmp_path / "new", grasps=1, first=12)
    (logs / "cup" / "day0_12").rename(logs / "cup" / "unknown")
    (logs / "cup").rename(logs / "what")
    called("predict", model, logs, "--out", tmp_path / "out")
    table = pq.read_table(tmp_path / "out" / "predictions.parquet").to_pandas()
    summary = {
        each["recording"]: each for each in json.loads((tmp_path / "out" / "summary.json").read_text())["recordings"]
    }
    assert {name: each["vote"] for name, each in summary.items()} == {
        "ball/day0_12": "ball", "ball/day1_13": "ball", "plate/day0_12": "plate", "plate/day1_13": "plate",
        "what/unknown": "cup", "what/day1_13": "cup",
    }  # fmt: skip
    assert "scores" not in summary["what/unknown"] and summary["ball/day0_12"]["scores"]["coverage"] > 0.7
    sizes = table["set"].map(len)
    assert (table["set"].map(lambda names: names[0]) == table["predicted"]).all() and sizes.min() == 1 < sizes.max()
    assert np.stack(table["score"]).sum(axis=1) == pytest.approx(1)


@pytest.mark.parametrize(
    ("experiment", "made", "way"), [("strain", free_targets.angles, -1), ("glove", free_targets.objects, 1)]
)
def test_readings_outside_the_training_have_no_interval_or_set(
    experiment, made, way, workspace, called, tmp_path, monkeypatch
):
    """The second half of a log is shifted by a third of what the sensor showed in training."""
    folder = made(workspace.root / "data" / "own" / "sensor")
    model, log = trained(called, monkeypatch, workspace, folder), min(folder.rglob(experiments.log_name(experiment)))
    card = json.loads((model / "target.json").read_text())
    (kind,) = card["trained_on"]
    shift = way * (np.array(kind["high"]) - kind["low"]).max() / 3
    rows = [line.split(",") for line in log.read_text().splitlines()]
    half, moved = len(rows) // 2, tmp_path / "moved" / log.name
    moved.parent.mkdir()
    lines = [[t, *(f"{float(value) + shift * (k >= half):.4f}" for value in row)] for k, (t, *row) in enumerate(rows)]
    moved.write_text("".join(",".join(line) + "\n" for line in lines))

    def predicted(path):
        said = called("predict", model, path, "--out", tmp_path / "out")
        (summary,) = json.loads((tmp_path / "out" / "summary.json").read_text())["recordings"]
        return said, summary, pq.read_table(tmp_path / "out" / "predictions.parquet").to_pandas()

    said, summary, table = predicted(log)
    assert summary["share_outside_training"] == 0 and not table.isna().any(axis=None) and "lie outside" not in said
    said, summary, table = predicted(moved)
    outside = table["outside_training"].to_numpy()
    assert outside[half:].mean() > 0.5 and not outside[:half].any()
    assert f"{outside.sum()} of {len(rows)} readings lie outside what the model was trained on" in said
    assert summary["share_outside_training"] == pytest.approx(outside.mean())
    for name in ("set",) if experiment == "glove" else ("low", "high"):
        assert table[name].isna().tolist() == outside.tolist()
    assert not table["predicted"].isna().any()
    del card["trained_on"]
    (model / "target.json").write_text(cards.sealed(json.dumps(card), "target.json"))
    _, _, table = predicted(moved)
    assert "outside_training" not in table and not table.isna().any(axis=None), "as a card of before"


def test_two_runs_on_one_sensor_do_not_mix(workspace, called):
    folder = free_targets.angles(workspace.root / "data" / "own" / "joint", people=("anna",), seconds=3.0)
    with processes.holding(workspace.root / "build" / "own" / "joint" / "lock", lambda: None):
        with pytest.raises(SystemExit, match="is already running; wait until it ends, or stop it"):
            called("try", folder)
