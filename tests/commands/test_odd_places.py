"""Names that no file or folder can have: one sentence of every command, and no traceback."""

import os
from pathlib import Path

import pytest
from builders import live_models, own_logs

from tactile.inference import mlflow_store

LONG = "a/" + "x" * 300
PLACES = [LONG, "/proc/none", "file/below", "..", ".", "loop/below", "a\0b"]
OUT = [("predict", "linear", "logs", "--no-pictures", "--out", "PLACE"), ("export", "linear", "PLACE")]
IN = [("predict", "linear", "PLACE/none"), ("predict", "PLACE", "logs"), ("check", "touch", "PLACE")]
IN += [("sheet", "PLACE"), ("own", "PLACE"), ("fetch", "strain_recorded", "--from", "PLACE")]


@pytest.fixture
def room(workspace, monkeypatch) -> Path:
    """Return the folder of a test, in one of its own so that `..` is one, too; it holds a log and a model."""
    room = workspace.root / "room"
    room.mkdir()
    monkeypatch.chdir(room)
    own_logs.touch(room / "logs", 2, 3, 50.0, seconds=20.0, recordings=1, conditions=())
    (room / "logs" / "single" / "day1_0" / "load_cell.log").unlink()
    live_models.linear(room / "linear")
    (room / "file").write_text("kept")
    (room / "loop").symlink_to("loop")
    return room


@pytest.mark.parametrize(
    ("words", "place"),
    [*((words, place) for words in OUT for place in PLACES), *((words, place) for words in IN for place in PLACES[:3])],
    ids=lambda given: ascii(given)[:40],
)
def test_a_place_that_cannot_be_is_a_sentence(words, place, room, called, capsys):
    before = sorted(path.name for path in room.iterdir())
    with pytest.raises(SystemExit) as ended:
        called(*(word.replace("PLACE", place) for word in words))
    said = str(ended.value.code) if isinstance(ended.value.code, str) else capsys.readouterr().err
    assert said.strip() and "\n" not in said.strip() or words[0] == "check", said
    assert sorted(path.name for path in room.iterdir() if path.name != "a") == before


def test_the_whole_disk_is_no_sensor(room, called):
    for words in (("check", "touch", os.sep), ("own", os.sep), ("sheet", os.sep)):
        with pytest.raises(SystemExit, match="is the whole disk; name a sensor's folder"):
            called(*words)


@pytest.mark.parametrize("uri", ["http://u:secret@[::1/", "http://u:secret@h:port/", "http://u:secret@h:99999/"])
def test_an_address_that_is_none_is_a_sentence_without_its_password(uri, workspace, called, monkeypatch):
    monkeypatch.setenv("MLFLOW_TRACKING_URI", uri)
    with pytest.raises(Exception, match="MLFLOW_TRACKING_URI: is no address") as raised:
        with mlflow_store.opened(workspace):
            pass
    assert "secret" not in str(raised.value)
