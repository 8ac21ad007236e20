"""Times of a prediction: of raw readings to kPa or mm, after the warm-up, round by round, on the threads stated."""

import os
import re
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest
from builders import made_reports, random_models
from builders.project import ROOT, run_stage

from pipeline.results import shards, times
from pipeline.stages import latency
from pipeline.studies import latency as study
from tactile import tasks
from tactile.base import modules, params
from tactile.base.paths import Workspace
from tactile.datasets import schemas
from tactile.inference import describer, onnx_network, predictor
from tactile.tasks import windows

SETTINGS = {"warm_up": 3, "calls": 4, "rounds": 1}


class Clock:
    """Stands in for the module `time` of the stage; predictions move it."""

    def __init__(self):
        self.now = 0.0

    def perf_counter(self) -> float:
        return self.now


@pytest.fixture
def clock(monkeypatch):
    clock = Clock()
    monkeypatch.setattr(latency, "time", clock)
    return clock


def slow_at_first(clock, slow: int, seen: list):
    """A prediction that takes 1 s in its first `slow` calls, then 1 ms, 2 ms, 3 ms and so on."""

    def predict(x):
        clock.now += 1.0 if len(seen) < slow else 1e-3 * (len(seen) - slow + 1)
        seen.append(x)

    return predict


@pytest.mark.parametrize(("batch", "warm_up", "calls"), [(1, 3, 4), (16, 1, 1)])
def test_calls_of_the_warm_up_are_made_and_not_counted(clock, batch, warm_up, calls):
    seen = []
    times = latency.prediction_times(slow_at_first(clock, warm_up, seen), np.zeros((20, 2, 3)), batch, SETTINGS)
    assert times == pytest.approx(np.arange(1, calls + 1))  # ms
    assert len(seen) == warm_up + calls and all(x.shape == (batch, 2, 3) for x in seen)


def test_every_call_gets_the_next_windows_from_the_start_again_at_the_end(clock):
    seen = []
    x = np.arange(5.0)[:, None]
    latency.prediction_times(slow_at_first(clock, 0, seen), x, 1, {"warm_up": 2, "calls": 10, "rounds": 2})
    assert [float(windows[0, 0]) for windows in seen] == [0, 1, 2, 3, 4, 0, 1]


def write_times(workspace, model: str, seconds: dict) -> None:
    """The training times of a model of touch: protocol -> seconds by seed."""
    path = workspace.training_times("touch", model)
    path.parent.mkdir(parents=True, exist_ok=True)
    rows = [f"{protocol},{seed},{s}" for protocol, own in seconds.items() for seed, s in enumerate(own)]
    path.write_text("\n".join(["protocol,seed,train_s", *rows]) + "\n")


ROUNDS_MS = ((5.0, 11.0, 12.0), (5.0, 3.0, 30.0), (5.0, 1.0, 2.0))  # of each round, of which the first is warm-up


def test_times_are_of_all_rounds_and_of_the_threads_that_the_table_names(workspace, monkeypatch, clock):
    """The stage on a model of one matrix product: threads of torch and of numpy's library while it predicts."""
    import torch
    from threadpoolctl import threadpool_info, threadpool_limits

    before, threads, taken = torch.get_num_threads(), [], iter(sum(ROUNDS_MS, ()))

    def watched(x):
        mkl = re.findall(r"mkl_get_max_threads\(\) : (\d+)", torch.__config__.parallel_info())
        threads.append({torch.get_num_threads(), *(pool["num_threads"] for pool in threadpool_info()), *map(int, mkl)})
        clock.now += 1e-3 * next(taken)

    values = params.load(ROOT / "params.yaml")
    timing = {"warm_up": 1, "calls": 6, "rounds": 3, "batches": [1], "threads": 1}
    values["touch"] |= {"models": {"linear": {}}, "latency": timing}
    model = SimpleNamespace(predict=watched, streams=False, parameters=lambda: 5, macs=lambda: 6)
    monkeypatch.setattr(params, "load", lambda _: values)
    monkeypatch.setattr("sys.argv", ["latency", "touch"])
    monkeypatch.setattr(latency, "why_not_run", lambda *given: None)
    monkeypatch.setattr(windows, "stream", lambda *arguments: (None, np.zeros((4, 2, 3))))
    monkeypatch.setattr(tasks, "load", lambda *arguments: SimpleNamespace(model=model))
    monkeypatch.setattr(latency, "fastest", lambda *arguments: {"linear": windows.timed(model, arguments[-1])})
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        monkeypatch.setenv(name, "2")  # the stage must not depend on it
    protocol, seed = params.runs(values, "touch")[0]
    folder = workspace.run_folder("touch", "linear", protocol, seed)
    folder.mkdir(parents=True)
    for name, size in {"estimator.skops": 100, "fit.json": 7, "history.csv": 7}.items():
        (folder / name).write_bytes(b"x" * size)
    write_times(workspace, "linear", {protocol: [1.0, 2.0, 30.0], "random_window": [500.0]})
    try:
        torch.set_num_threads(2)
        with threadpool_limits(2):
            latency.main(workspace)
    finally:
        torch.set_num_threads(before)
    assert len(threads) == 9 and set.union(*threads) == {1} and os.environ["OMP_NUM_THREADS"] == "1"
    ((_, row),) = pd.read_csv(workspace.latency("touch")).iterrows()
    assert tuple(row[["experiment", "model", "batch", "threads"]]) == ("touch", "linear", 1, 1)
    timed = [ms for _, *of_round in ROUNDS_MS for ms in of_round]
    assert row["p50_ms"] == pytest.approx(7.0) and row["p95_ms"] == pytest.approx(np.percentile(timed, 95))
    assert (row["p50_low_ms"], row["p50_high_ms"]) == pytest.approx((1.5, 16.5)), "medians of the rounds"
    assert tuple(row[["params", "macs", "train_s", "size_bytes", "calls"]]) == (5, 6, 2.0, 100, 6)


OF_KIND = {"touch": (40, 200, (6, 3, 6)), "strain": (1.5, 2.5, (6, 3)), "glove": (0, 255, (6, 1, 1024))}


@pytest.mark.parametrize("key", ["cnn", "lomp", "lomp_stream", "lstm_direct", "ridge", "resnet3x3"])
def test_the_timer_runs_a_model_from_raw_readings_to_its_unit(key, workspace, tmp_path, monkeypatch):
    """It hands over readings as they are, and is told what the model says of them: all scaling is inside of it."""
    saved = predictor.load(random_models.save(key, tmp_path))
    monkeypatch.setattr(describer.Describer, "__init__", lambda *given: None)
    monkeypatch.setattr(describer.Describer, "without_scores", lambda *given, **named: saved.card)
    experiment = random_models.CASES[key].experiment
    low, high, shape = OF_KIND[experiment]
    x = np.random.default_rng(0).uniform(low, high, shape).astype(np.float32)
    raw = x[:, -1] if key == "lomp_stream" else x  # a stream is told each frame once
    predict, inputs = latency.fastest(workspace, {}, experiment, "press", 0, {key: saved.model}, x)[key]
    if key in ("cnn", "lstm_direct", "resnet3x3"):
        assert isinstance(predict.__self__, onnx_network.OnnxNetwork)
    given, told = [], []
    noted = lambda part: (given.append(part), told.append(predict(part)))  # noqa: E731
    latency.prediction_times(noted, inputs, 1, {"warm_up": 0, "calls": 6, "rounds": 1})
    given, told = np.concatenate(given), np.concatenate(told).reshape(6, -1)
    if key == "lstm_direct":  # in the columns of a log
        assert not given[:, [1, 3]].any()
        given = given[:, random_models.CHOSEN]
    np.testing.assert_array_equal(given, raw)
    wanted = saved.model.predict(raw[None] if key == "lomp_stream" else x).reshape(-1, told.shape[1])
    assert np.ptp(told, axis=0).max() > 1e-2
    np.testing.assert_allclose(told[-len(wanted) :], wanted, rtol=1e-3, atol=2e-3 * np.abs(wanted).max())


@pytest.mark.parametrize(("column", "experiment"), [("x", "touch"), ("v", "strain"), ("pressure", "glove")])
def test_what_is_timed_are_the_readings_of_the_test_part(column, experiment, workspace, monkeypatch):
    """As the dataset's file has them, of the first run, in turn, whatever the batch."""
    settings = made_reports.settings_of(experiment)
    settings["sensor"]["channels"] = 4  # of strain
    run = next(iter(settings["protocols"])), 0
    made_reports.write(workspace, experiment, settings)
    table = pq.read_table(workspace.dataset(experiment))
    values, of_models = params.load(ROOT / "params.yaml") | {experiment: settings}, []
    monkeypatch.setattr(params, "load", lambda _: values)
    monkeypatch.setattr("sys.argv", ["latency", experiment])
    monkeypatch.setattr(latency, "why_not_run", lambda *given: None)
    model = SimpleNamespace(parameters=lambda: 5, macs=lambda: 6)
    monkeypatch.setattr(tasks, "load", lambda *arguments: SimpleNamespace(model=model))
    timed = lambda *given: of_models.append(given[-1]) or dict.fromkeys(given[-2], (None, given[-1]))  # noqa: E731
    monkeypatch.setattr(latency, "fastest", timed)
    batches = []
    monkeypatch.setattr(
        latency, "prediction_times", lambda predict, x, batch, _: batches.append((batch, x)) or np.ones(3)
    )
    latency.main(workspace)
    of_test = np.array(table[schemas.split_column(*run)].to_pylist()) == "test"
    if experiment == "strain":  # a recording of the task
        of_test &= np.array(table["condition"].to_pylist()) == run[0]
    raw = np.array(table[column].to_pylist())[of_test].astype(float)
    raw = raw[:, : settings["sensor"]["channels"]] if experiment == "strain" else raw
    (x,) = of_models
    assert len(raw) > 3 and np.ptp(raw) > 0
    np.testing.assert_array_equal(np.asarray(x, float).reshape(len(x), -1)[: len(raw)], raw.reshape(len(raw), -1))
    assert {batch for batch, _ in batches} == {1, 4} and all(given is x for _, given in batches)


SETS = {each.experiment: each for each in shards.read_sets(Workspace(ROOT)).values() if each.study == times.LATENCY}


def test_every_experiment_is_timed_for_the_evidence_with_more_calls_than_the_look():
    values = params.load(ROOT / "params.yaml")
    assert set(SETS) == set(values["experiments"])
    for experiment, each in SETS.items():
        first, _ = params.runs(values, experiment)[0]
        assert (each.protocols, each.seeds) == ([first], 1), "what the stage times"
        assert each.set[f"{experiment}.latency.calls"] > values[experiment]["latency"]["calls"]
        assert each.set[f"{experiment}.budget"] == values[experiment]["budget"], "trained no longer than for the look"


def test_the_study_keeps_what_the_stage_measured(workspace, monkeypatch):
    run = []

    def stage(root, module, *given):
        run.append((root, module, *given))
        if module.endswith("latency"):
            workspace.latency("touch").parent.mkdir(parents=True)
            workspace.latency("touch").write_text("experiment,model\ntouch,linear\n")

    monkeypatch.setattr(modules, "run", stage)
    run_stage(monkeypatch, workspace, study, "touch", "0")
    stages = "tactile.stages.train", "pipeline.stages.latency"
    assert run == [(workspace.root, name, "touch") for name in stages]
    assert workspace.study_result("touch", times.LATENCY).read_text() == "experiment,model\ntouch,linear\n"
