"""Fit one regression for each element of an array: from an element's own readings to its share of the pressure map.

Conventional calibration as the LoMP paper describes it: its section I says that conventional approaches calibrate
subelements separately, section IV-D that a regression gives each sensor value a weight of its own. A cell of the map is
the element's above which its centre lies: 4 x 4 of 20 x 20 cells are one element's of 5 x 5.
"""

from collections.abc import Iterator, Sequence

import numpy as np
from sklearn.base import BaseEstimator
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler
from sklearn.tree import DecisionTreeRegressor

from tactile.learning.estimators import SklearnRegressor, tree_numbers
from tactile.learning.spec import Spec


def owners(spec: Spec) -> tuple[int, ...]:
    """Return the element of each cell of a task's map, (outputs,)."""
    row = (2 * np.arange(spec.map_rows) + 1) * spec.rows // (2 * spec.map_rows)
    col = (2 * np.arange(spec.map_cols) + 1) * spec.cols // (2 * spec.map_cols)
    return tuple(map(int, (row[:, None] * spec.cols + col).ravel()))


def parts(owner: Sequence[int]) -> Iterator[tuple[int, np.ndarray]]:
    """Yield every element that has cells, and its cells."""
    for element in np.unique(owner):
        yield int(element), np.flatnonzero(np.asarray(owner) == element)


class ElementPolynomials(BaseEstimator):
    """A polynomial of the last reading for each element, by least squares with a penalty.

    `ridge` weighs squared coefficients, but for the constant, against the squared error summed over windows. A
    coefficient that the readings do not determine is 0, as of an element that was never pressed.
    """

    def __init__(self, owner: tuple[int, ...], degree: int, ridge: float):
        self.owner = owner
        self.degree = degree
        self.ridge = ridge

    def fit(self, x: np.ndarray, y: np.ndarray) -> "ElementPolynomials":
        """Fit to x (n, elements), standardised, and maps y (n, outputs)."""
        self.coef_, self.intercept_ = np.empty((self.degree, y.shape[1])), np.empty(y.shape[1])
        for element, cells in parts(self.owner):
            powers, part = (
                np.stack([x[:, element] ** power for power in range(1, self.degree + 1)], axis=1),
                y[:, cells],
            )
            mean, mean_part = powers.mean(axis=0), part.mean(axis=0)
            powers, part = powers - mean, part - mean_part
            squares = powers.T @ powers + self.ridge * np.eye(self.degree)
            self.coef_[:, cells] = np.linalg.pinv(squares, hermitian=True) @ (powers.T @ part)
            self.intercept_[cells] = mean_part - mean @ self.coef_[:, cells]
        return self

    def predict(self, x: np.ndarray) -> np.ndarray:
        """Return maps (n, outputs) for x (n, elements)."""
        own = x[:, self.owner]
        return self.intercept_ + sum(weights * own ** (power + 1) for power, weights in enumerate(self.coef_))


class ElementTrees(BaseEstimator):
    """A decision tree for each element, which sees the window of its own readings."""

    def __init__(self, owner: tuple[int, ...], elements: int, min_samples_leaf: int, max_features: float, seed: int):
        self.owner = owner
        self.elements = elements
        self.min_samples_leaf = min_samples_leaf
        self.max_features = max_features
        self.seed = seed

    def fit(self, x: np.ndarray, y: np.ndarray) -> "ElementTrees":
        """Grow the trees on windows x (n, frames * elements) and maps y (n, outputs)."""
        self.trees_ = [
            DecisionTreeRegressor(
                min_samples_leaf=self.min_samples_leaf, max_features=self.max_features, random_state=self.seed
            ).fit(x[:, element :: self.elements], y[:, cells])
            for element, cells in parts(self.owner)
        ]
        return self

    def predict(self, x: np.ndarray) -> np.ndarray:
        """Return maps (n, outputs) for windows x (n, frames * elements)."""
        x, maps = x.astype(np.float32, copy=False), np.empty((len(x), len(self.owner)))
        for tree, (element, cells) in zip(self.trees_, parts(self.owner), strict=True):
            own = np.ascontiguousarray(x[:, element :: self.elements])
            if own.shape[1] != tree.tree_.n_features:
                raise ValueError(f"a tree of {tree.tree_.n_features} columns is given {own.shape[1]}")
            # The trees' checks of their input would take ten times as long as the trees.
            maps[:, cells] = tree.tree_.predict(own).reshape(len(x), -1)
        return maps


def polynomials(spec: Spec, degree: int, ridge: float) -> SklearnRegressor:
    """Return the unfitted polynomials of all elements."""
    owner = owners(spec)
    return SklearnRegressor(
        lambda seed: make_pipeline(StandardScaler(), ElementPolynomials(owner, degree, ridge)),
        spec,
        count=lambda fitted: fitted[-1].coef_.size + fitted[-1].intercept_.size,
        macs=spec.elements * (degree - 1) + degree * len(owner),  # the powers, then the read-out
        last_frame=True,
        trusted=("tactile.learning.per_element.ElementPolynomials",),
    )


def trees(spec: Spec, min_samples_leaf: int, max_features: float) -> SklearnRegressor:
    """Return the trees of all elements, not yet grown."""
    owner = owners(spec)
    return SklearnRegressor(
        lambda seed: ElementTrees(owner, spec.elements, min_samples_leaf, float(max_features), seed),
        spec,
        count=lambda fitted: tree_numbers(fitted.trees_),
        macs=None,
        trusted=("tactile.learning.per_element.ElementTrees", "sklearn.tree._tree.Tree"),
    )
