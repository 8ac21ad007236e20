"""Measure how long a prediction takes, and what the model weighs. Runs alone, on one thread.

A prediction is the answer to one window or image, or, on series and streams, to the next sample or frame with the state
carried along. Networks and regressions run in ONNX Runtime, but for LoMP, which has compiled code of its own for one
row; trees, naive Bayes and ridge run in scikit-learn. All models are timed in turn, round after round, so that what
else the machine does meets all of them; `p50_low_ms` and `p50_high_ms` are the lowest and the highest median of a
round.
Usage: python -m pipeline.stages.latency EXPERIMENT
"""

import csv
import os
import statistics
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from tqdm import tqdm

from pipeline.results.times import COLUMNS
from tactile import tasks
from tactile.base import arguments, files, params, paths
from tactile.base.availability import why_not_run
from tactile.base.paths import Workspace

FEWER = 10  # batches of many windows are predicted this much less often: their times vary less, and they are long


def prediction_times(predict, x: np.ndarray, batch: int, settings: dict) -> np.ndarray:
    """Milliseconds of each of a round's share of `settings.calls` predictions after `settings.warm_up` of them.

    Of larger batches FEWER times less of both. x: (n, frames, elements); every call gets the next windows, as a
    stream would.
    """
    fewer = FEWER if batch > 1 else 1
    warm_up, calls = -(-settings["warm_up"] // fewer), -(-settings["calls"] // (fewer * settings["rounds"]))
    starts = [(k * batch) % max(1, len(x) - batch + 1) for k in range(warm_up + calls)]
    taken = []
    for start in starts:
        windows = x[start : start + batch]
        began = time.perf_counter()
        predict(windows)
        taken.append((time.perf_counter() - began) * 1e3)
    return np.array(taken[warm_up:])


def training_seconds(workspace: Workspace, experiment: str, model: str, protocol: str) -> float:
    """Median over the seeds of the main protocol of the measured training time, in s."""
    path = paths.require(workspace.training_times(experiment, model), params.training_command(experiment))
    with open(path, newline="", encoding="utf-8") as file:
        return statistics.median(float(row["train_s"]) for row in csv.DictReader(file) if row["protocol"] == protocol)


def fastest(
    workspace: Workspace, values: dict, experiment: str, protocol: str, seed: int, models: dict, x: np.ndarray
) -> dict[str, tuple[Callable, np.ndarray]]:
    """Return, by model, what predicts the next rows of its inputs, and the inputs; models: trained, by their names."""
    from tactile.inference import onnx_export
    from tactile.inference.describer import Describer
    from tactile.inference.predictor import Predictor

    task, describer, timed = tasks.of(experiment), Describer(workspace, values, experiment), {}
    for model, regressor in models.items():
        card = describer.without_scores(model, protocol, seed, commit="")
        with tempfile.TemporaryDirectory() as folder:
            onnx = onnx_export.faster(Predictor(regressor, card), Path(folder)).onnx
        readings = onnx_export.in_columns(x, card) if card.kind == "series" else x.astype(np.float32)
        timed[model] = task.timed(regressor, x) if onnx is None else task.timed(onnx, readings)
    return timed


def main(workspace: Workspace) -> None:
    """Time every model of the experiment named on the command line, first run of each."""
    values = params.load(workspace.params)
    experiment = arguments.parse(__doc__, experiment=values["experiments"]).experiment
    settings = values[experiment]["latency"]
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ[name] = str(settings["threads"])
    rows = []
    if why_not_run(workspace, experiment) is None:
        import torch
        from threadpoolctl import threadpool_limits

        torch.set_num_threads(settings["threads"])
        protocol, seed = params.runs(values, experiment)[0]
        task = tasks.of(experiment)
        spec, x = task.stream(workspace.dataset(experiment), experiment, values[experiment], protocol, seed)
        if len(x) < max(settings["batches"]):  # a tiny dataset: the time does not depend on the values
            x = np.resize(x, (max(settings["batches"]), *x.shape[1:]))
        models = {
            model: tasks.load(workspace, values, experiment, model, protocol, seed, spec).model
            for model in values[experiment]["models"]
        }
        timed = fastest(workspace, values, experiment, protocol, seed, models, x)
        times = {(model, batch): [] for model in models for batch in settings["batches"]}
        with threadpool_limits(settings["threads"]):
            turns = [key for _ in range(settings["rounds"]) for key in times]
            for model, batch in tqdm(turns, desc=f"latency {experiment}", unit="model"):
                times[model, batch].append(prediction_times(*timed[model], batch, settings))
        for (model, batch), of_rounds in times.items():
            medians = [np.median(taken) for taken in of_rounds]
            p50, p95 = np.percentile(np.concatenate(of_rounds), [50, 95])
            folder = workspace.run_folder(experiment, model, protocol, seed)
            size = sum(file.stat().st_size for file in folder.iterdir() if file.name not in ("history.csv", "fit.json"))
            costs = (
                models[model].parameters(),
                models[model].macs(),
                training_seconds(workspace, experiment, model, protocol),
            )
            key = (experiment, model, batch, settings["threads"])
            rows.append((*key, p50, min(medians), max(medians), p95, *costs, size, settings["calls"]))
    files.write_csv(workspace.latency(experiment), COLUMNS, rows)


if __name__ == "__main__":
    arguments.run(main)
