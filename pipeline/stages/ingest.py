"""Stage: raw logs to aligned, validated frames; every line that is left out goes to a rejects table.

Usage: python -m pipeline.stages.ingest EXPERIMENT
"""

import json
import sys
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path

import pyarrow as pa
from tqdm import tqdm

from pipeline.base import files, params, paths
from pipeline.base.errors import InputError, run_stage
from pipeline.datasets import schemas
from pipeline.logs import own_data, sources


def ingest(experiment: str, settings: dict) -> None:
    """Frames, rejects and report of an experiment; `settings` is its block of params.yaml.

    The logs are a public source's (without it: empty tables and the reason), the simulator's, or those in the
    folder in data/own (relative to the repository) that `<experiment>.source` names. Raises InputError for logs that
    cannot be read, for a public source with a missing or wrong file, and for a folder in which DVC would not notice a
    change.
    """
    module = params.experiment_module(experiment)
    schema = module.frames_schema(settings)
    if experiment in sources.SOURCES:
        if not sources.is_complete(experiment):
            reason = f"recordings not downloaded; run `tactile fetch {experiment}`"
            _write(experiment, schema, [], [], {"run": False, "reason": reason})
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
        _ingest(experiment, module.recordings(folder), schema, read, settings)
    except InputError as error:
        if settings.get("source", "simulated") == "simulated":
            raise
        more = f"`tactile check {experiment} {settings['source']}` says more"
        raise InputError(f"{error} ({more})") from error


def _ingest(
    experiment: str, recordings: list[Path], schema: pa.Schema, read_recording: Callable, settings: dict
) -> None:
    """Read every recording with `read_recording(path, settings)` and write the three files."""
    report: dict = {"run": True, "recordings": {}}
    rejects: list[pa.Table] = []

    def frames() -> Iterator[pa.Table]:
        for path in tqdm(recordings, desc=f"ingest {experiment}", unit="recording"):
            parts, bad, logs = read_recording(path, settings)
            count = 0
            for part in [parts] if isinstance(parts, pa.Table) else parts:
                count += part.num_rows
                yield part
            names = part["condition"][0].as_py(), part["recording"][0].as_py()
            for column, name in enumerate(names):
                bad = bad.add_column(column, schema.names[column], pa.array([name] * bad.num_rows, pa.string()))
            rejects.append(bad)
            report["recordings"]["/".join(names)] = {"frames": count, "files": logs}

    _write(experiment, schema, frames(), rejects, report)
    files = [file for one in report["recordings"].values() for file in one["files"].values()]
    lines, rejected = sum(f["lines"] for f in files), sum((Counter(f["rejects"]) for f in files), Counter())
    print(f"{experiment}: {len(recordings)} recordings, {lines} lines, {rejected.total()} rejected: {dict(rejected)}")


def _write(
    experiment: str, schema: pa.Schema, frames: Iterable[pa.Table], rejects: list[pa.Table], report: dict
) -> None:
    """Write frames, rejects and report; the last two are complete once `frames` is exhausted."""
    schemas.write(paths.frames(experiment), schema, frames)
    schemas.write(paths.rejects(experiment), schemas.REJECTS, rejects)
    files.write_text(paths.ingest_report(experiment), json.dumps(report, indent=1) + "\n")


def main() -> None:
    """Ingest the experiment named on the command line."""
    values = params.load()
    experiment = params.experiment_argument(sys.argv, "ingest", values)
    ingest(experiment, values[experiment])


if __name__ == "__main__":
    run_stage(main)
