"""Run independent tasks on a Dask cluster whose machines share the project's folder: the numbers are as on local cores.

A Dask worker computes nothing itself: each of its threads hands its task to a process of one thread, as on local
cores. The process is new in every stage, so that it runs the present code, ends with its worker, and is killed when no
stage waits for its task any more.
"""

import importlib
import logging
import os
import platform
import queue
import socket
import subprocess
import sys
import tempfile
import threading
import time
import uuid
from collections.abc import Callable, Hashable, Iterator, Mapping
from contextlib import contextmanager, suppress
from importlib.metadata import version
from multiprocessing import Pipe
from multiprocessing.connection import Connection
from pathlib import Path
from typing import NamedTuple
from urllib.parse import urlsplit

from tqdm import tqdm

from pipeline.base import files, paths, workers
from pipeline.base.errors import InputError, memory_error
from pipeline.base.processes import die_with_parent

CONNECT_S = 10
NO_WORKER_S = 60  # without a single worker a stage waits this long: one that was lost may come back
REPORT_S = 0.2  # between two reports of a task, which pass through the scheduler
IDLE_S = 60  # a process that got no task for so long ends
ATTEMPTS = 3  # at a task whose process is killed or hangs while its worker lives on
STILL_S = 600  # a process that has neither used its core nor reported for so long hangs; an epoch may last hours
TOPIC = "tactile-reproduction progress"
NUMBERS = ("numpy", "pyarrow", "scikit-learn", "scipy", "torch")  # packages whose version may change a result
SERVE = "import sys; from pipeline.base import cluster; cluster.serve(int(sys.argv[1]))"


class Job(NamedTuple):
    """The part that all tasks of one run share; `mark`: a file that exists in the project while the stage runs."""

    name: str
    root: str
    mark: str
    versions: dict[str, str]


class Task(NamedTuple):
    """One call of `function` of `module` with `arguments`.

    `folder`: the folder that the call makes anew, None where it replaces files; `called`: the task's name in messages.
    """

    called: str
    module: str
    function: str
    arguments: tuple
    folder: Path | None


class Process(NamedTuple):
    """A process of the worker, and the end of the pipe to it."""

    job: str
    popen: subprocess.Popen
    pipe: Connection


def run(
    address: str,
    function: Callable,
    tasks: Mapping[Hashable, tuple],
    bar: tqdm,
    steps: Mapping[Hashable, int],
    folders: Mapping[Hashable, Path],
) -> Iterator[tuple[Hashable, object]]:
    """Run tasks as `workers.run`, on the cluster of the Dask scheduler at `address`; restart tasks of lost workers.

    Raises InputError without the scheduler or any worker, for a worker that does not see the project's folder or has
    other versions of what computes, and for a task whose workers or processes are lost time and again.
    """
    module = sys.modules["__main__"].__spec__.name if function.__module__ == "__main__" else function.__module__
    heard: queue.SimpleQueue = queue.SimpleQueue()
    with _connected(address) as client, _mark() as mark:
        job = Job(uuid.uuid4().hex, str(paths.ROOT), str(mark), versions())
        client.subscribe_topic(TOPIC, lambda event: heard.put(event[1]))
        waiting = {}
        for number, (key, arguments) in enumerate(tasks.items()):
            task = Task(workers.called(bar, key), module, function.__qualname__, arguments, folders.get(key))
            future = client.submit(call, job, number, task, key=f"{job.name}-{number}", pure=False)
            waiting[future] = number, key, task.called
        done_steps, last_seen = [0] * len(tasks), time.monotonic()
        while waiting:
            time.sleep(0.2)
            _advance(heard, job, done_steps, bar)
            if client.scheduler_info().get("workers"):
                last_seen = time.monotonic()
            elif time.monotonic() - last_seen > NO_WORKER_S:
                raise InputError(
                    f"{address}: no worker for {NO_WORKER_S} s; start one with `dask worker {address} "
                    "--dashboard-address 127.0.0.1:0` "
                    "and run the command again"
                )
            for future in [future for future in waiting if future.done()]:
                number, key, called = waiting.pop(future)
                result = _result(future, address, called)
                bar.update(steps[key] - done_steps[number])
                done_steps[number] = None
                yield key, result


def versions() -> dict[str, str]:
    """Return the versions of Python and of the packages that compute."""
    return {"python": platform.python_version()} | {name: version(name) for name in NUMBERS}


@contextmanager
def _connected(address: str) -> Iterator:
    """Give the block a Dask client; raise InputError where no scheduler answers."""
    try:
        from distributed import Client
    except ModuleNotFoundError as error:
        raise InputError(
            f"WORKERS={address}: a Dask cluster needs `pip install -c constraints.txt -e '.[cluster]'` first"
        ) from error
    place = urlsplit(address)
    try:
        with socket.create_connection((place.hostname, place.port), CONNECT_S):  # Dask would try on and on
            pass
        for name in ("distributed", "distributed.client"):  # what they print is one sentence here and below
            logging.getLogger(name).setLevel(logging.CRITICAL)
        client = Client(address, timeout=CONNECT_S, set_as_default=False)
    except (OSError, ValueError) as error:  # ValueError: no such port
        raise InputError(
            f"WORKERS={address}: no Dask scheduler answers there ({error}); start one with "
            "`dask scheduler --dashboard-address 127.0.0.1:8787`"
        ) from error
    with client:
        yield client


@contextmanager
def _mark() -> Iterator[Path]:
    """Give the block a new file in the project's folder, by which a worker can tell that it sees this very folder."""
    folder = paths.ROOT / "data"
    folder.mkdir(exist_ok=True)
    handle, name = tempfile.mkstemp(dir=folder, prefix="cluster-", suffix=".unfinished")
    os.close(handle)
    try:
        yield Path(name)
    finally:
        Path(name).unlink(missing_ok=True)


def _advance(heard: queue.SimpleQueue, job: Job, done_steps: list[int | None], bar: tqdm) -> None:
    """Move the bar to the steps that tasks have reported, and back where a task had to start again."""
    while not heard.empty():
        name, number, done, note = heard.get()
        if name == job.name and done_steps[number] is not None:
            bar.set_postfix_str(note, refresh=False)
            bar.update(done - done_steps[number])
            done_steps[number] = done


def _result(future, address: str, called: str):
    """Return the result of a task that is done; raise InputError where workers or the scheduler are lost."""
    from distributed import CancelledError, KilledWorker

    try:
        return future.result()
    except KilledWorker as error:
        raise InputError(
            f"{called}: {error.allowed_failures + 1} workers in turn were lost over this task; look at the log of the "
            "last one (too little memory?) and run the command again"
        ) from error
    except CancelledError as error:
        raise InputError(f"{address}: the Dask scheduler is gone; start it and run the command again") from error


# What follows runs on the cluster.

_own = threading.local()  # .process: the process of this thread of the worker


def call(job: Job, number: int, task: Task):
    """Run one task in this thread's process, in the worker's name; returns what the task returns."""
    from distributed import get_worker

    worker = get_worker()
    key = worker.get_current_task()
    _check(job, worker.address)

    def wanted() -> bool:
        state = worker.state.tasks.get(key)
        return state is not None and state.state == "executing"

    def report(done: int, note: str) -> None:
        worker.log_event(TOPIC, (job.name, number, done, note))

    for _ in range(ATTEMPTS):
        if task.folder is not None:
            files.remove_folder(task.folder, inside=task.folder.parent)  # of a worker that was lost while it wrote
        process = _process(job)
        kind, value = _outcome(process, job, task, wanted, report)
        if kind == "result":
            return value
        if kind == "error" and memory_error(value) is not None:
            raise InputError(f"{task.called}, on {platform.node()}: {memory_error(value)}; {workers.ADVICE}") from value
        if kind == "error":
            raise value
        print(f"{task.called}: {value}", file=sys.stderr)
    raise InputError(
        f"{task.called}, on {platform.node()} ({worker.address}): no result in {ATTEMPTS} attempts, at the last one "
        f"{value}; look at the worker's log"
    )


def _check(job: Job, address: str) -> None:
    """Raise InputError for a worker that does not see the project's folder or has other versions."""
    if not Path(job.mark).is_file():
        raise InputError(
            f"worker {address} ({platform.node()}) does not see this project's folder {job.root}: every worker needs "
            "it under that path (a shared file system)"
        )
    for name, here in versions().items():
        if here != job.versions[name]:
            raise InputError(
                f"worker {address} ({platform.node()}) has {name} {here}, this machine {job.versions[name]}: results "
                "would differ; install the same there (constraints.txt)"
            )


def _process(job: Job) -> Process:
    """Return this thread's process, a new one where the last was of another job or has ended."""
    last = getattr(_own, "process", None)
    if last is not None and (last.job != job.name or last.popen.poll() is not None):
        last.pipe.close()
        _end(last)
        last = None
    if last is None:
        ours, theirs = Pipe()
        with theirs:
            popen = subprocess.Popen(
                [sys.executable, "-c", SERVE, str(theirs.fileno())],
                cwd=job.root,
                env={"GLIBC_TUNABLES": workers.KEEP_MEMORY} | os.environ | workers.ONE_THREAD,
                stdin=subprocess.DEVNULL,
                pass_fds=[theirs.fileno()],
            )
        last = _own.process = Process(job.name, popen, ours)
    return last


def _end(process: Process) -> None:
    """Kill a process."""
    process.popen.kill()
    with suppress(subprocess.TimeoutExpired):  # a process that waits for a dead disk ends with it, not before
        process.popen.wait(timeout=10)


def _outcome(
    process: Process, job: Job, task: Task, wanted: Callable[[], bool], report: Callable[[int, str], None]
) -> tuple[str, object]:
    """Have the process do the task: ("result", value), ("error", what it raised) or ("lost", why: it ended or hung)."""
    done, reported, used_s, alive = 0, 0.0, 0.0, time.monotonic()
    try:
        process.pipe.send((task.module, task.function, task.arguments))
        while True:
            if not wanted():
                Path(job.mark).unlink(missing_ok=True)  # of a stage that was killed
                _end(process)
                raise RuntimeError("nobody waits for this task any more")
            if not process.pipe.poll(0.5):
                if (now_s := _processor_s(process)) > used_s:
                    used_s, alive = now_s, time.monotonic()
                elif time.monotonic() - alive > STILL_S:
                    _end(process)
                    return "lost", f"its process hung: it neither computed nor reported for {STILL_S} s"
                continue
            kind, value = process.pipe.recv()
            alive = time.monotonic()
            if kind != "step":
                return kind, value
            done += 1
            if time.monotonic() - reported > REPORT_S:
                report(done, value)
                reported = time.monotonic()
    except (EOFError, ConnectionError):
        return "lost", workers.ended(process.popen.wait())


def _processor_s(process: Process) -> float:
    """Return the seconds that the process has computed, by itself and for the system; 0 where it has ended."""
    import psutil

    try:
        times = psutil.Process(process.popen.pid).cpu_times()
    except psutil.Error:
        return 0.0
    return times.user + times.system


def serve(handle: int) -> None:
    """Do the tasks that come through the pipe with this handle, one after the other, until it closes."""
    die_with_parent()
    with Connection(handle) as pipe:
        while pipe.poll(IDLE_S):
            try:
                module, function, arguments = pipe.recv()
            except EOFError:
                return
            workers.answer(pipe, _named, (module, function, *arguments))


def _named(module: str, function: str, *arguments):
    """Call a function by the names of its module and itself."""
    return getattr(importlib.import_module(module), function)(*arguments)
