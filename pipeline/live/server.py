"""Show predictions on a web page of this machine: a server beside the thread that predicts, which never waits for it.

The page listens to a stream of events. Each has the prediction that is the newest when it is sent, so that a slow
browser gets fewer of them. Ten times a second the page says which one it has drawn. The time until that word is back is
the time from line to picture. A page that has fallen AHEAD predictions behind gets no more until it has caught up.
"""

import asyncio
import base64
import contextlib
import json
import math
import socket
import threading
import time
from collections import deque
from collections.abc import AsyncIterator
from pathlib import Path

import numpy as np
import uvicorn
from matplotlib import colormaps
from starlette.applications import Starlette
from starlette.middleware import Middleware
from starlette.middleware.trustedhost import TrustedHostMiddleware
from starlette.requests import Request
from starlette.responses import FileResponse, Response, StreamingResponse
from starlette.routing import Route

from pipeline.base.errors import InputError
from pipeline.inference import intervals
from pipeline.inference.card import Card
from pipeline.live import outputs
from pipeline.live.session import Prediction, Session

HOST = "127.0.0.1"  # nothing outside this machine can ask
AHEAD = 100  # predictions: half a second of 200 lines a second
KEPT = 300  # drawn pictures that times are taken from: half a minute
STATUS_S = 0.2  # how often counts and times are worked out anew
WAIT_S = 10.0  # for the server to start or to end
FILES = {"/": "page.html", "/page.css": "page.css", "/page.js": "page.js"}
HEADERS = {"Cache-Control": "no-store", "Content-Security-Policy": "default-src 'self'; img-src 'self' data:"}


class Page:
    """The page of one session, served until `close`. `address`: where."""

    def __init__(self, session: Session, port: int):
        """Start the server; port 0: any that is free. Raises InputError where the port is taken."""
        self.session, self.newest, self.closed = session, None, False
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
        routes = [Route(path, self._file) for path in FILES]
        routes += [Route("/pictures", self._pictures), Route("/drawn", self._drawn, methods=["POST"])]
        hosts = Middleware(TrustedHostMiddleware, allowed_hosts=[HOST, "localhost"])
        self._loop: asyncio.AbstractEventLoop | None = None
        self._server = uvicorn.Server(
            uvicorn.Config(
                Starlette(routes=routes, middleware=[hosts], lifespan=self._lifespan),
                log_level="error",
                access_log=False,
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
        yield

    async def _file(self, request: Request) -> Response:
        return FileResponse(Path(__file__).with_name(FILES[request.url.path]), headers=HEADERS)

    async def _pictures(self, request: Request) -> Response:
        viewer = _Viewer()
        self._viewers.append(viewer)
        return StreamingResponse(self._events(viewer), media_type="text/event-stream", headers=HEADERS)

    async def _drawn(self, request: Request) -> Response:
        """Take a browser's word: its number, the prediction that it has drawn (or only got), and when its line came."""
        try:
            said = await request.json()
            viewer = next(viewer for viewer in self._viewers if viewer.number == said["viewer"])
            number, arrived_s = int(said["number"]), None if said["arrived_s"] is None else float(said["arrived_s"])
        except (ValueError, KeyError, TypeError, StopIteration):
            return Response("not the word of a viewer\n", status_code=400)
        viewer.drawn = max(viewer.drawn, number)
        viewer.ready.set()
        if arrived_s is not None and math.isfinite(arrived_s):
            self.to_picture_ms.append(1e3 * (time.monotonic() - arrived_s))
        return Response(status_code=204)

    async def _events(self, viewer: "_Viewer") -> AsyncIterator[str]:
        """Yield events for one browser: what the model is, predictions, and the end."""
        try:
            yield event("model", {"viewer": viewer.number} | description(self.session.card))
            sent = 0
            while True:
                newest = self.newest
                if newest is not None and newest.number > sent and sent - viewer.drawn < AHEAD:
                    sent = newest.number
                    yield event("picture", picture(newest, self.session.card) | {"status": self._status_now()})
                elif self.closed:
                    yield event("end", {"status": self._status_now(anew=True)})
                    return
                else:
                    await viewer.ready.wait()
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
            }
        return self._status


class _Viewer:
    """One browser that listens."""

    numbers = 0

    def __init__(self):
        _Viewer.numbers += 1
        self.number, self.drawn, self.ready = _Viewer.numbers, 0, asyncio.Event()


def event(name: str, data: dict) -> str:
    """Return an event of a stream as a browser expects it."""
    return f"event: {name}\ndata: {json.dumps(data)}\n\n"


def percentiles(values: list[float]) -> list[float] | None:
    """Return the median and the 95th percentile, None where there is no value."""
    return np.percentile(values, [50, 95]).round(2).tolist() if values else None


def description(card: Card) -> dict:
    """Return what the page has to know of a model before its first prediction."""
    sensor, shapes, grid = card.reading.get("sensor", {}), card.shapes, [1, card.inputs.columns]
    size_mm, least_span = None, 0.0
    if card.kind == "windows":
        grid = [shapes.rows, shapes.cols]
        least_span = 0.1 * card.reading.get("ingest", {}).get("highest_count", 0)  # noise is not to fill the scale
        if card.outputs.touch_kpa is not None:
            size_mm = [sensor["cols"] * sensor["pitch_mm"], sensor["rows"] * sensor["pitch_mm"]]
    elif card.kind == "images":
        grid = [math.ceil(card.inputs.columns / 27), 27]
    return {
        "name": f"{card.experiment}/{card.model}",
        "kind": card.kind,
        "unit": card.outputs.unit,
        "names": card.outputs.names,
        "touch_kpa": card.outputs.touch_kpa,
        "intervals": intervals.sentences(card),
        "map": [shapes.map_rows, shapes.map_cols],
        "size_mm": size_mm,
        "reading": {"grid": grid, "unit": card.inputs.unit, "order": card.inputs.order, "least_span": least_span},
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
    if card.kind == "windows":
        peak = max(float(prediction.values.max()), 1e-6)
        said |= {"peak": peak, "map": encoded(np.clip(prediction.values / peak, 0, 1) * 255)}
    else:
        said["values"] = np.round(prediction.values.astype(float), 4).tolist()
    return said | outputs.fields(prediction, card)


def encoded(values: np.ndarray) -> str:
    """Return numbers of 0 to 255 as text for a browser: bytes in base64."""
    return base64.b64encode(np.round(values).astype(np.uint8).tobytes()).decode()
