"""Collect scores, latencies, stress and claims' inputs of all experiments in one file each, in full precision.

Of an experiment without recordings the committed rows stay. Scores are of the budget `look`.
Usage: python -m pipeline.stages.collect
"""

from collections.abc import Mapping, Sequence
from pathlib import Path

import pandas as pd

from pipeline.base import arguments, files, foreign, params, paths
from pipeline.base.errors import InputError
from pipeline.base.paths import Workspace
from pipeline.experiments import facts
from pipeline.scoring.claim_inputs import LOOK
from pipeline.scoring.results import kept_rows

# Of reports/stress.csv: what others read first.
STRESS = ("experiment", "model", "seed", "perturbation", "severity", "metric", "unit", "value", "protocol", "condition")


def collect(parts: Mapping[str, Path], target: Path, first: Sequence[str] = (), budget: str = "") -> None:
    """Write the rows of all `parts` (experiment -> CSV file, all with one header) to `target`, digit for digit.

    A part without a row, of an experiment that was not run, gets the rows that `target` has of it. first: columns that
    come first, in this order, the others after them as they are. budget: of all rows, the last column, if there is one.
    """
    tables = {}
    for name, part in parts.items():
        with foreign.reading(paths.require(part, "dvc repro"), "a CSV table", "run `dvc repro` again"):
            tables[name] = pd.read_csv(part, dtype=str, keep_default_na=False)
    columns = list(next(iter(tables.values())))
    for name, table in tables.items():
        if list(table.columns) != columns:
            raise InputError(f"{parts[name]}: its columns differ from those of the others; run `dvc repro` again")
    if budget:
        tables = {name: table.assign(budget=budget) for name, table in tables.items()}
    kept = kept_rows(target, [name for name, table in tables.items() if table.empty], text=True)
    columns = list(next(iter(tables.values())))
    if set(kept) >= set(columns):
        tables = {name: table if len(table) else kept[kept["experiment"] == name] for name, table in tables.items()}
    together = pd.concat(tables.values())[columns]
    order = [*first, *(column for column in together.columns if column not in first)]
    files.write_table(target, together[order])


def main(workspace: Workspace) -> None:
    """Collect every experiment of the settings."""
    arguments.parse(__doc__)
    experiments = params.load(workspace.params)["experiments"]
    collect({name: workspace.scores(name) for name in experiments}, workspace.reports / "scores.csv", budget=LOOK)
    collect({name: workspace.latency(name) for name in experiments}, workspace.reports / "latency.csv")
    collect({name: workspace.stress(name) for name in experiments}, workspace.reports / "stress.csv", STRESS)
    derived = {name: workspace.claim_inputs(name) for name in experiments if facts(name).paper}
    if derived:
        collect(derived, workspace.reports / "claim_inputs.csv")


if __name__ == "__main__":
    arguments.run(main)
