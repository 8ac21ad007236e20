"""Log every trained model of an experiment as a run of MLflow, from the files that the stages wrote.

A run is known by its content, a digest of settings, scores and weights. So a second call logs nothing, and a changed
result is a new run. No run is ever deleted or changed, but for its tag `current`: "true" where the last call found its
content among the results, "false" where it did not. Times (`train_s`, `latency.*`) are no part of the content.
"""

import hashlib
import importlib.metadata
import json
import os
import re
import tempfile
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from pipeline.base import params, paths, provenance
from pipeline.base.errors import InputError
from pipeline.base.paths import Workspace
from pipeline.datasets import fits
from pipeline.inference import card as cards
from pipeline.inference import mlflow_store
from pipeline.reporting.words import labels
from pipeline.scoring import published, results

CODE = paths.CODE / "inference" / "mlflow_model.py"
# What a loaded model imports, and pandas, which MLflow hands it tables with. MLflow finds this out in seconds a model.
REQUIRED = (
    *("numba", "numpy", "pandas", "pyarrow", "pydantic", "ruamel.yaml", "safetensors", "scikit-learn", "scipy"),
    *("skops", "threadpoolctl", "torch"),
)
PREDICTED = 4  # readings of the input example that have a prediction
CURVES = ("train_loss", "validation_loss", "learning_rate")
COUNTS = ("best_epoch", "epochs", "parameters", "macs")
PER_CALL = 1000  # metrics that MLflow takes at once
NOTE = "mlflow.note.content"  # the tag that MLflow shows as the description of a run or an experiment
ABOUT = (
    "one run per trained model, protocol and seed. Metrics are `<condition>.<metric>` on the test part, in the unit of "
    "the tag `unit.<metric>`; the tag `published.<condition>.<metric>` is what the paper prints, in the same unit, on "
    "its own split. `train_s` is in s, `latency.*` in ms. The tag `current` is true for the results logged last."
)
NOT_TAKEN = re.compile(r"[^\w.\- ]")  # letters that MLflow does not take in a metric's name


@dataclass(frozen=True)
class TrainedRun:
    """One trained model as its files say, without its learning curve."""

    protocol: str
    model: str
    seed: int
    folder: Path
    settings: dict[str, str]  # the model's block of settings as params of MLflow: `training.epochs` -> "40"
    metrics: dict[str, float]  # `<condition>.<metric>`, counts, and what was measured
    tags: dict[str, str]  # units, published values, how the training ended
    content: str


def read_runs(workspace: Workspace, experiment: str, values: Mapping) -> list[TrainedRun]:
    """Read every run that params.yaml (`values`) lists for an experiment: model, then protocol, then seed.

    Raises InputError that names the first file, column or row that is missing, or the first model made with other
    settings: a run is complete, or it is not logged.
    """
    settings, made_by = values[experiment], params.training_command(experiment)
    columns = ["protocol", "condition", "model", "seed", "metric", "unit", "value"]
    scores = results.read_csv(workspace.scores(experiment), columns, "dvc repro evaluate")
    rows = dict(list(scores.groupby(["protocol", "model", "seed"])))
    latency, runs = results.read_latency(workspace, experiment, settings), []
    for model in settings["models"]:
        speed = {f"latency.batch_{n}.p50_ms": latency[model, n]["p50_ms"] for n in settings["latency"]["batches"]}
        times = results.read_csv(workspace.training_times(experiment, model), ["protocol", "seed", "train_s"], made_by)
        seconds = {(row.protocol, row.seed): row.train_s for row in times.itertuples()}
        for protocol, seed in params.runs(values, experiment):
            if (protocol, seed) not in seconds:
                file = workspace.training_times(experiment, model)
                raise InputError(f"{file}: no row for protocol {protocol}, seed {seed}; run `{made_by}` again")
            scored, measured = (
                rows.get((protocol, model, seed), scores[:0]),
                speed | {"train_s": seconds[protocol, seed]},
            )
            runs.append(_read_run(workspace, experiment, values, model, protocol, seed, scored, measured))
    return runs


def _read_run(
    workspace: Workspace,
    experiment: str,
    values: Mapping,
    model: str,
    protocol: str,
    seed: int,
    scores: pd.DataFrame,
    measured: dict,
) -> TrainedRun:
    """Read the folder of one run; scores: its rows of scores.csv, measured: its times."""
    made_by, folder = params.training_command(experiment), workspace.run_folder(experiment, model, protocol, seed)
    fit = fits.read(folder, made_by)
    if fit["settings"] != params.run_settings(values, experiment, model, protocol):
        raise InputError(
            f"{folder / 'fit.json'}: was made with other settings than {experiment}.models.{model} of "
            f"{params.file_of(experiment)}; run `dvc repro`"
        )
    by_name, tags = {}, {"stop_reason": str(fit["stop_reason"]), "precision": str(fit["precision"])}
    for row in scores.itertuples():
        name = f"{NOT_TAKEN.sub('_', row.condition)}.{row.metric}"
        by_name[name], tags[f"unit.{row.metric}"] = float(row.value), str(row.unit)
        if np.isfinite(printed := published.score(experiment, model, row.condition, row.metric)):
            tags[f"published.{name}"] = str(printed)
    if not by_name or len(by_name) < len(scores):
        problem = "two rows for the same condition and metric of" if by_name else "no row for"
        raise InputError(
            f"{workspace.scores(experiment)}: {problem} protocol {protocol}, model {model}, seed {seed}; "
            "run `dvc repro evaluate` again"
        )
    paths.require(folder / "history.csv", made_by)
    settings = _flat(fit["settings"])
    identity = [experiment, protocol, model, seed, settings, by_name, cards.digest(cards.weights_file(folder))]
    return TrainedRun(
        *(protocol, model, seed, folder, settings),
        metrics=by_name | {name: float(fit[name]) for name in COUNTS if fit[name] is not None} | measured,
        tags=tags,
        content=hashlib.sha256(json.dumps(identity, sort_keys=True).encode()).hexdigest(),
    )


def log(workspace: Workspace, client, experiment: str, values: Mapping, runs: list[TrainedRun]) -> tuple[int, str]:
    """Log those of `runs`, as `read_runs` returns them, that the store lacks, and mark all of them as the current ones.

    client: MlflowClient. Return the number of new runs, and the link that compares those of the first protocol.
    """
    in_mlflow = mlflow_store.experiment_id(workspace, client, experiment)
    page = client.search_runs([in_mlflow], "tags.content LIKE '%'")
    held = list(page)
    while page.token:
        page = client.search_runs([in_mlflow], "tags.content LIKE '%'", page_token=page.token)
        held += page
    for run in held:
        if run.info.status == "RUNNING":  # what a call that was killed left half-way
            client.set_terminated(run.info.run_id, "KILLED")
    known = {run.data.tags["content"]: run.info.run_id for run in held if run.info.status == "FINISHED"}
    new = [run for run in runs if run.content not in known]
    if new:
        writer = _Writer(workspace, client, in_mlflow, experiment, values)
        known |= {run.content: writer.write(run) for run in new}
    current = {known[run.content] for run in runs}
    for run in held:  # after the new ones are complete
        if run.data.tags.get("current") != (mark := str(run.info.run_id in current).lower()):
            client.set_tag(run.info.run_id, "current", mark)
    first = next(iter(runs[0].metrics))  # of scores.csv
    ascending = results.scale_of(first.rpartition(".")[2]) == results.PLAIN
    return len(new), mlflow_store.link(in_mlflow, runs[0].protocol, first, ascending)


class _Writer:
    """Writes runs of one experiment into the store; what they share is read once."""

    def __init__(self, workspace: Workspace, client, in_mlflow: str, experiment: str, values: Mapping):
        from pipeline.inference.describer import Describer  # here, because the import of torch takes 2 s

        self.workspace = workspace
        self.client, self.in_mlflow, self.experiment = client, in_mlflow, experiment
        self.name, self.git = labels.experiment_name(experiment), provenance.git_state(workspace)
        self.describer, self.readings = (
            Describer(workspace, values, experiment),
            _readings(workspace, experiment, values[experiment]),
        )
        self.required = [f"{name}=={importlib.metadata.version(name).partition('+')[0]}" for name in REQUIRED]
        protocol, seed = params.runs(values, experiment)[0]
        card = self.describer.without_scores(next(iter(values[experiment]["models"])), protocol, seed, self.git[0])
        client.set_experiment_tag(in_mlflow, NOTE, f"{self.name}: {ABOUT}\n\n{_told(card)['readings']}")

    def write(self, run: TrainedRun) -> str:
        """Log one run and return its id; its status is FINISHED only when everything has been logged."""
        from mlflow.entities import Metric, Param  # here, because mlflow_store says first how MLflow starts

        client, label = self.client, labels.model_name(run.model)
        card = self.describer.card(run.model, run.protocol, run.seed, self.git[0])
        told, identity = _told(card), {"protocol": run.protocol, "seed": str(run.seed)}
        tags = run.tags | identity | {"experiment": self.experiment, "model": run.model, "content": run.content}
        tags |= {"git_commit": self.git[0], "git_changed": self.git[1], "current": "true"}
        if "DVC_EXP_NAME" in os.environ:
            tags["dvc_experiment"] = os.environ["DVC_EXP_NAME"]
        about = f"{label} on {self.name}, protocol {run.protocol}, seed {run.seed}."
        tags[NOTE] = "\n\n".join([about, *told.values()])
        history = results.read_csv(
            run.folder / "history.csv", ["epoch", *CURVES], params.training_command(self.experiment)
        )
        now = int(time.time() * 1000)  # files hold no date: a run ends now, and lasts as long as its training did
        points = [
            Metric(name, value, now, int(epoch))
            for name in CURVES
            for epoch, value in history[["epoch", name]].to_numpy()
            if np.isfinite(value)  # a diverged fit ends in a NaN, which no chart can draw; `stop_reason` says it
        ]
        created = client.create_run(
            self.in_mlflow,
            start_time=now - round(1000 * run.metrics["train_s"]),
            tags=tags,
            run_name=f"{label}, {run.protocol}, seed {run.seed}",
        )
        run_id, settings = created.info.run_id, run.settings | identity | {"model": label}
        points += [Metric(name, value, now, 0) for name, value in run.metrics.items()]
        client.log_batch(run_id, params=[Param(name, value) for name, value in settings.items()])
        for first in range(0, len(points), PER_CALL):
            client.log_batch(run_id, metrics=points[first : first + PER_CALL])
        own = ("params", self.experiment)
        settings = [file for file in params.settings_files(self.workspace.params) if file.stem in own]
        for file in (*settings, run.folder / "fit.json", run.folder / "history.csv"):
            client.log_artifact(run_id, str(file))
        with tempfile.TemporaryDirectory() as draft:
            self._save(Path(draft), run, card)
            client.log_artifacts(run_id, str(Path(draft, mlflow_store.MODEL)), mlflow_store.MODEL)
        client.set_terminated(run_id, end_time=now)
        return run_id

    def _save(self, draft: Path, run: TrainedRun, card: cards.Card) -> None:
        """Write a model of MLflow into a folder of the folder `draft`; nothing in it is pickled."""
        import mlflow.pyfunc
        from mlflow.models import ModelSignature
        from mlflow.types import Schema, TensorSpec

        number = np.dtype("float32")
        taken, predicted = TensorSpec(number, (-1, card.inputs.columns)), TensorSpec(number, (-1, *_shape(card)))
        cards.write(draft, card)
        mlflow.pyfunc.save_model(
            draft / mlflow_store.MODEL,
            python_model=str(CODE),
            artifacts={"card": str(draft / cards.NAME), "weights": str(cards.weights_file(run.folder))},
            signature=ModelSignature(Schema([taken]), Schema([predicted])),
            input_example=self.readings[: _before(card) + PREDICTED],
            pip_requirements=self.required,
            metadata=_told(card),
        )


def _shape(card: cards.Card) -> tuple[int, ...]:
    """Return the shape of one prediction: (rows, columns) of a map, or (outputs,)."""
    shapes = card.shapes
    return (shapes.map_rows, shapes.map_cols) if card.kind == "windows" else (shapes.map_rows * shapes.map_cols,)


def _before(card: cards.Card) -> int:
    """Return the number of readings that have no prediction, before a window is whole."""
    return (card.shapes.frames - 1) * card.inputs.frame_step if card.kind == "windows" else 0


def _told(card: cards.Card) -> dict[str, str]:
    """Say in words what a model takes and gives, with shapes and units."""
    inputs, outputs = card.inputs, card.outputs
    said = f"float32 ({', '.join(map(str, ('n', *_shape(card))))}) in {outputs.unit}, one per reading"
    if outputs.names:
        said += f": {', '.join(outputs.names)}"
    if before := _before(card):
        said += f"; where a model takes whole windows, NaN for the first {before}"
    taken = f"float32 (n, {inputs.columns}) in {inputs.unit}, {inputs.order}; one every {inputs.interval_s:g} s"
    return {"readings": f"Readings: {taken}.", "predictions": f"Predictions: {said}."}


def _readings(workspace: Workspace, experiment: str, settings: Mapping) -> np.ndarray:
    """Return the readings of an experiment's frames, (n, columns) float32."""
    from pipeline import experiments
    from pipeline.datasets import images, schemas

    schema = experiments.module(experiment).frames_schema(settings)
    names = ["v"] if "v" in schema.names else images.reading_columns(schema)
    frames = schemas.read(paths.require(workspace.frames(experiment), "dvc repro evaluate"), names)
    return np.concatenate([schemas.matrix(frames[name]) for name in names], axis=1).astype(np.float32)


def _flat(settings: Mapping, prefix: str = "") -> dict[str, str]:
    """Return nested settings as MLflow's params: `{"a": {"b": 1}}` becomes `{"a.b": "1"}`."""
    flat = {}
    for name, value in settings.items():
        if isinstance(value, Mapping):
            flat |= _flat(value, f"{prefix}{name}.")
        else:
            flat[prefix + name] = value if isinstance(value, str) else json.dumps(value)
    return flat
