"""Two models are compared seed by seed, through every reader of results, in whatever order their rows stand.

Three seeds, in another order for each of the two: paired, `poly` is below `linear` by 1.1 kPa with an interval that is
known; unpaired or in the order of the rows, it is another and includes 0.
"""

import numpy as np
import pandas as pd
import pytest
from scipy import stats

from pipeline.base.paths import Workspace
from pipeline.claims import entries, judge
from pipeline.claims.rules import REPRODUCED
from pipeline.reporting.verdicts import physics, sizes
from pipeline.scoring import glove_results, ladders, one_table, results, variants

LEVELS = {"linear": {0: 9.0, 1: 5.0, 2: 7.0}, "poly": {2: 5.9, 0: 8.0, 1: 3.8}}
ONE, OTHER = (np.array([LEVELS[model][seed] for seed in range(3)]) for model in LEVELS)


def interval(differences: np.ndarray, confidence: float = 0.95) -> tuple[float, float]:
    """The t interval of the mean of paired differences."""
    return tuple(stats.ttest_1samp(differences, 0).confidence_interval(confidence))


def rows(names: dict[str, str], scale: float = 1.0) -> list[tuple[str, int, float]]:
    """(name, seed, value) in the order of LEVELS; names: model -> what it is called."""
    return [(names[model], seed, scale * value) for model, runs in LEVELS.items() for seed, value in runs.items()]


def scores(
    workspace: Workspace, experiment: str, places: dict[str, tuple[str, str]], metric: str, scale: float = 1.0
) -> results.Scores:
    """scores.csv of the two models, through its reader; places: model -> (protocol, condition)."""
    table = [
        (experiment, *places[model], model, seed, metric, "1", value, 10)
        for model, seed, value in rows({model: model for model in LEVELS}, scale)
    ]
    path = workspace.scores(experiment)
    path.parent.mkdir(parents=True, exist_ok=True)
    columns = ["experiment", "protocol", "condition", "model", "seed", "metric", "unit", "value", "n"]
    pd.DataFrame(table, columns=columns).to_csv(path, index=False)
    orders = zip(dict.fromkeys(protocol for protocol, _ in places.values()), ([1, 2, 0], [2, 0, 1]), strict=False)
    return results.Scores(
        workspace, experiment, {"protocols": {protocol: {"seeds": seeds} for protocol, seeds in orders}}
    )


SINGLE = dict.fromkeys(LEVELS, ("press", "single"))


def test_the_case_is_decided_by_pairing():
    assert interval(ONE - OTHER)[0] > 0.5
    in_the_order_of_rows = np.subtract(*(list(runs.values()) for runs in LEVELS.values()))
    assert interval(in_the_order_of_rows)[0] < 0 > np.subtract(*interval(ONE))


def test_claims(workspace):
    scores(workspace, "touch", SINGLE, "rmse")
    (claim,) = [claim for claim in entries.read(workspace)[0] if claim.id == "lomp/nonlinear-single"]
    table = one_table.read(one_table.of_experiment(workspace, "touch"))
    found, _ = judge.judged(claim, one_table.Results(table.assign(budget=one_table.FULL)))
    assert (found.low, found.high) == pytest.approx(interval(ONE - OTHER)) and found.ours == pytest.approx(1.1)
    assert found.verdict == REPRODUCED and found.runs == 3


def test_gains_of_the_glove(workspace):
    """In points, of fractions, of two protocols whose seeds params.yaml lists in two orders."""
    places = {"linear": ("session_strain", "strain"), "poly": ("session_pressure", "pressure")}
    both = scores(workspace, "glove", places, "macro_precision", 0.01)
    found = glove_results.gain(both, ("session_strain", "linear"), ("session_pressure", "poly"))
    assert found[:3] == pytest.approx((1.1, *interval(ONE - OTHER)))


def test_effects_of_a_scene():
    """Of the logarithms of the ratio, with the 90 % interval of two one-sided tests."""
    table = pd.DataFrame(rows({"linear": physics.NONE, "poly": "creep"}), columns=["effect", "seed", "value"])
    table = table.assign(experiment="touch", condition="single", model="cnn", metric="rmse", unit="kPa")
    (judged,) = physics.assess(table[list(variants.COLUMNS)])
    low, high = np.expm1(interval(np.log(OTHER / ONE), 0.9))
    assert (judged.changes[0].low, judged.changes[0].high) == pytest.approx((low, high), rel=1e-4)


def test_sizes():
    """The excess of a size over the best one."""
    table = pd.DataFrame(rows({"linear": 8.0, "poly": 16.0}), columns=["size", "seed", "value"])
    table = table.assign(experiment="touch", condition="single", family="lomp", metric="rmse", unit="kPa")
    judged = sizes.judge(table.assign(params=1, macs=1)[list(ladders.COLUMNS)]).set_index("size").loc[8.0]
    assert (judged["excess_low"], judged["excess_high"]) == pytest.approx(interval(ONE / OTHER - 1))
