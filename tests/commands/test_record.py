"""The recorder, against a pseudo-terminal in place of a device."""

import argparse
import contextlib
import errno
import os
import pty
import re
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
from builders.devices import WAIT_S, Device, until
from builders.packets import arrived
from builders.project import ROOT

from tactile.base.errors import InputError
from tactile.commands import record


@pytest.fixture
def device(tmp_path):
    device = Device(tmp_path / "port")
    yield device
    if device.path.is_symlink():
        device.unplug()


@pytest.fixture
def start(device, tmp_path):
    """`start()`: the recorder on `device`, once it listens; ended with the test."""
    running = []

    def one(*arguments):
        command = [
            sys.executable,
            "-m",
            "tactile.commands.command_line",
            "record",
            *(arguments or (device.path, tmp_path / "new" / "log")),
        ]
        process = subprocess.Popen(
            command,
            cwd=ROOT,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            bufsize=1,
            preexec_fn=lambda: signal.signal(signal.SIGHUP, signal.SIG_DFL),  # also where tests run under `nohup`
        )
        running.append(process)
        assert "recording" in process.stderr.readline()
        return process

    yield one
    for process in running:
        process.kill()
        process.communicate()


def ended(process):
    """What it says after Ctrl-C."""
    process.send_signal(signal.SIGINT)
    out, err = process.communicate(timeout=WAIT_S)
    assert process.returncode == 0, err
    return out


def numbered(first, last, end=b"\n"):
    return b"".join(b"%d,%s" % (k, b"1023," * 20) + end for k in range(first, last))


def test_every_byte_arrives_as_it_was_printed(device, start, tmp_path):
    process, log = start(), tmp_path / "new" / "log"
    sent = b"array ready\r\n\x00\xff noise\n" + numbered(0, 1000, b"\r\n")
    device.print(sent)
    until(lambda: log.stat().st_size == len(sent))  # flushed while it runs
    assert "1002 lines" in ended(process)
    assert log.read_bytes() == sent


@pytest.mark.parametrize("end", [b"\r", b"\n", b"\r\n", b"\n\r"])
def test_whole_lines_are_on_the_disk_whatever_ends_them(end, tmp_path):
    """In pieces that cut line ends; the line that is arriving is kept back, and a time is put before each line."""
    sent, clock = b"".join(b"%d,5" % k + end for k in range(40)), iter(range(0, 10**9, 1000))
    plain, stamped = record.Log(tmp_path / "plain"), record.Log(tmp_path / "stamped", lambda: next(clock))
    for k in range(0, len(sent), 3):
        plain.add(sent[k : k + 3])
        stamped.add(sent[k : k + 3])
    held = (tmp_path / "plain").read_bytes()
    assert sent.startswith(held) and len(sent) - len(held) <= len(b"39,5" + end) and plain.lines >= 39
    for log in (plain, stamped):
        log.close()
    assert (tmp_path / "plain").read_bytes() == sent
    lines = [line for line in (tmp_path / "stamped").read_bytes().replace(b"\r", b"\n").split(b"\n") if line]
    assert [line.split(b",")[1:] for line in lines] == [[b"%d" % k, b"5"] for k in range(40)]


def test_a_device_without_line_feeds_is_not_said_to_end_no_line(monkeypatch, capsys):
    Disk(monkeypatch)
    text = record._Text("port")
    for now, data in ((100.0, b"1,2\r"), (110.0, b"2,3\r")):
        monkeypatch.setattr(record.time, "monotonic", lambda now=now: now)
        text.judge(data)
    assert not capsys.readouterr().err


def test_what_is_sent_at_first_waits_for_the_board(monkeypatch):
    """A board that starts anew when its port is opened hears nothing until it runs."""

    class Board:
        def __init__(self, *_, **__):
            self.opened, self.heard, self.in_waiting = now[0], [], 0
            boards.append(self)

        def write(self, data):
            self.heard.append((now[0] - self.opened, data))

        def read(self, _):
            now[0] += 0.5
            return b""

        def close(self):
            pass

    class Until(list):
        def __bool__(self):
            return now[0] > 6

    now, boards = [0.0], []
    serial = pytest.importorskip("serial")
    monkeypatch.setattr(serial, "Serial", Board)
    monkeypatch.setattr(record.time, "monotonic", lambda: now[0])
    list(record.Port("port", 9600, Until(), b"?\n", every_s=1.5, after_s=2.0).chunks())
    assert boards[0].heard == [(2.0, b"?\n"), (3.5, b"?\n"), (5.0, b"?\n")]


def test_a_port_that_is_not_there_gets_the_ones_that_are(monkeypatch):
    list_ports = pytest.importorskip("serial.tools.list_ports")
    there = [type("", (), {"device": name}) for name in ("/dev/ttyUSB1", "/dev/ttyACM0")]
    monkeypatch.setattr(list_ports, "comports", lambda: there)
    with pytest.raises(InputError) as said:
        record.Port("/dev/none", 9600, False)
    assert str(said.value) == (
        "/dev/none: cannot be opened (No such file or directory); check the name, the cable and your rights (ports "
        "that are there: /dev/ttyACM0, /dev/ttyUSB1)"
    )


@pytest.mark.slow
def test_ctrl_c_loses_nothing_and_waits_for_the_line_that_is_arriving(device, start, tmp_path):
    process, log = start(), tmp_path / "new" / "log"
    sent = numbered(0, 300)
    device.print(sent)
    device.print(b"300,10")
    process.send_signal(signal.SIGINT)
    time.sleep(0.2)
    device.print(b"23\n301,")
    out, err = process.communicate(timeout=WAIT_S)
    assert process.returncode == 0 and "301 lines" in out, err
    whole = sent + b"300,1023\n"
    assert log.read_bytes() in (whole, whole + b"301,")  # on a busy machine, one read brings both


@pytest.mark.slow
def test_device_vanishes_and_comes_back(device, start, tmp_path):
    process, log = start(), tmp_path / "new" / "log"
    first, second = numbered(0, 100), numbered(100, 200)
    device.print(first + b"77,torn")
    until(lambda: log.read_bytes() == first)
    time.sleep(0.3)  # the torn line is read, too
    device.unplug()
    assert "gone" in process.stderr.readline()
    device.plug()
    assert "back" in process.stderr.readline()
    device.print(second)
    until(lambda: log.read_bytes().endswith(second))
    assert "201 lines" in ended(process)
    assert log.read_bytes() == first + b"77,torn\n" + second


@pytest.mark.slow
def test_existing_file_and_missing_port_are_one_sentence(device, tmp_path):
    old = tmp_path / "old.log"
    old.write_bytes(b"kept")
    for port, target, words in (
        (device.path, old, "exists already and is never overwritten; give another name"),
        (tmp_path / "none", tmp_path / "new.log", "cannot be opened"),
    ):
        command = [sys.executable, "-m", "tactile.commands.command_line", "record", str(port), str(target)]
        done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=WAIT_S)
        assert done.returncode == 1 and words in done.stderr and "Traceback" not in done.stderr
        assert len(done.stderr.strip().splitlines()) == 1
    assert old.read_bytes() == b"kept" and not (tmp_path / "new.log").exists()


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGHUP, signal.SIGTERM, signal.SIGINT])
def test_every_way_to_end_loses_nothing(device, start, tmp_path, number):
    process, log = start(), tmp_path / "new" / "log"
    sent = numbered(0, 50) + b"123,45"
    device.print(sent)
    until(lambda: log.stat().st_size)
    time.sleep(0.2)
    process.send_signal(number)
    out, err = process.communicate(timeout=WAIT_S)
    assert process.returncode == 0 and "50 lines" in out, err
    assert log.read_bytes() == sent


@pytest.mark.slow
def test_a_terminal_that_is_closed_ends_a_recording_which_loses_nothing(device, tmp_path):
    """The terminal is gone: what is said can no longer be written anywhere."""
    log = tmp_path / "log"
    line = [sys.executable, "-m", "tactile.commands.command_line", "record", str(device.path), str(log)]
    child, terminal = pty.fork()  # in a session of its own, of which it is the terminal
    if not child:
        signal.signal(signal.SIGHUP, signal.SIG_DFL)
        os.chdir(ROOT)
        os.execv(sys.executable, line)
    try:
        until(log.exists, 30)
        sent = numbered(0, 50) + b"123,45"
        device.print(sent)
        until(lambda: log.stat().st_size)
        time.sleep(0.2)
        os.close(terminal)
        ends = []
        until(lambda: ends.append(os.waitpid(child, os.WNOHANG)) or ends[-1][0])
    finally:
        with contextlib.suppress(ProcessLookupError):
            os.kill(child, signal.SIGKILL)
    assert os.waitstatus_to_exitcode(ends[-1][1]) == 0
    assert log.read_bytes() == sent


@pytest.mark.slow
def test_a_recording_that_ignores_the_end_of_its_terminal_goes_on(device, tmp_path):
    """As with `nohup`."""
    log = tmp_path / "log"
    line = [sys.executable, "-m", "tactile.commands.command_line", "record", str(device.path), str(log)]
    process = subprocess.Popen(
        line,
        cwd=ROOT,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=lambda: signal.signal(signal.SIGHUP, signal.SIG_IGN),
    )
    try:
        assert "recording" in process.stderr.readline()
        process.send_signal(signal.SIGHUP)
        time.sleep(0.5)
        device.print(numbered(0, 10))
        until(lambda: log.stat().st_size == len(numbered(0, 10)))
        assert "10 lines" in ended(process)
    finally:
        process.kill()


def test_words_to_a_terminal_that_is_gone_are_lost_without_an_error():
    inner, outer = os.openpty()
    with os.fdopen(outer, "w", buffering=1) as gone:
        os.close(inner)
        for _ in range(3):
            record.say("lines", gone)
    with open("/dev/full", "w") as full:
        with pytest.raises(OSError, match="No space"):
            record.say("lines", full)
        record.silence(full)


class Disk:
    """In place of time and of fsync: `now`, and the bytes that the disk has for certain."""

    def __init__(self, monkeypatch):
        self.now, self.has, self.waits, self.broken = 100.0, 0, 0, False
        monkeypatch.setattr(record.time, "monotonic", lambda: self.now)
        monkeypatch.setattr(record.os, "fsync", self.sync)

    def sync(self, number):
        if self.broken:
            raise OSError(errno.EIO, os.strerror(errno.EIO))
        self.has, self.waits = os.fstat(number).st_size, self.waits + 1


def test_the_disk_has_every_line_that_is_older_than_a_second(tmp_path, monkeypatch):
    """A power cut is no kill: what the system has not written to the disk is lost."""
    disk = Disk(monkeypatch)
    log, sizes = record.Log(tmp_path / "log"), []
    for k in range(4000):  # 200 lines a second for 10 s, then the device is silent for 10 s
        log.add(numbered(k, k + 1) if k < 2000 else b"")
        sizes.append((tmp_path / "log").stat().st_size)
        disk.now += 0.005
        before = k - round(record.SYNC_S / 0.005) - 1
        assert before < 0 or disk.has >= sizes[before]
    assert disk.has == sizes[-1] == len(numbered(0, 2000)) and disk.waits <= 11
    log.add(b"1,2\n3,")
    log.close()
    assert disk.has == (tmp_path / "log").stat().st_size == sizes[-1] + len(b"1,2\n3,")


@pytest.mark.parametrize("delimiter", [b";", b"\x00", b"\x03", b","])
@pytest.mark.parametrize("first", [b"", b"1,2\n", b"1,2\r3,4\r"])
def test_what_has_no_line_end_is_written_within_a_second(first, delimiter, tmp_path, monkeypatch):
    """At 10 bytes and at 1 MB a second, read every 0.1 s: no more than a second and 64 KiB are held back."""
    disk, log = Disk(monkeypatch), record.Log(tmp_path / "log")
    log.add(first)
    sent, came, synced = len(first), [], []
    for piece in 50 * [9 * b"5" + delimiter] + 20 * [100_000 * delimiter] + 30 * [b""]:
        log.add(piece)
        sent += len(piece)
        came.append(sent)
        written = (tmp_path / "log").stat().st_size
        assert sent - written < 1 << 16 and written >= ([0] * 10 + came)[-11]
        synced.append(written)
        assert disk.has >= ([0] * 11 + synced)[-12]
        disk.now += 0.1
    log.close()
    assert (tmp_path / "log").read_bytes() == first + 50 * (9 * b"5" + delimiter) + 2_000_000 * delimiter


@pytest.mark.parametrize("first", [b"", b"1,2\n", b"1,2\r3,4\r"])
def test_only_new_bytes_are_searched(first, tmp_path):
    """16 MB without a line end take 0.1 s; to search all that is kept at each read takes minutes."""
    log, began = record.Log(tmp_path / "log"), time.process_time()
    log.add(first)
    for _ in range(4096):
        log.add(4096 * b"5")
        assert len(log.rest) < record.HELD
    assert time.process_time() - began < 5
    log.add(b"\n")
    log.close()
    assert (tmp_path / "log").stat().st_size == len(first) + (1 << 24) + 1


@pytest.mark.parametrize("end", [b"\r", b"\n", b"\r\n", b"\n\r"])
@pytest.mark.parametrize("seed", range(5))
def test_a_stamp_is_never_inside_a_line_and_is_true(seed, end, tmp_path, monkeypatch):
    """In pieces of any length, at any time: the time is that of its end, or within a second after it began."""
    disk, rng = Disk(monkeypatch), np.random.default_rng(seed)
    monkeypatch.setattr(record, "SEVERAL", np.inf)  # lines of a packet are not set apart
    plain = record.Log(tmp_path / "plain")
    stamped = record.Log(tmp_path / "stamped", lambda: int(1e6 * disk.now))
    lines = [b"%d,%s" % (k, rng.integers(1, 30) * b"7") for k in range(60)]
    data, pieces, came = b"".join(line + end for line in lines), [], []
    while data:
        cut = int(rng.integers(1, 60))
        pieces, data = [*pieces, data[:cut]], data[cut:]
    for piece in pieces:
        for log in (plain, stamped):
            log.add(piece)
        came += [disk.now] * len(piece)
        for _ in range(int(rng.choice([0, 1, 12]))):
            disk.now += 0.1
            for log in (plain, stamped):
                log.add(b"")
    for log in (plain, stamped):
        log.close()
    assert (tmp_path / "plain").read_bytes() == b"".join(pieces)
    assert plain.lines == stamped.lines == 60
    found = [line.split(b",", 1) for line in re.findall(rb"[^\r\n]+", (tmp_path / "stamped").read_bytes())]
    assert [line for _, line in found] == lines
    begins = np.cumsum([0] + [len(line + end) for line in lines])[:-1]
    for (stamp, line), begin in zip(found, begins, strict=True):
        shown_s = [*came, disk.now][begin + len(line) + (end[0] == 13)]  # what follows a CR shows that it ends a line
        assert came[begin] - 0.001 < int(stamp) / 1e6 < min(shown_s, came[begin] + 1.0) + 0.001
    assert (np.diff([int(stamp) for stamp, _ in found]) > 0).all()


@pytest.mark.parametrize("stamped", [False, True])
def test_a_line_that_is_torn_after_its_beginning_was_written_ends(stamped, tmp_path, monkeypatch):
    disk = Disk(monkeypatch)
    log = record.Log(tmp_path / "log", (lambda: int(1e6 * disk.now)) if stamped else None)
    log.add(b"1,2\n3,")
    disk.now += 1.0
    log.add(b"")
    log.tear()
    log.tear()
    disk.now += 1.0
    log.add(b"5,6\n")
    log.close()
    times = [b"100000000,", b"101000000,", b"102000000,"] if stamped else 3 * [b""]
    assert (tmp_path / "log").read_bytes() == b"%s1,2\n%s3,\n%s5,6\n" % tuple(times)


@pytest.mark.parametrize(
    ("piece", "words"),
    [
        (b"12345,", ["no end of a line"]),
        (b"12345;", ["no end of a line"]),
        (b"12345\x00", ["no end of a line"]),  # a delimiter, no wrong baud rate
        (b"\x0212\x03", ["no end of a line"]),
        (b"\x0012\x80\xff", ["only 40 % of", "no end of a line"]),
        (b"\x00\x00\x00\x001", ["only 20 % of", "no end of a line"]),
        (b"12345\n", []),
        (b"12345\r", []),
        (b"\xf0\n\x80\xff\n", ["only 40 % of"]),
    ],
)
def test_two_questions_of_what_arrives_end_apart(piece, words, monkeypatch, capsys):
    disk, text = Disk(monkeypatch), record._Text("port")
    for _ in range(200):
        text.judge(20 * piece)
        disk.now += 0.1
    said = capsys.readouterr().err.splitlines()
    assert len(said) == len(words) and all(word in line for word, line in zip(words, said, strict=True)), said


def test_a_device_that_rests_within_a_line_is_not_said_to_end_none(monkeypatch, capsys):
    disk, text = Disk(monkeypatch), record._Text("port")
    for piece in (b"1,2\n", b"3,", b"4\n5", b",6\n", b"7,8\n"):
        text.judge(piece)
        disk.now += 4.0
    text.judge(b"9")  # an hour of rest is none of the time in which bytes came
    disk.now += 3600.0
    text.judge(b"\n")
    assert not capsys.readouterr().err


def test_the_disk_has_a_torn_line_before_the_device_is_waited_for(tmp_path, monkeypatch):
    disk, log = Disk(monkeypatch), record.Log(tmp_path / "log")
    log.add(b"1,2\n3,")
    log.tear()
    assert disk.has == len(b"1,2\n3,\n")


def test_a_disk_that_fails_is_one_sentence_with_the_lines_it_has(tmp_path, monkeypatch):
    disk, log = Disk(monkeypatch), record.Log(tmp_path / "log")
    log.add(b"1,2\n3,4\n")
    disk.now += record.SYNC_S
    log.add(b"5,6\n7,8\n")
    log.add(b"9,10\n")  # within the second after
    disk.now += record.SYNC_S
    disk.broken = True
    with pytest.raises(InputError, match=r"log: cannot be written \(.*\); its first 4 lines are safe$"):
        log.add(b"11,12\n")


@pytest.mark.parametrize(("hz", "packet_s"), [(100, 0.016), (1000, 0.016), (1000, 0.004), (20, 0.001)])
def test_lines_of_a_packet_get_times_as_far_apart_as_they_were_printed(tmp_path, hz, packet_s):
    """Bytes of a packet, the last line torn; then silence, after which a line is not stamped back into it."""
    now, log_of = 0.0, tmp_path / "log"
    log = record.Log(log_of, lambda: int(1e6 * now))
    ends_s = 1 + np.arange(10 * hz) / hz
    arrives_s = arrived(ends_s, packet_s, np.random.default_rng(0))
    printed = b"".join(b"%d,1\n" % k for k in range(len(ends_s)))
    ends = np.flatnonzero(np.frombuffer(printed, np.uint8) == 10) + 1
    sent = 0
    for now in np.unique(arrives_s):
        until_byte = ends[np.searchsorted(arrives_s, now, side="right") - 1] + 2
        log.add(printed[sent:until_byte])
        sent = until_byte
        log.add(b"")
    now += 2.0
    log.add(b"last\n")
    log.close()
    stamps = np.array([int(line.split(b",")[0]) for line in lines_of(log_of)])
    assert len(stamps) == len(ends_s) + 1 and (np.diff(stamps) > 0).all()
    assert stamps[-1] == int(1e6 * now)
    late_s = stamps[:-1] / 1e6 - ends_s
    assert 1e6 / np.median(np.diff(stamps)) == pytest.approx(hz, rel=0.01)
    assert (late_s[hz:] < packet_s / 2).mean() > 0.9 and late_s[hz:].max() < 3.1 * packet_s
    if hz == 20:
        assert (stamps[:-1] == (1e6 * arrives_s).astype(int)).all()  # one by one: when they arrived


@pytest.fixture
def second(tmp_path):
    device = Device(tmp_path / "other_port")
    yield device
    device.unplug()


def lines_of(path):
    return path.read_bytes().splitlines()


@pytest.mark.slow
def test_two_ports_are_stamped_by_one_clock(device, second, start, tmp_path):
    logs = tmp_path / "array.log", tmp_path / "load_cell.log"
    process = start("--stamp", device.path, logs[0], second.path, logs[1], "--baud", "115200", "9600")
    assert "at 9600 baud" in process.stderr.readline()
    for k in range(5):
        device.print(b"%d,1\n%d,2\n" % (k, k))
        second.print(b"0.%d\n" % k)
        until(lambda k=k: len(lines_of(logs[0])) == 2 * k + 2 and len(lines_of(logs[1])) == k + 1)
        time.sleep(0.02)
    assert "5 lines" in ended(process)
    stamped = [[line.split(b",", 1) for line in lines_of(log)] for log in logs]
    assert [rest for _, rest in stamped[0]] == [b"%d,%d" % (k // 2, k % 2 + 1) for k in range(10)]
    array, cell = ([int(time_us) for time_us, _ in of] for of in stamped)
    assert all(a < b for a, b in zip(array, array[1:], strict=False)), "no time repeats"
    # The two lines of each round came within it, and the rounds 20 ms and more apart.
    assert all(abs(cell[k] - array[2 * k]) < 1e6 * WAIT_S for k in range(5))
    assert all(later - earlier > 15_000 for earlier, later in zip(cell, cell[1:], strict=False))


@pytest.mark.slow
def test_a_device_that_prints_when_it_is_asked(device, start, tmp_path):
    process = start("--start", "?", "--start-after", "0", "--every", "0.05", device.path, tmp_path / "log")
    for k in range(3):
        assert os.read(device.end, 2) == b"?\n"
        device.print(b"%d\n" % k)
    until(lambda: lines_of(tmp_path / "log") == [b"0", b"1", b"2"])
    device.unplug()
    assert "gone" in process.stderr.readline()
    device.plug()
    assert "back" in process.stderr.readline()
    assert os.read(device.end, 2) == b"?\n"
    ended(process)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("data", "words"),
    [(bytes(range(128, 256)) * 4, "only 0 % of what arrives are printable"), (numbered(0, 100), None)],
)
def test_a_wrong_baud_rate_gets_a_word(device, start, tmp_path, data, words):
    process = start(device.path, tmp_path / "log")
    device.print(data)
    until(lambda: (tmp_path / "log").stat().st_size or words)
    time.sleep(0.5)
    process.send_signal(signal.SIGINT)
    _, said = process.communicate(timeout=WAIT_S)
    assert (words in said and "--baud" in said) if words else "baud" not in said, said


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["a", "b", "c"], "c: give a file for each port"),
        (["a", "b", "--baud", "1", "2"], "--baud: 2 rates for 1 ports"),
        (["a", "b", "--every", "1"], "--every: needs .* --start"),
    ],
)
def test_ports_files_and_rates_that_do_not_go_together(workspace, arguments, words):
    parser = argparse.ArgumentParser()
    record.add_arguments(parser)
    with pytest.raises(InputError, match=words):
        record.main(workspace, parser.parse_args(arguments))
