"""End a process when its parent ends: a killed `dvc repro` leaves no process that writes."""

import ctypes
import signal
import sys


def die_with_parent() -> None:
    """Have Linux end this process when its parent ends or is killed; on other systems do nothing."""
    if sys.platform == "linux":
        pr_set_pdeathsig = 1
        ctypes.CDLL(None).prctl(pr_set_pdeathsig, signal.SIGKILL)
