"""Stage: predictions and scores of every trained model on the test part (which nothing before this reads).

Usage: python -m pipeline.evaluate EXPERIMENT
"""

import json
import sys
from pathlib import Path

import numpy as np
import pyarrow as pa
from tqdm import tqdm

from pipeline import classification, files, images, metrics, params, paths, series, tables, workers
from pipeline.availability import why_not_run
from pipeline.errors import run_stage

COLUMNS = ("experiment", "protocol", "condition", "model", "seed", "metric", "unit", "value", "n")


def evaluate_model(experiment: str, model: str, target: Path, report) -> list[tuple]:
    """Predict with every run of one model, write the predictions to `target`, return rows of scores.csv.

    A run whose training diverged before any usable epoch predicts NaN and keeps its rows, with NaN as value.
    """
    import torch

    from pipeline.fitting import Spec

    torch.set_num_threads(1)
    values = params.load()
    settings = values[experiment]
    score, pooled = getattr(metrics, experiment), metrics.POOLED.get(experiment, ())
    spec = Spec(*params.shapes(settings))
    block = params.model_settings(values, experiment, model)
    data = tables.read_dataset(paths.dataset(experiment), spec.frames)
    condition = tables.names(data.rows["condition"])
    scores, parts = [], []
    for protocol, seed in params.runs(values, experiment):
        folder = paths.require(
            paths.run_folder(experiment, model, protocol, seed), f"python -m pipeline.train {experiment} {model}"
        )
        regressor = params.build_model(model, spec, block, f"{experiment}.models.{model}")
        regressor.load(folder)
        rows = np.flatnonzero(data.part(protocol, seed) == "test")
        predicted = regressor.predict(data.x[rows])
        failed = json.loads((folder / "fit.json").read_text())["best_epoch"] == 0
        if failed:
            predicted[:] = np.nan
        conditions = np.unique(condition[rows])
        for name in [*conditions, *(pooled if len(conditions) > 1 else ())]:
            chosen = rows if name in pooled else rows[condition[rows] == name]
            picked = predicted if name in pooled else predicted[condition[rows] == name]
            windows = data.rows.take(pa.array(chosen))
            for metric, unit, value, n in score(windows, data.y[chosen], picked, settings):
                value = float("nan") if failed else value
                scores.append((experiment, protocol, name, model, seed, metric, unit, value, n))
        parts.append(tables.prediction_rows(protocol, seed, rows, predicted))
        report()
    tables.write(target / f"{model}.parquet", parts[0].schema, parts)
    return scores


def evaluate_series_model(experiment: str, model: str, target: Path, report) -> list[tuple]:
    """As `evaluate_model`, for an experiment on series: a model goes through the whole recording, the test part counts.

    Predictions have the three columns x, y, z (mm), NaN where the task does not ask for one.
    """
    import torch

    from pipeline import series_fitting

    torch.set_num_threads(1)
    values = params.load()
    settings, module = values[experiment], params.experiment_module(experiment)
    block = params.model_settings(values, experiment, model)
    scores, parts = [], []
    for protocol, seed in params.runs(values, experiment):
        folder = paths.require(
            paths.run_folder(experiment, model, protocol, seed), f"python -m pipeline.train_series {experiment} {model}"
        )
        task = module.task(protocol)
        spec = series_fitting.spec_of(task, settings["window"]["frames"])
        regressor = series_fitting.adapted(
            params.build_model(model, spec, block, f"{experiment}.models.{model}"), spec
        )
        regressor.load(folder)
        failed = json.loads((folder / "fit.json").read_text())["best_epoch"] == 0
        for piece in series.read(paths.dataset(experiment), task, protocol, seed):
            test = piece.part == "test"
            if not test.any():
                continue
            predicted = regressor.predict(piece.record.x)[test]
            if failed:
                predicted[:] = np.nan
            own = series.Record(*(column[test] for column in piece.record))
            for metric, unit, value, n in metrics.series(own, predicted, task.outputs):
                value = float("nan") if failed else value
                scores.append((experiment, protocol, piece.condition, model, seed, metric, unit, value, n))
            wide = np.full((len(predicted), 3), np.nan, np.float32)
            wide[:, list(task.outputs)] = predicted
            parts.append(tables.prediction_rows(protocol, seed, piece.rows[test], wide))
        report()
    tables.write(target / f"{model}.parquet", parts[0].schema, parts)
    return scores


def evaluate_image_model(experiment: str, model: str, target: Path, report) -> list[tuple]:
    """As `evaluate_model`, for an experiment on images; predictions have a column a class."""
    import torch

    from pipeline.image_fitting import spec_of

    torch.set_num_threads(1)
    values = params.load()
    block = params.model_settings(values, experiment, model)
    scores, parts = [], []
    for protocol, seed in params.runs(values, experiment):
        folder = paths.require(
            paths.run_folder(experiment, model, protocol, seed), f"python -m pipeline.train_images {experiment} {model}"
        )
        data = images.read(paths.dataset(experiment), protocol, seed)
        classifier = params.build_model(model, spec_of(len(data.objects)), block, f"{experiment}.models.{model}")
        classifier.load(folder)
        rows = np.flatnonzero(data.part == "test")
        predicted = classifier.predict(data.x[rows])
        failed = json.loads((folder / "fit.json").read_text())["best_epoch"] == 0
        if failed:
            predicted[:] = np.nan
        for metric, unit, value, n in classification.scores(data.y[rows], predicted):
            value = float("nan") if failed else value
            scores.append((experiment, protocol, images.modality(protocol), model, seed, metric, unit, value, n))
        parts.append(tables.prediction_rows(protocol, seed, rows, predicted))
        report()
    tables.write(target / f"{model}.parquet", parts[0].schema, parts)
    return scores


def main() -> None:
    """Evaluate the experiment named on the command line."""
    values = params.load()
    experiment = params.experiment_argument(sys.argv, "evaluate", values)
    models, runs = list(values[experiment]["models"]), params.runs(values, experiment)
    evaluate = evaluate_model
    if experiment in params.SERIES:
        evaluate = evaluate_series_model
    if experiment in params.IMAGES:
        evaluate = evaluate_image_model
    found = {}
    with files.replacing_folder(paths.predictions(experiment)) as draft:
        if why_not_run(experiment) is None:
            tasks = {model: (experiment, model, draft) for model in models}
            with tqdm(total=len(models) * len(runs), desc=f"evaluate {experiment}", unit="run") as bar:
                found = dict(workers.run(evaluate, tasks, bar, steps=len(runs)))
    files.write_csv(paths.scores(experiment), COLUMNS, (row for model in models for row in found.get(model, [])))


if __name__ == "__main__":
    run_stage(main)
