"""An archive of all results: restored in another checkout of the same commit, nothing is left to run there."""

import argparse
import shutil
import sys
import zipfile

import pytest
from dvc.repo import Repo

from pipeline.base import paths
from pipeline.base.errors import InputError
from pipeline.commands import bundle

PIPELINE = """stages:
  make:
    cmd: "{python} -c \\"import pathlib; pathlib.Path('made').mkdir(); pathlib.Path('made/a').write_text('1')\\""
    outs: [made]
"""


@pytest.fixture
def checkout(tmp_path, monkeypatch):
    """A pipeline of one stage that has run, in a folder of its own, which the commands take for this project."""
    for variable in ("DVC_GLOBAL_CONFIG_DIR", "DVC_SYSTEM_CONFIG_DIR", "DVC_SITE_CACHE_DIR"):
        monkeypatch.setenv(variable, str(tmp_path / variable))
    folder = tmp_path / "first"
    (folder / "reports").mkdir(parents=True)
    (folder / "reports" / "index.html").write_text("page")
    (folder / "params.yaml").write_text("a: 1\n")
    (folder / "params").mkdir()
    (folder / "params" / "touch.yaml").write_text("b: 1\n")
    (folder / "dvc.yaml").write_text(PIPELINE.format(python=sys.executable))
    monkeypatch.chdir(folder)
    monkeypatch.setattr(paths, "ROOT", folder)
    with Repo.init(str(folder), no_scm=True) as repo:
        repo.reproduce()
    return folder


def other(checkout, monkeypatch):
    """Return another checkout of the same commit, in which nothing has run."""
    folder = checkout.parent / "second"
    shutil.copytree(checkout, folder, ignore=shutil.ignore_patterns("cache", "made", "tmp"))
    monkeypatch.chdir(folder)
    monkeypatch.setattr(paths, "ROOT", folder)
    return folder


def test_what_was_written_is_restored_in_another_checkout(checkout, monkeypatch, capsys):
    file = checkout.parent / "all.zip"
    bundle.main(argparse.Namespace(what="write", file=file))
    assert "all.zip: 2 files" in capsys.readouterr().out  # the folder's list, and the file in it
    with zipfile.ZipFile(file) as archive:
        assert {"reports/index.html", "params.yaml", "params/touch.yaml", "dvc.lock"} <= set(archive.namelist())
    folder = other(checkout, monkeypatch)
    with Repo(str(folder)) as repo:
        assert repo.status()
    bundle.main(argparse.Namespace(what="restore", file=file))
    assert (folder / "made" / "a").read_text() == "1"
    with Repo(str(folder)) as repo:
        assert repo.status() == {}, "nothing is left to run"
    assert not (folder / ".dvc" / "config.local").exists(), "the user's remotes stay as they are"


def test_a_wrong_archive_is_named(checkout, monkeypatch):
    file = checkout.parent / "all.zip"
    with pytest.raises(InputError, match="there is no such file"):
        bundle.restore(file)
    bundle.write(file)
    folder = other(checkout, monkeypatch)
    (folder / "dvc.lock").write_text((folder / "dvc.lock").read_text() + "# of another commit\n")
    with pytest.raises(InputError, match="not that of this checkout"):
        bundle.restore(file)
    file.write_bytes(file.read_bytes()[:100])
    with pytest.raises(InputError, match="cut short"):
        bundle.restore(file)


def test_what_was_not_run_is_named(checkout):
    shutil.rmtree(checkout / ".dvc" / "cache")
    shutil.rmtree(checkout / "made")
    with pytest.raises(InputError, match="run `dvc repro` first"):
        bundle.write(checkout.parent / "all.zip")
    assert not (checkout.parent / "all.zip").exists()
