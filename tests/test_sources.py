"""Named sources: the pinned list, the copy from a folder, and the refusal of wrong files."""

import hashlib
import io
import re
from urllib.error import URLError

import pytest

from pipeline import fetch, paths, sources
from pipeline.errors import InputError

CONTENT = {"a/one.txt": b"1.0 2.0\n", "b/two words.txt": b"3.0 4.0\n"}


@pytest.fixture
def small(monkeypatch, tmp_path):
    """A source of two files, its local folder, and an empty place for the fetched files."""
    monkeypatch.setattr(paths, "SOURCES", tmp_path / "sources")
    digests = {path: hashlib.sha256(data).hexdigest() for path, data in CONTENT.items()}
    monkeypatch.setattr(sources, "files", lambda name: digests)
    local = tmp_path / "local"
    for path, data in CONTENT.items():
        (local / path).parent.mkdir(parents=True)
        (local / path).write_bytes(data)
    return local


def test_velostat_list_is_pinned_and_complete():
    listed = sources.files("velostat_recorded")
    assert len(listed) == 32
    assert all(re.fullmatch(r"[0-9a-f]{64}", digest) for digest in listed.values())
    readings = {path.removeprefix("velostat_data/") for path in listed if path.startswith("velostat_data/")}
    forces = {path.removeprefix("futek_data/") for path in listed if path.startswith("futek_data/")}
    assert readings == forces and len(readings) == 16
    assert re.fullmatch(r"[0-9a-f]{40}", sources.source("velostat_recorded").commit)


def test_address_has_commit_and_path():
    path = "velostat_data/pike1/exp_pike1_sensor1_exp1.txt"
    assert sources.address("velostat_recorded", path) == (
        "https://raw.githubusercontent.com/Lupasic/tactile-sensor-velostat/"
        f"c319860a13fcde964917329370ae31314024a96f/src/experimental_data/{path}"
    )


def test_copy_from_folder_then_nothing_left_to_do(small):
    assert not sources.is_complete("velostat_recorded")
    assert fetch.fetch("velostat_recorded", small) == (2, 0)
    assert sources.is_complete("velostat_recorded")
    target = sources.folder("velostat_recorded")
    got = {str(p.relative_to(target)): p.read_bytes() for p in target.rglob("*") if p.is_file()}
    assert got == CONTENT  # nothing else, so no temporary file either
    assert fetch.fetch("velostat_recorded", small) == (0, 2)


def test_resumes_and_repairs(small):
    fetch.fetch("velostat_recorded", small)
    (sources.folder("velostat_recorded") / "a/one.txt").write_bytes(b"damaged")
    assert not sources.is_complete("velostat_recorded")
    assert fetch.fetch("velostat_recorded", small) == (1, 1)
    assert sources.is_complete("velostat_recorded")


def test_wrong_file_is_refused_and_not_put_in_place(small):
    (small / "b/two words.txt").write_bytes(b"something else\n")
    with pytest.raises(InputError, match=r"two words\.txt: SHA-256 is .* expected"):
        fetch.fetch("velostat_recorded", small)
    assert [p.name for p in sources.folder("velostat_recorded").rglob("*") if p.is_file()] == ["one.txt"]
    assert not sources.is_complete("velostat_recorded")


def test_missing_file_folder_and_name_are_one_sentence(small, tmp_path):
    (small / "a/one.txt").unlink()
    with pytest.raises(InputError, match=r"one\.txt: not found; --from"):
        fetch.fetch("velostat_recorded", small)
    with pytest.raises(InputError, match="no such folder"):
        fetch.fetch("velostat_recorded", tmp_path / "nowhere")
    with pytest.raises(InputError, match="no such source; choose one of .*velostat_recorded"):
        fetch.fetch("velostat")


def test_download_takes_the_public_address(small, monkeypatch):
    asked = []

    def answer(address, timeout):
        asked.append(address)
        return io.BytesIO(CONTENT["a/one.txt" if address.endswith("a/one.txt") else "b/two words.txt"])

    monkeypatch.setattr(fetch, "urlopen", answer)
    assert fetch.fetch("velostat_recorded") == (2, 0)
    assert asked == [sources.address("velostat_recorded", path) for path in CONTENT]
    assert " " not in asked[1]


def test_failed_download_is_one_sentence(small, monkeypatch):
    def refuse(address, timeout):
        raise URLError("no route")

    monkeypatch.setattr(fetch, "urlopen", refuse)
    with pytest.raises(InputError, match=r"one\.txt: download failed .* use --from FOLDER"):
        fetch.fetch("velostat_recorded")
