"""An archive of all results: restored in another checkout of the same commit, nothing is left to run there."""

import argparse
import shutil
import sys
import zipfile

import pytest
from dvc.repo import Repo

from pipeline.base.errors import InputError
from pipeline.base.paths import Workspace
from pipeline.commands import bundle

PIPELINE = """stages:
  make:
    cmd: "{python} -c \\"import pathlib; pathlib.Path('made').mkdir(); pathlib.Path('made/a').write_text('1')\\""
    outs: [made]
"""


@pytest.fixture
def checkout(tmp_path, monkeypatch):
    """A pipeline of one stage that has run, in a folder of its own."""
    for variable in ("DVC_GLOBAL_CONFIG_DIR", "DVC_SYSTEM_CONFIG_DIR", "DVC_SITE_CACHE_DIR"):
        monkeypatch.setenv(variable, str(tmp_path / variable))
    folder = tmp_path / "first"
    (folder / "reports").mkdir(parents=True)
    (folder / "reports" / "index.html").write_text("page")
    (folder / "params.yaml").write_text("a: 1\n")
    (folder / "params").mkdir()
    (folder / "params" / "touch.yaml").write_text("b: 1\n")
    (folder / "dvc.yaml").write_text(PIPELINE.format(python=sys.executable))
    monkeypatch.chdir(folder)  # DVC reproduces what is here
    with Repo.init(str(folder), no_scm=True) as repo:
        repo.reproduce()
    return folder


def other(checkout):
    """Return another checkout of the same commit, in which nothing has run."""
    folder = checkout.parent / "second"
    shutil.copytree(checkout, folder, ignore=shutil.ignore_patterns("cache", "made", "tmp"))
    return folder


def test_what_was_written_is_restored_in_another_checkout(checkout, capsys):
    file = checkout.parent / "all.zip"
    bundle.main(Workspace(checkout), argparse.Namespace(what="write", file=file))
    assert "all.zip: 2 files" in capsys.readouterr().out  # the folder's list, and the file in it
    with zipfile.ZipFile(file) as archive:
        assert {"reports/index.html", "params.yaml", "params/touch.yaml", "dvc.lock"} <= set(archive.namelist())
    folder = other(checkout)
    with Repo(str(folder)) as repo:
        assert repo.status()
    bundle.main(Workspace(folder), argparse.Namespace(what="restore", file=file))
    assert (folder / "made" / "a").read_text() == "1"
    with Repo(str(folder)) as repo:
        assert repo.status() == {}, "nothing is left to run"
    assert not (folder / ".dvc" / "config.local").exists(), "the user's remotes stay as they are"


def test_a_wrong_archive_is_named(checkout):
    file = checkout.parent / "all.zip"
    with pytest.raises(InputError, match="there is no such file"):
        bundle.restore(Workspace(checkout), file)
    bundle.write(Workspace(checkout), file)
    folder = other(checkout)
    (folder / "dvc.lock").write_text((folder / "dvc.lock").read_text() + "# of another commit\n")
    with pytest.raises(InputError, match="not that of this checkout"):
        bundle.restore(Workspace(folder), file)
    file.write_bytes(file.read_bytes()[:100])
    with pytest.raises(InputError, match="cut short"):
        bundle.restore(Workspace(folder), file)


def test_what_was_not_run_is_named(checkout):
    shutil.rmtree(checkout / ".dvc" / "cache")
    shutil.rmtree(checkout / "made")
    with pytest.raises(InputError, match="run `dvc repro` first"):
        bundle.write(Workspace(checkout), checkout.parent / "all.zip")
    assert not (checkout.parent / "all.zip").exists()
