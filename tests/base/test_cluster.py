"""Training on a Dask cluster gives the files of local cores to the byte, with a worker lost in the middle too."""

import builtins
import importlib
import os
import queue
import re
import shutil
import signal
import socket
import subprocess
import sys
from contextlib import nullcontext
from pathlib import Path

import distributed
import psutil
import pytest
from builders.project import ROOT, Project
from tqdm import tqdm

from pipeline.base import cluster, paths, workers
from pipeline.base.errors import InputError

pytestmark = pytest.mark.slow


EPOCHS = 200  # half a second
RECIPE = {"learning_rate": 5e-3, "epochs": EPOCHS, "drop_epoch": 100, "drop": 0.2, "clip": 1.0, "streams": 1}
RUNS = 3
SETTINGS = {
    "strain.model_zero": "ridge",  # not listed: so nothing is trained before the runs
    "strain.protocols": {f"task_{number}": {"seeds": [0]} for number in range(RUNS)},
    "strain.models": {"lstm_direct": {"units": 6, "training": RECIPE | {"batch": 1}}},
}
# What the cluster needs for training, and the same training without it.
PREPARE = """
import sys
from pipeline.stages import dataset, ingest, simulate, train
for stage in (simulate, ingest, dataset, train):
    sys.argv = [stage.__name__, "strain"]
    stage.main()
"""
# Tasks that do nothing, for what can go wrong; as a command, two that never end.
TASKS = """
import builtins
import os
import signal
import time
from pipeline.base.errors import InputError, run_stage

def square(number, report):
    report(1, 1, 0.5)
    return number * number, os.environ["OMP_NUM_THREADS"]

def refused(number, report):
    raise InputError(f"log {number}: no such file; name one")

def wrong(number, report):
    return {}[number]

def killed(place, report):
    tries = len(list(place.parent.iterdir()))
    (place.parent / f"try{tries}").touch()
    place.mkdir()  # must not be there
    if tries < int(place.name):
        os.kill(os.getpid(), signal.SIGKILL)
    return tries

def stopped(place, report):
    tries = len(list(place.parent.iterdir()))
    (place.parent / f"try{tries}").touch()
    place.mkdir()
    if tries < int(place.name):
        os.kill(os.getpid(), signal.SIGSTOP)
    return tries

def computes(seconds, report):
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        pass
    return "done"

def sleeps(seconds, report):
    for _ in range(4 * seconds):
        time.sleep(0.25)
        report()
    return "done"

def fails(name, report):
    raise getattr(builtins, name)("of the task")

def greedy(size, report):
    return bytearray(size)

def endless(number, report):
    while True:
        report()
        report()
        time.sleep(0.1)

def main():
    from tqdm import tqdm
    from pipeline.base import workers
    list(workers.run(endless, {0: (0,), 1: (1,)}, tqdm()))

if __name__ == "__main__":
    run_stage(main)
"""


@pytest.fixture(scope="module")
def project(tmp_path_factory):
    """A project with TASKS as a module of the pipeline."""
    project = Project(tmp_path_factory.mktemp("cluster"))
    project.set(SETTINGS)
    (project.folder / "pipeline" / "made_tasks.py").write_text(TASKS)
    return project


@pytest.fixture(scope="module")
def client():
    """A client of a cluster of two workers on loopback."""
    settings = {"n_workers": 2, "threads_per_worker": 1, "host": "127.0.0.1", "dashboard_address": "127.0.0.1:0"}
    with distributed.LocalCluster(**settings) as started, started.get_client() as client:
        yield client


@pytest.fixture
def heard(client):
    """(number of the task, steps that it has done) in the order in which the workers report them."""
    messages = queue.SimpleQueue()
    client.subscribe_topic(cluster.TOPIC, lambda event: messages.put(event[1][1:3]))
    yield messages
    client.unsubscribe_topic(cluster.TOPIC)


@pytest.fixture
def run(project, client, monkeypatch):
    """`run(task, {key: arguments})` of TASKS on the cluster: the results."""
    monkeypatch.setattr(paths, "ROOT", project.folder)
    monkeypatch.setenv("WORKERS", client.scheduler.address)

    def results(name: str, tasks: dict, **more) -> dict:
        def task():
            pass

        task.__module__, task.__qualname__ = "pipeline.made_tasks", name
        try:
            with tqdm(total=len(tasks)) as bar:
                return dict(workers.run(task, tasks, bar, **more))
        finally:
            assert not list((project.folder / "data").glob("cluster-*"))

    return results


def models(project: Project) -> Path:
    return project.folder / "data" / "strain" / "models" / "lstm_direct"


def files(folder: Path) -> dict[str, bytes]:
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def start(project: Project, client, *command: str) -> subprocess.Popen:
    """A command whose tasks go to the cluster."""
    environment = project.environment | {"WORKERS": client.scheduler.address}
    command = [sys.executable, "-m", *command]
    return subprocess.Popen(command, cwd=project.folder, env=environment, stderr=subprocess.PIPE, text=True)


def two_under_way(heard) -> None:
    """Wait until both workers are in the middle of a task."""
    numbers = set()
    while len(numbers) < 2:
        numbers.add(heard.get(timeout=300)[0])


def worker_at(client, number: int) -> int:
    """Process id of the worker that is at a task."""
    found = client.run(
        lambda dask_worker: (
            os.getpid(),
            [key for key, task in dask_worker.state.tasks.items() if task.state == "executing"],
        )
    )
    (pid,) = (pid for pid, keys in found.values() if any(key.endswith(f"-{number}") for key in keys))
    return pid


def children(pid: int) -> list[psutil.Process]:
    return psutil.Process(pid).children()


def gone(processes: list[psutil.Process]) -> bool:
    return not psutil.wait_procs(processes, timeout=60)[1]


def test_a_lost_worker_changes_no_byte(project, client, heard):
    project.run("-c", PREPARE)
    local = files(models(project))
    shutil.rmtree(models(project))
    stage = start(project, client, "pipeline.stages.train", "strain")
    reports = [heard.get(timeout=300)]
    number, _ = reports[0]
    lost = worker_at(client, number)
    processes = children(lost)
    os.kill(lost, signal.SIGKILL)
    _, printed = stage.communicate(timeout=300)
    assert stage.returncode == 0, printed
    assert len(processes) == 1 and gone(processes)
    assert len(local) >= 3 * RUNS and files(models(project)) == local
    while not heard.empty():
        reports.append(heard.get())
    begun = sorted(number for number, done in reports if done == 1)
    assert begun == sorted([*range(RUNS), number])  # the lost task twice
    assert f"{EPOCHS * RUNS}/{EPOCHS * RUNS}" in printed.replace("\r", "\n").splitlines()[-1]


def test_a_killed_stage_leaves_nobody_computing(project, client, heard):
    stage = start(project, client, "pipeline.made_tasks")
    two_under_way(heard)
    processes = [process for pid in client.run(os.getpid).values() for process in children(pid)]
    assert len(processes) == 2
    stage.kill()
    stage.communicate()
    assert gone(processes)
    assert not list((project.folder / "data").glob("cluster-*"))


def test_tasks_run_with_one_thread_and_give_what_they_return(run):
    assert run("square", {"a": (3,), "b": (4,)}) == {"a": (9, "1"), "b": (16, "1")}


def test_a_process_that_is_killed_starts_again_from_nothing(run, tmp_path):
    place = tmp_path / "1"
    assert run("killed", {"a": (place,)}, folders={"a": place}) == {"a": 1}


def test_a_process_that_is_killed_every_time_is_one_sentence(run, tmp_path):
    place = tmp_path / "9"
    words = (
        r"^a, on \S+ \(tcp://127.0.0.1:\d+\): no result in 3 attempts, at the last one its process ended with status -9"
    )
    with pytest.raises(InputError, match=words):
        run("killed", {"a": (place,)}, folders={"a": place})


@pytest.fixture
def impatient(client):
    """Workers for which a process hangs after two seconds."""

    def wait(seconds):
        client.run(lambda: setattr(importlib.import_module("pipeline.base.cluster"), "STILL_S", seconds))

    wait(2)
    yield
    wait(cluster.STILL_S)


def test_a_process_that_hangs_is_killed_and_starts_again(run, impatient, tmp_path):
    place = tmp_path / "1"
    assert run("stopped", {"a": (place,)}, folders={"a": place}) == {"a": 1}


def test_a_process_that_hangs_every_time_is_one_sentence(run, impatient, tmp_path):
    place = tmp_path / "9"
    words = r"^a, on .* 3 attempts, at the last one its process hung: it neither computed nor reported for 2 s; look at"
    with pytest.raises(InputError, match=words):
        run("stopped", {"a": (place,)}, folders={"a": place})


@pytest.mark.parametrize("name", ["computes", "sleeps"])
def test_a_long_task_that_computes_or_reports_does_not_hang(run, impatient, name):
    assert run(name, {"a": (6,)}) == {"a": "done"}


@pytest.mark.parametrize("name", ["EOFError", "ConnectionResetError"])
def test_an_error_of_a_task_is_not_taken_for_a_lost_process(run, name):
    with pytest.raises(getattr(builtins, name), match="of the task"):
        run("fails", {"a": (name,)})


def test_a_task_without_memory_is_named(run):
    with pytest.raises(InputError, match=r"^press 0, on \S+: not enough memory \(.*; free memory"):
        run("greedy", {("press", 0): (1 << 60,)})


def test_bad_input_of_a_task_is_its_own_sentence(run):
    with pytest.raises(InputError, match=r"^log [12]: no such file; name one$"):
        run("refused", {"a": (1,), "b": (2,)})


def test_an_error_of_the_code_says_where_it_happened(run):
    with pytest.raises(KeyError) as error:
        run("wrong", {"a": (1,)})
    assert "return {}[number]" in error.value.__notes__[0]


def test_a_worker_that_does_not_see_the_folder_is_named(run, monkeypatch):
    monkeypatch.setattr(cluster, "_mark", lambda: nullcontext(Path("/elsewhere/data/mark")))
    with pytest.raises(InputError, match=r"^worker tcp://127.0.0.1:\d+ .* does not see this project's folder /\S+: "):
        run("square", {"a": (3,)})


def test_a_worker_of_other_versions_is_named(run, monkeypatch):
    monkeypatch.setattr(cluster, "versions", lambda: {"python": "3"})
    with pytest.raises(InputError, match=r"has python 3\.\d+\.\d+, this machine 3: results would differ"):
        run("square", {"a": (3,)})


def test_a_scheduler_that_does_not_answer_is_one_sentence(monkeypatch):
    with socket.create_server(("127.0.0.1", 0)) as free:
        address = f"tcp://127.0.0.1:{free.getsockname()[1]}"
    monkeypatch.setenv("WORKERS", address)
    with pytest.raises(InputError, match=f"WORKERS={address}: no Dask scheduler answers there .*refused"):
        list(workers.run(print, {"a": ()}, tqdm()))


def test_a_cluster_without_workers_is_one_sentence(project, monkeypatch):
    monkeypatch.setattr(paths, "ROOT", project.folder)
    monkeypatch.setattr(cluster, "NO_WORKER_S", 0.2)
    with distributed.LocalCluster(n_workers=0, host="127.0.0.1", dashboard_address="127.0.0.1:0") as empty:
        monkeypatch.setenv("WORKERS", empty.scheduler_address)
        with pytest.raises(InputError, match=r"no worker for 0.2 s; start one with `dask worker tcp://127.0.0.1:"):
            list(workers.run(print, {"a": ()}, tqdm()))


@pytest.mark.parametrize("given", ["0", "-1", "two", "1.5", "²", "localhost", "localhost:8786", "http://localhost:80"])
def test_a_wrong_setting_is_one_sentence(given, monkeypatch):
    monkeypatch.setenv("WORKERS", given)
    with pytest.raises(InputError, match=f"WORKERS={given}: expected a whole number of 1 or more, or a Dask scheduler"):
        workers.count()


def test_the_documented_commands_listen_to_nobody_else():
    """Documented commands with loopback for HOST: every port that they open, their dashboards' too, is loopback's."""
    lines = [line.partition("#")[0] for line in (ROOT / "docs" / "runs.md").read_text().splitlines()]
    commands = [line.split() for line in lines if line.startswith("dask ")]
    assert [command[1] for command in commands] == ["scheduler", "worker"]
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = str(free.getsockname()[1])
    loopback = {"HOST": "127.0.0.1", "MACHINE": "127.0.0.1", "8786": port, ":8787": ":0"}
    started = []
    try:
        for command, more in zip(commands, (["--port", port], ["--nthreads", "1"]), strict=True):
            words = [re.sub("|".join(loopback), lambda found: loopback[found[0]], word) for word in command]
            started.append(subprocess.Popen([sys.executable, "-m", *words, *more], stderr=subprocess.DEVNULL))
        with distributed.Client(f"tcp://127.0.0.1:{port}", timeout=60) as client:
            client.wait_for_workers(1, timeout=60)
            processes = [psutil.Process(popen.pid) for popen in started]
            processes += [child for process in processes for child in process.children(recursive=True)]
            ports = [one.laddr for process in processes for one in process.net_connections() if one.status == "LISTEN"]
            dashboards = [client.scheduler_info()["services"]["dashboard"]]
            dashboards += [worker["services"]["dashboard"] for worker in client.scheduler_info()["workers"].values()]
    finally:
        for popen in reversed(started):
            popen.terminate()
            popen.wait(timeout=60)
    assert {int(port), *dashboards} <= {address.port for address in ports}
    assert {address.ip for address in ports} == {"127.0.0.1"}, ports
