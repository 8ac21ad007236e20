"""What each stage of a `dvc repro` takes of the machine: minutes, busy and idle core-seconds."""

import re
import subprocess
import sys
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple, TextIO

from tactile.base import files

COLUMNS = ("stage", "minutes", "busy_core_s", "idle_core_s")
BEGINS = re.compile(r"Running stage '(\S+?)'")
BEFORE = "(before the first stage)"  # DVC reads the pipeline
TICKS_PER_S = 100  # of /proc/stat, on every Linux


class Sample(NamedTuple):
    """A moment of a run: the stage that begins, the time in s, and the seconds that all cores have been busy so far."""

    stage: str
    seconds: float
    busy: float


def busy_of(stat: str) -> tuple[float, int]:
    """Return the seconds that all cores have worked since the machine started, and how many cores there are.

    stat: the text of /proc/stat; user, nice and system count as work, waiting for the disk does not.
    """
    lines = [line.split() for line in stat.splitlines()]
    total = next(line for line in lines if line[0] == "cpu")
    cores = sum(bool(re.fullmatch(r"cpu\d+", line[0])) for line in lines if line)
    user, nice, system = map(int, total[1:4])
    return (user + nice + system) / TICKS_PER_S, cores


def sample(stage: str) -> Sample:
    """Return this moment of this machine."""
    return Sample(stage, time.perf_counter(), busy_of(Path("/proc/stat").read_text())[0])


def watch(lines: Iterable[str], out: TextIO, sample: Callable[[str], Sample]) -> list[Sample]:
    """Pass lines on to `out` as they come; return a sample of the start, of each stage's beginning and of the end."""
    samples = [sample(BEFORE)]
    for line in lines:
        if begins := BEGINS.search(line):
            samples.append(sample(begins[1]))
        out.write(line)
        out.flush()
    return [*samples, sample("")]


def repro(folder: Path, environment: Mapping[str, str], out: TextIO) -> list[Sample]:
    """Run `dvc repro` in a checkout and return its samples, see `watch`; CalledProcessError where it fails."""
    command = [sys.executable, "-m", "dvc", "repro"]
    unbuffered = {**environment, "PYTHONUNBUFFERED": "1"}  # else a pipe gets DVC's lines when it ends
    with subprocess.Popen(command, cwd=folder, env=unbuffered, stdout=subprocess.PIPE, text=True) as run:
        samples = watch(run.stdout, out, sample)
    if run.returncode:
        raise subprocess.CalledProcessError(run.returncode, command)
    return samples


def rows(samples: Sequence[Sample], cores: int) -> list[tuple[str, float, float, float]]:
    """Return a row of COLUMNS for each stage, in the order of time; idle is what `cores` could have done besides."""
    table = []
    for begin, end in pairwise(samples):
        wall, busy = end.seconds - begin.seconds, end.busy - begin.busy
        table.append((begin.stage, wall / 60, busy, max(0.0, cores * wall - busy)))
    return table


def idle_share(table: Sequence[tuple[str, float, float, float]], cores: int) -> float:
    """Return the idle share of all core-seconds of a run, 0 to 1; table: as of `rows`."""
    return sum(idle for *_, idle in table) / (cores * 60 * sum(minutes for _, minutes, *_ in table))


def write(path: Path, table: Sequence[tuple[str, float, float, float]]) -> None:
    """Write a table of `rows` as CSV."""
    files.write_csv(path, COLUMNS, table)
