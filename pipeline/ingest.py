"""Stage: raw logs to aligned, validated frames; every line that is left out goes to a rejects table.

Usage: python -m pipeline.ingest touch|velostat_recorded
"""

import json
import os
import sys
from collections import Counter
from collections.abc import Callable, Iterable
from pathlib import Path

import pyarrow as pa
from tqdm import tqdm

from pipeline import paths, sources, tables
from pipeline.errors import InputError, run_stage
from pipeline.experiments import touch, velostat_recorded
from pipeline.params import load


def ingest_touch(settings: dict) -> None:
    """Frames, rejects and report of `touch`; `settings` is its block of params.yaml.

    The logs are the simulator's, or those in the folder (relative to the repository) that `touch.source`
    names.
    """
    if settings["source"] == "simulated":
        folder = paths.require(paths.logs("touch"), "python -m pipeline.simulate touch")
    else:
        folder = paths.ROOT / settings["source"]
        if not folder.is_dir():
            raise InputError(
                f"params.yaml, touch.source: there is no folder {settings['source']}; name one or `simulated`"
            )
    _ingest("touch", touch.recordings(folder), touch.frames_schema(settings), touch.read_recording, settings)


def ingest_velostat_recorded(settings: dict) -> None:
    """Frames, rejects and report of `velostat_recorded`; without recordings, empty tables and a reason."""
    name = "velostat_recorded"
    if not sources.is_complete(name):
        reason = f"recordings not downloaded; run `python -m pipeline.fetch {name}`"
        _write(name, velostat_recorded.SCHEMA, [], {"run": False, "reason": reason})
        print(f"{name}: not run, {reason}")
        return
    found = velostat_recorded.recordings(sources.folder(name))
    _ingest(name, found, velostat_recorded.SCHEMA, velostat_recorded.read_recording, settings)


def _ingest(
    experiment: str, recordings: list[Path], schema: pa.Schema, read_recording: Callable, settings: dict
) -> None:
    """Read every recording with `read_recording(path, settings)` and write the three files."""
    report: dict = {"run": True, "recordings": {}}

    def parts() -> Iterable[tuple[pa.Table, pa.Table]]:
        for path in tqdm(recordings, desc=f"ingest {experiment}", unit="recording"):
            frames, rejects, files = read_recording(path, settings)
            condition, recording = frames["condition"][0].as_py(), frames["recording"][0].as_py()
            for column, value in ((0, condition), (1, recording)):
                name = schema.names[column]
                rejects = rejects.add_column(column, name, pa.array([value] * rejects.num_rows, pa.string()))
            report["recordings"][f"{condition}/{recording}"] = {"frames": frames.num_rows, "files": files}
            yield frames, rejects

    _write(experiment, schema, parts(), report)
    files = [file for one in report["recordings"].values() for file in one["files"].values()]
    lines, rejected = sum(f["lines"] for f in files), sum((Counter(f["rejects"]) for f in files), Counter())
    print(
        f"{experiment}: {len(recordings)} recordings, {lines} lines, "
        f"{rejected.total()} rejected: {dict(rejected)}"
    )


def _write(
    experiment: str, schema: pa.Schema, parts: Iterable[tuple[pa.Table, pa.Table]], report: dict
) -> None:
    """Write frames, rejects and report (complete once `parts` is exhausted)."""
    rejects: list[pa.Table] = []

    def frames() -> Iterable[pa.Table]:
        for part, bad in parts:
            rejects.append(bad)
            yield part

    tables.write(paths.frames(experiment), schema, frames())
    tables.write(paths.rejects(experiment), tables.REJECTS, rejects)
    target = paths.ingest_report(experiment)
    draft = target.with_name(target.name + ".unfinished")
    draft.write_text(json.dumps(report, indent=1) + "\n", encoding="utf-8")
    os.replace(draft, target)


def main() -> None:
    """Ingest the experiment named on the command line."""
    stages = {"touch": ingest_touch, "velostat_recorded": ingest_velostat_recorded}
    experiment = sys.argv[1] if len(sys.argv) == 2 else ""
    if experiment not in stages:
        raise InputError(f"usage: python -m pipeline.ingest {'|'.join(stages)}")
    stages[experiment](load()[experiment])


if __name__ == "__main__":
    run_stage(main)
