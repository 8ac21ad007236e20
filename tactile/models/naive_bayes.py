"""Build Gaussian naive Bayes on the pixels (SP-ResNet paper, Table 1): every pixel normal, given the object."""

import numpy as np
from pydantic import Field
from sklearn.naive_bayes import GaussianNB

from tactile.learning.estimators import SklearnRegressor
from tactile.learning.spec import Spec
from tactile.settings.shared import Block, Positive


class Settings(Block):
    """Settings of a model `naive_bayes` in params.yaml."""

    smoothing: Positive = Field(description="Added to all variances, in units of the largest variance of a pixel")


def build(spec: Spec, *, smoothing: float) -> SklearnRegressor:
    """Return the unfitted model; 32,784 fitted numbers on 1x32x32 images of 16 objects.

    They are a mean and a variance per pixel and object, and 16 priors.

    `smoothing` is above 0, because a pixel that is not wired never varies. Multiply-accumulates: a square and a
    weighting per pixel and object.
    Differs from paper: it does not say which naive Bayes; pixels are numbers, so the normal one.
    """
    return SklearnRegressor(
        lambda seed: OneHotNaiveBayes(var_smoothing=smoothing),
        spec,
        count=lambda fitted: fitted.theta_.size + fitted.var_.size + fitted.class_prior_.size,
        macs=2 * spec.frames * spec.elements * spec.outputs,
        trusted=("tactile.models.naive_bayes.OneHotNaiveBayes",),
    )


class OneHotNaiveBayes(GaussianNB):
    """GaussianNB whose labels are one-hot (n, classes) and whose predictions are probabilities (n, classes)."""

    def fit(self, x: np.ndarray, y: np.ndarray) -> "OneHotNaiveBayes":
        """Fit to x (n, pixels) and one-hot y (n, classes); a class without an image gets no distribution."""
        self.width_ = y.shape[1]
        return super().fit(x, y.argmax(1))

    def predict(self, x: np.ndarray) -> np.ndarray:
        """Return the probability of each class (n, classes) for x (n, pixels); 0 for a class that `fit` never saw."""
        probability = np.zeros((len(x), self.width_))
        probability[:, self.classes_] = self.predict_proba(x)
        return probability
