"""Regress series: read-outs on frozen states, window models used on a series, and the scaling that all share.

Models without a rule that stops training by validation are fitted to the training and the validation part, so that in
one table all have seen the same samples, up to the test part. Settings are chosen before, by fits to training alone.
The paper's LSTM is in `lstm.py`. tactile/models/__init__.py says what a model of series provides.
"""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import torch
from torch import nn

from tactile.base import foreign
from tactile.base.errors import InputError
from tactile.datasets.levels import Levels
from tactile.datasets.series import Record
from tactile.learning import weights
from tactile.learning.estimators import SklearnRegressor
from tactile.learning.regressors import TorchRegressor
from tactile.learning.spec import Spec
from tactile.learning.training import FitSummary, Progress, solved

MILLIVOLT = 1e3  # window models see mV: the smallest spread that regressors.py scales by is 1
LARGEST_CHUNK = 20_000  # windows predicted at once


class Scaling(nn.Module):
    """Mean and spread of inputs (V) and outputs (mm), as buffers; `of_training` takes them from training samples."""

    def __init__(self, channels: int, outputs: int):
        super().__init__()
        for name, size in (("x", channels), ("y", outputs)):
            self.register_buffer(f"{name}_mean", torch.zeros(size))
            self.register_buffer(f"{name}_spread", torch.ones(size))

    @classmethod
    def of_training(cls, records: list[Record]) -> "Scaling":
        """Return the scaling of the training samples of records; InputError where there is none.

        Differs from paper: the authors' script normalises by the whole record, test part included.
        """
        x = np.concatenate([record.x[record.training] for record in records]).astype(np.float64)
        y = np.concatenate([record.y[record.training & record.counted] for record in records]).astype(np.float64)
        if not len(x) or not len(y):
            raise InputError("no sample in the training part; record longer")
        scaling = cls(x.shape[1], y.shape[1])
        for name, values in (("x", x), ("y", y)):
            spread = np.maximum(values.std(0), 1e-6)  # 1 uV, 1 nm: below is no signal
            for of, value in (("mean", values.mean(0)), ("spread", spread)):
                getattr(scaling, f"{name}_{of}").copy_(torch.from_numpy(value))
        return scaling

    def normalised(self, x: torch.Tensor) -> torch.Tensor:
        """Return normalised inputs (..., channels) for voltages x."""
        return (x - self.x_mean) / self.x_spread

    def in_mm(self, y: torch.Tensor) -> torch.Tensor:
        """Return outputs (..., outputs) in mm for normalised outputs y."""
        return y * self.y_spread + self.y_mean

    def inputs(self, x: np.ndarray) -> torch.Tensor:
        """Return normalised inputs (T, channels) for voltages x (T, channels)."""
        return self.normalised(torch.from_numpy(np.array(x, np.float32)))

    def targets(self, y: np.ndarray) -> torch.Tensor:
        """Return normalised outputs (T, outputs) for y (T, outputs) in mm."""
        return (torch.from_numpy(np.array(y, np.float32)) - self.y_mean) / self.y_spread

    def millimetres(self, y: torch.Tensor) -> np.ndarray:
        """Return outputs (T, outputs) in mm for normalised outputs y."""
        return self.in_mm(y).numpy()

    def squared_mm(self) -> float:
        """Return the mm squared, mean over outputs, in one unit of normalised squared error."""
        return float(self.y_spread.square().mean())


class StateReadout:
    """A closed-form read-out on the states of a fixed dynamical system (a reservoir).

    `make(channels, seed)` returns the system's arrays by name; `advance(arrays, x, state)` maps normalised inputs
    (n, T, channels) and a state (n, units), or None at rest, to states (n, T, units). `ridge`: penalty of the
    read-out, as for `ridge_weights`; `macs`: multiply-accumulates for one sample.
    """

    def __init__(self, spec: Spec, make: Callable, advance: Callable, ridge: float, macs: int):
        self.spec, self.make, self.advance, self.ridge, self.cost = spec, make, advance, ridge, macs
        self.summary: FitSummary | None = None
        self.scaling = Scaling(spec.elements, spec.outputs)
        self.state = None

    def fit(
        self, records: list[Record], *, seed: int, device: str = "auto", progress: Progress = None, base=None
    ) -> list[dict]:
        """Solve the read-out on training and validation part; return one row of history (losses in mm squared)."""
        self.scaling = Scaling.of_training(records)
        self.system = self.make(self.spec.elements, seed)
        parts = [(self._states(record.x), self.scaling.targets(record.y).numpy(), record) for record in records]
        chosen = [record.counted for *_, record in parts]
        held = [~record.training & record.counted for *_, record in parts]
        pick = lambda k, masks: np.concatenate([p[k][m] for p, m in zip(parts, masks, strict=True)])  # noqa: E731
        self.weights = ridge_weights(pick(0, chosen), pick(1, chosen), self.ridge)
        losses = [
            float(np.square(pick(0, masks) @ self.weights - pick(1, masks)).mean()) * self.scaling.squared_mm()
            for masks in (chosen, held)
        ]
        history, self.summary = solved(*losses)
        return history

    def _states(self, x: np.ndarray) -> np.ndarray:
        """Return the states and a column of ones (T, units + 1) for voltages x (T, channels), from rest."""
        states = self.advance(self.system, self.scaling.inputs(x).numpy()[None], None)[0]
        return np.concatenate([states, np.ones((len(states), 1))], axis=1)

    def predict(self, x: np.ndarray) -> np.ndarray:
        """Return outputs (T, outputs) in mm for a series of voltages (T, channels), from rest."""
        return self.scaling.millimetres(torch.from_numpy(self._states(x) @ self.weights).float())

    def step(self, x: np.ndarray) -> np.ndarray:
        """Return outputs (n, outputs) in mm for the next sample (n, channels) of n streams."""
        if self.state is not None and len(self.state) != len(x):
            self.state = None
        self.state = self.advance(self.system, self.scaling.inputs(x).numpy()[:, None], self.state)[:, 0]
        outputs = self.state @ self.weights[:-1] + self.weights[-1]
        return self.scaling.millimetres(torch.from_numpy(outputs).float())

    def save(self, folder: Path) -> None:
        """Write the system, the read-out and the scaling to `folder` (which exists), as safetensors."""
        system = {name: torch.from_numpy(array) for name, array in self.system.items()}
        readout = {"weights": torch.from_numpy(self.weights)}
        weights.save(
            folder, weights.grouped("system", system) | weights.grouped("readout", readout) | self.scaling.state_dict()
        )

    def load(self, folder: Path) -> None:
        """Read everything from `folder`; InputError where the file is absent, damaged or of another model."""
        tensors = weights.read(folder)
        if "readout.weights" not in tensors:
            raise weights.other_settings(folder)
        weights.load(self.scaling, weights.constants(tensors), folder)
        with foreign.reading(
            Path(folder) / weights.NETWORK_FILE, "a model with these settings", "train the model again"
        ):
            self.system = {name: value.numpy() for name, value in weights.group_of(tensors, "system").items()}
            self.weights = tensors["readout.weights"].numpy()
            units = len(self.weights) - 1
            shapes = {"reservoir": (units, units), "input": (self.spec.elements, units), "bias": (units,)}
            if {name: array.shape for name, array in self.system.items()} != shapes:
                raise ValueError(f"it has no reservoir of {units} units for {self.spec.elements} channels")
            if self.weights.shape != (units + 1, self.spec.outputs):
                raise ValueError(f"it does not predict {self.spec.outputs} outputs")

    def parameters(self) -> int:
        """Return the number of fitted numbers: the read-out's."""
        return self.weights.size

    def macs(self) -> int:
        """Return the multiply-accumulates for one sample."""
        return self.cost


class Windowed:
    """A model of windows (n, frames, channels) used on a series: the window that ends at sample t answers it.

    Before the first full window the first sample is repeated.
    """

    def __init__(self, inner: SklearnRegressor | TorchRegressor, spec: Spec):
        self.inner, self.spec, self.buffer = inner, spec, None

    @property
    def summary(self) -> FitSummary | None:
        """How the fit ended."""
        return self.inner.summary

    def fit(
        self,
        records: list[Record],
        *,
        seed: int,
        device: str = "auto",
        progress: Progress = None,
        base=None,
        levels: Levels | None = None,
    ) -> list[dict]:
        """Fit the window model on all windows that end at a counted sample; return its history.

        A network, which stops by validation, is fitted to windows of the training part alone. levels: in V, for a
        training with faults.
        """
        windows = [self._windows(record.x) for record in records]
        stops = isinstance(self.inner, TorchRegressor)
        masks = [
            (record.counted & record.training if stops else record.counted, record.counted & ~record.training)
            for record in records
        ]
        train, validation = (
            (
                np.concatenate([x[mask[k]] for x, mask in zip(windows, masks, strict=True)]),
                np.concatenate([record.y[mask[k]] for record, mask in zip(records, masks, strict=True)]),
            )
            for k in (0, 1)
        )
        further = {} if levels is None else {"levels": levels.times(MILLIVOLT)}
        return self.inner.fit(train, validation, seed=seed, device=device, progress=progress, **further)

    def _windows(self, x: np.ndarray) -> np.ndarray:
        """Return the windows (T, frames, channels) in mV that end at each of the samples x (T, channels) in V."""
        frames = self.spec.frames
        padded = np.concatenate([np.repeat(x[:1], frames - 1, axis=0), x]).astype(np.float32) * MILLIVOLT
        return np.lib.stride_tricks.sliding_window_view(padded, frames, axis=0).transpose(0, 2, 1)

    def predict(self, x: np.ndarray) -> np.ndarray:
        """Return outputs (T, outputs) in mm for a series of voltages (T, channels)."""
        windows = self._windows(x)
        chunks = range(0, len(windows), LARGEST_CHUNK)
        return np.concatenate([self.inner.predict(windows[k : k + LARGEST_CHUNK]) for k in chunks])

    def step(self, x: np.ndarray) -> np.ndarray:
        """Return outputs (n, outputs) in mm for the next sample (n, channels) of n streams."""
        newest = np.asarray(x, np.float32)[:, None] * MILLIVOLT
        if self.buffer is None or len(self.buffer) != len(x):
            self.buffer = np.repeat(newest, self.spec.frames, axis=1)
        self.buffer = np.concatenate([self.buffer[:, 1:], newest], axis=1)
        return self.inner.predict(self.buffer)

    def save(self, folder: Path) -> None:
        """Write the window model to `folder`."""
        self.inner.save(folder)

    def load(self, folder: Path) -> None:
        """Read the window model from `folder`; errors as the window model's."""
        self.inner.load(folder)

    def parameters(self) -> int:
        """Return the window model's number of fitted numbers."""
        return self.inner.parameters()

    def macs(self) -> int | None:
        """Return the multiply-accumulates for one sample: the window model's for a whole window."""
        return self.inner.macs()


def adapted(model, spec: Spec):
    """Return `model` itself if it is made for series (it has `step`), else `model` wrapped for use on a series."""
    return model if hasattr(model, "step") else Windowed(model, spec)


def ridge_weights(states: np.ndarray, y: np.ndarray, penalty: float) -> np.ndarray:
    """Return the w (units, outputs) of least |states w - y|^2 / T + penalty |w|^2.

    states: (T, units), y: (T, outputs).
    """
    gram = states.T @ states / len(states)
    return np.linalg.solve(gram + penalty * np.eye(len(gram)), states.T @ y / len(states))
