"""Where tips pressed while a replayed log was recorded, of logs of touch that have the ground truth beside them."""

from pathlib import Path

import numpy as np

from tactile.experiments import facts
from tactile.inference import recordings
from tactile.inference.card import Card
from tactile.live.source import Reading


class Truth:
    """Finds a replayed reading among those of its log."""

    def __init__(self, recording: recordings.Recording, tips: recordings.Tips):
        self._x, self._tips = recording.x, tips
        self._rows: dict[int, list[int]] = {}  # us on the device's clock, which may begin anew -> rows of that time
        for row, t_s in enumerate(recording.t_s.tolist()):
            self._rows.setdefault(round(1e6 * t_s), []).append(row)

    def of(self, reading: Reading) -> dict:
        """Return `tips`, [x, y] in mm of each that presses, and `load_cells_n`, their force; {} where nobody knows."""
        rows = self._rows.get(round(1e6 * reading.t_s), [])
        row = next((row for row in rows if (self._x[row] == reading.values).all()), None)
        if row is None or not self._tips.known[row]:
            return {}
        force_n = self._tips.force_n[row]
        pressed = ~np.isnan(force_n)
        places = np.column_stack([self._tips.x_mm[row], self._tips.y_mm[row]])[pressed]
        return {"tips": places.round(2).tolist(), "load_cells_n": round(float(force_n[pressed].sum()), 4)}


def beside(log: Path, card: Card) -> Truth | None:
    """Return the truth beside a log of touch, read as a card says; None where there is none.

    Raises InputError where log or truth cannot be read.
    """
    names = facts(card.experiment).truth
    if card.outputs.touch_kpa is None or not all((log.parent / name).is_file() for name in names):
        return None
    recording = recordings.read(log.absolute(), log.stem, card)
    tips = recordings.tips(recording, card)
    return Truth(recording, tips) if tips else None
