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
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd

from pipeline.base import files, params, paths, provenance
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


class TrainedRun(NamedTuple):
    """One trained model as its files say, without its learning curve."""

    model: str
    protocol: str
    seed: int
    folder: Path
    settings: dict[str, str]  # the model's block of settings as params of MLflow: `training.epochs` -> "40"
    metrics: dict[str, float]  # `<condition>.<metric>`, counts, and what was measured
    tags: dict[str, str]  # units, published values, how the training ended, and the content


def read_runs(workspace: Workspace, experiment: str, values: Mapping) -> list[TrainedRun]:
    """Read every run that params.yaml (`values`) lists for an experiment: model, then protocol, then seed.

    Raises InputError that names the first file, column or row that is missing, or the first model made with other
    settings: a run is complete, or it is not logged.
    """
    settings, made_by = values[experiment], params.training_command(experiment)
    scores = results.read_csv(
        workspace.scores(experiment),
        ["protocol", "condition", "model", "seed", "metric", "unit", "value"],
        "dvc repro evaluate",
    )
    latency, runs = results.read_latency(workspace, experiment, settings), []
    for model in settings["models"]:
        speed = {f"latency.batch_{n}.p50_ms": latency[model, n]["p50_ms"] for n in settings["latency"]["batches"]}
        file = workspace.training_times(experiment, model)
        times = results.read_csv(file, ["protocol", "seed", "train_s"], made_by).set_index(["protocol", "seed"])
        for protocol, seed in params.runs(values, experiment):
            if (protocol, seed) not in times.index:
                raise InputError(f"{file}: no row for protocol {protocol}, seed {seed}; run `{made_by}` again")
            folder = workspace.run_folder(experiment, model, protocol, seed)
            paths.require(folder / "history.csv", made_by)
            fit = fits.read_as_set(folder, values, experiment, model, protocol)
            flat = pd.json_normalize(fit["settings"]).to_dict("records")[0] if fit["settings"] else {}
            flat = {name: value if isinstance(value, str) else json.dumps(value) for name, value in flat.items()}
            of_run = scores[(scores.protocol == protocol) & (scores.model == model) & (scores.seed == seed)]
            by_name, tags = _scores(experiment, model, of_run)
            if not by_name or len(by_name) < len(of_run):
                problem = "two rows for the same condition and metric of" if by_name else "no row for"
                raise InputError(
                    f"{workspace.scores(experiment)}: {problem} protocol {protocol}, model {model}, seed {seed}; "
                    "run `dvc repro evaluate` again"
                )
            identity = [experiment, protocol, model, seed, flat, by_name, files.sha256(cards.weights_file(folder))]
            tags |= {name: str(fit[name]) for name in ("stop_reason", "precision")}
            tags["content"] = hashlib.sha256(json.dumps(identity, sort_keys=True).encode()).hexdigest()
            counts = {name: float(fit[name]) for name in COUNTS if fit[name] is not None}
            measured = speed | {"train_s": float(times.train_s[protocol, seed])}
            runs.append(TrainedRun(model, protocol, seed, folder, flat, by_name | counts | measured, tags))
    return runs


def _scores(experiment: str, model: str, scores: pd.DataFrame) -> tuple[dict[str, float], dict[str, str]]:
    """Return the scores of a run's rows of scores.csv by MLflow's names, and tags with units and printed values."""
    by_name, tags = {}, {}
    for row in scores.itertuples():
        name = f"{NOT_TAKEN.sub('_', row.condition)}.{row.metric}"
        by_name[name], tags[f"unit.{row.metric}"] = float(row.value), str(row.unit)
        if np.isfinite(printed := published.score(experiment, model, row.condition, row.metric)):
            tags[f"published.{name}"] = str(printed)
    return by_name, tags


def log(workspace: Workspace, client, experiment: str, values: Mapping, runs: list[TrainedRun]) -> tuple[int, str]:
    """Log those of `runs`, as `read_runs` returns them, that the store lacks, and mark all of them as the current ones.

    client: MlflowClient. Return the number of new runs, and the link that compares those of the first protocol.
    """
    in_mlflow = mlflow_store.experiment_id(workspace, client, experiment)
    held, token = [], ""
    while token is not None:
        page = client.search_runs([in_mlflow], "tags.content LIKE '%'", page_token=token or None)
        held, token = held + list(page), page.token or None
    for run in held:
        if run.info.status == "RUNNING":  # what a call that was killed left half-way
            client.set_terminated(run.info.run_id, "KILLED")
    known = {run.data.tags["content"]: run.info.run_id for run in held if run.info.status == "FINISHED"}
    new = [run for run in runs if run.tags["content"] not in known]
    if new:
        known |= _write(workspace, client, in_mlflow, experiment, values, new)
    current = {known[run.tags["content"]] for run in runs}
    for run in held:  # after the new ones are complete
        if run.data.tags.get("current") != (mark := str(run.info.run_id in current).lower()):
            client.set_tag(run.info.run_id, "current", mark)
    first = next(iter(runs[0].metrics))  # of scores.csv
    ascending = results.scale_of(first.rpartition(".")[2]) in (results.PLAIN, results.LOG)
    return len(new), mlflow_store.link(in_mlflow, runs[0].protocol, first, ascending)


def _write(workspace: Workspace, client, in_mlflow: str, experiment: str, values: Mapping, runs) -> dict[str, str]:
    """Log runs; return content -> id. A run's status is FINISHED only when everything of it has been logged."""
    from mlflow.entities import Metric, Param  # here, because mlflow_store says first how MLflow starts

    from pipeline.inference.describer import Describer  # here, because the import of torch takes 2 s

    describer = Describer(workspace, values, experiment)
    readings = describer.readings()
    commit, changed = provenance.git_state(workspace)
    shared = {"experiment": experiment, "git_commit": commit, "git_changed": changed, "current": "true"}
    if "DVC_EXP_NAME" in os.environ:
        shared["dvc_experiment"] = os.environ["DVC_EXP_NAME"]
    settings_files = [file for file in params.settings_files(workspace.params) if file.stem in ("params", experiment)]
    name, made_by, written = labels.experiment_name(experiment), params.training_command(experiment), {}
    for run in runs:
        card, label = describer.card(run.model, run.protocol, run.seed, commit), labels.model_name(run.model)
        told, identity = _told(card), {"protocol": run.protocol, "seed": str(run.seed)}
        if not written:
            client.set_experiment_tag(in_mlflow, NOTE, f"{name}: {ABOUT}\n\n{told['readings']}")
        about = f"{label} on {name}, protocol {run.protocol}, seed {run.seed}."
        history = results.read_csv(run.folder / "history.csv", ["epoch", *CURVES], made_by)
        now = int(time.time() * 1000)  # files hold no date: a run ends now, and lasts as long as its training did
        points = [
            Metric(curve, value, now, int(epoch))
            for curve in CURVES
            for epoch, value in history[["epoch", curve]].to_numpy()
            if np.isfinite(value)  # a diverged fit ends in a NaN, which no chart can draw; `stop_reason` says it
        ]
        points += [Metric(name, value, now, 0) for name, value in run.metrics.items()]
        run_id = client.create_run(
            in_mlflow,
            start_time=now - round(1000 * run.metrics["train_s"]),
            tags=run.tags | shared | identity | {"model": run.model, NOTE: "\n\n".join([about, *told.values()])},
            run_name=f"{label}, {run.protocol}, seed {run.seed}",
        ).info.run_id
        settings = run.settings | identity | {"model": label}
        client.log_batch(run_id, params=[Param(key, value) for key, value in settings.items()])
        for first in range(0, len(points), PER_CALL):
            client.log_batch(run_id, metrics=points[first : first + PER_CALL])
        for file in (*settings_files, run.folder / "fit.json", run.folder / "history.csv"):
            client.log_artifact(run_id, str(file))
        with tempfile.TemporaryDirectory() as draft:
            _save(Path(draft), run, card, readings)
            client.log_artifacts(run_id, str(Path(draft, mlflow_store.MODEL)), mlflow_store.MODEL)
        client.set_terminated(run_id, end_time=now)
        written[run.tags["content"]] = run_id
    return written


def _save(draft: Path, run: TrainedRun, card: cards.Card, readings: np.ndarray) -> None:
    """Write a model of MLflow into a folder of the folder `draft`; nothing in it is pickled."""
    import mlflow.pyfunc
    from mlflow.models import ModelSignature
    from mlflow.types import Schema, TensorSpec

    number = np.dtype("float32")
    taken, predicted = TensorSpec(number, (-1, card.inputs.columns)), TensorSpec(number, (-1, *card.output_shape))
    cards.write(draft, card)
    mlflow.pyfunc.save_model(
        draft / mlflow_store.MODEL,
        python_model=str(CODE),
        artifacts={"card": str(draft / cards.NAME), "weights": str(cards.weights_file(run.folder))},
        signature=ModelSignature(Schema([taken]), Schema([predicted])),
        input_example=readings[: card.reach() + PREDICTED],
        pip_requirements=[f"{name}=={importlib.metadata.version(name).partition('+')[0]}" for name in REQUIRED],
        metadata=_told(card),
    )


def _told(card: cards.Card) -> dict[str, str]:
    """Say in words what a model takes and gives, with shapes and units."""
    inputs, outputs = card.inputs, card.outputs
    said = f"float32 ({', '.join(map(str, ('n', *card.output_shape)))}) in {outputs.unit}, one per reading"
    if outputs.names:
        said += f": {', '.join(outputs.names)}"
    if before := card.reach():
        said += f"; where a model takes whole windows, NaN for the first {before}"
    taken = f"float32 (n, {inputs.columns}) in {inputs.unit}, {inputs.order}; one every {inputs.interval_s:g} s"
    return {"readings": f"Readings: {taken}.", "predictions": f"Predictions: {said}."}
