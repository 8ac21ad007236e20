"""Regressors for series: the paper's LSTM, read-outs on frozen states, and window models used on a series.

All have the same methods: `fit(records, *, seed, device, progress, base)`, `predict(x)` (T, channels) in V to
(T, outputs) in mm where sample t uses nothing later than t, `step(x)` (n, channels) for the next sample of n
parallel streams, `save`, `load`, `parameters`, `macs` (for one sample) and `summary`.
"""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import torch
from safetensors.torch import save_file
from torch import nn

from pipeline.base.blocks import SequenceTraining
from pipeline.base.errors import InputError
from pipeline.datasets.series import Record, Task
from pipeline.learning import cost
from pipeline.learning.regressors import NETWORK_FILE, SklearnRegressor, Spec, TorchRegressor, read_tensors
from pipeline.learning.training import Epoch, FitSummary, Progress, device_of, history_row, run_epochs

MILLIVOLT = 1e3  # window models see mV: the smallest spread that fitting.py scales by is 1
LARGEST_CHUNK = 20_000  # windows predicted at once


class Scaling:
    """Mean and spread of inputs and outputs over the training samples. Differs from paper: its authors' script
    takes them from the whole record, test part included.
    """

    def __init__(self, records: list[Record]):
        x = np.concatenate([record.x[record.training] for record in records]).astype(np.float64)
        y = np.concatenate([record.y[record.training & record.counted] for record in records]).astype(np.float64)
        if not len(x) or not len(y):
            raise InputError("no sample in the training part; record longer")
        self.tensors = {
            "x_mean": torch.from_numpy(x.mean(0)).float(),
            "x_spread": torch.from_numpy(np.maximum(x.std(0), 1e-6)).float(),  # 1 uV: below is no signal
            "y_mean": torch.from_numpy(y.mean(0)).float(),
            "y_spread": torch.from_numpy(np.maximum(y.std(0), 1e-6)).float(),
        }

    @classmethod
    def loaded(cls, tensors: dict[str, torch.Tensor]) -> "Scaling":
        """Scaling with given numbers."""
        scaling = cls.__new__(cls)
        scaling.tensors = tensors
        return scaling

    def inputs(self, x: np.ndarray) -> torch.Tensor:
        """Normalised inputs (T, channels)."""
        return (torch.from_numpy(np.array(x, np.float32)) - self.tensors["x_mean"]) / self.tensors["x_spread"]

    def targets(self, y: np.ndarray) -> torch.Tensor:
        """Normalised outputs (T, outputs)."""
        return (torch.from_numpy(np.array(y, np.float32)) - self.tensors["y_mean"]) / self.tensors["y_spread"]

    def millimetres(self, y: torch.Tensor) -> np.ndarray:
        """Outputs (T, outputs) in mm from normalised ones."""
        return (y * self.tensors["y_spread"] + self.tensors["y_mean"]).numpy()

    def squared_mm(self) -> float:
        """What one unit of normalised squared error is worth in mm squared, mean over outputs."""
        return float(self.tensors["y_spread"].square().mean())


class Lstm(nn.Module):
    """tanh, LSTM, linear read-out without bias (section III-A): 4 (h^2 + h n + h) + h m parameters.

    Differs from paper: eqs. for c and h print a sigmoid where every LSTM library, the authors' too, has tanh.
    torch keeps a second bias vector; it stays zero and is not trained.
    """

    def __init__(self, channels: int, units: int, outputs: int):
        super().__init__()
        self.lstm = nn.LSTM(channels, units, batch_first=True)
        self.lstm.bias_hh_l0.requires_grad_(False).zero_()
        self.readout = nn.Linear(units, outputs, bias=False)

    def latent(self, x: torch.Tensor, state=None) -> tuple[torch.Tensor, tuple]:
        """States (n, T, units) for normalised inputs (n, T, channels), and what to go on from."""
        return self.lstm(torch.tanh(x), state)

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        return self.readout(self.latent(x)[0])


class LstmRegressor:
    """The paper's network. With `base`, its recurrent part is model-0's, and only the read-out is trained.

    `closed_form`: ridge penalty of a read-out solved in one step, or None to train it with the recipe.
    """

    def __init__(
        self, spec: Spec, units: int, training: SequenceTraining | None, *, transfer: bool, ridge: float | None = None
    ):
        self.spec, self.training, self.transfer, self.ridge = spec, training, transfer, ridge
        self.network = Lstm(spec.elements, units, spec.outputs)
        self.summary: FitSummary | None = None
        self.scaling: Scaling | None = None
        self.state = None

    def fit(
        self, records: list[Record], *, seed: int, device: str = "auto", progress: Progress = None, base: Path | None
    ) -> list[dict]:
        """Train; `base`: the folder that model-0 was saved in, for transfer.

        The recipe has nothing to stop or select by, so the validation part is trained on too: 24,000 samples
        of 30,000, as published. Returns a row an epoch (losses in mm squared).
        """
        self.scaling = Scaling(records)
        with torch.random.fork_rng(devices=[]):
            torch.manual_seed(seed)
            self.network = Lstm(self.spec.elements, self.network.lstm.hidden_size, self.spec.outputs)
        if self.transfer:
            if base is None:
                raise InputError(
                    "transfer starts from model-0, so it cannot be model-0 itself; name a model like lstm_direct as "
                    "model_zero in params.yaml"
                )
            self._take_recurrent_part(base)
        place = device_of(device)
        self.network.to(place)
        parts = [
            [
                self.scaling.inputs(record.x)[None].to(place),
                self.scaling.targets(record.y)[None].to(place),
                torch.from_numpy(record.counted)[None].to(place),
                torch.from_numpy(record.counted & ~record.training)[None].to(place),
            ]
            for record in records
        ]
        forward = self.network
        if self.transfer:  # frozen states: computed once
            with torch.no_grad():
                parts = [[self.network.latent(x)[0], *others] for x, *others in parts]
            forward = self.network.readout
        else:
            parts = [[_streams(column, self.training.streams) for column in part] for part in parts]
        order = torch.Generator().manual_seed(seed)
        history = self._solve(parts) if self.ridge is not None else self._train(forward, parts, order, progress)
        self.network.to("cpu")
        return history

    def _train(self, forward: nn.Module, parts: list[list], order: torch.Generator, progress: Progress) -> list[dict]:
        t = self.training
        weights = [weight for weight in self.network.parameters() if weight.requires_grad]
        optimiser = torch.optim.Adam(weights, lr=t.learning_rate)
        schedule = torch.optim.lr_scheduler.MultiStepLR(optimiser, [t.drop_epoch], t.drop)
        rows, unit = max(1, sum(int(counted.sum()) for _, _, counted, _ in parts)), self.scaling.squared_mm()

        def run_epoch() -> Epoch:
            total, validation, samples, rate = 0.0, 0.0, 0, optimiser.param_groups[0]["lr"]
            for part in parts:
                for chosen in torch.randperm(len(part[0]), generator=order).to(part[0].device).split(t.batch):
                    x, y, counted, held = (column[chosen] for column in part)
                    error = (forward(x) - y).square().mean(2)
                    optimiser.zero_grad()
                    (error[counted].sum() / max(1, int(counted.sum()))).backward()
                    nn.utils.clip_grad_norm_(weights, t.clip)
                    optimiser.step()
                    total += float(error.detach()[counted].sum()) / rows
                    validation += float(error.detach()[held].sum())
                    samples += int(held.sum())
            schedule.step()
            return Epoch(total * unit, validation / samples * unit if samples else None, rate)

        history, self.summary = run_epochs(self.network, t.max_epochs, run_epoch, progress=progress, keep_last=True)
        return history

    def _solve(self, parts: list[list]) -> list[dict]:
        latent = torch.cat([x[counted] for x, _, counted, _ in parts]).double().cpu().numpy()
        y = torch.cat([y[counted] for _, y, counted, _ in parts]).double().cpu().numpy()
        weights = ridge_weights(latent, y, self.ridge)
        self.network.readout.weight.data = torch.from_numpy(weights.T).float()
        held = torch.cat([held[counted] for *_, counted, held in parts]).cpu().numpy()
        error = np.square(latent @ weights - y).mean(1) * self.scaling.squared_mm()
        self.summary = FitSummary("closed_form", 1)
        return [history_row(1, Epoch(float(error.mean()), float(error[held].mean()) if held.any() else None, 0.0))]

    def latents(self, x: np.ndarray) -> np.ndarray:
        """States (T, units) for voltages (T, channels)."""
        with torch.no_grad():
            return self.network.latent(self.scaling.inputs(x)[None])[0][0].numpy()

    def predict(self, x: np.ndarray) -> np.ndarray:
        """Outputs (T, outputs) in mm for a series of voltages (T, channels), from a zero state."""
        with torch.no_grad():
            return self.scaling.millimetres(self.network(self.scaling.inputs(x)[None])[0])

    def step(self, x: np.ndarray) -> np.ndarray:
        """Outputs (n, outputs) in mm for the next sample (n, channels) of n streams."""
        if self.state is not None and self.state[0].shape[1] != len(x):
            self.state = None
        with torch.no_grad():
            latent, self.state = self.network.latent(self.scaling.inputs(x)[:, None], self.state)
            return self.scaling.millimetres(self.network.readout(latent[:, 0]))

    def save(self, folder: Path) -> None:
        """Weights and scaling as safetensors in `folder` (which exists)."""
        tensors = {f"network.{name}": value.contiguous() for name, value in self.network.state_dict().items()}
        save_file(tensors | self.scaling.tensors, Path(folder) / NETWORK_FILE)

    def load(self, folder: Path) -> None:
        """Take weights and scaling from `folder`, with the number of units saved there.

        Raises InputError where the files are absent, damaged or of another model.
        """
        tensors = read_tensors(folder)
        weights = {name.removeprefix("network."): value for name, value in tensors.items() if "." in name}
        try:
            self.network = Lstm(self.spec.elements, weights["lstm.weight_hh_l0"].shape[1], self.spec.outputs)
            self._freeze()
            self.network.load_state_dict(weights)
        except (KeyError, RuntimeError) as error:
            raise InputError(f"{folder}: was saved by a model with other settings; train the model again") from error
        self.scaling = Scaling.loaded({name: value for name, value in tensors.items() if "." not in name})
        self.network.eval()

    def parameters(self) -> int:
        """Number of trainable parameters: the read-out's alone after transfer."""
        return cost.parameters(self.network)

    def macs(self) -> int:
        """Multiply-accumulates for one sample."""
        return cost.multiply_accumulates(self.network, torch.zeros(1, 1, self.spec.elements))

    def _take_recurrent_part(self, base: Path) -> None:
        weights = {name: value for name, value in read_tensors(base).items() if name.startswith("network.lstm.")}
        lstm = {name.removeprefix("network.lstm."): value for name, value in weights.items()}
        units, channels = lstm["weight_hh_l0"].shape[1], lstm["weight_ih_l0"].shape[1]
        if channels != self.spec.elements:
            raise InputError(f"{base}: model-0 has {channels} channels, this task {self.spec.elements}")
        if units != self.network.lstm.hidden_size:
            with torch.random.fork_rng(devices=[]):
                self.network = Lstm(channels, units, self.spec.outputs)
        self.network.lstm.load_state_dict(lstm)
        self._freeze()

    def _freeze(self) -> None:
        if self.transfer:
            self.network.lstm.requires_grad_(False)


class StateReadout:
    """A closed-form read-out on the states of a fixed dynamical system (a reservoir).

    `make(channels, seed)` returns the system's arrays by name; `advance(arrays, x, state)` maps normalised inputs
    (n, T, channels) and a state (n, units), or None at rest, to states (n, T, units).
    """

    def __init__(self, spec: Spec, make: Callable, advance: Callable, ridge: float, macs: int):
        self.spec, self.make, self.advance, self.ridge, self.cost = spec, make, advance, ridge, macs
        self.summary: FitSummary | None = None
        self.state = None

    def fit(
        self, records: list[Record], *, seed: int, device: str = "auto", progress: Progress = None, base=None
    ) -> list[dict]:
        """Solve the read-out on the training samples; one row of history (losses in mm squared)."""
        self.scaling = Scaling(records)
        self.system = self.make(self.spec.elements, seed)
        parts = [(self._states(record.x), self.scaling.targets(record.y).numpy(), record) for record in records]
        chosen = [record.training & record.counted for *_, record in parts]
        held = [~record.training & record.counted for *_, record in parts]
        pick = lambda k, masks: np.concatenate([p[k][m] for p, m in zip(parts, masks, strict=True)])  # noqa: E731
        self.weights = ridge_weights(pick(0, chosen), pick(1, chosen), self.ridge)
        losses = [
            float(np.square(pick(0, masks) @ self.weights - pick(1, masks)).mean()) * self.scaling.squared_mm()
            for masks in (chosen, held)
        ]
        self.summary = FitSummary("closed_form", 1)
        return [history_row(1, Epoch(*losses, 0.0))]

    def _states(self, x: np.ndarray) -> np.ndarray:
        states = self.advance(self.system, self.scaling.inputs(x).numpy()[None], None)[0]
        return np.concatenate([states, np.ones((len(states), 1))], axis=1)

    def predict(self, x: np.ndarray) -> np.ndarray:
        """Outputs (T, outputs) in mm for a series of voltages (T, channels), from a zero state."""
        return self.scaling.millimetres(torch.from_numpy(self._states(x) @ self.weights).float())

    def step(self, x: np.ndarray) -> np.ndarray:
        """Outputs (n, outputs) in mm for the next sample (n, channels) of n streams."""
        if self.state is not None and len(self.state) != len(x):
            self.state = None
        self.state = self.advance(self.system, self.scaling.inputs(x).numpy()[:, None], self.state)[:, 0]
        outputs = self.state @ self.weights[:-1] + self.weights[-1]
        return self.scaling.millimetres(torch.from_numpy(outputs).float())

    def save(self, folder: Path) -> None:
        """The system, the read-out and the scaling as safetensors in `folder` (which exists)."""
        system = {f"system.{name}": torch.from_numpy(value) for name, value in self.system.items()}
        readout = {"readout.weights": torch.from_numpy(np.ascontiguousarray(self.weights))}
        save_file(system | readout | self.scaling.tensors, Path(folder) / NETWORK_FILE)

    def load(self, folder: Path) -> None:
        """Take everything from `folder`; InputError where the file is absent, damaged or of another model."""
        tensors = read_tensors(folder)
        if "readout.weights" not in tensors:
            raise InputError(f"{folder}: was saved by a model with other settings; train the model again")
        self.system = {
            name.removeprefix("system."): value.numpy() for name, value in tensors.items() if name.startswith("system.")
        }
        self.weights = tensors["readout.weights"].numpy()
        self.scaling = Scaling.loaded({name: value for name, value in tensors.items() if "." not in name})

    def parameters(self) -> int:
        """Number of fitted numbers: the read-out's."""
        return self.weights.size

    def macs(self) -> int:
        """Multiply-accumulates for one sample."""
        return self.cost


class Windowed:
    """A model of windows (n, frames, channels) used on a series: sample t is answered from the window that ends at t.

    Before the first full window the first sample is repeated.
    """

    def __init__(self, inner: SklearnRegressor | TorchRegressor, spec: Spec):
        self.inner, self.spec, self.buffer = inner, spec, None

    @property
    def summary(self) -> FitSummary | None:
        """How the fit ended."""
        return self.inner.summary

    def fit(
        self, records: list[Record], *, seed: int, device: str = "auto", progress: Progress = None, base=None
    ) -> list[dict]:
        """Fit the window model on all windows that end at a counted sample."""
        windows = [self._windows(record.x) for record in records]
        masks = [(record.counted & record.training, record.counted & ~record.training) for record in records]
        train, validation = (
            (
                np.concatenate([x[mask[k]] for x, mask in zip(windows, masks, strict=True)]),
                np.concatenate([record.y[mask[k]] for record, mask in zip(records, masks, strict=True)]),
            )
            for k in (0, 1)
        )
        return self.inner.fit(train, validation, seed=seed, device=device, progress=progress)

    def _windows(self, x: np.ndarray) -> np.ndarray:
        frames = self.spec.frames
        padded = np.concatenate([np.repeat(x[:1], frames - 1, axis=0), x]).astype(np.float32) * MILLIVOLT
        return np.lib.stride_tricks.sliding_window_view(padded, frames, axis=0).transpose(0, 2, 1)

    def predict(self, x: np.ndarray) -> np.ndarray:
        """Outputs (T, outputs) in mm for a series of voltages (T, channels)."""
        windows = self._windows(x)
        chunks = range(0, len(windows), LARGEST_CHUNK)
        return np.concatenate([self.inner.predict(windows[k : k + LARGEST_CHUNK]) for k in chunks])

    def step(self, x: np.ndarray) -> np.ndarray:
        """Outputs (n, outputs) in mm for the next sample (n, channels) of n streams."""
        newest = np.asarray(x, np.float32)[:, None] * MILLIVOLT
        if self.buffer is None or len(self.buffer) != len(x):
            self.buffer = np.repeat(newest, self.spec.frames, axis=1)
        self.buffer = np.concatenate([self.buffer[:, 1:], newest], axis=1)
        return self.inner.predict(self.buffer)

    def save(self, folder: Path) -> None:
        """As the window model."""
        self.inner.save(folder)

    def load(self, folder: Path) -> None:
        """As the window model."""
        self.inner.load(folder)

    def parameters(self) -> int:
        """As the window model."""
        return self.inner.parameters()

    def macs(self) -> int | None:
        """As the window model: a whole window for every sample."""
        return self.inner.macs()


def spec_of(task: Task, frames: int) -> Spec:
    """Shapes of a task as one row of channels and one row of outputs; `frames`: what window models look back."""
    return Spec(frames, 1, len(next(iter(task.channels.values()))), 1, len(task.outputs))


def adapted(model, spec: Spec):
    """`model` itself if it is made for series, else its use on a series."""
    return model if hasattr(model, "step") else Windowed(model, spec)


def ridge_weights(states: np.ndarray, y: np.ndarray, penalty: float) -> np.ndarray:
    """(units, outputs) that minimise |states w - y|^2 / T + penalty |w|^2; states (T, units), y (T, outputs)."""
    gram = states.T @ states / len(states)
    return np.linalg.solve(gram + penalty * np.eye(len(gram)), states.T @ y / len(states))


def _streams(column: torch.Tensor, streams: int) -> torch.Tensor:
    """(1, T, ...) as (streams, T // streams, ...); the first samples that do not fill a stream are left out."""
    length = column.shape[1] // streams
    return column[0, column.shape[1] - streams * length :].view(streams, length, *column.shape[2:])
