"""The rows of a table of a target: a constant, ridge regression and extra trees on the statistics of windows.

Classes and events are columns of 0 and 1, to which ridge regression is fitted as in scikit-learn's RidgeClassifier.
What is predicted is one score per class; those of ridge regression are cut at 0 and have the sum 1.
"""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from sklearn.decomposition import PCA
from sklearn.dummy import DummyRegressor
from sklearn.ensemble import ExtraTreesClassifier, ExtraTreesRegressor
from sklearn.linear_model import Ridge
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler

from tactile.learning.window_statistics import PENALTIES
from tactile.targets.features import LEVEL, VIEWS

COMPONENTS = 200  # of more columns, ridge sees the principal components; a matrix of 500 cells has 3,000
LEAST = 1e-9  # score of a class, so that a sum is never 0
LEAF = 5  # windows of a leaf of numbers, at least: windows of one moment resemble one another

Fitted = Sequence[Any]  # estimators with `predict`, one for each penalty


class Row(NamedTuple):
    """A row of the table."""

    name: str
    view: str  # of the statistics, one of features.VIEWS
    fit: Callable[[np.ndarray, np.ndarray], Fitted]  # of x (n, features) and y (n, outputs)


def rows(kind: str, trees: int) -> list[Row]:
    """Return the rows for a kind of target; trees: of a forest."""

    def forest(x: np.ndarray, y: np.ndarray) -> Fitted:
        if kind != "continuous":
            return [ExtraTreesClassifier(trees, random_state=0).fit(x, y.argmax(axis=1))]
        return [ExtraTreesRegressor(trees, min_samples_leaf=LEAF, random_state=0).fit(x, y.ravel())]

    fits = {"ridge": ridge, "extra trees": forest}
    seen = [Row(name if view == LEVEL else f"{name} {view}", view, fit) for name, fit in fits.items() for view in VIEWS]
    return [Row("constant", LEVEL, constant), *seen]


def constant(x: np.ndarray, y: np.ndarray) -> Fitted:
    """Return what looks at no reading: the mean, of classes their shares."""
    return [DummyRegressor().fit(x, y)]


def ridge(x: np.ndarray, y: np.ndarray) -> Fitted:
    """Return ridge regressions, one for each of PENALTIES."""
    main = PCA(COMPONENTS, svd_solver="randomized", iterated_power=2, random_state=0)
    scaled = make_pipeline(StandardScaler(), *[main] * (min(x.shape) > COMPONENTS)).fit(x)
    seen = scaled.transform(x)
    return [make_pipeline(scaled, Ridge(penalty).fit(seen, y)) for penalty in PENALTIES]


def predicted(estimator: Any, x: np.ndarray, outputs: int) -> np.ndarray:
    """Return numbers (n, 1), or scores of classes (n, classes) that are not negative and have the sum 1."""
    if hasattr(estimator, "predict_proba"):
        guess = np.zeros((len(x), outputs))
        guess[:, estimator.classes_] = estimator.predict_proba(x)  # a class that did not train is never named
        return guess
    guess = np.asarray(estimator.predict(x), float).reshape(len(x), outputs)
    if outputs == 1:
        return guess
    guess = np.clip(guess, 0, None) + LEAST
    return guess / guess.sum(axis=1, keepdims=True)
