"""How the files of one trained model become one MLflow run.

The stages only write files. This module reads what they wrote for every (protocol, model, seed) of an
experiment, and makes the store hold exactly one active run for each, found again by a hash of its content.
The store can therefore be deleted at any time: the next call fills it again from the files.
"""

import hashlib
import json
import logging
import os
import subprocess
import time
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from pipeline import paths
from pipeline.errors import InputError

os.environ["MLFLOW_DISABLE_TELEMETRY"] = "true"  # read by mlflow when it is imported
os.environ["MLFLOW_SUPPRESS_PRINTING_URL_TO_STDOUT"] = "true"  # two lines a run, where a server is used
os.environ.setdefault("MLFLOW_HTTP_REQUEST_MAX_RETRIES", "2")  # 7 retries of a dead server take 4 minutes

from mlflow import MlflowClient
from mlflow.entities import Metric, Param, Run, ViewType
from mlflow.exceptions import MlflowException
from sqlalchemy.exc import SQLAlchemyError

WRITER = "pipeline.track"  # the tag `written_by`: runs without it belong to the user and are never touched
MODEL_FILES = ("*.safetensors", "*.skops")
CURVES = ("train_loss", "validation_loss", "learning_rate")
METRICS_PER_CALL = 1000  # the limit of MLflow's log_batch

logging.getLogger("alembic").setLevel(logging.CRITICAL)
logging.getLogger("mlflow").setLevel(logging.CRITICAL)  # its errors reach the user as one InputError


@dataclass(frozen=True)
class TrackedRun:
    """One trained model as read from its files; losses are in the model's own training units."""

    experiment: str
    protocol: str
    model: str
    seed: int
    settings: dict[str, str]  # MLflow params
    curves: dict[str, list[tuple[int, float]]]  # name -> (epoch, value)
    metrics: dict[str, float]  # scores and counts, the same on every machine up to rounding
    timings: dict[str, float]  # measured wall times: logged, but not part of the content
    params_hash: str
    folder: Path
    content: str

    @property
    def key(self) -> tuple[str, str, str, str]:
        """(experiment, protocol, model, seed), as the run's tags hold them."""
        return self.experiment, self.protocol, self.model, str(self.seed)


def store_folder() -> Path:
    """`mlruns`: the default store `mlflow.db`, its `artifacts`, and the receipt `tracked.csv`."""
    return paths.ROOT / "mlruns"


def receipt() -> Path:
    """`mlruns/tracked.csv`: experiment, protocol, model, seed, content, run_id; one row a run."""
    return store_folder() / "tracked.csv"


def read_runs(experiment: str, params: dict) -> list[TrackedRun]:
    """Every run that `params[experiment]` lists, in its order: protocol, then model, then seed.

    `params` is the whole of params.yaml as nested dicts. Raises InputError that names the first file, column
    or row that is missing: a run is complete or it is not tracked.
    """
    settings = params[experiment]
    scores = _read_csv(
        paths.scores(experiment),
        ["protocol", "condition", "model", "seed", "metric", "value"],
        made_by="dvc repro evaluate",
    )
    latency = _read_csv(
        paths.latency(experiment),
        ["model", "batch", "p50_ms", "p95_ms", "size_bytes"],
        made_by="dvc repro latency",
    )
    runs = []
    for protocol, replicates in settings["protocols"].items():
        for model in settings["models"]:
            times = _read_csv(
                paths.training_times(experiment, model),
                ["protocol", "seed", "train_s"],
                made_by="dvc repro train",
            )
            for seed in replicates["seeds"]:
                runs.append(_read_run(experiment, settings, protocol, model, seed, scores, latency, times))
    return runs


def synchronise(runs: list[TrackedRun]) -> tuple[pd.DataFrame, int, int]:
    """Make the store hold exactly `runs`: log the missing ones, delete those that are superseded or unlisted.

    Returns the receipt (experiment, protocol, model, seed, content, run_id; a row a run), the number of runs
    logged and the number deleted. "Deleted" is MLflow's lifecycle stage: `mlflow gc` removes them for good,
    and only runs that this function wrote are ever deleted. Raises InputError if the store is unreachable,
    locked, or was made by a copy of the repository in another folder.
    """
    uri = os.environ.get("MLFLOW_TRACKING_URI")
    try:
        if uri:
            return _synchronise(MlflowClient(tracking_uri=uri), runs, artifacts=None)
        store_folder().mkdir(exist_ok=True)
        client = MlflowClient(tracking_uri=f"sqlite:///{store_folder() / 'mlflow.db'}")
        return _synchronise(client, runs, artifacts=store_folder() / "artifacts")
    except (MlflowException, SQLAlchemyError, OSError) as error:
        reason = str(error).strip().splitlines()[0].rstrip(".")
        raise InputError(
            f"{uri or 'mlruns/mlflow.db'}: the MLflow store cannot be used ({reason}); all results are "
            "safe in data/, so free or start the store and run `python -m pipeline.track` again"
        ) from error


def git_state() -> tuple[str, str]:
    """The commit of the working tree, and "true" if code or params differ from it, else "false".

    `dvc.lock` and `reports/` do not count: the pipeline itself has just written them.
    """
    try:
        top, commit = _git("rev-parse", "--show-toplevel", "HEAD").split("\n")
        if Path(top) != paths.ROOT.resolve():  # a copy that lies inside somebody else's repository
            raise ValueError
        changes = _git("status", "--porcelain", "--", ".", ":!dvc.lock", ":!reports")
    except (OSError, ValueError, subprocess.CalledProcessError):
        return "unknown (not a git checkout)", "unknown (not a git checkout)"
    return commit, "true" if changes else "false"


def _git(*arguments: str) -> str:
    command = ["git", "-C", str(paths.ROOT), *arguments]
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout.strip()


def _read_run(
    experiment: str,
    settings: dict,
    protocol: str,
    model: str,
    seed: int,
    scores: pd.DataFrame,
    latency: pd.DataFrame,
    times: pd.DataFrame,
) -> TrackedRun:
    folder = paths.run_folder(experiment, model, protocol, seed)
    history = _read_csv(folder / "history.csv", ["epoch", *CURVES], made_by="dvc repro train")
    fit = _read_json(folder / "fit.json", made_by="dvc repro train")
    if absent := {"stop_reason", "best_epoch", "epochs", "parameters", "macs", "settings"} - fit.keys():
        raise InputError(f"{_shown(folder / 'fit.json')}: key {min(absent)!r} is missing; run `dvc repro train` again")
    if not any(path for pattern in MODEL_FILES for path in folder.glob(pattern)):
        raise InputError(
            f"{_shown(folder)}: holds no model file ({' or '.join(MODEL_FILES)}); run `dvc repro train` again"
        )

    this_run = f"protocol {protocol}, model {model}, seed {seed}"
    is_run = (scores["protocol"] == protocol) & (scores["model"] == model) & (scores["seed"] == seed)
    if not is_run.any():
        raise InputError(f"{_shown(paths.scores(experiment))}: no row for {this_run}; run `dvc repro evaluate` again")
    if scores[is_run].duplicated(["condition", "metric"]).any():
        raise InputError(
            f"{_shown(paths.scores(experiment))}: two rows for the same condition and metric of {this_run}; "
            "run `dvc repro evaluate` again"
        )
    metrics = {f"{row.condition}.{row.metric}": float(row.value) for row in scores[is_run].itertuples(index=False)}
    speed = _one_row(
        latency,
        paths.latency(experiment),
        {"model": model, "batch": 1},
        mend=f"keep 1 in {experiment}.latency.batches of params.yaml and run `dvc repro latency`",
    )
    training = _one_row(
        times,
        paths.training_times(experiment, model),
        {"protocol": protocol, "seed": seed},
        mend="run `dvc repro train` again",
    )

    logged = _flatten(fit["settings"]) | {
        "protocol": protocol,
        "model": model,
        "seed": str(seed),
        "parameters": str(fit["parameters"]),
        "macs": "not counted" if fit["macs"] is None else str(fit["macs"]),
        "stop_reason": str(fit["stop_reason"]),
    }
    metrics |= {
        "best_epoch": float(fit["best_epoch"]),
        "epochs": float(fit["epochs"]),
        "size_bytes": float(speed["size_bytes"]),
    }
    curves = {}
    for name in CURVES:  # a diverged fit ends in a NaN, which no chart can draw; `stop_reason` says it
        points = history[["epoch", name]].replace([np.inf, -np.inf], np.nan).dropna()
        curves[name] = [(int(epoch), float(value)) for epoch, value in points.to_numpy()]
    # What in params.yaml decides this run: not the other models or seeds, nor how inference is timed.
    others = ("models", "protocols", "latency")
    decisive = {name: value for name, value in settings.items() if name not in others}
    params_hash = _hash(
        [
            decisive,
            settings["models"][model],
            {name: value for name, value in settings["protocols"][protocol].items() if name != "seeds"},
        ]
    )
    files = {
        path.relative_to(folder).as_posix(): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }
    return TrackedRun(
        experiment,
        protocol,
        model,
        seed,
        settings=logged,
        curves=curves,
        metrics=metrics,
        timings={
            "latency.p50_ms": float(speed["p50_ms"]),
            "latency.p95_ms": float(speed["p95_ms"]),
            "train_s": float(training["train_s"]),
        },
        params_hash=params_hash,
        folder=folder,
        content=_hash([experiment, logged, curves, metrics, params_hash, files]),
    )


def _synchronise(client: MlflowClient, runs: list[TrackedRun], artifacts: Path | None) -> tuple[pd.DataFrame, int, int]:
    """`artifacts` is the folder for the files of the runs, or None if a server decides."""
    experiments = _open_experiments(client, {run.experiment for run in runs}, artifacts)
    wanted = {run.key: run for run in runs}
    kept: dict[tuple[str, ...], str] = {}
    outdated = []
    for old in _written_runs(client, experiments.values()):
        key = tuple(old.data.tags.get(name, "") for name in ("experiment", "protocol", "model", "seed"))
        unchanged = (
            key in wanted
            and key not in kept
            and old.data.tags.get("content") == wanted[key].content
            and old.info.status == "FINISHED"  # an interrupted call leaves a run that is still "RUNNING"
            and (artifacts is None or (Path(old.info.artifact_uri) / "model").is_dir())
        )
        if unchanged:
            kept[key] = old.info.run_id
        else:
            outdated.append(old.info.run_id)

    logged = [run for key, run in wanted.items() if key not in kept]
    commit = git_state()
    for run in logged:
        kept[run.key] = _write_run(client, experiments[run.experiment], run, commit)
    for run_id in outdated:  # after the new ones are complete: an interruption loses nothing
        client.delete_run(run_id)

    rows = [(*key, run.content, kept[key]) for key, run in wanted.items()]
    columns = ["experiment", "protocol", "model", "seed", "content", "run_id"]
    return pd.DataFrame(rows, columns=columns), len(logged), len(outdated)


def _open_experiments(client: MlflowClient, names: set[str], artifacts: Path | None) -> dict[str, str]:
    """Name -> MLflow id of all experiments that this module ever wrote to; creates those of `names`."""
    known = {
        experiment.name: experiment
        for experiment in client.search_experiments(view_type=ViewType.ALL)
        if experiment.name in names or experiment.tags.get("written_by") == WRITER
    }
    ids = {}
    for name, experiment in known.items():
        if artifacts is not None and Path(experiment.artifact_location) != artifacts / name:
            raise InputError(
                f"mlruns/mlflow.db: keeps the files of experiment {name!r} in {experiment.artifact_location} "
                f"instead of {artifacts / name} (was the repository moved or copied?); delete the folder "
                "mlruns and run `python -m pipeline.track`, which fills it again from the results"
            )
        if experiment.lifecycle_stage == "deleted" and name in names:
            client.restore_experiment(experiment.experiment_id)
        if experiment.tags.get("written_by") != WRITER:
            client.set_experiment_tag(experiment.experiment_id, "written_by", WRITER)
        ids[name] = experiment.experiment_id
    for name in sorted(names - known.keys()):
        location = None if artifacts is None else str(artifacts / name)
        ids[name] = client.create_experiment(name, location, tags={"written_by": WRITER})
    return ids


def _written_runs(client: MlflowClient, experiment_ids: Iterable[str]) -> list[Run]:
    """All active runs that this module wrote, newest first."""
    ids = list(experiment_ids)
    found: list[Run] = []
    token = None
    while ids:
        page = client.search_runs(
            ids,
            filter_string=f"tags.written_by = '{WRITER}'",
            order_by=["attributes.start_time DESC"],
            page_token=token,
        )
        found.extend(page)
        token = page.token
        if not token:
            break
    return found


def _write_run(client: MlflowClient, experiment_id: str, run: TrackedRun, commit: tuple[str, str]) -> str:
    """Log one run and return its id; its status is FINISHED only when everything has been logged."""
    now = int(time.time() * 1000)
    tags = {
        "experiment": run.experiment,
        "protocol": run.protocol,
        "model": run.model,
        "seed": str(run.seed),
        "git_commit": commit[0],
        "git_dirty": commit[1],
        "params_hash": run.params_hash,
        "content": run.content,
        "written_by": WRITER,
    }
    created = client.create_run(
        experiment_id,
        start_time=now - round(run.timings["train_s"] * 1000),  # so that MLflow's "Duration" is the training's
        tags=tags,
        run_name=f"{run.model} {run.protocol} seed {run.seed}",
    )
    run_id = created.info.run_id
    points = [Metric(name, value, now, epoch) for name, curve in run.curves.items() for epoch, value in curve] + [
        Metric(name, value, now, 0) for name, value in (run.metrics | run.timings).items()
    ]
    client.log_batch(run_id, params=[Param(name, value) for name, value in run.settings.items()])
    for start in range(0, len(points), METRICS_PER_CALL):
        client.log_batch(run_id, metrics=points[start : start + METRICS_PER_CALL])
    client.log_artifacts(run_id, str(run.folder), "model")
    client.set_terminated(run_id, end_time=now)
    return run_id


def _flatten(settings: dict, prefix: str = "") -> dict[str, str]:
    """Nested settings as MLflow params: `{"a": {"b": 1}}` becomes `{"a.b": "1"}`."""
    flat = {}
    for name, value in settings.items():
        if isinstance(value, dict):
            flat |= _flatten(value, f"{prefix}{name}.")
        else:
            flat[f"{prefix}{name}"] = value if isinstance(value, str) else json.dumps(value)
    return flat


def _hash(content: object) -> str:
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()


def _shown(path: Path) -> Path:
    return path.relative_to(paths.ROOT)


def _read_json(path: Path, made_by: str) -> dict:
    try:
        content = json.loads(paths.require(path, made_by).read_text())
    except (ValueError, RecursionError) as error:
        raise InputError(f"{_shown(path)}: not JSON ({error}); run `{made_by}` again") from error
    if not isinstance(content, dict):
        raise InputError(f"{_shown(path)}: not a JSON object; run `{made_by}` again")
    return content


def _read_csv(path: Path, columns: list[str], made_by: str) -> pd.DataFrame:
    try:
        table = pd.read_csv(paths.require(path, made_by))
    except ValueError as error:  # no table, or no text
        raise InputError(f"{_shown(path)}: not a CSV table ({error}); run `{made_by}` again") from error
    for column in columns:
        if column not in table.columns:
            raise InputError(f"{_shown(path)}: column {column!r} is missing; run `{made_by}` again")
    return table


def _one_row(table: pd.DataFrame, path: Path, where: dict, mend: str) -> pd.Series:
    rows = table[(table[list(where)] == pd.Series(where)).all(axis=1)]
    if len(rows) != 1:
        wanted = ", ".join(f"{name} {value}" for name, value in where.items())
        raise InputError(f"{_shown(path)}: {len(rows)} rows for {wanted} instead of 1; {mend}")
    return rows.iloc[0]
