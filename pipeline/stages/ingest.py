"""Turn raw logs into aligned, validated frames; every line that is left out goes to a rejects table.

Usage: python -m pipeline.stages.ingest EXPERIMENT
"""

import json
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import pyarrow as pa
from tqdm import tqdm

from pipeline import experiments
from pipeline.base import arguments, files, params, paths
from pipeline.base.errors import InputError, run_stage
from pipeline.datasets import schemas
from pipeline.logs import own_data, sources


def ingest(experiment: str, settings: dict) -> None:
    """Write the frames, rejects and report of an experiment; `settings` is its block of params.yaml.

    The logs are from a public source (where it is not downloaded: empty tables and the reason), from the simulator, or
    from the folder in data/own (relative to the repository) that `<experiment>.source` names. Raises InputError for
    logs that cannot be read, for a public source with a missing or wrong file, and for a folder in which DVC would not
    notice a change.
    """
    module = experiments.module(experiment)
    schema = module.frames_schema(settings)
    if experiment in sources.SOURCES:
        if not sources.is_complete(experiment):
            reason = f"recordings not downloaded; run `tactile fetch {experiment}`"
            schemas.write(paths.frames(experiment), schema, [])
            _write_rest(experiment, [], {"run": False, "reason": reason})
            print(f"{experiment}: not run, {reason}")
            return
        folder = sources.folder(experiment)
    elif settings["source"] == "simulated":
        folder = paths.require(paths.logs(experiment), f"python -m pipeline.stages.simulate {experiment}")
    else:
        folder = paths.ROOT / settings["source"]
        if not folder.is_dir():
            raise InputError(
                f"params.yaml, {experiment}.source: there is no folder {settings['source']}; name one or `simulated`"
            )
        if problem := own_data.unnoticed(folder):
            raise InputError(f"params.yaml, {experiment}.source: {problem}")
    try:
        read = getattr(module, "read_in_parts", module.read_recording)
        recordings = module.recordings(folder)
        rejects, reports = _write_frames(experiment, recordings, schema, read, settings)
    except InputError as error:
        if settings.get("source", "simulated") == "simulated":
            raise
        more = f"`tactile check {experiment} {settings['source']}` says more"
        raise InputError(f"{error} ({more})") from error
    _write_rest(experiment, rejects, {"run": True, "recordings": reports})
    logs = [log for report in reports.values() for log in report["files"].values()]
    lines = sum(log["lines"] for log in logs)
    rejected = sum((Counter(log["rejects"]) for log in logs), Counter())
    print(f"{experiment}: {len(recordings)} recordings, {lines} lines, {rejected.total()} rejected: {dict(rejected)}")


def _write_frames(
    experiment: str, recordings: list[Path], schema: pa.Schema, read_recording: Callable, settings: dict
) -> tuple[list[pa.Table], dict[str, dict]]:
    """Read every recording with `read_recording(path, settings)` and write its frames part by part.

    Returns a table of rejects per recording, and recording -> report.
    """
    rejects, reports = [], {}
    with schemas.writing(paths.frames(experiment), schema) as write_part:
        for path in tqdm(recordings, desc=f"ingest {experiment}", unit="recording"):
            parts, rejected, logs = read_recording(path, settings)
            count = 0
            for part in [parts] if isinstance(parts, pa.Table) else parts:
                write_part(part)
                count += part.num_rows
            names = part["condition"][0].as_py(), part["recording"][0].as_py()
            for column, name in enumerate(names):
                values = pa.array([name] * rejected.num_rows, pa.string())
                rejected = rejected.add_column(column, schema.names[column], values)
            rejects.append(rejected)
            reports["/".join(names)] = {"frames": count, "files": logs}
    return rejects, reports


def _write_rest(experiment: str, rejects: list[pa.Table], report: dict) -> None:
    """Write the rejects and the report of an experiment."""
    schemas.write(paths.rejects(experiment), schemas.REJECTS, rejects)
    files.write_text(paths.ingest_report(experiment), json.dumps(report, indent=1) + "\n")


def main() -> None:
    """Ingest the experiment named on the command line."""
    values = params.load()
    experiment = arguments.parse(__doc__, experiment=values["experiments"]).experiment
    ingest(experiment, values[experiment])


if __name__ == "__main__":
    run_stage(main)
