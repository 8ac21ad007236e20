"""Score the naming of one of several objects: accuracy, macro precision, and the confusion matrix behind them."""

import numpy as np

from tactile.scoring.metrics import Row

MOST_FRAMES = 8  # whose answers are averaged, in place of figure 15
METRICS = ("accuracy", "macro_precision")  # fractions of what is right: the error is what is missing to 1


def scores(truth: np.ndarray, predicted: np.ndarray) -> list[Row]:
    """Return accuracy and macro_precision (fractions).

    truth: (n, classes), one-hot; predicted: (n, classes), a score per class.

    * accuracy: share of images whose highest score is the object's.
    * macro_precision: mean over classes of the share of the images named so that are of the class (the paper's
      "precision"); a class whose name no image was given counts as 0.
    """
    table = confusion(truth, predicted)
    right, named = np.diag(table), table.sum(axis=0)
    precision = np.divide(right, named, out=np.zeros(len(right)), where=named > 0)
    values = {"accuracy": float(right.sum() / table.sum()), "macro_precision": float(precision.mean())}
    return [(metric, "1", value, len(truth)) for metric, value in values.items()]


def confusion(truth: np.ndarray, predicted: np.ndarray) -> np.ndarray:
    """Return (classes, classes): the number of images of class i that were named j; arguments as for `scores`."""
    classes = truth.shape[1]
    pairs = truth.argmax(axis=1) * classes + predicted.argmax(axis=1)
    return np.bincount(pairs, minlength=classes**2).reshape(classes, classes)


def by_frames(predicted: np.ndarray, group: np.ndarray, frames: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the mean predictions of a one-frame network to sets of images: (first rows (m,), scores (m, classes)).

    In place of figure 15, whose networks are trained on all the frames at once.

    predicted: (n, classes); group: (n,) number of each image's recording. The images of a recording make as many sets
    of `frames` as they fill, each spread evenly over the recording; images left over are not used.
    """
    rows, means = [], []
    for recording in np.unique(group):
        images = np.flatnonzero(group == recording)
        sets = len(images) // frames
        for k in range(sets):
            picked = images[k::sets][:frames]
            rows.append(picked[0])
            means.append(predicted[picked].mean(axis=0))
    return np.array(rows, dtype=int), np.array(means).reshape(-1, predicted.shape[1])
