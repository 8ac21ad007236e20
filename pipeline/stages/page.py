"""Write the reviewer's pages, reports/index.html and appendix.html, shards.md, and the answers of README.md.

Usage: python -m pipeline.stages.page
"""

from pipeline.reporting.page import sections
from tactile.base import arguments, files, params
from tactile.base.paths import Workspace


def main(workspace: Workspace) -> None:
    """Write the pages and their first chart, shards.md, and the answers in README.md, if there is one."""
    arguments.parse(__doc__)
    (workspace.reports / "benchmarks").mkdir(exist_ok=True)
    for name, html in sections.build(workspace, params.load(workspace.params)).items():
        files.write_text(workspace.reports / name, html)
        print(f"reports/{name}: {len(html.encode()) // 1024} KiB")


if __name__ == "__main__":
    arguments.run(main)
