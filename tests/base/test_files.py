"""Files that others read appear whole or not at all."""

import errno
import os
import platform
import stat
import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from builders.project import CODE, ROOT

from tactile.base import files
from tactile.base.errors import InputError, storage_error


def test_a_file_keeps_its_old_content_until_the_new_is_whole(tmp_path):
    path = tmp_path / "new" / "scores.csv"
    files.write_csv(path, ["model", "value"], [("lomp", 1 / 3)])

    def rows():
        yield "lomp", 0.5
        raise RuntimeError("killed half-way")

    with pytest.raises(RuntimeError, match="half-way"):
        files.write_csv(path, ["model", "value"], rows())
    assert path.read_text() == f"model,value\nlomp,{1 / 3!r}\n"
    files.write_csv(path, ["model", "value"], [("cnn", 2)])
    assert path.read_text() == "model,value\ncnn,2\n"
    assert [file.name for file in path.parent.iterdir()] == ["scores.csv"]


def test_a_folder_keeps_its_old_content_until_the_new_is_whole(tmp_path):
    path = tmp_path / "reports" / "touch"
    with files.replacing_folder(path) as draft:
        (draft / "old.md").write_text("old")
    with pytest.raises(RuntimeError, match="half-way"), files.replacing_folder(path) as draft:
        (draft / "torn.md").write_text("torn")
        raise RuntimeError("killed half-way")
    assert [file.name for file in path.iterdir()] == ["old.md"]
    with files.replacing_folder(path) as draft:
        (draft / "new.md").write_text("new")
    assert [file.name for file in path.rglob("*")] == ["new.md"]
    assert [file.name for file in path.parent.iterdir()] == ["touch"]


def former(path, kind: str):
    """Write a result of one's own, 'old', as a file or as a folder with a file."""
    replace = files.replacing if kind == "file" else files.replacing_folder
    with replace(path) as draft:
        (draft if kind == "file" else draft / "a.txt").write_text("old")
    return replace


def content(path) -> str:
    return (path if path.is_file() else path / "a.txt").read_text()


@pytest.mark.parametrize("kind", ["file", "folder"])
def test_two_processes_have_two_drafts_and_the_later_result_is_whole(kind, tmp_path, monkeypatch):
    path = tmp_path / "result"
    replace = former(path, kind)
    with replace(path) as mine:
        with monkeypatch.context() as patch:
            patch.setattr(os, "getpid", lambda: 1)  # runs always
            with replace(path) as theirs:
                assert theirs != mine and mine.parent == theirs.parent
                (theirs if kind == "file" else theirs / "a.txt").write_text("theirs")
            assert content(path) == "theirs"
        (mine if kind == "file" else mine / "a.txt").write_text("mine")
    assert content(path) == "mine" and [file.name for file in tmp_path.iterdir()] == ["result"]


@pytest.mark.parametrize("kind", ["file", "folder"])
def test_only_drafts_of_dead_processes_of_this_machine_are_removed(kind, tmp_path):
    path, here = tmp_path / "result[1]", platform.node()
    dead = subprocess.run([sys.executable, "-c", "import os; print(os.getpid())"], capture_output=True, text=True)
    names = [f"{path.name}.{dead.stdout.strip()}-{here}.unfinished"]
    names += [f"{path.name}.{os.getppid()}-{here}.unfinished", f"{path.name}.1-another.unfinished"]
    names += [f"other.{dead.stdout.strip()}-{here}.unfinished"]
    for name in names:
        (tmp_path / name).mkdir()
        (tmp_path / name / "part").touch()
    former(path, kind)
    assert sorted(file.name for file in tmp_path.iterdir()) == sorted([path.name, *names[1:]])


@pytest.mark.parametrize("exchange", [True, False])
def test_a_folder_is_never_without_a_name_where_names_can_be_exchanged(exchange, tmp_path, monkeypatch):
    path, seen = tmp_path / "result", []
    former(path, "folder")
    if not exchange:
        monkeypatch.setattr(files, "_exchanged", lambda one, other: False)
    elif not files._exchanged(path, path.with_name(path.name)):
        pytest.skip("this file system does not exchange names")
    rename = os.rename
    sys.addaudithook(lambda event, given: event == "os.rename" and seen.append(path.is_dir()))
    with files.replacing_folder(path) as draft:
        (draft / "a.txt").write_text("new")
        seen.clear()
    assert os.rename is rename and content(path) == "new"
    assert all(seen) if exchange else seen.count(False) == 1  # then the former one is beside it, as result.former
    assert [file.name for file in tmp_path.iterdir()] == ["result"]


def test_a_draft_is_on_the_disk_before_it_is_renamed(tmp_path, monkeypatch):
    synced, sync = [], os.fsync

    def noted(number):
        synced.append(os.readlink(f"/proc/self/fd/{number}") if sys.platform == "linux" else number)
        sync(number)

    monkeypatch.setattr(os, "fsync", noted)
    former(tmp_path / "folder", "folder")
    former(tmp_path / "file", "file")
    if sys.platform == "linux":
        names = [os.path.relpath(name, tmp_path).partition(".")[0] or "." for name in synced]
        assert names == ["folder", "folder", ".", "file", "."]
    assert len(synced) == 5


def test_a_folder_does_not_take_the_place_of_a_file(tmp_path):
    (tmp_path / "result").write_text("precious")
    with pytest.raises(InputError, match="result: is a file, not a folder"):
        former(tmp_path / "result", "folder")
    assert (tmp_path / "result").read_text() == "precious"


def test_a_folder_with_a_file_that_nobody_may_write_is_taken(tmp_path):
    with files.replacing_folder(tmp_path / "result") as draft:
        (draft / "a.txt").write_text("of DVC's cache")
        (draft / "a.txt").chmod(stat.S_IRUSR)
    assert content(tmp_path / "result") == "of DVC's cache"


@pytest.mark.parametrize(
    "error",
    [
        OSError(errno.ENOSPC, "x"),  # as pyarrow raises it
        RuntimeError("Error while serializing: I/O error: No space left on device (os error 28)"),  # as safetensors
    ],
)
def test_a_full_disk_names_the_file(error, tmp_path):
    with pytest.raises(OSError) as raised, files.replacing(tmp_path / "network.safetensors"):
        raise error
    assert storage_error(raised.value).startswith(f"{tmp_path / 'network.safetensors'}: No space left")


@pytest.mark.parametrize("write", [files.replacing, files.replacing_folder, files.changing_folder])
@pytest.mark.parametrize("name", ["a" * 300, "a\0b", "file/x", ".", "..", "/", "/proc/x", "loop/x"])
def test_a_place_that_cannot_be_written_is_a_sentence(name, write, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("file").write_text("kept")
    Path("loop").symlink_to("loop")
    with pytest.raises(InputError), write(Path(name)) as draft:
        (draft if write is files.replacing else draft / "x").write_text("x")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["file", "loop"]
    assert not list(tmp_path.parent.glob(f"*{files.UNFINISHED}"))


def test_a_changed_folder_keeps_what_is_not_replaced(tmp_path):
    path = tmp_path / "run0"
    (path / "more").mkdir(parents=True)
    (path / "a.log").write_text("old")
    (path / "more" / "b").write_text("kept")
    (path / "nowhere").symlink_to("gone")
    os.mkfifo(path / "pipe")
    with pytest.raises(RuntimeError), files.changing_folder(path) as draft:
        files.write_text(draft / "a.log", "new")
        raise RuntimeError
    assert (path / "a.log").read_text() == "old"
    with files.changing_folder(path) as draft:
        files.write_text(draft / "a.log", "new")
    assert (path / "a.log").read_text() == "new" and (path / "more" / "b").read_text() == "kept"
    assert (path / "nowhere").is_symlink() and (path / "pipe").is_fifo() and not (path / "pipe").is_file()
    assert [one.name for one in tmp_path.iterdir()] == ["run0"]


def test_what_comes_into_a_changed_folder_meanwhile_is_not_lost(tmp_path):
    path = tmp_path / "run0"
    path.mkdir()
    with pytest.raises(InputError, match="another process changed it meanwhile"), files.changing_folder(path):
        (path / "array.log").write_text("recorded meanwhile")
    assert (path / "array.log").read_text() == "recorded meanwhile"


def test_a_link_to_a_folder_stays_one(tmp_path):
    (tmp_path / "disk").mkdir()
    (tmp_path / "out").symlink_to("disk")
    with files.replacing_folder(tmp_path / "out") as draft:
        (draft / "new").write_text("new")
    assert (tmp_path / "out").is_symlink() and (tmp_path / "disk" / "new").read_text() == "new"
    assert sorted(one.name for one in tmp_path.iterdir()) == ["disk", "out"]


def test_tables_keep_every_digit(tmp_path):
    table = pd.DataFrame({"n": [1, 2], "value": [0.1 + 0.2, np.nan], "single": np.float32([1 / 3, 1e-30])})
    files.write_table(tmp_path / "table.csv", table, missing="nan")
    header, first, second = (tmp_path / "table.csv").read_text().splitlines()
    assert (header, first.split(",")[:2], second.split(",")[:2]) == (
        "n,value,single",
        ["1", "0.30000000000000004"],
        ["2", "nan"],
    )
    assert [np.float32(line.split(",")[2]) for line in (first, second)] == table["single"].tolist()


@pytest.mark.parametrize("name", ["../outside", ".", "/outside", "link"])
def test_no_folder_outside_its_room_is_removed(name, tmp_path):
    room, canary = tmp_path / "models", tmp_path / "outside" / "canary"
    room.mkdir()
    canary.mkdir(parents=True)
    (room / "link").symlink_to(tmp_path / "outside")
    folder = tmp_path / "outside" if name == "/outside" else room / name
    with pytest.raises(InputError, match="lies outside .*models, so it is not removed"):
        files.remove_folder(folder, inside=room)
    assert canary.is_dir() and room.is_dir()
    (room / "lomp" / "press-0").mkdir(parents=True)
    files.remove_folder(room / "lomp", inside=room)
    assert [path.name for path in room.iterdir()] == ["link"]


def test_folders_are_removed_in_known_places():
    """That of files.remove_folder, and those of folders that their module has made."""
    calls = {path.relative_to(ROOT).as_posix(): path.read_text().count("rmtree(") for path in CODE}
    known = {"tactile/base/files.py": 1, "tactile/commands/own.py": 1, "pipeline/tracking/mlflow_runs.py": 1}
    assert {file: count for file, count in calls.items() if count} == known
