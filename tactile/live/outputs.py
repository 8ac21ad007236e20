"""Hand predictions to other programs: lines of CSV, or a datagram of JSON each."""

import csv
import ipaddress
import json
import math
import socket
from typing import TextIO

import numpy as np

from tactile.base.errors import InputError
from tactile.inference import intervals
from tactile.inference.card import Card
from tactile.live.session import Prediction

MOST_TOUCHES = 5  # columns of a line: the hardest ones


def fields(prediction: Prediction, card: Card) -> dict:
    """Return a prediction that is `known` by name: numbers with their unit at the end of the name.

    Of every model t_s, on the device's clock, and latency_ms, from the line to the prediction; of a map force_n, of a
    pressure map also `touches`, a list of {x_mm, y_mm, kpa}; of other models each output by its name, and the likeliest
    `object`, of a target of one's own `predicted`. Behind these the ends of intervals, or the set of objects, as
    intervals.columns, None: cannot tell; where the card has the ranges of its training also `outside_training`, whether
    the reading lies outside.
    """
    said = {
        "t_s": round(prediction.reading.t_s, 6),
        "latency_ms": round(1e3 * (prediction.predicted_s - prediction.arrived_s), 3),
    }
    if card.outputs.names:
        if card.says == "classes":
            said[card.outputs.best] = card.outputs.names[int(prediction.values.argmax())]
        said |= dict(zip(card.outputs.names, np.round(prediction.values.astype(float), 4).tolist(), strict=True))
        return said | _intervals(prediction, card)
    said["force_n"] = round(prediction.force_n, 4)
    said |= _intervals(prediction, card)
    if card.outputs.touch_kpa is not None:
        rounded = [{key: round(value, 2) for key, value in touch._asdict().items()} for touch in prediction.touches]
        said["touches"] = rounded
    return said


def _intervals(prediction: Prediction, card: Card) -> dict[str, float | list[str] | bool | None]:
    """Return what intervals.columns says of a prediction, None: cannot tell; of objects the names in the set."""
    found = intervals.columns(prediction.values[None], np.array([prediction.outside]), card)
    said = {name: one[0] for name, one in found.items()}
    for name, value in said.items():
        if name == intervals.OUTSIDE:
            said[name] = bool(value)
        elif name != card.outputs.set_of_them:
            said[name] = round(float(value), 4) if np.isfinite(value) else None
    return said


def known(prediction: Prediction) -> bool:
    """Tell whether a model has seen a whole window, and could make an image of the reading."""
    return bool(np.isfinite(prediction.values).all())


def as_json(data: dict) -> str:
    """Return JSON of data; a number that JSON does not have, infinite or none, becomes null."""
    try:
        return json.dumps(data, allow_nan=False)
    except ValueError:
        return json.dumps(_finite(data), allow_nan=False)


def _finite(data):
    """Return data with None in the place of each number that is not finite."""
    if isinstance(data, dict):
        return {name: _finite(value) for name, value in data.items()}
    if isinstance(data, list | tuple):
        return [_finite(value) for value in data]
    return None if isinstance(data, float) and not math.isfinite(data) else data


class Table:
    """One line of CSV per known prediction, after a header."""

    def __init__(self, file: TextIO, card: Card):
        self.file, self.card, self.writer = file, card, csv.writer(file, lineterminator="\n")
        self.writer.writerow(self._header())
        file.flush()

    def _header(self) -> list[str]:
        names, ends = ["t_s", "latency_ms"], intervals.names(self.card)
        if self.card.outputs.names:
            likeliest = [self.card.outputs.best] if self.card.says == "classes" else []
            return [*names, *likeliest, *self.card.outputs.names, *ends]
        if self.card.outputs.touch_kpa is None:
            return [*names, "force_n", *ends]
        touches = [name for k in range(1, MOST_TOUCHES + 1) for name in (f"x{k}_mm", f"y{k}_mm", f"p{k}_kpa")]
        return [*names, "force_n", *ends, "touches", *touches]

    def add(self, prediction: Prediction) -> None:
        """Write one line, at once; BrokenPipeError where nobody reads any more."""
        if not known(prediction):
            return
        said = fields(prediction, self.card)
        touches = said.pop("touches", None)
        row = ["|".join(value) if isinstance(value, list) else value for value in said.values()]
        if touches is not None:
            listed = [value for touch in touches[:MOST_TOUCHES] for value in touch.values()]
            row += [len(touches), *listed, *[""] * (3 * MOST_TOUCHES - len(listed))]
        self.writer.writerow(row)
        self.file.flush()


class Datagrams:
    """One UDP datagram of JSON per known prediction, to a program on this machine."""

    def __init__(self, address: str, card: Card):
        """address: HOST:PORT; InputError unless it is of this machine: predictions are never sent elsewhere."""
        self.card = card
        host, _, port = address.rpartition(":")
        host = host.strip("[]")
        try:
            place = ipaddress.ip_address("127.0.0.1" if host == "localhost" else host)
            number = int(port)
        except ValueError as error:
            raise InputError(f"--udp {address}: is no HOST:PORT such as 127.0.0.1:9000") from error
        if not place.is_loopback or not 0 < number < 2**16:
            raise InputError(f"--udp {address}: is no port of this machine; give one such as 127.0.0.1:9000")
        self.target = str(place), number
        self.socket = socket.socket(socket.AF_INET if place.version == 4 else socket.AF_INET6, socket.SOCK_DGRAM)
        self.socket.setblocking(False)

    def add(self, prediction: Prediction) -> None:
        """Send one datagram. Nobody needs to listen; one that the system cannot take now is lost."""
        if not known(prediction):
            return
        try:
            self.socket.sendto(as_json(fields(prediction, self.card)).encode(), self.target)
        except (BlockingIOError, ConnectionRefusedError):
            return
