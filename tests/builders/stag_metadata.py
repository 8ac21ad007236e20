"""Make the MATLAB file of the STAG data set, with made-up frames."""

import numpy as np
import scipy.io

FRAMES, OBJECTS = 12, ["mug", "empty hand", "full can"]


def cells(names):
    """Return a MATLAB cell array of texts, one row."""
    array = np.empty((1, len(names)), dtype=object)
    array[0, :] = names
    return array


def metadata(**others):
    """Return the variables of metadata.mat: 12 frames of 3 objects in 4 recordings, of which the last is the test."""
    pressure = np.random.default_rng(0).integers(450, 700, (FRAMES, 32, 32)).astype(np.uint16)
    pressure[0, 0, :4] = [499, 500, 575, 651]
    recording = np.arange(FRAMES) // 3
    return {
        "pressure": pressure,
        "objectId": (recording % 3).astype(np.uint8)[:, None],
        "objects": cells(OBJECTS),
        "recordingId": recording.astype(float)[:, None],
        "recordings": cells([f"2018_{k}" for k in range(4)]),
        "splitId": (recording == 3).astype(np.uint8)[:, None],
        "splits": cells(["train", "test"]),
        "hasValidLabel": (np.arange(FRAMES) != 1)[:, None],
        "isBalanced": (np.arange(FRAMES) % 3 != 2)[:, None],
        "frame": np.arange(FRAMES)[:, None],
        "ts": np.arange(FRAMES)[:, None] * 0.14,
        "batchId": np.zeros((FRAMES, 1), np.uint8),
        "batches": cells(["2018"]),
    } | others


def save(folder, content, compress=True):
    path = folder / "metadata.mat"
    scipy.io.savemat(path, content, do_compression=compress)
    return path
