"""Processes that end when the one that started them does: a killed `dvc repro` leaves nobody writing."""

import ctypes
import signal
import sys


def die_with_parent() -> None:
    """Have Linux end this process when its parent ends, even where that is killed; elsewhere do nothing."""
    if sys.platform == "linux":
        pr_set_pdeathsig = 1
        ctypes.CDLL(None).prctl(pr_set_pdeathsig, signal.SIGKILL)
