"""Compare recordings with their simulated scenes for people: reports/twins.csv and reports/twins.

Usage: python -m pipeline.stages.render_twins
"""

from pipeline.base import arguments, files
from pipeline.base.paths import Workspace
from pipeline.reporting import twins


def main(workspace: Workspace) -> None:
    """Render all three comparisons; reports/twins is replaced whole."""
    arguments.parse(__doc__)
    target = workspace.reports / "twins"
    with files.replacing_folder(target) as draft:
        summary = twins.write(workspace, draft, former=target)
    files.write_table(workspace.reports / "twins.csv", summary)
    within = summary["inside"].dropna()
    print(f"reports/twins: {int(within.sum())} of {len(within)} simulated values lie in the recorded range")


if __name__ == "__main__":
    arguments.run(main)
