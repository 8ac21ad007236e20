"""Intervals hold the truth as often as they say, of groups that resemble one another too, or say that they cannot."""

import numpy as np
import pytest
from scipy import stats

from tactile.scoring import conformal


@pytest.mark.parametrize("n", [9, 10, 19, 57])
def test_the_bound_is_the_score_of_the_finite_sample_rank(n):
    scores = np.random.default_rng(n).random(n)
    rank = int(np.ceil(np.round((n + 1) * 0.9, 9)))
    assert conformal.quantile(scores) == np.sort(scores)[rank - 1]


def test_too_few_groups_cannot_tell_however_many_frames_they_have():
    errors, presses = np.ones(800), np.repeat(np.arange(8), 100)
    assert conformal.half_width(errors, presses) == np.inf
    assert conformal.half_width(np.append(errors, 1.0), np.append(presses, 8)) == 1.0
    assert conformal.class_threshold(np.full((8, 2), 0.5), np.zeros(8, int)) == 0.0


def presses(rng, count):
    """Return errors and groups of presses: one press misses by little, another by much, and they last unequally."""
    size = rng.integers(1, 30, count)
    groups = np.repeat(np.arange(count), size)
    return rng.lognormal(0, 1, count)[groups] * (1 + 0.1 * rng.standard_normal(len(groups))), groups


def test_groups_of_alike_frames_are_covered_as_promised():
    rng, covered = np.random.default_rng(0), []
    for _ in range(400):
        half = conformal.half_width(*presses(rng, 19))
        errors, groups = presses(rng, 40)
        covered.append(conformal.coverage(np.abs(errors) <= half, groups).share)
    assert 0.9 <= np.mean(covered) + 0.01 and np.mean(covered) < 0.95 + 0.01  # at most 1 / (n + 1) above


def test_normalised_intervals_grow_with_the_prediction():
    scale = conformal.root(np.linspace(0, 100, 200), 1.0)
    assert conformal.half_width(0.1 * scale, scale=scale) == pytest.approx(0.1)
    assert scale[0] == 1 and scale[-1] == pytest.approx(np.sqrt(101)) and conformal.root(np.array([-5.0]), 4.0) == [2.0]


def test_sets_hold_the_class_as_often_as_promised_and_are_never_empty():
    rng = np.random.default_rng(1)

    def held_out(count):
        logits = rng.standard_normal((count, 5))
        probabilities = np.exp(2 * logits) / np.exp(2 * logits).sum(axis=1, keepdims=True)
        return probabilities, np.array([rng.choice(5, p=row) for row in probabilities])

    probabilities, labels = held_out(2000)
    threshold = conformal.class_threshold(probabilities, labels)
    probabilities, labels = held_out(2000)
    sets = conformal.class_sets(probabilities, threshold)
    assert sets[np.arange(2000), labels].mean() == pytest.approx(0.9, abs=0.02)
    assert sets.sum(axis=1).mean() < 4
    assert conformal.class_sets(np.array([[0.3, 0.4, 0.3]]), 0.5).tolist() == [[False, True, False]]


def test_coverage_weighs_groups_equally_and_has_the_exact_interval():
    inside = np.array([True] * 90 + [False, True])
    found = conformal.coverage(inside, np.array([0] * 90 + [1, 1]))
    assert found.share == pytest.approx(0.75) and (found.groups, found.rows) == (2, 92)
    found = conformal.coverage(np.array([True] * 17 + [False] * 3))
    exact = stats.binomtest(17, 20).proportion_ci(0.95, "exact")
    assert (found.low, found.high) == pytest.approx((exact.low, exact.high))
    assert found.flagged and not conformal.coverage(np.array([True] * 9 + [False])).flagged
    assert conformal.coverage(np.ones(5, bool)).high == 1.0
    assert np.isnan(conformal.coverage(np.zeros(0, bool)).share)


def test_coverage_by_chance_lies_where_it_is_expected():
    rng, n, m = np.random.default_rng(2), 30, 50
    shares = []
    for _ in range(1000):
        half = conformal.half_width(rng.standard_normal(n))
        shares.append((np.abs(rng.standard_normal(m)) <= half).mean())
    low, high = conformal.expected(n, m)
    assert 0.93 < np.mean([low <= share <= high for share in shares]) < 0.99
    assert conformal.least() == 9 and conformal.expected(9, 1000)[0] < 0.75


def test_a_score_that_is_no_number_is_refused():
    with pytest.raises(ValueError, match="NaN"):
        conformal.quantile(np.array([1.0, np.nan]))
