"""Collect scores, latencies, stress and claims' inputs of all experiments in one file each, in full precision.

Each row of scores.csv says the scale of its experiment (`params.scale_of`).
Usage: python -m pipeline.stages.collect
"""

from collections.abc import Sequence
from pathlib import Path

import pandas as pd

from pipeline.base import arguments, files, params, paths
from pipeline.base.errors import InputError, run_stage
from pipeline.scoring import claim_inputs

# Of reports/stress.csv: what others read first.
STRESS = ("experiment", "model", "seed", "perturbation", "severity", "metric", "unit", "value", "protocol", "condition")


def collect(parts: list[Path], target: Path, first: Sequence[str] = (), scales: Sequence[str] = ()) -> None:
    """Write the rows of all `parts` (CSV files with one header) to `target`, digit for digit.

    first: columns that come first, in this order, the others after them as they are. scales: the last column, `scale`,
    of each part; none where there are no scales.
    """
    tables = [pd.read_csv(paths.require(part, "dvc repro"), dtype=str, keep_default_na=False) for part in parts]
    for part, table in zip(parts, tables, strict=True):
        if list(table.columns) != list(tables[0].columns):
            raise InputError(f"{part}: its columns differ from those of {parts[0]}; run `dvc repro` again")
    if scales:
        tables = [table.assign(scale=scale) for table, scale in zip(tables, scales, strict=True)]
    together = pd.concat(tables)
    order = [*first, *(column for column in together.columns if column not in first)]
    files.write_table(target, together[order])


def main() -> None:
    """Collect every experiment of params.yaml."""
    arguments.parse(__doc__)
    values = params.load()
    experiments = values["experiments"]
    scales = [params.scale_of(name, values[name]) for name in experiments]
    collect([paths.scores(name) for name in experiments], paths.REPORTS / "scores.csv", scales=scales)
    collect([paths.latency(name) for name in experiments], paths.REPORTS / "latency.csv")
    collect([paths.stress(name) for name in experiments], paths.REPORTS / "stress.csv", STRESS)
    derived = [paths.claim_inputs(name) for name in experiments if name in claim_inputs.EXPERIMENTS]
    if derived:
        collect(derived, paths.REPORTS / "claim_inputs.csv")


if __name__ == "__main__":
    run_stage(main)
