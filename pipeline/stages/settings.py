"""Stage: hold params.yaml against what the pipeline knows, before a stage that is named by one of its keys runs.

Usage: python -m pipeline.stages.settings
"""

from pipeline.base import arguments, files, params, paths
from pipeline.base.errors import run_stage


def main() -> None:
    """Check params.yaml; what is written does not depend on its values, so that nothing runs again for it."""
    arguments.parse(__doc__)
    params.load()
    files.write_text(paths.ROOT / "data" / "settings.txt", "params.yaml has known keys and values.\n")


if __name__ == "__main__":
    run_stage(main)
