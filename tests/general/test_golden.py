"""What stands in reports/ follows from what else stands there: derived files are computed anew, without training."""

import json

import numpy as np
import pandas as pd
import pytest
from builders.project import ROOT
from builders.prose import faults

from pipeline.base import params
from pipeline.base.paths import Workspace
from pipeline.claims import entries, judge
from pipeline.reporting import speed
from pipeline.reporting.verdicts import stability
from pipeline.reporting.words.labels import FRONTS, SPREAD
from pipeline.scoring import one_table, results
from pipeline.stages import metrics

REPOSITORY = Workspace(ROOT)
VALUES, REPORTS = params.load(REPOSITORY.params), REPOSITORY.reports
CLAIMS, _ = entries.read(REPOSITORY)
NUMBERS = ["published", "ours", "low", "high", "power", "seeds"]
WORDS = ["verdict", "reason", "budget", "over", "unit"]


def relative(path) -> str:
    return path.relative_to(REPORTS).as_posix()


def same(found, committed) -> bool:
    return np.allclose(np.asarray(found, float), np.asarray(committed, float), rtol=1e-9, atol=1e-12, equal_nan=True)


def read(path) -> pd.DataFrame:
    """A table whose words are "" where they are missing."""
    table = pd.read_csv(path)
    return table.fillna(dict.fromkeys(table.select_dtypes(exclude="number"), ""))


def test_claims_follow_from_the_results(kept):
    found, committed = judge.table(CLAIMS, kept).set_index("id"), read(REPORTS / "claims.csv").set_index("id")
    assert list(found.index) == list(committed.index) and len(found) > 150
    for claim, row in found.iterrows():
        assert list(row[WORDS]) == list(committed.loc[claim, WORDS]), claim
        assert same(row[NUMBERS], committed.loc[claim, NUMBERS]), claim


@pytest.mark.parametrize("experiment", VALUES["experiments"])
def test_metrics_follow_from_the_speed_table(experiment):
    table, folder = REPORTS / experiment / "speed" / "table2.csv", REPORTS / "metrics" / experiment
    found = metrics.of_experiment(pd.read_csv(table)) if table.exists() else {}
    assert found == {path.relative_to(folder): json.loads(path.read_text()) for path in folder.rglob("*.json")}


TABLES = [path for path in sorted(REPORTS.glob("*/accuracy/table*.csv")) if "model" in pd.read_csv(path, nrows=0)]
SPEEDS = sorted(REPORTS.glob("*/speed/table2.csv"))


@pytest.fixture(scope="module")
def kept() -> one_table.Results:
    """The evidence, and what is in reports/ of all else."""
    return one_table.results(REPOSITORY, one_table.of_own_logs(VALUES))


@pytest.mark.parametrize("path", TABLES, ids=relative)
def test_a_table_of_accuracy_has_means_and_intervals_of_the_results(path, kept):
    columns, experiment = ["mean", "low", "high", "runs", "failed"], path.relative_to(REPORTS).parts[0]
    for row in read(path).itertuples():
        found = kept.estimate(experiment, row.protocol, row.condition, row.model, row.metric)
        assert same(found, [getattr(row, column) for column in columns]), row


@pytest.mark.parametrize("path", SPEEDS, ids=relative)
def test_a_speed_table_has_the_measured_times_and_the_models_on_the_front(path):
    table, experiment = read(path), path.relative_to(REPORTS).parts[0]
    latency = pd.read_csv(REPORTS / "latency.csv").set_index(["experiment", "model", "batch"])
    for row in table.itertuples():
        one, many = (latency.loc[(experiment, row.model, batch)] for batch in (row.batch, row.large_batch))
        times = [one["p50_ms"], one["p95_ms"], 1e3 * row.large_batch / many["p50_ms"], one["size_bytes"]]
        assert same([row.p50_ms, row.p95_ms, row.predictions_per_s, row.size_bytes], times), row
    for _, panel in table.groupby("panel"):
        for time, column in FRONTS.items():
            error = panel["error"].where(panel["failed"] == 0)
            assert list(speed.pareto(panel[SPREAD[time]], error)) == list(panel[column] == 1), (column, panel)


@pytest.mark.parametrize("experiment", list(stability.ERRORS))
def test_failures_follow_from_the_stress_tests(experiment):
    stress = pd.read_csv(REPORTS / "stress.csv", dtype={"condition": str})
    stress = stress[(stress["experiment"] == experiment) & (stress["metric"] == stability.ERRORS[experiment][0])]
    error = 1 - stress["value"] if stability.ERRORS[experiment][0] == "accuracy" else stress["value"]
    found = stability.failures(stress.assign(error=error), experiment, VALUES["stress"][experiment]["usable"])
    committed = read(REPORTS / "stability" / "failures.csv")
    committed = committed[committed["experiment"] == experiment]
    key = ["protocol", "condition", "perturbation", "model"]
    together = found.merge(committed, on=key, suffixes=("", "_committed"), how="outer", indicator=True)
    assert (together["_merge"] == "both").all() and len(together)
    assert list(together["verdict"]) == list(together["verdict_committed"])
    for column in ("fails_at", "clean", "error", "last_error", "relative"):
        assert same(together[column], together[f"{column}_committed"]), column


INTERVALS = [path for path in sorted(REPORTS.rglob("*.csv")) if {"low", "high"} <= set(pd.read_csv(path, nrows=0))]
BOUNDS = {
    results.SHARE: (0.0, 1.0),
    results.LOG: (0.0, np.inf),
    results.R2: (-np.inf, 1.0),
    results.PLAIN: (-np.inf, np.inf),
}
WITH_INTERVALS = {"claims.csv", "rightsize.csv", "touch/accuracy/table1.csv", "glove/accuracy/table1.csv"}
EXACT = "physics.csv"  # of exact changes: an effect that a model cannot see changes nothing


def test_tables_with_intervals_are_there():
    assert {relative(path) for path in INTERVALS} >= WITH_INTERVALS


@pytest.mark.parametrize("path", [path for path in INTERVALS if path.name != EXACT], ids=relative)
def test_an_interval_has_width_and_stays_inside_its_bounds(path):
    table = pd.read_csv(path).dropna(subset=["low", "high"])
    assert (table["low"] < table["high"]).all(), table[table["low"] >= table["high"]].to_string()
    scale = table["metric"].map(results.scale_of) if "metric" in table else pd.Series(results.PLAIN, table.index)
    bounds = np.array([BOUNDS[each] for each in scale]).reshape(-1, 2)
    if "claim" in table:  # numbers that are judged say their unit alone
        percent = (table["kind"] == "number") & (table["unit"] == "%")
        explained = table["claim"].str.contains("(R2 below", regex=False)
        assert percent.any() and explained.any()
        bounds[percent], bounds[explained, 1] = (0, 100), 1
    outside = table[(table["low"] < bounds[:, 0]) | (table["high"] > bounds[:, 1])]
    assert outside.empty, outside.to_string()


@pytest.mark.parametrize("path", sorted([*REPORTS.rglob("*.md"), *REPORTS.glob("*.html")]), ids=relative)
def test_no_text_has_a_placeholder_or_broken_grammar(path):
    found = list(faults(path.read_text(encoding="utf-8")))
    assert not found, found


@pytest.mark.parametrize(
    ("text", "wrong"),
    [
        ("The difference spreads by - points.", True),
        ("about not counted seeds would be needed", True),
        ("split by session, 1 seeds", True),
        ("all 2 models stay usable", True),
        ("has the smallest images classified incorrectly", True),
        ("an interval of [nan, nan] kPa", True),
        ("| LoMP | not counted | - | 21 seeds, 1.1 points, failed (1 of 1 runs) | `nan` | banana |", False),
        ("<td>not counted</td><td>-</td>", False),
    ],
)
def test_what_a_placeholder_is(text, wrong):
    assert bool(faults(text)) == wrong
