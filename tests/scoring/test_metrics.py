"""Metrics of known predictions."""

import numpy as np
import pytest
from builders.press_frames import frames, press_force

from pipeline.base import params
from pipeline.datasets import schemas, series
from pipeline.datasets.windowing import windows_of
from pipeline.experiments import touch
from pipeline.scoring import metrics


@pytest.fixture
def settings():
    return params.load()["touch"]


def test_touch_metrics_of_known_predictions(settings):
    table = windows_of(
        frames(press_force(2), x=31.5, y=31.5), {"frames": 8, "frame_step": 1, "stride": 8, "contact_threshold_n": 0.5}
    )
    truth = touch.labels(table, settings)
    perfect = {name: (value, n) for name, _, value, n in metrics.touch(table, truth, truth, settings)}
    pressed = int((schemas.matrix(table["force_n"])[:, 0] > 0.5).sum())
    assert perfect["rmse"] == (0.0, len(truth)) and perfect["r2"][0] == 1.0
    assert perfect["peak_error"][0] == pytest.approx(0, abs=1e-3) and perfect["peak_error"][1] == pressed
    assert perfect["location_error"][0] == pytest.approx(0, abs=1e-6) and perfect["touches_found"] == (1.0, pressed)
    shifted = np.roll(truth.reshape(-1, 20, 20), 1, axis=2).reshape(truth.shape) / 2
    off = {name: value for name, _, value, _ in metrics.touch(table, truth, shifted, settings)}
    assert off["location_error"] == pytest.approx(3.0)
    assert off["peak_error"] == pytest.approx(truth.max() / 2, rel=1e-3)
    assert off["rmse"] == pytest.approx(np.sqrt(np.mean((shifted - truth.astype(float)) ** 2)), rel=1e-6)


@pytest.mark.parametrize(("away_mm", "found_mm"), [(9.0, 9.0), (12.0, 12.0), (15.0, 3.0)])
def test_a_touch_is_searched_within_one_pitch_of_its_place(settings, away_mm, found_mm):
    """A map of two peaks: 3 mm from the touch, and a larger one further away, which counts as far as one pitch."""
    assert settings["sensor"]["pitch_mm"] == 12.0
    table = windows_of(
        frames(press_force(1), x=31.5, y=31.5), {"frames": 8, "frame_step": 1, "stride": 1, "contact_threshold_n": 0.5}
    )
    truth = touch.labels(table, settings)
    maps = np.zeros((len(truth), 20, 20), np.float32)
    maps[:, 10, 11], maps[:, 10, 10 + round(away_mm / 3)] = 40.0, 50.0
    found = {name: value for name, _, value, _ in metrics.touch(table, truth, maps.reshape(truth.shape), settings)}
    assert found["location_error"] == pytest.approx(found_mm)


def test_r2_is_the_share_of_the_variance_around_the_mean():
    truth = np.random.default_rng(0).uniform(50, 60, (40, 3)).astype(np.float32)
    for guess, r2 in (
        (truth, 1.0),
        (np.full_like(truth, truth.mean(dtype=float)), 0.0),
        (2 * truth.mean() - truth, -3.0),
    ):
        found = {name: value for name, _, value, _ in metrics.overall(truth, guess, "kPa")}
        assert found["r2"] == pytest.approx(r2, abs=1e-4)


def test_peaks_are_counted():
    maps = np.zeros((3, 20, 20))
    maps[1, 5, 5] = 100
    maps[2, 5, 5], maps[2, 5, 6], maps[2, 14, 3], maps[2, 0, 19] = 100, 90, 50, 10
    assert metrics.peak_count(maps, 15.0).tolist() == [0, 1, 2]


def test_scores_of_known_predictions():
    truth = np.array([[0.0, 0.0], [3.0, 4.0], [6.0, 8.0], [9.0, 12.0]], np.float32)
    flags = np.ones(4, dtype=bool)
    rest = series.Record(np.zeros((4, 1)), truth, flags, flags, np.full(4, -1))
    found = {name: value for name, _, value, _ in metrics.series(rest, truth + [3, 4], (0, 1))}
    assert found["error"] == pytest.approx(5.0) and "press_error" not in found
    assert found["r2_x"] == pytest.approx(1 - 4 * 9 / np.square(truth[:, 0] - 4.5).sum())
    pressed = rest._replace(press=np.array([7, 7, 8, 8]), y=np.repeat(truth[[0, 2]], 2, axis=0))
    guess = pressed.y + np.array([[99, 99], [3, 4], [99, 99], [3, 4]])  # only the second half of a press counts
    found = {name: (value, n) for name, _, value, n in metrics.series(pressed, guess, (0, 1))}
    assert found["press_error"] == (pytest.approx(5.0), 2)
    depth = rest._replace(y=truth[:, :1])
    single = {name: value for name, _, value, _ in metrics.series(depth, depth.y - 2, (2,))}
    assert single["error"] == pytest.approx(2.0) and "r2_z" in single
