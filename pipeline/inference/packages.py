"""Find a trained model by what the user calls it, and make it a package: a folder of weights, card and nothing else."""

import re
import shutil
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pandas as pd

from pipeline import experiments, tasks
from pipeline.base import params, paths
from pipeline.base.errors import InputError
from pipeline.datasets import fits, images, schemas
from pipeline.inference import card as cards
from pipeline.scoring import metrics, results

PRETRAINED = paths.ROOT / "pretrained"  # packages that come with the repository, <experiment>/<model>
RUN_ID = re.compile("[0-9a-f]{32}")  # of MLflow
MAP_ORDER = "row by row from the bottom row, each from the left"
ORDERS = {
    "windows": MAP_ORDER,
    "series": "channels as in the log",
    "images": "cells of all areas, as in the log",
}
UNITS = {"windows": "counts", "series": "V", "images": "levels"}
OUTPUT_UNITS = {"velostat_recorded": "N", "windows": "kPa", "series": "mm", "images": "probability"}


def make(values: Mapping, experiment: str, model: str, protocol: str, seed: int, target: Path) -> cards.Card:
    """Write the package of one run of params.yaml (`values`) to the new folder `target`, and return its card.

    Raises InputError where the run has not been trained and evaluated, or was trained with other settings.
    """
    folder = paths.require(paths.run_folder(experiment, model, protocol, seed), params.training_command(experiment))
    weights = cards.weights_file(folder)
    target.mkdir(parents=True)
    shutil.copy(weights, target / weights.name)
    card = of_run(values, experiment, model, protocol, seed)
    cards.write(target, card)
    return card


def of_run(values: Mapping, experiment: str, model: str, protocol: str, seed: int) -> cards.Card:
    """Return the card of one run of params.yaml; errors as `make`."""
    from pipeline import tracking  # here, because the import of MLflow takes a second

    card = Describer(values, experiment).card(model, protocol, seed, tracking.git_state()[0])
    tracking.check_settings([experiment], values)
    return card


class Describer:
    """Makes the cards of the runs of an experiment; what they share is read once."""

    def __init__(self, values: Mapping, experiment: str):
        """Take params.yaml. Raises InputError where a file that the experiment's stages write is missing."""
        self.values, self.experiment, self.kind = values, experiment, tasks.kind(experiment)
        self._inputs = _inputs(experiment, self.kind, values[experiment])
        self._scores = _scores(experiment)
        of_images = self.kind == "images"
        self._classes = images.classes(_table(paths.dataset(experiment), ["condition"])) if of_images else None

    def card(self, model: str, protocol: str, seed: int, commit: str) -> cards.Card:
        """Return the card of one run. Raises InputError where it has not been trained, or with other settings."""
        experiment, settings = self.experiment, self.values[self.experiment]
        folder, made_by = paths.run_folder(experiment, model, protocol, seed), params.training_command(experiment)
        fit, block = fits.read(folder, made_by), params.run_settings(self.values, experiment, model, protocol)
        if fit["settings"] != block:
            raise InputError(
                f"{paths.shown(folder)}: was trained with other settings than {experiment}.models.{model} of "
                f"params.yaml; run `{made_by}`"
            )
        names, chosen, touch_kpa = self._classes, None, None
        if self.kind == "windows":
            spec = tasks.of(experiment).spec(settings)
            touch_kpa = metrics.touch_threshold_kpa(settings) if "tip_radius_mm" in settings["label"] else None
        elif self.kind == "series":
            spec = tasks.of(experiment).spec(experiment, settings, protocol)
            task = experiments.module(experiment).task(protocol, settings)
            names, chosen = [f"{'xyz'[k]}_mm" for k in task.outputs], list(next(iter(task.channels.values())))
        else:
            from pipeline.learning.image_classifier import spec_of

            spec = spec_of(len(names), images.shape(settings))
        unit = OUTPUT_UNITS.get(experiment, OUTPUT_UNITS[self.kind])
        return cards.Card(
            experiment=experiment,
            kind=self.kind,
            model=model,
            protocol=protocol,
            seed=seed,
            commit=commit,
            settings=dict(block),
            reading={name: settings[name] for name in cards.READING if name in settings},
            shapes=cards.Shapes(**spec._asdict()),
            inputs=self._inputs.model_copy(update={"chosen": chosen}),
            outputs=cards.Outputs(unit=unit, names=names, touch_kpa=touch_kpa),
            precision=fit["precision"],
            best_epoch=fit["best_epoch"],
            scores=self._scores.get((protocol, model, seed), []),
            sha256=cards.digest(cards.weights_file(folder)),
        )


def _inputs(experiment: str, kind: str, settings: Mapping) -> cards.Inputs:
    """Return what one reading of an experiment's sensor is."""
    frames = _table(paths.frames(experiment), ["t_s"])
    schema = experiments.module(experiment).frames_schema(settings)
    columns = images.reading_columns(schema) if kind == "images" else ["v"]
    return cards.Inputs(
        columns=sum(schema.field(name).type.list_size for name in columns),
        unit=settings.get("sensor", {}).get("unit", UNITS[kind]),
        order=ORDERS[kind],
        interval_s=round(float(np.median(np.diff(frames["t_s"].to_numpy()))), 6),
        frame_step=settings["window"].get("frame_step", 1),
    )


def _table(path: Path, columns: list[str]):
    """Return columns of a file that a stage of the experiment wrote."""
    return schemas.read(paths.require(path, "dvc repro evaluate"), columns)


def _scores(experiment: str) -> dict[tuple[str, str, int], list[cards.Score]]:
    """Return (protocol, model, seed) -> the run's rows of scores.csv."""
    columns = ["protocol", "condition", "model", "seed", "metric", "unit", "value", "n"]
    table = results.read_csv(paths.scores(experiment), columns, "dvc repro evaluate")
    scores = {}
    for row in table.itertuples(index=False):
        score = cards.Score(
            condition=row.condition,
            metric=row.metric,
            unit=str(row.unit),
            value=None if pd.isna(row.value) else float(row.value),
            n=int(row.n),
        )
        scores.setdefault((row.protocol, row.model, int(row.seed)), []).append(score)
    return scores


def locate(name: str, values: Mapping, draft: Path) -> tuple[Path, str]:
    """Return (folder of the package, where it comes from) for what the user calls a model.

    name: a folder with a card, or EXPERIMENT/MODEL, or EXPERIMENT/MODEL/PROTOCOL/SEED, or the id of an MLflow run. The
    model that this checkout trained is taken, of its first protocol and seed where none is named; where it trained
    none, the one of `pretrained/`. values: params.yaml; draft: a folder, not there yet, for the package of a run.
    Raises InputError where there is no such model.
    """
    if Path(name, cards.NAME).is_file():
        return Path(name), "folder"
    if RUN_ID.fullmatch(name):
        from pipeline.inference import mlflow_runs  # here, because the import of MLflow takes a second

        return mlflow_runs.downloaded(name, draft), "from MLflow"
    words = name.strip("/").split("/")
    if len(words) not in (2, 4) or words[0] not in values["experiments"]:
        raise InputError(
            f"{name}: no such model; name a folder with {cards.NAME}, or EXPERIMENT/MODEL such as touch/lomp "
            f"(experiments: {', '.join(values['experiments'])})"
        )
    experiment, model = words[:2]
    protocol, seed = params.runs(values, experiment)[0] if len(words) == 2 else (words[2], _number(words[3], name))
    if paths.run_folder(experiment, model, protocol, seed).is_dir():
        make(values, experiment, model, protocol, seed, draft)
        return draft, f"trained here, {protocol}, seed {seed}"
    shipped = PRETRAINED / experiment / model
    if len(words) == 2 and shipped.is_dir():
        return shipped, "pretrained"
    have = sorted(path.parent.relative_to(PRETRAINED).as_posix() for path in PRETRAINED.glob(f"*/*/{cards.NAME}"))
    raise InputError(
        f"{name}: not trained in this checkout; run `dvc repro`, or take one of the pretrained "
        f"({', '.join(have) or 'none'})"
    )


def _number(word: str, name: str) -> int:
    if not word.isdecimal():
        raise InputError(f"{name}: '{word}' is no seed; write EXPERIMENT/MODEL/PROTOCOL/SEED")
    return int(word)
