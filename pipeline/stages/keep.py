"""Keep what figures draw of the predictions that the stage `evaluate` wrote.

Usage: python -m pipeline.stages.keep EXPERIMENT
"""

from pipeline.results import kept
from tactile.base import arguments, params
from tactile.base.availability import why_not_run
from tactile.base.paths import Workspace


def main(workspace: Workspace) -> None:
    """Keep what is drawn of the experiment named on the command line."""
    values = params.load(workspace.params)
    experiment = arguments.parse(__doc__, experiment=values["experiments"]).experiment
    run = why_not_run(workspace, experiment) is None
    rows = kept.table(workspace, experiment, values[experiment]) if run else kept.none(experiment)
    kept.write(workspace.kept(experiment), rows)


if __name__ == "__main__":
    arguments.run(main)
