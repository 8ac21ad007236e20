"""Rows by unit say of presses and grasps what the scores say of all of them."""

import numpy as np
import pandas as pd
import pytest
from builders.project import ROOT

from pipeline import experiments
from pipeline.base.paths import Workspace
from pipeline.scoring import shards, units

SETS = {name: each for name, each in shards.read_sets(Workspace(ROOT)).items() if each.by_unit}
PLACE = ["protocol", "condition", "model", "seed"]


@pytest.mark.parametrize("name", SETS)
def test_the_units_of_a_committed_shard_have_its_scores(name):
    found = sorted((ROOT / "evidence" / "results").glob(f"{name}-[0-9]*.csv"))
    assert found, "the recorded sets have shards"
    for path in found:
        rows = pd.read_csv(path, dtype={"condition": str})
        metric = experiments.facts(SETS[name].experiment).metric
        of_unit = rows[rows["metric"] == metric + units.SUFFIX]
        assert set(of_unit["protocol"]) == set(SETS[name].by_unit)
        parts = of_unit.assign(weighted=of_unit["value"] * of_unit["n"]).groupby(PLACE)[["weighted", "n"]].sum()
        mean = parts["weighted"] / parts["n"]
        mean = np.sqrt(mean) if metric == "rmse" else mean
        score = rows[rows["metric"] == metric].set_index(PLACE)["value"]
        assert np.isfinite(score[mean.index]).all() and len(mean) > 0, path.name
        if metric != "error":  # samples of strain between presses are in the score alone
            assert mean.to_numpy() == pytest.approx(score[mean.index].to_numpy(), rel=1e-4), path.name
