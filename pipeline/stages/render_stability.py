"""Write the stability tests of all experiments for people, in reports/stability.

Usage: python -m pipeline.stages.render_stability
"""

from pipeline.base import arguments, files, params
from pipeline.base.paths import Workspace
from pipeline.reporting import stability


def main(workspace: Workspace) -> None:
    """Render all experiments of the settings; the folder in reports/ is replaced whole, but for what was not run."""
    arguments.parse(__doc__)
    target = workspace.reports / "stability"
    with files.replacing_folder(target) as draft:
        stability.write(workspace, params.load(workspace.params), draft, former=target)
    print(f"reports/stability: {sum(path.is_file() for path in target.rglob('*'))} files")


if __name__ == "__main__":
    arguments.run(main)
