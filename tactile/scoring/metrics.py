"""Score predictions: one function per experiment, of its name, from truth and prediction to rows of scores.csv."""

from collections.abc import Iterable, Mapping
from typing import NamedTuple

import numpy as np
from scipy import ndimage
from scipy.optimize import linear_sum_assignment

from tactile.datasets import labels
from tactile.datasets.series import Record

TIE_KPA = 0.01  # cells that differ by less are equally high: of labels up to 400 kPa in float32, none that tie do
CONTACT = 50.0  # percent: a cell of which at least half is touched is one that is touched
AWAY_MM = 9.6  # further from contact than the coarser of the two pitches, a map should be 0

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


def velostat_recorded(truth: np.ndarray, predicted: np.ndarray, settings: Mapping) -> list[Row]:
    """Return RMSE in N and R2 of force; truth, predicted: (n, 1) in N."""
    return overall(truth, predicted, "N")


def contact(truth: np.ndarray, predicted: np.ndarray, settings: Mapping) -> list[Row]:
    """Return scores of one run on maps of contact, of the frames of one condition.

    truth, predicted: (n, map_rows * map_cols) in percent of a cell, which is no pressure; settings: the block of
    params.yaml. A contact is what hangs together, over edges and corners, of cells that are touched by CONTACT or more.
    * rmse and r2: over all cells of all frames.
    * touches_found: share of frames whose predicted map has as many contacts as the true one, each over another one.
    * sum_ratio: sum of all predicted maps over that of the true ones.
    * away_rmse: rmse in cells further than AWAY_MM from any cell that is touched at all.
    """
    true_maps, maps, found, away = _contacts(truth, predicted, settings)
    squares = np.square(maps[away], dtype=np.float64)
    total = true_maps.sum(dtype=np.float64)
    rows = overall(truth, predicted, "% contact")
    rows.append(("touches_found", "1", float(np.mean(found)), len(found)))
    rows.append(("sum_ratio", "1", float(maps.sum(dtype=np.float64) / total) if total > 0 else float("nan"), len(maps)))
    rows.append(("away_rmse", "% contact", float(np.sqrt(squares.mean())) if len(squares) else float("nan"), len(maps)))
    return rows


def contact_by_frame(truth: np.ndarray, predicted: np.ndarray, settings: Mapping) -> dict[str, tuple]:
    """Return metric -> (share, of) of every frame, each (n,): a score of `contact` is sum of shares / sum of `of`.

    That of away_rmse is its square. Arguments: as there, without a failed run.
    """
    true_maps, maps, found, away = _contacts(truth, predicted, settings)

    def by_frame(cells: np.ndarray) -> np.ndarray:
        return cells.sum(axis=(1, 2), dtype=np.float64)

    return {
        "touches_found": (found.astype(float), np.ones(len(found))),
        "sum_ratio": (by_frame(maps), by_frame(true_maps)),
        "away_rmse": (by_frame(np.square(np.where(away, maps, 0), dtype=np.float64)), by_frame(away)),
    }


def _contacts(truth: np.ndarray, predicted: np.ndarray, settings: Mapping) -> tuple[np.ndarray, ...]:
    """Return both maps (n, rows, cols), whether their contacts are the same (n,), and which cells are away from any."""
    true_maps, maps = as_maps(truth, settings), as_maps(predicted, settings)
    found = [_same_contacts(*pair) for pair in zip(true_maps >= CONTACT, maps >= CONTACT, strict=True)]
    sensor, label = settings["sensor"], settings["label"]
    reach = [round(AWAY_MM * label[f"map_{side}"] / (sensor[side] * sensor["pitch_mm"])) for side in ("rows", "cols")]
    size = (1, *(2 * cells + 1 for cells in reach))
    return true_maps, maps, np.array(found), ndimage.maximum_filter(true_maps, size=size, mode="constant") == 0


def _same_contacts(truth: np.ndarray, predicted: np.ndarray) -> bool:
    """Tell whether two maps (rows, cols) bool have as many contacts, and each of the one lies over one of the other."""
    (true, count), (seen, number) = (ndimage.label(each, np.ones((3, 3))) for each in (truth, predicted))
    both = (true > 0) & (seen > 0)
    pairs = np.unique(np.stack([true[both], seen[both]]), axis=1)
    return count == number == pairs.shape[1] == len(np.unique(pairs[0])) == len(np.unique(pairs[1]))


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
        in_truth, in_guess = (np.array([values[half].mean(axis=0) for half in halves]) for values in (truth, guess))
        rows += _distances(in_truth, in_guess, outputs, "press_")
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


def touch(truth: np.ndarray, predicted: np.ndarray, settings: Mapping) -> list[Row]:
    """Return scores of one run on the windows of one condition.

    truth, predicted: (n, map_rows * map_cols) in kPa; settings: the block `touch` of params.yaml.
    * rmse: over all cells of all windows, as in the LoMP paper's Table I.
    * r2: share of the variance over all cells and windows that is explained.

    The others look at windows in contact alone. A touch is a peak of the label of at least touch_threshold_kpa: touches
    too close to make two peaks are one. A window of k touches is compared with the k highest peaks of the whole
    predicted map, paired so that the sum of their distances is least (`paired`).
    * location_error: mean distance from a touch to its peak in mm; n counts touches.
    * peak_error: mean |pressure of the peak - pressure of the touch|; where the peak is further away than one element
      pitch, the predicted pressure at the touch's place takes its place.
    * touches_found: share of windows whose predicted map has as many peaks of at least touch_threshold_kpa as there are
      touches, each within one pitch of its touch.
    * force_error: mean |integral of the predicted map over its area - that of the label| in N.
    """
    sensor, label = settings["sensor"], settings["label"]
    lowest, shape = touch_threshold_kpa(settings), (-1, label["map_rows"], label["map_cols"])
    rows = overall(truth, predicted, "kPa")
    contact = in_contact(truth, settings)
    true_maps, maps = truth[contact].reshape(shape), predicted[contact].reshape(shape)
    touches = peaks(true_maps, sensor)
    touches = touches.chosen(touches.kpa >= lowest)
    seen = peaks(maps, sensor)
    away, kpa = paired(touches, seen, len(maps))
    near = away <= sensor["pitch_mm"]
    under = maps[touches.window, touches.row, touches.col]
    off = np.abs(np.where(near, kpa, under) - touches.kpa)
    counts = [np.bincount(kind.window, minlength=len(maps)) for kind in (touches, seen.chosen(seen.kpa >= lowest))]
    right = (counts[0] == counts[1]) & (np.bincount(touches.window, ~near, len(maps)) == 0)
    force = np.abs(integral_n(maps - true_maps, sensor))
    further = (("peak_error", "kPa", off), ("location_error", "mm", away), ("touches_found", "1", right))
    for name, unit, values in (*further, ("force_error", "N", force)):
        rows.append((name, unit, float(values.mean()) if len(values) else float("nan"), len(values)))
    return rows


def in_contact(truth: np.ndarray, settings: Mapping) -> np.ndarray:
    """Return which of the true maps (n, cells) in kPa have a touch, (n,) bool; settings: the block `touch`."""
    return truth.max(axis=1, initial=0) >= touch_threshold_kpa(settings)


def force_gain(force_n: np.ndarray, maps: np.ndarray, settings: Mapping) -> float:
    """Return the factor from the integral of a model's maps to the force on the load cells, by least squares.

    force_n: (n,) in N, the sum of all touches, and maps: (n, map_rows * map_cols) in kPa, of the training part;
    settings: the block `touch` of params.yaml. What the integral of a map is worth depends on the tip, on the cells, on
    the edges and on how much of a peak a model shows: 2 on the paper's array for a perfect map, 0.5 on one element.
    NaN where the maps are NaN or 0 everywhere.
    """
    integral = integral_n(as_maps(maps, settings), settings["sensor"])
    squares = float(integral @ integral)
    return float(integral @ force_n) / squares if squares > 0 else float("nan")


def force(force_n: np.ndarray, maps: np.ndarray, gain: float, settings: Mapping) -> list[Row]:
    """Return scores of the force of maps in N against the load cells: force_rmse, force_r2, and the gain itself.

    force_n: (n,) in N, the sum of all touches; maps: (n, map_rows * map_cols) in kPa; gain: as `force_gain` fitted it.
    """
    if not len(maps):
        return [("force_rmse", "N", np.nan, 0), ("force_r2", "1", np.nan, 0), ("force_gain", "1", gain, 0)]
    predicted = gain * integral_n(as_maps(maps, settings), settings["sensor"])
    rows = overall(force_n, predicted, "N")
    return [*((f"force_{name}", unit, value, n) for name, unit, value, n in rows), ("force_gain", "1", gain, len(maps))]


def as_maps(maps: np.ndarray, settings: Mapping) -> np.ndarray:
    """Return flat maps (n, cells) as (n, map_rows, map_cols); settings: the block `touch` of params.yaml."""
    return maps.reshape(-1, settings["label"]["map_rows"], settings["label"]["map_cols"])


def integral_n(maps: np.ndarray, sensor: Mapping) -> np.ndarray:
    """Return the integral of maps (n, rows, cols) in kPa over the array's area, (n,) in N."""
    area_mm2 = sensor["rows"] * sensor["cols"] * sensor["pitch_mm"] ** 2
    return 1e-3 * area_mm2 / np.prod(maps.shape[1:]) * maps.sum(axis=(1, 2), dtype=np.float64)


def touch_threshold_kpa(settings: Mapping) -> float:
    """Return the pressure under the tip at touch.window.contact_threshold_n, in kPa: no lower peak is a touch."""
    return float(labels.pressure_kpa(settings["window"]["contact_threshold_n"], settings["label"]["tip_radius_mm"]))


class Peaks(NamedTuple):
    """The peaks of maps, one entry per peak, by window; a plateau of several cells is one peak."""

    window: np.ndarray  # number of the map
    row: np.ndarray  # the highest cell, the first of several that tie
    col: np.ndarray
    kpa: np.ndarray
    x_mm: np.ndarray  # place, see `vertex`
    y_mm: np.ndarray

    def chosen(self, which: np.ndarray) -> "Peaks":
        """Return the peaks that `which`, (peaks,) bool or numbers, names."""
        return Peaks(*(values[which] for values in self))


def peaks(maps: np.ndarray, sensor: Mapping) -> Peaks:
    """Return all peaks of maps (n, rows, cols) in kPa: cells, or plateaus of them, that are the largest of 5 x 5 cells.

    5 x 5: two touches closer than 3 cells (9 mm) would be one blob, their Gaussians having sigma = 1 cell. The ground
    of a map, its lowest cells, is no peak; a map without any other, which tells no place, has one in its middle.
    """
    _, rows, cols = maps.shape
    largest = ndimage.maximum_filter(maps, size=(1, 5, 5), mode="constant", cval=-np.inf)
    top = (maps >= largest - TIE_KPA) & (maps > maps.min(axis=(1, 2), keepdims=True) + TIE_KPA)
    top[~top.any(axis=(1, 2)), rows // 2, cols // 2] = True
    touching = np.zeros((3, 3, 3), bool)
    touching[1] = True  # over edges and corners, within a map
    plateau, _ = ndimage.label(top, touching)
    window, row, col = np.nonzero(top)
    order = np.argsort(-maps[window, row, col], kind="stable")
    _, first = np.unique(plateau[window, row, col][order], return_index=True)
    window, row, col = (cells[order[first]] for cells in (window, row, col))
    height, width = sensor["rows"] * sensor["pitch_mm"] / rows, sensor["cols"] * sensor["pitch_mm"] / cols
    x = (col + 0.5 + vertex(maps[window, row], col)) * width
    y = (row + 0.5 + vertex(maps[window, :, col], row)) * height
    return Peaks(window, row, col, maps[window, row, col], x, y)


def vertex(values: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Return how far beside cell `at` (n,) of `values` (n, cells) the peak lies, (n,) in cells, -0.5 to 0.5.

    It is the vertex of the parabola through the cell, which is the highest of the three, and its two neighbours: 0.5
    towards a neighbour that is as high, so that a touch between cells has its place there. 0 on the edge of the map.
    """
    inside = np.clip(at, 1, max(1, values.shape[1] - 2))
    n = np.arange(len(at))
    before, here, after = (values[n, np.clip(inside + k, 0, values.shape[1] - 1)] for k in (-1, 0, 1))
    bend = before - 2 * here + after
    curved = (bend < 0) & (inside == at)
    return np.where(curved, 0.5 * (before - after) / np.where(curved, bend, 1), 0.0)


def paired(touches: Peaks, seen: Peaks, windows: int) -> tuple[np.ndarray, np.ndarray]:
    """Return for each touch how far away its peak is (mm) and how high (kPa), both (touches,).

    Of the peaks `seen` in a window of k touches, the k highest are paired with the touches, each with another one, so
    that the sum of distances is least. Where there are fewer peaks, a touch without one takes the nearest.
    """
    away, kpa = np.zeros((2, len(touches.window)))
    seen = seen.chosen(np.lexsort((-seen.kpa, seen.window)))
    sizes, there = (np.bincount(kind.window, minlength=windows) for kind in (touches, seen))
    firsts = [np.cumsum(counts) - counts for counts in (sizes, there)]
    for k in np.unique(sizes[sizes > 0]):
        for most in np.unique(np.minimum(there[sizes == k], k)):
            of = np.flatnonzero((sizes == k) & (np.minimum(there, k) == most))
            touch, peak = (first[of, None] + np.arange(count) for first, count in zip(firsts, (k, most), strict=True))
            distance = np.hypot(
                touches.x_mm[touch][:, :, None] - seen.x_mm[peak][:, None],
                touches.y_mm[touch][:, :, None] - seen.y_mm[peak][:, None],
            )  # (windows, touches, peaks)
            best = distance.argmin(axis=2)
            for number in range(len(of) if most > 1 else 0):
                ones, others = linear_sum_assignment(distance[number])
                best[number, ones] = others
            away[touch] = np.take_along_axis(distance, best[:, :, None], 2)[:, :, 0]
            kpa[touch] = np.take_along_axis(seen.kpa[peak], best, 1)
    return away, kpa
