"""Models that see windows of frames: data, training, tests; see __init__.py."""

from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from types import ModuleType

import numpy as np
import pyarrow as pa

from tactile import experiments
from tactile.base import paths
from tactile.base.errors import InputError
from tactile.base.paths import Workspace
from tactile.datasets import levels, schemas
from tactile.datasets.windowing import windows_of
from tactile.datasets.windows import Dataset, read_dataset
from tactile.learning.spec import Spec
from tactile.learning.trained import Fitted, Tested, fitted
from tactile.scoring import metrics


def source(workspace: Workspace, experiment: str) -> pa.Table:
    """Return the windows that the stage window wrote."""
    return schemas.read(paths.require(workspace.windows(experiment), f"python -m tactile.stages.window {experiment}"))


def inputs(frames: pa.Table, settings: Mapping) -> pa.Table:
    """Return the windows of a frames table."""
    return windows_of(frames, settings["window"])


def rows(windows: pa.Table, module: ModuleType, settings: Mapping) -> tuple[pa.Table, pa.Table]:
    """Return the windows, as what is split and as the dataset's columns, whose conditions a module may name."""
    if not hasattr(module, "conditions"):
        return windows, windows
    at = windows.schema.get_field_index("condition")
    return windows, windows.set_column(at, windows.schema.field(at), module.conditions(windows))


def labelled(table: pa.Table, module: ModuleType, settings: Mapping) -> tuple[pa.Schema, Iterator[pa.Table]]:
    """Return schema and parts of the dataset with its maps `y`, some windows at a time: maps are most of a dataset."""
    kind = pa.list_(pa.float32(), settings["label"]["map_rows"] * settings["label"]["map_cols"])

    def parts() -> Iterator[pa.Table]:
        for first in range(0, table.num_rows, schemas.GROUP_ROWS):
            some = table.slice(first, schemas.GROUP_ROWS)
            yield some.append_column("y", schemas.lists(module.labels(some, settings), pa.float32()))

    return table.schema.append(pa.field("y", kind)), parts()


def spec(settings: Mapping):
    """Return the shapes of an experiment's task (learning.spec.Spec); settings: its block of settings."""
    sensor, label = settings["sensor"], settings["label"]
    return Spec(settings["window"]["frames"], sensor["rows"], sensor["cols"], label["map_rows"], label["map_cols"])


def read(path: Path, settings: Mapping, run: tuple[str, int] | None = None) -> Dataset:
    """Return a dataset as models see it; arguments: as of read_dataset."""
    shapes = spec(settings)
    return read_dataset(path, shapes.frames, shapes.elements, run)


def base(experiment: str, settings: Mapping, protocol: str) -> None:
    """Return None: no model of windows starts from another network."""


def fit(
    path: Path, experiment: str, settings: Mapping, protocol: str, seed: int, build: Callable, *, base=None, **fitting
) -> Fitted:
    """Return a model fitted to the training windows of one run. Raises InputError where a part has no window."""
    from tactile.learning import faults

    regressor = build(spec(settings))
    data = read(path, settings, (protocol, seed))
    part = data.part(protocol, seed)
    if faults.asked(regressor):
        fitting["levels"] = levels.of_windows(settings, data, part == "train")
    train, validation = (data.windows(part == name, regressor.streams) for name in ("train", "validation"))
    for name, windows in (("train", train), ("validation", validation)):
        if not len(windows[0]):
            raise InputError(
                f"{experiment}, {protocol} split, seed {seed}: no window in the {name} part; record more presses"
            )
    del data
    return fitted(regressor, train, validation, seed=seed, **fitting)


def adapted(model, spec):
    """Return the model as it is: models are made for windows."""
    return model


def tested(
    path: Path, experiment: str, settings: Mapping, runs: Iterable[tuple[str, int]], load: Callable
) -> Iterator[Tested]:
    """Yield the tests of all runs of one model; `load(protocol, seed, spec)` gives its Trained."""
    module = experiments.module(experiment)
    pooled = module.FACTS.pooled
    data = read(path, settings)
    condition = schemas.names(data.rows["condition"])
    for protocol, seed in runs:
        run = load(protocol, seed, spec(settings))
        part = data.part(protocol, seed)
        test, train = np.flatnonzero(part == "test"), np.flatnonzero(part == "train")
        predicted = run.unless_failed(predict(run.model, data.x[test], data, test))
        of_force = force_scores(run.model, module, data, train, settings)
        conditions, scores = np.unique(condition[test]), []
        for name in [*conditions, *(pooled if len(conditions) > 1 else ())]:
            chosen = np.full(len(test), name in pooled) | (condition[test] == name)
            values = score(module, data.y[test[chosen]], predicted[chosen], settings)
            values += of_force(test[chosen], predicted[chosen])
            scores += [(name, *row) for row in metrics.unless_failed(values, run.failed)]
        yield protocol, seed, [(test, predicted, scores)]


def force_scores(model, module: ModuleType, data: Dataset, train: np.ndarray, settings: Mapping) -> Callable:
    """Return what scores the force of pressure maps in contact, given rows of `data` and the maps predicted for them.

    The maps' gain is fitted to the load cells on the training part, the rows `train`. Where the prediction is no
    pressure map, nothing is scored.
    """
    if module.SCORES != "touch":
        return lambda rows, predicted: []
    force_n = np.nansum(schemas.matrix(data.rows["force_n"]), axis=1, dtype=float)
    gain = metrics.force_gain(force_n[train], predict(model, data.x[train], data, train), settings)

    def scored(rows: np.ndarray, predicted: np.ndarray) -> list:
        contact = metrics.in_contact(data.y[rows], settings)
        return metrics.force(force_n[rows[contact]], predicted[contact], gain, settings)

    return scored


def predict(model, x: np.ndarray, data: Dataset, rows: np.ndarray) -> np.ndarray:
    """Predict windows x (n, frames, elements), which are rows `rows` (n,) of `data` or perturbed copies of them.

    A streaming model starts each window from the state that its predecessor left (`data.previous`).
    """
    return model.predict(x, data.previous(rows)) if model.streams else model.predict(x)


def score(module: ModuleType, y: np.ndarray, predicted: np.ndarray, settings: Mapping) -> list:
    """Return rows (metric, unit, value, n) by the function of scoring/metrics.py that the experiment names."""
    return getattr(metrics, module.SCORES)(y, predicted, settings)


def stream(path: Path, experiment: str, settings: Mapping, protocol: str, seed: int) -> tuple:
    """Return (spec, test windows (n, frames, elements)) of one run."""
    data = read(path, settings)
    return spec(settings), data.x[data.part(protocol, seed) == "test"]


def timed(model, x: np.ndarray) -> tuple[Callable, np.ndarray]:
    """Return what answers one window, and its inputs; a model of streams sees one new frame at a time."""
    return (model.step, x[:, -1]) if model.streams else (model.predict, x)
