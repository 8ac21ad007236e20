"""Read the studies of the latent space, and how errors on strain sensors change with time since training.

Those of the number of samples, of strands, of units and of the task that transfer starts from are variants.
"""

from collections.abc import Mapping

import numpy as np
import pandas as pd
import pyarrow as pa

from pipeline.base.paths import Workspace
from pipeline.datasets import schemas
from pipeline.scoring import studies
from pipeline.scoring.results import read_csv, read_predictions

LATENT = "latent of model-0"  # an input of the decoders, in drift.csv
STUDIES = {  # table -> the columns that say what differs between its rows, beside the seed
    "samples": ["protocol", "model", "samples"],
    "drift": ["protocol", "input", "target"],
    "capacity": ["protocol", "units", "params", "macs"],
    "strands": ["protocol", "strands", "model"],
    "bases": ["protocol", "base", "model"],
}
TIME_BINS = 10  # of the test part


def read_study(workspace: Workspace, rows: pd.DataFrame, name: str) -> pd.DataFrame:
    """Return a study of STUDIES as its table in the report has it, without a row where it was not computed.

    rows: of the one table.
    """
    if name == "drift":
        return studies.read(workspace, "strain", name, ["protocol", "seed", "value"])
    if name == "capacity":
        table = studies.ladders(rows, "strain").rename(columns={"condition": "protocol", "size": "units"})
    else:
        column = {"bases": "base"}.get(name, name)
        table = studies.rungs(rows[rows["metric"] == "error"], "strain", column)
        table = table if column == "base" else table.astype({column: int})
    table = table[[*STUDIES[name], "seed", "metric", "unit", "value"]]
    return table.sort_values(["seed", *STUDIES[name]], key=lambda values: values.astype(str), ignore_index=True)


def read_latents(workspace: Workspace) -> pd.DataFrame:
    """Read t_s and the states of the first model-0 on task 2; without a row where they were not computed."""
    first = workspace.study("strain", "latents")[:1]
    return read_csv(first[0], ["t_s"], studies.MADE_BY) if first else pd.DataFrame(columns=["t_s"])


def mean_error(truth: np.ndarray, guess: np.ndarray) -> float:
    """Return the mean distance in mm over the predicted outputs; truth, guess: (n, 3), NaN where not predicted."""
    asked = np.isfinite(guess).any(axis=0)
    return float(np.linalg.norm((guess - truth)[:, asked], axis=1).mean())


def tested_rows(table: pa.Table, task: str, seed: int) -> np.ndarray:
    """Return the rows of the dataset that one seed of a task tests on."""
    return np.flatnonzero(schemas.names(table[schemas.split_column(task, seed)]) == "test")


def errors_by_time(workspace: Workspace, settings: Mapping, table: pa.Table, task: str, model: str) -> np.ndarray:
    """Return the mean error in mm, (seeds, TIME_BINS), in equal parts of the test part, in the order of time."""
    truth, errors = schemas.matrix(table["y"]), []
    for seed in settings["protocols"][task]["seeds"]:
        predicted = read_predictions(workspace, "strain", model, task, seed, table)
        parts = np.array_split(tested_rows(table, task, seed), TIME_BINS)
        errors.append([mean_error(truth[part], predicted[part]) for part in parts])
    return np.array(errors)
