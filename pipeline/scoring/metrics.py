"""Score predictions: one function per experiment, of its name, from truth and prediction to rows of scores.csv."""

from collections.abc import Iterable, Mapping

import numpy as np
import pyarrow as pa
from scipy.ndimage import maximum_filter

from pipeline.datasets import labels, schemas
from pipeline.datasets.series import Record

LOWEST_PEAK_KPA = 15.0  # half the smallest peak pressure of the data: a lower peak does not count as a touch
POOLED = {"velostat_recorded": ("all",)}  # experiment -> name of all test windows of a run together

Row = tuple[str, str, float, int]  # metric, unit, value, number of windows or touches


def unless_failed(rows: Iterable[Row], failed: bool) -> list[Row]:
    """Return rows of scores, with NaN as value where training diverged before any usable epoch (`failed`)."""
    return [(metric, unit, float("nan") if failed else value, n) for metric, unit, value, n in rows]


def overall(truth: np.ndarray, predicted: np.ndarray, unit: str) -> list[Row]:
    """Return RMSE and R2 over all outputs of all windows; truth, predicted: (n, outputs) in `unit`."""
    error = predicted.astype(np.float64) - truth
    total = np.square(truth - truth.mean(dtype=np.float64), dtype=np.float64).sum()
    r2 = float(1 - np.square(error).sum() / total) if total > 0 else float("nan")
    return [("rmse", unit, float(np.sqrt(np.mean(np.square(error)))), len(truth)), ("r2", "1", r2, len(truth))]


def velostat_recorded(windows: pa.Table, truth: np.ndarray, predicted: np.ndarray, settings: Mapping) -> list[Row]:
    """Return RMSE in N and R2 of force; truth, predicted: (n, 1) in N."""
    return overall(truth, predicted, "N")


def series(record: Record, predicted: np.ndarray, outputs: tuple[int, ...]) -> list[Row]:
    """Return scores of one run on the test samples of one recording; record: T samples, predicted: (T, outputs) in mm.

    * error: mean absolute error for one output, mean Euclidean distance for more (latent-space paper, Table I).
    * r2, and r2_x, r2_y, r2_z: share of variance explained, for all outputs together and for each.
    * press_error, press_r2_x, ...: the same per press, predicted as the mean over the second half of the press's
      samples; only where presses are known.
    """
    counted = record.counted
    truth, guess, press = record.y[counted].astype(np.float64), predicted[counted].astype(np.float64), record.press
    rows = _distances(truth, guess, outputs, "")
    press = press[counted]
    if (press >= 0).all() and len(press):
        numbers, first, size = np.unique(press, return_index=True, return_counts=True)
        halves = [slice(start + count // 2, start + count) for start, count in zip(first, size, strict=True)]
        means = [np.array([values[half].mean(axis=0) for half in halves]) for values in (truth, guess)]
        rows += _distances(*means, outputs, "press_")
    return rows


def _distances(truth: np.ndarray, guess: np.ndarray, outputs: tuple[int, ...], prefix: str) -> list[Row]:
    """Return error and R2 of positions (n, outputs) in mm; `prefix` starts the names of the metrics."""
    error = guess - truth
    distance = np.abs(error[:, 0]) if len(outputs) == 1 else np.linalg.norm(error, axis=1)
    spread = np.square(truth - truth.mean(axis=0)).sum(axis=0)
    missed = np.square(error).sum(axis=0)
    explained = {"r2": (missed.sum(), spread.sum())}
    explained |= {f"r2_{'xyz'[column]}": (missed[k], spread[k]) for k, column in enumerate(outputs)}
    rows = [("error", "mm", float(distance.mean()))]
    rows += [(name, "1", float(1 - off / of) if of else float("nan")) for name, (off, of) in explained.items()]
    return [(prefix + name, unit, value, len(truth)) for name, unit, value in rows]


def touch(windows: pa.Table, truth: np.ndarray, predicted: np.ndarray, settings: Mapping) -> list[Row]:
    """Return scores of one run on the windows of one condition.

    truth, predicted: (n, map_rows * map_cols) in kPa.
    * rmse: over all cells of all windows, as in the LoMP paper's Table I.
    * r2: share of the variance over all cells and windows that is explained.
    * peak_error: mean over touches of |largest predicted value near the touch - true pressure|; near = within
      one element pitch; n counts touches above touch.window.contact_threshold_n.
    * location_error: mean distance from a touch to the centre of the largest predicted cell near it.
    * touches_found: share of windows in contact whose predicted map has as many peaks as there are touches.
    """
    sensor, label = settings["sensor"], settings["label"]
    shape = (label["map_rows"], label["map_cols"])
    rows = overall(truth, predicted, "kPa")
    peak = labels.peaks_kpa(windows, settings)
    force, x, y = (schemas.matrix(windows[name]) for name in ("force_n", "x_mm", "y_mm"))
    touched = np.nan_to_num(force) > settings["window"]["contact_threshold_n"]
    centre_x, centre_y = labels.cell_centres(sensor, label)
    maps = predicted.reshape(-1, *shape)
    window, touch = np.nonzero(touched)
    away = np.hypot(
        centre_x[None, None, :] - x[window, touch][:, None, None],
        centre_y[None, :, None] - y[window, touch][:, None, None],
    )  # (touches, map_rows, map_cols)
    near = np.where(away <= sensor["pitch_mm"], maps[window], -np.inf).reshape(len(window), -1)
    largest = near.argmax(axis=1)
    picked = np.arange(len(window))
    missing = float("nan")
    rows.append(
        (
            "peak_error",
            "kPa",
            float(np.mean(np.abs(near[picked, largest] - peak[window, touch]))) if len(window) else missing,
            len(window),
        )
    )
    distance = away.reshape(len(window), -1)[picked, largest]
    rows.append(("location_error", "mm", float(np.mean(distance)) if len(window) else missing, len(window)))
    in_contact = touched.any(axis=1)
    right = peak_count(maps[in_contact], LOWEST_PEAK_KPA) == touched[in_contact].sum(axis=1)
    rows.append(("touches_found", "1", float(np.mean(right)) if len(right) else missing, int(in_contact.sum())))
    return rows


def peak_count(maps: np.ndarray, lowest: float) -> np.ndarray:
    """Return (n,): the number of cells of maps (n, rows, cols) that are at least `lowest` and the largest of 5 x 5.

    5 x 5: two touches closer than 3 cells (9 mm) would be one blob, their Gaussians having sigma = 1 cell.
    """
    return ((maps == maximum_filter(maps, size=(1, 5, 5), mode="constant", cval=-np.inf)) & (maps >= lowest)).sum(
        axis=(1, 2)
    )
