"""Where models lose their skill: crossings, intervals, which models are judged, starts, and what helps."""

import numpy as np
import pandas as pd
import pytest
from builders import stress_rows
from builders.project import ROOT

from pipeline.claims import stability
from pipeline.claims.stability import DOWN, LINEAR, LOG, NO_CLEAN, NO_ORDER, UP
from pipeline.results import shards
from tactile.base import params
from tactile.base.errors import InputError
from tactile.base.paths import Workspace
from tactile.experiments import facts

DOUBLE = ("press", "double")
SLOPES = (8.0, 10.0, 12.0, 10.0)  # of an error over severity, by seed
USABLE = {"press": 5.0}


def constant(severity, seed):
    return 10.0


def rising(severity, seed):
    """From 2 up by a slope of the seed's own: half of the skill is lost at an error of 6, all of it at 10."""
    return 2.0 + SLOPES[seed % 4] * abs(severity)


def judged(curves, tests, usable=USABLE, place=DOUBLE, **further) -> tuple[pd.DataFrame, pd.DataFrame, pd.DataFrame]:
    """Return failures, models that are not usable clean, and the runs of made-up curves."""
    stress = stress_rows.rows("touch", place, {"constant": constant, **curves}, tests, **further)
    runs = stability.runs(stress, "touch")
    clean = stability.clean_errors(stress.iloc[:0], runs, "touch")
    return *stability.failures(runs, clean, "touch", usable), runs


def test_half_and_all_of_the_skill_are_lost_where_the_mean_curve_crosses_their_levels():
    table, _, _ = judged({"lomp": rising}, {"noise": [0, 0.5, 1.0]})
    (row,) = table.to_dict("records")
    assert row["half_at"] == pytest.approx(0.4) and row["all_at"] == pytest.approx(0.8)
    assert row["fails_at"] == pytest.approx(0.3), "5 kPa are usable"
    assert (row["clean"], row["seeds"], row["budget"], row["largest"], row["axis"]) == (2.0, 4, "full", 1.0, LINEAR)
    assert row["half_low"] < 0.4 < row["half_high"], "slopes differ by seed"
    rng = np.random.default_rng(5)
    by_hand = [4 / rng.choice(SLOPES, 4).mean() for _ in range(20_000)]
    assert [row["half_low"], row["half_high"]] == pytest.approx(np.quantile(by_hand, [0.025, 0.975]), rel=0.02)


def test_where_a_test_changes_the_truth_errors_are_shares_of_that_of_the_constant_model():
    """Skill is kept where both errors grow alike, and lost where that of the model grows faster."""

    def constant(severity, seed):
        return 10.0 * (1 + severity)

    alike = {"lomp": lambda severity, seed: 0.2 * constant(severity, seed), "constant": constant}
    table, _, _ = judged(alike, {"peak_pressure": [0, 0.5, 2.0]})
    assert table["half_at"].isna().all() and table["half_note"].eq("> 2").all()
    faster = alike | {"lomp": lambda severity, seed: (0.2 + 0.4 * severity) * constant(severity, seed)}
    table, _, _ = judged(faster, {"peak_pressure": [0, 0.5, 2.0]})
    assert table["half_at"].tolist() == pytest.approx([1.0]) and table["all_at"].tolist() == pytest.approx([2.0])


def test_seeds_that_agree_have_an_interval_without_width_and_two_have_none():
    same = {"lomp": lambda severity, seed: 2.0 + 10 * severity}
    (row,) = judged(same, {"noise": [0, 1.0]})[0].to_dict("records")
    assert row["half_low"] == row["half_high"] == row["half_at"] == pytest.approx(0.4)
    (row,) = judged(same, {"noise": [0, 1.0]}, seeds=(0, 1))[0].to_dict("records")
    assert row["half_at"] == pytest.approx(0.4) and np.isnan(row["half_low"]) and row["seeds"] == 2


def test_a_level_beyond_the_largest_severity_is_said_and_an_end_there_is_open():
    """Of four seeds one alone reaches the level at 0.35: the mean of some draws does, of the others not."""
    table, _, _ = judged({"lomp": rising}, {"noise": [0, 0.2, 0.36]})
    (row,) = table.to_dict("records")
    assert np.isnan(row["half_at"]) and row["half_note"] == "> 0.36"
    assert row["half_low"] < 0.36 and row["half_high"] == np.inf
    assert np.isnan(row["all_at"]) and row["all_note"] == "> 0.36" and row["all_low"] == np.inf


def test_severities_of_both_signs_are_two_directions_walked_from_0_outwards():
    def curve(severity, seed):
        return 2 + (3 * severity if severity > 0 else -8 * severity)

    table, _, _ = judged({"lomp": curve}, {"press_speed": [0, -2, -1, 1, 2]})
    at = table.set_index("direction")
    assert at.loc[DOWN, "half_at"] == pytest.approx(-0.5) and at.loc[UP, "half_at"] == pytest.approx(4 / 3)
    assert (at.loc[DOWN, "largest"], at.loc[UP, "largest"]) == (-2, 2)
    down = judged({"lomp": rising}, {"press_speed": [0, -0.2, -0.36]})[0].iloc[0]
    assert down["half_low"] == -np.inf and -0.36 < down["half_high"] < 0 and down["half_note"] == "< -0.36"
    assert (table["half_low"] <= table["half_at"]).all() and (table["half_at"] <= table["half_high"]).all()


def test_severities_that_span_a_factor_of_ten_are_on_a_logarithmic_axis_but_for_the_first_segment():
    levels = {0: 2.0, 0.01: 4.0, 0.1: 8.0, 1.0: 9.0}
    (row,) = judged({"lomp": lambda at, seed: levels[at]}, {"noise": list(levels)})[0].to_dict("records")
    assert row["axis"] == LOG and row["half_at"] == pytest.approx(0.01 * 10**0.5)
    assert row["fails_at"] == pytest.approx(0.01 * 10**0.25)
    steep = {0: 2.0, 0.01: 10.0, 0.1: 10.0}
    (row,) = judged({"lomp": lambda at, seed: steep[at]}, {"noise": list(steep)})[0].to_dict("records")
    assert row["half_at"] == pytest.approx(0.005), "from 0 on there is no logarithm"
    assert stability.axis_of([0, 1, 9.9]) == LINEAR and stability.axis_of([0, -1, -10]) == LOG
    assert stability.axis_of([0, 5]) == LINEAR


def test_a_curve_that_comes_back_crosses_where_it_does_first():
    levels = {0: 2.0, 1: 7.0, 2: 3.0, 3: 9.0}
    (row,) = judged({"lomp": lambda at, seed: levels[at]}, {"dead_line": list(levels)})[0].to_dict("records")
    assert row["half_at"] == pytest.approx(0.8)


def test_a_level_on_a_severity_is_reached_there_and_one_at_0_at_once():
    found = stability.crossing(np.array([0.0, 1, 2]), np.array([[2, 6, 9], [7, 8, 9], [2, 3, 5.9]]), 6.0, LINEAR)
    assert found.tolist() == [1.0, 0.0, np.inf]


def test_models_that_are_not_usable_clean_are_listed_and_not_judged():
    curves = {
        "lomp": rising,
        "cnn": lambda at, seed: 5.1 + at,  # above what is usable
        "rnn": lambda at, seed: 4.9 + at,
        "vgg": lambda at, seed: np.nan,
    }
    table, bad, _ = judged(curves, {"noise": [0, 1]})
    assert set(table["model"]) == {"lomp", "rnn"} and bad["model"].tolist() == ["cnn", "vgg"]
    assert bad.set_index("model").loc["cnn", ["clean", "floor", "usable", "seeds"]].tolist() == [5.1, 10, 5.0, 4]
    assert bad.set_index("model").loc["vgg", "failed"] == 4
    table, bad, _ = judged({"cnn": lambda at, seed: 10.5}, {"noise": [0, 1]}, usable={"press": 20.0})
    assert table.empty and bad["model"].tolist() == ["cnn"], "usable, and no better than a constant"
    table, _, _ = judged({"cnn": curves["cnn"]}, {"noise": [0, 1]}, usable={"press": 5.0, "press/double": 6.0})
    assert table["usable"].tolist() == [6.0], "a condition may have a limit of its own"


def test_a_run_that_failed_is_counted_and_left_out_of_the_mean():
    def curve(severity, seed):
        return np.nan if seed == 1 else 2 + 10 * severity

    (row,) = judged({"lomp": curve}, {"noise": [0, 1]})[0].to_dict("records")
    assert (row["seeds"], row["failed"]) == (3, 1) and row["half_at"] == pytest.approx(0.4)


def test_other_sensors_have_no_order_and_layouts_no_clean_level():
    table, _, _ = judged({"lomp": rising}, {"specimen": [0, 1, 2], "noise": [0, 1]})
    assert table.set_index("perturbation")["half_note"].to_dict() == {"specimen": NO_ORDER, "noise": ""}
    table, _, _ = judged({"lomp": rising}, {"touches": [2, 3]}, place=("press", "several"))
    assert table[["perturbation", "half_note"]].values.tolist() == [["touches", NO_CLEAN]]
    assert table[["half_at", "fails_at", "largest"]].isna().all(axis=None)


def test_every_test_of_other_sensors_is_known_by_its_unit():
    named = {test for of, test, told in stability.TESTS if "other sensor" in told.unit}
    assert named == {test for _, test, told in stability.TESTS if told.unit.endswith(stability.NAMES)} == {"specimen"}


def test_only_full_runs_of_the_variant_count_and_none_twice():
    rows = stress_rows.rows("touch", DOUBLE, {"constant": constant, "lomp": rising}, {"noise": [0, 1]})
    half = rows[rows["model"] == "lomp"].assign(budget="half", value=99.0)
    other = rows[rows["model"] == "lomp"].assign(variant="faults", value=77.0)
    runs = stability.runs(pd.concat([rows, half, other]), "touch")
    assert len(runs) == len(rows) and runs["error"].max() < 20
    assert stability.runs(pd.concat([rows, other]), "touch", "faults")["error"].unique().tolist() == [77.0]
    with pytest.raises(InputError, match="two rows of touch for protocol press, condition double, perturbation noise"):
        stability.runs(pd.concat([rows, rows.tail(1)]), "touch")


def test_a_run_that_other_seeds_have_is_missed():
    rows = stress_rows.rows("touch", DOUBLE, {"constant": constant, "lomp": rising}, {"noise": [0, 0.3, 1]})
    lost = rows[(rows["model"] == "lomp") & (rows["seed"] == 2) & (rows["severity"] == 0.3)].index
    with pytest.raises(InputError, match="no row of touch for perturbation noise, severity 0.3, model lomp, seed 2"):
        stability.runs(rows.drop(index=lost), "touch")
    whole = rows[~((rows["model"] == "lomp") & (rows["seed"] == 2))]
    assert len(stability.runs(whole, "touch")) == len(whole), "a seed that was not computed at all is another matter"


def test_an_accuracy_is_turned_into_an_error():
    rows = stress_rows.rows("glove", ("session_combined", "combined"), {"tree": lambda at, seed: 0.3}, {"noise": [0]})
    assert rows["value"].unique() == pytest.approx([0.7])
    assert stability.runs(rows, "glove")["error"].unique() == pytest.approx([0.3])


def test_the_clean_error_is_that_of_the_tables_of_the_same_seeds():
    stress = stress_rows.rows("touch", DOUBLE, {"constant": constant, "lomp": rising}, {"noise": [0, 1]}, seeds=(0, 1))
    runs = stability.runs(stress, "touch")
    told = stress_rows.rows("touch", DOUBLE, {"lomp": lambda at, seed: 3.0 + seed}, {"noise": [0]}, seeds=(0, 1, 2))
    clean = stability.clean_errors(told, runs, "touch")
    assert clean[clean["model"] == "lomp"]["error"].tolist() == [3.0, 4.0]
    assert clean[clean["model"] == "constant"]["error"].tolist() == [10.0, 10.0], (
        "as under stress, where no table has it"
    )
    table, _ = stability.failures(runs, clean, "touch", USABLE)
    assert (table["clean"].iloc[0], table["start"].iloc[0]) == (3.5, 2.0)


def test_the_hardest_test_takes_half_of_most_models_at_the_least_share_of_what_was_tried():
    def weak(severity, seed):
        return 2 + 5 * severity

    curves = {"lomp": weak, "cnn": lambda at, seed: 2 + 0.5 * at}
    table, _, _ = judged(curves, {"dead": [0, 1, 2], "stuck": [0, 2, 8], "jitter": [0, 0.1, 0.2]})
    assert stability.hardest(table) == [("stuck", UP), ("dead", UP), ("jitter", UP)]


def test_another_model_is_better_only_where_seeds_agree():
    def robust(severity, seed):
        return 3 + severity * (1 + 0.1 * seed)

    def uncertain(severity, seed):
        return (0.5, 11, 0.5, 11)[seed] if severity else 4.0

    table, _, runs = judged({"lomp": rising, "cnn": robust}, {"noise": [0, 0.5, 1.0]})
    (found,) = stability.better(runs, table)
    assert (found.model, found.perturbation) == ("cnn", "noise") and found.severity == pytest.approx(0.4)
    assert found.error == pytest.approx(3 + 0.4 * 1.15) and found.of_best == pytest.approx(6.0)
    table, _, runs = judged({"lomp": rising, "cnn": uncertain}, {"noise": [0, 0.4, 1.0]})
    assert stability.better(runs, table) == []
    table, _, runs = judged({"lomp": rising, "cnn": robust}, {"noise": [0, 0.5, 1.0]}, seeds=(0, 1))
    assert stability.better(runs, table) == [], "two seeds tell nothing"


def test_what_helps_is_a_ratio_of_severities():
    plain = judged({"lomp": rising}, {"noise": [0, 0.5, 1.0], "dead": [0, 0.1]})[0]
    other = judged({"lomp": lambda at, seed: 2.5 + 5 * at}, {"noise": [0, 0.5, 1.0], "dead": [0, 0.1]})[0]
    found = stability.helped(plain, other).set_index("perturbation")
    assert found.loc["noise", "ratio"] == pytest.approx(0.75 / 0.4) and np.isnan(found.loc["dead", "ratio"])
    assert found.loc["noise", ["clean", "clean_variant"]].tolist() == [2.0, 2.5]


def table_of(rows: list[tuple]) -> pd.DataFrame:
    """Return rows of the one table: protocol, condition, model, variant, seed, value."""
    made = pd.DataFrame(rows, columns=["protocol", "condition", "model", "variant", "seed", "value"])
    budget = np.where(made["variant"] == "", "full", "")
    return made.assign(experiment="touch", metric="rmse", unit="kPa", n=9, budget=budget)


def test_starts_that_fail_or_are_worse_than_twice_the_median_are_counted_once():
    errors = [5.0, 5.1, 5.2, 10.1, 10.3, np.nan]
    rows = [("press", at, "lomp", "", seed, error) for at in ("single", "double") for seed, error in enumerate(errors)]
    rows[4] = (*rows[4][:5], 10.5)
    (found,) = stability.starts(table_of(rows), "touch").to_dict("records")
    assert (found["starts"], found["failed"]) == (6, 1)
    assert found["worse"] == 1, "of a median of 5.2, 10.4 is the limit"
    assert np.isnan(found["third"]) and found["rate_seeds"] == 0
    half = table_of(rows).assign(budget="half")
    assert stability.starts(half, "touch").empty and stability.starts(table_of(rows[:0]), "touch").empty


def test_learning_rates_are_compared_with_a_training_as_short():
    rows = [("press", "single", "lomp", "", 0, 1.0)]
    rows += [("press", "single", "lomp", f"rate_{at}", seed, error * (1 + seed))
             for at, error in (("1", 4.0), ("0.33", 6.0), ("3", 8.0)) for seed in (0, 1)]  # fmt: skip
    (found,) = stability.starts(table_of(rows), "touch").to_dict("records")
    assert found["third"] == pytest.approx(1.5) and found["thrice"] == pytest.approx(2.0) and found["rate_seeds"] == 2
    rows[-1] = (*rows[-1][:5], np.nan)
    (found,) = stability.starts(table_of(rows), "touch").to_dict("records")
    assert found["thrice"] == np.inf and found["third"] == pytest.approx(1.5)
    named = [(*row[:3], row[3].replace("rate", "transfer_rate"), *row[4:]) for row in rows]
    assert stability.starts(table_of(named), "touch")["third"].tolist() == pytest.approx([1.5])


@pytest.mark.parametrize("name", ["starts_touch", "starts_strain", "starts_glove"])
def test_each_network_is_trained_at_a_third_and_three_times_the_rate_of_the_tables(name):
    each = shards.read_sets(Workspace(ROOT))[name]
    values = params.load(ROOT / "params.yaml")[each.experiment]["models"]
    seen = set()
    for variant, settings in each.variants.items():
        times = float(stability.RATE.search(variant)[1])
        for model in settings.models:
            rate = values[model]["training"]["learning_rate"]
            given = settings.set.get(f"{each.experiment}.models.{model}.training.learning_rate", rate)
            assert given == pytest.approx(times * rate, rel=0.02), (variant, model)
            seen.add((model, times))
    networks = {model for model in values if "training" in values[model]}
    assert seen == {(model, times) for model in networks for times in (0.33, 1.0, 3.0)}


@pytest.mark.parametrize("experiment", params.load(ROOT / "params.yaml")["experiments"])
def test_the_best_model_is_usable_clean_and_a_constant_is_not(experiment):
    """The limits of params.yaml, by the committed evidence."""
    asked, rows = params.load(ROOT / "params.yaml")["stress"][experiment], shards.read(Workspace(ROOT))
    own = stability.as_error(stability.of_variant(rows, ""), experiment)
    tested = {at: words for at, words in facts(experiment).tested.items()}
    for protocol in asked["protocols"]:
        here = own[own["protocol"] == protocol]
        for condition in set(here["condition"]):
            if (protocol, condition) in tested or len(set(here["condition"])) == 1:
                errors = here[here["condition"] == condition].groupby("model")["error"].mean()
                limit = stability.limit(asked["usable"], protocol, condition)
                best = errors.drop("constant").min()
                assert best <= limit < errors["constant"], (protocol, condition, best, limit, errors["constant"])
