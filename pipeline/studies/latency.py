"""Train an experiment's models as for the look, and measure how long their predictions take.

The time of a prediction does not depend on how long a network was trained. Nothing else should run on the machine.
Usage: python -m pipeline.studies.latency EXPERIMENT SEED
"""

from pipeline.results.times import LATENCY
from tactile.base import arguments, files, modules, params
from tactile.base.paths import Workspace


def main(workspace: Workspace) -> None:
    """Time the models of the experiment named on the command line."""
    values = params.load(workspace.params)
    experiment, _ = arguments.of_study(__doc__, values["experiments"])
    for stage in ("tactile.stages.train", "pipeline.stages.latency"):
        modules.run(workspace.root, stage, experiment)
    measured = workspace.latency(experiment).read_text(encoding="utf-8")
    files.write_text(workspace.study_result(experiment, LATENCY), measured)


if __name__ == "__main__":
    arguments.run(main)
