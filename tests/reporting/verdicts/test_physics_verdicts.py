"""Judging effects of a scene: verdicts follow the scores, and every run of params.yaml is asked for."""

import csv
from itertools import product

import numpy as np
import pandas as pd
import pytest

from pipeline.base import params, paths
from pipeline.base.errors import InputError
from pipeline.reporting import physics as physics_report
from pipeline.reporting.verdicts import physics as physics_verdicts
from pipeline.reporting.verdicts.physics import CLAIMS, FAILED, NEEDED, NONE, NOT_NEEDED, assess
from pipeline.scoring.variants import COLUMNS, DEFAULT, variants
from pipeline.studies import physics as physics_study

# RMSE in kPa: LoMP is best on double touch, the networks are best on single touch.
SINGLE = {"constant": 11.0, "linear": 9.0, "poly": 6.0, "tree": 7.5, "rbf": 5.5, "cnn": 4.0, "rnn": 4.8, "lomp": 3.5}
DOUBLE = {
    "constant": 16.0,
    "linear": 12.0,
    "poly": 50.0,
    "tree": 13.0,
    "rbf": 10.0,
    "cnn": 9.0,
    "rnn": 14.0,
    "lomp": 7.0,
}
SEEDS = (0, 1, 2)
STEP = 0.02  # a seed differs from the one before by this share of the error
FLOOR = 4.3027 * STEP  # t of three seeds; two are compared with two: sqrt(2 / 2)


def touch_scores(changes=None, effect="creep", seeds=(0, 1)) -> pd.DataFrame:
    """physics.csv of one effect that changes errors by the factors `changes`: (model, condition) -> factor."""
    rows = []
    for name, own in ((NONE, SEEDS), (effect, seeds)):
        for seed in own:
            for condition, values in (("single", SINGLE), ("double", DOUBLE)):
                for model, value in values.items():
                    factor = (changes or {}).get((model, condition), 1.0) if name != NONE else 1.0
                    value = value * (1 + STEP * (seed - 1)) * factor
                    rows.append(("touch", name, condition, model, seed, "rmse", "kPa", value))
    return pd.DataFrame(rows, columns=COLUMNS)


def judged(changes=None):
    (one,) = assess("touch", touch_scores(changes)).effects
    return one


def test_an_effect_that_changes_nothing_is_not_needed():
    one = judged()
    assert one.verdict == NOT_NEEDED and one.flipped == []
    assert one.tau == pytest.approx({"single": 1.0, "double": 1.0})
    assert all(change.floors == 0 for change in one.changes)


def test_a_change_counts_beyond_the_floor():
    assert judged({("tree", "single"): 1 + 0.9 * FLOOR}).verdict == NOT_NEEDED
    for factor in (1 + 1.5 * FLOOR, 1 - 1.5 * FLOOR):
        one = judged({("tree", "single"): factor})
        assert one.verdict == NEEDED and one.largest()[:2] == ("single", "tree")
        assert one.largest().relative == pytest.approx(factor - 1)
        assert one.largest("double").floors == 0


def test_the_floor_is_the_spread_between_seeds():
    scores = touch_scores()
    change = next(one for one in assess("touch", scores).effects[0].changes if one[:2] == ("single", "tree"))
    assert change.floor == pytest.approx(FLOOR, rel=1e-3)
    last = (scores.effect == NONE) & (scores.seed == 2) & (scores.model == "tree") & (scores.condition == "single")
    scores.loc[last, "value"] = 9.0
    change = next(one for one in assess("touch", scores).effects[0].changes if one[:2] == ("single", "tree"))
    assert change.floor == pytest.approx(4.3027 * np.std(np.log([7.35, 7.5, 9.0]), ddof=1), rel=1e-4)


@pytest.mark.parametrize(("seeds", "share"), [((0,), 2**0.5), ((0, 1), 1.0), ((0, 1, 2), (2 / 3) ** 0.5)])
def test_the_floor_is_narrower_for_means_of_more_seeds(seeds, share):
    found = assess("touch", touch_scores(seeds=seeds)).effects[0]
    change = next(one for one in found.changes if one[:2] == ("single", "tree"))
    assert change.floor == pytest.approx(FLOOR * share, rel=1e-3)


def test_a_model_whose_seeds_agree_by_luck_gets_the_median_floor():
    scores = touch_scores({("tree", "single"): 1 + 0.9 * FLOOR})
    lucky = (scores.effect == NONE) & (scores.model == "tree") & (scores.condition == "single")
    scores.loc[lucky, "value"] = 7.5
    change = assess("touch", scores).effects[0].largest()
    assert change.model == "tree" and change.floor == pytest.approx(FLOOR, rel=1e-3) and not change.counts


def test_a_change_in_one_seed_alone_does_not_count():
    scores = touch_scores()
    one = (scores.effect == "creep") & (scores.seed == 0) & (scores.model == "tree") & (scores.condition == "single")
    scores.loc[one, "value"] *= 1 + 3 * FLOOR
    found = assess("touch", scores).effects[0]
    assert found.largest().floors > 1 and not found.largest().counts and found.verdict == NOT_NEEDED
    both = (scores.effect == "creep") & (scores.model == "tree") & (scores.condition == "single")
    scores.loc[both & (scores.seed == 1), "value"] *= 1.001
    assert assess("touch", scores).effects[0].verdict == NEEDED


def test_seeds_that_agree_to_the_digit_leave_a_floor():
    scores = touch_scores({("lomp", "single"): 1.005})
    scores = scores.assign(value=scores["value"] / (1 + STEP * (scores["seed"] - 1)))
    (one,) = assess("touch", scores).effects
    assert one.verdict == NOT_NEEDED and one.largest().floors == pytest.approx(
        np.log(1.005) / np.log(1 + physics_verdicts.LEAST)
    )


def test_another_order_is_seen():
    one = judged({("cnn", "single"): 1.3})  # behind the RNN
    assert one.tau["single"] == pytest.approx(1 - 2 / 28) and one.tau["double"] == pytest.approx(1)  # one pair of 28
    assert one.verdict == NEEDED


def test_an_order_that_seeds_change_as_well_is_no_news():
    scores = touch_scores({("cnn", "single"): 1.3})
    own = (scores.condition == "single") & (scores.model == "cnn")
    scores.loc[own & (scores.effect == NONE) & (scores.seed == 1), "value"] = 6.2
    found = assess("touch", scores)
    assert found.floor_tau["single"] < 1 and found.effects[0].verdict == NOT_NEEDED


@pytest.mark.parametrize(
    ("changes", "claim"),
    [
        ({("lomp", "double"): 2.0}, "LoMP best on double"),
        (dict.fromkeys([(m, "single") for m in ("cnn", "rnn", "lomp")], 2.0), "learning beats conventional"),
        ({("tree", "double"): 0.5}, "double is harder"),
        ({("cnn", "double"): 0.4, ("rnn", "double"): 0.4, ("linear", "double"): 2.0}, "plain networks lose most"),
    ],
)
def test_claims_turn_over_with_the_scores(changes, claim):
    found = assess("touch", touch_scores(changes))
    assert all(holds for holds in found.claims.values()), "with all effects on, all hold here"
    assert claim in found.effects[0].flipped and found.effects[0].verdict == NEEDED


@pytest.mark.parametrize("model", ["linear", "tree", "lomp"])
def test_a_claim_about_a_model_that_was_not_run_is_not_tested(model):
    scores = touch_scores()
    found = assess("touch", scores[scores.model != model])
    about = {  # model -> claims that do not compare it
        "linear": set(),
        "tree": {"plain networks lose most"},
        "lomp": {"double is harder", "plain networks lose most"},
    }
    assert set(found.claims) == about[model]


def test_a_claim_that_seeds_disagree_on_does_not_count():
    scores = touch_scores({("lomp", "double"): 2.0})
    own = (scores.condition == "double") & (scores.model == "lomp") & (scores.effect == NONE) & (scores.seed == 2)
    scores.loc[own, "value"] = 30.0
    found = assess("touch", scores)
    assert found.claims["LoMP best on double"] is None and found.effects[0].flipped == []


def test_a_failed_run_is_no_verdict():
    scores = touch_scores()
    scores.loc[(scores.effect == "creep") & (scores.seed == 0) & (scores.model == "rnn"), "value"] = np.nan
    found = assess("touch", scores)
    assert found.effects[0].verdict == FAILED
    settings = {"touch": {"floor_seeds": [0, 1, 2], "effect_seeds": [0, 1], "scene": {}}}
    values = {"physics": settings, "touch": {"simulate": {"effects": {"creep": True}}}}
    text = physics_report.readme({"touch": found}, {"touch": scores}, values)
    assert "a run failed: `creep`" in text and "failed" in text.split("| creep")[1].split("\n")[0]


def test_an_effect_that_makes_the_seeds_differ_is_seen():
    """Without it all errors are small and alike: in kPa, a change within the spread between seeds."""
    scores = touch_scores()
    own = (scores.condition == "single") & (scores.model == "tree")
    scores.loc[own & (scores.effect == NONE), "value"] = [4.0, 8.0, 12.0]
    scores.loc[own & (scores.effect != NONE), "value"] = [0.1, 0.1]
    change = assess("touch", scores).effects[0].largest()
    assert change[:2] == ("single", "tree") and change.counts and change.before - change.after < 12.0 - 4.0


def test_accuracy_counts_as_an_error():
    scores = pd.DataFrame([("glove", NONE, "pressure", "tree", 0, "accuracy", "1", 0.75)], columns=COLUMNS)
    assert physics_verdicts.errors(scores)["error"].tolist() == [0.25]


# Errors with which each claim of strain and glove holds, and what turns it over.
STRAIN = {
    ("constant", "task_1"): 2.0, ("ridge", "task_1"): 0.3, ("lstm_direct", "task_1"): 0.3,
    ("lstm_transfer_ridge", "task_1"): 0.5, ("constant", "task_2"): 34.0, ("ridge", "task_2"): 27.0,
    ("lstm_direct", "task_2"): 20.0, ("lstm_transfer_ridge", "task_2"): 22.0,
}  # fmt: skip
GLOVE = {
    ("tree", "pressure"): 0.3, ("tree", "strain"): 0.5, ("tree", "combined"): 0.25,
    ("naive_bayes", "pressure"): 0.25, ("naive_bayes", "strain"): 0.5, ("naive_bayes", "combined"): 0.2,
    ("sp_resnet_nogcam", "pressure"): 0.15, ("sp_resnet_nogcam", "strain"): 0.4,
    ("sp_resnet_nogcam", "combined"): 0.1,
}  # fmt: skip


@pytest.mark.parametrize(
    ("experiment", "errors", "name", "change"),
    [
        ("strain", STRAIN, "depth can be read", {("lstm_direct", "task_1"): 1.2}),
        ("strain", STRAIN, "place can be summed from slips", {("lstm_direct", "task_2"): 28.0}),
        ("strain", STRAIN, "transfer near direct, z", {("lstm_transfer_ridge", "task_1"): 0.7}),
        ("strain", STRAIN, "transfer near direct, xy", {("lstm_transfer_ridge", "task_2"): 26.0}),
        ("glove", GLOVE, "combined is best", {("sp_resnet_nogcam", "combined"): 0.2}),
        ("glove", GLOVE, "network beats tree", {("sp_resnet_nogcam", "strain"): 0.6}),
        ("glove", GLOVE, "network beats naive Bayes", {("sp_resnet_nogcam", "combined"): 0.21}),
        ("glove", GLOVE, "pressure tells more than joints", {("sp_resnet_nogcam", "pressure"): 0.45}),
    ],
)
def test_every_claim_can_hold_and_fail(experiment, errors, name, change):
    claim = next(one for one in CLAIMS[experiment] if one.name == name)
    assert claim.holds(errors) and not claim.holds(errors | change)


def test_params_yaml_runs_what_the_claims_need():
    values = params.load()
    conditions = {"touch": ("single", "double"), "strain": ("task_1", "task_2"), "glove": physics_verdicts.IMAGES}
    for experiment, claims in CLAIMS.items():
        errors = dict.fromkeys(product(values["physics"][experiment]["models"], conditions[experiment]), 1.0)
        assert all(isinstance(claim.holds(errors), bool) for claim in claims)
        wanted = variants(values, experiment)
        assert {effect for effect, _ in wanted} - {DEFAULT} == {NONE, *values[experiment]["simulate"]["effects"]}


def test_every_effect_with_a_purpose_exists():
    values = params.load()
    for experiment, effect in physics_verdicts.PURPOSE:
        assert effect in values[experiment]["simulate"]["effects"]


def test_settings_switch_one_effect_and_move_the_seed():
    values = params.load()
    whole, without = (physics_study.settings_of(values, "touch", effect, 3) for effect in (NONE, "crosstalk"))
    assert whole["simulate"]["seed"] == values["touch"]["simulate"]["seed"] + 3
    assert [k for k, on in without["simulate"]["effects"].items() if not on] == ["crosstalk"]
    assert all(whole["simulate"]["effects"].values())
    assert whole["simulate"]["single"]["points_per_side"] == 12 and values["touch"]["simulate"]["circuit"]


def test_what_is_off_by_default_is_left_out_at_once():
    values = params.load()
    switches = values["glove"]["simulate"]["effects"]
    switches |= dict.fromkeys(switches, True)
    assert DEFAULT not in {effect for effect, _ in variants(values, "glove")}
    switches |= {"noise": False, "softness": False}
    effects = physics_study.settings_of(values, "glove", DEFAULT, 0)["simulate"]["effects"]
    assert {name for name, on in effects.items() if not on} == {"noise", "softness"}
    assert all(physics_study.settings_of(values, "glove", NONE, 0)["simulate"]["effects"].values())
    assert (DEFAULT, values["physics"]["glove"]["effect_seeds"][0]) in variants(values, "glove")


def test_a_misspelt_scene_setting_is_refused():
    values = params.load()
    values["physics"]["strain"]["scene"]["simulate"]["sampels"] = 9
    with pytest.raises(InputError, match="sampels.*did you mean 'samples'"):
        physics_study.settings_of(values, "strain", NONE, 0)


def test_seeds_that_cannot_be_compared_are_refused():
    values = params.load()
    values["physics"]["glove"] |= {"floor_seeds": [0, 1], "effect_seeds": [2]}
    with pytest.raises(InputError, match="physics.glove: floor_seeds"):
        variants(values, "glove")


def test_a_missing_run_is_named(tmp_path, monkeypatch):
    values = params.load()
    values["physics"]["touch"] |= {"floor_seeds": list(SEEDS), "effect_seeds": [0, 1]}
    values["touch"]["simulate"]["effects"] = {"creep": True}
    monkeypatch.setattr(paths, "ROOT", tmp_path)
    target = paths.physics("touch")
    target.parent.mkdir(parents=True)
    scores = touch_scores()
    scores.to_csv(target, index=False)
    assert len(physics_verdicts.read("touch", values)) == len(scores)
    scores.drop(scores[(scores.effect == "creep") & (scores.model == "lomp")].index[0]).to_csv(target, index=False)
    with pytest.raises(InputError, match="no row for effect creep, seed 0, condition single, model lomp"):
        physics_verdicts.read("touch", values)
    pd.concat([scores, scores.tail(1)]).to_csv(target, index=False)
    with pytest.raises(InputError, match="two rows for effect creep, seed 1, condition double, model lomp"):
        physics_verdicts.read("touch", values)


def test_miniature_judges_every_effect_and_condition(miniature):
    table = pd.read_csv(miniature.folder / "reports" / "physics.csv")
    values = params.load(miniature.folder / "params.yaml")
    for experiment, conditions in (("touch", 2), ("strain", 2), ("glove", 3)):
        own = table[table.experiment == experiment]
        assert set(own.effect) == {*values[experiment]["simulate"]["effects"], DEFAULT}
        assert own.groupby("effect")["condition"].nunique().eq(conditions).all()
        with open(miniature.folder / "data" / experiment / "physics.csv", newline="") as file:
            rows = list(csv.DictReader(file))
        runs = len(variants(values, experiment)) * conditions * len(values["physics"][experiment]["models"])
        assert len(rows) == runs and all(np.isfinite(float(row["value"])) for row in rows)
    assert table.verdict.isin([NEEDED, NOT_NEEDED]).all()
    names = {path.name for path in (miniature.folder / "reports" / "physics").iterdir()}
    assert names == {"README.md", "touch.png", "strain.png", "glove.png"}
