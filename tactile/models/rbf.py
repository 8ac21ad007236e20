"""Build the RBF-Net of the LoMP paper (Table I, its reference 17): Gaussians at k-means centres, ridge read-out."""

import numpy as np
from pydantic import Field
from sklearn.base import BaseEstimator, TransformerMixin
from sklearn.cluster import KMeans
from sklearn.linear_model import Ridge
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler

from tactile.base.errors import InputError
from tactile.learning.estimators import SklearnRegressor
from tactile.learning.spec import Spec
from tactile.settings.shared import Block, NotNegative, Positive


class Settings(Block):
    """Settings of a model `rbf` in params.yaml."""

    centres: int = Field(ge=1, le=100_000, description="Number of Gaussians")
    width: Positive = Field(
        description="Width of all Gaussians in units of the mean distance from a centre to its nearest neighbour"
    )
    ridge: NotNegative = Field(
        description="Weight of the squared coefficients against the squared error summed over the training windows"
    )


def build(spec: Spec, *, centres: int, width: float, ridge: float) -> SklearnRegressor:
    """Return the unfitted model; 300,400 fitted numbers for 500 centres on 200 inputs and 400 outputs.

    They are 100,000 of the centres and 200,400 of the read-out.

    Differs from paper: number, places and widths of the Gaussians are not given there; here k-means centres of one
    width, all frames of a window.
    """
    return SklearnRegressor(
        lambda seed: make_pipeline(
            StandardScaler(), GaussianFeatures(centres, width, seed), Ridge(ridge, solver="cholesky")
        ),
        spec,
        count=lambda fitted: fitted[1].centres_.size + fitted[-1].coef_.size + fitted[-1].intercept_.size,
        macs=centres * (spec.frames * spec.elements + spec.outputs),
        trusted=("tactile.models.rbf.GaussianFeatures",),
    )


class GaussianFeatures(TransformerMixin, BaseEstimator):
    """exp(-distance^2 / (2 width^2)) to each of `centres` k-means centres; x (n, inputs) to (n, centres)."""

    def __init__(self, centres: int, width: float, seed: int):
        self.centres = centres
        self.width = width
        self.seed = seed

    def fit(self, x: np.ndarray, y=None) -> "GaussianFeatures":
        """Place the centres and set the shared width; InputError for fewer windows than centres."""
        if len(x) < self.centres:
            raise InputError(f"rbf: centres is {self.centres}, but there are only {len(x)} training windows; lower it")
        kmeans = KMeans(self.centres, n_init=1, max_iter=50, random_state=self.seed).fit(x)
        self.centres_ = kmeans.cluster_centers_
        distances = np.sqrt(self._squares(self.centres_))
        np.fill_diagonal(distances, np.inf)
        nearest = distances.min(axis=1).mean() if self.centres > 1 else np.sqrt(kmeans.inertia_ / len(x))
        self.width_ = float(self.width * nearest)
        return self

    def transform(self, x: np.ndarray) -> np.ndarray:
        """Return activations (n, centres), each between 0 and 1, for x (n, inputs)."""
        return np.exp(self._squares(x) / (-2 * self.width_**2))

    def _squares(self, x: np.ndarray) -> np.ndarray:
        """Return squared distances (n, centres) from x (n, inputs) to the centres."""
        squares = np.square(x).sum(1)[:, None] - 2 * x @ self.centres_.T + np.square(self.centres_).sum(1)
        return np.maximum(squares, 0)  # rounding can leave -1e-12
