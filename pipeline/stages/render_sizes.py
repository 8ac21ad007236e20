"""Judge the size ladders of all experiments: reports/rightsize.csv, and reports/rightsize for people.

Usage: python -m pipeline.stages.render_sizes
"""

from pipeline.base import arguments, files, params
from pipeline.base.paths import Workspace
from pipeline.reporting import sizes


def main(workspace: Workspace) -> None:
    """Judge and render all ladders; reports/rightsize is replaced whole."""
    arguments.parse(__doc__)
    with files.replacing_folder(workspace.reports / "rightsize") as draft:
        judged = sizes.write(workspace, params.load(workspace.params), draft)
    sizes.write_csv(workspace.reports / "rightsize.csv", judged)


if __name__ == "__main__":
    arguments.run(main)
