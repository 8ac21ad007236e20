"""The study of strain: what its networks are trained on, and on what they are scored."""

from types import SimpleNamespace

import numpy as np
import pytest
from builders.noted_series import noting
from builders.project import ROOT

from pipeline import models
from pipeline.base import params
from pipeline.experiments import strain
from pipeline.studies import latent


@pytest.fixture
def regressor(monkeypatch):
    """What `train_with` builds in place of a network."""
    model = noting(monkeypatch)
    model.task = SimpleNamespace(outputs=(2,), channels={"task_1": list(range(6))}, base="task_0", pressed_only=False)
    monkeypatch.setattr(strain, "task", lambda *arguments: model.task)
    return model


def trained(workspace, samples):
    values = {"strain": {"window": {"frames": 10}}, "device": "cpu"}
    return latent.train_with(workspace, values, "lstm_direct", {}, "task_1", 0, samples)


@pytest.mark.parametrize("samples", [None, 30])
def test_the_error_is_that_of_the_test_part(workspace, regressor, samples):
    model, error = trained(workspace, samples)
    assert model is regressor and error == pytest.approx(3.0)


def test_few_samples_are_the_last_ones_before_the_test_part(workspace, regressor):
    trained(workspace, 30)
    ((x, y, counted, training, press),) = regressor.records
    expected = regressor.piece.record
    assert np.array_equal(x, expected.x[50:80]) and np.array_equal(y, expected.y[50:80])
    assert training.all() and counted.all() and len(training) == len(counted) == len(press) == 30


def test_all_samples_end_before_the_test_part_and_keep_their_validation(workspace, regressor):
    trained(workspace, None)
    ((x, _, _, training, _),) = regressor.records
    assert np.array_equal(x, regressor.piece.record.x[:80]) and training.tolist() == [True] * 70 + [False] * 10


STUDY = {
    "window": {"frames": 10},
    "sensor": {"channels": 6},
    "model_zero": "lstm_direct",
    "models": {
        "lstm_direct": {"units": 9, "training": {"a": 1, "b": 2}},
        "lstm_transfer": {},
        "lstm_transfer_ridge": {},
    },
    "study": {"tasks": ["task_1", "task_2"], "capacity": {"training": {"b": 3}}},
}


def test_transfer_starts_from_the_network_of_the_task_asked_for(workspace, regressor):
    values = {"strain": STUDY, "device": "cpu"}
    rows = latent.one_base(workspace, values, "task_1", "task_2", 4, lambda: None)
    assert [row[:4] for row in rows] == [("task_2", "task_1", m, 4) for m in ("lstm_transfer", "lstm_transfer_ridge")]
    assert regressor.bases == 2 * [workspace.run_folder("strain", "lstm_direct", "task_1", 4)]
    assert [row[-1] for row in rows] == [pytest.approx(3.0)] * 2


def test_fewer_strands_are_seen_by_model_zero_and_by_all_that_starts_from_it(workspace, regressor, monkeypatch):
    seen, built = [], []
    monkeypatch.setattr(strain, "task", lambda protocol, settings: seen.append(settings["sensor"]) or regressor.task)
    monkeypatch.setattr(models, "build", lambda name, spec, block, where: built.append((name, block)) or regressor)
    rows = latent.one_strands(workspace, {"strain": STUDY, "device": "cpu"}, 2, 0, lambda: None)
    assert all(sensor == {"channels": 2} for sensor in seen)
    assert [row[:3] for row in rows] == [
        (t, 2, m) for t in ("task_1", "task_2") for m in ("lstm_direct", "lstm_transfer")
    ]
    assert built[0] == ("lstm_direct", {"units": 9, "training": {"a": 1, "b": 3}})
    (zero,) = regressor.saved
    assert [base for (name, _), base in zip(built, regressor.bases, strict=True) if name == "lstm_transfer"] == 2 * [
        zero
    ]


def test_truths_are_those_of_the_seeds_recording(workspace):
    settings = params.load(ROOT / "params.yaml")["strain"]
    settings = settings | {"simulate": settings["simulate"] | {"samples": 300}}
    at_s = np.array([0.5])
    assert latent.true_drift(workspace, settings, "task_1", 0, at_s) == {}
    for k in range(2):
        folder = workspace.logs("strain") / "task_1" / f"run00{k}"
        folder.mkdir(parents=True)
        (folder / "truth.csv").write_text(f"t_s,drift0\n0,{k}\n1,{k + 2}\n")
    first, second, again = (latent.true_drift(workspace, settings, "task_1", seed, at_s) for seed in range(3))
    assert [float(truths["true deviation"][0, 0]) for truths in (first, second, again)] == [1.0, 2.0, 1.0]
    assert np.array_equal(first["true drift"], again["true drift"]) and first["true drift"].shape == (1, 6)
    assert not np.allclose(first["true drift"], second["true drift"])
