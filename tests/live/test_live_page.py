"""A device on a serial port, the command, and the page in a real browser: all as a user has them."""

import contextlib
import os
import pty
import signal
import subprocess
import sys
import threading
import time

import numpy as np
import pytest
from builders.devices import Device, until
from builders.live_models import press, printed
from builders.project import ROOT

pytestmark = pytest.mark.slow
SECONDS = 4  # that the device prints


def command(*arguments: str) -> subprocess.Popen:
    line = [sys.executable, "-m", "tactile.commands.command_line", "live", *arguments]
    return subprocess.Popen(line, cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def ended(process: subprocess.Popen) -> tuple[str, str]:
    """Ask a process to end, and return what it printed."""
    process.terminate()
    try:
        return process.communicate(timeout=120)
    finally:
        process.kill()


def test_a_device_is_shown_recorded_and_may_vanish(tmp_path, package, tab):
    device, log = Device(tmp_path / "port"), tmp_path / "array.log"
    places = "--port", str(device.path), "--record", str(log), "--http-port", "0"
    process = command(str(package("linear")), *places)
    try:
        lines = iter(process.stderr.readline, "")
        address = next(line.split()[0] for line in lines if line.startswith("http://127.0.0.1"))
        tab.width(1000)
        tab.open(address)
        data = printed(press(50 * SECONDS)).splitlines(keepends=True)

        def play(part: list[bytes]) -> None:
            for line in part:
                device.print(line)
                time.sleep(0.02)

        playing = threading.Thread(target=play, args=(data[:-20],))
        playing.start()
        until(lambda: "1 touch;" in tab.run("document.body.innerText"), 30)
        playing.join()
        words = tab.run("document.body.innerText")
        assert "Line to picture" in words and "Rejected lines" in words
        colours = "new Set(document.querySelector('canvas').getContext('2d').getImageData(0, 0, 400, 300).data).size"
        assert tab.run(colours) > 20, "a map is drawn"
        device.unplug()
        until(lambda: any("gone" in line for line in [process.stderr.readline()]), 30)
        device.plug()
        until(lambda: any("back" in line for line in [process.stderr.readline()]), 30)
        play(data[-20:])
        assert all(request.startswith((address, "data:")) for request in tab.requests), "nothing from elsewhere"
        assert tab.problems == []
    finally:
        _, said = ended(process)
    assert f"{len(data)} lines, " in said
    assert log.read_bytes() == b"".join(data)
    assert process.returncode == 0


def test_a_terminal_that_is_closed_ends_a_session_which_records_all(tmp_path, package):
    """With CSV on the terminal: it cannot be written any more, and what is under way is recorded."""
    device, log = Device(tmp_path / "port"), tmp_path / "array.log"
    data = printed(press(100))
    line = [sys.executable, "-m", "tactile.commands.command_line", "live", str(package("linear")), "--csv"]
    line += ["--port", str(device.path), "--record", str(log)]
    child, terminal = pty.fork()  # in a session of its own, of which it is the terminal
    if not child:
        os.chdir(ROOT)
        os.execv(sys.executable, line)
    os.set_blocking(terminal, False)
    shown, ends = [], []

    def rows() -> int:
        with contextlib.suppress(BlockingIOError):
            shown.append(os.read(terminal, 1 << 16))
        return b"".join(shown).partition(b"t_s,latency_ms")[2].count(b"\n")

    try:
        until(lambda: rows() > 0, 60)
        device.print(data[:-30])
        until(lambda: rows() > 60)
        os.close(terminal)
        device.print(data[-30:-3])
        until(lambda: ends.append(os.waitpid(child, os.WNOHANG)) or ends[-1][0])
    finally:
        with contextlib.suppress(ProcessLookupError):
            os.kill(child, signal.SIGKILL)
    assert os.waitstatus_to_exitcode(ends[-1][1]) == 0
    assert log.read_bytes() == data[:-3]


def test_a_replay_ends_by_itself(tmp_path, package):
    log = tmp_path / "array.log"
    log.write_bytes(printed(press(100)))
    process = command(str(package("linear")), "--replay", str(log), "--speed", "10", "--csv")
    said, notes = process.communicate(timeout=120)
    rows = np.array([line.split(",")[0] for line in said.splitlines()[1:]], float)
    assert process.returncode == 0 and len(rows) == 96 and (np.diff(rows) > 0).all()
    assert "100 lines, 100 predictions, 0 lines rejected; line to prediction" in notes
