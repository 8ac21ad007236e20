"""Labels: equation 1 of the LoMP paper."""

import numpy as np
import pyarrow as pa
import pytest
from builders.project import ROOT

from tactile.base import params
from tactile.base.errors import InputError
from tactile.datasets import labels, schemas
from tactile.experiments import touch


@pytest.fixture
def settings():
    return params.load(ROOT / "params.yaml")["touch"]


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


def test_the_largest_cell_of_a_single_touch_is_its_pressure(settings):
    """On cell centres, between cells, at the elements' centres, on the edge, and with a tip of half the size."""
    rng = np.random.default_rng(0)
    centres = labels.cell_centres(settings["sensor"], settings["label"])[0]
    places = np.concatenate([centres, centres[1:] - 1.5, 6.0 + 12 * np.arange(5), [0.0, 60.0], rng.uniform(0, 60, 200)])
    x, y, peak = rng.permutation(places), rng.permutation(places), rng.uniform(1, 400, len(places))
    for radius in (5.0, 2.5):
        label = settings["label"] | {"tip_radius_mm": radius}
        maps = labels.pressure_maps(peak[:, None], x[:, None], y[:, None], settings["sensor"], label)
        np.testing.assert_allclose(maps.max(axis=(1, 2)), peak, rtol=1e-6)


def test_cells_wider_than_the_tip_are_refused():
    """A mat of 20 mm pitch with a cell an element and a tip of 10 mm: the map has no peak that tells a place."""
    sensor, label = {"rows": 16, "cols": 8, "pitch_mm": 20.0}, {"tip_radius_mm": 5.0, "map_rows": 16, "map_cols": 16}
    with pytest.raises(InputError, match=r"touch\.label\.map_rows: cells of 20 mm are wider than the tip .*set 32 or"):
        labels.check_cells(sensor, label)
    labels.check_cells(sensor, label | {"map_rows": 32})
    with pytest.raises(InputError, match=r"map_cols: cells of 10 mm are wider than the tip \(8 mm"):
        labels.check_cells(sensor, label | {"map_rows": 48, "tip_radius_by_condition_mm": {"small": 4.0}})
    labels.check_cells({"rows": 1, "cols": 1, "pitch_mm": 20.0}, label | {"map_rows": 1, "map_cols": 1})


def test_each_touch_of_two_tips_has_the_label_of_its_own(settings):
    """By hand, eq. 1: force over the area of the tip that made it, spread by half its radius, whatever the order."""
    label = settings["label"] | {"tip_radius_mm": 5.0, "tip_radius_by_condition_mm": {"small": 2.5}}
    rng, names = np.random.default_rng(0), ["small", "single", "small", "double", "single"]
    centres = 1.5 + 3 * np.arange(20)
    force, (x, y) = rng.uniform(5, 40, (5, 2)), rng.choice(centres, (2, 5, 2))
    second = np.array(names) == "double"
    for values in (force, x, y):
        values[~second, 1] = np.nan
    columns = {
        name: schemas.lists(values, pa.float32()) for name, values in {"force_n": force, "x_mm": x, "y_mm": y}.items()
    }
    table = pa.table({"condition": pa.array(names).dictionary_encode(), **columns})
    found = touch.labels(table, settings | {"label": label}).reshape(5, 20, 20)
    for k, name in enumerate(names):
        radius, wanted = {"small": 2.5}.get(name, 5.0), np.zeros((20, 20))
        for force_n, x_mm, y_mm in zip(force[k], x[k], y[k], strict=True):
            if np.isfinite(force_n):
                away = (centres - x_mm)[None, :] ** 2 + (centres - y_mm)[:, None] ** 2
                peak = 1000 * force_n / (np.pi * radius**2)  # N / mm2 are MPa
                wanted += peak * np.exp(-away / (2 * (radius / 2) ** 2))
        np.testing.assert_allclose(found[k], wanted, rtol=1e-4, atol=1e-3, err_msg=name)
