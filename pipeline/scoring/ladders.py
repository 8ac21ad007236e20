"""Name the size ladders, and the table of their runs that one stage writes and another judges."""

from pathlib import Path
from typing import NamedTuple

from pipeline.base.paths import Workspace

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


def path(workspace: Workspace, experiment: str) -> Path:
    """Return the file of all runs of an experiment's ladders (output of pipeline/studies/sizes.py)."""
    return workspace.experiment_folder(experiment) / "rightsize.csv"


def protocol(experiment: str, condition: str) -> str:
    """Return the protocol of the experiment's main table under which a condition is trained and tested."""
    return {"touch": "press", "glove": f"session_{condition}"}.get(experiment, condition)
