"""Devices that send lines over a network, against sockets of this machine."""

import contextlib
import socket
import threading
import time

import pytest
from test_record import numbered

from tactile.base.errors import InputError
from tactile.commands import record


class Until:
    """False for as many looks as are wanted, then true: a stop without a signal."""

    def __init__(self, done):
        self.done, self.since = done, time.monotonic()

    def __bool__(self):
        return self.done() or time.monotonic() - self.since > 20


def lines_of(name, log, wanted):
    """Record from a port until the log has `wanted` bytes."""
    port = record.Port(name, 0, Until(lambda: log.exists() and log.stat().st_size >= wanted))
    for _ in record.recorded(port.chunks(), record.Log(log)):
        pass
    return log.read_bytes()


def test_a_device_that_listens_is_recorded_and_comes_back(tmp_path, capsys):
    """Its lines arrive in pieces; a line that is torn when it goes is none of the lines that follow."""
    with socket.create_server(("127.0.0.1", 0)) as server:

        def serve():
            for pieces in ((b"12,3", b"4\n", numbered(0, 500), b"torn 7"), (numbered(500, 1000),)):
                with server.accept()[0] as device:
                    for piece in pieces:
                        device.sendall(piece)
                        time.sleep(0.05)

        thread = threading.Thread(target=serve)
        thread.start()
        sent = b"12,34\n" + numbered(0, 500) + b"torn 7\n" + numbered(500, 1000)
        got = lines_of(f"tcp://127.0.0.1:{server.getsockname()[1]}", tmp_path / "log", len(sent))
        thread.join()
    assert got == sent
    said = capsys.readouterr().err
    assert "gone (the device has closed the connection); waiting for it, 501 lines so far" in said and "back" in said


def test_datagrams_are_lines(tmp_path):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        place = free.getsockname()
    wanted = b"1,2\n3,4\n5,6\n7,8\n"

    def send():
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as device:
            time.sleep(0.3)
            for datagram in (b"1,2", b"3,4\n", b"5,6\n7,8"):
                device.sendto(datagram, place)

    thread = threading.Thread(target=send)
    thread.start()
    got = lines_of("udp://{}:{}".format(*place), tmp_path / "log", len(wanted))
    thread.join()
    assert got == wanted


def test_a_device_that_prints_when_it_is_asked_is_asked(tmp_path):
    with socket.create_server(("127.0.0.1", 0)) as server:

        def answer():
            with server.accept()[0] as device, contextlib.suppress(OSError):
                while asked := device.recv(100):
                    device.sendall(b"9,9\n" * asked.count(b"?\n"))

        thread = threading.Thread(target=answer)
        thread.start()
        log, name = tmp_path / "log", f"tcp://127.0.0.1:{server.getsockname()[1]}"
        stop = Until(lambda: log.exists() and log.stat().st_size >= 8)
        port = record.Port(name, 0, stop, b"?\n", every_s=0.2, after_s=0.0)
        for _ in record.recorded(port.chunks(), record.Log(log)):
            pass
        thread.join()
    assert set(log.read_bytes().splitlines()) == {b"9,9"}


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("tcp://127.0.0.1", "no place in a network; write tcp://HOST:PORT or udp://HOST:PORT"),
        ("udp://:5005", "udp://0.0.0.0:PORT: on all networks of this computer"),
        ("http://127.0.0.1:80", "no place in a network"),
        ("tcp://127.0.0.1:99999", "Port out of range"),
        ("tcp://127.0.0.1:1", "check address and port, and that the device is on"),
        ("udp://203.0.113.7:5005", "check address and port"),
    ],
)
def test_what_is_no_place_or_cannot_be_reached_is_said(name, words):
    with pytest.raises(InputError, match=words):
        record.Port(name, 0, False)
