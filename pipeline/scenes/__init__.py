"""Simulated scenes: physics that writes the raw logs of an experiment.

Every scene, `pipeline/scenes/<experiment>.py`, provides `plan(settings)` -> (recordings, logs_of): recordings have a
`condition` and a `name`, and `logs_of(recording)` gives {file name: (lines, injected faults)}.
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
    rows = []
    for recording in recordings:
        target = folder / recording.condition / recording.name
        target.mkdir(parents=True)
        for name, (lines, faults) in logs_of(recording).items():
            write_log(target / name, lines)
            rows += [(recording.condition, recording.name, name, fault.line, fault.kind) for fault in faults]
    return rows


def write_log(path: Path, lines: Iterable[str]) -> None:
    """Write one log, as a device's serial port printed it."""
    path.write_text("\n".join(lines) + "\n", encoding="ascii")
