"""Judge what the effects of the simulated scenes change: reports/physics.csv and reports/physics.

Usage: python -m pipeline.stages.render_physics
"""

from pipeline.base import arguments, files, params
from pipeline.base.paths import Workspace
from pipeline.reporting import physics
from pipeline.reporting.verdicts.physics import EQUIVALENT


def main(workspace: Workspace) -> None:
    """Judge and render all experiments; reports/physics is replaced whole."""
    arguments.parse(__doc__)
    with files.replacing_folder(workspace.reports / "physics") as draft:
        judged = physics.write(workspace, params.load(workspace.params), draft)
    files.write_table(workspace.reports / "physics.csv", judged)
    for experiment, effects in judged.groupby("experiment", sort=False):
        equivalent = effects[effects["verdict"] == EQUIVALENT]["effect"].unique()
        print(f"{experiment}: equivalent to their absence: {', '.join(equivalent) or 'none'}")


if __name__ == "__main__":
    arguments.run(main)
