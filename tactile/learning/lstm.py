"""Train the latent-space paper's LSTM (section III) on a task, or its read-out alone on model-0's frozen states."""

from pathlib import Path

import numpy as np
import torch
from torch import nn

from tactile.base.errors import InputError
from tactile.datasets.levels import Levels
from tactile.datasets.series import Record
from tactile.learning import cost, weights
from tactile.learning.faults import FaultDraws, drawing
from tactile.learning.series_regressors import Scaling, ridge_weights
from tactile.learning.spec import Spec
from tactile.learning.training import Epoch, FitSummary, Progress, device_of, new_network, run_epochs, solved
from tactile.settings.training import SequenceTraining


class Lstm(nn.Module):
    """tanh, LSTM, linear read-out without bias (section III-A): 4 (h^2 + h n + h) + h m parameters.

    Normalised inputs (N, T, n) to normalised outputs (N, T, m) through h units.
    Differs from paper: eqs. for c and h print a sigmoid where every LSTM library, the authors' too, has tanh.
    torch keeps a second bias vector; it stays zero and is not trained.
    Differs from paper: weights and biases start uniform, as torch's, and without a penalty. Its MATLAB toolbox starts
    the forget gate with a bias of 1 and the recurrent weights orthogonal, and penalises weights by 1e-4, unless told
    otherwise.
    """

    def __init__(self, channels: int, units: int, outputs: int):
        super().__init__()
        self.lstm = nn.LSTM(channels, units, batch_first=True)
        self.lstm.bias_hh_l0.requires_grad_(False).zero_()
        self.readout = nn.Linear(units, outputs, bias=False)

    def latent(self, x: torch.Tensor, state: tuple | None = None) -> tuple[torch.Tensor, tuple]:
        """Return the states (n, T, units) for normalised inputs (n, T, channels), and the last state to go on from.

        state: the state before the first sample, None for zero.
        """
        return self.lstm(torch.tanh(x), state)

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        return self.readout(self.latent(x)[0])


class LstmRegressor:
    """The paper's network. With `transfer`, its recurrent part is model-0's, and only the read-out is trained.

    `ridge`: penalty of a read-out solved in one step, or None to train the read-out with the recipe `training`.
    `units` holds only without `transfer`: model-0 and saved models bring their own number.
    Methods as those of every model of series (tactile/models/__init__.py).

    Differs from paper: it trains the read-out of transfer with the parameters of direct training; the authors' script
    has ten times the learning rate, as here.
    """

    def __init__(
        self, spec: Spec, units: int, training: SequenceTraining | None, *, transfer: bool, ridge: float | None = None
    ):
        self.spec, self.training, self.transfer, self.ridge = spec, training, transfer, ridge
        self.network = Lstm(spec.elements, units, spec.outputs)
        self.summary: FitSummary | None = None
        self.scaling = Scaling(spec.elements, spec.outputs)
        self.state = None

    def fit(
        self,
        records: list[Record],
        *,
        seed: int,
        device: str = "auto",
        progress: Progress = None,
        base: Path | None,
        levels: Levels | None = None,
    ) -> list[dict]:
        """Train; `base` is the folder that model-0 was saved in, for transfer.

        The recipe has nothing to stop or select by, so the validation part is trained on too: 24,000 samples
        of 30,000, as published. Returns one row per epoch (losses in mm squared). levels: what readings were in
        training, for one with faults, whose validation loss is of readings without. Raises InputError for transfer
        without model-0, or from a model-0 of another number of channels, and for faults without levels.
        """
        self.scaling = Scaling.of_training(records)
        units = self.network.lstm.hidden_size
        self.network = new_network(lambda: Lstm(self.spec.elements, units, self.spec.outputs), seed)
        if self.transfer:
            if base is None:
                raise InputError(
                    "transfer starts from model-0, so it cannot be model-0 itself; name a model like lstm_direct as "
                    "model_zero in the settings"
                )
            self._take_recurrent_part(base)
        place = device_of(device, series=True)
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
        faults = drawing(self, levels, seed, place, self.scaling.x_mean, self.scaling.x_spread)
        if self.transfer and not faults:  # frozen states: computed once
            with torch.no_grad():
                parts = [[self.network.latent(x)[0], *others] for x, *others in parts]
            forward = self.network.readout
        elif not self.transfer:
            parts = [[_streams(column, self.training.streams) for column in part] for part in parts]
        order = torch.Generator().manual_seed(seed)
        history = self._solve(parts) if self.ridge is not None else self._train(forward, parts, order, faults, progress)
        self.network.to("cpu")
        return history

    def _train(
        self,
        forward: nn.Module,
        parts: list[list],
        order: torch.Generator,
        faults: FaultDraws | None,
        progress: Progress,
    ) -> list[dict]:
        """Train `forward` by the recipe; parts: inputs, targets, counted and validation masks of each record."""
        t = self.training
        trained = [weight for weight in self.network.parameters() if weight.requires_grad]
        optimiser = torch.optim.Adam(trained, lr=t.learning_rate)
        schedule = torch.optim.lr_scheduler.MultiStepLR(optimiser, [t.drop_epoch], t.drop)
        samples, unit = max(1, sum(int(counted.sum()) for _, _, counted, _ in parts)), self.scaling.squared_mm()

        def run_epoch(epoch: int) -> Epoch:
            total, validation, held_samples, rate = 0.0, 0.0, 0, optimiser.param_groups[0]["lr"]
            for part in parts:
                for chosen in torch.randperm(len(part[0]), generator=order).to(part[0].device).split(t.batch):
                    x, y, counted, held = (column[chosen] for column in part)
                    seen = faults.changed(x, faults.drawn(len(x)).to(x.device)) if faults else x
                    error = (forward(seen) - y).square().mean(2)
                    of_held = error.detach()
                    if faults and held.any():
                        with torch.no_grad():
                            of_held = (forward(x) - y).square().mean(2)
                    optimiser.zero_grad()
                    (error[counted].sum() / max(1, int(counted.sum()))).backward()
                    nn.utils.clip_grad_norm_(trained, t.clip)
                    optimiser.step()
                    total += float(error.detach()[counted].sum()) / samples
                    validation += float(of_held[held].sum())
                    held_samples += int(held.sum())
            schedule.step()
            return Epoch(total * unit, validation / held_samples * unit if held_samples else None, rate)

        history, self.summary = run_epochs(self.network, t.epochs, run_epoch, progress=progress, keep_last=True)
        return history

    def _solve(self, parts: list[list]) -> list[dict]:
        """Set the read-out to the ridge regression on the states; parts as for `_train`, states for inputs."""
        latent = torch.cat([x[counted] for x, _, counted, _ in parts]).double().cpu().numpy()
        y = torch.cat([y[counted] for _, y, counted, _ in parts]).double().cpu().numpy()
        readout = ridge_weights(latent, y, self.ridge)
        self.network.readout.weight.data = torch.from_numpy(readout.T).float()
        held = torch.cat([held[counted] for *_, counted, held in parts]).cpu().numpy()
        error = np.square(latent @ readout - y).mean(1) * self.scaling.squared_mm()
        history, self.summary = solved(float(error.mean()), float(error[held].mean()) if held.any() else None)
        return history

    def latents(self, x: np.ndarray) -> np.ndarray:
        """Return the states (T, units) for voltages (T, channels), from a zero state."""
        with torch.no_grad():
            return self.network.latent(self.scaling.inputs(x)[None])[0][0].numpy()

    def predict(self, x: np.ndarray) -> np.ndarray:
        """Return outputs (T, outputs) in mm for a series of voltages (T, channels), from a zero state."""
        with torch.no_grad():
            return self.scaling.millimetres(self.network(self.scaling.inputs(x)[None])[0])

    def step(self, x: np.ndarray) -> np.ndarray:
        """Return outputs (n, outputs) in mm for the next sample (n, channels) of n streams."""
        if self.state is not None and self.state[0].shape[1] != len(x):
            self.state = None
        with torch.no_grad():
            latent, self.state = self.network.latent(self.scaling.inputs(x)[:, None], self.state)
            return self.scaling.millimetres(self.network.readout(latent[:, 0]))

    def save(self, folder: Path) -> None:
        """Write weights and scaling to `folder` (which exists), as safetensors."""
        weights.save(folder, weights.grouped("network", self.network.state_dict()) | self.scaling.state_dict())

    def load(self, folder: Path) -> None:
        """Read weights and scaling from `folder`, with the number of units saved there.

        Raises InputError where the file is absent, damaged or of another model.
        """
        tensors = weights.read(folder)
        recurrent = weights.group_of(tensors, "network.lstm")
        shape = recurrent["weight_hh_l0"].shape if "weight_hh_l0" in recurrent else ()
        if len(shape) != 2 or not 0 < 4 * shape[1] == shape[0]:  # else it may ask for more units than it has numbers
            raise weights.other_settings(folder)
        self.network = Lstm(self.spec.elements, shape[1], self.spec.outputs)
        self._freeze()
        weights.load(self.network, weights.group_of(tensors, "network"), folder)
        weights.load(self.scaling, weights.constants(tensors), folder)
        self.network.eval()

    def parameters(self) -> int:
        """Return the number of trainable parameters: the read-out's alone after transfer."""
        return cost.parameters(self.network)

    def macs(self) -> int:
        """Return the multiply-accumulates for one sample."""
        return cost.multiply_accumulates(self.network, torch.zeros(1, 1, self.spec.elements))

    def _take_recurrent_part(self, base: Path) -> None:
        """Replace the recurrent part by that of the model-0 saved in the folder `base`, and freeze it."""
        recurrent = weights.group_of(weights.read(base), "network.lstm")
        units, channels = recurrent["weight_hh_l0"].shape[1], recurrent["weight_ih_l0"].shape[1]
        if channels != self.spec.elements:
            raise InputError(f"{base}: model-0 has {channels} channels, this task {self.spec.elements}")
        if units != self.network.lstm.hidden_size:
            with torch.random.fork_rng(devices=[]):
                self.network = Lstm(channels, units, self.spec.outputs)
        self.network.lstm.load_state_dict(recurrent)
        self._freeze()

    def _freeze(self) -> None:
        if self.transfer:
            self.network.lstm.requires_grad_(False)


def _streams(column: torch.Tensor, streams: int) -> torch.Tensor:
    """Cut (1, T, ...) into (streams, T // streams, ...), leaving out the first samples, which do not fill a stream."""
    length = column.shape[1] // streams
    return column[0, column.shape[1] - streams * length :].view(streams, length, *column.shape[2:])
