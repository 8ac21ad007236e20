"""A folder that strangers can write to, as a remote of DVC: what docs/runs.md says of `verify` holds."""

import hashlib
import json
import re
import shutil
import sys
from pathlib import Path

import pytest
from builders.project import ROOT
from dvc.exceptions import DvcException
from dvc.repo import Repo

PIPELINE = "stages: {make: {cmd: python make.py, outs: [data/d, x]}}\n"
MAKE = """from pathlib import Path
Path("data/d").mkdir(parents=True)
Path("data/d/a").write_text("1")
Path("x").write_text("2")
"""
FOREIGN = b"print('code of a stranger')\n"


@pytest.fixture
def shelf(tmp_path, monkeypatch) -> Path:
    """Return a remote with the outputs of a stage that has run in the folder `first` beside it."""
    for variable in ("DVC_GLOBAL_CONFIG_DIR", "DVC_SYSTEM_CONFIG_DIR", "DVC_SITE_CACHE_DIR"):
        monkeypatch.setenv(variable, str(tmp_path / variable))
    folder, shelf = tmp_path / "first", tmp_path / "shelf"
    folder.mkdir()
    (folder / "dvc.yaml").write_text(PIPELINE.replace("python", sys.executable))
    (folder / "make.py").write_text(MAKE)
    monkeypatch.chdir(folder)  # DVC reproduces what is here
    with Repo.init(str(folder), no_scm=True) as repo:
        repo.reproduce()
        with repo.config.edit("local") as config:
            config["remote"] = {"shelf": {"url": str(shelf), "verify": True}}
    with Repo(str(folder)) as repo:
        repo.push(remote="shelf")
    return shelf


def checkout(shelf: Path, monkeypatch) -> Path:
    """Return a checkout of the same commit, in which nothing has run."""
    folder = shelf.parent / "second"
    ignored = shutil.ignore_patterns("cache", "data", "x", "tmp")
    shutil.copytree(shelf.parent / "first", folder, ignore=ignored)
    monkeypatch.setenv("DVC_SITE_CACHE_DIR", str(shelf.parent / "site"))  # as on another machine
    monkeypatch.chdir(folder)
    return folder


def held(folder: Path) -> dict[str, bytes]:
    """Return the content of all files of a folder, without DVC's cache and notes."""
    files = {path.relative_to(folder).as_posix(): path for path in folder.rglob("*") if path.is_file()}
    return {name: path.read_bytes() for name, path in files.items() if not re.match(r"\.dvc/(cache|tmp)/", name)}


def planted(shelf: Path, place: str) -> None:
    """Put a file of a stranger's into a remote, and have the list of a folder place it."""
    digest = hashlib.md5(FOREIGN).hexdigest()
    path = shelf / "files" / "md5" / digest[:2] / digest[2:]
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(FOREIGN)
    (listed,) = shelf.rglob("*.dir")
    listed.chmod(0o644)
    content = json.loads(listed.read_text()) + [{"md5": digest, "relpath": place}]
    listed.write_text(json.dumps(content))


@pytest.mark.parametrize("place", ["", "../../tqdm.py", "../../../outside.txt", "ABOVE/outside.txt", "more"])
def test_of_a_changed_remote_only_what_dvc_lock_tells_of_comes_here(place, shelf, monkeypatch):
    if place:
        planted(shelf, place.replace("ABOVE", str(shelf.parent)))
    else:
        changed = next(path for path in shelf.rglob("*") if path.is_file() and path.read_bytes() == b"1")
        changed.chmod(0o644)
        changed.write_text("99")
    folder = checkout(shelf, monkeypatch)
    before, beside = held(folder), sorted(path.name for path in shelf.parent.iterdir())
    with Repo(str(folder)) as repo, pytest.raises(DvcException):
        repo.pull(remote="shelf")
    assert held(folder) in (before, before | {"x": b"2"})  # x is as the lock file says
    cached = [path for path in (folder / ".dvc" / "cache").rglob("*") if path.is_file()]
    for path in cached:
        assert hashlib.md5(path.read_bytes()).hexdigest() == (path.parent.name + path.name).removesuffix(".dir")
    assert sorted(path.name for path in shelf.parent.iterdir() if path.name != "site") == beside


def test_a_remote_as_it_was_written_leaves_nothing_to_run(shelf, monkeypatch):
    folder = checkout(shelf, monkeypatch)
    with Repo(str(folder)) as repo:
        assert repo.status()
        repo.pull(remote="shelf")
        assert repo.status() == {}
    assert (folder / "data" / "d" / "a").read_text() == "1"


def test_the_documents_say_how_a_remote_is_verified():
    assert "dvc remote modify --local shelf verify true" in (ROOT / "docs" / "runs.md").read_text()
