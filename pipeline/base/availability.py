"""Tell whether an experiment could run: recorded data may be absent on a machine."""

import json

from pipeline.base import foreign, paths
from pipeline.base.paths import Workspace


def why_not_run(workspace: Workspace, experiment: str) -> str | None:
    """Return the reason that ingest gave for not running `experiment` (recordings absent), or None if it ran.

    Raises InputError if the report of ingest is missing or is not JSON.
    """
    path = paths.require(workspace.ingest_report(experiment), f"python -m pipeline.stages.ingest {experiment}")
    with foreign.reading(path, "a report of ingest", f"run `python -m pipeline.stages.ingest {experiment}`"):
        report = json.loads(path.read_text(encoding="utf-8"))
        return None if report["run"] else report["reason"]


def has_report(workspace: Workspace, experiment: str) -> bool:
    """Tell whether reports/<experiment> holds results, of this machine or committed ones."""
    return (workspace.reports / experiment / "speed" / "table2.csv").is_file()


def why_not_shown(workspace: Workspace, experiment: str) -> str | None:
    """Return why there are no results of an experiment to show, neither new nor committed; None where there are."""
    return None if has_report(workspace, experiment) else why_not_run(workspace, experiment)
