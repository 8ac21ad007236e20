"""Printed numbers stand beside scores in the same unit."""

import numpy as np

from pipeline.results import published


def test_published_values_are_in_our_units():
    assert published.score("touch", "lomp", "double", "rmse") == 7.49
    assert published.score("glove", "sp_resnet", "combined", "macro_precision") == 0.955
    assert published.score("strain", "lstm_direct", "task_2", "error") == 27.0
    missing = [("touch", "tree", "tape", "rmse"), ("glove", "tree", "strain", "accuracy"), ("own", "a", "b", "rmse")]
    assert all(np.isnan(published.score(*row)) for row in missing)
