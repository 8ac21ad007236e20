"""Rows by unit say of presses and grasps what the scores say of all of them."""

from typing import NamedTuple

import numpy as np
import pandas as pd
import pyarrow as pa
import pytest
from builders.project import ROOT

from pipeline import experiments
from pipeline.base.facts import Facts
from pipeline.base.paths import Workspace
from pipeline.datasets import schemas
from pipeline.scoring import metrics, shards, units

SETS = {name: each for name, each in shards.read_sets(Workspace(ROOT)).items() if each.by_unit}
PLACE = ["protocol", "condition", "model", "seed"]


@pytest.mark.parametrize("name", SETS)
def test_the_units_of_a_committed_shard_have_its_scores(name):
    found = sorted((ROOT / "evidence" / "results").glob(f"{name}-[0-9]*.csv"))
    assert found, "the recorded sets have shards"
    facts = experiments.facts(SETS[name].experiment)
    for path in found:
        rows = pd.read_csv(path, dtype={"condition": str})
        of_unit = rows[rows["metric"].str.endswith(units.SUFFIX)]
        assert set(of_unit["protocol"]) == set(SETS[name].by_unit)
        kept = set(of_unit["metric"].str.removesuffix(units.SUFFIX))
        assert kept == {facts.metric} | ({"touches_found", "sum_ratio", "away_rmse"} if facts.subject else set())
        for metric in kept:
            mean, score = of_all(of_unit, metric), rows[rows["metric"] == metric].set_index(PLACE)["value"]
            assert np.isfinite(score[mean.index]).all() and len(mean) > 0, path.name
            if metric != "error":  # samples of strain between presses are in the score alone
                assert mean.to_numpy() == pytest.approx(score[mean.index].to_numpy(), rel=1e-4), (path.name, metric)


def of_all(rows: pd.DataFrame, metric: str) -> pd.Series:
    """Place -> the score that its rows by unit give together."""
    rows = rows[rows["metric"] == metric + units.SUFFIX]
    parts = rows.assign(weighted=rows["value"] * rows["n"]).groupby(PLACE)[["weighted", "n"]].sum()
    mean = parts["weighted"] / parts["n"]
    return np.sqrt(mean) if metric.endswith("rmse") else mean


class Made(NamedTuple):
    """An experiment's module, as far as rows by unit ask it."""

    FACTS: Facts
    SCORES: str


@pytest.mark.parametrize("lost", [0, 7])
def test_units_of_persons_have_the_scores_of_maps_of_contact(monkeypatch, lost):
    """Frames of persons and conditions of unlike number, a quarter of the map never near contact; some lost."""
    rng, n = np.random.default_rng(0), 120
    settings = {"sensor": {"rows": 4, "cols": 4, "pitch_mm": 9.6}, "label": {"map_rows": 8, "map_cols": 8}}
    settings |= {"models": ["m"], "protocols": {"fold_0": {"seeds": [0]}, "fold_1": {"seeds": []}}}
    truth = np.zeros((n, 8, 8), np.float32)
    truth[:, 4:, 4:] = 100 * rng.integers(0, 2, (n, 4, 4))
    truth = truth.reshape(n, -1)
    predicted = np.where(rng.random(truth.shape) < 0.8, truth, 60) + rng.normal(0, 5, truth.shape).astype(np.float32)
    predicted[:lost] = np.nan
    condition, person = (
        rng.choice(["one", "two"], n, p=[0.7, 0.3]),
        rng.choice(["P1", "P2", "P3"], n, p=[0.7, 0.2, 0.1]),
    )
    names = {"condition": condition, "recording": person, "person": person}
    table = {name: pa.array(value).dictionary_encode() for name, value in names.items()}
    table = pa.table(table | {"press": np.arange(n), "y": schemas.lists(truth, pa.float32())})
    module = Made(experiments.facts("array_recorded"), "contact")
    monkeypatch.setattr(experiments, "module", lambda name: module)
    monkeypatch.setattr(units, "read_windows", lambda *_: table)
    monkeypatch.setattr(units, "read_predictions", lambda *_: predicted)
    rows = pd.DataFrame(units.rows(None, "x", settings, ["fold_0", "fold_1"]))
    further = rows[rows["metric"] != "rmse_of_unit"]
    assert set(further["variant"]) == {"unit_P1_0", "unit_P2_0", "unit_P3_0"} and len(further) == 3 * 3 * 2
    for name in ("one", "two"):
        chosen = (condition == name) & np.isfinite(predicted).all(axis=1)
        for metric, _, value, _ in metrics.contact(truth[chosen], predicted[chosen], settings):
            if metric != "r2":
                assert of_all(rows, metric)["fold_0", name, "m", 0] == pytest.approx(value, rel=1e-4), metric


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
    fewer = model[model["variant"] != "unit_P3_5"]  # one of a person who is drawn, or not, in the same draws
    alike = fewer.assign(value=fewer["variant"].str[6].astype(int))
    assert (units.drawn(alike, "error") - units.drawn(model.assign(value=alike["value"]), "error")).abs().max() < 0.4
    shuffled = pd.concat([model.iloc[12:], model.iloc[:12]])
    assert (units.drawn(shuffled, "error") == units.drawn(model, "error")).all()
