"""Compare recordings with their simulated scenes for people: reports/twins.csv and reports/twins.

Usage: python -m pipeline.stages.render_twins
"""

from pipeline.base import arguments, files, paths
from pipeline.base.errors import run_stage
from pipeline.reporting import twins


def main() -> None:
    """Render all three comparisons; reports/twins is replaced whole."""
    arguments.parse(__doc__)
    target = paths.REPORTS / "twins"
    with files.replacing_folder(target) as draft:
        summary = twins.write(draft, former=target)
    files.write_table(paths.REPORTS / "twins.csv", summary)
    within = summary["inside"].dropna()
    print(f"reports/twins: {int(within.sum())} of {len(within)} simulated values lie in the recorded range")


if __name__ == "__main__":
    run_stage(main)
