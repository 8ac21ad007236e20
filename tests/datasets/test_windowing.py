"""Presses and windows: where they begin and end."""

import numpy as np
from builders.press_frames import frames, press_force

from tactile.datasets import schemas
from tactile.datasets.windowing import presses, previous_windows, window_rows, windows_of


def test_presses_are_cut_in_the_middle_of_the_rest():
    force = press_force(3)
    found = presses(force, np.arange(len(force)) / 50, 0.5)
    assert found.max() == 2
    np.testing.assert_array_equal(np.bincount(found), [40, 40, 40])


def test_a_bounce_does_not_make_a_press():
    force = np.concatenate([np.zeros(20), np.full(10, 5.0), np.zeros(3), np.full(10, 5.0), np.zeros(20)])
    assert presses(force, np.arange(len(force)) / 50, 0.5).max() == 0


def test_windows_never_cross_a_gap_or_a_press():
    table = frames(press_force(2), gap_at=20)
    found = windows_of(table, {"frames": 8, "frame_step": 1, "stride": 3, "contact_threshold_n": 0.5})
    ends = np.round(found["t_s"].to_numpy() * 50).astype(int)
    # runs of frames: 0-19, 20-39 (5 later for the gap), 40-79 (also)
    assert ends.tolist() == [*range(7, 20, 3), *range(32, 45, 3), *range(52, 85, 3)]
    assert found["press"].to_pylist() == [0] * 10 + [1] * 11
    x = schemas.matrix(found["x"]).reshape(len(found), 8, 25)
    np.testing.assert_array_equal(x[0, :, 12], schemas.matrix(table["v"])[:8, 12])


def test_frame_step_spreads_a_window():
    rows = window_rows(np.zeros(30, int), frames=4, frame_step=3, stride=5)
    assert rows[0].tolist() == [0, 3, 6, 9] and rows[1, 0] == 5 and rows.max() <= 29


def test_a_window_goes_on_from_the_one_that_ends_before_it():
    run = np.repeat([0, 1, 2], [12, 9, 5])  # 26 frames
    rows = window_rows(run, frames=4, frame_step=1, stride=4)
    assert rows[:, 0].tolist() == [0, 4, 8, 12, 16, 21]
    assert previous_windows(rows, run, 1).tolist() == [-1, 0, 1, -1, 3, -1]
    rows = window_rows(run, frames=4, frame_step=1, stride=2)  # two streams, one two frames behind
    assert rows[:, 0].tolist() == [0, 2, 4, 6, 8, 12, 14, 16, 21]
    assert previous_windows(rows, run, 1).tolist() == [-1, -1, 0, 1, 2, -1, -1, 5, -1]
    rows = window_rows(run, frames=2, frame_step=3, stride=6)
    assert rows.tolist() == [[0, 3], [6, 9], [12, 15], [21, 24]]
    assert previous_windows(rows, run, 3).tolist() == [-1, 0, -1, -1]
