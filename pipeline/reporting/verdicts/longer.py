"""Read how much a longer training by the same recipe changes the validation error of a network: `tactile longer`."""

from pathlib import Path

import pandas as pd

from pipeline.base import paths
from pipeline.scoring.results import PLAIN, R2, read_csv, scale_of

ENDED = 0.01  # a longer training changes the error of one that has ended by less, as a share of it
COLUMNS = ["protocol", "model", "seed", "epochs", "error", "longer_epochs", "longer_error", "seconds"]
PLACE = ["protocol", "model", "epochs", "longer_epochs"]


def path(experiment: str) -> Path:
    """Return where the trainings of an experiment are: one row per run, of COLUMNS."""
    return paths.REPORTS / "longer" / f"{experiment}.csv"


def read(experiment: str) -> pd.DataFrame:
    """Return the trainings of an experiment; no row where none was made."""
    if not path(experiment).exists():
        return pd.DataFrame(columns=COLUMNS)
    return read_csv(path(experiment), COLUMNS, f"tactile longer {experiment}")


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
