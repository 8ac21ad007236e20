"""Tell whether an experiment could run: recorded data may be absent on a machine."""

import json

from tactile.base import foreign, paths
from tactile.base.paths import Workspace


def why_not_run(workspace: Workspace, experiment: str) -> str | None:
    """Return the reason that ingest gave for not running `experiment` (recordings absent), or None if it ran.

    Raises InputError if the report of ingest is missing or is not JSON.
    """
    path = paths.require(workspace.ingest_report(experiment), f"python -m tactile.stages.ingest {experiment}")
    with foreign.reading(path, "a report of ingest", f"run `python -m tactile.stages.ingest {experiment}`"):
        report = json.loads(path.read_text(encoding="utf-8"))
        return None if report["run"] else report["reason"]
