"""Train an experiment's models as for the look, and measure how long their predictions take.

The time of a prediction does not depend on how long a network was trained. Nothing else should run on the machine.
Usage: python -m pipeline.studies.latency EXPERIMENT SEED
"""

from pipeline.base import arguments, files, modules, params
from pipeline.base.paths import Workspace
from pipeline.scoring.times import LATENCY


def main(workspace: Workspace) -> None:
    """Time the models of the experiment named on the command line."""
    values = params.load(workspace.params)
    seeds = sorted({seed for name in values["experiments"] for _, seed in params.runs(values, name)})
    given = arguments.parse(__doc__, experiment=values["experiments"], seed=tuple(map(str, seeds)))
    for stage in ("train", "latency"):
        modules.run(workspace.root, f"pipeline.stages.{stage}", given.experiment)
    measured = workspace.latency(given.experiment).read_text(encoding="utf-8")
    files.write_text(workspace.study_result(given.experiment, LATENCY), measured)


if __name__ == "__main__":
    arguments.run(main)
