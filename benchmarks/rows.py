"""reports/benchmarks.csv: a row per figure, ours beside a peer's from the same run."""

import csv
import datetime
import importlib.metadata
import os
import platform
from pathlib import Path
from typing import NamedTuple

from tactile.base import files

PACKAGES = ("numpy", "pandas", "pyarrow", "scipy", "torch", "onnxruntime", "dvc")


class Row(NamedTuple):
    """One figure. `ratio` is peer / ours: how many times less than the peer we need."""

    name: str
    ours: float | str
    peer: float | str  # empty where there is none
    unit: str
    ratio: float | str
    target: float | str  # empty where none is set
    met: str  # yes, no, failed, or empty without a target
    what: str
    peer_is: str
    target_is: str  # 'ratio at least' or 'ours at most'
    rounds: int | str
    threads: int | str
    size: str  # full; tiny figures are only to try the code and mean nothing
    machine: str
    versions: str
    date: str


def row(
    name: str,
    *,
    what: str,
    unit: str,
    ours: float,
    peer: float | None = None,
    peer_is: str = "",
    least_ratio: float | None = None,
    most: float | None = None,
    rounds: int,
    threads: int = 1,
    size: str,
) -> Row:
    """A measured figure; it is met where the ratio is at least `least_ratio`, or ours at most `most`.

    Of both, either is enough; the row has the one that is met, `most` where both or neither are.
    """
    ratio = "" if peer is None else peer / ours if ours else float("inf")
    met, target, target_is = "", "", ""
    if most is not None:
        met, target, target_is = "yes" if ours <= most else "no", most, "ours at most"
    if least_ratio is not None and (most is None or met == "no" and ratio >= least_ratio):
        met, target, target_is = "yes" if ratio >= least_ratio else "no", least_ratio, "ratio at least"
    shown = "" if peer is None else peer
    return Row(name, ours, shown, unit, ratio, target, met, what, peer_is, target_is, rounds, threads, size, *where())


def failed(name: str, size: str) -> Row:
    """A figure whose measurement ended in an error."""
    return Row(name, "", "", "", "", "", "failed", "", "", "", "", "", size, *where())


def where() -> tuple[str, str, str]:
    """Machine, versions and date of a measurement."""
    machine = f"{_processor()}, {os.cpu_count()} cores, {platform.system()}"
    packages = [f"{name} {importlib.metadata.version(name)}" for name in PACKAGES]
    return machine, ", ".join([f"Python {platform.python_version()}", *packages]), datetime.date.today().isoformat()


def merge(path: Path, rows: list[Row]) -> None:
    """Put the rows into a table of earlier ones, each in the place of the one with its name, new ones last."""
    table: dict[str, tuple] = {}
    if path.exists():
        with open(path, newline="", encoding="utf-8") as file:
            table = {one["name"]: tuple(one.get(key) or "" for key in Row._fields) for one in csv.DictReader(file)}
    table |= {one.name: tuple(one) for one in rows}
    files.write_csv(path, Row._fields, table.values())


def _processor() -> str:
    """The processor's name: `platform` knows only its kind on Linux."""
    path = Path("/proc/cpuinfo")
    lines = path.read_text().splitlines() if path.exists() else []
    names = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor() or platform.machine()
