"""Derive from predictions and studies of one experiment the numbers that claims need beside scores, times and counts.

Writes data/<experiment>/claim_inputs.csv, rows of the one table of results. A study of the evidence that was not
computed has no rows, and this says so.
Usage: python -m pipeline.stages.claim_inputs EXPERIMENT
"""

from pipeline import experiments
from pipeline.base import arguments, files, params
from pipeline.base.paths import Workspace
from pipeline.scoring import claim_inputs


def main(workspace: Workspace) -> None:
    """Derive the numbers of the experiment named on the command line."""
    experiment = arguments.parse(__doc__, experiment=tuple(experiments.having("paper"))).experiment
    table = claim_inputs.rows(workspace, experiment, params.load(workspace.params)[experiment])
    files.write_table(workspace.claim_inputs(experiment), table)
    missing = [name for name in experiments.facts(experiment).studies if not workspace.study(experiment, name)]
    todo = f"; still to be computed with `tactile evidence`: {', '.join(missing)}" if missing else ""
    print(f"{experiment}: {len(table)} numbers{todo}")


if __name__ == "__main__":
    arguments.run(main)
