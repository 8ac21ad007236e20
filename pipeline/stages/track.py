"""Log every result of the pipeline as a run in MLflow. `python -m pipeline.stages.track`

A second call adds nothing; pipeline/tracking.py says what one run holds. The store is `mlruns/mlflow.db`, or the
server that MLFLOW_TRACKING_URI names. DVC runs this at every `dvc repro`, so it looks at a receipt first.
"""

import os

from pipeline.base import arguments, store
from pipeline.base.availability import why_not_run
from pipeline.base.errors import run_stage
from pipeline.base.params import load


def track(params: dict) -> None:
    """Bring the store in line with the files of all `params["experiments"]` and write the receipt.

    Raises InputError if a file is missing or was made with other settings (nothing is logged then), or the store
    cannot be used.
    """
    with store.one_at_a_time():
        origin = store.origin(params)
        rows = None if store.in_temporary_copy() else store.known_rows(origin)
        if rows is not None and not store.server() and store.is_untouched(rows):
            print(f"MLflow: {len(rows)} runs, nothing changed since they were tracked; {_search_for()}")
            return
        rows = _track(params, rows)
        if not store.in_temporary_copy():
            store.write_receipt(origin, rows)


def _track(params: dict, known: list[dict[str, str]] | None) -> list[dict[str, str]]:
    """Return the receipt's rows; `known`: those of an earlier call, if all that it tracked is unchanged."""
    from pipeline import tracking  # MLflow takes 3 s to import

    if known is not None and tracking.holds(known):
        print(f"MLflow: {len(known)} runs, all found in the store; {_search_for()}")
        return known
    from pipeline.inference import mlflow_runs

    ran = []
    for experiment in params["experiments"]:
        if reason := why_not_run(experiment):
            print(f"{experiment}: not run, so nothing to track ({reason})")
        else:
            ran.append(experiment)
    tracking.check_settings(ran, params)
    runs = [run for experiment in ran for run in tracking.read_runs(experiment, params)]
    done = tracking.synchronise(runs, mlflow_runs.Writer(params).write)
    print(
        f"MLflow: {done.logged} runs logged, {len(runs) - done.logged} found again (of them {done.restored} restored, "
        f"{done.measured} with new times), {done.former} no longer current; {_search_for()}"
    )
    return done.rows


def _search_for() -> str:
    """Return the words to type into MLflow's search to see the tracked runs."""
    if store.in_temporary_copy():
        return f"search for tags.dvc_experiment = '{os.environ.get('DVC_EXP_NAME', '')}'"
    return f"the present results: tags.`{store.current_tag()}` = 'true'"


def main() -> None:
    """Track every experiment of params.yaml."""
    arguments.parse(__doc__)
    track(load())


if __name__ == "__main__":
    run_stage(main)
