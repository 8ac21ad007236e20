"""How one run was trained: fit.json and history.csv in the run's folder, beside the model's own files."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Protocol

from tactile.base import files, foreign, params, paths
from tactile.base.errors import InputError

KEYS = ("stop_reason", "best_epoch", "epochs", "parameters", "macs", "precision", "settings")


class Summary(Protocol):
    """How a fit ended."""

    @property
    def stop_reason(self) -> str: ...
    @property
    def best_epoch(self) -> int: ...


class Fitted(Protocol):
    """What is asked of a fitted model; one of products in a format that can be chosen has `precision`, too."""

    @property
    def summary(self) -> Summary: ...
    def parameters(self) -> int: ...
    def macs(self) -> int: ...


def write(folder: Path, model: Fitted, history: Sequence[Mapping], settings: Mapping) -> None:
    """Write both files of a fitted model.

    history: one dictionary per epoch, losses in the label's unit squared (images: cross-entropy); settings: the
    model's block of settings. `precision` is that of products in training, null for a model that cannot choose it.
    """
    columns = list(history[0])
    files.write_csv(folder / "history.csv", columns, ([epoch[name] for name in columns] for epoch in history))
    summary = model.summary.stop_reason, model.summary.best_epoch, len(history)
    counts = model.parameters(), model.macs(), getattr(model, "precision", None)
    fit = dict(zip(KEYS, (*summary, *counts, settings), strict=True))
    files.write_text(folder / "fit.json", json.dumps(fit, indent=1) + "\n")


def read(folder: Path, made_by: str) -> dict:
    """Return fit.json as a dictionary that has KEYS; InputError where it is missing or broken.

    made_by: the command that trains the run.
    """
    path = paths.require(folder / "fit.json", made_by)
    with foreign.reading(path, "a summary of a training", f"run `{made_by}` again"):
        fit = json.loads(path.read_text(encoding="utf-8"))
        absent = [key for key in KEYS if key not in fit]
        fit = dict(fit)
    if absent:
        raise InputError(f"{path}: key '{absent[0]}' is missing; run `{made_by}` again")
    return fit


def read_as_set(folder: Path, values: Mapping, experiment: str, model: str, protocol: str) -> dict:
    """Return fit.json as `read`; InputError, too, where its settings are not those of params.yaml (`values`)."""
    made_by = params.training_command(experiment)
    fit = read(folder, made_by)
    if fit["settings"] != params.run_settings(values, experiment, model, protocol):
        raise InputError(
            f"{folder / 'fit.json'}: was made with other settings than {experiment}.models.{model} of "
            f"{params.file_of(experiment)}; run `{made_by}`"
        )
    return fit
