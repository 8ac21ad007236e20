"""Where models lose their skill, with intervals over blocks of presses, grasps and persons."""

import numpy as np
import pandas as pd
import pytest
from builders import stress_rows

from pipeline.claims import stability
from tactile.scoring import units

DAY = ("within_day_xy", "day_1")
SLOPES = np.array([4.0, 6, 7, 9, 10, 10, 11, 13, 14, 16])  # of an error over severity, by block


def judged(rows: pd.DataFrame, most: float = 9.0) -> pd.DataFrame:
    (experiment,), (protocol,) = rows["experiment"].unique(), rows["protocol"].unique()
    runs = stability.runs(rows, experiment)
    clean = stability.clean_errors(rows.iloc[:0], runs, experiment)
    return stability.failures(runs, clean, experiment, {protocol: most})[0]


def errors(slopes, seed_costs=0.0, tests=(0, 0.5, 1.0), seeds=(0,), floor=10.0) -> pd.DataFrame:
    """Rows of a model whose mean distance rises from 2 mm by the slope of each block, beside a constant one."""
    losses = {
        "constant": lambda at, seed: [[floor] * len(slopes)],
        "ridge": lambda at, seed: [2.0 + seed_costs * seed + slopes * at],
    }
    return stress_rows.by_blocks("strain_recorded", DAY, losses, {"noise": tests}, seeds)


def test_one_start_has_an_interval_over_presses_of_the_known_spread():
    (row,) = judged(errors(SLOPES)).to_dict("records")
    assert row["half_at"] == pytest.approx(4 / SLOPES.mean()) and row["all_at"] == pytest.approx(8 / SLOPES.mean())
    rng = np.random.default_rng(3)
    by_hand = 4 / rng.choice(SLOPES, (20_000, 10)).mean(axis=1)
    assert [row["half_low"], row["half_high"]] == pytest.approx(np.quantile(by_hand, [0.025, 0.975]), rel=0.03)
    assert (row["over"], row["seeds"]) == ("presses", 1)


def test_the_interval_holds_the_severity_of_all_presses_about_as_often_as_it_says():
    """Blocks from a population of slopes of mean 10: ten tell their spread less well than its 95 %."""
    rng, held = np.random.default_rng(0), []
    for _ in range(60):
        (row,) = judged(errors(rng.normal(10, 3, 10), tests=(0, 1.0))).to_dict("records")
        held.append(row["half_low"] <= 0.4 <= row["half_high"])
    assert 0.8 < np.mean(held) < 0.99


def test_starts_that_agree_tell_nothing_of_presses_and_starts_that_differ_are_averaged():
    rows = errors(SLOPES, seeds=(0, 1, 2))
    (of_starts,) = judged(rows.assign(blocks="")).to_dict("records")
    assert of_starts["half_low"] == of_starts["half_high"] and of_starts["over"] == "starts"
    (of_presses,), (of_one,) = (judged(each).to_dict("records") for each in (rows, errors(SLOPES)))
    assert of_presses["half_low"] < 0.35 < 0.46 < of_presses["half_high"]
    ends = ["half_low", "half_high"]
    assert [of_presses[end] for end in ends] == pytest.approx([of_one[end] for end in ends])
    apart = judged(errors(SLOPES, seed_costs=0.6, seeds=(0, 1, 2))).iloc[0]
    assert apart["half_at"] == pytest.approx((6.3 - 2.6) / 10)
    middle = judged(errors(SLOPES, seed_costs=0.6, seeds=(1,))).iloc[0]
    assert apart[ends].tolist() == pytest.approx(middle[ends].tolist())


def test_squared_errors_are_averaged_before_the_root_and_by_their_counts():
    """RMSE: at severity 1 nine of ten windows err by 1 N, the others by 20 N."""
    losses = {"constant": lambda at, seed: [[100.0] * 10], "linear": lambda at, seed: [[1.0] * 9 + [1 + 399 * at]]}
    rows = stress_rows.by_blocks("velostat_recorded", ("repetition", "all"), losses, {"noise": [0, 1.0]})
    runs = stability.runs(rows, "velostat_recorded")
    drawn = runs[(runs["model"] == "linear") & (runs["severity"] == 1)]["draws"].iloc[0]
    times = np.sqrt((np.square(drawn) - 1) / 399 * 10)  # how often the last block is drawn, rooted
    assert np.square(times) == pytest.approx(np.round(np.square(times)), abs=1e-6)
    assert np.square(times).mean() == pytest.approx(1, abs=0.1)
    uneven = rows.assign(blocks=["1:90 400:1 1:5"] * len(rows))
    drawn = stability.runs(uneven, "velostat_recorded")["draws"].iloc[0]
    assert drawn.min() == pytest.approx(1) and drawn.max() == pytest.approx(20)
    assert np.square(drawn) == pytest.approx(units.of_written("1:90 400:1 1:5", "error")[0])


def test_all_severities_and_models_share_a_draw():
    """Presses that cost any model more by one factor do not move the severity at which half of the skill is lost."""
    heavy = np.array([0.2, 0.5, 0.8, 1, 1, 1.5, 2, 3, 5, 8])
    losses = {"constant": lambda at, seed: [10 * heavy], "ridge": lambda at, seed: [(2 + 8 * at) * heavy]}
    (row,) = judged(stress_rows.by_blocks("strain_recorded", DAY, losses, {"noise": [0, 1.0]}), 99.0).to_dict("records")
    assert [row[name] for name in ("half_low", "half_at", "half_high")] == pytest.approx([0.5] * 3, rel=1e-3)


@pytest.mark.parametrize("at", ["ridge", "constant"])
def test_a_row_without_blocks_leaves_the_interval_to_starts(at):
    rows = errors(SLOPES, seeds=(0, 1, 2))
    lost = (rows["model"] == at) & (rows["seed"] == 1) & (rows["severity"] == 0.5)
    rows.loc[lost, "blocks"] = ""
    (row,) = judged(rows).to_dict("records")
    assert row["over"] == "starts" and row["half_low"] == row["half_high"]
    (row,) = judged(rows[rows["seed"] == 1]).to_dict("records")
    assert row["over"] == "" and np.isnan(row["half_low"]), "one start"


def test_two_blocks_are_too_few():
    (row,) = judged(errors(SLOPES[[0, -1]])).to_dict("records")
    assert row["over"] == "" and np.isnan(row["half_low"]) and row["half_at"] == pytest.approx(0.4)


def of_persons(*slopes) -> pd.DataFrame:
    """Rows of frames of persons, whose blocks are alike; the squared error of each rises by a slope of the person's."""
    losses = {
        "constant": lambda at, seed: [[100.0] * 5 for _ in slopes],
        "linear": lambda at, seed: [[4 + own * at] * 5 for own in slopes],
    }
    return stress_rows.by_blocks("array_recorded", ("fold_0", "two"), losses, {"noise": [0, 0.5, 1.0]})


def test_persons_are_drawn_before_frames_and_two_persons_tell_of_frames_alone():
    (row,) = judged(of_persons(40, 60, 80), 99).to_dict("records")
    assert row["over"] == "persons"
    mean = judged(of_persons(40), 99).iloc[0], judged(of_persons(80), 99).iloc[0]
    assert row["half_high"] == pytest.approx(mean[0]["half_at"], rel=1e-3)
    assert row["half_low"] == pytest.approx(mean[1]["half_at"], rel=1e-3)
    (row,) = judged(of_persons(40, 80), 99).to_dict("records")
    assert row["over"] == "frames of 2 persons", "whose frames are alike"
    assert row["half_low"] == pytest.approx(row["half_high"]) == pytest.approx(row["half_at"], rel=1e-3)
    assert mean[0]["over"] == "frames of 1 person"


def test_shares_that_are_right_are_turned_into_errors():
    right = {"constant": lambda at, seed: [[0.1] * 10], "tree": lambda at, seed: [0.9 - 0.8 * at * SLOPES / 10]}
    rows = stress_rows.by_blocks("glove_recorded", ("grasp_pressure", "pressure"), right, {"noise": [0, 0.5, 1.0]})
    (row,) = judged(rows, 0.5).to_dict("records")
    assert row["half_at"] == pytest.approx(0.5) and row["over"] == "grasps"
    assert 0.4 < row["half_low"] < 0.46 and 0.56 < row["half_high"] < 0.68


def test_another_model_is_better_where_the_same_presses_say_so():
    """Of one start: presses differ by more than the models do, and all of them or some are for the other model."""
    spread, turns = np.linspace(1, 9, 10), np.array([4, -4] * 4 + [4, 4])
    for gain, told in ((0.2 * spread, ["noise"]), (turns, [])):
        losses = {
            "constant": lambda at, seed: [[20.0] * 10],
            "ridge": lambda at, seed: [0.5 * spread + 4 * spread * at],
            "knn": lambda at, seed, gain=gain: [0.51 * spread + (4 * spread - gain) * at],
        }
        rows = stress_rows.by_blocks("strain_recorded", DAY, losses, {"noise": [0, 1.0]})
        table = judged(rows)
        found = stability.better(stability.runs(rows, "strain_recorded"), table)
        assert [each.perturbation for each in found] == told
