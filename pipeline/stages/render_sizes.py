"""Judge the size ladders of all experiments: reports/rightsize.csv, and reports/rightsize for people.

Usage: python -m pipeline.stages.render_sizes
"""

from pipeline.base import arguments, files, params, paths
from pipeline.base.errors import run_stage
from pipeline.reporting import sizes


def main() -> None:
    """Judge and render all ladders; reports/rightsize is replaced whole."""
    arguments.parse(__doc__)
    with files.replacing_folder(paths.REPORTS / "rightsize") as draft:
        judged = sizes.write(params.load(), draft)
    sizes.write_csv(paths.REPORTS / "rightsize.csv", judged)


if __name__ == "__main__":
    run_stage(main)
