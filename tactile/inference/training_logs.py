"""Find the logs that a model was trained on, for `predict` to give no score of them."""

import json
from collections.abc import Mapping
from pathlib import Path

from tactile import experiments, tasks
from tactile.base import files, foreign, params
from tactile.base.errors import InputError
from tactile.base.paths import MODEL_ZERO, Workspace
from tactile.datasets import schemas
from tactile.experiments import facts, log_name
from tactile.inference.card import Card, Log
from tactile.logs import sources


def digests(workspace: Workspace, settings: Mapping, experiment: str) -> dict[str, str] | None:
    """Return `condition/recording` -> digest of the sensor's log of all recordings that ingest read.

    settings: the block of the experiment. None where the logs are no longer here, or are others than ingest read,
    and of frames that are no log.
    """
    report = workspace.ingest_report(experiment)
    if not report.is_file() or not facts(experiment).stream:
        return None
    with foreign.reading(report, "a report of ingest", f"run `python -m tactile.stages.ingest {experiment}`"):
        names = list(json.loads(report.read_text(encoding="utf-8")).get("recordings", {}))
    if not names:
        return None
    try:
        recordings = experiments.module(experiment).recordings(_raw(workspace, settings, experiment))
    except InputError:  # no recording is there
        return None
    logs = [path / log_name(experiment) if log_name(experiment) else path for path in recordings]
    if len(names) != len(logs):
        return None
    return {name: files.content_sha256(path) for name, path in zip(names, logs, strict=True)}


def _raw(workspace: Workspace, settings: Mapping, experiment: str) -> Path:
    """Return the folder of the raw logs that an experiment reads."""
    if facts(experiment).source:
        return sources.folder(workspace, experiment)
    source = settings["source"]
    return workspace.logs(experiment) if source == "simulated" else workspace.root / source


def added(workspace: Workspace, settings: Mapping, card: Card, known: Mapping[str, str] | None) -> Card:
    """Return a card with the recordings in the split of its run and their parts, by name.

    A model that starts from model-0 was trained on the training part of that one, too. settings: the block of the
    experiment; known: as of `digests`. Without them where it is None, the dataset is not here, or one is not known.
    """
    path = workspace.dataset(card.experiment)
    if known is None or not path.exists():
        return card
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
        return card
    logs = [
        Log(name=name, sha256=known[name], parts=[part for part in schemas.PARTS if part in parts[name]])
        for name in sorted(parts)
    ]
    return card.model_copy(update={"logs": logs})
