"""Make frames of the capacitive array: round contacts on a mask, and readings that follow it, in .npz files."""

from pathlib import Path

import numpy as np

from tactile.experiments.array_recorded import COLS, PIXELS, ROWS

PRESSED = 400.0  # counts above rest of an element that is wholly in contact


def mask_of(contacts, radius: float = 8.0) -> np.ndarray:
    """The mask (ROWS * PIXELS, COLS * PIXELS) bool of discs at contacts (row, col) in pixels."""
    row, col = np.mgrid[: ROWS * PIXELS, : COLS * PIXELS] + 0.5
    touched = np.zeros(row.shape, bool)
    for y, x in contacts:
        touched |= (row - y) ** 2 + (col - x) ** 2 <= radius**2
    return touched


def save(path: Path, touched: np.ndarray, cap: np.ndarray | None = None, in_contact: int = 0) -> None:
    """Write one frame; cap: readings (ROWS, COLS), else those that follow the mask; in_contact: the mask's value."""
    if cap is None:
        cap = np.round(PRESSED * touched.reshape(ROWS, PIXELS, COLS, PIXELS).mean(axis=(1, 3)) - 20)
    path.parent.mkdir(parents=True, exist_ok=True)
    mask = np.where(touched, in_contact, 255 - in_contact).astype(float)
    np.savez_compressed(path, cap=cap.astype(np.int16), ftir=mask)


def sessions(folder: Path, persons: int = 4, frames: int = 12) -> None:
    """Two sessions of each person with frames of one, two and three contacts in turn, all of which fit into a crop."""
    rng = np.random.default_rng(0)
    for person in range(1, persons + 1):
        for session in (1, 2):
            for number in range(frames):
                start = rng.uniform(20, 150, 2)
                places = start + np.array([(0, 0), (60, 40), (20, 100)])[: 1 + number % 3] + rng.uniform(-6, 6, 2)
                path = folder / f"P{person:02d}" / str(session) / "npz" / f"{number:04d}.npz"
                save(path, mask_of(places, rng.uniform(6, 10)), in_contact=255 * (person == 2))
