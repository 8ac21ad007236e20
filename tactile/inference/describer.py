"""Make the cards of trained models, from params.yaml and what the stages of an experiment wrote."""

from collections.abc import Mapping
from functools import cached_property
from pathlib import Path

import numpy as np
import pandas as pd

from tactile import experiments, tasks
from tactile.base import files, paths, provenance, ranges
from tactile.base.paths import Workspace
from tactile.datasets import fits, images, schemas
from tactile.inference import card as cards
from tactile.inference import consistent, training
from tactile.scoring import estimates, metrics

MAP_ORDER = "row by row from the bottom row, each from the left"
ORDERS = {
    "windows": MAP_ORDER,
    "series": "channels as in the log",
    "images": "cells of all areas, as in the log",
}


class Describer:
    """Makes the cards of the runs of an experiment; what they share is read once."""

    def __init__(self, workspace: Workspace, values: Mapping, experiment: str):
        """Take params.yaml. Raises InputError where a file that the experiment's stages write is missing."""
        self.workspace = workspace
        self.values, self.experiment, self.kind = values, experiment, tasks.kind(experiment)
        of_images, settings = self.kind == "images", values[experiment]
        schema = experiments.module(experiment).frames_schema(settings)
        self._columns = images.reading_columns(schema) if of_images else ["v"]
        times = _table(workspace.frames(experiment), ["t_s"])["t_s"].to_numpy()
        self._inputs = cards.Inputs(
            columns=sum(schema.field(name).type.list_size for name in self._columns),
            unit=settings.get("sensor", {}).get("unit", experiments.facts(experiment).unit),
            order=ORDERS[self.kind],
            interval_s=round(float(np.median(np.diff(times))), 6),
            frame_step=settings["window"].get("frame_step", 1),
        )
        self._trained_on: dict[tuple[str, int], list[ranges.Columns] | None] = {}  # by protocol and seed
        self._classes = images.classes(_table(workspace.dataset(experiment), ["condition"])) if of_images else None

    @cached_property
    def _scores(self) -> dict[tuple[str, str, int], list[cards.Score]]:
        return _scores(self.workspace, self.experiment)

    def readings(self) -> np.ndarray:
        """Return the readings of all frames of the experiment, (n, columns) float32."""
        frames = _table(self.workspace.frames(self.experiment), self._columns)
        return np.concatenate([schemas.matrix(frames[name]) for name in self._columns], axis=1).astype(np.float32)

    def card(self, model: str, protocol: str, seed: int, commit: str) -> cards.Card:
        """Return the card of one run. Raises InputError where it has not been trained, or with other settings."""
        scores = self._scores.get((protocol, model, seed), [])
        card = self.without_scores(model, protocol, seed, commit)
        gain = next((score.value for score in scores if score.metric == "force_gain"), None)
        outputs = card.outputs.model_copy(update={"force_gain": gain})
        run = (protocol, seed)
        if run not in self._trained_on:
            self._trained_on[run] = training.trained_on(self.workspace, self.values[self.experiment], card)
        return card.model_copy(update={"scores": scores, "outputs": outputs, "trained_on": self._trained_on[run]})

    def without_scores(self, model: str, protocol: str, seed: int, commit: str) -> cards.Card:
        """Return the card of a run that need not have been evaluated; errors as `card`."""
        experiment, settings = self.experiment, self.values[self.experiment]
        folder = self.workspace.run_folder(experiment, model, protocol, seed)
        weights = cards.weights_file(folder)
        fit = fits.read_as_set(folder, self.values, experiment, model, protocol)
        names, chosen, touch_kpa = self._classes, None, None
        if self.kind == "windows":
            spec = tasks.of(experiment).spec(settings)
            touch_kpa = metrics.touch_threshold_kpa(settings) if "tip_radius_mm" in settings["label"] else None
        elif self.kind == "series":
            spec = tasks.of(experiment).spec(experiment, settings, protocol)
            task = experiments.module(experiment).task(protocol, settings)
            names, chosen = [f"{'xyz'[k]}_mm" for k in task.outputs], list(next(iter(task.channels.values())))
        else:
            from tactile.learning.spec import of_images

            spec = of_images(len(names), images.shape(settings))
        unit = experiments.facts(experiment).output_unit
        return cards.Card(
            experiment=experiment,
            kind=self.kind,
            model=model,
            protocol=protocol,
            seed=seed,
            commit=commit,
            version=provenance.version(),
            settings=fit["settings"],
            reading={name: settings[name] for name in consistent.READING if name in settings},
            shapes=cards.Shapes(**spec._asdict()),
            inputs=self._inputs.model_copy(update={"chosen": chosen}),
            outputs=cards.Outputs(unit=unit, names=names, touch_kpa=touch_kpa),
            precision=fit["precision"],
            best_epoch=fit["best_epoch"],
            scores=[],
            files={weights.name: files.sha256(weights)},
            source=settings.get("source", experiment),
        )


def _table(path: Path, columns: list[str]):
    """Return columns of a file that a stage of the experiment wrote."""
    return schemas.read(paths.require(path, "dvc repro evaluate"), columns)


def _scores(workspace: Workspace, experiment: str) -> dict[tuple[str, str, int], list[cards.Score]]:
    """Return (protocol, model, seed) -> the run's rows of scores.csv."""
    columns = ["protocol", "condition", "model", "seed", "metric", "unit", "value", "n"]
    table = estimates.read_csv(workspace.scores(experiment), columns, "dvc repro evaluate")
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
