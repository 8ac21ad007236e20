"""Intervals over runs: inside the bounds of what they are of, and none where runs tell nothing of their spread."""

import numpy as np
import pytest

from pipeline.scoring import results


@pytest.mark.parametrize("values", [[0.99, 1.0, 0.97], [0.01, 0.0, 0.2], [0.5, 0.6, 0.55]])
def test_an_interval_of_shares_stays_between_0_and_1(values):
    found = results.estimate(values, results.SHARE)
    assert 0 < found.low < np.mean(values) < found.high < 1


def test_an_interval_of_r2_stays_below_1():
    found = results.estimate([0.9, 0.99, 0.7], results.R2)
    assert found.low < found.mean < found.high < 1


def test_runs_with_one_value_have_no_interval():
    for values, scale in (([2.0] * 5, results.PLAIN), ([0.5] * 5, results.SHARE), ([0.5], results.PLAIN)):
        assert np.isnan(results.estimate(values, scale)[1:3]).all()


def test_shares_at_a_bound_have_the_interval_of_so_many_trials():
    assert results.estimate([1.0] * 5, results.SHARE)[1:3] == pytest.approx((0.025**0.2, 1.0))
    assert results.estimate([0.0] * 5, results.SHARE)[1:3] == pytest.approx((0.0, 1 - 0.025**0.2))
    assert results.estimate([0.5, 0.5], results.SHARE, trials=20)[1:3] == pytest.approx((0.2720, 0.7280), abs=1e-4)
