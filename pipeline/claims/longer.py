"""Read how much a longer training by the same recipe changes the validation error of a network: `tactile longer`."""

from collections.abc import Iterable, Mapping
from pathlib import Path

import pandas as pd

from pipeline.base import params
from pipeline.base.paths import Workspace
from pipeline.scoring.results import PLAIN, R2, read_csv, scale_of

ENDED = 0.01  # a longer training changes the error of one that has ended by less, as a share of it
COLUMNS = ["protocol", "model", "seed", "epochs", "error", "longer_epochs", "longer_error", "seconds"]
PLACE = ["protocol", "model", "epochs", "longer_epochs"]
Network = tuple[str, str, str]  # experiment, protocol, model


def path(workspace: Workspace, experiment: str) -> Path:
    """Return where the trainings of an experiment are: one row per run, of COLUMNS."""
    return workspace.reports / "longer" / f"{experiment}.csv"


def read(file: Path) -> pd.DataFrame:
    """Return the trainings of a file; no row where there is no file."""
    return read_csv(file, COLUMNS, f"tactile longer {file.stem}") if file.exists() else pd.DataFrame(columns=COLUMNS)


def with_errors(values: pd.Series, metric: str, factor: float) -> pd.Series:
    """Return values of a metric whose errors are `factor` times as large.

    A share is an error of what is missing to 1; R2 of mean squares, which change by the square of the factor.
    """
    scale = scale_of(metric)
    if scale == PLAIN:
        return factor * values
    return 1 - factor ** (2 if scale == R2 else 1) * (1 - values)


def changes(trainings: pd.DataFrame) -> pd.DataFrame:
    """Return one row per protocol, network and length: mean errors over runs and `change`, the share that longer adds.

    A run that diverged makes the longer error, and with it the change, NaN.
    """
    rows = [
        dict(zip(PLACE, place, strict=True))
        | {"error": runs["error"].mean(), "longer_error": runs["longer_error"].mean(skipna=False), "runs": len(runs)}
        for place, runs in trainings.groupby(PLACE, sort=False)
    ]
    table = pd.DataFrame(rows, columns=[*PLACE, "error", "longer_error", "runs"])
    return table.assign(change=table["longer_error"] / table["error"] - 1)


def unended(networks: Iterable[Network], known: Mapping[str, pd.DataFrame], values: Mapping) -> dict[Network, float]:
    """Return the change of each network whose validation error a longer training lowers by ENDED or more.

    known: experiment -> rows of `changes`; values: params.yaml. Trainings of another protocol of the same experiment
    stand for one that was not trained longer itself; those of other numbers of epochs than params.yaml has say nothing.
    """
    found = {}
    for experiment, protocol, model in networks:
        block = values[experiment]
        trained = "training" in block["models"].get(model, {}) and protocol in block["protocols"]
        if experiment not in known or not trained:
            continue
        table = known[experiment]
        epochs = params.epochs(params.run_settings(values, experiment, model, protocol))
        rows = table[(table["model"] == model) & (table["epochs"] == epochs)]
        here = rows[rows["protocol"] == protocol]
        found[experiment, protocol, model] = float((here if len(here) else rows)["change"].mean())
    return {network: change for network, change in found.items() if change <= -ENDED}
