"""Record what a device prints on a serial port, as it comes.

Bytes are written unchanged, whole lines at a time, so that the file can be read while it grows. If this program is
killed, the line that is arriving is lost; if the computer loses its power, the lines of the last SYNC_S as well: the
disk has all lines before. The device may vanish and come back: recording goes on when the port does, and the part of a
line that the device had printed when it vanished becomes a line of its own, which ingest rejects. Ctrl-C ends the
recording after the line that is arriving; a line that does not end within LAST_LINE_S is kept as it came.
"""

import argparse
import os
import signal
import sys
import time
from pathlib import Path

from pipeline.base.errors import InputError

BAUD = 115200
WAIT_S = 0.1  # longest wait for bytes: how soon Ctrl-C is seen
RETRY_S = 0.3  # between two attempts to open a port that vanished
LAST_LINE_S = 0.5  # after Ctrl-C, for bytes that are under way and for the rest of a line, each
SYNC_S = 1.0  # between two calls of fsync, each of which takes milliseconds
SILENT_S = 5.0  # a device that prints nothing for so long is reported


class Stop:
    """True once Ctrl-C or a request to end has come; a signal never interrupts a read, whose bytes would be lost."""

    def __init__(self):
        self.wanted = False
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, self._stop)

    def _stop(self, number, frame) -> None:
        self.wanted = True

    def __bool__(self) -> bool:
        return self.wanted


class Log:
    """The growing file: takes bytes as they come, writes whole lines; InputError where the disk refuses them."""

    def __init__(self, path: Path):
        self.path, self.lines, self.rest = path, 0, b""
        self.safe, self.synced = 0, time.monotonic()  # lines that the disk has, and since when it has them
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            self.file = path.open("xb")
        except FileExistsError as error:
            raise InputError(f"{path}: exists already and is never overwritten; give another name") from error
        except OSError as error:
            raise InputError(f"{path}: cannot be written ({error.strerror}); give another place") from error

    def add(self, data: bytes) -> None:
        """Write all lines that are whole with these bytes (or none), keep the rest, and sync where it is due."""
        whole, end, self.rest = (self.rest + data).rpartition(b"\n")
        self._write(whole + end)
        if self.lines > self.safe and time.monotonic() - self.synced >= SYNC_S:
            self.sync()

    def tear(self) -> None:
        """End a line that will never be whole, so that it does not become one with the next."""
        if self.rest:
            self._write(self.rest + b"\n")
            self.rest = b""
        self.sync()

    def close(self) -> None:
        """Write the last, partial line as it came."""
        self._write(self.rest)
        self.sync()
        self.file.close()

    def sync(self) -> None:
        """Wait until the disk has all that was written."""
        try:
            os.fsync(self.file.fileno())
        except OSError as error:
            raise self._cannot(error) from error
        self.safe, self.synced = self.lines, time.monotonic()

    def _write(self, data: bytes) -> None:
        try:
            self.file.write(data)
            self.file.flush()
        except OSError as error:
            raise self._cannot(error) from error
        self.lines += data.count(b"\n")

    def _cannot(self, error: OSError) -> InputError:
        return InputError(f"{self.path}: cannot be written ({error.strerror}); its first {self.safe} lines are safe")


def record(port: str, target: Path, baud: int, stop: Stop) -> int:
    """Record until `stop` and return the number of whole lines. Raises InputError as `Log`, and if there is no port."""
    try:
        import serial
    except ModuleNotFoundError as error:
        raise InputError("pyserial is not installed; run `pip install -c constraints.txt -e '.[record]'`") from error

    def opened():
        return serial.Serial(port, baud, timeout=WAIT_S)

    try:
        device = opened()
    except (OSError, ValueError, OverflowError) as error:  # SerialException is an OSError
        raise InputError(f"{port}: cannot be opened ({error}); check the name, the cable and your rights") from error
    log = Log(target)
    _say(f"recording {port} at {baud} baud to {target}; Ctrl-C ends it")
    heard = time.monotonic()
    while not stop:
        try:
            data = device.read(device.in_waiting or 1)
        except OSError as error:
            device.close()
            log.tear()
            _say(f"{port}: gone ({error}); waiting for it, {log.lines} lines so far")
            device = _reopened(opened, stop)
            if device is not None:
                _say(f"{port}: back")
            heard = time.monotonic()
            continue
        log.add(data)
        if data:
            heard = time.monotonic()
        elif time.monotonic() - heard > SILENT_S:
            _say(f"{port}: nothing arrives; right port, right baud rate, device started?")
            heard = float("inf")  # said once
    if device is not None:
        _finish(device, log)
    log.close()
    return log.lines


def _reopened(opened, stop: Stop):
    """Wait for the port; return it once it is back, or None if `stop` comes first."""
    while not stop:
        try:
            return opened()
        except OSError:  # still away, which `record` has said already
            time.sleep(RETRY_S)
    return None


def _finish(device, log: Log) -> None:
    """Read the bytes that are under way (until the device pauses), and the rest of the line that is arriving."""
    try:
        end = time.monotonic() + LAST_LINE_S
        while (data := device.read(device.in_waiting or 1)) and time.monotonic() < end:
            log.add(data)
        log.add(data)
        if log.rest:
            device.timeout = LAST_LINE_S
            log.add(device.read_until(b"\n"))
        device.close()
    except OSError as error:
        _say(f"gone at the last moment ({error}); all that arrived is in the log")


def _say(sentence: str) -> None:
    print(sentence, file=sys.stderr, flush=True)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the port, the new file and the baud rate to the parser of this command."""
    parser.add_argument("port", metavar="PORT", help="such as /dev/ttyUSB0, /dev/tty.usbmodem1 or COM3")
    parser.add_argument(
        "file", type=Path, metavar="FILE", help="a new file, such as data/own/finger/single/run000/array.log"
    )
    parser.add_argument("--baud", type=int, default=BAUD, metavar="N", help=f"symbols per second (default {BAUD})")


def main(given: argparse.Namespace) -> None:
    """Record from the port named on the command line."""
    lines = record(given.port, given.file, given.baud, Stop())
    print(f"{given.file}: {lines} lines")
