"""A perfect prediction has the perfect score, by every metric of every experiment."""

import numpy as np
import pytest
from builders.project import ROOT

from tactile import experiments
from tactile.base import params
from tactile.datasets import labels, series
from tactile.scoring import classification, metrics

VALUES = params.load(ROOT / "params.yaml")
# A metric that is not here has no test: add the value that the truth must have.
PERFECT = {"rmse": 0.0, "error": 0.0, "peak_error": 0.0, "location_error": 0.0, "force_error": 0.0}
PERFECT |= {"touches_found": 1.0, "accuracy": 1.0, "macro_precision": 1.0}
PERFECT |= {f"{press}{name}": 1.0 for press in ("", "press_") for name in ("r2", "r2_x", "r2_y", "r2_z")}
PERFECT |= {"sum_ratio": 1.0, "away_rmse": 0.0}
PERFECT |= {"press_error": 0.0, "force_rmse": 0.0, "force_r2": 1.0}


def check(rows) -> set[str]:
    """Compare rows (metric, unit, value, n) with PERFECT; return their names."""
    for name, _, value, n in rows:
        assert value == PERFECT[name] and n > 0, (name, value, n)
    return {row[0] for row in rows}


def touch_maps(settings, touches: int) -> np.ndarray:
    """Labels of touches on cell centres, between cells, on elements' centres and anywhere, far and near, and none."""
    rng = np.random.default_rng(touches)
    spots = [1.5 + 3 * np.arange(20), 3.0 * np.arange(1, 20), 6.0 + 12 * np.arange(5), rng.uniform(0, 60, 40)]
    spots = np.concatenate(spots)
    n = 3000
    x, y = rng.choice(spots, (2, n, touches))
    kpa = rng.uniform(0, 400, (n, touches))
    kpa[: n // 4] = kpa[: n // 4, :1]  # as hard as each other
    x[n // 2 : n // 2 + 300] = x[n // 2 : n // 2 + 300, :1] + 7.2 * np.arange(touches)  # neighbours, as in the tape
    y[n // 2 : n // 2 + 300] = y[n // 2 : n // 2 + 300, :1]
    return labels.pressure_maps(kpa, x, y, settings["sensor"], settings["label"]).reshape(n, -1)


@pytest.mark.parametrize("touches", [1, 2, 3, 5])
def test_touch(touches):
    settings = VALUES["touch"]
    truth = touch_maps(settings, touches)
    expected = {"rmse", "r2", "peak_error", "location_error", "touches_found", "force_error"}
    assert check(metrics.touch(truth, truth, settings)) == expected
    wrong = {row[0]: row[2] for row in metrics.touch(truth, np.roll(truth, 7, axis=0), settings)}
    assert all(wrong[name] != PERFECT[name] for name in expected)


def test_force_of_maps():
    settings = VALUES["touch"]
    maps = touch_maps(settings, 2)
    force_n = 1.8 * metrics.integral_n(metrics.as_maps(maps, settings), settings["sensor"])
    *rows, gain = metrics.force(force_n, maps, 1.8, settings)
    assert check(rows) == {"force_rmse", "force_r2"} and gain[0] == "force_gain"


def test_touch_of_another_array():
    sensor = {"rows": 3, "cols": 6, "pitch_mm": 4.0, "element_mm": 3.5}
    label = {"tip_radius_mm": 1.5, "map_rows": 12, "map_cols": 24}
    settings = VALUES["touch"] | {"sensor": sensor, "label": label}
    settings |= {"window": settings["window"] | {"contact_threshold_n": 0.1}}
    rng = np.random.default_rng(0)
    x, y = rng.uniform(0, 24, (500, 2)), rng.uniform(0, 12, (500, 2))
    truth = labels.pressure_maps(rng.uniform(0, 400, (500, 2)), x, y, sensor, label).reshape(500, -1)
    check(metrics.touch(truth, truth, settings))


def test_velostat_recorded():
    truth = np.random.default_rng(0).uniform(0, 50, (100, 1)).astype(np.float32)
    score = getattr(metrics, experiments.module("velostat_recorded").SCORES)
    assert check(score(truth, truth, VALUES["velostat_recorded"])) == {"rmse", "r2"}


@pytest.mark.parametrize("contacts", [1, 2, 3])
def test_contact(contacts):
    """Discs of any size and place, in pieces where they overlap the edge, and as wide as the whole map."""
    settings, rng = VALUES["array_recorded"], np.random.default_rng(contacts)
    row, col = np.mgrid[:160, :160]
    maps = []
    for _ in range(300):
        place, radius = rng.uniform(0, 160, (2, contacts)), rng.uniform(6, 14, contacts)
        mask = np.zeros((160, 160), bool)
        for y, x, r in zip(*place, radius, strict=True):
            mask |= (row - y) ** 2 + (col - x) ** 2 <= r**2
        maps.append(100 * mask.reshape(20, 8, 20, 8).mean(axis=(1, 3)).ravel())
    truth = np.array(maps, np.float32)
    expected = {"rmse", "r2", "touches_found", "sum_ratio", "away_rmse"}
    assert check(metrics.contact(truth, truth, settings)) == expected
    wrong = {row[0]: row[2] for row in metrics.contact(truth, np.roll(truth, 7, axis=0) / 2, settings)}
    assert all(wrong[name] != PERFECT[name] for name in expected)


@pytest.mark.parametrize("outputs", [(0, 1), (2,), (0, 1, 2)])
@pytest.mark.parametrize("press", [-1, 3])
def test_strain(outputs, press):
    """Simulated fingers have no presses that are known (-1), recorded ones have."""
    truth = np.random.default_rng(0).normal(0, 20, (60, len(outputs))).astype(np.float32)
    flags = np.ones(60, bool)
    numbers = np.full(60, -1) if press < 0 else np.arange(60) // 6
    record = series.Record(np.zeros((60, 6)), truth, flags, flags, numbers)
    found = check(metrics.series(record, truth, outputs))
    axes = {f"r2_{'xyz'[column]}" for column in outputs}
    once = {"error", "r2"} | axes
    assert found == (once if press < 0 else once | {f"press_{name}" for name in once})


def test_glove():
    truth = np.eye(16, dtype=np.float32)[np.random.default_rng(0).permutation(np.repeat(np.arange(16), 5))]
    assert check(classification.scores(truth, truth)) == {"accuracy", "macro_precision"}


@pytest.mark.parametrize("experiment", VALUES["experiments"])
def test_every_experiment_has_its_metrics_here(experiment):
    module = experiments.module(experiment)
    assert module.KIND in ("series", "images") or module.SCORES in ("touch", "velostat_recorded", "contact")
