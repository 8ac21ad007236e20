"""Name the size ladders, and read the table of their runs that studies write; strain's is that of its latent space."""

from typing import NamedTuple

import pandas as pd

from pipeline.base.paths import Workspace
from pipeline.scoring import studies

COLUMNS = ("experiment", "condition", "family", "size", "params", "metric", "unit", "seed", "value", "macs")
METRIC = {"touch": "rmse", "strain": "error", "glove": "macro_precision"}  # of each experiment's ladders


class Family(NamedTuple):
    """One way to make a model larger; `model` is its key in params.yaml."""

    experiment: str
    model: str


FAMILIES = {
    "lomp": Family("touch", "lomp"),  # hidden units
    "window": Family("touch", "cnn"),  # frames of a window that the model sees
    "lstm": Family("strain", "lstm_direct"),  # units
    "sp_resnet": Family("glove", "sp_resnet"),  # channels, as a share of the published ones
}


def read(workspace: Workspace, experiment: str) -> pd.DataFrame:
    """Return the runs of an experiment's ladders, columns COLUMNS; without a row where none was computed."""
    if experiment != "strain":
        return studies.read(workspace, experiment, "sizes", COLUMNS)
    columns = ["protocol", "units", "params", "macs", "seed", "metric", "unit", "value"]
    table = studies.read(workspace, experiment, "capacity", columns).rename(
        columns={"protocol": "condition", "units": "size"}
    )
    return table.assign(experiment=experiment, family="lstm")[list(COLUMNS)]


def protocol(experiment: str, condition: str) -> str:
    """Return the protocol of the experiment's main table under which a condition is trained and tested."""
    return {"touch": "press", "glove": f"session_{condition}"}.get(experiment, condition)
