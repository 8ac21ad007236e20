"""Training on a Dask cluster gives the files of local cores to the byte, with a worker lost in the middle too."""

import os
import queue
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import distributed
import psutil
import pytest
from conftest import Project

from pipeline import cluster

# What the cluster needs to train on, and the models trained by one local process after the other, in one Python.
PREPARE = """
import sys
from pipeline import dataset, ingest, simulate, train_series
for stage, *model in ((simulate,), (ingest,), (dataset,), (train_series, "model_zero")):
    sys.argv = [stage.__name__, "strain", *model]
    stage.main()
"""
EPOCHS = 150  # about two seconds of one core
RECIPE = {"learning_rate": 5e-3, "max_epochs": EPOCHS, "drop_epoch": 100, "drop": 0.2, "clip": 1.0, "streams": 1}
SEEDS = [0, 1, 2]
SETTINGS = {
    "strain.protocols.task_0.seeds": SEEDS,
    "strain.models": {"lstm_direct": {"units": 6, "training": RECIPE | {"batch": 1}}},
}


@pytest.fixture(scope="module")
def project(tmp_path_factory):
    project = Project(tmp_path_factory.mktemp("cluster"))
    project.set(SETTINGS)
    project.run("-c", PREPARE)
    models(project).rename(models(project).with_name("local"))
    return project


@pytest.fixture(scope="module")
def workers():
    """A cluster of two workers on loopback, and a client of it."""
    settings = {"n_workers": 2, "threads_per_worker": 1, "host": "127.0.0.1", "dashboard_address": None}
    with distributed.LocalCluster(**settings) as started, started.get_client() as client:
        yield client


def models(project: Project) -> Path:
    return project.folder / "data" / "strain" / "models" / "model_zero"


def files(folder: Path) -> dict[str, bytes]:
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def training(project: Project, address: str) -> subprocess.Popen:
    """The stage, begun from nothing."""
    shutil.rmtree(models(project), ignore_errors=True)
    command = [sys.executable, "-m", "pipeline.train_series", "strain", "model_zero"]
    environment = project.environment | {"WORKERS": address}
    return subprocess.Popen(command, cwd=project.folder, env=environment, stderr=subprocess.PIPE, text=True)


@pytest.fixture
def heard(workers):
    """(number of the task, steps that it has done) in the order in which the cluster reports them."""
    messages = queue.SimpleQueue()
    workers.subscribe_topic(cluster.TOPIC, lambda event: messages.put(event[1][1:3]))
    yield messages
    workers.unsubscribe_topic(cluster.TOPIC)


def processes(workers) -> dict[int, list[psutil.Process]]:
    """Process id of every worker -> the processes that compute for it."""
    return {pid: psutil.Process(pid).children() for pid in workers.run(os.getpid).values()}


def until(condition, seconds: float = 30) -> None:
    deadline = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.05)


def two_under_way(heard) -> list[tuple[int, int]]:
    """Wait until both workers are in the middle of a task; returns the reports until then."""
    reports = []
    while len({number for number, done in reports if done > 1}) < 2:
        reports.append(heard.get(timeout=60))
    return reports


def test_a_lost_worker_changes_no_byte(project, workers, heard):
    stage = training(project, workers.scheduler.address)
    reports = two_under_way(heard)
    lost, computing = next(iter(processes(workers).items()))
    os.kill(lost, signal.SIGKILL)
    _, printed = stage.communicate(timeout=120)
    assert stage.returncode == 0, printed
    assert not any(process.is_running() for process in computing)
    local = files(models(project).with_name("local"))
    assert len(local) >= 3 * len(SEEDS) and files(models(project)) == local
    while not heard.empty():
        reports.append(heard.get())
    assert sum(done == 1 for _, done in reports) == len(SEEDS) + 1  # one task began twice
    assert f"{EPOCHS * len(SEEDS)}/{EPOCHS * len(SEEDS)}" in printed  # the bar is full, and not beyond
    assert not list((project.folder / "data").glob("cluster-*"))
