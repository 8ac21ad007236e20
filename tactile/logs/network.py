"""Read lines that a device sends over a network, by TCP or UDP, as if they came from a serial port."""

import socket
import time
from urllib.parse import urlsplit

from tactile.base.errors import InputError

CONNECT_S = 5.0
MOST = 1 << 16  # bytes of a read; a datagram has no more
FORMS = "tcp://HOST:PORT or udp://HOST:PORT"


def is_address(name: str) -> bool:
    """Tell whether a port is named as a place in a network."""
    return "://" in name


class NetworkPort:
    """A place in a network, opened, with what is used of a `serial.Serial`.

    `tcp://HOST:PORT` is a server that the device, or an adapter before it, runs. `udp://HOST:PORT` is where datagrams
    are waited for here, HOST an address of this computer; each datagram ends a line. A connection that ends is an
    OSError, as a serial port that vanishes is.
    """

    def __init__(self, name: str, timeout: float):
        """Open it; timeout: the longest wait of `read`, in s. Raises InputError for what is no place, and OSError."""
        found = urlsplit(name)
        try:
            place = found.hostname, found.port
        except ValueError as error:
            raise InputError(f"{name}: {error}; write {FORMS}") from error
        if found.scheme not in ("tcp", "udp") or None in place or found.path.strip("/") or found.query:
            hint = " (udp://0.0.0.0:PORT: on all networks of this computer)" if found.scheme == "udp" else ""
            raise InputError(f"{name}: no place in a network; write {FORMS}{hint}")
        self.datagrams = found.scheme == "udp"
        if self.datagrams:
            family, *_, address = socket.getaddrinfo(*place, type=socket.SOCK_DGRAM)[0]
            self.socket = socket.socket(family, socket.SOCK_DGRAM)
            self.socket.bind(address)
        else:
            self.socket = socket.create_connection(place, CONNECT_S)
        self.sender = None  # of the last datagram, who gets what is written
        self.timeout = timeout

    in_waiting = MOST

    def read(self, size: int) -> bytes:
        """Return the bytes that come next, up to `size`, b"" where none come for `timeout`."""
        self.socket.settimeout(self.timeout)
        try:
            if self.datagrams:
                data, self.sender = self.socket.recvfrom(max(size, MOST))
                return data if data.endswith((b"\n", b"\r")) else data + b"\n"
            data = self.socket.recv(size)
        except TimeoutError:
            return b""
        if not data:
            raise ConnectionResetError("the device has closed the connection")
        return data

    def read_until(self, end: bytes) -> bytes:
        """Return the bytes up to `end`, or those that came within `timeout`."""
        data, until = b"", time.monotonic() + self.timeout
        while end not in data and time.monotonic() < until:
            data += self.read(MOST)
        return data

    def write(self, data: bytes) -> None:
        """Send bytes to the device; to one of datagrams only once it has sent some."""
        if not self.datagrams:
            self.socket.sendall(data)
        elif self.sender:
            self.socket.sendto(data, self.sender)

    def close(self) -> None:
        """Close it."""
        self.socket.close()
