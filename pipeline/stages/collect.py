"""Collect scores and times of predictions of all experiments in one file each, in full precision, of the evidence.

reports/scores.csv has every row of the committed shards but those by press or grasp, which stay in evidence/results.
With `look`, the tables that the stages wrote here go to reports/look, with stress and claims' inputs; an experiment
without recordings has no rows there.
Usage: python -m pipeline.stages.collect [look]
"""

from collections.abc import Mapping, Sequence
from pathlib import Path

import pandas as pd

from pipeline.results import shards, times
from pipeline.results.claim_inputs import LOOK
from tactile.base import arguments, files, foreign, params, paths
from tactile.base.errors import InputError
from tactile.base.paths import Workspace
from tactile.experiments import facts
from tactile.scoring import units

# What others read first.
SCORES = ["experiment", "protocol", "condition", "model", "seed", "metric", "unit", "value", "n", "budget", "variant"]
STRESS = ["experiment", "model", "seed", "perturbation", "severity", "metric", "unit", "value", "protocol", "condition"]


def collect(parts: Mapping[str, Path], target: Path, first: Sequence[str] = (), budget: str = "") -> None:
    """Write the rows of all `parts` (experiment -> CSV file, all with one header) to `target`, digit for digit.

    first: columns that come first, in this order, the others after them as they are. budget: of all rows, the last
    column, if there is one.
    """
    tables = []
    for part in parts.values():
        with foreign.reading(paths.require(part, "dvc repro"), "a CSV table", "run `dvc repro` again"):
            tables.append(pd.read_csv(part, dtype=str, keep_default_na=False))
        if list(tables[-1].columns) != list(tables[0].columns):
            raise InputError(f"{part}: its columns differ from those of the others; run `dvc repro` again")
    together = pd.concat(tables)
    together = together.assign(budget=budget) if budget else together
    order = [*first, *(column for column in together.columns if column not in first)]
    files.write_table(target, together[order])


def evidence(workspace: Workspace, experiments: Sequence[str]) -> None:
    """Write scores.csv and latency.csv of these experiments to reports/; a score that does not exist is `nan`."""
    rows = shards.read(workspace)
    rows = rows[rows["experiment"].isin(experiments) & ~rows["metric"].str.endswith(units.SUFFIX)]
    words = dict.fromkeys(("budget", "variant", "protocol"), "")
    scores = rows[SCORES].fillna(words).astype({"seed": "Int64"})
    files.write_table(workspace.reports / "scores.csv", scores, missing="nan")
    timed = pd.concat([times.predictions(workspace, name) for name in experiments])
    files.write_table(workspace.reports / "latency.csv", timed)


def look(workspace: Workspace, experiments: Sequence[str]) -> None:
    """Write what the stages computed here of these experiments to reports/look."""
    target = workspace.look
    collect({name: workspace.scores(name) for name in experiments}, target / "scores.csv", budget=LOOK)
    collect({name: workspace.latency(name) for name in experiments}, target / "latency.csv")
    collect({name: workspace.stress(name) for name in experiments}, target / "stress.csv", STRESS)
    derived = {name: workspace.claim_inputs(name) for name in experiments if facts(name).paper}
    if derived:
        collect(derived, target / "claim_inputs.csv")


def main(workspace: Workspace) -> None:
    """Collect every experiment of the settings."""
    given = arguments.parse(__doc__, of=(LOOK, None))
    (look if given.of == LOOK else evidence)(workspace, params.load(workspace.params)["experiments"])


if __name__ == "__main__":
    arguments.run(main)
