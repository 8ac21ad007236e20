"""Scores and confusions of known answers to images."""

import numpy as np
import pytest

from tactile.scoring import classification


def test_scores_against_scikit_learn():
    from sklearn.metrics import accuracy_score, confusion_matrix, precision_score

    rng = np.random.default_rng(0)
    truth, guess = np.eye(5)[rng.integers(0, 5, 200)], rng.random((200, 5))
    guess[:, 3] = -1  # an object that is never named
    labels = truth.argmax(1), guess.argmax(1)
    found = {metric: value for metric, _, value, _ in classification.scores(truth, guess)}
    assert found["accuracy"] == pytest.approx(accuracy_score(*labels))
    assert found["macro_precision"] == pytest.approx(precision_score(*labels, average="macro", zero_division=0))
    assert (classification.confusion(truth, guess) == confusion_matrix(*labels)).all()


def test_frames_of_a_recording_are_averaged_in_even_sets():
    predicted = np.arange(14, dtype=float).reshape(7, 2)
    group = np.array([0, 0, 0, 0, 0, 1, 1])
    rows, means = classification.by_frames(predicted, group, 2)
    assert rows.tolist() == [0, 1, 5]
    assert means.tolist() == [[2, 3], [4, 5], [11, 12]]
    rows, means = classification.by_frames(predicted, group, 1)
    assert rows.tolist() == list(range(7)) and (means == predicted).all()
    assert len(classification.by_frames(predicted, group, 6)[0]) == 0
