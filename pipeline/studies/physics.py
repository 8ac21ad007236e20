"""Stage: what do the models say of a scene that lacks one of its effects? Small scenes, short trainings.

Every variant (an effect and a seed) goes the whole way: simulated logs, ingest, windows, labels, training, scores of
the test part. Effect `none`: all effects on; `default`: those that params.yaml has on. The seed moves the scene's own
seed and is that of split and training, so that two seeds differ in all that is drawn by chance; variants of one seed
share it.
Writes data/<experiment>/physics.csv; `render_physics` judges it.
Usage: python -m pipeline.studies.physics touch|strain|glove
"""

import importlib
import sys
import tempfile
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path

import numpy as np
import pyarrow as pa
from tqdm import tqdm

from pipeline.base import blocks, files, params, paths, workers
from pipeline.base.errors import InputError, run_stage
from pipeline.datasets import images, schemas, series
from pipeline.datasets.windowing import windows_of
from pipeline.datasets.windows import read_dataset
from pipeline.learning import trained
from pipeline.scoring import classification, metrics
from pipeline.scoring.variants import COLUMNS, DEFAULT, NONE, variants

MAIN_METRIC = {"touch": "rmse", "strain": "error", "glove": "accuracy"}
CONDITIONS = {"touch": ("single", "double")}  # no number of the paper is about the others, demonstrations


def settings_of(values: Mapping, experiment: str, effect: str, seed: int) -> dict:
    """The experiment's block of params.yaml at the scale of physics.<experiment>.scene, without `effect`.

    `none`: with all of them; `default`: with those that are on in params.yaml. Raises InputError where the result is
    not what pipeline/base/blocks.py allows.
    """
    settings = _merged(values[experiment], values["physics"][experiment]["scene"])
    params.check_block(
        settings, blocks.Settings.model_fields[experiment].annotation, f"{experiment} with physics.{experiment}.scene"
    )
    scene = settings["simulate"]
    on = dict.fromkeys(scene["effects"], True)
    effects = {NONE: on, DEFAULT: scene["effects"]}.get(effect, on | {effect: False})
    return settings | {"simulate": scene | {"seed": scene["seed"] + seed, "effects": effects}}


def _merged(block: Mapping, changes: Mapping) -> dict:
    """`block` with the values of `changes`, block by block."""
    merged = dict(block)
    for key, value in changes.items():
        both = isinstance(value, Mapping) and isinstance(merged.get(key), Mapping)
        merged[key] = _merged(merged[key], value) if both else value
    return merged


def run_variant(values: Mapping, experiment: str, effect: str, seed: int, report: Callable) -> list[tuple]:
    """Rows of physics.csv (variants.COLUMNS) of one effect left out and one seed."""
    import torch

    torch.set_num_threads(1)
    chosen = values["physics"][experiment]
    settings = settings_of(values, experiment, effect, seed)
    score = {"touch": touch_scores, "strain": strain_scores, "glove": glove_scores}[experiment]
    rows = []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        protocols = [*chosen["protocols"], *_bases(experiment, settings, chosen["protocols"])]
        write_dataset(experiment, settings, dict.fromkeys(protocols), seed, folder)
        for condition, model, found in score(settings, chosen, seed, folder, values["device"]):
            metric = MAIN_METRIC[experiment]
            unit, value = next((unit, value) for name, unit, value, _ in found if name == metric)
            rows.append((experiment, effect, condition, model, seed, metric, unit, value))
    report()
    return rows


def _bases(experiment: str, settings: Mapping, protocols: list[str]) -> list[str]:
    """Protocols that model-0 of `protocols` is trained on."""
    if experiment not in params.SERIES:
        return []
    return [params.experiment_module(experiment).task(protocol, settings).base for protocol in protocols]


def dataset_of(folder: Path) -> Path:
    """The variant's dataset."""
    return folder / "dataset.parquet"


def write_dataset(experiment: str, settings: dict, protocols: Iterable[str], seed: int, folder: Path) -> None:
    """Simulate, ingest and label in `folder`: what the stages simulate, ingest, window and dataset do, unsaved."""
    module = params.experiment_module(experiment)
    recordings, logs_of = importlib.import_module(f"pipeline.scenes.{experiment}").plan(settings)
    for recording in recordings:
        if recording.condition not in CONDITIONS.get(experiment, (recording.condition,)):
            continue
        place = folder / "logs" / recording.condition / recording.name
        place.mkdir(parents=True)
        for name, (lines, _) in logs_of(recording).items():
            (place / name).write_text("\n".join(lines) + "\n", encoding="ascii")
    schema_of = module.frames_schema(settings)
    parts = [module.read_recording(path, settings)[0] for path in module.recordings(folder / "logs")]
    frames = pa.concat_tables([part.select(schema_of.names).cast(schema_of) for part in parts])
    frames = frames.unify_dictionaries().combine_chunks()
    if experiment in params.SERIES:
        rows = frames
        table = frames.rename_columns({"y_mm": "y"})
    elif experiment in params.IMAGES:
        rows = frames.take(pa.array(module.chosen(frames, settings))).combine_chunks()
        table = images.dataset_rows(rows, module.images(rows, settings))
    else:
        rows = windows_of(frames, settings["window"])
        table = rows.append_column("y", schemas.lists(module.labels(rows, settings), pa.float32()))
    for protocol in protocols:
        part = pa.array(module.split(rows, settings, protocol, seed), pa.string()).dictionary_encode()
        table = table.append_column(schemas.split_column(protocol, seed), part)
    schemas.write(dataset_of(folder), table.schema, [table])


def touch_scores(settings: dict, chosen: Mapping, seed: int, folder: Path, device: str):
    """(condition, model, rows of metrics.touch) of every model; settings: the scene's, chosen: physics.touch."""
    from pipeline.learning.regressors import Spec

    spec = Spec(*params.shapes(settings))
    data = read_dataset(dataset_of(folder), spec.frames)
    condition = schemas.names(data.rows["condition"])
    (protocol,) = chosen["protocols"]
    part = data.part(protocol, seed)
    for model, block in chosen["models"].items():
        regressor = params.build_model(model, spec, block, f"physics.touch.models.{model}")
        train, validation = (data.windows(part == name, regressor.streams) for name in ("train", "validation"))
        regressor.fit(train, validation, seed=seed, device=device)
        for name in CONDITIONS["touch"]:
            rows = np.flatnonzero((part == "test") & (condition == name))
            predicted = trained.predict_windows(regressor, data.x[rows], data, rows)
            found = metrics.touch(data.rows.take(pa.array(rows)), data.y[rows], predicted, settings)
            yield name, model, metrics.unless_failed(found, regressor.summary.best_epoch == 0)


def strain_scores(settings: dict, chosen: Mapping, seed: int, folder: Path, device: str):
    """As `touch_scores`; a condition is a task. Model-0 of transfer is trained on all of task 0 first."""
    from pipeline.learning import series_regressors

    module, zeros = params.experiment_module("strain"), {}

    def fitted(protocol: str, model: str, base: Path | None):
        if model not in chosen["models"]:
            raise InputError(f"params.yaml, physics.strain.models: '{model}' is missing; strain.model_zero names it")
        block, task = chosen["models"][model], module.task(protocol, settings)
        spec = series_regressors.spec_of(task, settings["window"]["frames"])
        regressor = params.build_model(model, spec, block, f"physics.strain.models.{model}")
        regressor = series_regressors.adapted(regressor, spec)
        (piece,) = series.read(dataset_of(folder), task, protocol, seed)
        regressor.fit(series.seen_in_training([piece]), seed=seed, device=device, base=base)
        return regressor, piece, task

    for protocol in chosen["protocols"]:
        base = module.task(protocol, settings).base
        if base not in zeros:
            zeros[base] = folder / base
            zeros[base].mkdir()
            fitted(base, settings["model_zero"], None)[0].save(zeros[base])
        for model in chosen["models"]:
            regressor, piece, task = fitted(protocol, model, zeros[base])
            test = piece.part == "test"
            own = series.Record(*(column[test] for column in piece.record))
            found = metrics.series(own, regressor.predict(piece.record.x)[test], task.outputs)
            yield protocol, model, metrics.unless_failed(found, regressor.summary.best_epoch == 0)


def glove_scores(settings: dict, chosen: Mapping, seed: int, folder: Path, device: str):
    """As `touch_scores`; a condition is a dataset of images."""
    from pipeline.learning.image_classifier import spec_of

    for protocol in chosen["protocols"]:
        data = images.read(dataset_of(folder), protocol, seed)
        train, validation, test = ((data.x[data.part == name], data.y[data.part == name]) for name in images.PARTS)
        for model, block in chosen["models"].items():
            regressor = params.build_model(model, spec_of(len(data.objects)), block, f"physics.glove.models.{model}")
            regressor.fit(train, validation, seed=seed, device=device)
            found = classification.scores(test[1], regressor.predict(test[0]))
            yield images.modality(protocol), model, metrics.unless_failed(found, regressor.summary.best_epoch == 0)


def main() -> None:
    """Run every variant of the experiment named on the command line."""
    values = params.load()
    experiment = sys.argv[1] if len(sys.argv) == 2 else ""
    if experiment not in values["physics"]:
        raise InputError(f"usage: python -m pipeline.studies.physics {'|'.join(values['physics'])}")
    wanted = variants(values, experiment)
    with tqdm(total=len(wanted), desc=f"physics {experiment}", unit="variant") as bar:
        found = dict(workers.run(run_variant, {key: (values, experiment, *key) for key in wanted}, bar))
    files.write_csv(paths.physics(experiment), COLUMNS, (row for key in wanted for row in found[key]))


if __name__ == "__main__":
    run_stage(main)
