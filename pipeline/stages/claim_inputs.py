"""Derive from predictions of one experiment the numbers that claims need beside scores, times and counts.

Writes data/<experiment>/claim_inputs.csv, rows of the one table of results.
Usage: python -m pipeline.stages.claim_inputs EXPERIMENT
"""

from pipeline.results import claim_inputs
from tactile import experiments
from tactile.base import arguments, files, params
from tactile.base.paths import Workspace


def main(workspace: Workspace) -> None:
    """Derive the numbers of the experiment named on the command line."""
    experiment = arguments.parse(__doc__, experiment=tuple(experiments.having("paper"))).experiment
    table = claim_inputs.rows(workspace, experiment, params.load(workspace.params)[experiment])
    files.write_table(workspace.claim_inputs(experiment), table)
    print(f"{experiment}: {len(table)} numbers")


if __name__ == "__main__":
    arguments.run(main)
