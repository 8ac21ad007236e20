"""How a process that computes is set up: one thread, memory that it keeps, an end with its parent's, and locks.

Only the standard library is imported: evidence/run.py begins where nothing else may be installed yet.
"""

import ctypes
import os
import platform
import re
import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None  # type: ignore[assignment]  # `holding` asks for it

# glibc's allocator: large pieces of memory are kept and lie in huge pages. Fresh memory costs a page fault each 4 kB,
# which takes a tenth of the training of a convolutional network.
KEEP_MEMORY = "glibc.malloc.hugetlb=1:glibc.malloc.mmap_max=0:glibc.malloc.trim_threshold=4000000000"
KEEP_MEMORY += ":glibc.malloc.top_pad=67108864"

# For a process's environment before its first import of numpy and torch: their thread pools are sized when they load.
ONE_THREAD = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")


def die_with_parent() -> None:
    """Have Linux end this process when its parent ends or is killed: a killed `dvc repro` leaves none that writes."""
    if sys.platform == "linux":
        pr_set_pdeathsig = 1
        ctypes.CDLL(None).prctl(pr_set_pdeathsig, signal.SIGKILL)


def processor() -> str:
    """Return the make of this machine's processor."""
    try:
        with open("/proc/cpuinfo", encoding="utf-8") as file:
            names = [line.partition(":")[2].strip() for line in file if line.startswith("model name")]
    except OSError:
        names = []
    return names[0] if names else platform.processor() or platform.machine()


def make() -> str:
    """Return who made this machine's processor, the first word of its name: AMD, Intel, Apple."""
    return re.split(r"[^A-Za-z]", processor().strip(), maxsplit=1)[0] or "unknown"


def memory_bytes() -> float:
    """Return how much memory this machine has; inf where the system does not say it."""
    try:
        return float(os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE"))
    except (AttributeError, ValueError, OSError):  # Windows has none of these names
        return float("inf")


@contextmanager
def holding(lock: Path, when_busy: Callable[[], None]) -> Iterator[None]:
    """Hold a lock file during the block; where another process holds it, call `when_busy`, then wait.

    `when_busy` may raise. The operating system frees the lock when the process ends, however it ends. A system, or
    a file system, without such locks gets a sentence.
    """
    lock.parent.mkdir(parents=True, exist_ok=True)
    with open(lock, "w") as file:
        try:
            if fcntl is None:
                raise OSError("no locks")
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            when_busy()
            fcntl.flock(file, fcntl.LOCK_EX)
        except OSError:  # Windows, and some file systems of a network
            print(f"cannot lock {lock} here: start nothing else that writes to {lock.parent}", file=sys.stderr)
        yield


def torch_on_one_thread() -> None:
    """Have torch take one thread from now on, if it is loaded."""
    if torch := sys.modules.get("torch"):
        torch.set_num_threads(1)
