"""Stage: predictions and scores of every trained model on the test part (which nothing before this reads).

Usage: python -m pipeline.stages.evaluate EXPERIMENT
"""

import functools
import sys
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path

import numpy as np
import pyarrow as pa
from tqdm import tqdm

from pipeline.base import files, params, paths, workers
from pipeline.base.availability import why_not_run
from pipeline.base.errors import run_stage
from pipeline.datasets import images, schemas, series
from pipeline.datasets.windows import read_dataset
from pipeline.learning import trained
from pipeline.scoring import classification, metrics

COLUMNS = ("experiment", "protocol", "condition", "model", "seed", "metric", "unit", "value", "n")

# A run's protocol and seed, and for each part of its test rows: the rows' numbers in the dataset (n,), predictions
# (n, outputs), and scores, each with its condition.
Piece = tuple[np.ndarray, np.ndarray, list[tuple]]
Tested = tuple[str, int, list[Piece]]


def evaluate_model(values: Mapping, experiment: str, model: str, target: Path, report) -> list[tuple]:
    """Predict with every run of one model, write the predictions to `target`, return rows of scores.csv.

    A run whose training diverged before any usable epoch predicts NaN and keeps its rows, with NaN as value.
    """
    import torch

    torch.set_num_threads(1)
    tested = on_series if experiment in params.SERIES else on_images if experiment in params.IMAGES else on_windows
    load = functools.partial(trained.load, values, experiment, model)
    scores, parts = [], []
    for protocol, seed, pieces in tested(experiment, values[experiment], params.runs(values, experiment), load):
        for rows, predicted, found in pieces:
            scores += [(experiment, protocol, condition, model, seed, *row) for condition, *row in found]
            parts.append(schemas.prediction_rows(protocol, seed, rows, predicted))
        report()
    schemas.write(target / f"{model}.parquet", parts[0].schema, parts)
    return scores


def on_windows(experiment: str, settings: Mapping, runs: list[tuple[str, int]], load: Callable) -> Iterator[Tested]:
    """The tests of all runs of one model; `load(protocol, seed, spec)` gives its trained.Trained."""
    from pipeline.learning.regressors import Spec

    score, pooled = getattr(metrics, experiment), metrics.POOLED.get(experiment, ())
    spec = Spec(*params.shapes(settings))
    data = read_dataset(paths.dataset(experiment), spec.frames)
    condition = schemas.names(data.rows["condition"])
    for protocol, seed in runs:
        run = load(protocol, seed, spec)
        rows = np.flatnonzero(data.part(protocol, seed) == "test")
        predicted = run.predict_windows(data.x[rows], data, rows)
        conditions, found = np.unique(condition[rows]), []
        for name in [*conditions, *(pooled if len(conditions) > 1 else ())]:
            own = np.full(len(rows), name in pooled) | (condition[rows] == name)
            windows = data.rows.take(pa.array(rows[own]))
            values = score(windows, data.y[rows[own]], predicted[own], settings)
            found += [(name, *row) for row in metrics.unless_failed(values, run.failed)]
        yield protocol, seed, [(rows, predicted, found)]


def on_series(experiment: str, settings: Mapping, runs: list[tuple[str, int]], load: Callable) -> Iterator[Tested]:
    """As `on_windows`: a model goes through each whole recording, and the samples of the test part count.

    Predictions have the three columns x, y, z (mm), NaN where the task does not ask for one.
    """
    from pipeline.learning.series_regressors import spec_of

    module = params.experiment_module(experiment)
    for protocol, seed in runs:
        task = module.task(protocol, settings)
        run, pieces = load(protocol, seed, spec_of(task, settings["window"]["frames"])), []
        for piece in series.read(paths.dataset(experiment), task, protocol, seed):
            test = piece.part == "test"
            if not test.any():
                continue
            predicted = run.predict(piece.record.x)[test]
            own = series.Record(*(column[test] for column in piece.record))
            values = metrics.unless_failed(metrics.series(own, predicted, task.outputs), run.failed)
            wide = np.full((len(predicted), 3), np.nan, np.float32)
            wide[:, list(task.outputs)] = predicted
            pieces.append((piece.rows[test], wide, [(piece.condition, *row) for row in values]))
        yield protocol, seed, pieces


def on_images(experiment: str, settings: Mapping, runs: list[tuple[str, int]], load: Callable) -> Iterator[Tested]:
    """As `on_windows`; predictions have a column a class."""
    from pipeline.learning.image_classifier import spec_of

    for protocol, seed in runs:
        data = images.read(paths.dataset(experiment), protocol, seed)
        run = load(protocol, seed, spec_of(len(data.objects)))
        rows = np.flatnonzero(data.part == "test")
        predicted = run.predict(data.x[rows])
        values = metrics.unless_failed(classification.scores(data.y[rows], predicted), run.failed)
        yield protocol, seed, [(rows, predicted, [(images.modality(protocol), *row) for row in values])]


def main() -> None:
    """Evaluate the experiment named on the command line."""
    values = params.load()
    experiment = params.experiment_argument(sys.argv, "evaluate", values)
    models, runs = list(values[experiment]["models"]), params.runs(values, experiment)
    found = {}
    with files.replacing_folder(paths.predictions(experiment)) as draft:
        if why_not_run(experiment) is None:
            tasks = {model: (values, experiment, model, draft) for model in models}
            with tqdm(total=len(models) * len(runs), desc=f"evaluate {experiment}", unit="run") as bar:
                found = dict(workers.run(evaluate_model, tasks, bar, steps=len(runs)))
    files.write_csv(paths.scores(experiment), COLUMNS, (row for model in models for row in found.get(model, [])))


if __name__ == "__main__":
    run_stage(main)
