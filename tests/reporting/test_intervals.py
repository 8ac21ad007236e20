"""Intervals in the committed reports: inside the bounds of what they are of, and none without width over runs."""

import numpy as np
import pandas as pd
import pytest
from builders.project import ROOT

from pipeline.scoring import results

EFFECTS = "physics.csv"  # of exact changes: an effect that a model cannot see changes nothing
TABLES = [
    path.relative_to(ROOT / "reports").as_posix()
    for path in sorted((ROOT / "reports").rglob("*.csv"))
    if {"low", "high"} <= set(pd.read_csv(path, nrows=0)) and path.name != EFFECTS
]
BOUNDS = {
    results.SHARE: (0.0, 1.0),
    results.LOG: (0.0, np.inf),
    results.R2: (-np.inf, 1.0),
    results.PLAIN: (-np.inf, np.inf),
}


def test_tables_with_intervals_are_there():
    assert {"claims.csv", "rightsize.csv", "touch/accuracy/table1.csv", "glove/accuracy/table1.csv"} <= set(TABLES)


@pytest.mark.parametrize("name", TABLES)
def test_an_interval_has_width_and_stays_inside_its_bounds(name):
    table = pd.read_csv(ROOT / "reports" / name).dropna(subset=["low", "high"])
    assert (table["low"] < table["high"]).all(), table[table["low"] >= table["high"]].to_string()
    if "metric" in table:
        low, high = np.array([BOUNDS[results.scale_of(metric)] for metric in table["metric"]]).reshape(-1, 2).T
        outside = table[(table["low"] < low) | (table["high"] > high)]
        assert outside.empty, outside.to_string()


def test_shares_that_are_judged_stay_between_0_and_100_percent():
    claims = pd.read_csv(ROOT / "reports" / "claims.csv")
    printed = claims[(claims["kind"] == "number") & (claims["unit"] == "%")].dropna(subset=["low"])
    assert ((printed["low"] >= 0) & (printed["high"] <= 100)).all(), printed[["id", "low", "high"]].to_string()


def test_explained_shares_that_are_judged_are_at_most_1():
    claims = pd.read_csv(ROOT / "reports" / "claims.csv")
    explained = claims[claims["claim"].str.contains("(R2 below", regex=False)]
    assert len(explained) and not (explained["high"] > 1).any()
