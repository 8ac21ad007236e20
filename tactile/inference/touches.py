"""Say what a pressure map means: touches with place and pressure, and the force of all of them."""

from typing import NamedTuple

import numpy as np

from tactile.base.errors import InputError
from tactile.inference.card import Card
from tactile.scoring import metrics


class Touch(NamedTuple):
    """One touch: its place from the array's lower left corner in mm, and its pressure in kPa."""

    x_mm: float
    y_mm: float
    kpa: float


def touches(maps: np.ndarray, card: Card) -> list[list[Touch]]:
    """Return the touches of each map, the hardest first; maps (n, rows, cols) in kPa.

    A touch is a peak of at least `card.outputs.touch_kpa`, as in the scores (scoring.metrics.peaks). A map that holds
    NaN has none.
    """
    of_maps = [[] for _ in maps]
    if not len(maps):
        return of_maps
    peaks = metrics.peaks(np.nan_to_num(maps), card.reading["sensor"])
    peaks = peaks.chosen(peaks.kpa >= card.outputs.touch_kpa)
    for k in np.argsort(-peaks.kpa, kind="stable"):
        of_maps[peaks.window[k]].append(Touch(float(peaks.x_mm[k]), float(peaks.y_mm[k]), float(peaks.kpa[k])))
    return of_maps


def force_n(maps: np.ndarray, card: Card) -> np.ndarray:
    """Return the force of all touches of each map in N, (n,), NaN of a map that holds NaN; maps (n, rows, cols) in kPa.

    It is the map's integral times the gain that was fitted to the load cells on the model's training part. Raises
    InputError where the card has none.
    """
    if card.outputs.force_gain is None:
        raise InputError(
            f"{card.experiment}/{card.model}: its card has no force_gain; run `python -m tactile.stages.evaluate "
            f"{card.experiment}` and export the model again"
        )
    return card.outputs.force_gain * metrics.integral_n(maps, card.reading["sensor"])
