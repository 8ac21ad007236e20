"""Train a network on windows and predict with it; `Spec`, the shapes of a task, is here too."""

from collections.abc import Callable, Iterable, Iterator
from pathlib import Path

import numpy as np
import torch
from torch import nn

from tactile.base.errors import InputError
from tactile.datasets.levels import Levels
from tactile.learning import cost, faults, weights
from tactile.learning.spec import Spec
from tactile.learning.training import (
    BETAS,
    Epoch,
    FitSummary,
    Progress,
    Schedule,
    device_of,
    new_network,
    precision_on,
    products_in,
    run_epochs,
)
from tactile.learning.updates import Update, adam, stream_on
from tactile.settings.training import ScheduledTraining

SMALLEST_SPREAD = 1.0  # ADC counts: below one count an element's spread is rounding, not signal
LARGEST_BATCH = 128  # windows per prediction step: keeps the temporaries of every network in cache


Windows = tuple[np.ndarray, np.ndarray]  # x (n, frames, elements) in ADC counts, y (n, outputs) in kPa


class Scaled(nn.Module):
    """A network and the constants that scale it: readings (n, frames, elements) to maps (n, outputs) in their unit."""

    def __init__(self, network: nn.Module, mean: torch.Tensor, spread: torch.Tensor, output_scale: torch.Tensor):
        super().__init__()
        self.network = network  # normalised windows to normalised maps
        self.register_buffer("input_mean", mean)  # (elements,)
        self.register_buffer("input_spread", spread)  # (elements,)
        self.register_buffer("output_scale", output_scale)  # ()

    def normalised(self, x: torch.Tensor) -> torch.Tensor:
        """Return readings (..., elements) as the network takes them."""
        return (x - self.input_mean) / self.input_spread

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        return self.network(self.normalised(x)) * self.output_scale


class TorchRegressor:
    """A network that maps normalised windows (n, frames, elements) to normalised maps (n, outputs)."""

    streams = False  # True: carries its state from window to window, see `models/lomp_stream.py`
    largest_gradient = float("inf")  # norm that the gradient of an update is cut to, for normalised labels
    chunk = 1 << 30  # windows of a batch that go through the network at once; the gradients of a batch add up

    def __init__(self, make_network: Callable[[], nn.Module], spec: Spec, training: ScheduledTraining):
        self.make_network = make_network
        self.spec = spec
        self.training = training
        self.summary: FitSummary | None = None
        self.precision: str | None = None  # of products in the last fit
        self.faults: faults.FaultDraws | None = None  # of the last fit
        untrained = new_network(make_network, 0).eval()
        self.scaled = Scaled(untrained, torch.zeros(spec.elements), torch.ones(spec.elements), torch.ones(()))

    @property
    def network(self) -> nn.Module:
        """The network between the two scalings, from normalised windows to normalised maps."""
        return self.scaled.network

    def fit(
        self,
        train: Windows,
        validation: Windows,
        *,
        seed: int,
        device: str = "auto",
        progress: Progress = None,
        levels: Levels | None = None,
    ) -> list[dict]:
        """Train with Adam on the mean squared error of the map and keep the weights of the best epoch.

        train, validation: x (n, frames, elements) in ADC counts, y (n, outputs) in kPa. `device`: 'auto'
        takes a GPU if there is one. `progress(epoch, epochs, train_loss, validation_loss)` is called after every
        epoch. Returns one row per epoch (epoch, train_loss, validation_loss in kPa squared, learning_rate); `summary`
        says how the fit ended. Normalisation uses the training part only; labels are divided by the largest one, so
        that a network starts near the truth of a sensor that is mostly at rest. The result depends only on data,
        settings and `seed` (on one CPU thread, bit for bit). A loss that is not finite ends the training as 'diverged'.
        levels: what readings were in training, which a training with faults needs. Raises InputError for arrays of the
        wrong shape, and for such a training without levels.
        Differs from paper: the loss is the mean over the map instead of the sum of eq. 7; the constant factor 400
        drops out of Adam's update, and losses of different map sizes compare.
        Differs from paper: it gives no number of epochs, no stopping rule and one learning rate, 1e-3; here each
        network has a set number of epochs and its own highest rate, to which the rate rises over a tenth of the updates
        and from which it falls to zero; and an epoch sees only a share of the windows without a touch.
        Differs from paper: it names Adam and no more; here the second beta is 0.95, last layers start at zero, products
        of the simulated array's networks are in bfloat16, and the weights kept are those of the epoch with the lowest
        validation loss.
        """
        check_windows(self.spec, train, "training")
        check_windows(self.spec, validation, "validation")
        place = device_of(device)
        with stream_on(place):
            return self._fit_on(place, train, validation, seed, progress, levels)

    def _fit_on(
        self,
        place: torch.device,
        train: Windows,
        validation: Windows,
        seed: int,
        progress: Progress,
        levels: Levels | None,
    ) -> list[dict]:
        self._begin(seed, place)
        mean, spread = map(torch.from_numpy, input_scale(train[0]))
        self.faults = faults.drawing(self, levels, seed, place, mean, spread)
        output_scale = float(np.abs(train[1]).max()) or 1.0
        self.scaled = Scaled(self.network, mean, spread, torch.tensor(output_scale, dtype=torch.float32))
        parts = self._normalised(train, place), self._normalised(validation, place)
        optimiser = adam(self.network.parameters(), self.training.learning_rate, place, betas=BETAS)
        order, epochs = torch.Generator().manual_seed(seed), self.training.epochs
        schedule = Schedule(optimiser, self.training.learning_rate)

        def descend(losses: Iterable[torch.Tensor]) -> torch.Tensor:
            optimiser.zero_grad()
            total = 0.0
            for loss in losses:
                loss.backward()
                total = total + loss.detach()
            if np.isfinite(self.largest_gradient):
                nn.utils.clip_grad_norm_(self.network.parameters(), self.largest_gradient)
            optimiser.step()
            return total

        step = Update(lambda *given: self.update(parts[0], descend, *given), place)

        def run_epoch(epoch: int) -> Epoch:
            def update(done: float, *given: torch.Tensor | None) -> tuple[torch.Tensor, ...]:
                schedule.at((epoch + done) / epochs)
                return step(*given)

            self.network.train()
            train_loss = self.train_epoch(parts[0], order, update) * output_scale**2
            self.network.eval()
            with torch.no_grad():
                return Epoch(train_loss, self.loss(parts[1]) * output_scale**2, schedule.learning_rate)

        history, self.summary = run_epochs(self.network, epochs, run_epoch, progress=progress)
        self.network.eval().to("cpu")
        return history

    def train_epoch(
        self, train: tuple[torch.Tensor, ...], order: torch.Generator, update: Callable[..., tuple[torch.Tensor, ...]]
    ) -> float:
        """Train once over the normalised training part and return the mean loss of the windows that the epoch saw.

        `order` draws the windows and their batches. `update(done, *given)` makes one step of the optimiser, by the
        method `update`, and returns its results; `done`: the share of the epoch at the middle of the batch.
        """
        x, y = train
        total = torch.zeros((), device=x.device)
        windows = self._of_an_epoch(y, order).to(x.device)
        for first, batch in batches(windows, self.training.batch_size):
            (loss,) = update((first + len(batch) / 2) / len(windows), batch, self._drawn_faults(len(batch)))
            total += loss * len(batch)
        return float(total) / len(windows)

    def update(
        self,
        train: tuple[torch.Tensor, ...],
        descend: Callable[..., torch.Tensor],
        batch: torch.Tensor,
        drawn: torch.Tensor | None = None,
    ) -> tuple[torch.Tensor, ...]:
        """Make one update on a batch (n,) of the normalised training part; return (mean loss,).

        `descend(losses)` makes a step of the optimiser on the sum of losses, and returns the sum. drawn: faults of the
        batch, as `FaultDraws.drawn` gives them.
        """
        x, y = train
        inputs = (
            (rows, self._with_faults(x[rows], None if drawn is None else drawn[first : first + len(rows)]))
            for first, rows in batches(batch, self.chunk)
        )
        losses = (
            nn.functional.mse_loss(self._trained_output(seen), y[rows]) * (len(rows) / len(batch))
            for rows, seen in inputs
        )
        return (descend(losses),)

    def _drawn_faults(self, n: int) -> torch.Tensor | None:
        """Return the faults of the n examples of the next batch, None in a training without faults."""
        return self.faults and self.faults.drawn(n)

    def _with_faults(self, x: torch.Tensor, drawn: torch.Tensor | None) -> torch.Tensor:
        """Return normalised x (n, frames, elements) with the faults that are drawn for it, if there are any."""
        return x if drawn is None else self.faults.changed(x, drawn)

    def _begin(self, seed: int, place: torch.device) -> None:
        """Draw the network's first weights, and choose the precision of its products on the device `place`."""
        self.precision = precision_on(place, self.training.precision)
        self.scaled.network = new_network(self.make_network, seed).to(place)

    def _trained_output(self, x: torch.Tensor) -> torch.Tensor:
        """Return the network's output for normalised x in training, its products in `precision`, itself float32."""
        with products_in(self.precision, x.device):
            return self.network(x).float()

    def _of_an_epoch(self, y: torch.Tensor, order: torch.Generator) -> torch.Tensor:
        """Return numbers of windows in random order: all that have a touch and a share of the others.

        If that share comes to nothing where no window has a touch, all of them. A window that would be the last batch
        waits for another epoch: batch normalisation cannot train on it.
        """
        at_rest = ~y.any(1).cpu()
        windows = torch.randperm(len(y), generator=order)
        keep = torch.rand(len(y), generator=order) < self.training.rest_share
        seen = windows[keep | ~at_rest[windows]]
        seen = seen if len(seen) else windows
        return seen[: len(seen) - (len(seen) > 1 and len(seen) % self.training.batch_size == 1)]

    def loss(self, part: tuple[torch.Tensor, ...]) -> float:
        """Return the mean loss over a normalised part; the network is in the mode for predictions."""
        x, y = part
        squares = [
            nn.functional.mse_loss(self.network(windows), maps, reduction="sum")
            for windows, maps in zip(x.split(LARGEST_BATCH), y.split(LARGEST_BATCH), strict=True)
        ]
        return float(sum(squares)) / y.numel()

    def predict(self, x: np.ndarray) -> np.ndarray:
        """Return pressure maps (n, outputs) in kPa, float32, for windows x (n, frames, elements) in ADC counts."""
        x = torch.from_numpy(np.array(x, dtype=np.float32)).to(self.place)
        with torch.no_grad():
            maps = [self.scaled(part) for part in x.split(LARGEST_BATCH)]
        return (maps[0] if len(maps) == 1 else torch.cat(maps)).cpu().numpy()

    @property
    def place(self) -> torch.device:
        """The device that `predict` computes on: the CPU, unless `predict_on` named another."""
        return self.scaled.input_mean.device

    def predict_on(self, device: str) -> None:
        """Let `predict` compute on a device, named as for `fit`; for many windows at once, not for one at a time."""
        self.scaled.to(device_of(device))

    def save(self, folder: Path) -> None:
        """Write weights and normalisation constants to `folder` (which exists), as safetensors."""
        weights.save(folder, self.scaled.state_dict())

    def load(self, folder: Path) -> None:
        """Read weights and normalisation from `folder`; InputError if absent, damaged or of other settings."""
        weights.load(self.scaled, weights.read(folder), folder)

    def parameters(self) -> int:
        """Return the number of trainable parameters."""
        return cost.parameters(self.network)

    def macs(self) -> int:
        """Return the multiply-accumulates for one window."""
        return cost.multiply_accumulates(self.network, torch.zeros(1, self.spec.frames, self.spec.elements))

    def _normalised(self, windows: Windows, device: torch.device) -> tuple[torch.Tensor, ...]:
        x, y = (torch.from_numpy(np.array(part, dtype=np.float32)) for part in windows[:2])
        x.sub_(self.scaled.input_mean).div_(self.scaled.input_spread)
        return x.to(device), y.div_(self.scaled.output_scale).to(device), *windows[2:]


def batches(rows: torch.Tensor, size: int) -> Iterator[tuple[int, torch.Tensor]]:
    """Yield (number of rows before it, batch) for the batches of rows (n,)."""
    for first in range(0, len(rows), size):
        yield first, rows[first : first + size]


def zero_linear(inputs: int, outputs: int) -> nn.Linear:
    """Return a last layer that starts at zero: the first updates go into the map, not into undoing random ones."""
    layer = nn.Linear(inputs, outputs)
    nn.init.zeros_(layer.weight)
    nn.init.zeros_(layer.bias)
    return layer


def perceptron(inputs: int, hidden: Iterable[int], outputs: int) -> nn.Sequential:
    """Return linear layers of the widths `hidden`, each with a ReLU, and a last one that starts at zero."""
    layers, width = [], inputs
    for wider in hidden:
        layers += [nn.Linear(width, wider), nn.ReLU()]
        width = wider
    return nn.Sequential(*layers, zero_linear(width, outputs))


def input_scale(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return mean and spread (elements,) of each element over all windows and frames of x (n, frames, elements).

    The spread is the standard deviation, but at least SMALLEST_SPREAD: an element that was never pressed
    must not have its rounding noise blown up to full scale.
    """
    mean = x.mean(axis=(0, 1), dtype=np.float64)
    spread = np.maximum(x.std(axis=(0, 1), dtype=np.float64), SMALLEST_SPREAD)
    return mean.astype(np.float32), spread.astype(np.float32)


def check_windows(spec: Spec, windows: Windows, part: str) -> None:
    """Raise InputError unless the windows of a part (`training`, `validation`) exist and have the shapes of `spec`."""
    x, y = windows[:2]
    if not len(x):
        raise InputError(f"the {part} part has no windows; record more or change the split")
    if x.shape != (len(x), spec.frames, spec.elements) or y.shape != (len(x), spec.outputs):
        raise InputError(
            f"the {part} part has windows {x.shape} with labels {y.shape}, but the model expects "
            f"(n, {spec.frames}, {spec.elements}) and (n, {spec.outputs}); make the dataset again"
        )
