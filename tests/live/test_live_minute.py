"""A device at 1,000 lines a second, predicted while the page is open in a browser. MINUTE_S=60 for the whole minute:

MINUTE_S=60 python -m pytest tests/live/test_live_minute.py -n 0 -s
"""

import os
import re
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest
from builders.devices import Device, until
from builders.live_models import printed
from builders.project import ROOT

SECONDS, HZ = float(os.environ.get("MINUTE_S", "10")), 1000
MODEL = "touch/lomp_stream"  # of 25 columns


def used(process: subprocess.Popen) -> tuple[float, float]:
    """Return the CPU seconds that a process has taken, and the MB that it holds."""
    ticks = Path(f"/proc/{process.pid}/stat").read_text().rpartition(")")[2].split()[11:13]
    held = re.search(r"VmRSS:\s+(\d+)", Path(f"/proc/{process.pid}/status").read_text())
    return sum(map(int, ticks)) / os.sysconf("SC_CLK_TCK"), int(held[1]) / 1024


class Feed(threading.Thread):
    """A device that prints HZ lines a second for SECONDS. `late_s`: the longest time in which nobody took its lines."""

    def __init__(self, device: Device):
        super().__init__(daemon=True)
        self.device, self.sent, self.late_s = device, 0, 0.0
        self.readings = np.random.default_rng(0).integers(0, 1000, (HZ, 25))
        self.readings[:, 0] = np.arange(HZ) % 900
        self.start()

    def run(self) -> None:
        began = time.monotonic()
        while (now := time.monotonic() - began) < SECONDS:
            due = np.arange(self.sent, min(int(now * HZ), self.sent + 20))
            self.device.print(printed(self.readings[due % HZ], times_us=1_000_000 + 1000 * due))
            self.sent, self.late_s = self.sent + len(due), max(self.late_s, time.monotonic() - began - now)
            time.sleep(0.002)


def cell(tab, name: str) -> str:
    return tab.run(f"document.getElementById('{name}').textContent")


@pytest.mark.slow
def test_a_minute_at_1000_lines_a_second_loses_nothing(tmp_path, tab):
    """No line is lost, memory stays, and pictures go on to the end."""
    device, log = Device(tmp_path / "port"), tmp_path / "array.log"
    line = [sys.executable, "-m", "tactile.commands.command_line", "live", MODEL, "--port", str(device.path)]
    process = subprocess.Popen(
        [*line, "--record", str(log), "--http-port", "0"], cwd=ROOT, stderr=subprocess.PIPE, text=True
    )
    try:
        address = next(said.split()[0] for said in iter(process.stderr.readline, "") if said.startswith("http://"))
        tab.width(1000)
        tab.open(address)
        feed, before, marks, began = Feed(device), used(process), [], time.monotonic()
        while feed.is_alive():
            feed.join(10)
            marks.append(used(process))
            times = [cell(tab, name) for name in ("state", "lines", "to-prediction", "to-picture")]
            print(f"{time.monotonic() - began:5.1f} s, load {os.getloadavg()[0]:.1f}: {marks[-1][1]:.0f} MB; {times}")
        after, load = used(process), os.getloadavg()[0]
        sent = feed.sent
        until(lambda: log.read_bytes().count(b"\n") == sent)
    finally:
        process.terminate()
        _, said = process.communicate(timeout=120)
    share, start = 100 * (after[0] - before[0]) / SECONDS, marks[0][1]  # MB after 10 s
    print(said)
    lines, predictions, rejected = map(
        int, re.search(r"(\d+) lines, (\d+) predictions, (\d+) lines rej", said).groups()
    )
    print(
        f"{sent} sent, {lines} read, {predictions} predicted, {rejected} rejected; "
        f"{share:.0f} % of a core, {start:.0f} to {after[1]:.0f} MB; "
        f"{times}; the device was kept from printing for {feed.late_s:.3f} s at most; load {load:.1f}"
    )
    assert lines == sent and rejected == 0 and log.read_bytes().count(b"\n") == sent
    assert times[0] == "live" and tab.problems == []
    every = int(found[1]) if (found := re.search(r"one of (\d+) lines is predicted", said)) else 1
    assert abs(predictions - sent / every) <= 1
    assert after[1] - start < 30, "MB that it has grown by"
