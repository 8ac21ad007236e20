"""Run tasks on a Dask cluster whose machines share the project's folder: the numbers are as on local cores.

A Dask worker computes nothing itself: for each stage it starts a process of one thread for each task that it does at a
time, which runs the present code. They end with the stage, and are killed where no stage waits for them any more.
"""

import contextlib
import importlib
import os
import platform
import subprocess
import sys
import tempfile
import threading
import traceback
import uuid
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from importlib.metadata import version
from multiprocessing import Pipe
from multiprocessing.connection import Connection
from pathlib import Path
from typing import TypeVar

from tactile.base import files
from tactile.base.errors import InputError, memory_error
from tactile.base.paths import CODE
from tactile.base.processes import KEEP_MEMORY, ONE_THREAD, die_with_parent

Result = TypeVar("Result")
CONNECT_S, NO_WORKER_S = 10, 60
LOOK_S = 0.2  # between two looks at whether a stage waits for its task
ANSWER = "import sys; from tactile.base import cluster; cluster.answer(int(sys.argv[1]))"
NUMBERS = ("numpy", "pyarrow", "scikit-learn", "scipy", "torch")  # packages whose version may change a result
_processes: dict[tuple[str, int], tuple[subprocess.Popen, Connection]] = {}  # of a worker, by stage's mark and thread


def run(address: str, function: Callable[..., Result], calls: Mapping[str, tuple]) -> Iterator[tuple[str, Result]]:
    """Do tasks, as `workers.run`, on the cluster of the Dask scheduler at `address`; yield (name, result).

    A lost worker's task starts again on another. calls: name -> (arguments, the new folder that the task makes or
    None). Raises InputError without the scheduler or any worker, for a worker that does not see the project's folder or
    has other versions, and for a task whose process is killed, or over which worker after worker is lost.
    """
    from distributed import CancelledError, Client, KilledWorker, as_completed

    try:
        client = Client(address, timeout=CONNECT_S, set_as_default=False)
    except (OSError, ValueError) as error:  # ValueError: no such port
        raise InputError(f"WORKERS={address}: no Dask scheduler answers there ({error}); start one") from error
    root = Path.cwd()
    started = sys.modules["__main__"].__spec__  # of a stage, which is run as a module
    module = started.name if started and function.__module__ == "__main__" else function.__module__
    with client, tempfile.NamedTemporaryFile(dir=root, suffix=".unfinished") as mark:
        try:
            client.wait_for_workers(1, timeout=NO_WORKER_S)
        except TimeoutError as error:
            raise InputError(f"{address}: no worker for {NO_WORKER_S} s; start one and repeat the command") from error
        here, futures = (str(root), mark.name, versions()), {}
        for name, (arguments, folder) in calls.items():
            # As one call without arguments: Dask looks for names of other tasks in arguments.
            call = partial(_on_worker, here, name, (module, function.__qualname__, arguments), folder)
            futures[client.submit(call, key=f"{name} {uuid.uuid4().hex}", pure=False)] = name
        for future in as_completed(futures, loop=client.loop):
            name = futures[future]
            try:
                result, failed = future.result()
            except KilledWorker as error:
                lost = f"{error.allowed_failures + 1} workers in turn were lost over this task"
                raise InputError(f"{name}: {lost}; look at the log of the last one") from error
            except CancelledError as error:
                raise InputError(f"{address}: the Dask scheduler is gone; start it and repeat the command") from error
            if failed is not None and memory_error(failed) is not None:
                raise InputError(f"{name}: {memory_error(failed)}; free memory on the worker's machine") from failed
            if failed is not None:
                raise failed
            yield name, result
        client.run(end, mark.name)


def versions() -> dict[str, str]:
    """Return the versions of Python and of the packages that compute."""
    return {"python": platform.python_version()} | {name: version(name) for name in NUMBERS}


def _on_worker(
    here: tuple[str, str, dict], name: str, task: tuple[str, str, tuple], folder: Path | None
) -> tuple[object, Exception | None]:
    """Do a task in the process of this worker's thread; return its result and its error.

    here: the stage's current folder, a file in it that is new, and the versions that are wanted; task: module,
    function and arguments.
    """
    from distributed import get_worker

    worker, (root, mark, wanted) = get_worker(), here
    key, called = worker.get_current_task(), f"worker {worker.address} ({platform.node()})"
    if not Path(mark).is_file():
        raise InputError(f"{called} does not see this project's folder {root}, which all need under that path")
    if wrong := [f"{of} {found}, not {wanted[of]}" for of, found in versions().items() if found != wanted[of]]:
        raise InputError(f"{called} has {', '.join(wrong)}: results would differ; install the same (constraints.txt)")
    if folder is not None:
        files.remove_folder(folder, inside=folder.parent)  # of a worker that was lost while it wrote
    process, channel = _process(mark, root)
    try:
        channel.send(task)
        while not channel.poll(LOOK_S):
            state = worker.state.tasks.get(key)
            if state is None or state.state != "executing":  # the stage was killed
                process.kill()
        return channel.recv()
    except (EOFError, OSError) as error:
        ended = f"its process ended with status {process.wait()} (-9: killed, as when memory is short)"
        end(mark)
        raise InputError(f"{name}, on {called}: {ended}; look at the worker's log") from error


def _process(mark: str, root: str) -> tuple[subprocess.Popen, Connection]:
    """Return the process that does this stage's tasks for the calling thread, with the present code, and its pipe.

    It is kept for the next task, as to import torch takes seconds. Those of other stages, which were killed, end.
    """
    for other in {stage for stage, _ in _processes if stage != mark}:
        end(other)
    place = mark, threading.get_ident()
    if place not in _processes:
        ours, theirs = Pipe()
        command = [sys.executable, "-c", ANSWER, str(theirs.fileno())]
        code = os.pathsep.join([str(CODE.parent), *filter(None, [os.environ.get("PYTHONPATH")])])
        environment = {"GLIBC_TUNABLES": KEEP_MEMORY} | os.environ | ONE_THREAD | {"PYTHONPATH": code}
        process = subprocess.Popen(
            command, cwd=root, env=environment, stdin=subprocess.DEVNULL, pass_fds=[theirs.fileno()]
        )
        theirs.close()
        _processes[place] = process, ours
    return _processes[place]


def end(mark: str) -> None:
    """End the processes that this worker keeps for a stage, whatever they are at."""
    for place in [place for place in _processes if place[0] == mark]:
        process, channel = _processes.pop(place)
        process.kill()
        process.wait()
        channel.close()


def answer(channel: int) -> None:
    """Do the tasks that come from a pipe, and send the result and the error of each; channel: number of its file."""
    die_with_parent()
    with Connection(channel) as pipe, contextlib.suppress(EOFError):  # the worker has ended
        while True:
            module, function, arguments = pipe.recv()
            try:
                reply: tuple[object, Exception | None] = (
                    getattr(importlib.import_module(module), function)(*arguments, lambda *_: None),
                    None,
                )
            except Exception as error:
                error.add_note(f"On {platform.node()}:\n{traceback.format_exc()}")
                reply = None, error
            pipe.send(reply)
