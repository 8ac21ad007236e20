"""Score models on a scene whose settings are not those of params.yaml, all the way from its logs.

What the stages simulate, ingest, window, dataset, train and evaluate do, in a workspace that nobody keeps.
"""

import tempfile
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pyarrow as pa

from pipeline import scenes
from tactile import experiments, models, tasks
from tactile.base import params, paths
from tactile.base.errors import InputError
from tactile.base.paths import Workspace
from tactile.datasets import images, schemas, series, specimens
from tactile.learning.trained import Trained
from tactile.scoring import classification, metrics
from tactile.settings import Params
from tactile.tasks import images as tasks_images
from tactile.tasks import series as tasks_series
from tactile.tasks import windows as tasks_windows

CONDITIONS = {"touch": ("single", "double")}  # no number of the paper is about the others, demonstrations


class Asked(NamedTuple):
    """What is trained on the dataset of a changed scene, and scored."""

    protocols: list[str]
    models: Mapping  # key -> settings, of all models that are scored or that transfer starts from
    where: str  # the place of `models` in params.yaml
    scored: list[str]  # keys of `models`
    part: str = "test"  # or validation


def settings_of(values: Mapping, experiment: str, changes: Mapping, where: str) -> dict:
    """Return the experiment's block of settings with the values of `changes`, block by block.

    where: the place in params.yaml that a sentence about a wrong value names. Raises InputError where the result is
    not what tactile/settings allows.
    """
    settings = _merged(values[experiment], changes)
    params.check_block(settings, Params.model_fields[experiment].annotation, f"{experiment} with {where}")
    return settings


def drawn(settings: Mapping, seed: int) -> dict:
    """Return the settings of the scene that a seed draws: one other specimen, and other motions, noise and faults."""
    return {**settings, "simulate": specimens.drawn(settings["simulate"], seed) | {"specimens": 1}}


def _merged(block: Mapping, changes: Mapping) -> dict:
    """Return `block` with the values of `changes`, block by block."""
    merged = dict(block)
    for key, value in changes.items():
        both = isinstance(value, Mapping) and isinstance(merged.get(key), Mapping)
        merged[key] = _merged(merged[key], value) if both else value
    return merged


def write_dataset(workspace: Workspace, experiment: str, settings: dict, protocols: Iterable[str], seed: int) -> None:
    """Simulate, ingest and label in a workspace: what the stages simulate, ingest, window and dataset do, unsaved.

    The protocols that model-0 of `protocols` is trained on are added.
    """
    module, task = experiments.module(experiment), tasks.of(experiment)
    recordings, logs_of = scenes.plan(experiment, settings)
    conditions = CONDITIONS.get(experiment)
    recordings = [each for each in recordings if conditions is None or each.condition in conditions]
    scenes.write_logs(workspace.logs(experiment), recordings, logs_of)
    schema = module.frames_schema(settings)
    parts = [module.read_recording(path, settings)[0] for path in module.recordings(workspace.logs(experiment))]
    frames = pa.concat_tables([part.select(schema.names).cast(schema) for part in parts])
    inputs = task.inputs(frames.unify_dictionaries().combine_chunks(), settings)
    bases = [task.base(experiment, settings, protocol) for protocol in protocols]
    runs = [(name, seed) for name in dict.fromkeys([*protocols, *filter(None, bases)])]
    tasks.write_dataset(workspace.dataset(experiment), experiment, inputs, settings, runs)


def scores(
    workspace: Workspace, experiment: str, settings: dict, asked: Asked, seed: int, device: str
) -> Iterator[tuple[str, str, list[metrics.Row]]]:
    """Yield (condition, model, rows of scores of the asked part) of every model trained on the workspace's dataset."""
    by_kind = {"windows": _windows_scores, "series": _series_scores, "images": _images_scores}
    yield from by_kind[experiments.module(experiment).KIND](workspace, experiment, settings, asked, seed, device)


def scores_anew(
    experiment: str, settings: dict, asked: Asked, seed: int, device: str
) -> Iterator[tuple[str, str, list[metrics.Row]]]:
    """Yield as `scores`, of a dataset that is made for it and that nobody keeps."""
    with tempfile.TemporaryDirectory() as name:
        workspace = Workspace(Path(name))
        write_dataset(workspace, experiment, settings, asked.protocols, seed)
        yield from scores(workspace, experiment, settings, asked, seed, device)


def _fitted(
    workspace: Workspace, experiment: str, model: str, settings: dict, asked: Asked, run: tuple, **fitting
) -> Trained:
    """Return a model trained on the workspace's dataset; run: protocol and seed."""
    if model not in asked.models:
        raise InputError(f"params.yaml, {asked.where}: '{model}' is missing; {experiment}.model_zero names it")

    def build(spec):
        return models.build(model, spec, asked.models[model], f"{asked.where}.{model}")

    regressor = (
        tasks.of(experiment).fit(workspace.dataset(experiment), experiment, settings, *run, build, **fitting).model
    )
    return Trained(regressor, failed=regressor.summary.best_epoch == 0)


def _windows_scores(workspace: Workspace, experiment: str, settings: dict, asked: Asked, seed: int, device: str):
    """Yield as `scores`; a condition is that of the recording."""
    module = experiments.module(experiment)
    data = tasks_windows.read(workspace.dataset(experiment), settings)
    condition = schemas.names(data.rows["condition"])
    for protocol in asked.protocols:
        part = data.part(protocol, seed)
        for model in asked.scored:
            run = _fitted(workspace, experiment, model, settings, asked, (protocol, seed), device=device)
            for name in CONDITIONS[experiment]:
                rows = np.flatnonzero((part == asked.part) & (condition == name))
                if not len(rows):  # double touches are for the test part alone
                    continue
                predicted = tasks_windows.predict(run.model, data.x[rows], data, rows)
                scored = tasks_windows.score(module, data.y[rows], predicted, settings)
                yield name, model, metrics.unless_failed(scored, run.failed)


def _series_scores(workspace: Workspace, experiment: str, settings: dict, asked: Asked, seed: int, device: str):
    """Yield as `scores`; a condition is a task. Model-0 of transfer is trained on all of task 0 first."""
    module, zeros = experiments.module(experiment), {}
    common = settings, asked
    for protocol in asked.protocols:
        task = module.task(protocol, settings)
        if task.base not in zeros:
            zeros[task.base] = workspace.run_folder(experiment, paths.MODEL_ZERO, task.base, seed)
            zeros[task.base].mkdir(parents=True)
            zero = _fitted(
                workspace, experiment, settings["model_zero"], *common, (task.base, seed), device=device, base=None
            )
            zero.model.save(zeros[task.base])
        for model in asked.scored:
            run = _fitted(workspace, experiment, model, *common, (protocol, seed), device=device, base=zeros[task.base])
            (piece,) = series.read(workspace.dataset(experiment), task, protocol, seed)
            predicted = run.model.predict(piece.record.x)[piece.part == asked.part]
            scored = tasks_series.score(piece, predicted, task, asked.part)
            yield protocol, model, metrics.unless_failed(scored, run.failed)


def _images_scores(workspace: Workspace, experiment: str, settings: dict, asked: Asked, seed: int, device: str):
    """Yield as `scores`; a condition is a dataset of images."""
    for protocol in asked.protocols:
        x, y = tasks_images.part_of(images.read(workspace.dataset(experiment), protocol, seed), asked.part)
        for model in asked.scored:
            run = _fitted(workspace, experiment, model, settings, asked, (protocol, seed), device=device)
            scored = classification.scores(y, run.model.predict(x))
            yield images.modality(protocol), model, metrics.unless_failed(scored, run.failed)
