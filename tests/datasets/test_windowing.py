"""Windows, labels, splits and metrics."""

import numpy as np
import pyarrow as pa
import pytest

from pipeline.base import params
from pipeline.base.errors import InputError
from pipeline.datasets import labels, schemas
from pipeline.datasets.windowing import presses, window_rows, windows_of
from pipeline.experiments import touch, velostat_recorded
from pipeline.scoring import metrics


@pytest.fixture
def settings():
    return params.load()["touch"]


def frames(force: np.ndarray, x: float = 30.0, y: float = 30.0, gap_at: int | None = None) -> pa.Table:
    """Frames of one recording at 50 Hz in which element 12 reads ten counts a newton."""
    n = len(force)
    t_s = np.arange(n) / 50
    if gap_at:
        t_s[gap_at:] += 0.1
    v = np.full((n, 25), 20)
    v[:, 12] += (10 * force).astype(int)
    schema = schemas.frames(25, 2, pa.int16())
    place = np.full((n, 1), x), np.full((n, 1), y)
    zero = np.zeros(n, dtype=int)
    return schemas.frame_rows(
        schema, "single", "run", segment=zero, t_s=t_s, v=v, force_n=force[:, None], x_mm=place[0], y_mm=place[1]
    )


def press_force(count: int, steps: int = 40) -> np.ndarray:
    one = np.concatenate([np.zeros(15), np.full(steps - 30, 8.0), np.zeros(15)])
    return np.tile(one, count)


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


def test_pressure_map_is_equation_one(settings):
    sensor, label = settings["sensor"], settings["label"]
    peak, x, y = np.array([[200.0, np.nan]]), np.array([[31.5, np.nan]]), np.array([[13.5, np.nan]])
    (found,) = labels.pressure_maps(peak, x, y, sensor, label)
    assert found.shape == (20, 20) and np.unravel_index(found.argmax(), found.shape) == (4, 10)
    assert found.max() == pytest.approx(200.0)
    sigma = label["tip_radius_mm"] / 2
    assert found[4, 12] == pytest.approx(200 * np.exp(-(6.0**2) / (2 * sigma**2)), rel=1e-5)
    two = labels.pressure_maps(
        np.array([[200.0, 90.0]]), np.array([[31.5, 4.5]]), np.array([[13.5, 49.5]]), sensor, label
    )
    alone = labels.pressure_maps(np.array([[90.0]]), np.array([[4.5]]), np.array([[49.5]]), sensor, label)
    np.testing.assert_allclose(two[0], found + alone[0], rtol=1e-6)


def test_split_is_eight_one_one_by_press_and_changes_with_the_seed(settings):
    table = windows_of(frames(press_force(40)), {"frames": 8, "frame_step": 1, "stride": 4, "contact_threshold_n": 0.5})
    parts = [touch.split(table, settings, "press", seed) for seed in (0, 0, 1)]
    assert (parts[0] == parts[1]).all() and (parts[0] != parts[2]).any()
    press = table["press"].to_numpy()
    sizes = {name: len(set(press[parts[0] == name])) for name in ("train", "validation", "test")}
    assert sizes == {"train": 32, "validation": 4, "test": 4}
    assert sum(sizes.values()) == len(set(press))


@pytest.mark.parametrize("protocol", ["press", "random_window"])
def test_only_single_touches_are_trained_on(settings, protocol):
    conditions = ["single"] * 40 + ["double"] * 20 + ["slide", "three", "tape"] * 10
    windows = pa.table(
        {
            "condition": pa.array(conditions).dictionary_encode(),
            "press": pa.array(np.arange(len(conditions), dtype=np.int32)),
        }
    )
    part = touch.split(windows, settings, protocol, 0)
    assert (part[40:] == "test").all()
    assert [int((part == name).sum()) for name in ("train", "validation", "test")] == [32, 4, 54]


def test_recorded_split_tests_on_the_other_repetition():
    windows = pa.table(
        {"recording": ["a/exp1"] * 10 + ["a/exp2"] * 4, "press": np.repeat(np.arange(7), 2).astype(np.int32)}
    )
    part = velostat_recorded.split(windows, {"split": {"validation": 0.2}}, "repetition", 0)
    assert part.tolist() == ["train"] * 8 + ["validation"] * 2 + ["test"] * 4


def test_recorded_split_of_one_recording_leaves_the_others_unused():
    windows = pa.table(
        {
            "condition": pa.array(["a"] * 6 + ["b"] * 6).dictionary_encode(),
            "recording": ["a/exp1"] * 4 + ["a/exp2"] * 2 + ["b/exp1"] * 4 + ["b/exp2"] * 2,
            "press": np.repeat(np.arange(6), 2).astype(np.int32),
        }
    )
    settings = {"split": {"validation": 0.5}}
    part = velostat_recorded.split(windows, settings, "b", 0)
    assert part.tolist() == ["unused"] * 6 + ["train"] * 2 + ["validation"] * 2 + ["test"] * 2
    with pytest.raises(InputError, match="no recording 'c'; there are a, b"):
        velostat_recorded.split(windows, settings, "c", 0)


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
