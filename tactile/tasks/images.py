"""Models that see one tactile image (glove, glove_recorded): data, training, tests; see __init__.py."""

from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from types import ModuleType

import numpy as np
import pyarrow as pa

from tactile import experiments
from tactile.base import paths
from tactile.base.errors import InputError
from tactile.base.paths import Workspace
from tactile.datasets import images, levels, schemas
from tactile.learning.spec import of_images
from tactile.learning.trained import Fitted, Tested, fitted
from tactile.scoring import classification, metrics


def source(workspace: Workspace, experiment: str) -> pa.Table:
    """Return the frames that the stage ingest wrote."""
    return schemas.read(paths.require(workspace.frames(experiment), f"python -m tactile.stages.ingest {experiment}"))


def inputs(frames: pa.Table, settings: Mapping) -> pa.Table:
    """Return the frames: the experiment chooses those that become images."""
    return frames


def rows(frames: pa.Table, module: ModuleType, settings: Mapping) -> tuple[pa.Table, pa.Table]:
    """Return the frames that become images, as what is split, and their images as the dataset's columns."""
    chosen = frames.take(pa.array(module.chosen(frames, settings))).combine_chunks()
    return chosen, images.dataset_rows(chosen, module.images(chosen, settings))


def labelled(table: pa.Table, module: ModuleType, settings: Mapping) -> tuple[pa.Schema, list[pa.Table]]:
    """Return schema and parts of the dataset: the label is the condition."""
    return table.schema, [table]


def spec(data: images.Images):
    """Return the shapes of the task (learning.spec.Spec): one image, one score per object."""
    return of_images(len(data.objects), data.shape)


def base(experiment: str, settings: Mapping, protocol: str) -> None:
    """Return None: no model of images starts from another network."""


def fit(
    path: Path, experiment: str, settings: Mapping, protocol: str, seed: int, build: Callable, *, base=None, **fitting
) -> Fitted:
    """Return a model fitted to the images that a protocol names: pressure, strain or both."""
    from tactile.learning import faults

    data = images.read(path, protocol, seed)
    classifier = build(spec(data))
    if faults.asked(classifier):
        fitting["readings"] = readings(path, experiment, settings, protocol, data)
    train, validation = (part_of(data, name) for name in ("train", "validation"))
    del data
    return fitted(classifier, train, validation, seed=seed, **fitting)


def readings(path: Path, experiment: str, settings: Mapping, protocol: str, data: images.Images):
    """Return the readings behind the training images of a run (learning.faults.Readings), of the frames beside them.

    path: of the dataset; data: its images. Raises InputError where there are no frames, or those of other images.
    """
    from tactile.learning.faults import Readings

    module, file = experiments.module(experiment), path.with_name("frames.parquet")
    table = schemas.read(paths.require(file, f"python -m tactile.stages.ingest {experiment}"))
    chosen = module.chosen(table, settings)
    train = data.part == "train"
    names = images.reading_columns(table.schema)
    if len(chosen) != len(train):
        raise _other_frames(file, experiment)
    values, found = {}, []
    for name in names:
        kind = table.schema.field(name).type.value_type
        values[name] = schemas.matrix(table[name])[chosen[train]]
        lowest, highest, _ = device(module, name, images.areas(settings))
        found.append(levels.of_area(values[name], lowest, highest, pa.types.is_integer(kind)))
    edges = np.cumsum([values[name].shape[1] for name in names])[:-1]
    modality = images.modality(protocol)

    def shown(cells: np.ndarray) -> np.ndarray:
        areas = zip(names, np.split(cells, edges, axis=1), strict=True)
        columns = {name: schemas.lists(own, table.schema.field(name).type.value_type) for name, own in areas}
        return module.images(pa.table(columns), settings)[modality].reshape(len(cells), -1)

    cells = np.concatenate([values[name] for name in names], axis=1)
    if not np.array_equal(shown(cells), data.x[train, 0]):
        raise _other_frames(file, experiment)
    return Readings(cells, levels.side_by_side(found), shown)


def _other_frames(file: Path, experiment: str) -> InputError:
    return InputError(
        f"{file}: its frames are not those of the images in dataset.parquet beside it; run "
        f"`python -m tactile.stages.dataset {experiment}` again"
    )


def device(
    module: ModuleType, area: str, areas: Mapping[str, images.Area] = images.GLOVE
) -> tuple[float, float, tuple[tuple[int, int], ...]]:
    """Return the range of an area's readings and its matrices; module: of the experiment; areas: of its sensor."""
    if hasattr(module, "MATRICES"):
        if area == "strain":
            return -module.IMPOSSIBLE_DEG, module.IMPOSSIBLE_DEG, ()
        return 0, module.FULL_SCALE, module.MATRICES
    here = areas[area]
    return here.lowest, here.highest, ((here.rows, here.cols),)


def part_of(data: images.Images, name: str) -> tuple[np.ndarray, np.ndarray]:
    """Return images x (n, 1, pixels) and labels y (n, classes) of one part of a run."""
    return data.x[data.part == name], data.y[data.part == name]


def adapted(model, spec):
    """Return the model as it is: an image is a window of one frame."""
    return model


def tested(
    path: Path, experiment: str, settings: Mapping, runs: Iterable[tuple[str, int]], load: Callable
) -> Iterator[Tested]:
    """Yield the tests of all runs; predictions have one column per class. load: as of windows."""
    for protocol, seed in runs:
        data = images.read(path, protocol, seed)
        run = load(protocol, seed, spec(data))
        test = np.flatnonzero(data.part == "test")
        predicted = run.predict(data.x[test])
        scores = metrics.unless_failed(classification.scores(data.y[test], predicted), run.failed)
        yield protocol, seed, [(test, predicted, [(images.modality(protocol), *row) for row in scores])]


def stream(path: Path, experiment: str, settings: Mapping, protocol: str, seed: int) -> tuple:
    """Return (spec, test images (n, 1, pixels)) of one run."""
    data = images.read(path, protocol, seed)
    return spec(data), part_of(data, "test")[0]


def timed(model, x: np.ndarray) -> tuple[Callable, np.ndarray]:
    """Return what answers one image, and the images."""
    return model.predict, x
