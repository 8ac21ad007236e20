"""Intervals over runs: of the number they stand beside, inside its bounds, and none where runs do not tell a spread."""

import numpy as np
import pytest
from scipy import stats

from pipeline.results import shards
from tactile.base.errors import InputError
from tactile.scoring import estimates

RUNS = (3, 4, 5, 10, 24)  # of the evidence
SIMULATED = 2000  # a coverage of 0.95 is then known to 0.005


def shares(rng, mean, alike, windows):
    """Return a function of a shape: shares of so many windows, which differ from run to run as a beta distribution."""
    return lambda shape: rng.binomial(windows, rng.beta(mean * alike, (1 - mean) * alike, shape)) / windows


def populations(rng):
    """Yield scale and population of runs: of the shape that the scale is made for, and of others as skewed."""
    yield estimates.PLAIN, lambda shape: rng.normal(1, 2, shape)
    yield estimates.PLAIN, lambda shape: rng.logistic(0, 1, shape)
    yield estimates.LOG, lambda shape: rng.lognormal(0, 0.5, shape)
    yield estimates.LOG, lambda shape: rng.gamma(4, 1, shape)
    yield estimates.R2, lambda shape: 1 - rng.lognormal(-3, 0.8, shape)
    yield estimates.R2, lambda shape: 1 - rng.gamma(3, 0.02, shape)
    yield estimates.SHARE, shares(rng, 0.5, 30, 100)
    yield estimates.SHARE, shares(rng, 0.9, 30, 100)
    yield estimates.SHARE, shares(rng, 0.97, 100, 1000)
    yield estimates.SHARE, shares(rng, 0.8, 20, 60)


@pytest.mark.parametrize("runs", RUNS)
@pytest.mark.parametrize("case", range(10))
def test_an_interval_holds_the_number_beside_it_in_95_of_100_cases(case, runs):
    rng = np.random.default_rng(case)
    scale, population = list(populations(rng))[case]
    truth = estimates.estimate(population(10**6), scale).mean
    found = [estimates.estimate(values, scale) for values in population((SIMULATED, runs)) if np.ptp(values) > 0]
    assert 0.93 <= np.mean([one.low <= truth <= one.high for one in found]) <= 0.97
    assert all(one.low < one.mean < one.high for one in found)


@pytest.mark.parametrize("runs", RUNS)
@pytest.mark.parametrize(("mean", "windows"), [(0.98, 30), (0.98, 100), (0.9, 8)])
def test_an_interval_of_shares_near_1_of_few_windows_is_rather_too_wide(mean, windows, runs):
    rng = np.random.default_rng(0)
    drawn = shares(rng, mean, 30, windows)((SIMULATED, runs))
    found = [estimates.estimate(values, estimates.SHARE) for values in drawn]
    assert np.mean([one.low <= mean <= one.high for one in found if np.isfinite(one.low)]) >= 0.915


@pytest.mark.parametrize("runs", RUNS)
@pytest.mark.parametrize("case", range(10))
def test_a_prediction_interval_holds_the_next_run_in_95_of_100_cases(case, runs):
    rng = np.random.default_rng(case)
    scale, population = list(populations(rng))[case]
    drawn = [values for values in population((SIMULATED, runs + 1)) if np.ptp(values[:-1]) > 0]
    found = [estimates.prediction(values[:-1], scale) for values in drawn]
    assert (
        0.93 <= np.mean([low <= values[-1] <= high for (low, high), values in zip(found, drawn, strict=True)]) <= 0.97
    )
    widths = [high - low for low, high in found]
    mean = [estimates.estimate(values[:-1], scale) for values in drawn]
    assert np.median(widths) > 1.5 * np.median([each.high - each.low for each in mean]), "wider than that of the mean"


@pytest.mark.parametrize(("scale", "least", "most"), [("share", 0, 1), ("r2", -np.inf, 1), ("log", 0, np.inf)])
def test_a_prediction_interval_stays_where_values_can_be(scale, least, most):
    low, high = estimates.prediction([0.9, 0.99, 0.5], scale)
    assert least <= low < 0.5 and 0.99 < high <= most
    for values in ([0.5, 0.6], [0.5] * 5, [0.5, np.nan, 0.6], []):
        assert np.isnan(estimates.prediction(values, scale)).all()


def test_an_interval_of_skewed_runs_is_not_stretched_to_their_arithmetic_mean():
    values = [0.25, 0.27, 0.26, 0.28, 0.24, 0.26, 0.27, 0.25, 0.83, 0.70]
    found = estimates.estimate(values, estimates.LOG)
    assert found.mean == pytest.approx(np.exp(np.mean(np.log(values)))) and found.mean < np.mean(values)
    middle = np.sqrt(found.low * found.high)
    assert middle == pytest.approx(found.mean)


@pytest.mark.parametrize("values", [[0.99, 1.0, 0.97], [0.01, 0.0, 0.2], [0.5, 0.6, 0.55]])
def test_an_interval_of_shares_stays_between_0_and_1(values):
    found = estimates.estimate(values, estimates.SHARE)
    assert 0 < found.low < found.mean < found.high < 1 and found.mean == pytest.approx(np.mean(values))


@pytest.mark.parametrize("share", [0.0, 1.0])
def test_an_interval_of_the_same_shares_in_all_runs_is_that_of_as_many_trials(share):
    """Of 7 windows each: in how many of the windows of the next runs it is so, they tell no better."""
    found = estimates.estimate([share] * 5, estimates.SHARE)
    expected = stats.binomtest(round(5 * share), 5).proportion_ci(0.95, "exact")
    assert found[:3] == pytest.approx((share, *expected))


def test_shares_of_few_windows_have_the_interval_of_as_many_trials_where_runs_are_alike():
    """Runs of 8 windows each that differ by chance alone: together they are about as many trials as windows."""
    rng = np.random.default_rng(1)
    trials = estimates.effective_trials(rng.binomial(8, 0.8, (24, 2000)) / 8)
    assert np.median(trials) == pytest.approx(24 * 8, rel=0.15)


def test_an_interval_of_r2_stays_below_1():
    found = estimates.estimate([0.9, 0.99, 0.7], estimates.R2)
    assert found.low < found.mean < found.high < 1
    assert estimates.estimate([0.9996, 0.9998, 0.9997], estimates.R2).mean > 0.9995


def test_runs_with_one_value_have_no_interval():
    for values, scale in (([2.0] * 5, estimates.PLAIN), ([0.5] * 5, estimates.SHARE), ([0.5], estimates.PLAIN)):
        assert np.isnan(estimates.estimate(values, scale)[1:3]).all()


@pytest.mark.parametrize("scale", estimates.SCALES)
def test_two_runs_have_a_mean_and_no_interval(scale):
    found = estimates.estimate([0.5, 0.6], scale)
    assert 0.5 < found.mean < 0.6 and np.isnan(found[1:3]).all()
    assert np.isnan(estimates.estimate([1.0, 1.0], scale)[1:3]).all()


@pytest.mark.parametrize(
    "damage",
    [
        b"",
        b"\xff\xfe\x00",
        b"shard,model\n",
        b"shard,model,protocol,seed,epochs,train_s\na,b,c,x,1,2\n",
        b"shard,model,protocol,seed,epochs,train_s\na,b,c,0,1,two\n",
        b"shard,model,protocol,seed,epochs,train_s\na,b,c,0,1,2,3\na,b,c,0,1,2,3\n",
        b"shard,model,protocol,seed,epochs,train_s\na,b,c,0,1,2\na,b,c,0,1,2,3\n",
    ],
)
def test_a_damaged_table_of_the_evidence_is_one_sentence(damage, tmp_path):
    path = tmp_path / "times.csv"
    path.write_bytes(damage)
    with pytest.raises(InputError, match=r"times\.csv: .*; get it again from git"):
        shards.table(path, shards.TIMES)
    path.write_bytes(b"shard,model,protocol,seed,epochs,train_s\na,b,c,0,1,2\n")
    assert shards.table(path, shards.TIMES).to_dict("records")[0]["train_s"] == "2"
