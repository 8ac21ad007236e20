"""Compute the labels of touch: Gaussian pressure maps (LoMP paper, section III-A)."""

import math
from collections.abc import Mapping

import numpy as np
import pyarrow as pa

from tactile.base.errors import InputError
from tactile.datasets import schemas


def pressure_kpa(force_n: np.ndarray, tip_radius_mm: float | np.ndarray) -> np.ndarray:
    """Return the mean pressure under a flat tip of radius r, F / (pi r^2), in kPa; negative load-cell noise is 0."""
    return np.maximum(force_n, 0) / (np.pi * (tip_radius_mm * 1e-3) ** 2) / 1e3


def peaks_kpa(windows: pa.Table, settings: Mapping) -> np.ndarray:
    """Return each touch's true pressure at each window's last frame, (n, touches) in kPa, NaN where there is none."""
    return pressure_kpa(schemas.matrix(windows["force_n"]), tip_radius_mm(windows, settings["label"]))


def tip_radius_mm(windows: pa.Table, label: Mapping) -> float | np.ndarray:
    """Return the radius of the tip that made each of n windows, (n, 1) in mm; one number where all have the same."""
    if not (other := label.get("tip_radius_by_condition_mm")):
        return label["tip_radius_mm"]
    conditions, place = np.unique(schemas.names(windows["condition"]), return_inverse=True)
    return np.array([other.get(name, label["tip_radius_mm"]) for name in conditions])[place, None]


def cell_centres(sensor: Mapping, label: Mapping) -> tuple[np.ndarray, np.ndarray]:
    """Return x of the map's columns and y of its rows in mm; row 0 is the bottom row."""
    width, height = sensor["cols"] * sensor["pitch_mm"], sensor["rows"] * sensor["pitch_mm"]
    x = (np.arange(label["map_cols"]) + 0.5) * width / label["map_cols"]
    y = (np.arange(label["map_rows"]) + 0.5) * height / label["map_rows"]
    return x, y


def check_cells(sensor: Mapping, label: Mapping) -> None:
    """Raise InputError where the cells of a map are wider than a tip: the cell under it then says nothing of its place.

    A map of one cell, which tells no place, may be as wide as its element. sensor, label: blocks of `touch`.
    """
    if label["map_rows"] * label["map_cols"] == 1:
        return
    radii = [label["tip_radius_mm"], *label.get("tip_radius_by_condition_mm", {}).values()]
    width_mm = 2 * min(radii)
    for side in ("rows", "cols"):
        along_mm = sensor[side] * sensor["pitch_mm"]
        if (cell_mm := along_mm / label[f"map_{side}"]) > width_mm:
            least = sensor[side] * math.ceil(along_mm / width_mm / sensor[side])
            raise InputError(
                f"params/touch.yaml, touch.label.map_{side}: cells of {cell_mm:.3g} mm are wider than the tip "
                f"({width_mm:g} mm, touch.label.tip_radius_mm), so that maps have no peak to find; set {least} or more"
            )


def pressure_maps(
    peak_kpa: np.ndarray,
    x_mm: np.ndarray,
    y_mm: np.ndarray,
    sensor: Mapping,
    label: Mapping,
    tip_radius_mm: float | np.ndarray | None = None,
) -> np.ndarray:
    """Return pressure maps: per touch a Gaussian X of sigma = r/2 as P X / max(X), added up over the touches (eq. 1).

    peak_kpa, x_mm, y_mm: (n, touches), NaN where there is no such touch. Returns (n, map_rows, map_cols) in kPa,
    float32. max(X) is the largest cell of the touch's own map, so that this cell is exactly P wherever the touch lies.
    tip_radius_mm: of each map, (n, 1), or of all; None: that of `label`.
    """
    sigma = np.reshape(label["tip_radius_mm"] if tip_radius_mm is None else tip_radius_mm, (-1, 1, 1)) / 2
    absent = np.isnan(peak_kpa)
    factors = []  # a Gaussian is the product of one along x and one along y, and so is its largest cell
    for centres, place in zip(cell_centres(sensor, label), (x_mm, y_mm), strict=True):
        away = np.square(centres - np.where(absent, 0, place)[..., None])  # (n, touches, cells)
        factors.append(np.exp((away.min(axis=-1, keepdims=True) - away) / (2 * sigma**2)))
    across, along = factors
    along = along * np.where(absent, 0, peak_kpa)[..., None]
    return np.einsum("ntr,ntc->nrc", along, across).astype(np.float32)
