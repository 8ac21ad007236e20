"""Independent tasks in parallel processes: local ones that die with the stage that started them, or a cluster's."""

import multiprocessing
import os
import queue
import re
from collections.abc import Callable, Hashable, Iterator, Mapping
from concurrent.futures import FIRST_COMPLETED, ProcessPoolExecutor, wait
from pathlib import Path
from types import MappingProxyType

from threadpoolctl import threadpool_limits
from tqdm import tqdm

from pipeline.errors import InputError
from pipeline.parent import die_with_parent

# glibc's allocator: large pieces of memory are kept and lie in huge pages. Fresh memory costs a page fault each 4 kB,
# which takes a tenth of the training of a convolutional network.
KEEP_MEMORY = "glibc.malloc.hugetlb=1:glibc.malloc.mmap_max=0:glibc.malloc.trim_threshold=4000000000"
KEEP_MEMORY += ":glibc.malloc.top_pad=67108864"

# For a process's environment before its first import of numpy and torch: their thread pools are sized when they load.
ONE_THREAD = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")

_progress = None  # in a worker process: where its reports go


def count() -> int | str:
    """Number of local processes, or the address of a Dask scheduler: the variable WORKERS, else the cores."""
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
    steps: int = 1,
    folders: Mapping[Hashable, Path] = MappingProxyType({}),
) -> Iterator[tuple[Hashable, object]]:
    """Call `function(*arguments, report)` for every task in processes of one thread; yield (key, result).

    Results come as they finish. `bar` moves by one for every call of `report` in a task and, at a task's end,
    by what is left of its `steps` (early stopping). An InputError of a task is raised here. Where one process is
    enough, it is this one: to start another takes 3 s. `folders`: the new folder that a task makes, if it makes one;
    a cluster removes what a lost worker left of it.
    """
    processes = count()
    if isinstance(processes, str):
        from pipeline import cluster

        yield from cluster.run(processes, function, tasks, bar, steps, folders)
        return
    if min(processes, len(tasks)) == 1:
        yield from _in_turn(function, tasks, bar, steps)
        return
    context = multiprocessing.get_context("spawn")
    os.environ.setdefault("GLIBC_TUNABLES", KEEP_MEMORY)  # read where a process starts
    progress = context.Queue()
    with ProcessPoolExecutor(min(processes, len(tasks)), context, initializer=_start, initargs=(progress,)) as pool:
        futures = {
            pool.submit(_call, function, arguments, number): (number, key)
            for number, (key, arguments) in enumerate(tasks.items())
        }
        done_steps = [0] * len(tasks)
        waiting = set(futures)
        try:
            while waiting:
                finished, waiting = wait(waiting, timeout=0.2, return_when=FIRST_COMPLETED)
                _advance(progress, done_steps, bar)
                for future in finished:
                    number, key = futures[future]
                    result = future.result()
                    bar.update(steps - done_steps[number])
                    yield key, result
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            for process in multiprocessing.active_children():
                process.terminate()
            raise


def _in_turn(function: Callable, tasks: Mapping, bar: tqdm, steps: int) -> Iterator[tuple[Hashable, object]]:
    with threadpool_limits(1):
        for key, arguments in tasks.items():
            done = 0

            def report(*numbers) -> None:
                nonlocal done
                done += 1
                bar.set_postfix_str(note(numbers), refresh=False)
                bar.update(1)

            result = function(*arguments, report)
            bar.update(steps - done)
            yield key, result


def note(numbers: tuple) -> str:
    """What the bar shows of `report(epoch, epochs, loss, ...)`."""
    return " ".join(f"{value:.4g}" for value in numbers[2:])


def _advance(progress, done_steps: list[int], bar: tqdm) -> None:
    while True:
        try:
            number, note = progress.get_nowait()
        except queue.Empty:
            return
        done_steps[number] += 1
        bar.set_postfix_str(note, refresh=False)
        bar.update(1)


def _start(reports) -> None:
    global _progress
    _progress = reports
    die_with_parent()
    os.environ |= ONE_THREAD


def _call(function: Callable, arguments: tuple, number: int):
    def report(*numbers) -> None:
        _progress.put((number, note(numbers)))

    return function(*arguments, report)
