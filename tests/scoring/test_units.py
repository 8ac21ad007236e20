"""Rows by unit say of presses and grasps what the scores say of all of them."""

import re
from typing import NamedTuple

import numpy as np
import pandas as pd
import pyarrow as pa
import pytest
from builders.project import ROOT

from pipeline.results import shards
from tactile import experiments
from tactile.base.facts import Facts
from tactile.base.paths import Workspace
from tactile.datasets import schemas
from tactile.scoring import metrics, units

COMPUTED = set(pd.read_csv(ROOT / "evidence" / "index.csv")["shard"].str.rsplit("-", n=2).str[0])
SETS = {name: each for name, each in shards.read_sets(Workspace(ROOT)).items() if each.by_unit and not each.study}
PLACE = ["protocol", "condition", "model", "seed"]


def test_every_recorded_experiment_has_shards():
    assert {each.experiment for each in SETS.values()} <= COMPUTED


@pytest.mark.parametrize("name", [name for name in SETS if name in COMPUTED])
def test_the_units_of_a_committed_shard_have_its_scores(name):
    found = sorted((ROOT / "evidence" / "results").glob(f"{name}-[0-9]*.csv"))
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


@pytest.mark.parametrize(("experiment", "apart"), [("glove_recorded", True), ("strain_recorded", False)])
def test_folds_have_units_of_their_own_and_starts_share_theirs(monkeypatch, experiment, apart):
    """Each half of the grasps is tested by one seed: drawn together they are all grasps, not the mean of two each."""
    rng, n, metric = np.random.default_rng(0), 240, experiments.facts(experiment).metric
    names = [np.repeat(["a", "b"], n // 2), np.arange(n).astype(str)]
    table = {"condition": names[0], "recording": names[1]}
    table = pa.table(
        {name: pa.array(value).dictionary_encode() for name, value in table.items()} | {"press": np.arange(n)}
    )
    truth = rng.integers(0, 2, n)
    table = table.append_column("label", pa.array(truth))
    table = table.append_column("y", schemas.lists(truth[:, None].astype(float), pa.float32()))
    tested = [np.arange(n) % 2 == 0, np.arange(n) % 2 == (1 if apart else 0)]

    def predicted(_workspace, _experiment, _model, _protocol, seed, _table):
        right = np.eye(2)[truth] if metric == "accuracy" else truth[:, None] + 1.0
        wrong = np.eye(2)[1 - truth] if metric == "accuracy" else truth[:, None] + 9.0
        return np.where(tested[seed][:, None], right if seed == 0 else wrong, np.nan)

    monkeypatch.setattr(units, "read_windows", lambda *_: table)
    monkeypatch.setattr(units, "read_predictions", predicted)
    settings = {"models": ["m"], "protocols": {"grasp_combined": {"seeds": [0, 1]}}}
    rows = pd.DataFrame(units.rows(Workspace(ROOT), experiment, settings, ["grasp_combined"]))
    rows = rows[rows["condition"] == rows["condition"].iloc[0]]
    first, second = (set(rows["variant"][rows["seed"] == seed]) for seed in (0, 1))
    assert first and (first.isdisjoint(second) if apart else first == second)
    spread = units.drawn(rows, metric).std()
    assert (spread > 0.02) if apart else (spread == 0), "every start errs alike on every unit, each fold on its own"


def test_units_of_persons_are_named_and_stay_within_a_person():
    """Frames of two persons in turn, more of one than there are blocks."""
    unit, person = np.arange(60), np.array(["P02", "P01"] * 25 + ["P02"] * 10)
    names = np.asarray(units._named(*units._blocks(unit, person, units.MOST_OF_SUBJECT)))
    assert {name.rpartition("_")[0] for name in names} == {"unit_P01", "unit_P02"}
    for one, most in (("P01", 9), ("P02", 9)):
        own = names[person == one]
        numbers = [int(name.rpartition("_")[2]) for name in own]
        assert numbers == sorted(numbers) and set(numbers) == set(range(most)) and own[0] == f"unit_{one}_0"
    block = units._blocks(np.array([7, 7, 9]), None, units.MOST_UNITS)
    assert np.asarray(units._named(*block)).tolist() == ["unit_0", "unit_0", "unit_1"]


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


def of_rows(unit, subject=None) -> units.Units:
    """Units of rows that are every second one of a dataset."""
    return units.Units(2 * np.arange(len(unit)), np.asarray(unit), None if subject is None else np.asarray(subject))


@pytest.mark.parametrize(("presses", "blocks"), [(3, 3), (10, 10), (11, 6), (37, 10)])
def test_blocks_of_a_score_are_whole_presses_and_average_to_it(presses, blocks):
    """Presses of different lengths, of which a score counts some of the samples."""
    rng = np.random.default_rng(presses)
    unit = np.repeat(np.arange(presses) + 40, rng.integers(2, 9, presses))
    chosen = np.flatnonzero(rng.random(len(unit)) < 0.8)
    loss = rng.uniform(0.001, 20, len(chosen))
    text = of_rows(unit).written(2 * chosen, loss)
    mean, count = np.array([pair.split(":") for pair in text.split()], float).T
    assert len(mean) <= blocks and count.sum() == len(chosen)
    assert (mean * count).sum() / count.sum() == pytest.approx(loss.mean(), rel=5e-4)
    edges = np.cumsum(count)[:-1].astype(int)
    assert (unit[chosen][edges - 1] != unit[chosen][edges]).all(), "no press is in two blocks"


def test_blocks_are_of_one_person_each_and_persons_stand_apart():
    person = np.array(["P02", "P01"] * 50)
    loss = np.where(person == "P01", 1.0, 5.0)
    text = of_rows(np.arange(100), person).written(2 * np.arange(100), loss)
    assert text == " ".join(["1:10"] * 5) + " / " + " ".join(["5:10"] * 5)
    many = np.array([f"P{k:02}" for k in range(12)])
    assert of_rows(np.arange(12), many).written(2 * np.arange(12), np.ones(12)) == " / ".join(["1:1"] * 12)


def test_what_is_between_presses_is_of_the_press_before():
    table = pa.table({"condition": ["a"] * 6, "recording": ["r"] * 6, "press": [-1, 3, -1, 3, 8, -1]})
    found = units.Units.of(np.arange(6), table, experiments.facts("strain_recorded"))
    assert len(set(found.unit[1:4])) == 1 and len(set(found.unit)) == 3 and found.unit[4] == found.unit[5]


def written(loss, count) -> str:
    return " ".join(f"{one:.4g}:{n}" for one, n in zip(loss, count, strict=True))


@pytest.mark.parametrize("metric", ["rmse", "error", "accuracy"])
def test_blocks_drawn_anew_spread_as_the_mean_of_so_many_does(metric):
    """Draws of 10 blocks: the standard error of their mean, less the share of one of ten; of rmse half of it."""
    loss = np.linspace(0.5, 1.5, 10) if metric == "rmse" else np.linspace(0, 1, 10)
    drawn, sizes = units.of_written(written(loss, [7] * 10), metric)
    assert sizes == (10,) and len(drawn) == units.DRAWS
    expected = loss.std() / np.sqrt(10) / (2 if metric == "rmse" else 1)
    assert drawn.std() == pytest.approx(expected, rel=0.08)
    assert drawn.mean() == pytest.approx(1.0 if metric == "rmse" else 0.5, abs=0.02)


def test_larger_blocks_count_for_more():
    drawn, _ = units.of_written("1:1000 9:1 9:1 9:1", "error")
    assert np.median(drawn) < 1.1, "three of four draws have the large one"


def test_persons_are_drawn_where_there_are_three_and_else_what_is_theirs():
    three, sizes = units.of_written("1:5 1:5 / 4:5 4:5 / 7:5 7:5", "error")
    assert sizes == (2, 2, 2) and set(np.round(three)) == {1, 2, 3, 4, 5, 6, 7}
    two, sizes = units.of_written("1:5 1:5 / 4:5 4:5", "error")
    assert sizes == (2, 2) and set(two) == {2.5}, "two persons tell nothing of others"
    within = units.of_written("0:5 2:5 / 4:5 6:5", "error")[0]
    assert set(within) == {2.0, 2.5, 3.0, 3.5, 4.0}


def test_the_same_blocks_are_drawn_for_every_score():
    loss, count = np.array([1.0, 4, 2, 8, 5]), [3, 4, 5, 6, 7]
    one, other = (units.of_written(written(each, count), "error")[0] for each in (loss, 3 * loss + 1))
    assert other == pytest.approx(3 * one + 1)


@pytest.mark.parametrize("text", ["1:5", "0.01234:12 3.1e-05:7", "1:5 2:6 / 1e+04:9", ""])
def test_what_is_written_has_the_form(text):
    assert re.fullmatch(units.WRITTEN, text)


@pytest.mark.parametrize(
    "text", ["1", "1:0", "1:", "-1:4", "1.2.3:4", "nan:4", "1:5 /", "1:5  2:5", "1e999:3", "/ 1:5"]
)
def test_what_is_not_written_so_has_another_form(text):
    assert not re.fullmatch(units.WRITTEN, text)
