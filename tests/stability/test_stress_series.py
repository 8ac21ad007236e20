"""Stress tests of models of series: what acts where, against models whose errors are known in closed form."""

import csv
import json
from types import SimpleNamespace

import numpy as np
import pytest
from builders.project import ROOT, miniature_settings, run_stage

from pipeline.scenes import strain, strain_stress
from pipeline.stability import loop
from pipeline.stability import series as stress_series
from pipeline.stages import simulate
from tactile.base import params
from tactile.base.errors import InputError
from tactile.base.paths import Workspace
from tactile.base.stress_tests import REGISTERED
from tactile.datasets import series
from tactile.stages import dataset, evaluate, ingest, train

SAMPLES, FIRST = 4000, 3500  # the test part is longer ago than WARM_UP from the start
SEEN = {"span": np.array([1.0, 2.0]), "rest": np.array([0.5, 0.5]), "low": 5.0}


def piece() -> series.Piece:
    """Two channels, one output; the first 3500 samples train. One sample a second."""
    rng = np.random.default_rng(0)
    x = rng.uniform(1, 2, (SAMPLES, 2)).astype(np.float32)
    number = np.arange(SAMPLES)
    part = np.where(number < FIRST, "train", "test")
    record = series.Record(x, x[:, :1].copy(), np.full(SAMPLES, True), part == "train", np.full(SAMPLES, -1))
    return series.Piece("task_1", number, part, number * 1.0, record)


def errors(predict, failed=False, seed=0, **plan) -> dict:
    """(perturbation, severity) -> (error, n) of a model, in the order in which they come."""
    run = stress_series.Run.__new__(stress_series.Run)
    run.module = strain
    run.model, run.failed, run.seed, run.protocol = SimpleNamespace(predict=predict), failed, seed, "task_1"
    run.task, run.piece, run.levels = series.Task((2,), {"task_1": [0, 1]}, False, "task_0"), piece(), SEEN
    run.asked = {"perturbations": plan}
    run.predict_clean()
    found = {}
    for name, severities in plan.items():
        test = REGISTERED["series"][name]
        every = [
            (0, run.unchanged(test)),
            *((severity, run.scores(run.changed(test, severity))) for severity in severities),
        ]
        for severity, scored in every:
            ((_, scores),) = scored
            found[name, severity] = next((v, n) for m, _, v, n, _ in scores if m == "error")
    return found


def perturbed(name, x, severity):
    return stress_series.changed(x, REGISTERED["series"][name], severity, 0, SEEN)


def first_channel(x):
    return x[:, :1]


def test_a_clean_model_and_what_noise_and_offsets_add():
    found = errors(first_channel, noise=[0.01, 0.1], offset_drift=[0.1])
    assert list(found) == [("noise", 0), ("noise", 0.01), ("noise", 0.1), ("offset_drift", 0), ("offset_drift", 0.1)]
    assert found["noise", 0] == found["offset_drift", 0] == (0.0, SAMPLES - FIRST)
    # Mean absolute error of a normal error of standard deviation severity * span.
    assert found["noise", 0.1][0] == pytest.approx(0.1 * np.sqrt(2 / np.pi), rel=0.1)
    assert found["noise", 0.01][0] == pytest.approx(found["noise", 0.1][0] / 10, rel=1e-3)
    wide = errors(lambda x: x[:, :1] + x[:, 1:] - x[:, 1:], noise=[0.1])
    assert wide["noise", 0.1][0] == pytest.approx(found["noise", 0.1][0], rel=1e-5)


def test_gain_is_of_the_deviation_from_rest():
    x = piece().record.x[FIRST:]
    once, twice = (
        np.log((perturbed("gain_drift", x, severity) - SEEN["rest"]) / (x - SEEN["rest"])) for severity in (0.2, 0.4)
    )
    assert np.ptp(once, axis=0) == pytest.approx(0, abs=1e-5) and abs(once[0]).min() > 1e-3
    assert twice == pytest.approx(2 * once, abs=1e-5)


def test_readings_stay_between_0_and_what_a_loose_strand_reads():
    x = piece().record.x[FIRST:]
    for name in ("noise", "offset_drift", "gain_drift"):
        found = perturbed(name, x, 10.0)
        assert found.min() >= 0 and found.max() <= SEEN["low"] and found.dtype == np.float32


def test_a_dead_strand_reads_the_supply_and_half_of_the_time_costs_half():
    both = errors(lambda x: x.mean(axis=1, keepdims=True), dead=[2], half=[2])
    assert both["dead", 2][0] == pytest.approx(np.mean(5.0 - piece().record.x[FIRST:, 0]), rel=1e-5)
    x, middle = piece().record.x[FIRST:], FIRST + (SAMPLES - FIRST) // 2
    early = np.abs(x.mean(axis=1) - x[:, 0])[: middle - FIRST].sum()
    late = (5.0 - x[middle - FIRST :, 0]).sum()
    assert both["half", 2][0] == pytest.approx((early + late) / len(x), rel=1e-5)


def test_time_counts_every_sample_once_by_its_age():
    drifting = errors(lambda x: x[:, :1] + np.arange(len(x))[:, None], time=[2, 5, 10])
    clean, n = drifting.pop(("time", 0))
    assert sum(count for _, count in drifting.values()) == n == SAMPLES - FIRST
    assert sum(value * count for value, count in drifting.values()) == pytest.approx(clean * n)
    assert [value for value, _ in drifting.values()] == sorted(value for value, _ in drifting.values())
    with pytest.raises(InputError, match="no sample of task_1 is 60 minutes old; its test part lasts 8.3 minutes"):
        errors(first_channel, time=[10, 60])


def test_a_model_that_forgets_nothing_sees_the_whole_recording():
    lengths = []

    def mean_so_far(x):
        lengths.append(len(x))
        return np.cumsum(x[:, :1], axis=0, dtype=float) / np.arange(1, len(x) + 1)[:, None] * 1e3

    found = errors(mean_so_far, noise=[1e-9])
    assert found["noise", 1e-9][0] == pytest.approx(found["noise", 0][0], rel=1e-6)
    assert lengths[-1] == SAMPLES
    lengths.clear()
    errors(lambda x: lengths.append(len(x)) or x[:, :1], noise=[0.1])
    assert lengths[-1] == SAMPLES - FIRST + stress_series.WARM_UP


def test_a_failed_run_has_no_numbers_and_seeds_draw_anew():
    assert all(np.isnan(value) for value, _ in errors(first_channel, failed=True, noise=[0.1]).values())
    one, other = (errors(first_channel, seed=seed, stuck=[1])["stuck", 1] for seed in (0, 1))
    assert one == errors(first_channel, seed=0, stuck=[1])["stuck", 1] and one != other


@pytest.fixture(scope="module")
def workspace(tmp_path_factory) -> Workspace:
    return Workspace(tmp_path_factory.mktemp("series"))


@pytest.fixture(scope="module")
def project(workspace):
    """Logs, frames and dataset of strain at miniature scale, ridge and constant trained and scored; its settings."""
    values = miniature_settings(workspace)
    values["strain"]["models"] = {"constant": {}, "ridge": {"ridge": 1.0}}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(params, "load", lambda _: values)
        patch.setenv("WORKERS", "1")
        for stage in (simulate, ingest, dataset, train, evaluate):
            run_stage(patch, workspace, stage, "strain")
        yield values


@pytest.mark.slow
def test_severity_0_is_exactly_what_evaluate_found(workspace, project):
    with open(workspace.scores("strain")) as file:
        known = {tuple(row[k] for k in (1, 2, 4, 5)): float(row[7]) for row in csv.reader(file) if row[3] == "ridge"}
    reports = []
    found = loop.rows(workspace, project, "strain", "ridge", lambda: reports.append(1))
    clean = [row for row in found if row[4] == 0 and row[3] not in REGISTERED["strain"]]
    assert len(reports) == 4 and len(clean) == 4 * 4 * 2  # runs; perturbations, error and r2
    for protocol, condition, seed, _, _, metric, _, value, _, blocks in clean:
        assert blocks == "" and value == known[protocol, condition, str(seed), metric]
    asked = params.load(ROOT / "params.yaml")["stress"]["strain"]["perturbations"]
    assert {(row[3], row[4]) for row in found} == {(name, s) for name, own in asked.items() for s in (0, *own)}
    worse = {row[3]: row[7] for row in found if row[0] == "task_1" and row[5] == "error" and row[4] > 0}
    clean = {row[3]: row[7] for row in found if row[0] == "task_1" and row[5] == "error" and row[4] == 0}
    assert worse["dead"] > 5 * clean["dead"] and worse["specimen"] != clean["specimen"]


@pytest.mark.slow
def test_changed_scenes_keep_the_motion_and_change_what_they_say(project):
    settings = project["strain"]
    settings = settings | {"simulate": settings["simulate"] | {"faults": settings["simulate"]["faults"] | {"gaps": 0}}}

    def record(change, severity):
        return stress_series.scene_record(json.dumps(settings), "strain", "task_2", change, severity, 1)

    plain, double, fast, other = record("rate", 0), record("rate", 1), record("speed", 1), record("specimen", 1)
    assert len(double.x) == pytest.approx(2 * len(plain.x), abs=4)
    n = len(plain.y) - 2
    assert np.abs(plain.y[:n] - double.y[::2][:n]).max() < 0.5  # mm; two readings of one place
    assert np.abs(plain.y[:n] - other.y[:n]).max() < 0.5
    assert not np.allclose(np.ptp(other.x, axis=0), np.ptp(plain.x, axis=0), rtol=0.05)
    before_rest = 10  # samples of the first stroke
    assert np.abs(plain.y[:before_rest:2][:5] - fast.y[: before_rest // 2]).max() < 0.5
    *_, trained = (one for one in strain.recordings(settings["simulate"]) if one.condition == "task_2")
    steps = round(1 / settings["ingest"]["rate_hz"] / strain.STEP_S)
    assert np.abs(trained.place_mm[::steps, :2][:n] - plain.y[:n]).max() > 10  # a path that no model has seen
    with pytest.raises(InputError, match="no change 'colour'"):
        strain_stress.changed(settings, "colour", 1)
