"""Log every trained model as a run of MLflow. `python -m pipeline.stages.track`

A second call adds nothing; pipeline/inference/mlflow_runs.py says what a run holds. The store is `mlruns/mlflow.db`, or
the server or database that MLFLOW_TRACKING_URI names.
"""

from pipeline.base import arguments, provenance
from pipeline.base.availability import why_not_run
from pipeline.base.params import load
from pipeline.base.paths import Workspace
from pipeline.inference import mlflow_runs, mlflow_store


def track(workspace: Workspace, values: dict) -> None:
    """Log the runs of all experiments of the settings (`values`), and print the link that compares each one's.

    Raises InputError if a file is missing or was made with other settings (nothing is logged then), or the store
    cannot be used.
    """
    runs = {}
    for experiment in values["experiments"]:
        if reason := why_not_run(workspace, experiment):
            print(f"{experiment}: not run, so nothing to track ({reason})")
        else:
            runs[experiment] = mlflow_runs.read_runs(workspace, experiment, values)
    provenance.check_settings(workspace, runs, values)
    with mlflow_store.opened(workspace) as client:
        for experiment, of_experiment in runs.items():
            new, link = mlflow_runs.log(workspace, client, experiment, values, of_experiment)
            print(f"{experiment}: {new} of {len(of_experiment)} runs are new in MLflow; compare them at {link}")


def main(workspace: Workspace) -> None:
    """Track every experiment of the settings."""
    arguments.parse(__doc__)
    track(workspace, load(workspace.params))


if __name__ == "__main__":
    arguments.run(main)
