"""Train an experiment's models as for the look, and measure how long their predictions take.

The time of a prediction does not depend on how long a network was trained. Nothing else should run on the machine.
Usage: python -m pipeline.studies.latency EXPERIMENT SEED
"""

from pipeline.base import arguments, files, modules, params
from pipeline.base.paths import Workspace
from pipeline.results.times import LATENCY


def main(workspace: Workspace) -> None:
    """Time the models of the experiment named on the command line."""
    values = params.load(workspace.params)
    experiment, _ = arguments.of_study(__doc__, values["experiments"])
    for stage in ("train", "latency"):
        modules.run(workspace.root, f"pipeline.stages.{stage}", experiment)
    measured = workspace.latency(experiment).read_text(encoding="utf-8")
    files.write_text(workspace.study_result(experiment, LATENCY), measured)


if __name__ == "__main__":
    arguments.run(main)
