"""Read what a model was trained on, in the unit of its card, to find the ranges of the readings."""

from collections.abc import Mapping

import numpy as np
import pyarrow as pa

from tactile import experiments
from tactile.base import ranges
from tactile.base.errors import InputError
from tactile.base.paths import Workspace
from tactile.datasets import images, schemas, series
from tactile.inference.card import Card


def trained_on(workspace: Workspace, settings: Mapping, card: Card) -> list[ranges.Columns] | None:
    """Return the ranges of the readings in the training part of the run that a card describes.

    settings: the block of its experiment. None where the dataset is not here. Raises InputError where dataset and
    frames are not of one another.
    """
    if not workspace.dataset(card.experiment).exists():
        return None
    return OF_KIND[card.kind](workspace, settings, card)


def _of_windows(workspace: Workspace, settings: Mapping, card: Card) -> list[ranges.Columns]:
    split = schemas.split_column(card.protocol, card.seed)
    table = schemas.read(workspace.dataset(card.experiment), ["x", split])
    x = schemas.matrix(table["x"])[schemas.names(table[split]) == "train"].reshape(-1, card.inputs.columns)
    return [ranges.of(x, "v", 0, range(card.inputs.columns), ranges.MEAN_MARGIN_OF_TOUCHES)]


def _of_series(workspace: Workspace, settings: Mapping, card: Card) -> list[ranges.Columns]:
    task = experiments.module(card.experiment).task(card.protocol, settings)
    pieces = series.read(workspace.dataset(card.experiment), task, card.protocol, card.seed)
    x = np.concatenate([piece.record.x[piece.record.training] for piece in pieces])
    return [ranges.of(x, "v", 0, card.inputs.chosen, ranges.MEAN_MARGIN)]


def _of_images(workspace: Workspace, settings: Mapping, card: Card) -> list[ranges.Columns]:
    """An image of a dataset no longer has its readings, but the frames do that it was made of."""
    module, path = experiments.module(card.experiment), workspace.dataset(card.experiment)
    split = schemas.split_column(card.protocol, card.seed)
    dataset, frames = schemas.read(path, ["t_s", split]), schemas.read(workspace.frames(card.experiment))
    frames = frames.take(pa.array(module.chosen(frames, settings)))
    if not np.array_equal(frames["t_s"].to_numpy(), dataset["t_s"].to_numpy()):
        raise InputError(f"{path}: is not of {workspace.frames(card.experiment)}; run `dvc repro`")
    frames = frames.filter(pa.array(schemas.names(dataset[split]) == "train"))
    areas = {name: schemas.matrix(frames[name]) for name in images.reading_columns(frames.schema)}
    modality, x = images.modality(card.protocol), np.concatenate(list(areas.values()), axis=1)
    seen = list(areas) if modality == images.COMBINED else [modality]
    return ranges.of_areas(x, {name: values.shape[1] for name, values in areas.items()}, seen)


OF_KIND = {"windows": _of_windows, "series": _of_series, "images": _of_images}
