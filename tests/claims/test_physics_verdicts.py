"""Judging effects of a scene: paired seeds, an equivalence test, and every run of the settings is asked for."""

import re

import numpy as np
import pandas as pd
import pytest
from builders.made_reports import studied
from builders.project import ROOT
from scipy.stats import ttest_1samp

from pipeline.claims import physics as physics_verdicts
from pipeline.claims.physics import CHANGES, EQUIVALENT, FAILED, MARGIN, NONE, UNKNOWN, assess
from pipeline.reporting import tables
from pipeline.results import studies
from pipeline.results.studies import PHYSICS as COLUMNS
from pipeline.results.studies import effects
from pipeline.stages import twins as twins_stage
from pipeline.studies import physics as physics_study
from tactile import experiments
from tactile.base import params
from tactile.base.errors import InputError
from tactile.base.paths import Workspace

ERRORS = {"single": {"linear": 9.0, "tree": 7.5, "lomp": 3.5}, "double": {"linear": 12.0, "tree": 13.0, "lomp": 7.0}}
SEEDS = (0, 1, 2, 3, 4)
NOISE = 0.01 * np.array([-1.0, 0.5, 0.0, 1.5, -1.0])  # of the logarithm of a ratio, one value per seed; mean 0
HALF = 2.1318 * NOISE.std(ddof=1) / np.sqrt(5)  # half of the 90 % interval: t of five seeds


def touch_scores(changes=None, noise=NOISE) -> pd.DataFrame:
    """Return physics.csv of `creep`, which changes errors by factors; changes: (model, condition) -> factor."""
    rows = []
    for seed in SEEDS:
        specimen = 1 + 0.3 * seed  # the spread between seeds is large, and pairs share it
        for condition, values in ERRORS.items():
            for model, value in values.items():
                rows.append(("touch", NONE, condition, model, seed, "rmse", "kPa", value * specimen))
                factor = (changes or {}).get((model, condition), 1.0) * np.exp(noise[seed])
                rows.append(("touch", "creep", condition, model, seed, "rmse", "kPa", value * specimen * factor))
    return pd.DataFrame(rows, columns=COLUMNS)


def judged(changes=None, noise=NOISE):
    (judgement,) = assess(touch_scores(changes, noise))
    return judgement


def change_of(judgement, model, condition):
    return next(change for change in judgement.changes if change[:2] == (condition, model))


def test_pairs_whose_ratio_is_near_one_are_equivalent_however_much_seeds_differ():
    judgement = judged()
    assert judgement.verdict == EQUIVALENT and judgement.swapped == []
    change = change_of(judgement, "tree", "single")
    assert change.relative == pytest.approx(0, abs=1e-12)
    assert (change.low, change.high) == pytest.approx((np.exp(-HALF) - 1, np.exp(HALF) - 1), rel=1e-4)


def test_the_interval_is_that_of_two_one_sided_tests():
    """The upper end is the margin at which the one-sided test has p = 5 %."""
    change = change_of(judged({("tree", "single"): 1.02}), "tree", "single")
    ratios = np.log(1.02) + NOISE
    assert ttest_1samp(ratios, np.log1p(change.high), alternative="less").pvalue == pytest.approx(0.05, abs=1e-6)
    assert ttest_1samp(ratios, np.log1p(change.low), alternative="greater").pvalue == pytest.approx(0.05, abs=1e-6)


@pytest.mark.parametrize(
    ("factor", "verdict"),
    [
        (np.exp(np.log(1 + MARGIN) - 1.1 * HALF), EQUIVALENT),
        (np.exp(np.log(1 + MARGIN) - 0.9 * HALF), UNKNOWN),
        (np.exp(np.log(1 + MARGIN) + 0.9 * HALF), UNKNOWN),
        (np.exp(np.log(1 + MARGIN) + 1.1 * HALF), CHANGES),
        (np.exp(np.log(1 - MARGIN) + 1.1 * HALF), EQUIVALENT),
        (np.exp(np.log(1 - MARGIN) - 0.9 * HALF), UNKNOWN),
        (np.exp(np.log(1 - MARGIN) - 1.1 * HALF), CHANGES),
    ],
)
def test_the_verdict_turns_where_the_interval_crosses_the_margin(factor, verdict):
    assert judged({("tree", "single"): factor}).verdict == verdict


def test_few_pairs_that_scatter_tell_nothing():
    assert judged(noise=10 * NOISE).verdict == UNKNOWN


def test_models_that_change_places_are_not_equivalent():
    scores = touch_scores()
    scores.loc[(scores.model == "tree") & (scores.condition == "single"), "value"] *= 9.0 / 7.5 * 0.98
    assert assess(scores)[0].verdict == EQUIVALENT
    scores.loc[(scores.effect == "creep") & (scores.model == "tree") & (scores.condition == "single"), "value"] *= 1.03
    (judgement,) = assess(scores)
    assert judgement.swapped == ["linear and tree (single)"] and judgement.verdict == UNKNOWN


def test_a_failed_run_is_no_verdict():
    scores = touch_scores()
    scores.loc[(scores.effect == "creep") & (scores.seed == 0) & (scores.model == "lomp"), "value"] = np.nan
    (judgement,) = assess(scores)
    assert judgement.verdict == FAILED
    rows = pd.DataFrame(physics_verdicts.report_rows("touch", [judgement], {"creep": True}))
    assert tables.physics(rows).rows == [
        ["Creep", "failed", "LoMP, one touch", "0", FAILED, "kept: recorded (gain from past)"]
    ]


def test_the_table_shows_the_change_that_reaches_farthest():
    rows = pd.DataFrame(physics_verdicts.report_rows("touch", [judged({("tree", "single"): 1.3})], {"creep": True}))
    (row,) = tables.physics(rows).rows
    assert row[1].startswith("+30 % [+2") and row[2:5] == ["Decision tree, one touch", "1", CHANGES]
    errors = tables.physics_errors(rows)
    assert errors.header == ["Model", "One touch (kPa)", "Two touches (kPa)"] and errors.rows[0][0] == "Linear"
    assert float(errors.rows[0][1]) == pytest.approx(9.0 * np.exp(np.log(1 + 0.3 * np.array(SEEDS)).mean()), abs=0.005)


def test_accuracy_counts_as_an_error():
    scores = pd.DataFrame([("glove", NONE, "pressure", "tree", 0, "accuracy", "1", 0.75)], columns=COLUMNS)
    assert physics_verdicts.errors(scores)["error"].tolist() == [0.25]


@pytest.mark.parametrize(
    ("effect", "on", "factor", "text"),
    [
        ("crosstalk", True, 1.0, "may be left out: equivalent"),
        ("crosstalk", True, 1.2, "kept: changes errors"),
        ("crosstalk", True, 1.05, "kept: inconclusive"),
        ("crosstalk", False, 1.0, "left out: equivalent"),
        ("crosstalk", False, 1.05, "switch it on"),
        ("creep", True, 1.0, "kept: recorded"),
        ("creep", False, 1.2, "switch it on"),
        ("line_faults", True, 1.0, "kept: ingest is there"),
    ],
)
def test_what_follows_for_the_scene(effect, on, factor, text):
    judgement = judged({("tree", "single"): factor})._replace(effect=effect)
    assert physics_verdicts.consequence("touch", judgement, on).startswith(text)


@pytest.mark.parametrize("experiment", experiments.having("shown"))
def test_every_effect_with_a_reason_exists(experiment):
    """And one that recordings show is shown by a statistic of the twins."""
    facts, switches = (
        experiments.facts(experiment),
        params.load(ROOT / "params.yaml")[experiment]["simulate"]["effects"],
    )
    assert {*facts.purpose, *facts.shown} <= set(switches) and facts.purpose
    assert set(facts.shown.values()) <= set(twins_stage.MODULES[experiment].STATISTICS)


def test_settings_switch_one_effect_and_move_the_seed():
    values = params.load(ROOT / "params.yaml")
    whole, without = (physics_study.settings_of(values, "touch", effect, 3) for effect in (NONE, "crosstalk"))
    for name in ("seed", "specimen"):
        assert whole["simulate"][name] == values["touch"]["simulate"][name] + 3
    assert [k for k, on in without["simulate"]["effects"].items() if not on] == ["crosstalk"]
    assert all(whole["simulate"]["effects"].values())
    scene = values["physics"]["touch"]["scene"]["simulate"]["single"]
    assert whole["simulate"]["single"].items() >= scene.items() and values["touch"]["simulate"]["circuit"]


def test_a_misspelt_scene_setting_is_refused():
    values = params.load(ROOT / "params.yaml")
    values["physics"]["strain"]["scene"]["simulate"]["sampels"] = 9
    with pytest.raises(InputError, match="sampels.*did you mean 'samples'"):
        physics_study.settings_of(values, "strain", NONE, 0)


def test_one_seed_has_no_interval_and_tells_nothing():
    (judged,) = assess(touch_scores().query("seed == 0"))
    assert judged.verdict == UNKNOWN and all(np.isnan(change.low) for change in judged.changes)
    assert all(np.isfinite(change.relative) for change in judged.changes)
    rows = pd.DataFrame(physics_verdicts.report_rows("touch", [judged], {"creep": True}))
    assert re.fullmatch(r"[+-]\d+ %", tables.physics(rows).rows[0][1])


def test_a_missing_run_is_named(workspace):
    def read(scores):
        studied(workspace, "touch", "physics", scores)
        return physics_verdicts.read(workspace, "touch", [NONE, "creep"], ERRORS["single"])

    scores = touch_scores()
    assert read(scores.iloc[:0]).empty and len(read(scores)) == len(scores)
    with pytest.raises(InputError, match="no row for effect creep, seed 0, condition single, model lomp"):
        read(scores.drop(scores[(scores.effect == "creep") & (scores.model == "lomp")].index[0]))
    with pytest.raises(InputError, match="two rows for effect creep, seed 4, condition double, model lomp"):
        read(pd.concat([scores, scores.tail(1)]))


def test_miniature_judges_every_effect_and_condition(miniature):
    table = pd.read_csv(miniature.folder / "reports" / "physics.csv")
    values = params.load(miniature.folder / "params.yaml")
    for experiment, conditions in (("touch", 2), ("strain", 2), ("glove", 1)):
        judged_effects = table[table.experiment == experiment]
        assert set(judged_effects.effect) == set(values[experiment]["simulate"]["effects"])
        assert judged_effects.groupby("effect")["condition"].nunique().eq(conditions).all()
        rows = studies.read(Workspace(miniature.folder), experiment, "physics", COLUMNS)
        runs = 2 * len(effects(values, experiment)) * conditions * len(values["physics"][experiment]["models"])
        assert len(rows) == runs and np.isfinite(rows["value"]).all()
    assert table.verdict.isin([EQUIVALENT, CHANGES, UNKNOWN]).all()
    names = {path.name for path in (miniature.folder / "reports" / "physics").iterdir()}
    assert names == {"README.md", "touch.png", "strain.png", "glove.png"}
