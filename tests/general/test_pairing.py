"""Two models are compared seed by seed, through every reader of results, in whatever order their rows stand.

Three seeds, in another order for each of the two: paired, `poly` is below `linear` by 1.1 kPa with a known interval;
unpaired or in the order of the rows, it is another one that includes 0, in the order of the values a narrower one.
"""

from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from scipy import stats

from pipeline.claims import entries, judge, physics, sizes
from pipeline.claims.rules import REPRODUCED
from pipeline.reporting import glove
from pipeline.reporting.page import answers
from pipeline.reporting.report import Report
from pipeline.results import claim_inputs, one_table, shards, studies
from tactile.base.paths import Workspace

LEVELS = {"linear": {0: 9.0, 1: 5.0, 2: 5.1}, "poly": {2: 3.85, 0: 8.0, 1: 3.95}}
ONE, OTHER = (np.array([LEVELS[model][seed] for seed in range(3)]) for model in LEVELS)


def interval(differences: np.ndarray, confidence: float = 0.95) -> tuple[float, float]:
    """The t interval of the mean of paired differences."""
    return tuple(stats.ttest_1samp(differences, 0).confidence_interval(confidence))


def rows(names: dict[str, str], scale: float = 1.0) -> list[tuple[str, int, float]]:
    """(name, seed, value) in the order of LEVELS; names: model -> what it is called."""
    return [(names[model], seed, scale * value) for model, runs in LEVELS.items() for seed, value in runs.items()]


def scores(
    workspace: Workspace, experiment: str, places: dict[str, tuple[str, str]], metric: str, scale: float = 1.0
) -> None:
    """Write scores.csv of the two models; places: model -> (protocol, condition)."""
    table = [
        (experiment, *places[model], model, seed, metric, "1", value, 10)
        for model, seed, value in rows({model: model for model in LEVELS}, scale)
    ]
    path = workspace.scores(experiment)
    path.parent.mkdir(parents=True, exist_ok=True)
    columns = ["experiment", "protocol", "condition", "model", "seed", "metric", "unit", "value", "n"]
    pd.DataFrame(table, columns=columns).to_csv(path, index=False)


SINGLE = dict.fromkeys(LEVELS, ("press", "single"))


def study(workspace: Workspace, experiment: str, name: str, table: pd.DataFrame, columns) -> None:
    """A table of a study where its reader looks for it, all seeds in one file, whose order is that of `table`."""
    path = shards.study_file(workspace, experiment, name, 0)
    path.parent.mkdir(parents=True)
    table.assign(experiment=experiment)[list(columns)].to_csv(path, index=False)


def of_files(workspace: Workspace, experiment: str) -> one_table.Results:
    """The one table of results of what lies in the files of an experiment, as of the evidence."""
    table = one_table.read(one_table.of_experiment(workspace, experiment))
    return one_table.Results(table.assign(budget=one_table.FULL))


def test_the_case_is_decided_by_pairing():
    assert interval(ONE - OTHER)[0] > 0.5 and np.mean(ONE - OTHER) == pytest.approx(1.1)
    in_the_order_of_rows = np.subtract(*(list(runs.values()) for runs in LEVELS.values()))
    assert interval(in_the_order_of_rows)[0] < 0 > np.subtract(*interval(ONE))
    in_the_order_of_values = np.sort(ONE) - np.sort(OTHER)
    assert np.ptp(interval(in_the_order_of_values)) < 0.8 * np.ptp(interval(ONE - OTHER))


def test_claims(workspace):
    scores(workspace, "touch", SINGLE, "rmse")
    (claim,) = [claim for claim in entries.read(workspace)[0] if claim.id == "lomp/nonlinear-single"]
    found, _ = judge.judged(claim, of_files(workspace, "touch"))
    assert (found.low, found.high) == pytest.approx(interval(ONE - OTHER)) and found.ours == pytest.approx(1.1)
    assert found.verdict == REPRODUCED and found.runs == 3


def test_ratios_and_findings_of_a_report(workspace):
    """The interval of a ratio is that of its logarithm."""
    scores(workspace, "touch", SINGLE, "rmse")
    table = of_files(workspace, "touch")
    places = [("press", "single", model, "rmse") for model in LEVELS]
    ratio = Report.ratio(SimpleNamespace(experiment="touch", results=table), *places)
    assert (ratio.low, ratio.high) == pytest.approx(tuple(np.exp(interval(np.log(ONE / OTHER)))))
    assert ratio.mean == pytest.approx(np.exp(np.log(ONE / OTHER).mean())) and ratio.runs == 3
    found = answers._Scores(table, SimpleNamespace(simulated="touch", sources={}), {})
    assert found.side("press", "single", *LEVELS) == 1 and found.side("press", "single", *reversed(LEVELS)) == -1


def test_gains_by_augmentation():
    """Of fractions; the model without any method is what each method is compared with."""
    named = rows({"linear": "augmentation_A", "poly": "augmentation_none"}, 0.01)
    table = pd.DataFrame(named, columns=["variant", "seed", "value"])
    table = table.assign(experiment="glove", protocol="session_strain", condition="strain", model="sp_resnet")
    table = table.assign(metric="macro_precision", unit="1", n=1, budget=one_table.FULL)[claim_inputs.COLUMNS]
    found = glove.augmentation_table(SimpleNamespace(results=one_table.Results(table)))
    (row,) = found[
        (found["method"] == "A") & (found["condition"] == "strain") & (found["metric"] == "macro_precision")
    ].itertuples()
    assert (row.gain, row.gain_low, row.gain_high) == pytest.approx((0.011, *np.divide(interval(ONE - OTHER), 100)))


def test_effects_of_a_scene(workspace):
    """Of the logarithms of the ratio, with the 90 % interval of two one-sided tests."""
    table = pd.DataFrame(rows({"linear": physics.NONE, "poly": "creep"}), columns=["effect", "seed", "value"])
    table = table.assign(condition="single", model="cnn", metric="rmse", unit="kPa")
    study(workspace, "touch", "physics", table, studies.PHYSICS)
    (judged,) = physics.assess(physics.read(workspace, "touch", [physics.NONE, "creep"], ["cnn"]))
    low, high = np.expm1(interval(np.log(OTHER / ONE), 0.9))
    assert (judged.changes[0].low, judged.changes[0].high) == pytest.approx((low, high), rel=1e-4)


def test_sizes():
    """The excess of a size over the best one."""
    table = pd.DataFrame(rows({"linear": 8.0, "poly": 16.0}), columns=["size", "seed", "value"])
    table = table.assign(variant=table["size"].map("hidden_{:g}".format), experiment="touch", protocol="press")
    costs = [table.assign(condition="any", metric=cost, value=1) for cost in ("params", "macs")]
    table = pd.concat([table.assign(condition="single", metric="rmse"), *costs]).assign(
        model="lomp", unit="", budget="", n=10
    )
    judged = sizes.judge(studies.ladders(one_table.Results(table).table, "touch")).set_index("size").loc[8.0]
    assert (judged["excess_low"], judged["excess_high"]) == pytest.approx(interval(ONE / OTHER - 1))
