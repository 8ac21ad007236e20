"""Read what a model was trained on: the ranges of the readings, in the unit of its card, and the logs."""

import json
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pyarrow as pa

from pipeline import experiments, tasks
from pipeline.base import files, params, ranges
from pipeline.base.errors import InputError
from pipeline.base.paths import MODEL_ZERO, Workspace
from pipeline.datasets import images, schemas, series
from pipeline.inference.card import Card, Log
from pipeline.logs import sources
from pipeline.logs.formats import LOGS


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


def digests(workspace: Workspace, settings: Mapping, experiment: str) -> dict[str, str] | None:
    """Return `condition/recording` -> digest of the sensor's log of all recordings that ingest read.

    settings: the block of the experiment. None where the logs are no longer here, or are others than ingest read.
    """
    report = workspace.ingest_report(experiment)
    if not report.is_file():
        return None
    names = list(json.loads(report.read_text(encoding="utf-8")).get("recordings", {}))
    try:
        recordings = experiments.module(experiment).recordings(_raw(workspace, settings, experiment))
    except InputError:  # no recording is there
        return None
    logs = [path / LOGS[experiment] if experiment in LOGS else path for path in recordings]
    if len(names) != len(logs):
        return None
    return {name: files.content_sha256(path) for name, path in zip(names, logs, strict=True)}


def _raw(workspace: Workspace, settings: Mapping, experiment: str) -> Path:
    """Return the folder of the raw logs that an experiment reads."""
    if experiment in sources.SOURCES:
        return sources.folder(workspace, experiment)
    source = settings["source"]
    return workspace.logs(experiment) if source == "simulated" else workspace.root / source


def logs(workspace: Workspace, settings: Mapping, card: Card, known: Mapping[str, str] | None) -> list[Log] | None:
    """Return the recordings in the split of the run that a card describes, with their parts, by name.

    A model that starts from model-0 was trained on the training part of that one, too. known: as of `digests`. None
    where it is None, the dataset is not here, or has a recording that is not known.
    """
    path = workspace.dataset(card.experiment)
    if known is None or not path.exists():
        return None
    splits = [schemas.split_column(card.protocol, card.seed)]
    base = tasks.of(card.experiment).base(card.experiment, settings, card.protocol)
    if base and card.model != MODEL_ZERO and params.transfers(card.model):
        splits.append(schemas.split_column(base, card.seed))
    parts: dict[str, set[str]] = {}
    for number, split in enumerate(splits):
        table = schemas.read(path, ["condition", "recording", split]).unify_dictionaries()
        for row in table.group_by(["condition", "recording", split]).aggregate([]).to_pylist():
            if row[split] != "unused" and (number == 0 or row[split] != "test"):
                parts.setdefault(f"{row['condition']}/{row['recording']}", set()).add(row[split])
    if not parts.keys() <= known.keys():
        return None
    return [
        Log(name=name, sha256=known[name], parts=[part for part in schemas.PARTS if part in parts[name]])
        for name in sorted(parts)
    ]
