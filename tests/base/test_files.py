"""Files that others read appear whole or not at all."""

import numpy as np
import pandas as pd
import pytest

from pipeline.base import files
from pipeline.base.errors import InputError
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
