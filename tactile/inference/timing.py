"""Fit the rate of a device to that of a model's training: readings from one frame to the next, and lines that are lost.

A log that is predicted at once and lines that are predicted as they come are treated alike.
"""

import numpy as np

from tactile.inference.card import Card

TOLERANCE = 1.1  # ratio of times; a device within it of the model's training is taken as one of the same rate


def frame_step(card: Card, interval_s: float) -> int:
    """Return how many readings lie between two frames of a window, of a device that reads every `interval_s` seconds.

    Frames are then as far apart in time as in training, as nearly as the device's rate allows.
    """
    trained_s = card.inputs.interval_s
    if trained_s / TOLERANCE <= interval_s <= TOLERANCE * trained_s:
        return card.inputs.frame_step
    return max(1, round(card.inputs.frame_step * trained_s / interval_s))


def differences(card: Card, interval_s: float, read_s: float) -> list[str]:
    """Return sentences that say where a device's rate does not suit a model.

    interval_s: between the device's lines; read_s: between those that the model is given.
    """
    if card.kind == "images":
        return []  # one reading, one image: no time is in it
    trained_s, said = card.inputs.interval_s, []
    if interval_s > TOLERANCE * trained_s:
        said.append(
            f"The device prints {1 / interval_s:.3g} lines a second, fewer than the {1 / trained_s:.3g} of the model's "
            "training."
        )
    apart_s, wanted_s = frame_step(card, read_s) * read_s, card.inputs.frame_step * trained_s
    if not wanted_s / TOLERANCE <= apart_s <= TOLERANCE * wanted_s:
        said.append(
            f"Frames are {apart_s:.3g} s apart, in training {wanted_s:.3g} s: expect larger errors than the card's."
        )
    return said


def most_filled(step: int) -> int:
    """Return how many lost readings in a row are filled by interpolation, of `step` readings from frame to frame.

    So many touch one frame of a window at most, and one in any case. After more of them a new window begins.
    """
    return max(1, step - 1)


def between(before: np.ndarray, after: np.ndarray, lost: int) -> np.ndarray:
    """Return the readings (lost, columns) on the straight line between two readings (columns,)."""
    share = np.arange(1, lost + 1)[:, None] / (lost + 1)
    return before + share * (np.asarray(after, float) - before)
