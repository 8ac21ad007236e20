"""Show predictions on a web page of this machine: a server beside the thread that predicts, which never waits for it.

Nothing that a browser or another program sends is believed: hosts and origins other than the page's own are refused,
and so are bodies that are no word of a viewer, connections beyond MOST, and those that do not say what they want.

The page listens to a stream of events. Each has the prediction that is the newest when it is sent, so that a slow
browser gets fewer of them. Ten times a second the page says which one it has drawn. The time until that word is back is
the time from line to picture. A page that has not said a word of AHEAD pictures gets no more until it has. The
button "Record", the only one that does something here, says a word, too: nobody but a viewer can press it.
"""

import asyncio
import base64
import contextlib
import errno
import json
import math
import secrets
import socket
import threading
import time
from collections import deque
from collections.abc import AsyncIterator, Callable
from pathlib import Path
from typing import NamedTuple, Protocol

import numpy as np
import uvicorn
from matplotlib import colormaps
from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.datastructures import Headers, MutableHeaders
from starlette.middleware import Middleware
from starlette.middleware.trustedhost import TrustedHostMiddleware
from starlette.requests import ClientDisconnect, Request
from starlette.responses import Response, StreamingResponse
from starlette.routing import Route
from starlette.types import ASGIApp, Message, Receive, Scope, Send
from uvicorn.protocols.http.h11_impl import H11Protocol

from tactile.base.errors import InputError
from tactile.datasets import images
from tactile.inference.card import Card
from tactile.live import outputs
from tactile.live.session import Prediction, Session
from tactile.live.source import Reading

HOST = "127.0.0.1"  # nothing outside this machine can ask
PICTURE_S = 0.008  # between two pictures for one browser, which draws 60 a second
AHEAD = 50  # pictures: 0.4 s of a fast device
KEPT = 300  # drawn pictures that times are taken from: half a minute
STATUS_S = 0.2  # how often counts and times are worked out anew
WAIT_S = 10.0  # for the server to start or to end
MOST = 64  # connections, beyond which no page is opened
SPARE = 16  # connections beyond: of pages that are open, and to tell others that there are too many
LARGEST = 1000  # bytes of a body; the word of a viewer has 120
REQUEST_S = 5.0  # for a request to come whole
STALLED_S = 60.0  # in which a browser must take what was sent
QUIET_S = 180.0  # in which a browser must say a word if it is AHEAD behind; one that is hidden may say one a minute
LONGEST_S = 60.0  # from line to picture; more is a computer that slept
FULL = (errno.EMFILE, errno.ENFILE, errno.ENOBUFS, errno.ENOMEM)  # no connection can be accepted
FILES = {
    "/": ("page.html", "text/html"),
    "/page.css": ("page.css", "text/css"),
    "/page.js": ("page.js", "text/javascript"),
}
HEADERS = {
    "Cache-Control": "no-store",
    "Content-Security-Policy": "default-src 'self'; img-src 'self' data:; frame-ancestors 'none'",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Referrer-Policy": "same-origin",
    "X-Content-Type-Options": "nosniff",
}


class Recorder(Protocol):
    """What the button "Record" acts on, from another thread."""

    def start(self) -> None: ...

    def stop(self) -> None: ...

    def told(self) -> dict:
        """Return `file`, the present or the latest, its `lines`, whether it `runs`, and why none could: `problem`."""


class Page:
    """The page of one session, served until `close`. `address`: where."""

    def __init__(
        self,
        session: Session,
        port: int,
        recorder: Recorder | None = None,
        truth: Callable[[Reading], dict] | None = None,
    ):
        """Start the server; port 0: any that is free. Raises InputError where the port is taken.

        recorder: what the button "Record" starts; None: it does nothing. truth: as of `Truth.of`.
        """
        self.session, self.recorder, self.truth, self.newest, self.closed = session, recorder, truth, None, False
        self.to_picture_ms: deque[float] = deque(maxlen=KEPT)
        self._viewers: list[_Viewer] = []
        self._status, self._status_due = {}, 0.0
        listening = socket.socket()
        listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            listening.bind((HOST, port))
        except (OSError, OverflowError) as error:
            listening.close()
            raise InputError(f"--http-port {port}: cannot be used ({error}); give another, or 0 for any") from error
        self.address = f"http://{HOST}:{listening.getsockname()[1]}/"
        here = Path(__file__)
        self._files = {path: (here.with_name(name).read_bytes(), kind) for path, (name, kind) in FILES.items()}
        routes = [Route(path, self._file) for path in FILES]
        routes += [Route("/pictures", self._pictures)]
        routes += [Route(path, self._posted, methods=["POST"]) for path in WORDS]
        guards = [
            Middleware(_Guard, connections=lambda: len(self._server.server_state.connections)),
            Middleware(TrustedHostMiddleware, allowed_hosts=[HOST, "localhost"]),
        ]
        self._loop: asyncio.AbstractEventLoop | None = None
        self._is_full = False  # and that was said
        self._server = uvicorn.Server(
            uvicorn.Config(
                Starlette(routes=routes, middleware=guards, lifespan=self._lifespan),
                http=_Connection,
                ws="none",
                log_level="error",
                access_log=False,
                backlog=MOST,
                timeout_graceful_shutdown=2,
            )
        )
        self._thread = threading.Thread(target=self._server.run, args=([listening],), name="page", daemon=True)
        self._thread.start()
        deadline = time.monotonic() + WAIT_S
        while not self._server.started:
            if not self._thread.is_alive() or time.monotonic() > deadline:
                raise InputError(f"{self.address}: the server does not start; run again with another --http-port")
            time.sleep(0.01)

    def add(self, prediction: Prediction) -> None:
        """Show a prediction in every browser that is ready for it."""
        self.newest = prediction
        self._wake()

    def close(self) -> None:
        """Tell the browsers that nothing more comes, and end the server."""
        self.closed = True
        self._wake()
        self._server.should_exit = True
        self._thread.join(WAIT_S)

    def _wake(self) -> None:
        if self._viewers or self.closed:
            self._loop.call_soon_threadsafe(lambda: [viewer.ready.set() for viewer in self._viewers])

    @contextlib.asynccontextmanager
    async def _lifespan(self, app: Starlette) -> AsyncIterator[None]:
        self._loop = asyncio.get_running_loop()
        self._loop.set_exception_handler(self._failed)
        yield

    def _failed(self, loop: asyncio.AbstractEventLoop, context: dict) -> None:
        """Say once that no connection can be accepted: asyncio tells it anew for each, every second."""
        error = context.get("exception")
        if not (isinstance(error, OSError) and error.errno in FULL):
            loop.default_exception_handler(context)
        elif not self._is_full:
            self._is_full = True
            self.session.say(
                f"{self.address}: no further page can be opened now ({error.strerror}); the session goes on, and pages "
                "can be opened again once others are closed"
            )

    async def _file(self, request: Request) -> Response:
        content, kind = self._files[request.url.path]
        return Response(content, media_type=kind)

    async def _pictures(self, request: Request) -> Response:
        if request.method != "GET" or not is_own(request.headers):
            return Response("only the page itself gets pictures\n", status_code=403)
        viewer = _Viewer()
        return StreamingResponse(self._events(viewer), media_type="text/event-stream")

    async def _posted(self, request: Request) -> Response:
        """Take a browser's word of WORDS, if it is one of a viewer."""
        if not is_own(request.headers) or "origin" not in request.headers:  # which browsers send with every POST
            return Response("only the page itself says anything here\n", status_code=403)
        kind, take = WORDS[request.url.path]
        try:
            said = word(await request.body(), kind)
        except ClientDisconnect:  # nobody is there to be answered
            return Response(status_code=400)
        viewer = said and next((viewer for viewer in self._viewers if viewer.name == said.viewer), None)
        answer = viewer and await take(self, viewer, said)
        return answer or Response("not the word of a viewer\n", status_code=400)

    async def _drawn(self, viewer: "_Viewer", said: "Drawn") -> Response | None:
        """Note what a browser has drawn; None where it never got that."""
        if not 0 <= said.number <= viewer.sent:
            return None
        viewer.hear(said.number)
        if said.arrived_s is not None:
            self.to_picture_ms.append(1e3 * min(max(time.monotonic() - said.arrived_s, 0.0), LONGEST_S))
        return Response(status_code=204)

    async def _record(self, _: "_Viewer", said: "Record") -> Response | None:
        """Start or stop recording, and answer what is recorded now; None where nothing can be."""
        if self.recorder is None:
            return None
        await run_in_threadpool(self.recorder.start if said.record else self.recorder.stop)  # which write to a disk
        self._status_due = 0.0
        return Response(outputs.as_json(self.recorder.told()), media_type="application/json")

    async def _events(self, viewer: "_Viewer") -> AsyncIterator[str]:
        """Yield events for one browser: what the model is, predictions, and the end."""
        self._viewers.append(viewer)
        try:
            held = {"viewer": viewer.name, "records": self.recorder is not None, "truth": self.truth is not None}
            yield event("model", held | description(self.session.card, self.session.model.interval_sentences))
            while True:
                newest, behind = self.newest, len(viewer.unsaid) >= AHEAD
                if newest is not None and newest.number > viewer.sent and not behind:
                    viewer.sent, viewer.is_told = newest.number, False
                    viewer.unsaid.append(newest.number)
                    truth = self.truth(newest.reading) if self.truth else {}
                    said = picture(newest, self.session.card) | truth | {"status": self._status_now()}
                    yield event("picture", said)
                    await asyncio.sleep(PICTURE_S)
                elif self.closed:
                    yield event("end", {"status": self._status_now(anew=True)})
                    return
                elif behind and time.monotonic() - viewer.heard > QUIET_S:
                    return  # a browser that lives connects anew
                else:
                    with contextlib.suppress(TimeoutError):
                        async with asyncio.timeout(QUIET_S if viewer.is_told else STATUS_S):
                            await viewer.ready.wait()
                    if not (viewer.is_told or viewer.ready.is_set()):  # counts of the picture were STATUS_S old
                        viewer.is_told = True
                        yield event("status", {"status": self._status_now(anew=True)})
                    viewer.ready.clear()
        finally:
            self._viewers.remove(viewer)

    def _status_now(self, anew: bool = False) -> dict:
        """Return counts, rates and times of the session, at most STATUS_S old."""
        now = time.monotonic()
        if anew or now >= self._status_due:
            lines, self._status_due = self.session.lines, now + STATUS_S
            self._status = {
                "lines": lines.count,
                "lines_per_s": self.session.lines_per_s(),
                "rejects": dict(lines.rejects),
                "rejected": lines.rejected,
                "notes": list(self.session.notes),
                "to_prediction_ms": percentiles([1e3 * taken for taken in list(self.session.to_prediction_s)]),
                "to_picture_ms": percentiles(list(self.to_picture_ms)),
                "recording": self.recorder and self.recorder.told(),
            }
        return self._status


class _Viewer:
    """One browser that listens. `sent`: the latest prediction that it got; `unsaid`: those that no word was of, yet."""

    def __init__(self):
        self.name, self.ready = secrets.token_hex(), asyncio.Event()
        self.sent, self.heard = 0, time.monotonic()
        self.is_told = True  # of counts and times as they are, no line having come since
        self.unsaid: deque[int] = deque()

    def hear(self, number: int) -> None:
        """Take the word that a prediction, and thus all before, has come."""
        self.heard = time.monotonic()
        while self.unsaid and self.unsaid[0] <= number:
            self.unsaid.popleft()
        self.ready.set()


class _Guard:
    """Refuses what no page of this server asks, before its body is read, and gives every answer its headers."""

    def __init__(self, app: ASGIApp, connections: Callable[[], int]):
        self.app, self._connections = app, connections

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        async def headed(message: Message) -> None:
            if message["type"] == "http.response.start":
                MutableHeaders(scope=message).update(HEADERS)
            await send(message)

        refused = self._refused(scope["path"], Headers(scope=scope)) if scope["type"] == "http" else None
        await (refused or self.app)(scope, receive, headed)

    def _refused(self, path: str, headers: Headers) -> Response | None:
        close = {"Connection": "close"}
        if path in ("/", "/pictures") and self._connections() > MOST:  # the rest belongs to pages that are open
            words = f"{MOST} connections to this page are open: close other tabs. This one tries again every 5 s.\n"
            return Response(words, 503, close | {"Refresh": "5", "Retry-After": "5"}, "text/plain")
        if "transfer-encoding" in headers:
            return Response("a body must say its length\n", 411, close)
        if int(headers.get("content-length", "0")) > LARGEST:  # h11 has refused what is no number
            return Response(f"a body has at most {LARGEST} bytes\n", 413, close)
        return None


class _Connection(H11Protocol):
    """A connection that is closed unless each request comes whole within REQUEST_S, and answers go within STALLED_S."""

    _late: asyncio.TimerHandle | None = None  # closes it, while a request is awaited or arriving
    _stalled: asyncio.TimerHandle | None = None  # closes it, while the other side takes nothing

    def connection_made(self, transport: asyncio.Transport) -> None:
        super().connection_made(transport)
        if len(self.connections) > MOST + SPARE:
            transport.abort()
        else:
            self._late = self.loop.call_later(REQUEST_S, transport.abort)

    def data_received(self, data: bytes) -> None:
        super().data_received(data)
        if self.cycle is not None and not (self.cycle.response_complete or self.cycle.more_body):
            self._late = _cancelled(self._late)
        elif self._late is None:
            self._late = self.loop.call_later(REQUEST_S, self.transport.abort)

    def pause_writing(self) -> None:
        super().pause_writing()
        self._stalled = self._stalled or self.loop.call_later(STALLED_S, self.transport.abort)

    def resume_writing(self) -> None:
        super().resume_writing()
        self._stalled = _cancelled(self._stalled)

    def connection_lost(self, exc: Exception | None) -> None:
        super().connection_lost(exc)
        self._late, self._stalled = _cancelled(self._late), _cancelled(self._stalled)


def _cancelled(timer: asyncio.TimerHandle | None) -> None:
    if timer is not None:
        timer.cancel()


def is_own(headers: Headers) -> bool:
    """Tell whether a request comes from the page itself, by what browsers say of it; other programs need say nothing.

    An origin has scheme, host and port: another port of this machine, https, and "null" are others.
    """
    origins, sites = headers.getlist("origin"), headers.getlist("sec-fetch-site")
    own = f"http://{headers['host']}"
    return all(origin == own for origin in origins) and all(site in ("same-origin", "none") for site in sites)


class Drawn(NamedTuple):
    """What a browser has drawn."""

    viewer: str
    number: int  # of a prediction
    arrived_s: float | None  # time.monotonic() of its line; None: it is not drawn

    def is_sound(self) -> bool:
        """Tell whether its values are of these kinds."""
        is_time = self.arrived_s is None or (
            type(self.arrived_s) in (int, float) and abs(self.arrived_s) < 2**53  # also for NaN
        )
        return type(self.viewer) is str and type(self.number) is int and is_time


class Record(NamedTuple):
    """The button that starts and stops a recording was pressed."""

    viewer: str
    record: bool

    def is_sound(self) -> bool:
        """Tell whether its values are of these kinds."""
        return type(self.viewer) is str and type(self.record) is bool


WORDS = {"/drawn": (Drawn, Page._drawn), "/record": (Record, Page._record)}  # path -> what is said there, who takes it


def word(body: bytes, kind: type[Drawn] | type[Record]) -> Drawn | Record | None:
    """Return what a body says, None where it is no word of that kind."""
    try:
        said = kind(**json.loads(body))
    except (ValueError, TypeError, RecursionError):
        return None
    return said if said.is_sound() else None


def event(name: str, data: dict) -> str:
    """Return an event of a stream as a browser expects it."""
    return f"event: {name}\ndata: {outputs.as_json(data)}\n\n"


def percentiles(values: list[float]) -> list[float] | None:
    """Return the median and the 95th percentile, None where there is no value."""
    return np.percentile(values, [50, 95]).round(2).tolist() if values else None


def description(card: Card, interval_sentences: list[str]) -> dict:
    """Return what the page has to know of a model before its first prediction."""
    sensor, shapes, grid = card.reading.get("sensor", {}), card.shapes, [1, card.inputs.columns]
    size_mm, least_span = None, 0.0
    if card.kind == "windows":  # of a touch array
        grid = [shapes.rows, shapes.cols]
        least_span = 0.1 * card.reading.get("ingest", {}).get("highest_count", 0)  # noise is not to fill the scale
        if card.outputs.touch_kpa is not None:
            size_mm = [sensor["cols"] * sensor["pitch_mm"], sensor["rows"] * sensor["pitch_mm"]]
    elif card.kind == "images":
        areas = list(images.areas(card.reading).values())
        grid = [areas[0].rows, areas[0].cols] if len(areas) == 1 else [math.ceil(card.inputs.columns / 27), 27]
    return {
        "name": card.title,
        "heading": card.heading,
        "lacks": card.lacks,
        "says": card.says,
        "kind": card.kind,
        "unit": card.outputs.unit,
        "names": card.outputs.names,
        "best": card.outputs.best,
        "set": card.outputs.set_of_them,
        "touch_kpa": card.outputs.touch_kpa,
        "intervals": interval_sentences,
        "map": [shapes.map_rows, shapes.map_cols],
        "size_mm": size_mm,
        "reading": {
            "values": card.inputs.columns,
            "grid": grid,
            "unit": card.inputs.unit,
            "order": card.inputs.order,
            "least_span": least_span,
        },
        "viridis": encoded(np.array(colormaps["viridis"].colors) * 255),
    }


def picture(prediction: Prediction, card: Card) -> dict:
    """Return what the page draws of a prediction; of a pressure map, shares of its highest cell `peak` in 255 steps."""
    said = {
        "number": prediction.number,
        "arrived_s": prediction.arrived_s,
        "reading": [round(value, 4) for value in prediction.reading.values.tolist()],
        "known": outputs.known(prediction),
    }
    if not said["known"]:
        return said
    if card.says == "map":
        peak = max(float(prediction.values.max()), 1e-6)
        said |= {"peak": peak, "map": encoded(np.clip(prediction.values / peak, 0, 1) * 255)}
    else:
        said["values"] = np.round(prediction.values.astype(float), 4).tolist()
    return said | outputs.fields(prediction, card)


def encoded(values: np.ndarray) -> str:
    """Return numbers of 0 to 255 as text for a browser: bytes in base64."""
    return base64.b64encode(np.round(values).astype(np.uint8).tobytes()).decode()
