"""Write the reviewer's page, reports/index.html, from the other reports.

Usage: python -m pipeline.stages.page
"""

from pipeline.base import arguments, files, params
from pipeline.base.paths import Workspace
from pipeline.reporting.page import sections


def main(workspace: Workspace) -> None:
    """Write reports/index.html."""
    arguments.parse(__doc__)
    (workspace.reports / "benchmarks").mkdir(exist_ok=True)
    html = sections.build(workspace, params.load(workspace.params))
    files.write_text(workspace.reports / "index.html", html)
    print(f"reports/index.html: {len(html.encode()) // 1024} KiB")


if __name__ == "__main__":
    arguments.run(main)
