"""Write the dataset: windows, series or images with labels and, for every run, the part each row belongs to.

Usage: python -m pipeline.stages.dataset EXPERIMENT
"""

from pipeline import tasks
from pipeline.base import arguments, params, paths
from pipeline.base.errors import run_stage


def main() -> None:
    """Label and split the data of the experiment named on the command line."""
    values = params.load()
    experiment = arguments.parse(__doc__, experiment=values["experiments"]).experiment
    inputs, runs = tasks.of(experiment).source(experiment), params.runs(values, experiment)
    counts = tasks.write_dataset(paths.dataset(experiment), experiment, inputs, values[experiment], runs)
    print(*counts, sep="\n")


if __name__ == "__main__":
    run_stage(main)
