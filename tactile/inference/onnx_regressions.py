"""Build torch modules of regressions that scikit-learn fitted, so that they can be written as ONNX.

They compute in float64, as scikit-learn does: products of `poly_array` cancel each other.
"""

import numpy as np
import torch
from sklearn.linear_model import LinearRegression, Ridge
from sklearn.preprocessing import PolynomialFeatures, StandardScaler
from torch import nn

from tactile.learning.estimators import SklearnRegressor
from tactile.learning.per_element import ElementPolynomials
from tactile.models.rbf import GaussianFeatures


class Scaled(nn.Module):
    """Inputs (n, inputs) without their mean, over their spread."""

    def __init__(self, step: StandardScaler):
        super().__init__()
        self.register_buffer("mean", torch.from_numpy(step.mean_))
        self.register_buffer("spread", torch.from_numpy(step.scale_))

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        return (x - self.mean) / self.spread


class Products(nn.Module):
    """Products (n, features) of up to `degree` inputs."""

    def __init__(self, step: PolynomialFeatures):
        super().__init__()
        inputs = step.powers_.shape[1]
        factors = np.full((len(step.powers_), step.powers_.sum(1).max()), inputs)  # `inputs`: the 1 beside the inputs
        for row, powers in zip(factors, step.powers_, strict=True):
            chosen = np.repeat(np.arange(inputs), powers)
            row[: len(chosen)] = chosen
        self.register_buffer("factors", torch.from_numpy(factors.T.copy()))

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        x = torch.cat([x, torch.ones_like(x[:, :1])], 1)
        products = x.index_select(1, self.factors[0])
        for chosen in self.factors[1:]:
            products = products * x.index_select(1, chosen)
        return products


class Polynomials(nn.Module):
    """Maps (n, outputs) of a polynomial for each element (n, elements)."""

    def __init__(self, step: ElementPolynomials):
        super().__init__()
        self.register_buffer("owner", torch.tensor(step.owner))
        self.register_buffer("weights", torch.from_numpy(step.coef_.copy()))
        self.register_buffer("bias", torch.from_numpy(step.intercept_))

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        own = x.index_select(1, self.owner)
        return self.bias + sum(weights * own ** (power + 1) for power, weights in enumerate(self.weights))


class Gaussians(nn.Module):
    """Activations (n, centres) of Gaussians."""

    def __init__(self, step: GaussianFeatures):
        super().__init__()
        self.register_buffer("centres", torch.from_numpy(step.centres_.T.copy()))
        self.per_square = -1 / (2 * step.width_**2)

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        squares = (x * x).sum(1, keepdim=True) - 2 * (x @ self.centres) + (self.centres * self.centres).sum(0)
        return torch.exp(self.per_square * torch.relu(squares))


class ReadOut(nn.Module):
    """A linear map to (n, outputs)."""

    def __init__(self, step: LinearRegression | Ridge):
        super().__init__()
        self.register_buffer("weights", torch.from_numpy(np.atleast_2d(step.coef_).T.copy()))
        self.register_buffer("bias", torch.from_numpy(np.atleast_1d(step.intercept_)))

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        return torch.addmm(self.bias, x, self.weights)


MODULES = {
    StandardScaler: Scaled,
    PolynomialFeatures: Products,
    ElementPolynomials: Polynomials,
    GaussianFeatures: Gaussians,
    LinearRegression: ReadOut,
    Ridge: ReadOut,
}


class Regression(nn.Module):
    """Windows (n, frames, elements) to maps (n, rows, cols): polynomials of elements or of the array, or rbf."""

    def __init__(self, model: SklearnRegressor, shape: tuple[int, ...]):
        super().__init__()
        self.last_frame, self.shape = model.last_frame, shape
        self.steps = nn.Sequential(*(MODULES[type(step)](step) for step in _steps(model)))

    def scaling(self, shape: tuple[int, ...]) -> tuple[np.ndarray, np.ndarray]:
        """Return mean and spread of training windows of a shape (frames, elements), or of their last frames."""
        shape = shape[1:] if self.last_frame else shape
        return tuple(getattr(self.steps[0], name).numpy().reshape(shape) for name in ("mean", "spread"))

    def forward(self, readings: torch.Tensor) -> torch.Tensor:
        x = readings[:, -1] if self.last_frame else readings.flatten(1)
        return self.steps(x.double()).float().view(-1, *self.shape)


def is_regression(model: object) -> bool:
    """Tell whether a model is one that `Regression` can hold; its first step knows the range of readings."""
    if not isinstance(model, SklearnRegressor):
        return False
    first, *others = map(type, _steps(model))
    return first is StandardScaler and all(step in MODULES for step in others)


def _steps(model: SklearnRegressor) -> list:
    """Return what a fitted pipeline of scikit-learn does, one after the other; of another estimator, itself."""
    return [step for _, step in getattr(model.estimator, "steps", [("", model.estimator)])]
