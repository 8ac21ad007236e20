"""Fill MLflow's store with the committed evidence, and print the links that compare the models.

It computes nothing, takes half a minute the first time, and adds nothing when it is called again. Where `dvc repro` was
run, which ends with it, each of its trainings is a run, too. The store is `mlruns/mlflow.db`, or the server or database
that MLFLOW_TRACKING_URI names; docs/runs.md says how to start MLflow's pages.

Examples:

    tactile track
"""

import argparse

from pipeline.base import params
from pipeline.base.paths import Workspace


def main(workspace: Workspace, given: argparse.Namespace) -> None:
    """Track every experiment of the settings."""
    from pipeline.inference import mlflow_runs

    mlflow_runs.track(workspace, params.load(workspace.params))
