"""Models that see one tactile image (glove, glove_recorded): data, training, tests; see __init__.py."""

from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from types import ModuleType

import numpy as np
import pyarrow as pa

from pipeline.base import paths
from pipeline.base.paths import Workspace
from pipeline.datasets import images, schemas
from pipeline.learning.trained import Fitted, Tested, fitted
from pipeline.scoring import classification, metrics


def source(workspace: Workspace, experiment: str) -> pa.Table:
    """Return the frames that the stage ingest wrote."""
    return schemas.read(paths.require(workspace.frames(experiment), f"python -m pipeline.stages.ingest {experiment}"))


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
    """Return the shapes of the task (learning.regressors.Spec): one image, one score per object."""
    from pipeline.learning.image_classifier import spec_of

    return spec_of(len(data.objects), data.shape)


def base(experiment: str, settings: Mapping, protocol: str) -> None:
    """Return None: no model of images starts from another network."""


def fit(
    path: Path, experiment: str, settings: Mapping, protocol: str, seed: int, build: Callable, *, base=None, **fitting
) -> Fitted:
    """Return a model fitted to the images that a protocol names: pressure, strain or both."""
    data = images.read(path, protocol, seed)
    classifier = build(spec(data))
    train, validation = (part_of(data, name) for name in ("train", "validation"))
    del data
    return fitted(classifier, train, validation, seed=seed, **fitting)


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
