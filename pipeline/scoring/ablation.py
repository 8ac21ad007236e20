"""Read the settings and scores of models with one thing changed, and pair these with what they are compared with."""

from collections.abc import Mapping

import pandas as pd

from pipeline.base.paths import Workspace
from pipeline.scoring.results import Scores, read_csv

METRIC = "rmse"


def read(workspace: Workspace, experiment: str) -> pd.DataFrame:
    """Read ablation.csv: row, condition, seed, metric, value."""
    made_by = f"python -m pipeline.studies.ablation {experiment}"
    return read_csv(workspace.ablation(experiment), ["row", "condition", "seed", "metric", "value"], made_by)


def block_of(settings: Mapping, name: str) -> dict:
    """Return the settings of a row's model: its own, and those of the row beside it."""
    row = settings["ablation"][name]
    beside = row.get("beside", "")
    return (dict(settings["ablation"][beside]["settings"]) if beside else {}) | row["settings"]


def paired(ablation: pd.DataFrame, scores: Scores, settings: Mapping, name: str, condition: str) -> pd.DataFrame:
    """Return a row's error beside that of what it is compared with: columns error, reference; by seed.

    ablation: as `read` gives it; settings: the experiment's block. Empty where the row or the condition was not run.
    """
    chosen = ablation[(ablation["condition"] == condition) & (ablation["metric"] == METRIC)]
    errors = {key: part.set_index("seed")["value"] for key, part in chosen.groupby("row")}
    if name not in errors or name not in settings["ablation"]:
        return pd.DataFrame(columns=["error", "reference"], dtype=float)
    row, (protocol, block) = settings["ablation"][name], next(iter(settings["protocols"].items()))
    if beside := row.get("beside", ""):
        reference = errors[beside]
    else:
        reference = pd.Series(scores.runs(protocol, condition, row["of"], METRIC), index=block["seeds"])
    return pd.DataFrame({"error": errors[name], "reference": reference}).loc[row["seeds"]]
