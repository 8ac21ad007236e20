"""Write the few numbers that `dvc metrics` shows: one JSON file per experiment, and one of the verdicts.

reports/metrics/EXPERIMENT.json: panel -> model -> mean error on the test part (its name and unit are the key), median
time of one prediction in ms, and training seconds, from reports/EXPERIMENT/speed/table2.csv; empty for an experiment
without recordings. reports/metrics/verdicts.json: data -> paper -> verdict -> number of claims, of claims.csv.
Usage: python -m pipeline.stages.metrics
"""

import json
import math
from collections.abc import Mapping
from pathlib import Path

import pandas as pd

from pipeline.base import arguments, files, params, paths
from pipeline.base.paths import Workspace
from pipeline.claims.rules import VERDICTS
from pipeline.reporting.claims import COUNTED

TIMES = {"p50_ms": "prediction (ms)", "train_s": "training (s)"}  # columns of table2.csv and their names


def of_experiment(table: pd.DataFrame) -> dict:
    """Return panel -> model -> name of a number -> number; table: table2.csv. What is not finite is left out."""
    numbers: dict[str, dict[str, dict[str, float]]] = {}
    for row in table.to_dict("records"):
        values = {row["measure"]: row["error"]} | {name: row[column] for column, name in TIMES.items()}
        finite = {name: float(f"{value:.6g}") for name, value in values.items() if math.isfinite(value)}
        numbers.setdefault(row["panel"], {})[row["model"]] = finite
    return numbers


def of_claims(claims: pd.DataFrame) -> dict:
    """Return data -> paper -> verdict -> number of claims; claims: claims.csv."""
    counts = claims[claims["kind"].isin(COUNTED)].groupby(["data", "paper"])["verdict"].value_counts()
    numbers: dict[str, dict[str, dict[str, int]]] = {}
    for (data, paper), verdicts in counts.groupby(level=["data", "paper"]):
        number = verdicts.droplevel(["data", "paper"])
        numbers.setdefault(data, {})[paper] = {verdict: int(number.get(verdict, 0)) for verdict in VERDICTS}
    return numbers


def write(path: Path, numbers: Mapping) -> None:
    """Write numbers as JSON."""
    files.write_text(path, json.dumps(numbers, indent=1) + "\n")


def main(workspace: Workspace) -> None:
    """Write the numbers of every experiment of the settings."""
    arguments.parse(__doc__)
    for experiment in params.load(workspace.params)["experiments"]:
        table = workspace.reports / experiment / "speed" / "table2.csv"
        numbers = of_experiment(pd.read_csv(table)) if table.exists() else {}
        write(workspace.reports / "metrics" / f"{experiment}.json", numbers)
    claims = pd.read_csv(paths.require(workspace.reports / "claims.csv", "dvc repro"))
    write(workspace.reports / "metrics" / "verdicts.json", of_claims(claims))


if __name__ == "__main__":
    arguments.run(main)
