"""Benchmarks: our code against its peers in the same run, and its growth with the size of the data.

On an otherwise idle machine, after `dvc repro`, half an hour on two cores:

    python -m pytest benchmarks

writes reports/benchmarks.csv, reports/growth.csv and the tables and charts in reports/benchmarks/. `-k NAME` measures
some of the figures and keeps the others' rows; `--size tiny` tries the code in a few minutes and writes into a
temporary folder; `--full-repro` also times the whole pipeline in a fresh clone. A figure that misses its target is a
failed test, and `no` in its row.
"""

import os
import statistics
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple

import pytest

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[variable] = "1"  # before the first import of numpy and torch

from benchmarks import growth, report, rows  # noqa: E402
from benchmarks.made import ROOT  # noqa: E402


class Sizes(NamedTuple):
    """How much is measured."""

    name: str
    rounds: int  # of fast things; slow ones take 3
    log_mb: float  # the large log
    hours: float  # of the log that is predicted
    frames: int  # of the frames table for window + dataset
    epochs: int  # of the strain LSTM
    samples: int  # of the series
    windows: int  # of a LoMP batch
    images: int
    updates: int  # of an epoch of each network, for the cost of the papers' scale
    growth: growth.Sizes


FULL = Sizes("full", 15, 1000, 4, 600_000, 200, 24_000, 256, 1000, 24, growth.FULL)
TINY = Sizes("tiny", 2, 4, 0.02, 15_000, 2, 1500, 32, 64, 2, growth.TINY)


def pytest_addoption(parser):
    group = parser.getgroup("benchmarks of this project")
    group.addoption("--size", choices=["full", "tiny"], default="full", help="tiny: only to try the code")
    group.addoption("--log-mb", type=float, help="size of the large log in MB (full: 1000)")
    group.addoption("--results", type=Path, help="folder of the results (full: reports, tiny: a temporary one)")
    group.addoption("--full-repro", action="store_true", help="also time `dvc repro` in a fresh clone")


@pytest.fixture(scope="session")
def sizes(request) -> Sizes:
    """Full or tiny."""
    chosen = FULL if request.config.getoption("size") == "full" else TINY
    log_mb = request.config.getoption("log_mb")
    return chosen if log_mb is None else chosen._replace(log_mb=log_mb)


@pytest.fixture(scope="session")
def results(request, sizes, tmp_path_factory) -> Iterator[Path]:
    """The folder that results go to."""
    given = request.config.getoption("results")
    if given is not None:
        folder = given.resolve()
    else:
        folder = ROOT / "reports" if sizes.name == "full" else tmp_path_factory.mktemp("reports")
    yield folder
    report.write(folder)


@pytest.fixture(autouse=True)
def one_thread():
    """torch on one thread, as everywhere in the pipeline."""
    import torch

    torch.set_num_threads(1)


@pytest.fixture
def race(benchmark):
    """`race(ours, *peers, rounds, calls)`: median seconds of a call of each, and of ours first.

    After a call of each to warm up, in every round `calls` calls of each peer, then of ours.
    """

    def run(ours: Callable, *peers: Callable, rounds: int, calls: int = 1) -> list[float]:
        taken: list[list[float]] = [[] for _ in peers]

        def turn(function: Callable) -> None:
            for _ in range(calls):
                function()

        def peers_turn() -> None:
            for peer, times in zip(peers, taken, strict=True):
                began = time.perf_counter()
                turn(peer)
                times.append(time.perf_counter() - began)

        for function in (ours, *peers):
            function()
        benchmark.pedantic(turn, args=(ours,), setup=peers_turn, rounds=rounds)
        return [seconds / calls for seconds in (benchmark.stats.stats.median, *map(statistics.median, taken))]

    return run


@pytest.fixture
def record(request, sizes, results):
    """`record(name, **figures)` writes a row (rows.row); at full size a missed target then fails the test.

    A test that ends without a row leaves one that says so, under its own name.
    """
    done: list[rows.Row] = []

    def add(name: str, **figures) -> None:
        done.append(rows.row(name, size=sizes.name, **figures))
        rows.merge(results / "benchmarks.csv", done[-1:])

    yield add
    if not done:
        rows.merge(results / "benchmarks.csv", [rows.failed(request.node.name.removeprefix("test_"), sizes.name)])
    missed = [f"{one.name}: {one.ours:g} {one.unit}, {one.target_is} {one.target:g}" for one in done if one.met == "no"]
    assert sizes.name == "tiny" or not missed, "; ".join(missed)
