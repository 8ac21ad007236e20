"""Predict live: a trained model at work on what a sensor prints now, or on a recorded log as if it were printed now.

MODEL is a folder that `tactile export` made, EXPERIMENT/MODEL such as touch/lomp_stream (the model that this checkout
trained, else the pretrained one), or the folder of the model of a target of your own. A web page of this machine shows
readings, predictions and how long they take; with --csv or --udp alone there is no page unless --page is given, too.
The model's frames are as far apart in time as in training, whatever the rate of the device. Lines that cannot be used
are counted. Ctrl-C ends it.

Examples:

    tactile live touch/lomp_stream --replay data/sample/double/two_touches/array.log
    tactile live exported/finger --port /dev/ttyACM0
"""

import argparse
import errno
import gc
import re
import sys
import tempfile
import threading
import time
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path

from tactile.base import cards, params, processes
from tactile.base.errors import InputError
from tactile.base.paths import Workspace
from tactile.commands import record
from tactile.experiments import log_name
from tactile.inference.card import Card
from tactile.own.beside import Beside

PORT = 8765  # of the page
REPLAYED = "a replayed log is a file already"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the model, the source of lines and the places for predictions to the parser of this command."""
    parser.add_argument("model", metavar="MODEL")
    source = parser.add_mutually_exclusive_group(required=True)
    source.add_argument("--port", metavar="PORT", help="such as /dev/ttyUSB0, COM3, tcp://HOST:PORT or udp://HOST:PORT")
    source.add_argument("--replay", type=Path, metavar="LOG", help="a recorded log of the sensor, such as array.log")
    parser.add_argument(
        "--settings", type=Path, metavar="FOLDER", help="whose settings.yaml says how lines look (replay: found)"
    )
    parser.add_argument(
        "--baud", type=int, default=record.BAUD, metavar="N", help="bits per second of the port (default %(default)s)"
    )
    parser.add_argument("--record", type=Path, metavar="FILE", help="a new file for all that the port prints")
    parser.add_argument("--speed", type=float, default=1.0, metavar="X", help="speed of a replay: 2 is twice as fast")
    parser.add_argument("--loop", action="store_true", help="replay again and again")
    parser.add_argument("--page", action="store_true", help="show the page (without --csv and --udp: always)")
    parser.add_argument(
        "--http-port", type=int, default=PORT, metavar="N", help="port of the page (default %(default)s; 0: any)"
    )
    parser.add_argument("--csv", action="store_true", help="a line per prediction on standard output")
    parser.add_argument("--udp", metavar="HOST:PORT", help="a datagram of JSON per prediction, to this machine only")


def main(workspace: Workspace, given: argparse.Namespace) -> None:
    """Run the model named on the command line until its source ends."""
    from tactile.live import source

    if given.record and given.replay:
        raise InputError(f"--record: goes with --port; {REPLAYED}")
    if not given.speed > 0:
        raise InputError(f"--speed {given.speed:g}: must be more than 0; 2 is twice as fast")
    if given.replay:
        source.check_log(given.replay)
    from tactile.live import outputs
    from tactile.live.session import Session

    stop = record.Stop()
    model, comes_from = loaded(workspace, params.load(workspace.params), given.model)
    processes.torch_on_one_thread()
    card = model.card
    who = card.title
    say(f"{who}: {comes_from}")
    printed = as_printed(workspace, card, given)
    fmt, laid_out = source.line_format(printed), source.line_layout(printed)
    say("\n".join(model.interval_sentences))
    order = model.order(printed.reading)
    lines = source.Lines(fmt, str(given.port or given.replay), who, order, laid_out)
    session = Session(model, lines, say)
    places = [outputs.Datagrams(given.udp, card)] if given.udp else []
    recorder = None
    if given.replay:
        chunks = source.replay(given.replay, fmt, stop, given.speed, given.loop, laid_out)
    else:
        port = record.Port(given.port, given.baud, stop)
        recorder = Recorder(lines, given.record, log_name(card.experiment) or "lines.log")
        chunks = recorder.recorded(port.chunks())
    page = None
    if given.page or not (given.csv or given.udp):
        from tactile.live.server import Page

        page = Page(session, given.http_port, recorder, truth_beside(given.replay, printed))
        places.append(page)
        say(f"{page.address} shows it; Ctrl-C ends it")
    gc.collect()
    gc.freeze()  # else the libraries are searched for garbage every few seconds, 0.4 s in which no line is read
    try:
        if given.csv:
            places.append(outputs.Table(sys.stdout, card))
        for data in chunks:
            hand_on(session.take(data, time.monotonic()), places)
        hand_on(session.finish(), places)
    except OSError as error:
        if error.errno not in (errno.EPIPE, errno.EIO):
            raise
        record.silence(sys.stdout)  # who read the CSV has seen enough, or the terminal is gone
        stop.wanted = True
        for _ in chunks:  # what is under way is recorded
            pass
    finally:
        gc.unfreeze()
        if page is not None:
            page.close()
    say(sentence(session))
    if given.replay and lines.count == sum(lines.rejects.values()):
        raise InputError(f"{given.replay}: no line is a reading of {who}, {fmt.shown}; name a log of this sensor")


def loaded(workspace: Workspace, values: Mapping, name: str):
    """Return the model that the user calls so, ready to predict reading by reading, and where it comes from.

    values: params.yaml. Errors as `packages.locate` and `kept.load`.
    """
    if Path(name, cards.TARGET).is_file():
        from tactile.live.target_stream import Stream
        from tactile.targets import kept

        model = kept.load(Path(name))
        return Stream(model), f"{model.card.model}, of {len(model.card.groups)} groups ({model.card.by})"
    from tactile.inference import packages, predictor

    with tempfile.TemporaryDirectory() as draft:
        folder, comes_from = packages.locate(workspace, name, values, Path(draft, "package"))
        model = predictor.load(folder)
        if model.as_trained:
            from tactile.inference import onnx_export  # here, because the import of torch takes a second

            model = onnx_export.faster(model, Path(draft))
    return model, comes_from


class Recorder:
    """Records what a port prints, each time to a new file. A page may start and stop it from another thread."""

    def __init__(self, lines, file: Path | None, name: str):
        """lines: Lines of the port; file: the first one, which is begun at once; name: of a sensor's log.

        Without `file`, a log goes to live/<time>/<name> in the current folder. Raises InputError as `record.Log`.
        """
        self.log: record.Log | None = None  # the present one, or the latest
        self.runs, self.problem = False, ""  # problem: why none could be begun, or ended whole
        self._lines, self._file, self._name, self._count = lines, file, name, 0
        self._lock = threading.Lock()
        self._is_within_line, self._skips = False, False  # a log begins with a whole line
        if file:
            self._start(file)

    def start(self) -> None:
        """Begin a log, unless one is under way."""
        with self._lock:
            if self.runs:
                return
            path = Path("live", time.strftime("%Y-%m-%d_%H-%M-%S"), self._name)
            if self._file:
                path = self._file.with_stem(f"{self._file.stem}-{self._count + 1}")
            try:
                if (head := self._lines.head) is None:
                    raise InputError("a log of this layout needs the lines above its first row; begin it by --record")
                self._start(path)
                self.log.add(head)
                self.problem = ""
            except InputError as error:
                self.problem = str(error)

    def stop(self) -> None:
        """End the log that is under way, if one is, with its last whole line."""
        try:
            self._end(is_within_line=True)
        except InputError as error:
            self.problem = str(error)

    def told(self) -> dict:
        """Return what the page says of it."""
        file, lines = (str(self.log.path), self.log.lines) if self.log else ("", 0)
        return {"file": file, "lines": lines, "runs": self.runs, "problem": self.problem}

    def recorded(self, chunks: Iterable[bytes | None]) -> Iterator[bytes | None]:
        """Yield the chunks of a port once they are in the log, and end it with them. Raises InputError as `Log`."""
        try:
            for data in chunks:
                with self._lock:
                    self._add(data)
                yield data
        finally:
            self._end()

    def _end(self, is_within_line: bool = False) -> None:
        with self._lock:
            if self.runs:
                self.runs = False
                if is_within_line:  # its last number may not be whole, and would be read
                    self.log.rest = b""
                self.log.close()
                say(f"{self.log.path}: {self.log.lines} lines")

    def _start(self, path: Path) -> None:
        self.log = record.Log(path)
        self.runs, self._skips, self._count = True, self._is_within_line, self._count + 1

    def _add(self, data: bytes | None) -> None:
        if data is None:
            self._is_within_line = self._skips = False
            if self.runs:
                self.log.tear()
            return
        self._is_within_line = not data.endswith(record.ENDS) if data else self._is_within_line
        if self._skips:
            end = re.search(rb"[\r\n]+", data)
            self._skips, data = not end, data[end.end() :] if end else b""
        if self.runs:
            self.log.add(data)


def truth_beside(log: Path | None, card: Card):
    """Return what tells the truth of a replayed log's readings; None where nothing does, or it cannot be read."""
    if log is None:
        return None
    from tactile.live import truth  # here, because the import of recordings takes a second

    try:
        found = truth.beside(log, card)
    except InputError as error:
        say(f"{error}; the page shows no truth")
        return None
    return found and found.of


def as_printed(workspace: Workspace, card: Card, given: argparse.Namespace) -> Card:
    """Return a card that says how the lines to come are read: by the settings beside a replayed log, or --settings.

    Raises InputError where these settings are wrong, or of another sensor.
    """
    beside = Beside(workspace, card.experiment, card.title, card.reading)
    reading = card.reading
    if given.settings:
        reading = beside.of_folder(given.settings)
    elif given.replay:
        reading = beside.of_log(given.replay)
    for sentence_ in beside.said:
        say(sentence_)
    return card.model_copy(update={"reading": reading})


def hand_on(predictions, places: list) -> None:
    """Give each prediction to a page, a table and datagrams, where it is to go to."""
    for prediction in predictions:
        for place in places:
            place.add(prediction)


def say(words: str) -> None:
    """Say something to the user, beside the CSV."""
    record.say(words)


def sentence(session) -> str:
    """Say what came of a session."""
    lines, taken = session.lines, sorted(session.to_prediction_s)
    rejected = ", ".join(f"{reason} {count}" for reason, count in lines.rejects.items())
    words = f"{lines.count} lines, {session.count} predictions, {sum(lines.rejects.values())} lines rejected"
    words += f" ({rejected})" if rejected else ""
    return words + (f"; line to prediction {1e3 * taken[len(taken) // 2]:.1f} ms (median)" if taken else "")
