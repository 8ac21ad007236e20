"""Record what devices print on serial ports, or send over a network, as it comes.

Bytes are written unchanged, whole lines at a time, so that a file can be read while it grows; what has no line end is
written after HELD_S, or once it is HELD bytes. If this program is killed, what is held back then is lost; if the
computer loses its power, the bytes of the last SYNC_S as well: the disk has all before. A device may vanish and come
back: recording goes on when the port does, and the part of a line that the device had printed when it vanished becomes
a line of its own, which ingest rejects. Ctrl-C, a request to end, and the terminal's being closed end the recording
after the line that is arriving; a line that does not end within LAST_LINE_S is kept as it came.

Several ports, each with its file, are recorded side by side. With --stamp every line begins with the microseconds
since this program started, on one clock for all ports: for devices that print no time. It is the moment at which the
end of the line was read, or, of a line that took longer than HELD_S, at which its beginning was written. A USB adapter
hands bytes on in packets, every 1 to 16 ms: lines that come several at a time get times apart as at their rate so far,
none later than the moment at which it was read. --start sends a line to the device, --start-after seconds after the
port was opened, since many boards start anew then and hear nothing while they do; --every repeats it: for devices that
print when they are asked.

PORT may be a place in a network: tcp://HOST:PORT is a server of the device, udp://HOST:PORT where this computer waits
for datagrams, each of which ends a line.

Examples:

    tactile record /dev/ttyACM0 data/own/finger/bend/run0/daq.log
    tactile record /dev/ttyACM0 array.log /dev/ttyACM1 load_cell.log --baud 115200 9600
    tactile record tcp://192.168.4.1:23 data/own/finger/single/run0/array.log
"""

import argparse
import errno
import os
import re
import signal
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, wait
from pathlib import Path
from typing import TextIO

from tactile.base.errors import InputError
from tactile.base.paths import Workspace
from tactile.logs import layout, network

BAUD = 115200
ENDS = (b"\n", b"\r")  # of a line
LINE = re.compile(rb"[^\r\n]+")
PRINTABLE = frozenset(range(32, 127)) | frozenset(b"\t\r\n")
WAIT_S = 0.1  # longest wait for bytes: how soon Ctrl-C is seen
RETRY_S = 0.3  # between two attempts to open a port that vanished
LAST_LINE_S = 0.5  # after Ctrl-C, for bytes that are under way and for the rest of a line, each
SYNC_S = 1.0  # between two calls of fsync, each of which takes milliseconds
HELD_S = 0.9  # that bytes without a line end are held back; seen WAIT_S later at most, within a second
HELD = 1 << 16  # bytes without a line end that are held back
SILENT_S = 5.0  # a device that prints nothing, or no end of a line, for so long is reported
BOOT_S = 2.0  # that an Arduino takes to start, which it does when its port is opened
JUDGED = 400  # bytes after which it is clear whether they are text
TEXT = 0.9  # share of bytes that are printable in what a device prints; of a wrong baud rate about a third are
DELIMITED = 0.5  # such a share of a device that prints one or two control characters as delimiters, such as NUL or ETX
PROGRESS_S = 1.0  # between two reports of the lines so far, on a terminal
PACKET_US = 32_000  # that an adapter and a busy computer may keep a line
SILENT_US = 100_000  # without a line; the rate of lines is then taken anew
SEVERAL = 1.1  # lines a read, of lines that come in packets
HURRY = 1.002  # times the rate's interval, so that times stay close to those of the lines that came without delay


class Stop:
    """True once Ctrl-C, a request to end or the end of the terminal has come.

    A signal never interrupts a read, whose bytes would be lost.
    """

    def __init__(self):
        self.wanted = False
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, self._stop)
        # Windows has none; with `nohup` it is ignored, and the recording goes on without the terminal.
        if hasattr(signal, "SIGHUP") and signal.getsignal(signal.SIGHUP) != signal.SIG_IGN:
            signal.signal(signal.SIGHUP, self._stop)

    def _stop(self, number, frame) -> None:
        self.wanted = True

    def __bool__(self) -> bool:
        return self.wanted


class Log:
    """The growing file: takes bytes as they come, writes whole lines, and in time what has no line end.

    Raises InputError where the disk refuses them.
    """

    def __init__(self, path: Path, clock_us: Callable[[], int] | None = None):
        """path: a new file; clock_us: gives the time that is put before every line, None where none is."""
        self.path, self.lines, self.rest = path, 0, b""
        self._held = 0.0  # since when there is a rest
        self._end: bytes | None = None  # of a line: LF, or CR where a device prints no other; None: none was seen
        self._last = b""  # byte, read or written
        self._begun = False  # a line that was written in part goes on
        self._stamps = None if clock_us is None else Stamps(clock_us)
        self.safe, self._is_safe, self.synced = 0, True, time.monotonic()  # lines and bytes that the disk has, since
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            self.file = path.open("xb")
        except FileExistsError as error:
            raise InputError(f"{path}: exists already and is never overwritten; give another name") from error
        except OSError as error:
            raise InputError(f"{path}: cannot be written ({error.strerror}); give another place") from error

    def add(self, data: bytes) -> None:
        """Write all lines that are whole with these bytes (or none) and a rest that is due; sync where that is due."""
        now = time.monotonic()
        if data:
            self._find_end(data)
            cut = 0 if self._end is None else data.rfind(self._end) + 1
            if cut:
                self._write(self.rest + data[:cut])
                self.rest = b""
            if not self.rest:
                self._held = now
            self.rest += data[cut:]
            self._last = data[-1:]
        if self.rest and (len(self.rest) >= HELD or now - self._held >= HELD_S):
            self._write(self.rest)
            self.rest = b""
        if not self._is_safe and time.monotonic() - self.synced >= SYNC_S:
            self.sync()

    def _find_end(self, data: bytes) -> None:
        """Learn from the next bytes what ends a line."""
        if self._end == b"\n":
            return
        if b"\n" in data:
            self._end = b"\n"
        elif self._end is None and layout.line_end((self._last + data).decode("latin-1")):
            self._end = b"\r"
            if not self.rest and self._last == b"\r":  # which was written before it was known to end a line
                self.lines += 1
            whole, end, self.rest = self.rest.rpartition(b"\r")
            self._write(whole + end)

    def tear(self) -> None:
        """End a line that will never be whole, so that it does not become one with the next."""
        if self.rest or self._begun:
            self._write(self.rest + (self._end or b"\n"))
            self.rest = b""
        self.sync()

    def close(self) -> None:
        """Write the last, partial line as it came."""
        self._write(self.rest)
        self.rest = b""
        self.sync()
        self.file.close()

    def _stamped(self, lines: bytes) -> bytes:
        """Return lines that were read at once, with the time before each that begins here."""
        if self._stamps is None:
            return lines
        begun = LINE.match(lines).end() if self._begun and LINE.match(lines) else 0
        count = len(LINE.findall(lines, begun))
        if not count:
            return lines
        times = iter(self._stamps.of(count))
        return lines[:begun] + LINE.sub(lambda line: b"%d,%s" % (next(times), line[0]), lines[begun:])

    def sync(self) -> None:
        """Wait until the disk has all that was written."""
        try:
            os.fsync(self.file.fileno())
        except OSError as error:
            raise self._cannot(error) from error
        self.safe, self._is_safe, self.synced = self.lines, True, time.monotonic()

    def _write(self, data: bytes) -> None:
        if not data:
            return
        try:
            self.file.write(self._stamped(data))
            self.file.flush()
        except OSError as error:
            raise self._cannot(error) from error
        self.lines += data.count(self._end or b"\n")
        self._is_safe, self._begun = False, not data.endswith(ENDS)

    def _cannot(self, error: OSError) -> InputError:
        return InputError(f"{self.path}: cannot be written ({error.strerror}); its first {self.safe} lines are safe")


class Stamps:
    """Gives times to lines as they are read, in whole microseconds that rise from line to line."""

    def __init__(self, clock_us: Callable[[], int]):
        self._clock_us, self._last_us, self._read_us = clock_us, -1, -SILENT_US
        self._first_us, self._lines, self._reads = 0, 0, 0  # since lines have come without a silence

    def of(self, count: int) -> list[int]:
        """Return the times of `count` lines that were read now, and at once.

        Where reads bring several lines, each is one interval of their rate after the one before, but not later than now
        and not earlier than PACKET_US ago. Else it is now.
        """
        now = self._clock_us()
        if now - self._read_us >= SILENT_US:
            self._first_us, self._lines, self._reads = now, 0, 0
            interval_us = 0.0
        else:
            self._lines, self._reads = self._lines + count, self._reads + 1
            interval_us = (now - self._first_us) / self._lines
        self._read_us = now
        earliest = now - max(PACKET_US, count * interval_us) if self._lines >= SEVERAL * self._reads > 0 else now
        times, due_us = [], float(self._last_us)
        for _ in range(count):
            due_us = min(max(due_us + HURRY * interval_us, earliest), now)
            self._last_us = max(round(due_us), self._last_us + 1)
            times.append(self._last_us)
        return times


class Port:
    """A serial port, opened; its device may vanish and come back."""

    def __init__(
        self,
        name: str,
        baud: int,
        stop: Stop,
        start: bytes = b"",
        every_s: float | None = None,
        after_s: float = BOOT_S,
    ):
        """Open it. Raises InputError where the port cannot be opened.

        start: bytes that the device gets `after_s` seconds after it was opened, and again every `every_s` seconds if
        that is said.
        """
        import serial
        from serial.tools import list_ports

        self.name, self.stop = name, stop
        self._start, self._every_s, self._due = start, every_s or float("inf"), float("inf")

        def opened():
            networked = network.is_address(name)
            device = network.NetworkPort(name, WAIT_S) if networked else serial.Serial(name, baud, timeout=WAIT_S)
            if start:
                self._due = time.monotonic() + after_s
            return device

        self._open = opened
        try:
            self.device = self._open()
        except (OSError, ValueError, OverflowError) as error:  # SerialException is an OSError
            why = os.strerror(error.errno) if getattr(error, "errno", None) else error
            if network.is_address(name):
                raise InputError(
                    f"{name}: cannot be opened ({why}); check address and port, and that the device is on and in this "
                    "network"
                ) from error
            there = ", ".join(sorted(port.device for port in list_ports.comports())) or "none"
            raise InputError(
                f"{name}: cannot be opened ({why}); check the name, the cable and your rights (ports that are there: "
                f"{there})"
            ) from error

    def chunks(self) -> Iterator[bytes | None]:
        """Yield bytes as they come, b"" where none came for WAIT_S, and None where the device vanished, until `stop`.

        Then the bytes that are under way follow, and the rest of the line that is arriving.
        """
        heard, lines, partial, text = time.monotonic(), 0, False, _Text(self.name)
        while not self.stop:
            try:
                if time.monotonic() >= self._due:
                    self.device.write(self._start)
                    self._due = time.monotonic() + self._every_s
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
                text.judge(data)
                heard, partial = time.monotonic(), not data.endswith(ENDS)
                lines += data.count(b"\n") or data.count(b"\r")
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
                partial = not data.endswith(ENDS)
            if partial:
                self.device.timeout = LAST_LINE_S
                yield self.device.read_until(b"\n")
            self.device.close()
        except OSError as error:
            _say(f"gone at the last moment ({error}); all that arrived is in the log")


class _Text:
    """Says, each once, where what a device prints is hardly text (its baud rate is another), and where no line ends."""

    def __init__(self, name: str):
        self.name, self.seen, self.printable, self.odd, self.judged = name, 0, 0, set(), False
        self.since, self.endless = None, False  # since when bytes have come without an end; that was said

    def judge(self, data: bytes) -> None:
        """Take the next bytes."""
        if not self.judged:
            self._judge_bytes(data)
        if not self.endless:
            self._judge_ends(data)

    def _judge_bytes(self, data: bytes) -> None:
        odd = [byte for byte in data if byte not in PRINTABLE]
        self.seen, self.printable = self.seen + len(data), self.printable + len(data) - len(odd)
        self.odd.update(odd)
        if self.seen < JUDGED:
            return
        self.judged, share = True, self.printable / self.seen
        delimited = len(self.odd) <= 2 and max(self.odd, default=0) < 32
        if share < (DELIMITED if delimited else TEXT):
            _say(
                f"{self.name}: only {100 * share:.0f} % of what arrives are printable characters; is --baud the "
                "device's rate (9600, 57600, 115200, ...)?"
            )

    def _judge_ends(self, data: bytes) -> None:
        now = time.monotonic()
        if any(end in data for end in ENDS):
            self.since = None if data.endswith(ENDS) else now
        elif self.since is None:
            self.since = now
        elif now - self.since > SILENT_S:
            self.endless = True
            _say(
                f"{self.name}: bytes arrive, but no end of a line (LF or CR) in {SILENT_S:g} s, and only whole lines "
                "can be read; let the device end each reading by LF, and see that --baud is its rate"
            )


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


def record(ports: Sequence[Port], logs: Sequence[Log], stop: Stop) -> None:
    """Record each port to its log until `stop`. Raises InputError as `Log`; then all ports are at an end."""

    def one(port: Port, log: Log) -> None:
        try:
            for _ in recorded(port.chunks(), log):
                pass
        finally:
            stop.wanted = True

    with ThreadPoolExecutor(len(ports)) as threads:
        running = [threads.submit(one, port, log) for port, log in zip(ports, logs, strict=True)]
        while not all(each.done() for each in running):
            counts = [log.lines for log in logs]
            wait(running, timeout=PROGRESS_S)
            if sys.stderr.isatty():
                each = (
                    f"{log.path.name} {log.lines} lines, {(log.lines - before) / PROGRESS_S:.0f} a second"
                    for log, before in zip(logs, counts, strict=True)
                )
                say(f"\r{'; '.join(each)}\033[K", end="")
    for each in running:
        each.result()


def say(words: str, file: TextIO | None = None, end: str = "\n") -> None:
    """Print words to the user, on standard error or on `file`; where the terminal is gone, to nobody from here on."""
    file = file or sys.stderr
    try:
        print(words, end=end, file=file, flush=True)
    except OSError as error:
        if error.errno != errno.EIO:
            raise
        silence(file)


def silence(file: TextIO) -> None:
    """Let nobody get what is written to a standard stream from here on, nor what it still holds."""
    nobody = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nobody, file.fileno())
    os.close(nobody)


def _say(sentence: str) -> None:
    say(f"\r\033[K{sentence}" if sys.stderr.isatty() else sentence)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add ports with their new files, baud rates, stamps and what is sent to the parser of this command."""
    parser.add_argument(
        "places",
        nargs="+",
        metavar="PORT FILE",
        help="such as /dev/ttyUSB0, /dev/tty.usbmodem1, COM3 or tcp://HOST:PORT, and a new file, such as "
        "data/own/finger/single/run000/array.log",
    )
    parser.add_argument(
        "--baud", type=int, nargs="+", default=[BAUD], metavar="N", help=f"of all ports, or of each (default {BAUD})"
    )
    parser.add_argument("--stamp", action="store_true", help="put this computer's time before every line")
    parser.add_argument("--start", default="", metavar="TEXT", help="a line that is sent to each device at first")
    parser.add_argument(
        "--start-after",
        type=float,
        default=BOOT_S,
        metavar="SECONDS",
        help="that a board takes to start once its port is open (default %(default)g)",
    )
    parser.add_argument("--every", type=float, metavar="SECONDS", help="send the line of --start again and again")


def main(_: Workspace, given: argparse.Namespace) -> None:
    """Record from the ports named on the command line."""
    names, files = given.places[::2], [Path(name) for name in given.places[1::2]]
    if len(names) != len(files):
        raise InputError(f"{names[-1]}: give a file for each port: `tactile record PORT FILE PORT FILE`")
    bauds = given.baud * len(names) if len(given.baud) == 1 else given.baud
    if len(bauds) != len(names):
        raise InputError(f"--baud: {len(bauds)} rates for {len(names)} ports; give one, or one for each port")
    if given.every is not None and (given.every <= 0 or not given.start):
        raise InputError("--every: needs a time above 0 and --start, the line that is sent")
    if not given.start_after >= 0:
        raise InputError(f"--start-after {given.start_after:g}: must be 0 or more seconds")
    stop, began = Stop(), time.monotonic_ns()
    start = given.start.encode() + b"\n" if given.start else b""
    ports = [
        Port(name, baud, stop, start, given.every, given.start_after) for name, baud in zip(names, bauds, strict=True)
    ]
    logs = [Log(path, (lambda: (time.monotonic_ns() - began) // 1000) if given.stamp else None) for path in files]
    for port, baud, log in zip(ports, bauds, logs, strict=True):
        rate = "" if network.is_address(port.name) else f" at {baud} baud"
        _say(f"recording {port.name}{rate} to {log.path}; Ctrl-C ends it")
    record(ports, logs, stop)
    for log in logs:
        say(f"{log.path}: {log.lines} lines", sys.stdout)
