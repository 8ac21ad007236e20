"""Check params.yaml before any stage runs that is named after one of its keys.

Usage: python -m pipeline.stages.settings
"""

from pipeline.base import arguments, files, params, paths
from pipeline.base.errors import run_stage


def main() -> None:
    """Check params.yaml; the text written does not depend on its values, so that no stage runs again for it."""
    arguments.parse(__doc__)
    params.load()
    files.write_text(paths.ROOT / "data" / "settings.txt", "params.yaml has known keys and values.\n")


if __name__ == "__main__":
    run_stage(main)
