"""Take a quick look at your own logs: check them, train a few models on one split, and write a small report.

FOLDER is as `tactile own` takes it, and what is written as there, until `tactile own` writes more: reports/own/NAME.
A target of one's own, `target:` in settings.yaml, is tested as there, on fewer windows.
"""

import argparse

from pipeline.base import params
from pipeline.base.paths import Workspace
from pipeline.commands import check, own, targets
from pipeline.own import settings as own_settings

MODELS = {  # one that knows nothing, quick ones and a network of the papers
    "touch": ("constant", "window_ridge", "window_trees", "rbf", "lomp"),
    "strain": ("constant", "ridge", "window_ridge", "window_trees", "press_difference", "lstm_direct"),
    "glove": ("constant", "window_ridge", "window_trees", "naive_bayes", "tree", "sp_resnet"),
}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the experiment and the folder of logs to the parser of this command."""
    check.add_arguments(parser)


def main(workspace: Workspace, given: argparse.Namespace) -> None:
    """Look at the logs named on the command line."""
    experiment = check.experiment_of(given.folder, given.experiment)
    if asked := own_settings.asked(given.folder):
        return own.of_target(workspace, experiment, given.folder, asked, targets.LOOK)
    with own.prepared(workspace, given.folder, [0], MODELS) as sensor:
        own.run(workspace, sensor, params.load(sensor.workspace.params))
