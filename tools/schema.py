"""Write params.schema.json, by which editors complete and explain the keys of params.yaml and params/*.yaml."""

import argparse

from tactile.base import arguments, files
from tactile.base.paths import Workspace
from tactile.settings import schema


def main(workspace: Workspace, given: argparse.Namespace) -> None:
    """Write the file beside params.yaml."""
    files.write_text(workspace.root / "params.schema.json", schema() + "\n")


if __name__ == "__main__":
    arguments.run_tool(__doc__, main)
