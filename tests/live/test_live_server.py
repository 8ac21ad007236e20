"""What other programs and web sites may ask of the page's server, and what they get."""

import contextlib
import json
import re
import resource
import socket
import subprocess
import sys
import threading
import time
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import numpy as np
import pytest
from builders.devices import WAIT_S, until
from builders.live_models import press, printed
from builders.project import ROOT

from tactile.inference import predictor
from tactile.live import outputs, server
from tactile.live.session import Session
from tactile.live.source import Lines, line_format

GOOD = {"number": 0, "arrived_s": None}


class Client:
    """One connection to a page."""

    def __init__(self, port: int):
        self.port, self.rest, self.method = port, b"", ""
        self.socket = socket.create_connection(("127.0.0.1", port), timeout=WAIT_S)

    def send(self, method: str, path: str, body: bytes | None = None, **headers: str | None) -> "Client":
        """Send a request whose headers are HOST, LENGTH and those given; None: without it."""
        self.method = method
        given = {"Host": f"127.0.0.1:{self.port}"} | ({} if body is None else {"Content-Length": str(len(body))})
        given |= {name.replace("_", "-"): value for name, value in headers.items()}
        lines = [
            f"{method} {path} HTTP/1.1",
            *(f"{name}: {value}" for name, value in given.items() if value is not None),
        ]
        self.socket.sendall("\r\n".join([*lines, "", ""]).encode() + (body or b""))
        return self

    def answer(self) -> tuple[int, dict[str, str]]:
        """Return status and headers of the next answer; (0, {}) where the connection was closed."""
        head = self._until(b"\r\n\r\n")
        if not head:
            return 0, {}
        first, *lines = head.decode().split("\r\n")
        headers = dict(line.lower().split(": ", 1) for line in lines if line)
        if self.method != "HEAD":
            self._take(int(headers.get("content-length", 0)))
        return int(first.split()[1]), headers

    def event(self) -> tuple[str, dict]:
        """Return the next event of a stream."""
        block = self._until(b"\n\n")
        name, data = re.search(rb"event: (\w+)\ndata: (.*)", block, re.DOTALL).groups()

        def refuse(constant):
            raise AssertionError(f"{constant} is no JSON")

        return name.decode(), json.loads(re.sub(rb"\r\n[0-9a-f]+\r\n", b"", data), parse_constant=refuse)

    def is_closed(self) -> bool:
        """Tell whether the server has ended the connection."""
        self.socket.settimeout(0.01)
        try:
            while self.socket.recv(1 << 16):
                pass
            return True
        except TimeoutError:
            return False
        except ConnectionError:
            return True

    def _until(self, mark: bytes) -> bytes:
        while mark not in self.rest:
            try:
                data = self.socket.recv(1 << 16)
            except ConnectionError:
                data = b""
            if not data:
                return b""
            self.rest += data
        found, _, self.rest = self.rest.partition(mark)
        return found

    def _take(self, count: int) -> None:
        while len(self.rest) < count:
            data = self.socket.recv(1 << 16)
            assert data, "the answer is cut"
            self.rest += data
        self.rest = self.rest[count:]


class Pressed:
    """A recorder of which only counts how often it was started and stopped."""

    def __init__(self):
        self.started = self.stopped = 0

    def start(self) -> None:
        self.started += 1

    def stop(self) -> None:
        self.stopped += 1

    def told(self) -> dict:
        return {"file": "array.log", "lines": 0, "runs": self.started > self.stopped, "problem": ""}


@pytest.fixture
def page(package, capfd):
    """A page whose session has predicted some lines; nothing may be said on the terminal."""
    model = predictor.load(package("linear"))
    session = Session(model, Lines(line_format(model.card), "array.log", "the model"), lambda _: None)
    shown = server.Page(session, 0, Pressed())
    shown.port = int(shown.address.split(":")[2].strip("/"))
    shown.predictions = [*session.take(printed(press(60)), 0.0), *session.finish()]
    shown.add(shown.predictions[-1])
    yield shown
    shown.close()
    assert capfd.readouterr().err == ""


@pytest.fixture
def client(page):
    """`client()`: a new connection to the page; closed with the test."""
    with contextlib.ExitStack() as opened:

        def one() -> Client:
            made = Client(page.port)
            opened.enter_context(made.socket)
            return made

        yield one


def viewer(client) -> str:
    """The name of a viewer who has got a picture."""
    listening = client().send("GET", "/pictures")
    assert listening.answer()[0] == 200
    name, said = listening.event()
    assert name == "model" and listening.event()[0] == "picture"
    return said["viewer"]


def drawn(client, page, body, path="/drawn", **headers) -> int:
    """The status of the answer to a word."""
    body = body if isinstance(body, bytes) else json.dumps(body).encode()
    own = {"Origin": f"http://127.0.0.1:{page.port}", "Content_Type": "text/plain"}
    return client().send("POST", path, body, **own | headers).answer()[0]


ORIGINS = [  # of a request to 127.0.0.1:PORT
    ("http://127.0.0.1:{port}", True),
    ("http://localhost:{port}", False),  # another origin to a browser; a page there asks localhost
    ("http://127.0.0.1:{other}", False),
    ("http://127.0.0.1", False),
    ("https://127.0.0.1:{port}", False),
    ("http://127.0.0.1:{port}/", False),
    ("http://127.0.0.1:{port}.evil.com", False),
    ("http://127.0.0.1:{port}@evil.com", False),
    ("http://evil.com", False),
    ("http://evil.com:{port}", False),
    ("http://[::1]:{port}", False),
    ("file://", False),
    ("null", False),
    ("", False),
]


@pytest.mark.parametrize(("origin", "own"), ORIGINS)
def test_another_origin_gets_no_pictures_and_says_nothing(origin, own, page, client):
    given, name = origin.format(port=page.port, other=page.port + 1), viewer(client)
    assert client().send("GET", "/pictures", Origin=given).answer()[0] == (200 if own else 403)
    assert drawn(client, page, GOOD | {"viewer": name}, Origin=given) == (204 if own else 403)


@pytest.mark.parametrize(("origin", "own"), ORIGINS)
def test_another_origin_presses_no_button(origin, own, page, client):
    """Not even with the name of a viewer, which it cannot know; without an origin, or for another site, nobody does."""
    given, press_it = origin.format(port=page.port, other=page.port + 1), {"viewer": viewer(client), "record": True}
    assert drawn(client, page, press_it, "/record", Origin=given) == (200 if own else 403)
    assert drawn(client, page, press_it, "/record", Origin=None) == 403
    for site in ("cross-site", "same-site"):
        assert drawn(client, page, press_it, "/record", Sec_Fetch_Site=site) == 403
    assert page.recorder.started == own and not page.recorder.stopped


@pytest.mark.parametrize(
    "changed",
    [{"viewer": name} for name in ("", "1", None, 1, ["x"], "0" * 64)]
    + [{"record": value} for value in (1, 0, "true", None, [True], {})]
    + [{"more": 1}],
)
def test_a_press_of_no_viewer_is_refused(changed, page, client):
    name = viewer(client)
    assert drawn(client, page, {"viewer": name, "record": True} | changed, "/record") == 400
    assert drawn(client, page, {"viewer": name}, "/record") == 400
    assert drawn(client, page, GOOD | {"viewer": name}, "/record") == 400
    assert not page.recorder.started and not page.recorder.stopped


def test_where_nothing_can_be_recorded_no_press_is_taken(page, client):
    page.recorder = None
    assert drawn(client, page, {"viewer": viewer(client), "record": True}, "/record") == 400


@pytest.mark.parametrize("site", ["cross-site", "same-site", "none", "same-origin", "CROSS-SITE"])
def test_what_a_browser_asks_for_another_site_is_refused(site, page, client):
    """An image or a script of another site sends no origin, but says this; another port here is of the same site."""
    own = site in ("none", "same-origin")
    status, _ = client().send("GET", "/pictures", Sec_Fetch_Site=site).answer()
    assert status == (200 if own else 403)
    assert drawn(client, page, GOOD | {"viewer": viewer(client)}, Sec_Fetch_Site=site) == (204 if own else 403)
    assert client().send("GET", "/", Sec_Fetch_Site=site).answer()[0] == 200, "a link to the page may be followed"


def test_a_word_without_an_origin_is_refused(page, client):
    assert drawn(client, page, GOOD | {"viewer": viewer(client)}, Origin=None) == 403


def test_a_page_by_another_name_of_this_machine_is_one(page, client):
    """By localhost, and through a forwarded port."""
    for host in (f"localhost:{page.port}", "localhost:1234", "127.0.0.1:1234", "localhost"):
        body = GOOD | {"viewer": viewer(client)}
        assert drawn(client, page, body, Host=host, Origin=f"http://{host}") == 204
        assert drawn(client, page, body, Host=host) == (204 if host == f"127.0.0.1:{page.port}" else 403)


@pytest.mark.parametrize("host", ["evil.com", "127.0.0.1.evil.com", "evil.com:{port}", "", "[::1]:{port}"])
@pytest.mark.parametrize(
    ("method", "path"), [("GET", "/"), ("GET", "/pictures"), ("POST", "/drawn"), ("POST", "/record")]
)
def test_another_host_is_refused(method, path, host, page, client):
    given = host.format(port=page.port)
    status, _ = client().send(method, path, b"", Host=given, Origin=f"http://{given}").answer()
    assert status == 400


@pytest.mark.parametrize(
    "headers",
    [
        {"Content_Length": "1001"},
        {"Content_Length": str(300 << 20)},
        {"Content_Length": "9" * 30},
        {"Content_Length": "9" * 5000},
        {"Transfer_Encoding": "chunked"},
        {"Transfer_Encoding": "chunked", "Content_Length": "10"},
        {"Content_Length": "-1"},
        {"Content_Length": "1e3"},
        {"Content_Length": "0x10"},
        {"Content_Length": "ten"},
    ],
)
@pytest.mark.parametrize(
    ("method", "path"), [("POST", "/drawn"), ("POST", "/record"), ("GET", "/"), ("GET", "/pictures"), ("POST", "/none")]
)
def test_a_body_is_refused_before_it_is_read(method, path, headers, page, client):
    """No byte of the body is sent: who answers has read none."""
    one = client().send(method, path, None, Origin=f"http://127.0.0.1:{page.port}", **headers)
    status, said = one.answer()
    assert status in (400, 411, 413) and said["connection"] == "close"
    until(one.is_closed)


def test_a_large_body_takes_no_memory(page, client):
    one, block = client(), bytes(1 << 20)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    one.send("POST", "/drawn", None, Content_Length=str(300 << 20), Origin=f"http://127.0.0.1:{page.port}")
    with pytest.raises(ConnectionError):
        for _ in range(300):
            one.socket.sendall(block)
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 20 << 10


@pytest.mark.parametrize(
    "changed",
    [
        {"number": float("inf")},
        {"number": float("nan")},
        {"number": 10**400},
        {"number": -1},
        {"number": 10**6},  # was never sent
        {"number": 1.0},
        {"number": True},
        {"number": "1"},
        {"number": None},
        {"number": [1]},
        {"arrived_s": 10**400},
        {"arrived_s": -(10**400)},
        {"arrived_s": 1.7e308},
        {"arrived_s": float("inf")},
        {"arrived_s": float("-inf")},
        {"arrived_s": float("nan")},
        {"arrived_s": "nan"},
        {"arrived_s": "1"},
        {"arrived_s": True},
        {"arrived_s": [1.0]},
        {"arrived_s": {}},
        {"viewer": 1},
        {"viewer": "1"},
        {"viewer": ""},
        {"viewer": None},
        {"viewer": ["x"]},
        {"more": 1},
    ],
)
def test_a_word_of_no_viewer_is_refused(changed, page, client):
    assert drawn(client, page, GOOD | {"viewer": viewer(client)} | changed) == 400
    assert not page.to_picture_ms


@pytest.mark.parametrize(
    "body",
    [b"", b"null", b"[]", b"{}", b"1", b'"x"', b"\xff", b"[" * 1000, b'{"a":' * 150, b"9" * 1000, b"{", b"\x00"]
    + ['{"viewer": "a"}'.encode("utf-16"), b'{"viewer":1,"viewer":2}', b"[{}]", b'["viewer","number","arrived_s"]'],
)
def test_what_is_no_word_is_refused(body, page, client):
    assert drawn(client, page, body) == drawn(client, page, body, "/record") == 400


def test_times_are_of_0_to_60_seconds(page, client):
    name = viewer(client)
    now = time.monotonic()
    for arrived_s in (now - 0.5, now - 3600, now + 3600, 0, -1e15, 1e15):
        assert drawn(client, page, GOOD | {"viewer": name, "arrived_s": arrived_s}) == 204
    first, *others = page.to_picture_ms
    assert 500 <= first <= 500 + 1000 * (time.monotonic() - now)
    assert others[0] == others[3] == 60_000 and others[1] == others[4] == 0
    assert client().send("GET", "/pictures").answer()[0] == 200


def test_viewers_have_names_that_cannot_be_guessed(client):
    names = {viewer(client) for _ in range(5)}
    assert len(names) == 5 and all(re.fullmatch("[0-9a-f]{64}", name) for name in names)


def test_every_answer_says_who_may_show_it(page, client):
    for method, path, status in (
        ("GET", "/", 200),
        ("GET", "/page.js", 200),
        ("GET", "/page.css", 200),
        ("GET", "/pictures", 200),
        ("POST", "/drawn", 403),
        ("POST", "/record", 403),
        ("GET", "/record", 405),
        ("GET", "/none", 404),
        ("GET", "/drawn", 405),
        ("HEAD", "/pictures", 403),
    ):
        found, headers = client().send(method, path).answer()
        assert found == status
        assert "frame-ancestors 'none'" in headers["content-security-policy"]
        assert headers["x-content-type-options"] == "nosniff" and headers["referrer-policy"] == "same-origin"
        assert headers["cross-origin-resource-policy"] == "same-origin" and headers["cache-control"] == "no-store"


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_what_is_no_number_is_null(value, page, client):
    reading = page.predictions[-1].reading
    values = reading.values.copy()
    values[1] = value
    prediction = page.predictions[-1]._replace(force_n=float(value), reading=reading._replace(values=values))
    page.add(prediction)
    listening = client().send("GET", "/pictures")
    listening.answer()
    assert listening.event()[0] == "model"
    name, said = listening.event()
    assert name == "picture" and said["force_n"] is None and said["reading"][1] is None
    assert said["reading"][0] == values[0] and said["touches"][0]["kpa"] > 0
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as heard:
        heard.bind(("127.0.0.1", 0))
        heard.settimeout(5)
        outputs.Datagrams(f"127.0.0.1:{heard.getsockname()[1]}", page.session.card).add(prediction)
        assert json.loads(heard.recv(10_000), parse_constant=pytest.fail)["force_n"] is None


def test_no_more_than_64_connections_open_a_page(page, client):
    """Those that are open go on: their files, and their words."""
    opened = [client() for _ in range(server.MOST)]
    for one in opened:
        one.send("GET", "/pictures")
        assert one.answer()[0] == 200
    name = opened[0].event()[1]["viewer"]
    for path in ("/", "/pictures"):
        status, headers = client().send("GET", path).answer()
        assert status == 503 and headers["refresh"] == headers["retry-after"] == "5"
    assert client().send("GET", "/page.js").answer()[0] == 200
    assert drawn(client, page, GOOD | {"viewer": name}) == 204
    many = [client() for _ in range(5 * server.SPARE)]
    until(lambda: sum(one.is_closed() for one in many) >= 4 * server.SPARE)
    assert len(page._server.server_state.connections) <= server.MOST + server.SPARE
    for one in [*opened, *many]:
        one.socket.close()
    until(lambda: client().send("GET", "/").answer()[0] == 200)


@pytest.mark.parametrize(
    "begun",
    [b"", b"GET / HTTP/1.1\r\nX: ", b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\nGET /", b"POST"],
)
def test_a_request_that_does_not_end_is_let_go(begun, monkeypatch, client):
    """However slowly it goes on, byte by byte."""
    monkeypatch.setattr(server, "REQUEST_S", 1.0)
    one, began = client(), time.monotonic()
    one.socket.sendall(begun)
    while not one.is_closed():
        assert time.monotonic() < began + WAIT_S, "it is kept"
        with contextlib.suppress(ConnectionError):
            one.socket.sendall(b"x")
        time.sleep(0.1)
    assert time.monotonic() - began > 0.5


def test_a_body_that_does_not_come_is_let_go(page, monkeypatch, client):
    monkeypatch.setattr(server, "REQUEST_S", 1.0)
    one = client().send("POST", "/drawn", None, Content_Length="500", Origin=f"http://127.0.0.1:{page.port}")
    until(one.is_closed)


def test_a_body_that_breaks_off_is_no_error(page, client):
    one = client().send("POST", "/drawn", None, Content_Length="500", Origin=f"http://127.0.0.1:{page.port}")
    until(lambda: len(page._server.server_state.tasks) == 1)
    one.socket.close()
    until(lambda: not page._server.server_state.tasks)


def test_a_viewer_that_listens_is_kept(page, monkeypatch, client):
    monkeypatch.setattr(server, "REQUEST_S", 0.2)
    one = client().send("GET", "/pictures")
    assert one.answer()[0] == 200
    assert [one.event()[0] for _ in range(3)] == ["model", "picture", "status"], "counts as they are in the end"
    time.sleep(1.0)
    page.add(page.predictions[-1]._replace(number=1000))
    assert one.event()[1]["number"] == 1000


def test_a_viewer_that_says_no_word_is_let_go(page, monkeypatch, client):
    monkeypatch.setattr(server, "QUIET_S", 0.5)
    monkeypatch.setattr(server, "AHEAD", 2)
    one = client().send("GET", "/pictures")
    assert one.answer()[0] == 200
    assert [one.event()[0], one.event()[0]] == ["model", "picture"] and len(page._viewers) == 1
    page.add(page.predictions[-1]._replace(number=1000))
    until(lambda: not page._viewers)


def test_a_page_gets_pictures_as_long_as_it_says_so(page, monkeypatch, client):
    """However many predictions lie between two: the first second of lines is predicted at once."""
    monkeypatch.setattr(server, "AHEAD", 3)
    monkeypatch.setattr(server, "PICTURE_S", 0.0)
    one = client().send("GET", "/pictures")
    assert one.answer()[0] == 200
    name, number = one.event()[1]["viewer"], one.event()[1]["number"]
    for jump in (1000, 1, 10**6):
        page.add(page.predictions[-1]._replace(number=number + jump))
        number = one.event()[1]["number"]
        assert drawn(client, page, {"viewer": name, "number": number, "arrived_s": None}) == 204
    for place in range(6):
        number += 1
        page.add(page.predictions[-1]._replace(number=number))
        if place < 3:  # AHEAD of the page's word
            assert one.event()[1]["number"] == number
    assert one.event()[0] == "status"
    one.socket.settimeout(0.3)
    with pytest.raises(TimeoutError):
        one.event()
    one.socket.settimeout(WAIT_S)
    assert drawn(client, page, {"viewer": name, "number": number - 5, "arrived_s": None}) == 204
    assert one.event()[1]["number"] == number, "the newest"


@pytest.mark.slow
def test_file_descriptors_that_are_used_up_are_one_line(package, tmp_path):
    """The session goes on, and the page comes back once others are closed."""
    log = tmp_path / "array.log"
    log.write_bytes(printed(press(100)))
    line = [
        sys.executable,
        "-m",
        "tactile.commands.command_line",
        "live",
        str(package("linear")),
        "--replay",
        str(log),
    ]
    said, errors = (tmp_path / "csv").open("w"), (tmp_path / "errors").open("w")
    process = subprocess.Popen(
        [*line, "--loop", "--page", "--csv", "--http-port", "0"], cwd=ROOT, stdout=said, stderr=errors
    )
    try:
        until(lambda: "http://" in Path(errors.name).read_text(), 60)
        port = int(re.search(r"127\.0\.0\.1:(\d+)", Path(errors.name).read_text())[1])
        until(lambda: Path(said.name).read_text().count("\n") > 10)
        used = len(list(Path(f"/proc/{process.pid}/fd").iterdir()))
        resource.prlimit(process.pid, resource.RLIMIT_NOFILE, (used + 20, used + 20))
        half = [socket.socket() for _ in range(200)]
        for one in half:
            one.setblocking(False)
            one.connect_ex(("127.0.0.1", port))
        time.sleep(2.5)  # asyncio tries again every second
        before = Path(said.name).stat().st_size
        until(lambda: Path(said.name).stat().st_size > before + 1000)
        for one in half:
            one.close()
        until(lambda: Client(port).send("GET", "/").answer()[0] == 200, 10)
    finally:
        process.terminate()
        process.wait(20)
    notes = Path(errors.name).read_text().splitlines()
    about = [note for note in notes if "Too many open files" in note]
    assert (
        len(about) == 1 and about[0].startswith("http://127.0.0.1") and not any("Traceback" in note for note in notes)
    )
    assert process.returncode == 0


@pytest.mark.slow
def test_a_browser_that_is_refused_says_so_and_comes_back(page, client, tab, monkeypatch):
    opened = [client() for _ in range(server.MOST)]
    for one in opened:
        one.send("GET", "/pictures")
        assert one.answer()[0] == 200
    tab.width(1000)
    tab.open(page.address)
    assert "64 connections to this page are open" in tab.run("document.body.innerText")
    opened[0].socket.close()
    opened[1].socket.close()
    until(lambda: "live" in tab.run("document.getElementById('state')?.textContent ?? ''"), 20)
    # The page is open, and its stream is refused.
    for one in opened:
        one.socket.close()
    tab.open(page.address)
    until(lambda: "live" in tab.run("document.getElementById('state').textContent"), 20)
    monkeypatch.setattr(server, "MOST", 0)
    for connection in list(page._server.server_state.connections):
        page._loop.call_soon_threadsafe(connection.transport.abort)
    until(lambda: "refuses this page" in tab.run("document.getElementById('state').textContent"), 20)
    monkeypatch.setattr(server, "MOST", 64)
    until(lambda: "live" in tab.run("document.getElementById('state').textContent"), 20)


class Quiet(SimpleHTTPRequestHandler):
    """A web server that prints nothing."""

    def log_message(self, *_) -> None: ...


@pytest.mark.slow
def test_a_web_site_in_a_browser_gets_and_says_nothing(page, client, tab, tmp_path):
    """From another port of this machine, which is the same site, with the name of a viewer that it cannot know."""
    (tmp_path / "index.html").write_text("<!doctype html><title>another site</title>")
    site = ThreadingHTTPServer(("127.0.0.1", 0), partial(Quiet, directory=tmp_path))
    threading.Thread(target=site.serve_forever, daemon=True).start()
    name = viewer(client)
    before = list(page._viewers)
    try:
        tab.open(f"http://127.0.0.1:{site.server_port}/")
        body = json.dumps({"viewer": name, "number": 0, "arrived_s": 0.0})
        pressed = json.dumps({"viewer": name, "record": True})
        for mode in ("no-cors", "cors"):
            say = f"fetch('{page.address}drawn', {{method: 'POST', mode: '{mode}', body: {body!r}}})"
            tab.run(f"{say}.then(answer => answer.status, () => null)")
            tab.run(
                f"{say.replace('drawn', 'record').replace(body, pressed)}.then(answer => answer.status, () => null)"
            )
        asks = f"new Promise(end => {{ const asked = new EventSource('{page.address}pictures'); asked.onerror = end }})"
        tab.run(f"{asks}.then(() => 1)")
        image = (
            f"new Promise(end => {{ const one = new Image(); one.onerror = end; one.src = '{page.address}pictures' }})"
        )
        tab.run(f"{image}.then(() => 1)")
        frame = f"document.body.append(Object.assign(document.createElement('iframe'), {{src: '{page.address}'}}))"
        tab.run(f"{frame}, new Promise(end => setTimeout(end, 1000))")
        assert page._viewers == before and not page.to_picture_ms and not page.recorder.started
        tab.open(page.address)
        until(lambda: "live" in tab.run("document.getElementById('state').textContent"), 20)
        until(lambda: page.to_picture_ms, 20)
    finally:
        site.shutdown()
        site.server_close()
