"""Describe windows of readings by statistics: what extra trees and ridge regression see in place of a series."""

import numpy as np
from sklearn.base import BaseEstimator, TransformerMixin

KINDS = 6  # last, mean, slope, spread, smallest, largest
PENALTIES = (0.1, 3.0, 100.0, 3e3, 1e5)  # of ridge on standardised columns; a thousand windows weigh as much as 1e3


def described(windows: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Return last, mean, slope, spread, smallest and largest reading of every element, (n, KINDS, elements).

    windows: (n, frames, elements); at: (frames,) when the frames were, less the mean. The slope is per unit of `at`.
    """
    slope = np.einsum("t,nte->ne", at.astype(windows.dtype), windows) / max(float(at @ at), 1e-12)
    least, most = windows.min(axis=1), windows.max(axis=1)
    return np.stack([windows[:, -1], windows.mean(axis=1), slope, windows.std(axis=1), least, most], axis=1)


class Statistics(TransformerMixin, BaseEstimator):
    """Statistics of windows (n, frames * elements) as columns (n, KINDS * elements); of one frame the frame itself."""

    def __init__(self, frames: int):
        self.frames = frames

    def fit(self, x: np.ndarray, y=None) -> "Statistics":
        """Return self: there is nothing to learn."""
        self.fitted_ = True
        return self

    def transform(self, x: np.ndarray) -> np.ndarray:
        """Return the columns of the windows x."""
        x = np.asarray(x, np.float64)
        if self.frames == 1:
            return x
        at = np.arange(self.frames) - (self.frames - 1) / 2
        return described(x.reshape(len(x), self.frames, -1), at).reshape(len(x), -1)
