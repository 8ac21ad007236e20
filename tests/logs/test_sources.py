"""Named sources: the pinned list, the copy from a folder, and the refusal of wrong files."""

import hashlib
import re
import sys
import threading
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from urllib.parse import quote, unquote

import pytest

from tactile import experiments
from tactile.base.errors import InputError
from tactile.commands import command_line, fetch
from tactile.logs import sources

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
    files = (folder / one for path in sources.files(name) for one in sources.members(path))
    assert sum(file.stat().st_size for file in files) == experiments.facts(name).source.size


@pytest.fixture
def numbered(monkeypatch, tmp_path):
    """A source of one file and of three that are numbered, which have one digest, and its local folder."""
    content = {"a/one.txt": b"1.0\n"} | {f"b/{k:03d}.npz": b"frame %d" % k for k in range(9, 12)}
    digests = {path: hashlib.sha256(data).hexdigest() for path, data in content.items()}
    lines = "".join(f"{digests[path]}  {path}\n" for path in sorted(content) if path.startswith("b/"))
    listed = {"a/one.txt": digests["a/one.txt"], "b/{009..011}.npz": hashlib.sha256(lines.encode()).hexdigest()}
    monkeypatch.setattr(sources, "files", lambda name: listed)
    local = tmp_path / "numbered"
    for path, data in content.items():
        (local / path).parent.mkdir(parents=True, exist_ok=True)
        (local / path).write_bytes(data)
    return local


def test_numbered_files_are_copied_checked_and_repaired_together(workspace, numbered):
    name, folder = "array_recorded", sources.folder(workspace, "array_recorded")
    assert fetch.state(workspace, name) == "absent" and not sources.is_complete(workspace, name)
    assert fetch.fetch(workspace, name, numbered) == (4, 0) and sources.is_complete(workspace, name)
    assert fetch.fetch(workspace, name, numbered) == (0, 4) and fetch.state(workspace, name) == "complete"
    (folder / "b" / "010.npz").write_bytes(b"damaged")
    assert fetch.state(workspace, name) == "partly: 1 of 4 files, 3 wrong"
    with pytest.raises(
        InputError, match=r"b/\{009\.\.011\}\.npz: are not the recorded files \(their SHA-256 differs\)"
    ):
        sources.is_complete(workspace, name)
    assert fetch.fetch(workspace, name, numbered) == (3, 1) and sources.is_complete(workspace, name)
    (folder / "b" / "011.npz").unlink()
    assert fetch.state(workspace, name) == "partly: 1 of 4 files"
    with pytest.raises(InputError, match=r"b/011\.npz: is missing; run `tactile fetch array_recorded`"):
        sources.is_complete(workspace, name)


def test_numbered_files_that_are_wrong_are_not_put_in_place(workspace, numbered):
    folder = sources.folder(workspace, "array_recorded")
    (numbered / "b" / "009.npz").write_bytes(b"frame 10")
    (numbered / "b" / "010.npz").write_bytes(b"frame 9")  # the same contents under other names
    with pytest.raises(InputError, match=r"b/\{009\.\.011\}\.npz: SHA-256 is .*, expected"):
        fetch.fetch(workspace, "array_recorded", numbered)
    assert [path.name for path in folder.rglob("*") if path.is_file()] == ["one.txt"]
    (numbered / "b" / "009.npz").replace(numbered / "009.npz")  # its name alone does not tell where it belongs
    with pytest.raises(InputError, match=r"009\.npz: not found; --from"):
        fetch.fetch(workspace, "array_recorded", numbered)


@pytest.mark.parametrize("cut", [None, 3])
def test_numbered_files_are_downloaded_and_a_cut_download_goes_on(workspace, numbered, monkeypatch, cut):
    with Server() as server:
        server.content = {path.relative_to(numbered).as_posix(): path.read_bytes() for path in numbered.rglob("*.*")}
        server.cut = cut
        threading.Thread(target=server.serve_forever, daemon=True).start()
        monkeypatch.setattr(sources, "address", lambda origin, path: server.address("", path))
        for _ in range(8 if cut else 0):
            try:
                fetch.fetch(workspace, "array_recorded")
                break
            except InputError as error:
                assert "the connection ended after" in str(error)
        if cut is None:
            assert fetch.fetch(workspace, "array_recorded") == (4, 0)
        assert sources.is_complete(workspace, "array_recorded")
        server.shutdown()
    assert not list(sources.folder(workspace, "array_recorded").rglob("*.part"))


def test_the_digest_of_numbered_files_is_that_of_sha256sum(numbered):
    there = {one: numbered / one for one in sources.members("b/{009..011}.npz")}
    assert list(there) == ["b/009.npz", "b/010.npz", "b/011.npz"]
    assert sources.digest(there) == sources.files("")["b/{009..011}.npz"]


def test_the_frames_of_the_array_are_listed_by_session():
    listed = sources.files("array_recorded")
    files = [one for path in listed for one in sources.members(path)]
    assert len(listed) == 30 and len(set(files)) == 28_099 and {"P01/1/npz/0000.npz", "P10/3/npz/0296.npz"} < set(files)
