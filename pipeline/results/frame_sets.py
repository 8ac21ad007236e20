"""Put images of one session together into sets of several input frames (figure 15 of the SP-ResNet paper)."""

from collections.abc import Sequence

import numpy as np
import pyarrow as pa

from tactile.datasets import schemas
from tactile.scoring.classification import MOST_FRAMES


def sessions(table: pa.Table) -> np.ndarray:
    """Return the number of each image's session, (n,); table: a dataset of images."""
    names = np.char.add(np.char.add(schemas.names(table["condition"]), "/"), schemas.names(table["recording"]))
    return np.unique(names, return_inverse=True)[1]


def compared_images(table: pa.Table, protocol: str, seeds: Sequence[int]) -> tuple[int, dict[int, np.ndarray]]:
    """Return the most frames that are compared, and seed -> rows of the test images that are.

    At most MOST_FRAMES; fewer, where an object has no test session that long. Shorter sessions than the most frames
    are left out at every number of frames, so that all numbers are of the same sessions. table: the dataset's.
    """
    label, session = table["label"].to_numpy(), sessions(table)
    images = np.bincount(session)
    tests = {
        seed: np.flatnonzero(schemas.names(table[schemas.split_column(protocol, seed)]) == "test") for seed in seeds
    }
    longest = [images[session[test[label[test] == k]]].max() for test in tests.values() for k in set(label[test])]
    most = min(MOST_FRAMES, *longest)
    return int(most), {seed: test[images[session[test]] >= most] for seed, test in tests.items()}


def fixed_sets(group: np.ndarray, frames: int) -> np.ndarray:
    """Return the sets of `frames` images that `classification.by_frames` averages: rows (m, frames).

    group: (n,) number of each image's session.
    """
    sets = []
    for session in np.unique(group):
        images = np.flatnonzero(group == session)
        number = len(images) // frames
        sets += [images[k::number][:frames] for k in range(number)]
    return np.array(sets, dtype=int).reshape(-1, frames)


def drawn_sets(group: np.ndarray, frames: int, most: int, rng: np.random.Generator) -> np.ndarray:
    """Return at most `most` sets of `frames` images of one session, drawn without repetition: rows (m, frames).

    group: (n,) number of each image's session. Every session is cut into as many sets as it fills.
    """
    rows = rng.permutation(len(group))
    rows = rows[np.argsort(group[rows], kind="stable")]
    _, first, images = np.unique(group[rows], return_index=True, return_counts=True)
    place = np.arange(len(rows)) - np.repeat(first, images)
    sets = rows[place < np.repeat(images - images % frames, images)].reshape(-1, frames)
    return rng.permutation(sets)[:most]
