"""Metrics of known predictions."""

import numpy as np
import pytest
from builders.project import ROOT

from tactile.base import params
from tactile.datasets import labels, series
from tactile.scoring import metrics


@pytest.fixture
def settings():
    return params.load(ROOT / "params.yaml")["touch"]


def maps_of(settings, *touches):
    """Label maps (n, 400); touches: (kPa, x, y) per window, in as many lists as there are touches at once."""
    kpa, x, y = np.array(touches, float).transpose(2, 1, 0)
    return labels.pressure_maps(kpa, x, y, settings["sensor"], settings["label"]).reshape(len(kpa), -1)


def scores(truth, predicted, settings):
    return {name: (value, n) for name, _, value, n in metrics.touch(truth, predicted, settings)}


def test_touch_metrics_of_known_predictions(settings):
    truth = maps_of(settings, [(200, 31.5, 31.5), (100, 30.0, 30.0), (15, 4.5, 55.5), (0, 1.5, 1.5)])
    contact = 2  # 15 kPa are below the threshold of 1.2 N
    perfect = scores(truth, truth, settings)
    assert perfect["rmse"] == (0.0, 4) and perfect["r2"] == (1.0, 4)
    assert perfect["peak_error"] == perfect["location_error"] == perfect["force_error"] == (0.0, contact)
    assert perfect["touches_found"] == (1.0, contact)
    shifted = np.roll(truth.reshape(-1, 20, 20), 1, axis=2).reshape(truth.shape) / 2
    off = scores(truth, shifted, settings)
    assert off["location_error"][0] == pytest.approx(3.0)
    assert off["peak_error"][0] == pytest.approx((100 + 50) / 2)
    assert off["touches_found"][0] == 1.0
    # P pi r^2 / 2, but a touch between cells peaks beside its middle
    force_n = truth[:2].sum(axis=1) * 9e-3
    assert force_n[0] == pytest.approx(200e3 * np.pi * 5e-3**2 / 2, rel=0.01)
    assert off["force_error"][0] == pytest.approx(force_n.mean() / 2)
    assert off["rmse"][0] == pytest.approx(np.sqrt(np.mean((shifted - truth.astype(float)) ** 2)), rel=1e-6)


@pytest.mark.parametrize("share", [1.0, 0.4])
def test_the_gain_of_force_is_that_of_the_training_part(settings, share):
    """A model that shows a share of every peak still tells the force on the load cell, and another's gain does not."""
    pi_r2 = 1e-3 * np.pi * settings["label"]["tip_radius_mm"] ** 2  # kPa to N
    truth = maps_of(settings, *[[(kpa, 31.5, 31.5)] for kpa in (100,)])
    kpa = np.array([20.0, 50.0, 100.0, 300.0])
    maps = share * truth * kpa[:, None] / 100
    force_n = pi_r2 * kpa
    gain = metrics.force_gain(force_n[:2], maps[:2], settings)
    assert gain == pytest.approx(2.0 / share, rel=0.01), (
        "eq. 1: a Gaussian of sigma r / 2 holds half of the tip's force"
    )
    rows = {name: (unit, value, n) for name, unit, value, n in metrics.force(force_n, maps, gain, settings)}
    assert rows["force_rmse"] == ("N", pytest.approx(0.0, abs=1e-4), 4)
    assert rows["force_r2"][1] == pytest.approx(1.0) and rows["force_gain"][1] == gain
    wrong = {name: value for name, _, value, _ in metrics.force(force_n, maps, gain / 2, settings)}
    assert wrong["force_rmse"] == pytest.approx(np.sqrt(np.mean((force_n / 2) ** 2)), rel=1e-3)


def test_maps_of_nothing_have_no_gain(settings):
    for value in (0.0, np.nan):
        assert np.isnan(metrics.force_gain(np.ones(3), np.full((3, 400), value), settings))


def test_a_touch_is_searched_in_the_whole_map(settings):
    truth = maps_of(settings, [(100, 31.5, 31.5)])
    for away_mm, share in ((9.0, 1.0), (12.0, 1.0), (15.0, 0.0), (27.0, 0.0)):
        predicted = maps_of(settings, [(80, 31.5 + away_mm, 31.5)]) + 0.1 * truth
        off = scores(truth, predicted, settings)
        assert off["location_error"][0] == pytest.approx(away_mm, abs=0.02), "the highest peak of the map, however far"
        assert off["touches_found"][0] == share, "one peak, but not within a pitch of 12 mm"
        near = away_mm <= settings["sensor"]["pitch_mm"]
        expected = 100 - predicted.max() if near else 100 - predicted.reshape(20, 20)[10, 10]
        assert off["peak_error"][0] == pytest.approx(expected, rel=1e-5)


def test_peaks_are_paired_with_touches(settings):
    both = [(100, 10.5, 10.5)], [(200, 46.5, 46.5)]
    truth = maps_of(settings, *both)
    swapped = maps_of(settings, [(190, 13.5, 10.5)], [(110, 46.5, 40.5)])
    off = scores(truth, swapped, settings)
    assert off["location_error"] == (pytest.approx(4.5), 2) and off["peak_error"] == (pytest.approx(90), 2)
    assert off["touches_found"] == (1.0, 1)
    # Two peaks near one touch and none near the other: each peak has one touch, so one is far away.
    beside = maps_of(settings, [(100, 10.5, 10.5)], [(90, 10.5, 22.5)])
    off = scores(truth, beside, settings)
    assert off["location_error"][0] == pytest.approx(np.hypot(36, 24) / 2, abs=0.01) and off["touches_found"][0] == 0
    assert off["peak_error"][0] == pytest.approx(100, rel=1e-4), "nothing is predicted at the touch of 200 kPa"
    one = scores(truth, maps_of(settings, [(100, 10.5, 10.5)]), settings)
    assert one["touches_found"][0] == 0 and one["location_error"][0] == pytest.approx(np.hypot(36, 36) / 2)
    more = scores(truth, truth + maps_of(settings, [(50, 49.5, 10.5)]), settings)
    assert more["touches_found"][0] == 0 and more["location_error"][0] == 0


def test_a_failed_map_of_nan_is_scored_without_a_warning(settings):
    truth = maps_of(settings, [(100, 10.5, 10.5)])
    off = scores(truth, np.full_like(truth, np.nan), settings)
    assert np.isnan([off["rmse"][0], off["peak_error"][0], off["force_error"][0]]).all()
    assert off["touches_found"][0] == 0


def test_r2_is_the_share_of_the_variance_around_the_mean():
    truth = np.random.default_rng(0).uniform(50, 60, (40, 3)).astype(np.float32)
    for guess, r2 in (
        (truth, 1.0),
        (np.full_like(truth, truth.mean(dtype=float)), 0.0),
        (2 * truth.mean() - truth, -3.0),
    ):
        scored = {name: value for name, _, value, _ in metrics.overall(truth, guess, "kPa")}
        assert scored["r2"] == pytest.approx(r2, abs=1e-4)


def test_a_plateau_is_one_peak(settings):
    maps = np.zeros((4, 20, 20))
    maps[1, 5, 5] = 100
    maps[2, 5, 5], maps[2, 5, 6], maps[2, 14, 3], maps[2, 0, 19] = 100, 90, 50, 10
    maps[3, 5:7, 5:7] = 70
    maps[3, 12, 12], maps[3, 12, 15] = 60, 60  # 9 mm apart
    tops = metrics.peaks(maps, settings["sensor"])
    tops = tops.chosen(tops.kpa >= 15)
    assert np.bincount(tops.window, minlength=4).tolist() == [0, 1, 2, 3]
    plateau = tops.chosen(tops.kpa == 70)
    assert (plateau.x_mm, plateau.y_mm) == (18.0, 18.0), "the middle of its four cells"
    flat = metrics.peaks(np.full((1, 20, 20), 5.0), settings["sensor"])
    assert len(flat.window) == 1 and (flat.x_mm, flat.y_mm) == (31.5, 31.5)


def test_the_place_of_a_peak_is_known_between_cells(settings):
    """At a cell's centre, on a border, on the map's edge, and near the truth where a prediction nearly ties."""
    for x, place in ((31.5, 31.5), (30.0, 30.0), (1.5, 1.5), (58.5, 58.5)):
        maps = maps_of(settings, [(200, x, 16.5)]).reshape(-1, 20, 20)
        noise = np.random.default_rng(0).normal(0, 0.1, (50, 20, 20))
        for tried in (maps, maps + noise):
            tops = metrics.peaks(tried, settings["sensor"])
            tops = tops.chosen(tops.kpa > 15)
            assert len(tops.window) == len(tried)
            np.testing.assert_allclose(tops.x_mm, place, atol=0.02 if len(tried) > 1 else 1e-4)
            np.testing.assert_allclose(tops.y_mm, 16.5, atol=0.02)


def test_scores_of_known_predictions():
    truth = np.array([[0.0, 0.0], [3.0, 4.0], [6.0, 8.0], [9.0, 12.0]], np.float32)
    flags = np.ones(4, dtype=bool)
    rest = series.Record(np.zeros((4, 1)), truth, flags, flags, np.full(4, -1))
    scored = {name: value for name, _, value, _ in metrics.series(rest, truth + [3, 4], (0, 1))}
    assert scored["error"] == pytest.approx(5.0) and "press_error" not in scored
    assert scored["r2_x"] == pytest.approx(1 - 4 * 9 / np.square(truth[:, 0] - 4.5).sum())
    pressed = rest._replace(press=np.array([7, 7, 8, 8]), y=np.repeat(truth[[0, 2]], 2, axis=0))
    guess = pressed.y + np.array([[99, 99], [3, 4], [99, 99], [3, 4]])  # only the second half of a press counts
    scored = {name: (value, n) for name, _, value, n in metrics.series(pressed, guess, (0, 1))}
    assert scored["press_error"] == (pytest.approx(5.0), 2)
    depth = rest._replace(y=truth[:, :1])
    single = {name: value for name, _, value, _ in metrics.series(depth, depth.y - 2, (2,))}
    assert single["error"] == pytest.approx(2.0) and "r2_z" in single
