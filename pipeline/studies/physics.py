"""Score models on scenes that lack one of their effects each. Small scenes, short trainings.

Every variant (an effect and a seed) goes the whole way: simulated logs, ingest, windows, labels, training, scores of
the test part. Effect `none`: all effects on; `default`: those that params.yaml has on. The seed moves the scene's own
seed and is that of split and training, so that two seeds differ in all that is drawn by chance; variants of one seed
share it.
Writes data/<experiment>/physics.csv; `render_physics` judges it.
Usage: python -m pipeline.studies.physics touch|strain|glove
"""

import tempfile
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path

import numpy as np
import pyarrow as pa
from tqdm import tqdm

from pipeline import experiments, models, scenes, tasks
from pipeline.base import arguments, files, params, paths, workers
from pipeline.base.errors import InputError, run_stage
from pipeline.datasets import images, schemas, series
from pipeline.datasets.windows import read_dataset
from pipeline.learning.trained import Trained
from pipeline.scoring import classification, metrics
from pipeline.scoring.variants import COLUMNS, DEFAULT, NONE, variants
from pipeline.tasks import images as tasks_images
from pipeline.tasks import series as tasks_series
from pipeline.tasks import windows as tasks_windows

MAIN_METRIC = {"touch": "rmse", "strain": "error", "glove": "accuracy"}
CONDITIONS = {"touch": ("single", "double")}  # no number of the paper is about the others, demonstrations


def settings_of(values: Mapping, experiment: str, effect: str, seed: int) -> dict:
    """Return the experiment's block of params.yaml at the scale of physics.<experiment>.scene, without `effect`.

    `none`: with all of them; `default`: with those that are on in params.yaml. Raises InputError where the result is
    not what pipeline/base/blocks.py allows.
    """
    settings = _merged(values[experiment], values["physics"][experiment]["scene"])
    block = params.settings_block().model_fields[experiment].annotation
    params.check_block(settings, block, f"{experiment} with physics.{experiment}.scene")
    scene = settings["simulate"]
    on = dict.fromkeys(scene["effects"], True)
    effects = {NONE: on, DEFAULT: scene["effects"]}.get(effect, on | {effect: False})
    drawn = {name: scene[name] + seed for name in ("seed", "specimen") if name in scene}
    return settings | {"simulate": scene | drawn | {"effects": effects}}


def _merged(block: Mapping, changes: Mapping) -> dict:
    """Return `block` with the values of `changes`, block by block."""
    merged = dict(block)
    for key, value in changes.items():
        both = isinstance(value, Mapping) and isinstance(merged.get(key), Mapping)
        merged[key] = _merged(merged[key], value) if both else value
    return merged


def run_variant(values: Mapping, experiment: str, effect: str, seed: int, report: Callable) -> list[tuple]:
    """Return rows of physics.csv (variants.COLUMNS) of one effect left out and one seed."""
    import torch

    torch.set_num_threads(1)
    chosen = values["physics"][experiment]
    settings = settings_of(values, experiment, effect, seed)
    by_kind = {"windows": windows_scores, "series": series_scores, "images": images_scores}
    score = by_kind[experiments.module(experiment).KIND]
    rows = []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        protocols = [*chosen["protocols"], *_bases(experiment, settings, chosen["protocols"])]
        write_dataset(experiment, settings, dict.fromkeys(protocols), seed, folder)
        for condition, model, scores in score(experiment, settings, chosen, seed, folder, values["device"]):
            metric = MAIN_METRIC[experiment]
            unit, value = next((unit, value) for name, unit, value, _ in scores if name == metric)
            rows.append((experiment, effect, condition, model, seed, metric, unit, value))
    report()
    return rows


def _bases(experiment: str, settings: Mapping, protocols: list[str]) -> list[str]:
    """Return the protocols that model-0 of `protocols` is trained on."""
    bases = [tasks.of(experiment).base(experiment, settings, protocol) for protocol in protocols]
    return [base for base in bases if base]


def dataset_of(folder: Path) -> Path:
    """Return the path of the variant's dataset."""
    return folder / "dataset.parquet"


def write_dataset(experiment: str, settings: dict, protocols: Iterable[str], seed: int, folder: Path) -> None:
    """Simulate, ingest and label in `folder`: what the stages simulate, ingest, window and dataset do, unsaved."""
    module = experiments.module(experiment)
    recordings, logs_of = scenes.plan(experiment, settings)
    conditions = CONDITIONS.get(experiment)
    recordings = [each for each in recordings if conditions is None or each.condition in conditions]
    scenes.write_logs(folder / "logs", recordings, logs_of)
    schema = module.frames_schema(settings)
    parts = [module.read_recording(path, settings)[0] for path in module.recordings(folder / "logs")]
    frames = pa.concat_tables([part.select(schema.names).cast(schema) for part in parts])
    inputs = tasks.of(experiment).inputs(frames.unify_dictionaries().combine_chunks(), settings)
    tasks.write_dataset(dataset_of(folder), experiment, inputs, settings, [(name, seed) for name in protocols])


def fitted(
    experiment: str, model: str, settings: dict, chosen: Mapping, folder: Path, run: tuple, **fitting
) -> Trained:
    """Return a model of physics.<experiment>.models trained on the variant's dataset; run: protocol and seed."""
    if model not in chosen["models"]:
        raise InputError(
            f"params.yaml, physics.{experiment}.models: '{model}' is missing; {experiment}.model_zero names it"
        )
    where = f"physics.{experiment}.models.{model}"

    def build(spec):
        return models.build(model, spec, chosen["models"][model], where)

    regressor = tasks.of(experiment).fit(dataset_of(folder), experiment, settings, *run, build, **fitting).model
    return Trained(regressor, failed=regressor.summary.best_epoch == 0)


def windows_scores(experiment: str, settings: dict, chosen: Mapping, seed: int, folder: Path, device: str):
    """Yield (condition, model, rows of scores) of every model.

    settings: the experiment's block at the scene's scale; chosen: its block physics.<experiment>.
    """
    module = experiments.module(experiment)
    data = read_dataset(dataset_of(folder), settings["window"]["frames"])
    condition = schemas.names(data.rows["condition"])
    (protocol,) = chosen["protocols"]
    part = data.part(protocol, seed)
    for model in chosen["models"]:
        run = fitted(experiment, model, settings, chosen, folder, (protocol, seed), device=device)
        for name in CONDITIONS[experiment]:
            rows = np.flatnonzero((part == "test") & (condition == name))
            predicted = tasks_windows.predict(run.model, data.x[rows], data, rows)
            windows = data.rows.take(pa.array(rows))
            scores = tasks_windows.score(module, windows, data.y[rows], predicted, settings)
            yield name, model, metrics.unless_failed(scores, run.failed)


def series_scores(experiment: str, settings: dict, chosen: Mapping, seed: int, folder: Path, device: str):
    """Yield as `windows_scores`; a condition is a task. Model-0 of transfer is trained on all of task 0 first."""
    module, zeros = experiments.module(experiment), {}
    common = settings, chosen, folder
    for protocol in chosen["protocols"]:
        task = module.task(protocol, settings)
        if task.base not in zeros:
            zeros[task.base] = folder / task.base
            zeros[task.base].mkdir()
            zero = fitted(experiment, settings["model_zero"], *common, (task.base, seed), device=device, base=None)
            zero.model.save(zeros[task.base])
        for model in chosen["models"]:
            run = fitted(experiment, model, *common, (protocol, seed), device=device, base=zeros[task.base])
            (piece,) = series.read(dataset_of(folder), task, protocol, seed)
            predicted = run.model.predict(piece.record.x)[piece.part == "test"]
            yield protocol, model, metrics.unless_failed(tasks_series.score(piece, predicted, task), run.failed)


def images_scores(experiment: str, settings: dict, chosen: Mapping, seed: int, folder: Path, device: str):
    """Yield as `windows_scores`; a condition is a dataset of images."""
    for protocol in chosen["protocols"]:
        test = tasks_images.part_of(images.read(dataset_of(folder), protocol, seed), "test")
        for model in chosen["models"]:
            run = fitted(experiment, model, settings, chosen, folder, (protocol, seed), device=device)
            scores = classification.scores(test[1], run.model.predict(test[0]))
            yield images.modality(protocol), model, metrics.unless_failed(scores, run.failed)


def main() -> None:
    """Run every variant of the experiment named on the command line."""
    values = params.load()
    experiment = arguments.parse(__doc__, experiment=values["physics"]).experiment
    wanted = variants(values, experiment)
    with tqdm(total=len(wanted), desc=f"physics {experiment}", unit="variant") as bar:
        rows = dict(workers.run(run_variant, {key: (values, experiment, *key) for key in wanted}, bar))
    files.write_csv(paths.physics(experiment), COLUMNS, (row for key in wanted for row in rows[key]))


if __name__ == "__main__":
    run_stage(main)
