"""All runs of one model, trained in parallel into a folder that appears once it is complete."""

import json
import shutil
from collections.abc import Callable, Collection, Mapping
from pathlib import Path

from tqdm import tqdm

from pipeline import files, params, paths, workers
from pipeline.availability import why_not_run


def train_all(
    train_run: Callable[..., float],
    experiment: str,
    model: str,
    *,
    into: str | None = None,
    protocols: Collection[str] | None = None,
) -> None:
    """Call `train_run(experiment, model, protocol, seed, folder, report)` for every run of params.yaml.

    It writes the run's files to the new `folder`, calls `report` once an epoch and returns the seconds that
    fitting took. A progress bar goes over all epochs of all runs. Without recordings the model's folder is empty.
    `into`: another name for the folder; `protocols`: only these, in place of all.
    """
    name = into or model
    values = params.load()
    block = params.model_settings(values, experiment, model)
    target, times, draft = (
        place(experiment, name) for place in (paths.model_folder, paths.training_times, paths.model_draft)
    )
    for folder in (draft, target):
        shutil.rmtree(folder, ignore_errors=True)
    runs = params.runs(values, experiment) if why_not_run(experiment) is None else []
    runs = [run for run in runs if protocols is None or run[0] in protocols]
    draft.mkdir(parents=True)
    seconds = {}
    if runs:
        epochs = block.get("training", {}).get("max_epochs", 1)
        with tqdm(total=epochs * len(runs), desc=f"train {experiment} {name}", unit="epoch") as bar:
            tasks = {
                (protocol, seed): (experiment, model, protocol, seed, draft / f"{protocol}-{seed}")
                for protocol, seed in runs
            }
            folders = {key: arguments[-1] for key, arguments in tasks.items()}
            for key, result in workers.run(train_run, tasks, bar, steps=epochs, folders=folders):
                seconds[key] = result
    files.write_csv(times, ["protocol", "seed", "train_s"], [(*run, seconds[run]) for run in runs])
    target.parent.mkdir(parents=True, exist_ok=True)
    draft.rename(target)


def save(target: Path, regressor, history: list[dict], settings: Mapping) -> None:
    """Write a fitted run to the new folder `target`: the model's own files, history.csv and fit.json.

    history: a dictionary an epoch, losses in the label's unit squared (images: cross-entropy); settings: the
    model's block of params.yaml.
    """
    target.mkdir(parents=True)
    regressor.save(target)
    columns = list(history[0])
    files.write_csv(target / "history.csv", columns, ([epoch[name] for name in columns] for epoch in history))
    fit = {
        "stop_reason": regressor.summary.stop_reason,
        "best_epoch": regressor.summary.best_epoch,
        "epochs": len(history),
        "parameters": regressor.parameters(),
        "macs": regressor.macs(),
        "settings": settings,
    }
    files.write_text(target / "fit.json", json.dumps(fit, indent=1) + "\n")
