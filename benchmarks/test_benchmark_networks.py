"""LoMP, the strain networks and SP-ResNet against what one would write first."""

import numpy as np
import pytest
import torch
from torch import nn
from tqdm import tqdm

from benchmarks import made, measure, peers
from benchmarks.made import ROOT
from tactile import experiments, tasks
from tactile.base import params, paths, workers
from tactile.base.paths import Workspace
from tactile.datasets import schemas, series
from tactile.datasets.windows import Dataset
from tactile.learning.lstm import LstmRegressor
from tactile.learning.regressors import TorchRegressor
from tactile.learning.spec import Spec, of_series
from tactile.learning.training import precision_on
from tactile.models import esn, lstm_transfer_ridge
from tactile.settings.training import SequenceTraining
from tactile.tasks import windows as tasks_windows


@pytest.fixture(scope="module")
def touch():
    """The touch experiment's dataset, and what loads a model of its first run; needs what `dvc repro` has made."""
    workspace, values = Workspace(ROOT), params.load(ROOT / "params.yaml")
    data = tasks_windows.read(paths.require(workspace.dataset("touch"), "dvc repro"), values["touch"])
    spec = tasks_windows.spec(values["touch"])

    def load(model: str):
        return tasks.load(workspace, values, "touch", model, "press", 0, spec).model

    return data, load


def single_rmse(data: Dataset, predict) -> float:
    """RMSE in kPa of the single touches of the test part; `predict(x, rows)` gives the maps of these rows."""
    single = schemas.names(data.rows["condition"]) == "single"
    rows = np.flatnonzero(single & (data.part("press", 0) == "test"))
    return float(np.sqrt(np.mean((predict(data.x[rows], rows) - data.y[rows]) ** 2)))


def test_lomp_latency_error(record, sizes, touch):
    """What weights of 16 bits change in a window, against the float32 weights in torch."""
    data, load = touch
    model, most = load("lomp"), 0.0

    def fast(x: np.ndarray, _) -> np.ndarray:
        nonlocal most
        maps = np.concatenate([model.predict(one[None]) for one in x])
        exact = TorchRegressor.predict(model, x)
        most = float(np.abs(maps - exact).max() / exact.max())
        return maps

    errors = single_rmse(data, fast), single_rmse(data, lambda x, _: TorchRegressor.predict(model, x))
    shown = f"test RMSE {errors[0]:.6f} kPa, in torch {errors[1]:.6f}"
    what = f"LoMP, batch 1: largest difference of a map from torch's, share of full scale; {shown}"
    record("lomp_latency_error", what=what, unit="%", ours=100 * most, most=0.5, rounds=1)


def test_lomp_stream(race, record, sizes, touch):
    """A frame of the streaming model against a window of LoMP, both as the pipeline trained them."""
    data, load = touch
    stream, window = load("lomp_stream"), load("lomp")
    x = data.x[:1]
    seconds, peer = race(
        lambda: stream.step(x[:, -1]), lambda: window.predict(x), rounds=sizes.rounds, calls=sizes.rounds
    )

    def rmse(model) -> float:
        return single_rmse(data, lambda x, rows: tasks_windows.predict(model, x, data, rows))

    record(
        "lomp_stream",
        what=f"LoMP, one frame in, one map out; test RMSE {rmse(stream):.2f} kPa, by windows {rmse(window):.2f}",
        peer_is="LoMP, one window, batch 1",
        unit="ms",
        ours=seconds * 1e3,
        peer=peer * 1e3,
        least_ratio=5,
        rounds=sizes.rounds,
    )


@pytest.mark.parametrize("batch", ["large", "small"])
def test_lomp_training(record, sizes, tmp_path, batch):
    """`large` is the batch that the target is set for, `small` the one of params.yaml."""
    windows = sizes.windows if batch == "large" else measure.lomp(5, epochs=1).training.batch_size
    tasks = ("lomp_updates", "lomp_updates_looped", "lomp_updates_stacked")
    seconds, *theirs = medians(tasks, tmp_path, windows)
    names = ("a loop over 25 modules", "stacked weights under autograd")
    precision = precision_on(torch.device("cpu"), measure.lomp(5, epochs=1).training.precision)
    for name, peer, peer_is in zip(("loop", "stacked"), theirs, names, strict=True):
        faster = peer == min(theirs)
        record(
            f"lomp_training_{batch}_{name}",
            what=f"LoMP, one update, {windows} windows, in a worker process, products in {precision}",
            peer_is=peer_is + (", the faster one" if faster else "") + ", in the same precision",
            unit="ms",
            ours=seconds / measure.UPDATES * 1e3,
            peer=peer / measure.UPDATES * 1e3,
            least_ratio=1.5 if faster and batch == "large" else None,
            rounds=3,
        )


def test_strain_epoch(record, sizes, tmp_path):
    seconds, peer = medians(("lstm_epochs", "lstm_epochs_plain"), tmp_path, sizes.samples)
    record(
        "strain_epoch",
        what=f"direct training, an epoch of {sizes.samples} samples as one sequence, losses and scaling included",
        peer_is="nn.LSTM in float32, the same update",
        unit="s",
        ours=seconds / measure.EPOCHS,
        peer=peer / measure.EPOCHS,
        least_ratio=1,
        rounds=3,
    )


def fit_one_seed(samples: int, epochs: int, seed: int, report) -> float:
    """Train the strain LSTM in whatever process this is; returns the last training loss."""
    torch.set_num_threads(1)
    model = measure.lstm(epochs=epochs)
    return model.fit([made.series(samples)], seed=seed, device="cpu", progress=report, base=None)[-1]["train_loss"]


def test_strain_two_seeds(race, record, sizes, monkeypatch):
    def train(seeds: int) -> None:
        monkeypatch.setenv("WORKERS", str(seeds))
        tasks = {seed: (sizes.samples, sizes.epochs, seed) for seed in range(seeds)}
        with tqdm(disable=True) as bar:
            assert len(dict(workers.run(fit_one_seed, tasks, bar))) == seeds

    both, one = race(lambda: train(2), lambda: train(1), rounds=2)
    record(
        "strain_two_seeds",
        what=f"direct training, {sizes.epochs} epochs, two seeds in two processes, their start included",
        peer_is="one seed",
        unit="s",
        ours=both,
        peer=one,
        least_ratio=1 / 1.15,
        rounds=2,
        threads=2,
    )


@pytest.fixture(scope="module")
def transfer():
    """Series, scaling, base and settings of transfer to task 1, seed 0; needs what `dvc repro` has made."""
    workspace, settings = Workspace(ROOT), params.load(ROOT / "params.yaml")["strain"]
    module = experiments.module("strain")
    task = module.task("task_1", settings)
    pieces = series.read(paths.require(workspace.dataset("strain"), "dvc repro"), task, "task_1", 0)
    base = paths.require(workspace.run_folder("strain", paths.MODEL_ZERO, task.base, 0), "dvc repro")
    return settings, of_series(task, settings["window"]["frames"]), pieces, base


def error_mm(model, pieces) -> float:
    """Mean absolute error of task 1 in the test part."""
    (piece,) = pieces
    test = piece.part == "test"
    return float(np.abs(model.predict(piece.record.x)[test] - piece.record.y[test]).mean())


def test_strain_transfer(race, record, sizes, transfer):
    settings, spec, pieces, base = transfer
    records = series.seen_in_training(pieces)
    ours = lstm_transfer_ridge.build(spec, **settings["models"]["lstm_transfer_ridge"])
    block = settings["models"]["lstm_transfer"]["training"] | {"epochs": sizes.epochs}
    cached = LstmRegressor(spec, 50, SequenceTraining(**block), transfer=True)
    for model in (ours, cached):
        model.fit(records, seed=0, device="cpu", base=base)
    (one,) = records
    training = cached.training
    latent, target = torch.from_numpy(ours.latents(one.x)), cached.scaling.targets(one.y)

    def solve() -> None:
        ours._solve([[latent[None], target[None], *(torch.ones(1, len(latent), dtype=torch.bool),) * 2]])

    def adam() -> None:
        readout = nn.Linear(latent.shape[1], spec.outputs, bias=False)
        peers.readout_epochs(readout, latent, target, sizes.epochs, training.drop_epoch)

    solved, on_states = race(solve, adam, rounds=3)
    errors = [error_mm(model, pieces) for model in (ours, cached)]
    record(
        "strain_transfer_readout",
        what="the closed-form read-out alone, on states computed before",
        peer_is=f"Adam on the same states, {sizes.epochs} epochs",
        unit="s",
        ours=solved,
        peer=on_states,
        rounds=3,
    )
    record(
        "strain_transfer_error",
        what="test error of transfer to task 1, closed form; no worse than by Adam",
        peer_is=f"Adam, {sizes.epochs} epochs",
        unit="mm",
        ours=errors[0],
        peer=errors[1],
        least_ratio=1,
        rounds=1,
    )


def test_esn_states(race, record, sizes):
    block = params.load(ROOT / "params.yaml")["strain"]["models"]["esn"]
    model = esn.build(Spec(10, 1, 6, 1, 2), **block)
    system, x = model.make(6, 0), made.series(sizes.samples).x
    states = peers.reservoir_states(system, block["leak"], x[:500])
    np.testing.assert_allclose(model.advance(system, x[None, :500], None)[0], states, rtol=1e-3, atol=1e-4)
    seconds, peer = race(
        lambda: model.advance(system, x[None], None),
        lambda: peers.reservoir_states(system, block["leak"], x),
        rounds=5,
    )
    record(
        "esn_states",
        what=f"echo state network, {block['units']} units, states of {sizes.samples} samples",
        peer_is="a loop in numpy",
        unit="s",
        ours=seconds,
        peer=peer,
        least_ratio=3,
        rounds=5,
    )


def test_sp_resnet_training(record, sizes, tmp_path):
    seconds, peer = medians(("sp_resnet_epoch", "sp_resnet_epoch_plain"), tmp_path, sizes.images)
    record(
        "sp_resnet_training",
        what=f"SP-ResNet, an epoch of {sizes.images} images, in a worker process",
        peer_is="a plain loop, default memory layout, the same augmentation",
        unit="s",
        ours=seconds,
        peer=peer,
        least_ratio=1.5,
        rounds=3,
    )


def medians(tasks: tuple[str, ...], folder, size: float) -> list[float]:
    """Median seconds of three turns of tasks in processes of their own, the first as the pipeline's workers."""
    turns = [
        [measure.measured(task, folder, size, worker=task == tasks[0])["seconds"] for task in tasks] for _ in range(3)
    ]
    return np.median(turns, axis=0).tolist()
