"""Train the models of an experiment in parallel, each into a folder that appears once it is complete.

A folder that was made from the same settings, data and code is kept. A file in it says what it was made from.
"""

import csv
import hashlib
import json
from collections.abc import Callable, Collection, Iterable, Mapping
from pathlib import Path

from tqdm import tqdm

from tactile.base import files, params, workers
from tactile.base.availability import why_not_run
from tactile.base.paths import Workspace

TIMES = ("protocol", "seed", "train_s")
ORIGIN = "origin.txt"  # in a model's folder and in its draft


def train_all(
    workspace: Workspace,
    train_run: Callable[..., float],
    values: Mapping,
    experiment: str,
    origins: Mapping[str, str],
    protocols: Collection[str] | None = None,
) -> None:
    """Call `train_run` for every run of models to train.

    `train_run(workspace, values, experiment, model, protocol, seed, folder, report)` writes the run's files to the new
    `folder`, calls `report` once per epoch and returns the seconds that fitting took. All runs go to the same
    processes, those of the last model first: params.yaml lists networks last,
    and what takes long must not be left to one process at the end. Without recordings a model's folder has no runs.
    Kept is a folder of the same origin whose files are those that were written. The other folders stay until the last
    run is done. Where this call is stopped, its finished runs are kept in the models' drafts, and the next call with
    the same origins goes on from them.
    `values`: params.yaml; `origins`: model -> digest of all that its runs are made from (see `origin`); `protocols`:
    only these, in place of all.
    """
    runs = params.runs(values, experiment) if why_not_run(workspace, experiment) is None else []
    runs = [run for run in runs if protocols is None or run[0] in protocols]
    origins = {model: origin if runs else "" for model, origin in reversed(list(origins.items()))}
    origins = {model: origin for model, origin in origins.items() if not _is_kept(workspace, experiment, model, origin)}
    drafts = {model: workspace.model_draft(experiment, model) for model in origins}
    seconds = {model: _begin(drafts[model], origin) for model, origin in origins.items()}
    folders = {
        (model, *run): _folder(draft, run)
        for model, draft in drafts.items()
        for run in runs
        if run not in seconds[model]
    }
    if folders:
        steps = {
            (model, *run): params.epochs(params.run_settings(values, experiment, model, run[0]))
            for model in origins
            for run in runs
        }
        whole, steps = sum(steps.values()), {task: steps[task] for task in folders}
        size = {"total": whole, "initial": whole - sum(steps.values())}
        with tqdm(**size, desc=f"train {experiment}", unit="epoch") as bar:
            tasks = {task: (workspace, values, experiment, *task, folder) for task, folder in folders.items()}
            for (model, protocol, seed), taken in workers.run(train_run, tasks, bar, steps=steps, folders=folders):
                seconds[model][protocol, seed] = taken
                _write_times(drafts[model] / "times.csv", seconds[model])
    for model, origin in origins.items():
        _write_times(workspace.training_times(experiment, model), {run: seconds[model][run] for run in runs})
        _finish(drafts[model], workspace.model_folder(experiment, model), origin)


def remove_others(workspace: Workspace, experiment: str, models: Collection[str]) -> None:
    """Remove the folders and training times of models that are not among `models`."""
    kept = {path(experiment, model) for model in models for path in (workspace.model_folder, workspace.training_times)}
    for place in {path.parent for path in kept}:
        for path in set(place.iterdir()) - kept:
            if path.is_dir():
                files.remove_folder(path, inside=place)
            else:
                path.unlink()


def origin(settings: object, inputs: Iterable[Path]) -> str:
    """Return a digest of all that the runs of a model are made from: settings, and files of data and code."""
    digest = hashlib.sha256(json.dumps(settings, sort_keys=True).encode())
    for path in inputs:
        digest.update(bytes.fromhex(files.sha256(path)))
    return digest.hexdigest()


def _is_kept(workspace: Workspace, experiment: str, model: str, origin: str) -> bool:
    """Tell whether a model's folder is of this origin and as it was written, and has its times; remove its draft."""
    folder = workspace.model_folder(experiment, model)
    mark = folder / ORIGIN
    if not (mark.is_file() and workspace.training_times(experiment, model).is_file()):
        return False
    if mark.read_bytes() != _mark(folder, origin).encode():
        return False
    draft = workspace.model_draft(experiment, model)
    files.remove_folder(draft, inside=draft.parent)
    return True


def _mark(folder: Path, origin: str) -> str:
    """Return what stands in ORIGIN of a folder of runs: its origin, and a digest of the runs' files."""
    digest = hashlib.sha256()
    for path in sorted(folder.rglob("*")):
        if path.parent != folder and path.is_file():
            digest.update(path.relative_to(folder).as_posix().encode() + bytes.fromhex(files.sha256(path)))
    return f"made from {origin}\nfiles {digest.hexdigest()}\n"


def _begin(draft: Path, origin: str) -> dict[tuple[str, int], float]:
    """Return the seconds of runs that a stopped call finished from the same origin; remove all else from the draft."""
    mark, times, seconds = draft / ORIGIN, draft / "times.csv", {}
    if not mark.is_file() or mark.read_text(encoding="utf-8") != origin:
        files.remove_folder(draft, inside=draft.parent)
        files.write_text(mark, origin)
    if times.is_file():
        with open(times, newline="", encoding="utf-8") as file:
            seconds = {(row["protocol"], int(row["seed"])): float(row["train_s"]) for row in csv.DictReader(file)}
    finished = {_folder(draft, run) for run in seconds}
    (draft / "runs").mkdir(parents=True, exist_ok=True)
    for folder in (draft / "runs").iterdir():
        if folder not in finished:
            files.remove_folder(folder, inside=draft)
    return seconds


def _folder(draft: Path, run: tuple[str, int]) -> Path:
    """Return the folder of a run (protocol, seed) in a model's draft."""
    return draft / "runs" / f"{run[0]}-{run[1]}"


def _finish(draft: Path, target: Path, origin: str) -> None:
    """Make the complete draft of a model its folder."""
    files.write_text(draft / "runs" / ORIGIN, _mark(draft / "runs", origin))
    target.parent.mkdir(parents=True, exist_ok=True)
    files.put_folder(draft / "runs", target)
    files.remove_folder(draft, inside=draft.parent)


def _write_times(path: Path, seconds: Mapping[tuple[str, int], float]) -> None:
    """Write the seconds of each run as CSV."""
    files.write_csv(path, TIMES, [(*run, taken) for run, taken in seconds.items()])
