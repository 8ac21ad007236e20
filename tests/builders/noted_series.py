"""A model of series that notes what it is given, and the one recording that it knows."""

import numpy as np
import pytest

from tactile import models
from tactile.datasets import series
from tactile.learning.regressors import FitSummary

SAMPLES = 100


class Noting:
    """A model that notes what it is given; 3 mm off in the test part of its recording, 1000 mm off everywhere else."""

    summary = FitSummary("closed_form", 1)

    def __init__(self, piece: series.Piece):
        self.piece, self.records, self.bases, self.saved = piece, [], [], []

    def fit(self, records, *, base=None, **settings):
        self.records += records
        self.bases.append(base)

    def save(self, folder):
        self.saved.append(folder)

    def predict(self, x):
        assert np.array_equal(x, self.piece.record.x)  # the whole recording: the state builds up before the test part
        return self.piece.record.y + np.where(self.piece.part == "test", 3.0, 1000.0)[:, None]

    def step(self, x):
        """Makes it a model of series."""

    def parameters(self):
        return 7


def noting(patch: pytest.MonkeyPatch) -> Noting:
    """Return what is built in place of every model; the only recording has parts of 70, 10 and 20 samples."""
    x, y = np.arange(SAMPLES * 6.0).reshape(SAMPLES, 6), -np.arange(SAMPLES * 1.0)[:, None]
    part = series.chronological(SAMPLES, 0.8, 0.125)
    record = series.Record(x, y, np.ones(SAMPLES, bool), part == "train", np.full(SAMPLES, -1))
    model = Noting(series.Piece("task_1", np.arange(SAMPLES), part, np.arange(SAMPLES) / 5, record))
    patch.setattr(models, "build", lambda *arguments: model)
    patch.setattr(series, "read", lambda *arguments: [model.piece])
    return model
