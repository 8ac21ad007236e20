"""Scores of naming one of several objects: accuracy, macro precision, and the confusion matrix behind them."""

import numpy as np

from pipeline.scoring.metrics import Row

MOST_FRAMES = 8  # whose scores are averaged (figure 15)


def scores(truth: np.ndarray, predicted: np.ndarray) -> list[Row]:
    """accuracy and macro_precision (fractions); truth, predicted: (n, classes), one-hot and a score a class.

    * accuracy: share of images whose highest score is the object's.
    * macro_precision: mean over classes of the share of images given that name that are it (the paper's
      "precision"); a class that no image is given counts as 0.
    """
    table = confusion(truth, predicted)
    right, named = np.diag(table), table.sum(axis=0)
    precision = np.divide(right, named, out=np.zeros(len(right)), where=named > 0)
    values = {"accuracy": float(right.sum() / table.sum()), "macro_precision": float(precision.mean())}
    return [(metric, "1", value, len(truth)) for metric, value in values.items()]


def confusion(truth: np.ndarray, predicted: np.ndarray) -> np.ndarray:
    """(classes, classes) number of images of class i that were named j; arguments as for `scores`."""
    classes = truth.shape[1]
    pairs = truth.argmax(axis=1) * classes + predicted.argmax(axis=1)
    return np.bincount(pairs, minlength=classes**2).reshape(classes, classes)


def by_frames(predicted: np.ndarray, group: np.ndarray, frames: int) -> tuple[np.ndarray, np.ndarray]:
    """The mean score over `frames` images of each group (figure 15): (first rows (m,), scores (m, classes)).

    predicted: (n, classes); group: (n,) number of each image's recording. The images of a group are taken in as
    many sets of `frames` as there are, each spread evenly over the recording; what is left over is not used.
    """
    rows, means = [], []
    for one in np.unique(group):
        own = np.flatnonzero(group == one)
        sets = len(own) // frames
        for k in range(sets):
            picked = own[k::sets][:frames]
            rows.append(picked[0])
            means.append(predicted[picked].mean(axis=0))
    return np.array(rows, dtype=int), np.array(means).reshape(-1, predicted.shape[1])
