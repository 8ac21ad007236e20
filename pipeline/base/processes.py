"""Keep processes from writing where they should not: after their parent has ended, or beside another one."""

import ctypes
import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None


def die_with_parent() -> None:
    """Have Linux end this process when its parent ends or is killed; on other systems do nothing."""
    if sys.platform == "linux":
        pr_set_pdeathsig = 1
        ctypes.CDLL(None).prctl(pr_set_pdeathsig, signal.SIGKILL)


@contextmanager
def holding(lock: Path, when_busy: Callable[[], None]) -> Iterator[None]:
    """Hold a lock file during the block; where another process holds it, call `when_busy`, then wait.

    `when_busy` may raise. The operating system frees the lock when the process ends, however it ends. A system
    without such locks gets a sentence.
    """
    lock.parent.mkdir(parents=True, exist_ok=True)
    with open(lock, "w") as file:
        if fcntl is None:
            print(f"this system cannot lock {lock}: start nothing else that writes to {lock.parent}", file=sys.stderr)
        else:
            try:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                when_busy()
                fcntl.flock(file, fcntl.LOCK_EX)
        yield
