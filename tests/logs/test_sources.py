"""Named sources: the pinned list, the copy from a folder, and the refusal of wrong files."""

import hashlib
import re
import sys
import threading
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from urllib.parse import quote, unquote

import pytest

from pipeline import experiments
from pipeline.base.errors import InputError
from pipeline.commands import command_line, fetch
from pipeline.logs import sources

CONTENT = {"a/one.txt": b"1.0 2.0\n", "b/two words.txt": b"3.0 4.0\n"}


@pytest.fixture
def small(monkeypatch, tmp_path):
    """A source of two files, its local folder, and an empty place for the fetched files."""
    digests = {path: hashlib.sha256(data).hexdigest() for path, data in CONTENT.items()}
    monkeypatch.setattr(sources, "files", lambda name: digests)
    local = tmp_path / "local"
    for path, data in CONTENT.items():
        (local / path).parent.mkdir(parents=True)
        (local / path).write_bytes(data)
    return local


@pytest.mark.parametrize(
    ("name", "count", "first"),
    [
        ("velostat_recorded", 32, "/Lupasic/tactile-sensor-velostat/c319860a13fcde964917329370ae31314024a96f/src/exp"),
        ("strain_recorded", 2, "/30718094c8dbbb889c3207f4dc32394166c2821e/experiment/UR5RobotControlV3.2/"),
        ("glove_recorded", 856, "/7bbb341b2db445653477b82b908e2ef0175cf926/python/classification/training_grasp_profi"),
    ],
)
def test_a_source_is_pinned_and_complete(name, count, first):
    listed = sources.files(name)
    assert len(listed) == count and all(re.fullmatch(r"[0-9a-f]{64}", digest) for digest in listed.values())
    assert re.fullmatch(r"[0-9a-f]{40}", experiments.facts(name).source.commit)
    for path in listed:
        address = sources.address(experiments.facts(name).source, path)
        assert address.startswith("https://raw.githubusercontent.com/") and first in address
        assert unquote(address).endswith(f"/{path}")
    pairs = [{path.partition("/")[2] for path in listed if path.startswith(device)} for device in ("velostat", "futek")]
    assert pairs[0] == pairs[1]


def test_copy_from_folder_then_nothing_left_to_do(workspace, small):
    assert not sources.is_complete(workspace, "velostat_recorded")
    assert fetch.fetch(workspace, "velostat_recorded", small) == (2, 0)
    assert sources.is_complete(workspace, "velostat_recorded")
    assert got(workspace) == CONTENT  # nothing else, so no temporary file either
    assert fetch.fetch(workspace, "velostat_recorded", small) == (0, 2)


def test_resumes_and_repairs(workspace, small):
    fetch.fetch(workspace, "velostat_recorded", small)
    (sources.folder(workspace, "velostat_recorded") / "a/one.txt").write_bytes(b"damaged")
    with pytest.raises(InputError, match=r"a/one\.txt: is not the recorded file"):
        sources.is_complete(workspace, "velostat_recorded")
    assert fetch.fetch(workspace, "velostat_recorded", small) == (1, 1)
    assert sources.is_complete(workspace, "velostat_recorded")


def test_wrong_file_is_refused_and_not_put_in_place(workspace, small):
    (small / "b/two words.txt").write_bytes(b"something else\n")
    with pytest.raises(InputError, match=r"two words\.txt: SHA-256 is .* expected"):
        fetch.fetch(workspace, "velostat_recorded", small)
    assert [p.name for p in sources.folder(workspace, "velostat_recorded").rglob("*") if p.is_file()] == ["one.txt"]
    with pytest.raises(InputError, match=r"two words\.txt: is missing; run `tactile fetch velostat_recorded`"):
        sources.is_complete(workspace, "velostat_recorded")


def test_missing_file_and_folder_are_one_sentence(workspace, small, tmp_path):
    (small / "a/one.txt").unlink()
    with pytest.raises(InputError, match=r"one\.txt: not found; --from"):
        fetch.fetch(workspace, "velostat_recorded", small)
    with pytest.raises(InputError, match="no such folder"):
        fetch.fetch(workspace, "velostat_recorded", tmp_path / "nowhere")


class Server(ThreadingHTTPServer):
    """CONTENT on loopback, like a public address; `asked`: path and Range of every request."""

    def __init__(self):
        super().__init__(("127.0.0.1", 0), Handler)
        self.asked, self.content = [], dict(CONTENT)
        self.cut = None  # bytes after which a connection breaks
        self.ranges = True  # whether a part of a file is sent when asked for

    def address(self, name: str, path: str) -> str:
        return f"http://127.0.0.1:{self.server_port}/{quote(path)}"


class Handler(BaseHTTPRequestHandler):
    def do_GET(self):
        path, span, server = unquote(self.path[1:]), self.headers["Range"], self.server
        server.asked.append((path, span))
        if path not in server.content:
            self.send_error(404)
            return
        body, status = server.content[path], 200
        if span and server.ranges:
            first = int(span.removeprefix("bytes=").removesuffix("-"))
            if first >= len(body):
                self.send_error(416)
                return
            body, status = body[first:], 206
        self.send_response(status)
        self.send_header("Content-Length", str(len(body)))
        self.end_headers()
        self.wfile.write(body[: server.cut])

    def log_message(self, *arguments):
        """Says nothing."""


@pytest.fixture
def server(small, monkeypatch):
    with Server() as server:
        monkeypatch.setattr(sources, "address", server.address)
        thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.01})
        thread.start()
        yield server
        server.shutdown()
        thread.join()


def got(workspace) -> dict[str, bytes]:
    """Every file that is in the source's folder."""
    folder = sources.folder(workspace, "velostat_recorded")
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def test_download(workspace, server):
    assert fetch.fetch(workspace, "velostat_recorded") == (2, 0)
    assert server.asked == [("a/one.txt", None), ("b/two words.txt", None)]
    assert got(workspace) == CONTENT and sources.is_complete(workspace, "velostat_recorded")
    assert fetch.fetch(workspace, "velostat_recorded") == (0, 2) and len(server.asked) == 2


def test_a_broken_download_goes_on_in_the_middle_of_the_file(workspace, server):
    server.cut = 3
    with pytest.raises(InputError, match=r"one\.txt: the connection ended after 3 of 8 bytes; repeat the command"):
        fetch.fetch(workspace, "velostat_recorded")
    assert got(workspace) == {"a/one.txt.part": b"1.0"} and fetch.state(workspace, "velostat_recorded") == "absent"
    server.cut = None
    assert fetch.fetch(workspace, "velostat_recorded") == (2, 0)
    assert server.asked[1] == ("a/one.txt", "bytes=3-") and got(workspace) == CONTENT


@pytest.mark.parametrize("left", [b"1.0", b"other", b"1.0 2.0\n", b"1.0 2.0\nand more"])
@pytest.mark.parametrize("ranges", [True, False])
def test_whatever_an_interruption_left_ends_as_the_file(workspace, server, left, ranges):
    part = sources.folder(workspace, "velostat_recorded") / "a" / "one.txt.part"
    part.parent.mkdir(parents=True)
    part.write_bytes(left)
    server.ranges = ranges
    assert fetch.fetch(workspace, "velostat_recorded") == (2, 0) and got(workspace) == CONTENT


def test_a_wrong_file_from_the_public_address_is_refused(workspace, server):
    server.content["b/two words.txt"] = b"3.0 5.0\n"
    with pytest.raises(InputError, match=r"two%20words\.txt: SHA-256 is .* expected"):
        fetch.fetch(workspace, "velostat_recorded")
    assert got(workspace) == {"a/one.txt": CONTENT["a/one.txt"]}
    assert fetch.state(workspace, "velostat_recorded") == "partly: 1 of 2 files"


def test_a_file_without_end_is_refused(workspace, server, monkeypatch):
    monkeypatch.setattr(fetch, "LARGEST_FILE", 5)
    with pytest.raises(InputError, match="more than 5 bytes; this is not the recording"):
        fetch.fetch(workspace, "velostat_recorded")
    assert got(workspace) == {}


def test_failed_download_is_one_sentence(workspace, server, monkeypatch):
    del server.content["a/one.txt"]
    with pytest.raises(InputError, match=r"one\.txt: download failed \(HTTP Error 404.* use --from FOLDER"):
        fetch.fetch(workspace, "velostat_recorded")
    monkeypatch.setattr(sources, "address", lambda name, path: "http://127.0.0.1:1/nobody")
    with pytest.raises(InputError, match=r"nobody: download failed .*refused.* use --from FOLDER"):
        fetch.fetch(workspace, "velostat_recorded")


def test_the_list_has_size_licence_and_state(workspace, server):
    def line(name: str) -> str:
        return next(line for line in fetch.listing(workspace).splitlines() if line.startswith(name))

    assert re.search(r"2 +16\.9 MB +absent +none given", line("velostat_recorded"))
    assert re.search(r"5\.1 MB +absent +GPL-3", line("glove_recorded"))
    fetch.fetch(workspace, "velostat_recorded")
    assert re.search(r"16\.9 MB +complete +none given", line("velostat_recorded"))
    (sources.folder(workspace, "velostat_recorded") / "a" / "one.txt").write_bytes(b"damaged")
    assert " partly: 1 of 2 files, 1 wrong " in line("velostat_recorded")
    for source in experiments.having("source").values():
        assert f"github.com/{source.repository}/tree/{source.commit}" in fetch.listing(workspace)


def test_command_line(monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", ["tactile", "fetch"])
    command_line.main()
    said = capsys.readouterr().out
    assert said.startswith("source ") and "--from FOLDER" in said
    assert all(name in said for name in experiments.having("source"))
    monkeypatch.setattr(sys, "argv", ["tactile", "fetch", "--from", "there"])
    with pytest.raises(SystemExit, match="--from: name the source too"):
        command_line.main()


@pytest.mark.parametrize("name", experiments.having("source"))
def test_size_is_that_of_the_recordings(name, recordings):
    folder = recordings(name)
    assert sum((folder / path).stat().st_size for path in sources.files(name)) == experiments.facts(name).source.size
