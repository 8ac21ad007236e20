"""Write the stability tests of all experiments for people, in reports/stability.

Usage: python -m pipeline.stages.render_stability
"""

from pipeline.base import arguments, files, params, paths
from pipeline.base.errors import run_stage
from pipeline.reporting import stability


def main() -> None:
    """Render all experiments of the settings; the folder in reports/ is replaced whole, but for what was not run."""
    arguments.parse(__doc__)
    target = paths.REPORTS / "stability"
    with files.replacing_folder(target) as draft:
        stability.write(params.load(), draft, former=target)
    print(f"reports/stability: {sum(path.is_file() for path in target.rglob('*'))} files")


if __name__ == "__main__":
    run_stage(main)
