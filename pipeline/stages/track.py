"""Bring MLflow's store in line with the results, as `tactile track` does, unless neither has changed since then.

pipeline/tracking/mlflow_runs.py says what a run holds. To compare every run with the store takes ten seconds, to see
that no file of results, settings, code or store has another size or time of change a tenth of one.
Usage: python -m pipeline.stages.track
"""

import hashlib
import json
import os
from collections.abc import Iterable
from pathlib import Path

from tactile.base import arguments, files, paths
from tactile.base.imports import HOUSES
from tactile.base.params import load
from tactile.base.paths import Workspace

READ = ("ingest.json", "latency", "models", "scores.csv", "speed")  # of an experiment's folder; others change later


def main(workspace: Workspace) -> None:
    """Track every experiment of the settings."""
    arguments.parse(__doc__)
    mark, database = workspace.mlflow / "tracked.txt", workspace.mlflow_database
    own_store = not os.environ.get("MLFLOW_TRACKING_URI")  # of another one no file tells that it has changed
    values = load(workspace.params)
    of_results = [workspace.params, workspace.root / "params", workspace.root / "evidence"]
    of_results += [paths.CODE.parent / house for house in HOUSES]
    of_results += [workspace.experiment_folder(name) / part for name in values["experiments"] for part in READ]
    results = state(of_results)
    if own_store and mark.is_file() and mark.read_text(encoding="utf-8") == results + state([database]):
        print("MLflow's store has these results; `tactile track` prints the links that compare them")
        return
    from pipeline.tracking import mlflow_runs  # here, because the import of MLflow takes seconds

    mlflow_runs.track(workspace, values)
    if own_store:
        files.write_text(mark, results + state([database]))


def state(places: Iterable[Path]) -> str:
    """Return a line that differs where a file in or below one of `places` is new, gone or changed."""
    found = [path for place in places for path in (place, *sorted(place.rglob("*")))]
    found = [path for path in found if "__pycache__" not in path.parts and path.is_file()]  # written at a first import
    told = [(str(path), path.stat().st_size, path.stat().st_mtime_ns) for path in found]
    return hashlib.sha256(json.dumps(told).encode()).hexdigest() + "\n"


if __name__ == "__main__":
    arguments.run(main)
