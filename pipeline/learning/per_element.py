"""Fit one regression for each element of an array: from an element's own readings to its block of the pressure map.

Conventional calibration as the LoMP paper describes it: its section I says that conventional approaches calibrate
subelements separately, section IV-D that a regression gives each sensor value a weight of its own. The block of an
element is its share of the map, 4 x 4 of 20 x 20 cells for 5 x 5 elements.
"""

from typing import NamedTuple

import numpy as np
from sklearn.base import BaseEstimator
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler
from sklearn.tree import DecisionTreeRegressor

from pipeline.base.errors import InputError
from pipeline.learning.estimators import SklearnRegressor
from pipeline.learning.regressors import Spec


class Blocks(NamedTuple):
    """How a map is divided: rows x cols elements, each with height x width cells."""

    rows: int
    cols: int
    height: int
    width: int

    @property
    def elements(self) -> int:
        """Number of elements."""
        return self.rows * self.cols

    @property
    def cells(self) -> int:
        """Number of cells of one element."""
        return self.height * self.width


def blocks_of(spec: Spec, model: str) -> Blocks:
    """Return the blocks of a task's map; InputError where it does not divide into one block for each element."""
    if spec.map_rows % spec.rows or spec.map_cols % spec.cols:
        raise InputError(
            f"{model}: a map of {spec.map_rows}x{spec.map_cols} does not divide into equal blocks over "
            f"{spec.rows}x{spec.cols} elements; make the map a multiple of the array"
        )
    return Blocks(spec.rows, spec.cols, spec.map_rows // spec.rows, spec.map_cols // spec.cols)


def cut(maps: np.ndarray, blocks: Blocks) -> np.ndarray:
    """Return maps (n, outputs) as (elements, n, cells)."""
    rows, cols, height, width = blocks
    apart = maps.reshape(-1, rows, height, cols, width).transpose(1, 3, 0, 2, 4)
    return apart.reshape(blocks.elements, -1, blocks.cells)


def joined(parts: np.ndarray, blocks: Blocks) -> np.ndarray:
    """Return what `cut` took apart: (elements, n, cells) as maps (n, outputs)."""
    rows, cols, height, width = blocks
    apart = np.reshape(parts, (rows, cols, -1, height, width)).transpose(2, 0, 3, 1, 4)
    return apart.reshape(len(apart), -1)


class ElementPolynomials(BaseEstimator):
    """A polynomial of the last reading for each element, by least squares with a penalty.

    `ridge` weighs squared coefficients, but for the constant, against the squared error summed over windows. A
    coefficient that the readings do not determine is 0, as of an element that was never pressed.
    """

    def __init__(self, blocks: tuple[int, int, int, int], degree: int, ridge: float):
        self.blocks = blocks
        self.degree = degree
        self.ridge = ridge

    def fit(self, x: np.ndarray, y: np.ndarray) -> "ElementPolynomials":
        """Fit to x (n, elements), standardised, and maps y (n, outputs)."""
        blocks = Blocks(*self.blocks)
        weights, bias = [], []
        for values, part in zip(x.T, cut(y, blocks), strict=True):
            powers = self._powers(values)
            mean, mean_part = powers.mean(axis=0), part.mean(axis=0)
            powers, part = powers - mean, part - mean_part
            squares = powers.T @ powers + self.ridge * np.eye(self.degree)
            weights.append(np.linalg.pinv(squares, hermitian=True) @ (powers.T @ part))
            bias.append(mean_part - mean @ weights[-1])
        self.coef_, self.intercept_ = np.array(weights), np.array(bias)  # (elements, degree, cells), (elements, cells)
        return self

    def predict(self, x: np.ndarray) -> np.ndarray:
        """Return maps (n, outputs) for x (n, elements)."""
        parts = self._powers(x.T) @ self.coef_ + self.intercept_[:, None]
        return joined(parts, Blocks(*self.blocks))

    def _powers(self, values: np.ndarray) -> np.ndarray:
        """Return the powers 1 to `degree` of each value, as a last axis."""
        return np.stack([values**power for power in range(1, self.degree + 1)], axis=-1)


class ElementTrees(BaseEstimator):
    """A decision tree for each element, which sees the window of its own readings."""

    def __init__(self, blocks: tuple[int, int, int, int], min_samples_leaf: int, max_features: float, seed: int):
        self.blocks = blocks
        self.min_samples_leaf = min_samples_leaf
        self.max_features = max_features
        self.seed = seed

    def fit(self, x: np.ndarray, y: np.ndarray) -> "ElementTrees":
        """Grow the trees on windows x (n, frames * elements) and maps y (n, outputs)."""
        blocks = Blocks(*self.blocks)
        self.trees_ = [
            DecisionTreeRegressor(
                min_samples_leaf=self.min_samples_leaf, max_features=self.max_features, random_state=self.seed
            ).fit(own, part)
            for own, part in zip(self._own(x, blocks), cut(y, blocks), strict=True)
        ]
        return self

    def predict(self, x: np.ndarray) -> np.ndarray:
        """Return maps (n, outputs) for windows x (n, frames * elements)."""
        blocks = Blocks(*self.blocks)
        own = np.ascontiguousarray(self._own(x.astype(np.float32, copy=False), blocks))
        # The trees' checks of their input would take ten times as long as the trees.
        parts = [tree.tree_.predict(values) for tree, values in zip(self.trees_, own, strict=True)]
        return joined(np.array(parts), blocks)

    def _own(self, x: np.ndarray, blocks: Blocks) -> np.ndarray:
        """Return the windows of each element, (elements, n, frames)."""
        return x.reshape(len(x), -1, blocks.elements).transpose(2, 0, 1)


def polynomials(spec: Spec, model: str, degree: int, ridge: float) -> SklearnRegressor:
    """Return the unfitted polynomials of all elements; model: the key that a sentence about a wrong map names."""
    blocks = blocks_of(spec, model)
    return SklearnRegressor(
        lambda seed: make_pipeline(StandardScaler(), ElementPolynomials(tuple(blocks), degree, ridge)),
        spec,
        count=lambda fitted: fitted[-1].coef_.size + fitted[-1].intercept_.size,
        macs=blocks.elements * (degree - 1 + degree * blocks.cells),  # the powers, then the read-out
        last_frame=True,
        trusted=("pipeline.learning.per_element.ElementPolynomials",),
    )


def trees(spec: Spec, model: str, min_samples_leaf: int, max_features: float) -> SklearnRegressor:
    """Return the trees of all elements, not yet grown; model: as for `polynomials`."""
    blocks = blocks_of(spec, model)
    return SklearnRegressor(
        lambda seed: ElementTrees(tuple(blocks), min_samples_leaf, float(max_features), seed),
        spec,
        count=lambda fitted: sum(
            tree.tree_.node_count + (blocks.cells - 1) * tree.tree_.n_leaves for tree in fitted.trees_
        ),
        macs=None,
        trusted=("pipeline.learning.per_element.ElementTrees", "sklearn.tree._tree.Tree"),
    )
