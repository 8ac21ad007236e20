"""Make one MLflow run of the files of one trained model.

The stages only write files. This module reads the files of every (protocol, model, seed) of an experiment, and makes
the store hold a run of that content, found again by a hash of settings, curves, scores and model files. What makes the
files a model that MLflow opens (pipeline/inference/mlflow_runs.py) follows from these. No run is ever
deleted, and none changes its params, scores or files; a run that somebody deleted is restored when its content is
wanted again. Two checkouts with the same content share the run. Two things do change:

* the tag `current.<checkout>`, "true" on the runs of a checkout's present results and "false" on its former ones;
* times measured anew: further points of `train_s` and `latency.*`, by the checkout that logged the run.

The store can be deleted at any time: the next call fills it again from the files.
"""

import hashlib
import json
import logging
import os
import re
import subprocess
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple
from urllib.parse import unquote

import numpy as np
import pandas as pd
from ruamel.yaml import YAML
from ruamel.yaml.error import YAMLError

from pipeline.base import paths, store
from pipeline.base.errors import InputError, storage_error
from pipeline.base.params import run_settings, training_command
from pipeline.datasets import fits
from pipeline.scoring import results

os.environ["MLFLOW_DISABLE_TELEMETRY"] = "true"  # read by mlflow when it is imported
os.environ["MLFLOW_SUPPRESS_PRINTING_URL_TO_STDOUT"] = "true"  # two lines a run, where a server is used
os.environ.setdefault("MLFLOW_HTTP_REQUEST_MAX_RETRIES", "2")  # 7 retries of a dead server take 4 minutes

from mlflow import MlflowClient
from mlflow.entities import Metric, Param, Run, ViewType
from mlflow.exceptions import MlflowException
from mlflow.store.db.db_types import DATABASE_ENGINES
from sqlalchemy.exc import SQLAlchemyError

WRITER = "pipeline.stages.track"  # the tag `written_by`: runs without it belong to the user and are never touched
MODEL = "model"  # folder of a run with the files of the model
MODEL_FILES = ("*.safetensors", "*.skops")
NOTE = "mlflow.note.content"  # the tag that MLflow shows as the description of a run
TRACK = "run `python -m pipeline.stages.track` again"
CURVES = ("train_loss", "validation_loss", "learning_rate")
METRICS_PER_CALL = 1000  # the limit of MLflow's log_batch
PARAMS_PER_CALL = 100  # the same
LONGEST_PARAM = 6000  # characters; MLflow cuts what is longer
LONGEST_NAME = 100  # of a condition, in a metric's name; MLflow takes 250 characters for both
NAME = re.compile(r"\w[\w.\- ]*")  # what MLflow takes as a metric's name on every system, and no path but itself
DIGEST = re.compile(r" [0-9a-f]{8}$")  # how a name ends that MLflow would not have taken

logging.getLogger("alembic").setLevel(logging.CRITICAL)
logging.getLogger("mlflow").setLevel(logging.CRITICAL)  # its errors reach the user as one InputError
logging.getLogger("urllib3").setLevel(logging.CRITICAL)  # shows addresses with all that is secret in them


@dataclass(frozen=True)
class TrackedRun:
    """One trained model as read from its files; losses are in the model's own training units."""

    experiment: str
    protocol: str
    model: str
    seed: int
    settings: dict[str, str]  # MLflow params: the model's own settings, and what came out of fitting it
    block: dict[str, str]  # MLflow params: what the run was made with, as params.yaml names it (`touch.window.frames`)
    curves: dict[str, list[tuple[int, float]]]  # name -> (epoch, value)
    metrics: dict[str, float]  # scores (`<condition>.<metric>`) and counts, the same on every machine up to rounding
    timings: dict[str, float]  # measured wall times: logged, but not part of the content
    params_hash: str
    folder: Path
    content: str

    @property
    def key(self) -> tuple[str, str, str, str]:
        """Return (experiment, protocol, model, seed), as the run's tags hold them."""
        return self.experiment, self.protocol, self.model, str(self.seed)


WriteModel = Callable[[TrackedRun, Run, Path], str]  # returns the description of the model


class Outcome(NamedTuple):
    """What `synchronise` did, in numbers of runs."""

    rows: list[dict[str, str]]  # one row per run, with store.COLUMNS
    logged: int
    restored: int  # found again, but deleted by somebody
    measured: int  # found again, with times measured anew
    former: int  # no longer of the present results


def read_runs(experiment: str, params: dict) -> list[TrackedRun]:
    """Read every run that `params[experiment]` lists, in its order: protocol, then model, then seed.

    `params` is the whole of params.yaml as nested dicts. Raises InputError that names the first file, column or row
    that is missing, or the first model made with other settings: a run is complete or it is not tracked.
    """
    settings, runs = params[experiment], []
    key = ["protocol", "condition", "model", "seed", "metric"]
    scores = results.read_csv(paths.scores(experiment), [*key, "value"], "dvc repro evaluate")
    speed_columns = ["model", "batch", "p50_ms", "p95_ms", "size_bytes"]
    latency = results.read_csv(paths.latency(experiment), speed_columns, "dvc repro latency")
    batch = f"keep 1 in {experiment}.latency.batches of params.yaml and run `dvc repro latency`"
    for protocol, replicates in settings["protocols"].items():
        for model in settings["models"]:
            made_by, path = training_command(experiment), paths.training_times(experiment, model)
            times = results.read_csv(path, ["protocol", "seed", "train_s"], made_by)
            for seed in replicates["seeds"]:
                trained = _one_row(times, path, {"protocol": protocol, "seed": seed}, f"run `{made_by}` again")
                speed = _one_row(latency, paths.latency(experiment), {"model": model, "batch": 1}, batch)
                metrics = _scores(scores, experiment, protocol, model, seed) | {
                    "size_bytes": float(speed["size_bytes"])
                }
                timings = {f"latency.{name}": float(speed[name]) for name in ("p50_ms", "p95_ms")}
                timings["train_s"] = float(trained["train_s"])
                runs.append(_read_run(experiment, params, protocol, model, seed, metrics, timings))
    return runs


def check_settings(experiments: Iterable[str], params: dict) -> None:
    """Raise InputError if DVC made the results of `experiments` with other settings than `params`.

    Results that dvc.lock does not know, such as those of stages run by hand, cannot be checked.
    """
    path = paths.ROOT / "dvc.lock"
    if not path.is_file():
        return
    try:
        stages = YAML(typ="safe").load(path.read_text(encoding="utf-8"))["stages"].values()
        made_with = {
            out["path"]: dict(stage.get("params", {}).get("params.yaml", {}))
            for stage in stages
            for out in stage.get("outs", [])
        }
    except (YAMLError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise InputError("dvc.lock: was cut short or damaged; delete it and run `dvc repro`") from error
    for experiment in experiments:
        for output in (paths.scores(experiment), paths.models(experiment)):
            for dotted, value in made_with.get(paths.shown(output), {}).items():
                wanted = params
                for key in dotted.split("."):
                    wanted = wanted.get(key) if isinstance(wanted, Mapping) else None
                if key := _difference(value, wanted, dotted):
                    file = paths.shown(output)
                    raise InputError(
                        f"params.yaml, {key}: {file} was made with another value, says dvc.lock; run `dvc repro`"
                    )


def synchronise(runs: list[TrackedRun], write_model: WriteModel) -> Outcome:
    """Make the store hold every one of `runs`: find its content again, restore it or log it; then move `current`.

    write_model: writes into a folder what MLflow needs to open a run's model (pipeline/inference/mlflow_runs.py).
    In the temporary copy of an experiment no run becomes a current one. Raises InputError if the store is
    unreachable, locked, refuses a value, or was made by a copy of the repository in another folder.
    """
    with opened() as client:
        experiments = _open_experiments(client, {run.experiment for run in runs})
        _end_interrupted(client, experiments.values())
        marked = _marked(client, experiments.values())
        by_content = {
            run.data.tags["content"]: run
            for run in sorted(marked, key=_preference, reverse=True)
            if run.info.status == "FINISHED"
        }
        commit, rows, counts = git_state(), [], dict.fromkeys(("logged", "restored", "measured"), 0)
        for run in runs:
            match = by_content.get(run.content) or _find(client, experiments[run.experiment], run.content)
            if match is None:
                run_id = _write_run(client, experiments[run.experiment], run, commit, write_model)
                counts["logged"] += 1
            else:
                run_id = match.info.run_id
                counts["restored"] += _restore(client, match, run, write_model)
                counts["measured"] += _log_new_times(client, match, run)
            if not store.in_temporary_copy() and (match is None or match.data.tags.get(store.current_tag()) != "true"):
                client.set_tag(run_id, store.current_tag(), "true")
            rows.append(dict(zip(store.COLUMNS, (*run.key, run.content, run_id), strict=True)))
        former = {run.info.run_id for run in marked} - {row["run_id"] for row in rows}
        if store.in_temporary_copy():
            former = set()
        for run_id in sorted(former):  # after the new ones are complete
            client.set_tag(run_id, store.current_tag(), "false")
    return Outcome(rows, former=len(former), **counts)


def holds(rows: list[dict[str, str]]) -> bool:
    """Tell whether exactly `rows` of a receipt are the current runs of this checkout in the store, and complete."""
    with opened() as client:
        experiments = _open_experiments(client, set())
        complete = {
            (run.info.run_id, run.data.tags["content"])
            for run in _marked(client, experiments.values())
            if run.info.lifecycle_stage == "active" and run.info.status == "FINISHED" and not _lacks_files(run)
        }
    return complete == {(row["run_id"], row["content"]) for row in rows}


def git_state() -> tuple[str, str]:
    """Return the commit of the working tree, and "true" if code or params differ from it, else "false".

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


def _scores(scores: pd.DataFrame, experiment: str, protocol: str, model: str, seed: int) -> dict[str, float]:
    """Return `<condition>.<metric>` -> value of one run. Raises InputError where there is none, or two for one name."""
    rows = scores[(scores["protocol"] == protocol) & (scores["model"] == model) & (scores["seed"] == seed)]
    metrics = {f"{row.condition}.{row.metric}": float(row.value) for row in rows.itertuples(index=False)}
    if not metrics or len(metrics) < len(rows):
        problem = "two rows for the same condition and metric of" if metrics else "no row for"
        raise InputError(
            f"{paths.shown(paths.scores(experiment))}: {problem} protocol {protocol}, model {model}, seed {seed}; "
            "run `dvc repro evaluate` again"
        )
    return metrics


def _read_run(
    experiment: str, params: dict, protocol: str, model: str, seed: int, metrics: dict, timings: dict
) -> TrackedRun:
    """Read the folder of one run; metrics: its scores and size, timings: its measured times."""
    settings = params[experiment]
    folder, made_by = paths.run_folder(experiment, model, protocol, seed), training_command(experiment)
    history = results.read_csv(folder / "history.csv", ["epoch", *CURVES], made_by)
    fit = fits.read(folder, made_by)
    if not any(path for pattern in MODEL_FILES for path in folder.glob(pattern)):
        holds = f"holds no model file ({' or '.join(MODEL_FILES)})"
        raise InputError(f"{paths.shown(folder)}: {holds}; run `{made_by}` again")
    if fit["settings"] != run_settings(params, experiment, model, protocol):
        raise InputError(
            f"{paths.shown(folder / 'fit.json')}: was made with other settings than {experiment}.models.{model} of "
            "params.yaml; run `dvc repro`"
        )
    logged = _flatten(fit["settings"]) | {
        "protocol": protocol,
        "model": model,
        "seed": str(seed),
        "parameters": str(fit["parameters"]),
        "macs": "not counted" if fit["macs"] is None else str(fit["macs"]),
        "stop_reason": str(fit["stop_reason"]),
        "precision": fit["precision"] or "not chosen",
    }
    metrics = metrics | {name: float(fit[name]) for name in ("best_epoch", "epochs")}
    curves = {}
    for name in CURVES:  # a diverged fit ends in a NaN, which no chart can draw; `stop_reason` says it
        points = history[["epoch", name]].replace([np.inf, -np.inf], np.nan).dropna()
        curves[name] = [(int(epoch), float(value)) for epoch, value in points.to_numpy()]
    # What in params.yaml decides this run: not the other models or seeds, nor how inference is timed.
    others = ("models", "protocols", "latency")
    decisive = {name: value for name, value in settings.items() if name not in others}
    split = {name: value for name, value in settings["protocols"][protocol].items() if name != "seeds"}
    params_hash = _hash([decisive, settings["models"][model], split])
    files = {
        path.relative_to(folder).as_posix(): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }
    return TrackedRun(
        *(experiment, protocol, model, seed),
        settings=logged,
        block={"device": str(params["device"])} | _flatten({experiment: decisive | {"protocols": {protocol: split}}}),
        curves=curves,
        metrics=metrics,
        timings=timings,
        params_hash=params_hash,
        folder=folder,
        content=_hash([experiment, logged, curves, metrics, params_hash, files]),
    )


@contextmanager
def opened(then: str = TRACK) -> Iterator[MlflowClient]:
    """Open the store; an error of it becomes one sentence, without a password, that ends with `then`."""
    uri = store.server()
    try:
        client = MlflowClient(tracking_uri=uri or f"sqlite:///{store.database()}")
        client.search_experiments(max_results=1)
    except (MlflowException, SQLAlchemyError, OSError, ValueError, ImportError) as error:  # or a driver is missing
        raise InputError(_sentence(error, uri, then)) from error
    try:
        yield client
    except (MlflowException, SQLAlchemyError, OSError) as error:
        raise InputError(_sentence(error, uri, then, refused=("INVALID_PARAMETER_VALUE", "BAD_REQUEST"))) from error


def _sentence(error: Exception, uri: str | None, then: str, refused: Sequence[str] = ()) -> str:
    """Say what went wrong with a store and what to do; `refused`: MLflow's error codes that blame what it was sent."""
    if storage_error(error):
        return storage_error(error)
    reason = (str(error).strip() or type(error).__name__).splitlines()[0].rstrip(".")
    for secret in _secrets(uri or ""):
        reason = reason.replace(secret, "***")
    code = getattr(error, "error_code", "")
    problem = "the MLflow store cannot be used"
    if "locked" in reason:
        advice = "close what else uses it (`mlflow ui`, another `dvc repro`)"
    elif re.search("not a database|malformed", reason):
        advice = "move the damaged file away (the store is filled again from the results)"
    elif re.search("disk is full|readonly database|unable to open", reason):
        advice = "free or unlock the disk"
    elif re.search("database schema|Can't locate revision", reason):
        advice = "install the version of MLflow that wrote it, or upgrade it with `mlflow db upgrade`"
    elif code in ("UNAUTHENTICATED", "CUSTOMER_UNAUTHORIZED", "PERMISSION_DENIED"):
        advice = "set MLFLOW_TRACKING_USERNAME and MLFLOW_TRACKING_PASSWORD to an account that may write to it"
    elif code in refused:
        problem = "the MLflow store refuses what it was asked"
        advice = "change the name or value that the reason names"
    elif uri:
        advice = "start the server or fix MLFLOW_TRACKING_URI"
    else:
        advice = "free it"
    where = re.sub(r"\?.*", "", re.sub(r"//.*@", "//", uri)) if uri else "mlruns/mlflow.db"  # no account, no query
    return f"{where}: {problem} ({reason}); all results are safe in data/, so {advice} and {then}"


def _secrets(uri: str) -> list[str]:
    """Return the secrets of a tracking URI, longest first: user, password and query, as written and decoded."""
    account = re.search(r"//(.*)@", uri)
    texts = [account[1], account[1].partition(":")[2]] if account else []
    texts += [uri.partition("@")[2].partition("?")[2]] if account else [uri.partition("?")[2]]
    return sorted({form for text in texts if text for form in (text, unquote(text))}, key=len, reverse=True)


def _open_experiments(client: MlflowClient, names: set[str]) -> dict[str, str]:
    """Return name -> MLflow id of all experiments that this module ever wrote to; create those of `names`."""
    uri = store.server()
    known = {
        experiment.name: experiment
        for experiment in client.search_experiments(view_type=ViewType.ALL)
        if experiment.name in names or experiment.tags.get("written_by") == WRITER
    }
    ids = {}
    for name, experiment in known.items():
        if not uri and Path(experiment.artifact_location) != store.artifacts() / name:
            raise InputError(
                f"mlruns/mlflow.db: keeps the files of experiment {name!r} in {experiment.artifact_location} "
                f"instead of {store.artifacts() / name} (was the repository moved or copied?); delete the folder "
                "mlruns and run `python -m pipeline.stages.track`, which fills it again from the results"
            )
        if experiment.lifecycle_stage == "deleted" and name in names:
            client.restore_experiment(experiment.experiment_id)
        if experiment.tags.get("written_by") != WRITER:
            client.set_experiment_tag(experiment.experiment_id, "written_by", WRITER)
        ids[name] = experiment.experiment_id
    for name in sorted(names - known.keys()):
        # A server knows where; a database alone would have them below the working folder, which may be a copy's.
        is_database = not uri or uri.partition(":")[0].partition("+")[0] in DATABASE_ENGINES
        location = str(store.artifacts() / name) if is_database else None
        ids[name] = client.create_experiment(name, location, tags={"written_by": WRITER})
    return ids


def _search(client: MlflowClient, experiment_ids: Iterable[str], condition: str) -> list[Run]:
    """Return all runs that this module wrote and that meet a condition, deleted ones as well."""
    ids = list(experiment_ids)
    query, runs, token = f"tags.written_by = '{WRITER}' and {condition}", [], None
    while ids:
        page = client.search_runs(ids, query, ViewType.ALL, page_token=token)
        runs.extend(page)
        token = page.token
        if not token:
            break
    return runs


def _marked(client: MlflowClient, experiment_ids: Iterable[str]) -> list[Run]:
    """Return the runs with this checkout's tag `current`."""
    return _search(client, experiment_ids, f"tags.`{store.current_tag()}` = 'true'")


def _find(client: MlflowClient, experiment_id: str, content: str) -> Run | None:
    """Return the run of a content, or None; of two that were logged at the same moment, one that is not deleted."""
    matches = _search(client, [experiment_id], f"tags.content = '{content}' and attributes.status = 'FINISHED'")
    return min(matches, key=_preference, default=None)


def _preference(run: Run) -> tuple:
    """Return a key that is smallest for the run to take among those of one content: the same one at every call."""
    deleted, of_others = run.info.lifecycle_stage != "active", run.data.tags.get("checkout") != store.checkout()
    return deleted, of_others, run.info.start_time, run.info.run_id


def _end_interrupted(client: MlflowClient, experiment_ids: Iterable[str]) -> None:
    """Mark the runs that a killed call of this checkout left half-way; their content is logged anew, by other runs."""
    interrupted = f"attributes.status = 'RUNNING' and tags.checkout = '{store.checkout()}'"
    for run in _search(client, experiment_ids, interrupted):
        if run.info.lifecycle_stage == "active":
            client.set_terminated(run.info.run_id, "KILLED")


def _write_run(
    client: MlflowClient, experiment_id: str, run: TrackedRun, commit: tuple[str, str], write_model: WriteModel
) -> str:
    """Log one run and return its id; its status is FINISHED only when everything has been logged."""
    now = int(time.time() * 1000)
    tags = {
        **dict(zip(store.COLUMNS, run.key, strict=False)),
        "git_commit": commit[0],
        "git_dirty": commit[1],
        "params_hash": run.params_hash,
        "content": run.content,
        "written_by": WRITER,
        "checkout": store.checkout(),
        "mlflow.source.name": "dvc repro",
        "mlflow.source.type": "LOCAL",
    }
    if re.fullmatch("[0-9a-f]{40,64}", commit[0]):
        tags["mlflow.source.git.commit"] = commit[0]
    if "DVC_EXP_NAME" in os.environ:
        tags["dvc_experiment"] = os.environ["DVC_EXP_NAME"]
    metrics = {}
    for name, value in run.metrics.items():
        condition, dot, metric = name.rpartition(".")
        if condition and condition != _allowed(condition):
            tags[f"condition.{_allowed(condition)}"] = condition
        metrics[f"{_allowed(condition)}{dot}{metric}"] = value
    created = client.create_run(
        experiment_id,
        start_time=now - round(run.timings["train_s"] * 1000),  # so that MLflow's "Duration" is the training's
        tags=tags,
        run_name=f"{run.model} {run.protocol} seed {run.seed}",
    )
    run_id = created.info.run_id
    points = [Metric(name, value, now, epoch) for name, curve in run.curves.items() for epoch, value in curve]
    points += [Metric(name, value, now, 0) for name, value in (metrics | run.timings).items()]
    params = [Param(name, _shortened(value)) for name, value in (run.block | run.settings).items()]
    for start in range(0, len(params), PARAMS_PER_CALL):
        client.log_batch(run_id, params=params[start : start + PARAMS_PER_CALL])
    for start in range(0, len(points), METRICS_PER_CALL):
        client.log_batch(run_id, metrics=points[start : start + METRICS_PER_CALL])
    _log_files(client, created, run, write_model)
    client.set_terminated(run_id, end_time=now)
    return run_id


def _log_files(client: MlflowClient, logged: Run, run: TrackedRun, write_model: WriteModel) -> None:
    """Log settings and model; MLflow shows the description of the model on the page of the run."""
    run_id = logged.info.run_id
    with tempfile.TemporaryDirectory() as draft:
        description = write_model(run, logged, Path(draft, MODEL))
        client.log_artifact(run_id, str(paths.ROOT / "params.yaml"))
        client.log_artifacts(run_id, str(run.folder), MODEL)
        client.log_artifacts(run_id, str(Path(draft, MODEL)), MODEL)
    if NOTE not in logged.data.tags:
        client.set_tag(run_id, NOTE, description)


def _restore(client: MlflowClient, match: Run, run: TrackedRun, write_model: WriteModel) -> bool:
    """Bring back the run `match` (return True if somebody deleted it) or its files."""
    deleted = match.info.lifecycle_stage != "active"
    if deleted:
        client.restore_run(match.info.run_id)
    if _lacks_files(match):
        _log_files(client, match, run, write_model)
    return deleted


def _lacks_files(run: Run) -> bool:
    """Tell whether a run of the default store has lost its files, or never got a model's; a server is not asked."""
    return not store.server() and not store.has_model(Path(run.info.artifact_uri))


def _log_new_times(client: MlflowClient, match: Run, run: TrackedRun) -> bool:
    """Log the times that were measured anew, as a further step, so that MLflow's last value is that of the files.

    Only the checkout that logged a run does so: the times of another machine would say nothing about the first.
    A run of unknown origin becomes this checkout's. Returns whether there were any.
    """
    owner = match.data.tags.get("checkout")
    if store.in_temporary_copy() or owner not in (None, store.checkout()):
        return False
    if owner is None:
        client.set_tag(match.info.run_id, "checkout", store.checkout())
    new = {name: value for name, value in run.timings.items() if match.data.metrics.get(name) != value}
    points = []
    for name, value in new.items():
        steps = [point.step for point in client.get_metric_history(match.info.run_id, name)]
        points.append(Metric(name, value, int(time.time() * 1000), max(steps, default=-1) + 1))
    if points:
        client.log_batch(match.info.run_id, metrics=points)
    return bool(points)


def _allowed(name: str) -> str:
    """Return a condition's name in the letters that MLflow takes; a changed name gets a digest, so that no two meet."""
    if not name or (NAME.fullmatch(name) and len(name) <= LONGEST_NAME and not DIGEST.search(name)):
        return name
    taken = re.sub(r"^\W|[^\w.\- ]", "_", name)[:LONGEST_NAME]
    return f"{taken} {_hash(name)[:8]}"


def _shortened(value: str) -> str:
    """Return a param's value, or its beginning and digest where MLflow would cut it; params.yaml has all."""
    return value if len(value) <= LONGEST_PARAM else f"{value[: LONGEST_PARAM - 20]}... {_hash(value)[:8]}"


def _difference(made_with, wanted, where: str) -> str | None:
    """Return the dotted key of the first setting in which two blocks differ, None if there is none."""
    if isinstance(made_with, Mapping) and isinstance(wanted, Mapping):
        for key in [*made_with, *wanted]:
            if key not in made_with or key not in wanted:
                return f"{where}.{key}"
            if deeper := _difference(made_with[key], wanted[key], f"{where}.{key}"):
                return deeper
        return None
    return None if made_with == wanted else where


def _flatten(settings: dict, prefix: str = "") -> dict[str, str]:
    """Return nested settings as MLflow params: `{"a": {"b": 1}}` becomes `{"a.b": "1"}`."""
    flat = {}
    for name, value in settings.items():
        if isinstance(value, dict):
            flat |= _flatten(value, f"{prefix}{name}.")
        else:
            flat[f"{prefix}{name}"] = value if isinstance(value, str) else json.dumps(value)
    return flat


def _hash(content: object) -> str:
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()


def _one_row(table: pd.DataFrame, path: Path, where: dict, advice: str) -> pd.Series:
    rows = table[(table[list(where)] == pd.Series(where)).all(axis=1)]
    if len(rows) != 1:
        wanted = ", ".join(f"{name} {value}" for name, value in where.items())
        raise InputError(f"{paths.shown(path)}: {len(rows)} rows for {wanted} instead of 1; {advice}")
    return rows.iloc[0]
