"""Files that others read appear whole or not at all."""

import errno
import os
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from pipeline.base import files
from pipeline.base.errors import InputError, storage_error
from pipeline.base.paths import CODE


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
    calls = {path.relative_to(CODE).as_posix(): path.read_text().count("rmtree(") for path in CODE.rglob("*.py")}
    known = {"base/files.py": 1, "commands/own.py": 1, "inference/mlflow_runs.py": 1}
    assert {file: count for file, count in calls.items() if count} == known
