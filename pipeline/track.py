"""Stage: every result of the pipeline as a run in MLflow. `python -m pipeline.track`

A second call adds nothing; see `tracking.py` for what one run holds. The store is `mlruns/mlflow.db`, or the
server that MLFLOW_TRACKING_URI names.
"""

from pipeline import files, tracking
from pipeline.availability import why_not_run
from pipeline.errors import run_stage
from pipeline.params import load


def track(params: dict) -> None:
    """Bring the store in line with the files of all `params["experiments"]` and write the receipt.

    Raises InputError if a file is missing (nothing is logged then) or the store cannot be used.
    """
    runs = []
    for experiment in params["experiments"]:
        reason = why_not_run(experiment)
        if reason is not None:
            print(f"{experiment}: not run, so nothing to track ({reason})")
            continue
        found = tracking.read_runs(experiment, params)
        print(f"{experiment}: {len(found)} runs")
        runs += found
    table, logged, deleted = tracking.synchronise(runs)
    files.write_table(tracking.receipt(), table)
    print(f"MLflow: {logged} runs logged, {len(table) - logged} unchanged, {deleted} superseded")


def main() -> None:
    """Track every experiment of params.yaml."""
    track(load())


if __name__ == "__main__":
    run_stage(main)
