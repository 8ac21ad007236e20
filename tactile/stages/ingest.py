"""Turn raw logs into aligned, validated frames; every line that is left out goes to a rejects table.

Usage: python -m tactile.stages.ingest EXPERIMENT
"""

import itertools
import json
from collections import Counter, deque
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pyarrow as pa
from tqdm import tqdm

from tactile import experiments
from tactile.base import arguments, files, params, paths, processes, workers
from tactile.base.errors import InputError
from tactile.base.paths import Workspace
from tactile.datasets import schemas
from tactile.logs import own_data, sources

MEMORY = 2.5  # bytes that reading holds of a byte of logs: 645 MB of a recording of 256 MB
SMALL = 16 << 20  # bytes of logs: one process reads most in a second, and to start others takes three
Read = tuple[str, pa.Table, dict]  # `condition/recording`, its rejects, its report


def ingest(workspace: Workspace, experiment: str, settings: dict) -> None:
    """Write the frames, rejects and report of an experiment; `settings` is its block of settings.

    The logs are from a public source (where it is not downloaded: empty tables and the reason), from the simulator, or
    from the folder in data/own (relative to the repository) that `<experiment>.source` names. Raises InputError for
    logs that cannot be read, for a public source with a missing or wrong file, and for a folder in which DVC would not
    notice a change.
    """
    module = experiments.module(experiment)
    schema = module.frames_schema(settings)
    if module.FACTS.source:
        if not sources.is_complete(workspace, experiment):
            reason = f"recordings not downloaded; run `tactile fetch {experiment}`"
            schemas.write(workspace.frames(experiment), schema, [])
            _write_rest(workspace, experiment, [], {"run": False, "reason": reason})
            print(f"{experiment}: not run, {reason}")
            return
        folder = sources.folder(workspace, experiment)
    elif settings["source"] == "simulated":
        folder = paths.require(workspace.logs(experiment), f"python -m pipeline.stages.simulate {experiment}")
    else:
        folder = workspace.root / settings["source"]
        if not folder.is_dir():
            raise InputError(
                f"params/{experiment}.yaml, {experiment}.source: there is no folder {settings['source']}; name one or "
                "`simulated`"
            )
        if problem := own_data.unnoticed(workspace, folder):
            raise InputError(f"params/{experiment}.yaml, {experiment}.source: {problem}")
    try:
        recordings = module.recordings(folder)
        rejects, reports = _write_frames(workspace, experiment, recordings, schema, settings)
    except InputError as error:
        if settings.get("source", "simulated") == "simulated":
            raise
        more = f"`tactile check {experiment} {settings['source']}` says more"
        raise InputError(f"{error} ({more})") from error
    _write_rest(workspace, experiment, rejects, {"run": True, "recordings": reports})
    logs = [log for report in reports.values() for log in report["files"].values()]
    lines = sum(log["lines"] for log in logs)
    rejected = sum((Counter(log["rejects"]) for log in logs), Counter())
    print(f"{experiment}: {len(recordings)} recordings, {lines} lines, {rejected.total()} rejected: {dict(rejected)}")


def _write_frames(
    workspace: Workspace, experiment: str, recordings: list[Path], schema: pa.Schema, settings: dict
) -> tuple[list[pa.Table], dict[str, dict]]:
    """Read every recording and write its frames part by part, in the order of the recordings.

    Returns a table of rejects per recording, and recording -> report.
    """
    read_all = _in_processes if _several(recordings) else _in_turn
    rejects, reports = [], {}
    with schemas.writing(workspace.frames(experiment), schema) as write_part, _behind(write_part) as write_later:
        with tqdm(total=len(recordings), desc=f"ingest {experiment}", unit="recording") as bar:
            for name, rejected, report in read_all(workspace, experiment, recordings, settings, write_later, bar):
                rejects.append(rejected)
                reports[name] = report
    return rejects, reports


def _several(recordings: list[Path]) -> bool:
    """Tell whether processes read the recordings: where they are sooner done than one, and have memory beside others.

    They are not for a single recording, nor for little in all. On a cluster memory is its own matter.
    """
    count = workers.count()
    if len(recordings) == 1 or count == 1:
        return False
    files_of = (path.rglob("*") if path.is_dir() else [path] for path in recordings)
    sizes = sorted(sum(path.stat().st_size for path in of_one) for of_one in files_of)
    if isinstance(count, str):
        return sum(sizes) >= SMALL
    return sum(sizes) >= SMALL and MEMORY * sum(sizes[-count:]) < processes.memory_bytes() / 2


@contextmanager
def _behind(function: Callable) -> Iterator[Callable]:
    """Give the block `function` to call in a thread beside it, one call at a time; a call waits for the last one."""
    with ThreadPoolExecutor(1) as thread:
        running: list[Future] = []

        def call(argument: Any) -> None:
            while running:
                running.pop().result()
            running.append(thread.submit(function, argument))

        yield call
        while running:
            running.pop().result()


def _in_turn(
    workspace: Workspace, experiment: str, recordings: list[Path], settings: dict, write: Callable, bar: tqdm
) -> Iterator[Read]:
    """Yield what `_read` returns of every recording; `write` gets their frames."""
    for path in recordings:
        yield _read(experiment, path, settings, write)
        bar.update(1)


def _in_processes(
    workspace: Workspace, experiment: str, recordings: list[Path], settings: dict, write: Callable, bar: tqdm
) -> Iterator[Read]:
    """Yield what `_read` returns of every recording, each read in a process; `write` gets their frames, in order.

    The frames pass through files beside the table that is written: so what the stage holds does not grow with the
    number of recordings, and a cluster, which shares the folder, can read too.
    """
    folder = workspace.frames(experiment).with_suffix(".parts.unfinished")
    files.remove_folder(folder, inside=folder.parent)  # of a stage that was killed
    folder.mkdir(parents=True)
    try:
        targets = {path: folder / str(number) for number, path in enumerate(recordings)}
        tasks = {path: (experiment, path, settings, target) for path, target in targets.items()}
        waiting, left = {}, deque(recordings)
        for path, result in workers.run(read_to_files, tasks, bar, folders=targets):
            waiting[path] = result
            while left and left[0] in waiting:
                path = left.popleft()
                for part in sorted(targets[path].iterdir()):
                    with open(part, "rb") as file, pa.ipc.open_stream(file) as stream:
                        write(stream.read_all())
                    part.unlink()
                yield waiting.pop(path)
    finally:
        files.remove_folder(folder, inside=folder.parent)


def read_to_files(experiment: str, path: Path, settings: dict, folder: Path, report: Callable) -> Read:
    """Do as `_read`; the frames' parts become files of the new folder `folder`, named so that sorting keeps the order.

    report: not called; `workers.run` gives it to every task.
    """
    folder.mkdir()
    numbers = itertools.count()

    def keep(part: pa.Table) -> None:
        target = folder / f"{next(numbers):06d}.arrow"
        with open(target, "wb") as file, pa.ipc.new_stream(file, part.schema) as stream:
            stream.write_table(part)

    return _read(experiment, path, settings, keep)


def _read(experiment: str, path: Path, settings: dict, keep: Callable[[pa.Table], None]) -> Read:
    """Read one recording and give its frames to `keep`, part by part; returns its name, its rejects and its report."""
    module = experiments.module(experiment)
    parts, rejected, logs = getattr(module, "read_in_parts", module.read_recording)(path, settings)
    count = 0
    for part in [parts] if isinstance(parts, pa.Table) else parts:
        keep(part)
        count += part.num_rows
    names = part["condition"][0].as_py(), part["recording"][0].as_py()
    for column, name in enumerate(names):
        values = pa.array([name] * rejected.num_rows, pa.string())
        rejected = rejected.add_column(column, schemas.REJECTS.names[column], values)
    return "/".join(names), rejected, {"frames": count, "files": logs}


def _write_rest(workspace: Workspace, experiment: str, rejects: list[pa.Table], report: dict) -> None:
    """Write the rejects and the report of an experiment."""
    schemas.write(workspace.rejects(experiment), schemas.REJECTS, rejects)
    files.write_text(workspace.ingest_report(experiment), json.dumps(report, indent=1) + "\n")


def main(workspace: Workspace) -> None:
    """Ingest the experiment named on the command line."""
    values = params.load(workspace.params)
    experiment = arguments.parse(__doc__, experiment=values["experiments"]).experiment
    ingest(workspace, experiment, values[experiment])


if __name__ == "__main__":
    arguments.run(main)
