"""Stage: the scores and latencies of all experiments in one file each, in full precision, for others to read.

Usage: python -m pipeline.collect
"""

import os
from pathlib import Path

import pandas as pd

from pipeline import params, paths
from pipeline.errors import InputError, run_stage


def collect(parts: list[Path], target: Path) -> None:
    """Write the rows of all `parts` (CSV files with one header) to `target`, digit for digit."""
    tables = [pd.read_csv(paths.require(part, "dvc repro"), dtype=str, keep_default_na=False) for part in parts]
    for part, table in zip(parts, tables, strict=True):
        if list(table.columns) != list(tables[0].columns):
            raise InputError(f"{part}: its columns differ from those of {parts[0]}; run `dvc repro` again")
    target.parent.mkdir(parents=True, exist_ok=True)
    draft = target.with_name(target.name + ".unfinished")
    pd.concat(tables).to_csv(draft, index=False, lineterminator="\n")
    os.replace(draft, target)


def main() -> None:
    """Collect every experiment of params.yaml."""
    experiments = params.load()["experiments"]
    collect([paths.scores(name) for name in experiments], paths.REPORTS / "scores.csv")
    collect([paths.latency(name) for name in experiments], paths.REPORTS / "latency.csv")


if __name__ == "__main__":
    run_stage(main)
