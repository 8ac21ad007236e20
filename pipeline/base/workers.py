"""Run independent tasks in parallel processes: local ones, which die with the stage that started them, or a cluster."""

import multiprocessing
import os
import platform
import re
import signal
import sys
import traceback
from collections import deque
from collections.abc import Callable, Hashable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from multiprocessing.resource_tracker import ensure_running
from pathlib import Path
from types import MappingProxyType

from threadpoolctl import threadpool_limits
from tqdm import tqdm

from pipeline.base import files
from pipeline.base.errors import InputError, memory_error
from pipeline.base.processes import die_with_parent

# glibc's allocator: large pieces of memory are kept and lie in huge pages. Fresh memory costs a page fault each 4 kB,
# which takes a tenth of the training of a convolutional network.
KEEP_MEMORY = "glibc.malloc.hugetlb=1:glibc.malloc.mmap_max=0:glibc.malloc.trim_threshold=4000000000"
KEEP_MEMORY += ":glibc.malloc.top_pad=67108864"

# For a process's environment before its first import of numpy and torch: their thread pools are sized when they load.
ONE_THREAD = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")

ADVICE = "free memory or make its settings smaller, and run the command again"


@dataclass
class Worker:
    """A local process, the end of the pipe to it, and the task that it runs."""

    process: BaseProcess
    pipe: Connection
    key: Hashable = None
    done: int = 0  # steps of the task that it has reported
    alone: bool = False  # no other task was begun beside this one, nor will be


def count() -> int | str:
    """Return the number of local processes, or a Dask scheduler's address: the variable WORKERS, else the cores."""
    given = os.environ.get("WORKERS", "")
    if re.fullmatch(r"(tcp|tls)://\S+:\d+", given):
        return given
    if given and (not given.isdecimal() or int(given) < 1):
        raise InputError(
            f"WORKERS={given}: expected a whole number of 1 or more, or a Dask scheduler's address (tcp://HOST:8786)"
        )
    return int(given) if given else len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()


def run(
    function: Callable,
    tasks: Mapping[Hashable, tuple],
    bar: tqdm,
    steps: int | Mapping[Hashable, int] = 1,
    folders: Mapping[Hashable, Path] = MappingProxyType({}),
) -> Iterator[tuple[Hashable, object]]:
    """Call `function(*arguments, report)` for every task in processes of one thread; yield (key, result).

    Results come as they finish. `bar` moves by one for every call of `report` in a task and, at a task's end,
    by what is left of its `steps` (a training that diverged), one number for all tasks or one for each key. An
    InputError of a task is raised here. Where one process is enough, it is this one: to start another takes 3 s.
    `folders`: the new folder that a task makes, if it makes one; what a lost process left of it is removed. A task
    whose process is killed, or gets no memory, starts again beside one task fewer; InputError names it if that happens
    where it is alone.
    """
    processes = count()
    steps = steps if isinstance(steps, Mapping) else dict.fromkeys(tasks, steps)
    if isinstance(processes, str):
        from pipeline.base import cluster

        yield from cluster.run(processes, function, tasks, bar, steps, folders)
    elif min(processes, len(tasks)) == 1:
        yield from _in_turn(function, tasks, bar, steps)
    else:
        yield from _in_processes(min(processes, len(tasks)), function, tasks, bar, steps, folders)


def called(bar: tqdm, key: Hashable) -> str:
    """Return the name of a task in messages: the words of the bar and the key."""
    words = " ".join(map(str, key)) if isinstance(key, tuple) else str(key)
    return f"{bar.desc}, {words}" if bar.desc else words


def ended(status: int) -> str:
    """Return the words for a process that ended without a result."""
    return f"its process ended with status {status} (-9: killed, as when memory is short)"


def note(numbers: tuple) -> str:
    """Return the text on the bar for the numbers of `report(epoch, epochs, loss, ...)`."""
    return " ".join(f"{value:.4g}" for value in numbers[2:])


def answer(pipe: Connection, function: Callable, arguments: tuple) -> None:
    """Do a task: send ("step", note) for every report, at last ("result", value) or ("error", exception)."""
    try:
        reply = "result", function(*arguments, lambda *numbers: pipe.send(("step", note(numbers))))
    except Exception as error:
        if not isinstance(error, InputError):
            error.add_note(f"On {platform.node()}:\n{traceback.format_exc()}")
        reply = "error", error
    try:
        pipe.send(reply)
    except Exception as error:  # a reply that cannot be sent: a lock or an open file belongs to one process
        pipe.send(("error", RuntimeError(f"{error}: {reply[1]!r}")))


def _in_turn(function: Callable, tasks: Mapping, bar: tqdm, steps: Mapping) -> Iterator[tuple[Hashable, object]]:
    """Do the tasks in this process, one after the other."""
    with threadpool_limits(1):
        for key, arguments in tasks.items():
            done = 0

            def report(*numbers) -> None:
                nonlocal done
                done += 1
                bar.set_postfix_str(note(numbers), refresh=False)
                bar.update(1)

            try:
                result = function(*arguments, report)
            except Exception as error:
                if memory_error(error) is None:
                    raise
                raise InputError(f"{called(bar, key)}: {memory_error(error)}; {ADVICE}") from error
            bar.update(steps[key] - done)
            yield key, result


def _in_processes(
    most: int, function: Callable, tasks: Mapping, bar: tqdm, steps: Mapping, folders: Mapping
) -> Iterator[tuple[Hashable, object]]:
    """Do the tasks in at most `most` processes at a time."""
    left, idle, busy = deque(tasks), [], {}
    try:
        while left or busy:
            while left and len(busy) < most:
                worker = idle.pop() if idle else _start()
                worker.key, worker.done, worker.alone = left.popleft(), 0, most == 1
                with suppress(ConnectionError):  # the process has ended: its pipe says so below
                    worker.pipe.send((function, tasks[worker.key]))
                busy[worker.pipe] = worker
            for pipe in wait(busy):
                worker = busy[pipe]
                try:
                    kind, value = pipe.recv()
                except (EOFError, ConnectionError):
                    kind, value = "lost", None
                if kind == "step":
                    worker.done += 1
                    bar.set_postfix_str(value, refresh=False)
                    bar.update(1)
                    continue
                del busy[pipe]
                if kind == "result":
                    idle.append(worker)
                    bar.update(steps[worker.key] - worker.done)
                    yield worker.key, value
                    continue
                _end(worker)
                if kind == "error" and memory_error(value) is None:
                    raise value
                reason = memory_error(value) if kind == "error" else ended(worker.process.exitcode)
                if worker.alone:
                    raise InputError(f"{called(bar, worker.key)}: {reason}; {ADVICE}") from value
                most = max(1, min(most - 1, len(busy)))  # as many as were at work beside it
                bar.write(f"{called(bar, worker.key)}: {reason}; it starts again, {most} at a time now", sys.stderr)
                bar.update(-worker.done)
                if worker.key in folders:
                    files.remove_folder(folders[worker.key], inside=folders[worker.key].parent)
                left.append(worker.key)
            while idle and len(idle) + len(busy) > most:  # idle processes hold memory
                _end(idle.pop())
    finally:
        for worker in (*idle, *busy.values()):
            _end(worker)


def _start() -> Worker:
    """Start a process that does tasks, one after the other; a terminal's Ctrl-C goes to the stage alone."""
    context = multiprocessing.get_context("spawn")
    os.environ.setdefault("GLIBC_TUNABLES", KEEP_MEMORY)  # read where a process starts
    ours, theirs = context.Pipe()
    process = context.Process(target=_serve, args=(theirs,))
    ensure_running()  # Python's own helper, whose start would unblock the signal
    before = signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])  # the new process inherits the block
    try:
        process.start()
    finally:
        theirs.close()
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
    return Worker(process, ours)


def _end(worker: Worker) -> None:
    worker.process.kill()
    worker.process.join()
    worker.pipe.close()


def _serve(pipe: Connection) -> None:
    """Do the tasks that come through the pipe until it closes."""
    die_with_parent()
    os.environ |= ONE_THREAD
    with threadpool_limits(1):  # of what the stage's own module has imported before this
        while True:
            try:
                function, arguments = pipe.recv()
            except EOFError:
                return
            answer(pipe, function, arguments)
