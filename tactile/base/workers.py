"""Run independent tasks in parallel processes: local ones, which die with the stage that started them, or a cluster."""

import multiprocessing
import os
import re
import signal
from collections import Counter, deque
from collections.abc import Callable, Hashable, Iterator, Mapping
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from multiprocessing.queues import SimpleQueue
from pathlib import Path
from types import MappingProxyType
from typing import TypeVar

from threadpoolctl import threadpool_limits
from tqdm import tqdm

from tactile.base.errors import InputError, memory_error
from tactile.base.processes import KEEP_MEMORY, ONE_THREAD, die_with_parent

Key = TypeVar("Key", bound=Hashable)
Result = TypeVar("Result")
REPORT_S = 0.2  # between two looks at what tasks have reported
_reports: SimpleQueue  # of a worker's process: where its tasks report to
ADVICE = "free memory or make its settings smaller, and run the command again"


def count() -> int | str:
    """Return the number of local processes, or a Dask scheduler's address: the variable WORKERS, else the cores."""
    given = os.environ.get("WORKERS", "")
    if re.fullmatch(r"(tcp|tls)://\S+:\d+", given):
        return given
    if given and (not given.isdecimal() or int(given) < 1):
        raise InputError(
            f"WORKERS={given}: expected a whole number of 1 or more, or a Dask scheduler's address (tcp://HOST:8786)"
        )
    if given:
        return int(given)
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def run(
    function: Callable[..., Result],
    tasks: Mapping[Key, tuple],
    bar: tqdm,
    steps: int | Mapping[Key, int] = 1,
    folders: Mapping[Key, Path] = MappingProxyType({}),
) -> Iterator[tuple[Key, Result]]:
    """Call `function(*arguments, report)` for every task in processes of one thread; yield (key, result).

    Results come as they finish. `bar` moves by one for every call of `report` in a task (on a cluster it does not) and,
    at a task's end, by what is left of its `steps` (a training that diverged), one number for all tasks or one for each
    key. An error of a task is raised here. Where one process is enough, it is this one: to start another takes 3 s.
    Raises InputError that names the task whose process is killed or that gets no memory. `folders`: the new folder that
    a task makes, if it makes one; of a task that a cluster starts again, what is there is removed first.
    """
    processes = count()
    steps = steps if isinstance(steps, Mapping) else dict.fromkeys(tasks, steps)
    if isinstance(processes, str):
        from tactile.base import cluster

        names = {_called(bar, key): key for key in tasks}
        calls = {name: (tasks[key], folders.get(key)) for name, key in names.items()}
        for name, result in cluster.run(processes, function, calls):
            bar.update(steps[names[name]])
            yield names[name], result
    elif min(processes, len(tasks)) == 1:
        yield from _in_turn(function, tasks, bar, steps)
    else:
        yield from _in_processes(min(processes, len(tasks)), function, tasks, bar, steps)


def _called(bar: tqdm, key: Hashable) -> str:
    """Return the name of a task in messages: the words of the bar and the key."""
    words = " ".join(map(str, key)) if isinstance(key, tuple) else str(key)
    return f"{bar.desc}, {words}" if bar.desc else words


def _note(numbers: tuple) -> str:
    """Return the text on the bar for the numbers of `report(epoch, epochs, loss, ...)`."""
    return " ".join(f"{value:.4g}" for value in numbers[2:])


def _in_turn(
    function: Callable[..., Result], tasks: Mapping[Key, tuple], bar: tqdm, steps: Mapping[Key, int]
) -> Iterator[tuple[Key, Result]]:
    """Do the tasks in this process, one after the other."""
    with threadpool_limits(1):
        for key, arguments in tasks.items():
            done = 0

            def report(*numbers: float) -> None:
                nonlocal done
                done += 1
                bar.set_postfix_str(_note(numbers), refresh=False)
                bar.update(1)

            try:
                result = function(*arguments, report)
            except Exception as error:
                if memory_error(error) is None:
                    raise
                raise InputError(f"{_called(bar, key)}: {memory_error(error)}; {ADVICE}") from error
            bar.update(steps[key] - done)
            yield key, result


def _in_processes(
    most: int, function: Callable[..., Result], tasks: Mapping[Key, tuple], bar: tqdm, steps: Mapping[Key, int]
) -> Iterator[tuple[Key, Result]]:
    """Do the tasks in `most` processes, each a pool of its own: so it is known which task a killed one was at."""
    os.environ.setdefault("GLIBC_TUNABLES", KEEP_MEMORY)  # read where a process starts
    context, others = multiprocessing.get_context("spawn"), set(multiprocessing.active_children())
    reports = context.SimpleQueue()
    pools = [ProcessPoolExecutor(1, context, _begin, (reports,)) for _ in range(most)]
    left, idle = deque(tasks.items()), list(pools)
    running: dict[Future[Result], tuple[Key, ProcessPoolExecutor]] = {}
    done: Counter[Key] = Counter()
    try:
        while left or running:
            while left and idle:
                pool, (key, arguments) = idle.pop(), left.popleft()
                running[_submitted(pool, key, function, arguments)] = key, pool
            finished, _ = wait(running, REPORT_S, FIRST_COMPLETED)
            while not reports.empty():
                key, words = reports.get()
                done[key] += 1
                bar.set_postfix_str(words, refresh=False)
                bar.update(1)
            for future in finished:
                key, pool = running.pop(future)
                try:
                    result = future.result()
                except BrokenProcessPool as error:
                    reason = "its process ended without a result, as one does that is killed for lack of memory"
                    raise InputError(f"{_called(bar, key)}: {reason}; {ADVICE}") from error
                except Exception as error:
                    if memory_error(error) is None:
                        raise
                    raise InputError(f"{_called(bar, key)}: {memory_error(error)}; {ADVICE}") from error
                idle.append(pool)
                bar.update(steps[key] - done[key])
                yield key, result
    finally:
        for process in set(multiprocessing.active_children()) - others:
            process.kill()  # to wait for what it is at may take an hour
        for pool in pools:
            pool.shutdown(cancel_futures=True)


def _submitted(
    pool: ProcessPoolExecutor, key: Hashable, function: Callable[..., Result], arguments: tuple
) -> Future[Result]:
    """Give a task to a pool; a process that starts for it inherits the block: Ctrl-C goes to the stage alone."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])
    try:
        return pool.submit(_answer, key, function, arguments)
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _begin(reports: SimpleQueue) -> None:
    """Set up a process for its tasks; `reports`: the queue that all processes share."""
    global _reports
    die_with_parent()
    os.environ |= ONE_THREAD
    threadpool_limits(1)  # of what the stage's own module has imported before this
    _reports = reports


def _answer(key: Hashable, function: Callable[..., Result], arguments: tuple) -> Result:
    """Do a task; (key, note) goes to the queue for every report."""
    return function(*arguments, lambda *numbers: _reports.put((key, _note(numbers))))
