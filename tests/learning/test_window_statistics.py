"""Columns that describe a window, and the penalty of ridge regression on them."""

import numpy as np
import pytest

from tactile.learning.window_statistics import PENALTIES, Statistics
from tactile.models.window_ridge import CrossValidated


def test_a_window_that_does_not_change_has_its_reading_and_no_slope_nor_spread():
    columns = Statistics(4).transform(np.full((1, 4), 7.0))
    assert set(columns.ravel().tolist()) == {7.0, 0.0}


def by_hand(x, y, part):
    """Return the penalty with the least squared error when each part in turn says nothing."""
    errors = dict.fromkeys(PENALTIES, 0.0)
    for penalty in PENALTIES:
        for one in np.unique(part):
            here = part == one
            mean, middle = x[~here].mean(axis=0), y[~here].mean(axis=0)
            design = x[~here] - mean
            slope = np.linalg.solve(design.T @ design + penalty * np.eye(x.shape[1]), design.T @ (y[~here] - middle))
            errors[penalty] += np.square((x[here] - mean) @ slope + middle - y[here]).sum()
    return min(errors, key=errors.get)


@pytest.mark.parametrize("shares", [False, True])
def test_consecutive_parts_choose_the_penalty(shares):
    """Neighbours resemble one another, so that parts of every fourth window would choose another penalty."""
    rng, n, parts = np.random.default_rng(3), 240, 4
    x = np.repeat(rng.normal(size=(n // 8, 20)), 8, axis=0) + 0.02 * rng.normal(size=(n, 20))
    seen = x[:, 0] + np.repeat(1.2 * rng.normal(size=n // 8), 8)
    place = np.arange(n)
    y = np.stack([seen, 0.5 * seen], axis=1)
    if shares:  # each part has some images of both objects, in their order
        y = np.eye(2)[(seen > 0).astype(int)]
        place = np.empty(n, int)
        for rows in (np.flatnonzero(y[:, 0]), np.flatnonzero(y[:, 1])):
            place[rows] = np.arange(len(rows)) * n // len(rows)
    wanted = by_hand(x, y, place * parts // n)
    assert PENALTIES[0] < wanted < PENALTIES[-1] and wanted != by_hand(x, y, place % parts)
    assert CrossValidated(parts, shares).fit(x, y).ridge_.alpha == wanted
