"""Gather the touches that the page's viewer plays: readings, labels and predictions of a few windows in a row.

Values are bytes, 0 to 255 of a largest value that stands beside them: a step of 0.4 %, which the eye does not see.
"""

import base64
from collections.abc import Mapping

import numpy as np

from pipeline.reporting.figures.touch import MAP_NAMES, Windows
from pipeline.reporting.words.labels import model_name

MODELS = ("linear", "cnn", "convlstm", "lomp")
MOST = 15  # windows of a touch


def played(windows: Windows) -> dict[str, np.ndarray]:
    """Choose windows: name of a condition -> up to MOST in a row of one recording, around the one pressed hardest."""
    total = np.nansum(windows.force_n, axis=1)
    chosen = {}
    for condition, name in MAP_NAMES.items():
        rows = np.flatnonzero(windows.condition == condition)
        if len(rows):
            hardest = rows[total[rows].argmax()]
            rows = rows[windows.recording[rows] == windows.recording[hardest]]
            first = max(0, int(np.searchsorted(rows, hardest)) - MOST // 2)
            chosen[name] = rows[first : first + MOST]
    return chosen


def packed(values: np.ndarray, top: float) -> str:
    """Return values as base64 of one byte each, 255 at `top`; what lies outside 0 to `top` is cut."""
    share = np.clip(np.nan_to_num(values) / max(top, np.finfo(float).tiny), 0, 1)
    return base64.b64encode(np.round(255 * share).astype(np.uint8).tobytes()).decode()


def data(windows: Windows, maps: Mapping[str, np.ndarray], settings: Mapping) -> dict:
    """Return what page/viewer.js plays. maps: model -> (n, map_rows, map_cols) in kPa of the same windows.

    Among the windows is one at least of a condition that MAP_NAMES has.
    """
    sensor, label = settings["sensor"], settings["label"]
    touches = []
    for name, rows in played(windows).items():
        truth = windows.truth[rows]
        count, pressure = float(windows.counts[rows].max()), float(1.2 * truth.max())
        predictions = {}
        for model in MODELS:
            if model in maps:
                values = maps[model][rows].astype(float)
                errors = np.sqrt(np.square(values - truth).mean(axis=(1, 2)))
                predictions[model_name(model)] = {
                    "map": packed(values, pressure),
                    "rmse_kpa": [round(float(error), 2) for error in np.nan_to_num(errors)],
                }
        touches.append(
            {
                "name": name,
                "seconds": [round(float(second), 2) for second in windows.t_s[rows] - windows.t_s[rows[0]]],
                "largest_count": count,
                "largest_kpa": round(pressure, 2),
                "reading": packed(windows.counts[rows], count),
                "label": packed(truth, pressure),
                "predictions": predictions,
            }
        )
    shape = {"reading": [sensor["rows"], sensor["cols"]], "map": [label["map_rows"], label["map_cols"]]}
    return {"shape": shape, "touches": touches}
