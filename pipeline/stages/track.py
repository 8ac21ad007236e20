"""Fill MLflow's store with the committed evidence, and with what `dvc repro` trained on this machine.

`python -m pipeline.stages.track`, which is `tactile track`, computes nothing, and a second call adds nothing;
pipeline/inference/mlflow_runs.py says what a run holds. The store is `mlruns/mlflow.db`, or the server or database that
MLFLOW_TRACKING_URI names.
"""

from pipeline.base import arguments
from pipeline.base.params import load
from pipeline.base.paths import Workspace
from pipeline.inference import mlflow_runs


def main(workspace: Workspace) -> None:
    """Track every experiment of the settings."""
    arguments.parse(__doc__)
    mlflow_runs.track(workspace, load(workspace.params))


if __name__ == "__main__":
    arguments.run(main)
