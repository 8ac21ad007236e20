"""Fill MLflow's store with the committed evidence, and with what `dvc repro` trained on this machine.

`python -m pipeline.stages.track` computes nothing, and a second call adds nothing; pipeline/inference/mlflow_runs.py
says what a run holds. The store is `mlruns/mlflow.db`, or the server or database that MLFLOW_TRACKING_URI names.
"""

from pipeline.base import arguments, provenance
from pipeline.base.availability import why_not_run
from pipeline.base.params import load
from pipeline.base.paths import Workspace
from pipeline.inference import mlflow_runs, mlflow_store
from pipeline.scoring import one_table


def track(workspace: Workspace, values: dict) -> None:
    """Log the runs of all experiments of the settings (`values`), and print the link that compares each one's models.

    Raises InputError if a file is missing or was made with other settings (nothing is logged then), or the store
    cannot be used.
    """
    committed, runs, looked = mlflow_runs.evidence(workspace), {}, []
    for experiment in values["experiments"]:
        runs[experiment] = [] if experiment in one_table.of_own_logs(values) else committed.get(experiment, [])
        if not (workspace.ingest_report(experiment).exists() or workspace.models(experiment).exists()):
            continue
        if reason := why_not_run(workspace, experiment):
            print(f"{experiment}: not run here ({reason})")
        else:
            runs[experiment] += mlflow_runs.look(workspace, experiment, values)
            looked.append(experiment)
    provenance.check_settings(workspace, looked, values)
    with mlflow_store.opened(workspace) as client:
        for experiment, of_experiment in runs.items():
            if not of_experiment:
                print(f"{experiment}: no shard of the evidence, nor trained here, so nothing to track")
                continue
            new, link = mlflow_runs.log(workspace, client, experiment, values, of_experiment)
            print(f"{experiment}: {new} of {len(of_experiment)} runs are new in MLflow; compare them at {link}")


def main(workspace: Workspace) -> None:
    """Track every experiment of the settings."""
    arguments.parse(__doc__)
    track(workspace, load(workspace.params))


if __name__ == "__main__":
    arguments.run(main)
