"""Take a quick look at your own logs: check them, train a few models on one split, and write a small report.

It takes the same FOLDER as `tactile own`, and writes reports/own/NAME, which a later `tactile own` replaces. A target
of one's own, `target:` in settings.yaml, is tested on fewer windows than there.

Examples:

    tactile try data/own/finger
"""

import argparse

from tactile import experiments
from tactile.base.paths import Workspace
from tactile.commands import check, own, targets

add_arguments = check.add_arguments


def main(workspace: Workspace, given: argparse.Namespace) -> None:
    """Look at the logs named on the command line."""
    own.main(workspace, given, targets.LOOK, [0], experiments.having("quick"))
