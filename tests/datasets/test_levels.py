"""Levels of readings in training, by which faults are measured."""

from types import SimpleNamespace

import numpy as np
import pyarrow as pa
import pytest

from tactile.datasets import levels, schemas, series


def test_windows_have_the_range_of_the_adc_or_of_what_was_read():
    x = np.arange(24, dtype=np.float32).reshape(4, 3, 2) + 100
    rows = pa.table({"force_n": schemas.lists(np.array([[0.0], [9.0], [0.1], [9.0]]), pa.float64())})
    data, train = SimpleNamespace(x=x, rows=rows), np.array([True, True, True, False])
    settings = {"ingest": {"highest_count": 4095}, "window": {"contact_threshold_n": 0.5}}
    found = levels.of_windows(settings, data, train)
    assert found[:1] + found[2:6] == (4095.0, 0.0, 0.0, 4095.0, True)
    np.testing.assert_array_equal(found.rest, np.median(x[[0, 2]], axis=(0, 1)))  # of windows without a touch
    read = levels.of_windows(settings | {"ingest": {}}, data, train)
    assert read[:1] + read[2:6] == (17.0, 100.0, 100.0, 117.0, False)


@pytest.mark.parametrize(
    ("settings", "low"),
    [
        ({"source": "simulated", "simulate": {"circuit": {"supply_v": 5.0}}}, 5.0),
        ({}, 3.15),  # the recorded fingers
        ({"source": "data/own/finger", "simulate": {"circuit": {"supply_v": 5.0}}}, 42.0),
    ],
)
def test_a_strand_that_is_dead_reads_the_supply_or_the_highest_of_all(settings, low):
    x = np.array([[1.0, 40], [2, 42], [3, 41], [9, 99]], np.float32)
    training, press = np.array([True, True, True, False]), np.array([-1, 0, -1, -1])
    record = series.Record(x, x, training, training, press)
    found = levels.of_series([record], settings)
    assert (found.low, found.lowest, found.highest) == (low, 0.0, 42.0)
    np.testing.assert_array_equal(found.span, [2, 2])
    np.testing.assert_array_equal(found.rest, [2, 40.5])  # outside the press
    always = record._replace(press=np.zeros(4, int))
    np.testing.assert_array_equal(levels.of_series([always], settings).rest, [2, 41])
    millivolt = found.times(1e3)
    assert millivolt.low == 1e3 * low and millivolt.whole is False and millivolt.wired is True


def test_areas_stand_side_by_side():
    cells = np.array([[0, 3, 5], [0, 4, 9]])
    one, two = levels.of_area(cells, 0, 1023, True), levels.of_area(cells[:, :2] - 4.0, -10, 10, False)
    both = levels.side_by_side([one, two])
    assert both.span.tolist() == [9, 9, 9, 4, 4] and both.wired.tolist() == [False, True, True, True, True]
    assert both.whole.tolist() == [True] * 3 + [False] * 2 and both.highest.tolist() == [1023] * 3 + [10] * 2
    assert both.lowest.tolist() == [0] * 3 + [-10] * 2 and not both.low.any()
