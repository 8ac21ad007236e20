"""Models that see a whole series: data, training, tests; see __init__.py."""

from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from types import ModuleType

import numpy as np
import pyarrow as pa

from tactile import experiments
from tactile.base import paths
from tactile.base.errors import InputError
from tactile.base.paths import Workspace
from tactile.datasets import levels, schemas, series
from tactile.learning.spec import of_series
from tactile.learning.trained import Fitted, Tested, fitted
from tactile.scoring import metrics


def source(workspace: Workspace, experiment: str) -> pa.Table:
    """Return the frames that the stage ingest wrote."""
    return schemas.read(paths.require(workspace.frames(experiment), f"python -m tactile.stages.ingest {experiment}"))


def inputs(frames: pa.Table, settings: Mapping) -> pa.Table:
    """Return the frames: a series is all of them."""
    return frames


def rows(frames: pa.Table, module: ModuleType, settings: Mapping) -> tuple[pa.Table, pa.Table]:
    """Return the frames, as what is split, and with the column `y` as the dataset's columns."""
    return frames, frames.rename_columns({"y_mm": "y"})


def labelled(table: pa.Table, module: ModuleType, settings: Mapping) -> tuple[pa.Schema, list[pa.Table]]:
    """Return schema and parts of the dataset: a series carries its labels."""
    return table.schema, [table]


def spec(experiment: str, settings: Mapping, protocol: str):
    """Return the shapes of a protocol's task (learning.spec.Spec)."""
    return of_series(experiments.module(experiment).task(protocol, settings), settings["window"]["frames"])


def base(experiment: str, settings: Mapping, protocol: str) -> str:
    """Return the protocol that model-0 of a protocol is trained on (section III-B)."""
    return experiments.module(experiment).task(protocol, settings).base


def fit(path: Path, experiment: str, settings: Mapping, protocol: str, seed: int, build: Callable, **fitting) -> Fitted:
    """Return a model fitted to the recordings of one run. Raises InputError where no sample is for training."""
    shapes = spec(experiment, settings, protocol)
    regressor = adapted(build(shapes), shapes)
    task = experiments.module(experiment).task(protocol, settings)
    records = series.seen_in_training(series.read(path, task, protocol, seed))
    if most := settings["protocols"].get(protocol, {}).get("samples"):
        records = [series.Record(*(column[-most:] for column in record)) for record in records]
        records = [record._replace(training=np.ones(len(record.x), dtype=bool)) for record in records]
    if not any(record.training.any() for record in records):
        raise InputError(f"{experiment}, {protocol}: no sample in the training part; record longer")
    return fitted(regressor, records, seed=seed, **fitting, **known(regressor, records, settings))


def known(model, records: list[series.Record], settings: Mapping) -> dict:
    """Return what a model's `fit` must know beside the records: the levels of readings, for a training with faults."""
    from tactile.learning import faults

    return {"levels": levels.of_series(records, settings)} if faults.asked(model) else {}


def adapted(model, spec):
    """Return the model itself if it is made for series, else its use on a series."""
    from tactile.learning import series_regressors

    return series_regressors.adapted(model, spec)


def tested(
    path: Path, experiment: str, settings: Mapping, runs: Iterable[tuple[str, int]], load: Callable
) -> Iterator[Tested]:
    """Yield the tests of all runs: a model goes through each whole recording, and the samples of the test part count.

    Predictions have the three columns x, y, z (mm), NaN where the task does not ask for one. load: as of windows.
    """
    module = experiments.module(experiment)
    for protocol, seed in runs:
        task = module.task(protocol, settings)
        run, tests = load(protocol, seed, spec(experiment, settings, protocol)), []
        for piece in series.read(path, task, protocol, seed):
            test = piece.part == "test"
            if not test.any():
                continue
            predicted = run.predict(piece.record.x)[test]
            scores = metrics.unless_failed(score(piece, predicted, task), run.failed)
            wide = np.full((len(predicted), 3), np.nan, np.float32)
            wide[:, list(task.outputs)] = predicted
            tests.append((piece.rows[test], wide, [(piece.condition, *row) for row in scores]))
        yield protocol, seed, tests


def score(piece: series.Piece, predicted: np.ndarray, task: series.Task, part: str = "test") -> list:
    """Return rows (metric, unit, value, n) of predictions (n, outputs) of the samples of one part of a piece."""
    chosen = piece.part == part
    record = series.Record(*(column[chosen] for column in piece.record))
    return metrics.series(record, predicted, task.outputs)


def stream(path: Path, experiment: str, settings: Mapping, protocol: str, seed: int) -> tuple:
    """Return (spec, test samples (n, channels)) of one run."""
    task = experiments.module(experiment).task(protocol, settings)
    pieces = series.read(path, task, protocol, seed)
    x = np.concatenate([piece.record.x[piece.part == "test"] for piece in pieces])
    return spec(experiment, settings, protocol), x


def timed(model, x: np.ndarray) -> tuple[Callable, np.ndarray]:
    """Return what answers the next sample, with the state carried along, and the samples."""
    return model.step, x
