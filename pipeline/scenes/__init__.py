"""Simulated scenes: physics that writes the raw logs of an experiment.

Every scene, `pipeline/scenes/<experiment>.py`, provides `plan(settings)` -> (recordings, logs_of): recordings have a
`condition` and a `name`, and `logs_of(recording)` gives {file name: (lines, injected faults)}. Recordings are written
in any order and any process: `logs_of` can be pickled, and each recording draws its random numbers from its own seed.
"""

import importlib
from collections.abc import Callable, Iterable
from pathlib import Path

NAMES = ("touch", "strain", "glove")


def plan(experiment: str, settings: dict) -> tuple[Iterable, Callable]:
    """Return the recordings of an experiment's scene and what writes the logs of one; settings: its block."""
    return importlib.import_module(f"pipeline.scenes.{experiment}").plan(settings)


def write_logs(folder: Path, recordings: Iterable, logs_of: Callable) -> list[tuple]:
    """Write <folder>/<condition>/<recording>/<device>.log of every recording.

    Returns one row (condition, recording, file, line, fault) per injected fault.
    """
    return [row for recording in recordings for row in write_recording(folder, recording, logs_of)]


def write_recording(folder: Path, recording, logs_of: Callable, report: Callable | None = None) -> list[tuple]:
    """Write the logs of one recording, as `write_logs` does, and return their rows.

    report: not called; `workers.run` gives it to every task.
    """
    target = folder_of(folder, recording)
    target.mkdir(parents=True)
    rows = []
    for name, (lines, faults) in logs_of(recording).items():
        write_log(target / name, lines)
        rows += [(recording.condition, recording.name, name, fault.line, fault.kind) for fault in faults]
    return rows


def folder_of(folder: Path, recording) -> Path:
    """Return `<folder>/<condition>/<recording>`."""
    return folder / recording.condition / recording.name


def write_log(path: Path, lines: Iterable[str]) -> None:
    """Write one log, as a device's serial port printed it."""
    path.write_text("\n".join(lines) + "\n", encoding="ascii")
