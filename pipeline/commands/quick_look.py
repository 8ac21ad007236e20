"""Take a quick look at your own logs: check them, train a few models on one split, and write a small report.

FOLDER is as `tactile own` takes it, and what is written as there, until `tactile own` writes more: reports/own/NAME.
A target of one's own, `target:` in settings.yaml, is tested as there, on fewer windows.

Examples:

    tactile try data/own/finger
"""

import argparse

from pipeline import experiments
from pipeline.base.paths import Workspace
from pipeline.commands import check, own, targets

add_arguments = check.add_arguments


def main(workspace: Workspace, given: argparse.Namespace) -> None:
    """Look at the logs named on the command line."""
    own.main(workspace, given, targets.LOOK, [0], experiments.having("quick"))
