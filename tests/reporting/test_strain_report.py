"""How the errors of fingers go with drift that leaves its range in training."""

import numpy as np
import pandas as pd
import pytest
from scipy import stats

from pipeline.base import params
from pipeline.base.paths import Workspace
from pipeline.reporting import strain
from pipeline.scenes import strain as scene
from pipeline.scoring import claim_inputs, one_table
from tests.builders.project import ROOT

FINGERS = 6


@pytest.fixture
def settings() -> dict:
    block = params.load(Workspace(ROOT).params)["strain"]
    return block | {"simulate": block["simulate"] | {"samples": 3000}}


def results(values: dict[str, list[float]]) -> one_table.Results:
    """The one table of errors on task 1; values: model -> one a finger."""
    rows = [
        dict.fromkeys(claim_inputs.COLUMNS, "") | {"model": model, "seed": seed, "value": value, "n": 1}
        for model, runs in values.items()
        for seed, value in enumerate(runs)
    ]
    place = {"experiment": "strain", "protocol": "task_1", "condition": "task_1", "metric": "error", "unit": "mm"}
    return one_table.Results(pd.DataFrame(rows).assign(**place, budget=one_table.FULL))


def test_how_far_drift_leaves_its_range_is_that_of_the_logs(settings):
    """The drift at rest is what a strand's deviation has left where neither relaxation nor lag adds to it."""
    found = strain.errors_beyond(results({"ridge": [1.0] * FINGERS}), ["ridge"], settings)["beyond"]
    still = settings["simulate"] | {
        "effects": settings["simulate"]["effects"] | {"relaxation": False, "asymmetry": False}
    }
    for seed in range(FINGERS):
        recording = scene.recording_of(still, "task_1", f"run{seed:03d}", seed)
        header, *lines = scene.logs_of(recording, still, 6)["truth.csv"][0]
        away = []
        for drift in np.loadtxt(lines, delimiter=",")[:, 1:].T:
            trained, tested = drift[:2400], drift[2400:]
            distance = [max(trained.min() - each, each - trained.max(), 0) for each in tested]
            away.append(np.mean(distance) / np.ptp(trained))
        assert found[seed] == pytest.approx(np.mean(away), abs=1e-4)
    assert found.min() < 0.05 < found.max()


def test_rank_correlations_are_those_of_the_runs_that_did_not_fail(settings):
    errors = pd.DataFrame({"beyond": [0.0, 0.1, 0.2, 0.4, 0.8, 0.9], "linear": [1.0, 3, 2, 5, 4, 6], "esn": 1.0})
    errors["poly"] = [*-errors["linear"][:5], np.nan]
    found = strain.rank_correlations(errors)
    assert list(found) == ["linear", "poly"]  # of equal errors there are no ranks
    assert found["linear"].mean == pytest.approx(stats.spearmanr(errors["beyond"], errors["linear"]).statistic)
    assert found["poly"].mean < 0 and (found["linear"].runs, found["poly"].runs) == (6, 5)


def test_the_interval_of_a_rank_correlation_holds_it_in_95_percent():
    rng, held, true = np.random.default_rng(0), 0, 6 / np.pi * np.arcsin(0.7 / 2)  # of normal pairs, Pearson's 0.7
    for _ in range(400):
        pairs = rng.multivariate_normal([0, 0], [[1, 0.7], [0.7, 1]], 24)
        (rank,) = strain.rank_correlations(pd.DataFrame(pairs, columns=["beyond", "linear"])).values()
        held += rank.low <= true <= rank.high
    assert 0.92 <= held / 400 <= 0.98
