"""Say where this checkout's MLflow store lies and what it was last known to hold, without importing MLflow.

Importing MLflow and reading the model files takes seconds, and `track` is part of every `dvc repro`. So a receipt in
`mlruns/tracked.json` says for which files, settings and code the store was found complete.
"""

import hashlib
import json
import os
import re
import secrets
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from pipeline.base import files, paths, processes

# Files that decide how files become runs.
CODE = (
    "base/store.py",
    "datasets/fits.py",
    "inference/card.py",
    "inference/mlflow_model.py",
    "inference/mlflow_runs.py",
)
CODE += ("inference/packages.py", "scoring/results.py", "stages/track.py", "tracking.py")
DESCRIPTION = ("MLmodel", "card.json")  # files that make the files of a model one that MLflow opens
COLUMNS = ("experiment", "protocol", "model", "seed", "content", "run_id")  # of a receipt's rows


def workspace() -> Path:
    """Return the checkout that the store belongs to: this one, or the one that DVC copied it from.

    `dvc exp run --queue` and `--temp` run in a copy of the checkout below its `.dvc/tmp/exps`, which DVC removes
    afterwards; to the stages there it says in DVC_ROOT where the copy comes from.
    """
    origin = os.environ.get("DVC_ROOT")
    if origin and paths.ROOT.resolve().is_relative_to(Path(origin).resolve() / ".dvc" / "tmp" / "exps"):
        return Path(origin).resolve()
    return paths.ROOT


def in_temporary_copy() -> bool:
    """Tell whether this is a copy that DVC made for an experiment: its results are not those of the checkout."""
    return workspace() != paths.ROOT


def server() -> str | None:
    """Return the address in MLFLOW_TRACKING_URI, a server's or a database's; None for the default store."""
    return os.environ.get("MLFLOW_TRACKING_URI") or None


def folder() -> Path:
    """Return `mlruns`: the default store `mlflow.db`, its `artifacts`, the receipt and the checkout's id."""
    return workspace() / "mlruns"


def database() -> Path:
    """Return `mlruns/mlflow.db`, the default store."""
    return folder() / "mlflow.db"


def artifacts() -> Path:
    """Return `mlruns/artifacts`: the files of the runs in the default store, one folder per experiment."""
    return folder() / "artifacts"


def receipt() -> Path:
    """Return `mlruns/tracked.json`: digest of what was tracked, state of the default store, and one row per run."""
    return folder() / "tracked.json"


def current_tag() -> str:
    """Return the name of the tag that says which runs are of this checkout's present results."""
    return f"current.{checkout()}"


def checkout() -> str:
    """Return the id that tells this checkout from others that use the same store; drawn at the first call."""
    path = folder() / "checkout"
    text = path.read_text(encoding="utf-8", errors="replace").strip() if path.is_file() else ""
    if not re.fullmatch("[0-9a-f]{8}", text):
        text = secrets.token_hex(4)
        files.write_text(path, text + "\n")
    return text


@contextmanager
def one_at_a_time() -> Iterator[None]:
    """Let one process at a time write runs for this checkout: queued experiments may end at the same moment."""
    sentence = "MLflow: waiting for another `python -m pipeline.stages.track` to end"
    with processes.holding(folder() / "lock", lambda: print(sentence, flush=True)):
        yield


def origin(params: dict) -> str:
    """Return a digest of all sources of the runs: settings, code, and name, size and time of each file.

    No file of a result is read: DVC has compared their contents already, and writes a file anew when it changes. The
    folder counts, since the store does not work in a copy.
    """
    rows = [str(workspace()), json.dumps(params, sort_keys=True)]
    rows += [hashlib.sha256((paths.CODE / name).read_bytes()).hexdigest() for name in CODE]
    rows += [f"{path.relative_to(paths.ROOT).as_posix()} {_state(path)}" for path in _inputs(params)]
    return hashlib.sha256("\n".join(rows).encode()).hexdigest()


def write_receipt(origin: str, rows: list[dict[str, str]]) -> None:
    """Note that the store holds `rows` (COLUMNS, one per run), made from sources with the digest `origin`."""
    content = {"origin": origin, "database": _state(database()), "runs": rows}
    files.write_text(receipt(), json.dumps(content, indent=1) + "\n")


def known_rows(origin: str) -> list[dict[str, str]] | None:
    """Return the rows of the receipt if it is of the same origin, else None; a damaged receipt counts as none."""
    content = _read_receipt()
    return content["runs"] if content.get("origin") == origin else None


def is_untouched(rows: list[dict[str, str]]) -> bool:
    """Tell whether the default store is as the receipt left it, and holds the files of all `rows`."""
    state = _state(database())
    return (
        state is not None
        and state == _read_receipt().get("database")
        and all(has_model(artifacts() / row["experiment"] / row["run_id"] / "artifacts") for row in rows)
    )


def has_model(folder: Path) -> bool:
    """Tell whether the folder of a run's files holds a model that MLflow opens."""
    return all((folder / "model" / name).is_file() for name in DESCRIPTION)


def _read_receipt() -> dict:
    try:
        content = json.loads(receipt().read_text(encoding="utf-8"))
        complete = all(set(row) == set(COLUMNS) for row in content["runs"])
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        return {}
    return content if complete else {}


def _inputs(params: dict) -> Iterator[Path]:
    """Yield every file that tracking reads or logs; some may not exist."""
    for experiment in params["experiments"]:
        yield paths.ingest_report(experiment)
        yield paths.scores(experiment)
        yield paths.latency(experiment)
        yield paths.frames(experiment)
        yield paths.dataset(experiment)
        for model in params[experiment]["models"]:
            yield paths.training_times(experiment, model)
            yield from sorted(paths.model_folder(experiment, model).rglob("*"))


def _state(path: Path) -> list[int] | None:
    """Return size in bytes and time of the last change in ns; None for a file that is not there."""
    try:
        status = path.stat()
    except FileNotFoundError:
        return None
    return [status.st_size, status.st_mtime_ns]
