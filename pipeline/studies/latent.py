"""Test what the latent-space paper asserts and does not test, that the latent space is free of drift.

Writes tables of one seed: drift.csv (how well elapsed time, the strands' true drift and their whole deviation from the
strain can be read from the raw voltages and from the latent space, in held-out blocks of all but the first minute) and
latents.csv (states of model-0 on task 2, for figure 7).
Usage: python -m pipeline.studies.latent strain SEED
"""

from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
from tqdm import tqdm

from pipeline.scenes import strain as scene
from tactile.base import arguments, files, foreign, params, paths, workers
from tactile.base.paths import Workspace
from tactile.datasets import series
from tactile.experiments import strain
from tactile.tasks import series as tasks_series

BLOCK_S = 120.0  # decoding is tested on every fifth block of this length, trained on the others
FOLDS = 5
LATENT_SAMPLES = 500  # 100 s
TASKS = ("task_1", "task_2")
DECODER_RIDGE = 1e-4  # of standardised inputs, against the mean squared error of the standardised target
WARM_UP_S = 60.0  # an LSTM starts with states of 0, up to 45 standard deviations from later ones, which takes 10 s


def one_drift(workspace: Workspace, values: Mapping, protocol: str, seed: int, report: Callable) -> list[tuple]:
    """Return rows of drift.csv for one task: R2 of a ridge decoder, by input and by what is decoded."""
    import torch

    from tactile.learning import lstm

    torch.set_num_threads(1)
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
    from tactile.learning.series_regressors import Scaling

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


def main(workspace: Workspace) -> None:
    """Run the study of the experiment and seed named on the command line."""
    experiment, seed = arguments.of_study(__doc__, ["strain"])
    values = params.load(workspace.params)
    with tqdm(total=len(TASKS), desc=f"study {experiment} drift", unit="run") as bar:
        rows = dict(workers.run(one_drift, {task: (workspace, values, task, seed) for task in TASKS}, bar))
    columns = ("protocol", "input", "target", "seed", "metric", "unit", "value")
    together = sorted(row for task in TASKS for row in rows[task])
    files.write_csv(workspace.study_result(experiment, "drift"), columns, together)
    _write_latents(workspace, values, seed, workspace.study_result(experiment, "latents"))


def _write_latents(workspace: Workspace, values: Mapping, seed: int, path: Path) -> None:
    """Write t_s and states h0, h1, ... of model-0 on the first LATENT_SAMPLES test samples of task 2."""
    from tactile.learning import lstm

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
