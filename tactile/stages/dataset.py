"""Write the dataset: windows, series or images with labels and, for every run, the part each row belongs to.

Usage: python -m tactile.stages.dataset EXPERIMENT
"""

from tactile import tasks
from tactile.base import arguments, params
from tactile.base.paths import Workspace


def main(workspace: Workspace) -> None:
    """Label and split the data of the experiment named on the command line."""
    values = params.load(workspace.params)
    experiment = arguments.parse(__doc__, experiment=values["experiments"]).experiment
    inputs, runs = tasks.of(experiment).source(workspace, experiment), params.runs(values, experiment)
    counts = tasks.write_dataset(workspace.dataset(experiment), experiment, inputs, values[experiment], runs)
    print(*counts, sep="\n")


if __name__ == "__main__":
    arguments.run(main)
