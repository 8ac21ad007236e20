"""A pseudo-terminal in place of a device on a serial port."""

import os
import time
import tty
from collections.abc import Callable
from pathlib import Path

WAIT_S = 120  # longest wait of a test for something to happen: a busy machine takes a while, a hang for ever


class Device:
    """A pseudo-terminal whose end for programs is at a path that stays, like a serial port's."""

    def __init__(self, path: Path):
        self.path = path
        self.plug()

    def plug(self) -> None:
        """Be there, with nothing printed yet."""
        self.end, program_end = os.openpty()
        tty.setraw(program_end)
        self.path.symlink_to(os.ttyname(program_end))
        self.other = program_end  # open, so that the device is there before and after the program

    def print(self, data: bytes) -> None:
        """Print bytes; waits for a program that reads them where they are more than 4 kB."""
        while data:  # the terminal takes 4 kB at a time
            data = data[os.write(self.end, data[:1024]) :]

    def unplug(self) -> None:
        """Be gone."""
        self.path.unlink()
        os.close(self.end)
        os.close(self.other)


def until(condition: Callable[[], bool], limit_s: float = WAIT_S) -> None:
    """Wait for it, or fail."""
    deadline = time.monotonic() + limit_s
    while not condition():
        assert time.monotonic() < deadline, "never happened"
        time.sleep(0.01)
