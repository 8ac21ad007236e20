"""Write the reviewer's page, reports/index.html, from the other reports.

Usage: python -m pipeline.stages.page
"""

from pipeline.base import arguments, files, params, paths
from pipeline.base.errors import run_stage
from pipeline.reporting.page import sections


def main() -> None:
    """Write reports/index.html."""
    arguments.parse(__doc__)
    (paths.REPORTS / "benchmarks").mkdir(exist_ok=True)
    html = sections.build(params.load())
    files.write_text(paths.REPORTS / "index.html", html)
    print(f"reports/index.html: {len(html.encode()) // 1024} KiB")


if __name__ == "__main__":
    run_stage(main)
