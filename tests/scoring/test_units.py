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


def of_persons(blocks: dict[str, list[float]]) -> pd.DataFrame:
    """Rows by unit of one model, of one seed: person -> the value of each of its blocks."""
    rows = [(f"unit_{person}_{k}", value, 5) for person, values in blocks.items() for k, value in enumerate(values)]
    return pd.DataFrame(rows, columns=["variant", "value", "n"])


def test_units_of_persons_are_named_and_stay_within_a_person():
    """Frames of two persons in turn, more of one than there are blocks."""
    unit, person = np.arange(60), np.array(["P02", "P01"] * 25 + ["P02"] * 10)
    names = np.asarray(units._named(unit, person))
    assert {name.rpartition("_")[0] for name in names} == {"unit_P01", "unit_P02"}
    for one, most in (("P01", 9), ("P02", 9)):
        own = names[person == one]
        numbers = [int(name.rpartition("_")[2]) for name in own]
        assert numbers == sorted(numbers) and set(numbers) == set(range(most)) and own[0] == f"unit_{one}_0"
    assert np.asarray(units._named(np.array([7, 7, 9]), None)).tolist() == ["unit_0", "unit_0", "unit_1"]


def test_persons_are_drawn_before_what_is_theirs():
    """Where persons differ and their blocks do not, the draws are means over persons, drawn as often as there are."""
    alike = of_persons({f"P{k}": [float(k)] * 8 for k in range(5)})
    drawn = units.drawn(alike, "error")
    assert set(np.round(5 * drawn, 9)) <= set(range(21)) and drawn.mean() == pytest.approx(2, abs=0.1)
    assert drawn.std() == pytest.approx(np.sqrt(2 / 5), rel=0.1)
    one = units.drawn(of_persons({"P0": [float(k % 5) for k in range(40)]}), "error")
    assert one.std() == pytest.approx(np.sqrt(2 / 40), rel=0.1)


def test_the_same_persons_are_drawn_for_every_model_and_protocols_stand_together():
    values = np.random.default_rng(0).uniform(1, 9, (4, 6))
    model = of_persons({f"P{k}": list(row) for k, row in enumerate(values)})
    other = model.assign(value=model["value"] + 3)
    assert (units.drawn(other, "error") - units.drawn(model, "error")).to_numpy() == pytest.approx(3)
    shuffled = pd.concat([model.iloc[12:], model.iloc[:12]])
    assert (units.drawn(shuffled, "error") == units.drawn(model, "error")).all()
