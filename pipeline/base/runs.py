"""Train all runs of one model in parallel, into a folder that appears once it is complete."""

import csv
import hashlib
import json
from collections.abc import Callable, Collection, Mapping
from pathlib import Path

from tqdm import tqdm

from pipeline.base import files, params, paths, workers
from pipeline.base.availability import why_not_run

TIMES = ("protocol", "seed", "train_s")


def train_all(
    train_run: Callable[..., float],
    values: Mapping,
    experiment: str,
    model: str,
    *,
    into: str | None = None,
    protocols: Collection[str] | None = None,
) -> None:
    """Call `train_run(values, experiment, model, protocol, seed, folder, report)` for every run of params.yaml.

    `train_run` writes the run's files to the new `folder`, calls `report` once per epoch and returns the seconds that
    fitting took. A progress bar goes over all epochs of all runs. Without recordings the model's folder is empty.
    The folder of an earlier training stays until this one is complete. Where this one is stopped, its finished runs
    are kept in the model's draft, and the next call with the same settings, data and code goes on from them.
    `values`: params.yaml; `into`: another name for the folder; `protocols`: only these, in place of all.
    """
    name = into or model
    block = params.model_settings(values, experiment, model)
    target, draft = paths.model_folder(experiment, name), paths.model_draft(experiment, name)
    wanted = params.runs(values, experiment) if why_not_run(experiment) is None else []
    wanted = [run for run in wanted if protocols is None or run[0] in protocols]
    seconds = _begin(draft, _origin(values, experiment, name) if wanted else "")
    epochs = block.get("training", {}).get("epochs", 1)
    folders = {run: draft / "runs" / f"{run[0]}-{run[1]}" for run in wanted if run not in seconds}
    if folders:
        bar_size = {"total": epochs * len(wanted), "initial": epochs * (len(wanted) - len(folders))}
        with tqdm(**bar_size, desc=f"train {experiment} {name}", unit="epoch") as bar:
            tasks = {run: (values, experiment, model, *run, folder) for run, folder in folders.items()}
            for run, taken in workers.run(train_run, tasks, bar, steps=epochs, folders=folders):
                seconds[run] = taken
                _write_times(draft / "times.csv", seconds)
    _write_times(paths.training_times(experiment, name), {run: seconds[run] for run in wanted})
    files.remove_folder(target, inside=target.parent)
    target.parent.mkdir(parents=True, exist_ok=True)
    (draft / "runs").rename(target)
    files.remove_folder(draft, inside=draft.parent)


def _origin(values: Mapping, experiment: str, name: str) -> str:
    """Return a digest of all that the runs of a model are made from: settings, code and data."""
    digest = hashlib.sha256(json.dumps([values["device"], values[experiment]], sort_keys=True).encode())
    inputs = [paths.dataset(experiment), *sorted((paths.ROOT / "pipeline").rglob("*.py"))]
    if name != paths.MODEL_ZERO:
        inputs += sorted(paths.model_folder(experiment, paths.MODEL_ZERO).rglob("*.safetensors"))
    for path in inputs:
        if path.is_file():
            with open(path, "rb") as file:
                digest.update(hashlib.file_digest(file, "sha256").digest())
    return digest.hexdigest()


def _begin(draft: Path, origin: str) -> dict[tuple[str, int], float]:
    """Return the seconds of runs that a stopped call finished from the same origin; remove all else from the draft."""
    mark, times, seconds = draft / "origin.txt", draft / "times.csv", {}
    if not mark.is_file() or mark.read_text(encoding="utf-8") != origin:
        files.remove_folder(draft, inside=draft.parent)
        files.write_text(mark, origin)
    if times.is_file():
        with open(times, newline="", encoding="utf-8") as file:
            seconds = {(row["protocol"], int(row["seed"])): float(row["train_s"]) for row in csv.DictReader(file)}
    (draft / "runs").mkdir(parents=True, exist_ok=True)
    for folder in (draft / "runs").iterdir():
        if folder.name not in {f"{protocol}-{seed}" for protocol, seed in seconds}:
            files.remove_folder(folder, inside=draft)
    return seconds


def _write_times(path: Path, seconds: Mapping[tuple[str, int], float]) -> None:
    """Write the seconds of each run as CSV."""
    files.write_csv(path, TIMES, [(*run, taken) for run, taken in seconds.items()])
