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
from collections.abc import Iterable, Iterator
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


class Port:
    """A serial port, opened; its device may vanish and come back."""

    def __init__(self, name: str, baud: int, stop: Stop):
        """Open it. Raises InputError where pyserial is absent and where the port cannot be opened."""
        try:
            import serial
        except ModuleNotFoundError as error:
            raise InputError(
                "pyserial is not installed; run `pip install -c constraints.txt -e '.[record]'`"
            ) from error
        self.name, self.stop = name, stop
        self._open = lambda: serial.Serial(name, baud, timeout=WAIT_S)
        try:
            self.device = self._open()
        except (OSError, ValueError, OverflowError) as error:  # SerialException is an OSError
            raise InputError(
                f"{name}: cannot be opened ({error}); check the name, the cable and your rights"
            ) from error

    def chunks(self) -> Iterator[bytes | None]:
        """Yield bytes as they come, b"" where none came for WAIT_S, and None where the device vanished, until `stop`.

        Then the bytes that are under way follow, and the rest of the line that is arriving.
        """
        heard, lines, partial = time.monotonic(), 0, False
        while not self.stop:
            try:
                data = self.device.read(self.device.in_waiting or 1)
            except OSError as error:
                self.device.close()
                yield None
                _say(f"{self.name}: gone ({error}); waiting for it, {lines} lines so far")
                self.device, partial = self._reopened(), False
                if self.device is None:
                    return
                _say(f"{self.name}: back")
                heard = time.monotonic()
                continue
            yield data
            if data:
                heard, partial = time.monotonic(), not data.endswith(b"\n")
                lines += data.count(b"\n")
            elif time.monotonic() - heard > SILENT_S:
                _say(f"{self.name}: nothing arrives; right port, right baud rate, device started?")
                heard = float("inf")  # said once
        yield from self._last(partial)

    def _reopened(self):
        """Wait for the port; return it once it is back, or None if `stop` comes first."""
        while not self.stop:
            try:
                return self._open()
            except OSError:  # still away, which `chunks` has said already
                time.sleep(RETRY_S)
        return None

    def _last(self, partial: bool) -> Iterator[bytes]:
        """Yield the bytes that are under way (until the device pauses), and the rest of the line that is arriving."""
        try:
            end = time.monotonic() + LAST_LINE_S
            while time.monotonic() < end and (data := self.device.read(self.device.in_waiting or 1)):
                yield data
                partial = not data.endswith(b"\n")
            if partial:
                self.device.timeout = LAST_LINE_S
                yield self.device.read_until(b"\n")
            self.device.close()
        except OSError as error:
            _say(f"gone at the last moment ({error}); all that arrived is in the log")


def recorded(chunks: Iterable[bytes | None], log: Log) -> Iterator[bytes | None]:
    """Yield the chunks of a port once they are in the log; close the log at the end. Raises InputError as `Log`."""
    try:
        for data in chunks:
            if data is None:
                log.tear()
            else:
                log.add(data)
            yield data
    finally:
        log.close()


def record(port: str, target: Path, baud: int, stop: Stop) -> int:
    """Record until `stop` and return the number of whole lines. Raises InputError as `Port` and `Log`."""
    source = Port(port, baud, stop)
    log = Log(target)
    _say(f"recording {port} at {baud} baud to {target}; Ctrl-C ends it")
    for _ in recorded(source.chunks(), log):
        pass
    return log.lines


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
