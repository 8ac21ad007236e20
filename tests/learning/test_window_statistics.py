"""Columns that describe a window."""

import numpy as np

from pipeline.learning.window_statistics import Statistics


def test_a_window_that_does_not_change_has_its_reading_and_no_slope_nor_spread():
    columns = Statistics(4).transform(np.full((1, 4), 7.0))
    assert set(columns.ravel().tolist()) == {7.0, 0.0}
