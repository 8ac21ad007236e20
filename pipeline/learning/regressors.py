"""The two regressors that models of windows are made of: for torch and for scikit-learn."""

import io
import json
import re
import zipfile
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import torch
from safetensors import SafetensorError
from safetensors.torch import load_file, save_file
from threadpoolctl import threadpool_limits
from torch import nn

from pipeline.base.blocks import EarlyStopping
from pipeline.base.errors import InputError
from pipeline.learning import cost
from pipeline.learning.training import Epoch, FitSummary, Plateau, Progress, device_of, history_row, run_epochs

if TYPE_CHECKING:
    from sklearn.base import BaseEstimator

NETWORK_FILE = "network.safetensors"
ESTIMATOR_FILE = "estimator.skops"
NORMALISATION = ("input_mean", "input_spread", "output_scale")  # in NETWORK_FILE, beside the weights
SMALLEST_SPREAD = 1.0  # ADC counts: below one count an element's spread is rounding, not signal
LARGEST_BATCH = 128  # windows a prediction step: keeps the temporaries of every network in cache


class Spec(NamedTuple):
    """Shapes of the task: frames a window, rows x cols elements, map_rows x map_cols pressure map."""

    frames: int
    rows: int
    cols: int
    map_rows: int
    map_cols: int

    @property
    def elements(self) -> int:
        """Number of sensor elements in a frame."""
        return self.rows * self.cols

    @property
    def outputs(self) -> int:
        """Number of values in a pressure map."""
        return self.map_rows * self.map_cols


Windows = tuple[np.ndarray, np.ndarray]  # x (n, frames, elements) in ADC counts, y (n, outputs) in kPa


class TorchRegressor:
    """A network that maps normalised windows (n, frames, elements) to normalised maps (n, outputs)."""

    streams = False  # True: carries its state from window to window, see `models/lomp_stream.py`
    chunk = 1 << 30  # windows of a batch that go through the network at once; the gradients of a batch add up

    def __init__(self, make_network: Callable[[], nn.Module], spec: Spec, training: EarlyStopping):
        self.make_network = make_network
        self.spec = spec
        self.training = training
        self.summary: FitSummary | None = None
        self.network = self._new_network(0).eval()
        self._set_normalisation(torch.zeros(spec.elements), torch.ones(spec.elements), torch.ones(()))

    def fit(
        self,
        train: Windows,
        validation: Windows,
        *,
        seed: int,
        device: str = "auto",
        progress: Progress = None,
    ) -> list[dict]:
        """Train with Adam on the mean squared error of the map and keep the weights of the best epoch.

        train, validation: x (n, frames, elements) in ADC counts, y (n, outputs) in kPa. `device`: 'auto'
        takes a GPU if there is one. `progress(epoch, max_epochs, train_loss, validation_loss)` is called
        after every epoch. Returns one row an epoch (epoch, train_loss, validation_loss in kPa squared,
        learning_rate); `summary` says how it ended. Normalisation uses the training part only. The result
        depends only on data, settings and `seed` (on one CPU thread, bit for bit). A loss that is not finite
        ends the training as 'diverged'. Raises InputError for arrays of the wrong shape.
        Differs from paper: the loss is the mean over the map instead of the sum of eq. 7; the constant factor 400
        drops out of Adam's update, and losses of different map sizes compare.
        """
        _check(self.spec, train, "training")
        _check(self.spec, validation, "validation")
        device = device_of(device)
        mean, spread = input_scale(train[0])
        output_scale = float(np.std(train[1], dtype=np.float64)) or 1.0
        self._set_normalisation(
            torch.from_numpy(mean), torch.from_numpy(spread), torch.tensor(output_scale, dtype=torch.float32)
        )
        self.network = self._new_network(seed).to(device)
        parts = self._normalised(train, device), self._normalised(validation, device)
        optimiser = torch.optim.Adam(self.network.parameters(), lr=self.training.learning_rate, fused=True)
        training, order = self.training, torch.Generator().manual_seed(seed)
        plateau = Plateau(optimiser, patience=training.patience, plateau=training.plateau, drop=training.drop)

        def update(losses: Iterable[torch.Tensor]) -> torch.Tensor:
            optimiser.zero_grad()
            total = 0.0
            for loss in losses:
                loss.backward()
                total = total + loss.detach()
            optimiser.step()
            return total

        def run_epoch() -> Epoch:
            self.network.train()
            learning_rate = plateau.learning_rate
            train_loss = self.train_epoch(parts[0], order, update) * output_scale**2
            self.network.eval()
            with torch.no_grad():
                return Epoch(train_loss, self.loss(parts[1]) * output_scale**2, learning_rate)

        history, self.summary = run_epochs(
            self.network, training.max_epochs, run_epoch, progress=progress, stop=plateau
        )
        self.network.eval().to("cpu")
        return history

    def train_epoch(
        self, train: tuple[torch.Tensor, ...], order: torch.Generator, update: Callable[[Iterable], torch.Tensor]
    ) -> float:
        """Mean loss of one epoch over the normalised training part.

        `update(losses)` is one step of the optimiser on the sum of the losses, which it returns.
        """
        x, y = train
        total = torch.zeros((), device=x.device)
        for batch in torch.randperm(len(x), generator=order).to(x.device).split(self.training.batch_size):
            losses = (
                nn.functional.mse_loss(self.network(x[some]), y[some]) * (len(some) / len(batch))
                for some in batch.split(self.chunk)
            )
            total += update(losses) * len(batch)
        return float(total) / len(x)

    def loss(self, part: tuple[torch.Tensor, ...]) -> float:
        """Mean loss over a normalised part, with the network as it is for predictions."""
        x, y = part
        squares = [
            nn.functional.mse_loss(self.network(some), target, reduction="sum")
            for some, target in zip(x.split(LARGEST_BATCH), y.split(LARGEST_BATCH), strict=True)
        ]
        return float(sum(squares)) / y.numel()

    def predict(self, x: np.ndarray) -> np.ndarray:
        """Pressure maps (n, outputs) in kPa, float32, for windows x (n, frames, elements) in ADC counts."""
        x = torch.from_numpy(np.array(x, dtype=np.float32))
        with torch.no_grad():
            maps = [
                self.network((part - self.input_mean) / self.input_spread) * self.output_scale
                for part in x.split(LARGEST_BATCH)
            ]
        return (maps[0] if len(maps) == 1 else torch.cat(maps)).numpy()

    def save(self, folder: Path) -> None:
        """Write weights and normalisation constants to `folder` (which exists), as safetensors."""
        tensors = {f"network.{name}": value.contiguous() for name, value in self.network.state_dict().items()}
        tensors |= {
            "input_mean": self.input_mean,
            "input_spread": self.input_spread,
            "output_scale": self.output_scale,
        }
        save_file(tensors, Path(folder) / NETWORK_FILE)

    def load(self, folder: Path) -> None:
        """Take weights and normalisation from `folder`; InputError if absent or of other settings."""
        path, tensors = Path(folder) / NETWORK_FILE, read_tensors(folder)
        expected = {f"network.{name}": value.shape for name, value in self.network.state_dict().items()}
        found = {name: value.shape for name, value in tensors.items() if name.startswith("network.")}
        if found != expected or not tensors.keys() >= set(NORMALISATION):
            raise InputError(f"{path}: was saved by a model with other settings; train the model again")
        self.network.load_state_dict({name.removeprefix("network."): tensors[name] for name in expected}, strict=True)
        self._set_normalisation(*(tensors[name] for name in NORMALISATION))

    def parameters(self) -> int:
        """Number of trainable parameters."""
        return cost.parameters(self.network)

    def macs(self) -> int:
        """Multiply-accumulates for one window."""
        return cost.multiply_accumulates(self.network, torch.zeros(1, self.spec.frames, self.spec.elements))

    def _new_network(self, seed: int) -> nn.Module:
        with torch.random.fork_rng(devices=[]):
            torch.manual_seed(seed)
            return self.make_network()

    def _set_normalisation(self, mean: torch.Tensor, spread: torch.Tensor, output_scale: torch.Tensor) -> None:
        self.input_mean, self.input_spread, self.output_scale = mean, spread, output_scale

    def _normalised(self, windows: Windows, device: torch.device) -> tuple[torch.Tensor, ...]:
        x, y = (torch.from_numpy(np.array(part, dtype=np.float32)) for part in windows[:2])
        x.sub_(self.input_mean).div_(self.input_spread)
        return x.to(device), y.div_(self.output_scale).to(device), *windows[2:]


class SklearnRegressor:
    """A scikit-learn estimator on flattened windows, fitted in closed form (or grown, for a tree).

    `make_estimator(seed)` returns an unfitted estimator; `count(estimator)` its fitted numbers;
    `macs` the multiply-accumulates for one window, or None where there are none to count.
    With `last_frame` the estimator sees only the last frame of a window.
    """

    streams = False

    def __init__(
        self,
        make_estimator: Callable[[int], "BaseEstimator"],
        spec: Spec,
        *,
        count: Callable[["BaseEstimator"], int],
        macs: int | None,
        last_frame: bool = False,
        trusted: tuple[str, ...] = (),
    ):
        self.make_estimator = make_estimator
        self.spec = spec
        self.count = count
        self.cost = macs
        self.last_frame = last_frame
        self.trusted = trusted
        self.summary: FitSummary | None = None
        self.estimator: BaseEstimator | None = None

    def fit(
        self,
        train: Windows,
        validation: Windows,
        *,
        seed: int,
        device: str = "auto",
        progress: Progress = None,
    ) -> list[dict]:
        """Fit once; arguments and result as for TorchRegressor.fit, with a history of one row.

        Runs on one CPU thread whatever `device` says (sums in thread order would not repeat bit for bit). The
        row's learning_rate is 0: there is none. Raises InputError for arrays of the wrong shape.
        """
        _check(self.spec, train, "training")
        _check(self.spec, validation, "validation")
        estimator = self.make_estimator(seed)
        with threadpool_limits(1):
            estimator.fit(self._features(train[0]).astype(np.float64), train[1].astype(np.float64))
            self.estimator = estimator
            train_loss, validation_loss = (
                float(np.mean(np.square(self.predict(x) - y, dtype=np.float64))) for x, y in (train, validation)
            )
        self.summary = FitSummary("closed_form", 1)
        if progress:
            progress(1, 1, train_loss, validation_loss)
        return [history_row(1, Epoch(train_loss, validation_loss, 0.0))]

    def predict(self, x: np.ndarray) -> np.ndarray:
        """Pressure maps (n, outputs) in kPa, float32, for windows x (n, frames, elements) in ADC counts."""
        maps = self._fitted().predict(self._features(x))
        return maps.reshape(len(x), self.spec.outputs).astype(np.float32, copy=False)

    def save(self, folder: Path) -> None:
        """Write the fitted estimator, scaling included, to `folder` (which exists), as skops."""
        (Path(folder) / ESTIMATOR_FILE).write_bytes(_stable_skops(self._fitted()))

    def load(self, folder: Path) -> None:
        """Take the fitted estimator from `folder`; only types that skops knows or `trusted` names.

        Raises InputError for a file that is absent, damaged or holds other types.
        """
        import skops.io  # 3 s, for which no network has to wait

        path = _existing(Path(folder) / ESTIMATOR_FILE)
        try:
            self.estimator = skops.io.load(path, trusted=list(self.trusted))
        except Exception as error:  # skops lets pass what the parts it unpacks raise: some twenty types
            kind = re.sub(r"\W+", " ", str(error))[:200]  # it may quote the file
            raise InputError(f"{path}: no model of this kind ({kind}); train the model again") from error

    def parameters(self) -> int:
        """Number of fitted numbers (scaling constants not counted, as for networks)."""
        return int(self.count(self._fitted()))

    def macs(self) -> int | None:
        """Multiply-accumulates for one window; None for a model that only compares."""
        return self.cost

    def _features(self, x: np.ndarray) -> np.ndarray:
        return x[:, -1] if self.last_frame else x.reshape(len(x), -1)

    def _fitted(self) -> "BaseEstimator":
        if self.estimator is None:
            raise RuntimeError("fit or load the model first")
        return self.estimator


def input_scale(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Mean and spread (elements,) of each element over all windows and frames of x (n, frames, elements).

    The spread is the standard deviation, but at least SMALLEST_SPREAD: an element that was never pressed
    must not have its rounding noise blown up to full scale.
    """
    mean = x.mean(axis=(0, 1), dtype=np.float64)
    spread = np.maximum(x.std(axis=(0, 1), dtype=np.float64), SMALLEST_SPREAD)
    return mean.astype(np.float32), spread.astype(np.float32)


def _check(spec: Spec, windows: Windows, part: str) -> None:
    x, y = windows[:2]
    if not len(x):
        raise InputError(f"the {part} part has no windows; record more or change the split")
    if x.shape != (len(x), spec.frames, spec.elements) or y.shape != (len(x), spec.outputs):
        raise InputError(
            f"the {part} part has windows {x.shape} with labels {y.shape}, but the model expects "
            f"(n, {spec.frames}, {spec.elements}) and (n, {spec.outputs}); make the dataset again"
        )


def read_tensors(folder: Path) -> dict[str, torch.Tensor]:
    """Return the tensors of a saved network by name; InputError where the file is absent or damaged."""
    path = _existing(Path(folder) / NETWORK_FILE)
    try:
        return load_file(path)
    except SafetensorError as error:
        raise InputError(f"{path}: damaged ({str(error)[:200]}); train the model again") from error


def _existing(path: Path) -> Path:
    if not path.exists():
        raise InputError(f"{path}: not found; train the model first")
    return path


def _stable_skops(estimator: "BaseEstimator") -> bytes:
    """skops bytes that depend on the estimator only.

    skops numbers objects by memory address, names array files after it, and stamps the archive with the
    clock; here objects are numbered in the order in which they occur, and the date is the archive's zero.
    """
    import skops.io

    archive = zipfile.ZipFile(io.BytesIO(skops.io.dumps(estimator)))
    schema = json.loads(archive.read("schema.json"))
    numbers: dict[int, int] = {}
    files: dict[str, str] = {}

    def renumber(node) -> None:
        if isinstance(node, dict):
            if "__id__" in node:
                node["__id__"] = numbers.setdefault(node["__id__"], len(numbers))
            if isinstance(node.get("file"), str):
                node["file"] = files.setdefault(node["file"], f"{len(files)}.npy")
            node = list(node.values())
        if isinstance(node, list):
            for child in node:
                renumber(child)

    renumber(schema)
    stable = io.BytesIO()
    with zipfile.ZipFile(stable, "w", zipfile.ZIP_DEFLATED) as target:
        for name, content in [(new, archive.read(old)) for old, new in files.items()] + [
            ("schema.json", json.dumps(schema, sort_keys=True).encode())
        ]:
            info = zipfile.ZipInfo(name, date_time=(1980, 1, 1, 0, 0, 0))
            target.writestr(info, content, compress_type=zipfile.ZIP_DEFLATED)
    return stable.getvalue()
