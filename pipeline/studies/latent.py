"""Test what the latent-space paper asserts and does not test: few samples, freedom from drift, capacity, strands.

Writes tables of one seed: samples.csv (error against the number of training samples), capacity.csv (against the
size of the LSTM), strands.csv (against the number of strands that all models see), bases.csv (of transfer from a
model-0 that was trained on another task), drift.csv (how well elapsed time, the strands' true drift and their whole
deviation from the strain can be read from the raw voltages and from the latent space) and latents.csv (states of
model-0 on task 2, for figure 7). Errors are those of the test part; drift.csv is from held-out blocks of all but the
first minute.
Usage: python -m pipeline.studies.latent strain SEED
"""

import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
from tqdm import tqdm

from pipeline import models
from pipeline.base import arguments, files, foreign, params, paths, workers
from pipeline.base.paths import Workspace
from pipeline.datasets import series
from pipeline.experiments import strain
from pipeline.scenes import strain as scene
from pipeline.tasks import series as tasks_series

BLOCK_S = 120.0  # decoding is tested on every fifth block of this length, trained on the others
FOLDS = 5
LATENT_SAMPLES = 500  # 100 s
TRANSFER = "lstm_transfer"
DECODER_RIDGE = 1e-4  # of standardised inputs, against the mean squared error of the standardised target
WARM_UP_S = 60.0  # an LSTM starts with states of 0, up to 45 standard deviations from later ones, which takes 10 s


def train_with(
    workspace: Workspace,
    values: Mapping,
    model: str,
    block: dict,
    protocol: str,
    seed: int,
    samples: int | None = None,
    zero: Path | None = None,
    keep: Path | None = None,
) -> tuple:
    """Train on the last `samples` of the training part (None: all). Returns (model, error in mm on the test part).

    zero: the folder of model-0 for transfer; None: as in the stage `train`, the one that has seen all of task 0.
    keep: the folder to save the model in, if any.
    """
    experiment = "strain"
    task = strain.task(protocol, values[experiment])
    spec = tasks_series.spec(experiment, values[experiment], protocol)
    (piece,) = series.read(workspace.dataset(experiment), task, protocol, seed)
    (record,) = series.seen_in_training([piece])
    if samples is not None:
        record = series.Record(*(column[-samples:] for column in record))
        record = record._replace(training=np.ones(len(record.x), dtype=bool))
    regressor = models.build(model, spec, block, f"{experiment}.models.{model}")
    zero = zero or workspace.run_folder(experiment, paths.MODEL_ZERO, task.base, seed)
    regressor.fit([record], seed=seed, device=values["device"], base=zero)
    if keep:
        regressor.save(keep)
    rows = tasks_series.score(piece, regressor.predict(piece.record.x)[piece.part == "test"], task)
    error = next(value for name, _, value, _ in rows if name == "error")
    return regressor, error if np.isfinite(error) else float("nan")


def one_samples(
    workspace: Workspace, values: Mapping, protocol: str, model: str, samples: int, seed: int, report: Callable
) -> list[tuple]:
    """Return a row of samples.csv."""
    block = params.model_settings(values, "strain", model)
    _, error = _single_thread(train_with, workspace, values, model, block, protocol, seed, samples)
    report()
    return [(protocol, model, samples, seed, "error", "mm", error)]


def one_capacity(
    workspace: Workspace, values: Mapping, protocol: str, units: int, seed: int, report: Callable
) -> list[tuple]:
    """Return a row of capacity.csv: the direct LSTM with another number of units, trained in parallel streams."""
    block = _in_streams(values) | {"units": units}
    regressor, error = _single_thread(
        train_with, workspace, values, values["strain"]["model_zero"], block, protocol, seed
    )
    report()
    return [(protocol, units, regressor.parameters(), regressor.macs(), seed, "error", "mm", error)]


def one_strands(workspace: Workspace, values: Mapping, strands: int, seed: int, report: Callable) -> list[tuple]:
    """Return rows of strands.csv: model-0, direct training and transfer, all of which see the first `strands` strands.

    Model-0 and direct training are trained in parallel streams.
    """
    fewer = {**values, "strain": {**values["strain"], "sensor": {"channels": strands}}}
    direct, rows = values["strain"]["model_zero"], []
    blocks = {direct: _in_streams(values), TRANSFER: params.model_settings(values, "strain", TRANSFER)}
    with tempfile.TemporaryDirectory() as name:
        zero = Path(name)
        _single_thread(
            train_with, workspace, fewer, direct, blocks[direct], strain.MODEL_ZERO_TASK, seed, None, None, zero
        )
        for task in values["strain"]["study"]["tasks"]:
            for model, block in blocks.items():
                _, error = _single_thread(train_with, workspace, fewer, model, block, task, seed, None, zero)
                rows.append((task, strands, model, seed, "error", "mm", error))
    report()
    return rows


def one_base(
    workspace: Workspace, values: Mapping, base: str, protocol: str, seed: int, report: Callable
) -> list[tuple]:
    """Return rows of bases.csv: transfer to a task from the network of another task, by Adam and in closed form."""
    zero = workspace.run_folder("strain", values["strain"]["model_zero"], base, seed)
    rows = []
    for model in (TRANSFER, f"{TRANSFER}_ridge"):
        block = params.model_settings(values, "strain", model)
        _, error = _single_thread(train_with, workspace, values, model, block, protocol, seed, None, zero)
        rows.append((protocol, base, model, seed, "error", "mm", error))
    report()
    return rows


def _in_streams(values: Mapping) -> dict:
    """Return the block of direct training with the recipe of `study.capacity`."""
    block = params.model_settings(values, "strain", values["strain"]["model_zero"])
    return {**block, "training": block["training"] | values["strain"]["study"]["capacity"]["training"]}


def one_drift(workspace: Workspace, values: Mapping, protocol: str, seed: int, report: Callable) -> list[tuple]:
    """Return rows of drift.csv for one task: R2 of a ridge decoder, by input and by what is decoded."""
    rows = _single_thread(_decode, workspace, values, protocol, seed)
    report()
    return rows


def _decode(workspace: Workspace, values: Mapping, protocol: str, seed: int) -> list[tuple]:
    from pipeline.learning import lstm

    settings = values["strain"]
    task = strain.task(protocol, settings)
    spec = tasks_series.spec("strain", settings, protocol)
    (piece,) = series.read(workspace.dataset("strain"), task, protocol, seed)
    frames = settings["window"]["frames"]
    x, rows = piece.record.x, settled(piece.time_s, frames)
    at = piece.time_s[rows]
    window = np.stack([x[rows - lag] for lag in range(frames)], axis=1).reshape(len(rows), -1)
    inputs = {f"raw voltages, {frames} samples": window}
    zero = settings["model_zero"]
    for name, folder in {
        "latent of model-0": workspace.run_folder("strain", paths.MODEL_ZERO, task.base, seed),
        "latent of direct training": workspace.run_folder("strain", zero, protocol, seed),
    }.items():
        outputs = strain.task(task.base if "model-0" in name else protocol, settings).outputs
        network = lstm.LstmRegressor(spec._replace(map_cols=len(outputs)), 1, None, transfer=False)
        network.load(folder)
        if "model-0" in name:
            _rescale(network, piece)
        inputs[name] = network.latents(x)[rows]
    known = true_drift(workspace, settings, protocol, seed, at) if settings["source"] == "simulated" else {}
    targets = {"elapsed time": at[:, None], **known}
    return [
        (protocol, name, target, seed, "r2", "1", decoded(given, truth, at))
        for name, given in inputs.items()
        for target, truth in targets.items()
    ]


def true_drift(
    workspace: Workspace, settings: Mapping, protocol: str, seed: int, time_s: np.ndarray
) -> dict[str, np.ndarray]:
    """Return two truths of simulated strands at times (n,) of the DAQ's clock, each (n, strands); {} without logs.

    The true drift is that of the reading at rest (d of the scene's equation 6). The true deviation is all that differs
    from the strain, drift, relaxation and lag (m + d - e). settings: the block `strain`.
    """
    folder = workspace.logs("strain") / protocol
    names = [path.parent.name for path in folder.glob("*/truth.csv")]
    if not names:
        return {}
    name = strain.recording_of(seed, names)
    clock_s, drift = scene.drift_at_samples(protocol, name, settings["simulate"], settings["sensor"]["channels"])
    path = folder / name / "truth.csv"
    with foreign.reading(path, "a table of numbers", "run `dvc repro` again"):
        truth = np.loadtxt(path, delimiter=",", skiprows=1)
    return {
        "true drift": scene.sampled(drift, clock_s, time_s),
        "true deviation": scene.sampled(truth[:, 1:], truth[:, 0], time_s),
    }


def _rescale(network, piece: series.Piece) -> None:
    """Let model-0 (an LstmRegressor) see a task as transfer does: scaled by that task's training part."""
    from pipeline.learning.series_regressors import Scaling

    network.scaling = Scaling.of_training(series.seen_in_training([piece]))


def settled(time_s: np.ndarray, frames: int) -> np.ndarray:
    """Return the rows that are decoded: past the warm-up, at most a tenth of a recording, with a whole window."""
    since_s = time_s - time_s[0]
    rows = np.flatnonzero(since_s >= min(WARM_UP_S, 0.1 * since_s[-1]))
    return rows[rows >= frames - 1]


def decoded(given: np.ndarray, truth: np.ndarray, time_s: np.ndarray) -> float:
    """Return R2, on held-out blocks of BLOCK_S, of a ridge regression from `given` (n, inputs) to `truth` (n, k)."""
    length = min(BLOCK_S, np.ptp(time_s) / (2 * FOLDS))  # a short recording has at least two blocks a fold
    block = ((time_s - time_s[0]) // length).astype(int) % FOLDS
    guess = np.empty_like(truth, dtype=float)
    for fold in range(FOLDS):
        fitted, held = block != fold, block == fold
        mean, spread = given[fitted].mean(axis=0), np.maximum(given[fitted].std(axis=0), 1e-9)
        centre, scale = truth[fitted].mean(axis=0), np.maximum(truth[fitted].std(axis=0), 1e-12)
        a, b = (given - mean) / spread, (truth - centre) / scale
        gram = a[fitted].T @ a[fitted] / fitted.sum() + DECODER_RIDGE * np.eye(a.shape[1])
        guess[held] = (a[held] @ np.linalg.solve(gram, a[fitted].T @ b[fitted] / fitted.sum())) * scale + centre
    return float(1 - np.square(guess - truth).sum() / np.square(truth - truth.mean(axis=0)).sum())


def _single_thread(function: Callable, *arguments):
    import torch

    torch.set_num_threads(1)
    return function(*arguments)


def main(workspace: Workspace) -> None:
    """Run the studies of the experiment and seed named on the command line."""
    experiment, seed = arguments.of_study(__doc__, ["strain"])
    values = params.load(workspace.params)
    study = values[experiment]["study"]
    tasks, bases = study["tasks"], study["bases"]
    units = sorted(study["capacity"]["units"], reverse=True)
    strands = [count for count in study["strands"] if count <= values[experiment]["sensor"]["channels"]]
    sizes = sorted(study["samples"], reverse=True)
    plans = {
        "capacity": (
            one_capacity,
            [(task, count) for count in units for task in tasks],
            ("protocol", "units", "params", "macs", "seed", "metric", "unit", "value"),
        ),
        "samples": (
            one_samples,
            [(task, model, samples) for samples in sizes for model in study["models"] for task in tasks],
            ("protocol", "model", "samples", "seed", "metric", "unit", "value"),
        ),
        "strands": (
            one_strands,
            [(count,) for count in sorted(strands, reverse=True)],
            ("protocol", "strands", "model", "seed", "metric", "unit", "value"),
        ),
        "bases": (
            one_base,
            [(base, task) for base in bases["trained_on"] for task in bases["used_for"]],
            ("protocol", "base", "model", "seed", "metric", "unit", "value"),
        ),
        "drift": (
            one_drift,
            [(task,) for task in tasks],
            ("protocol", "input", "target", "seed", "metric", "unit", "value"),
        ),
    }
    for name, (function, runs, columns) in plans.items():
        with tqdm(total=len(runs), desc=f"study {experiment} {name}", unit="run") as bar:
            wanted = {k: (workspace, values, *run, seed) for k, run in enumerate(runs)}
            rows = dict(workers.run(function, wanted, bar))
        together = sorted((row for key in sorted(rows) for row in rows[key]), key=lambda row: tuple(map(str, row[:4])))
        files.write_csv(workspace.study_result(experiment, name), columns, together)
    _write_latents(workspace, values, seed, workspace.study_result(experiment, "latents"))


def _write_latents(workspace: Workspace, values: Mapping, seed: int, path: Path) -> None:
    """Write t_s and states h0, h1, ... of model-0 on the first LATENT_SAMPLES test samples of task 2."""
    from pipeline.learning import lstm

    settings = values["strain"]
    task = strain.task("task_2", settings)
    spec = tasks_series.spec("strain", settings, task.base)
    network = lstm.LstmRegressor(spec, 1, None, transfer=False)
    network.load(workspace.run_folder("strain", paths.MODEL_ZERO, task.base, seed))
    (piece,) = series.read(workspace.dataset("strain"), task, "task_2", seed)
    _rescale(network, piece)
    first = int(np.flatnonzero(piece.part == "test")[0])
    states = network.latents(piece.record.x[: first + LATENT_SAMPLES])[first:]
    table = np.column_stack([piece.time_s[first : first + len(states)], states])
    header = ",".join(["t_s", *(f"h{k}" for k in range(states.shape[1]))])
    np.savetxt(path, table, fmt="%.6g", delimiter=",", header=header, comments="")


if __name__ == "__main__":
    arguments.run(main)
