"""What the button "Record" writes: whole lines as they came, each time to a file of its own."""

from pathlib import Path

import pytest
from builders.live_models import press, printed

from tactile.base.errors import InputError
from tactile.commands.live import Recorder
from tactile.inference import consistent
from tactile.live.source import Lines, line_format

HEADER = b"t_us,v5,v4,v3,v2,v1,v0\n"


@pytest.fixture
def lines(package) -> Lines:
    return Lines(line_format(consistent.read(package("linear"))), "a port", "touch/linear")


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def played(recorder: Recorder, lines: Lines, data: bytes, orders: dict[int, str], size: int = 7) -> list[bytes]:
    """Play data in pieces; orders: piece -> the method of the recorder that is called before it comes."""
    pieces = [data[k : k + size] for k in range(0, len(data), size)]

    def chunks():
        for k, piece in enumerate(pieces):
            getattr(recorder, orders.get(k, "told"))()
            yield piece

    passed = []
    for piece in recorder.recorded(chunks()):
        lines.take(piece)
        passed.append(piece)
    assert passed == pieces, "the session gets each piece as it came"
    return pieces


def test_a_log_has_the_whole_lines_from_the_button_to_the_button(lines):
    recorder, data = Recorder(lines, None, "array.log"), printed(press(40))
    assert recorder.told() == {"file": "", "lines": 0, "runs": False, "problem": ""}
    pieces = played(recorder, lines, data, {20: "start", 60: "stop"})
    told = recorder.told()
    file = Path(told["file"])
    assert file.parts[0] == "live" and file.name == "array.log" and not told["runs"]
    before, until = len(b"".join(pieces[:20])), len(b"".join(pieces[:60]))
    assert data[before - 1 : before] != b"\n", "the button is pressed within a line"
    first, last = data.index(b"\n", before) + 1, data.rindex(b"\n", 0, until) + 1
    assert last < until, "as it is pressed again"
    assert file.read_bytes() == data[first:last]
    assert told["lines"] == data[first:last].count(b"\n") == 10


def test_a_log_that_is_not_ended_ends_with_its_port(lines):
    recorder, data = Recorder(lines, None, "array.log"), printed(press(20))
    played(recorder, lines, data, {0: "start"})
    assert Path(recorder.told()["file"]).read_bytes() == data and not recorder.told()["runs"]


def test_the_file_of_record_is_begun_at_once_and_others_stand_beside_it(lines, folder):
    recorder, data = Recorder(lines, Path("bench/array.log"), "array.log"), printed(press(40))
    assert recorder.told()["runs"]
    pieces = played(recorder, lines, data, {30: "stop", 50: "start"})
    kept = b"".join(pieces[:30])
    assert Path("bench/array.log").read_bytes() == kept[: kept.rindex(b"\n") + 1]
    assert Path("bench/array-2.log").read_bytes() in data and recorder.told()["file"] == "bench/array-2.log"
    assert [path.name for path in sorted(folder.rglob("*.log"))] == ["array-2.log", "array.log"]


def test_a_log_that_begins_later_has_the_names_of_its_columns(lines):
    """Without them, columns that a device prints in an order of its own would be read in the usual one."""
    recorder, data = Recorder(lines, None, "array.log"), HEADER + printed(press(40))
    played(recorder, lines, data, {30: "start"})
    kept = Path(recorder.told()["file"]).read_bytes()
    assert kept.startswith(HEADER) and kept[len(HEADER) :] in data
    again = Lines(lines.format, "the log", "touch/linear")
    assert [one.values.tolist() for one in again.take(kept)] == press(40)[-kept.count(b"\n") + 1 :, ::-1].tolist()


def test_a_layout_that_needs_its_first_lines_is_not_begun_later(lines):
    named = Lines(lines.format, "a port", "touch/linear", laid_out={"columns": "v0..v5", "time": "t_us"})
    recorder = Recorder(named, None, "array.log")
    recorder.start()
    assert "begin it by --record" in recorder.told()["problem"] and not recorder.told()["runs"]


def test_a_line_that_a_vanished_device_began_stays_alone(lines):
    recorder = Recorder(lines, Path("array.log"), "array.log")
    list(recorder.recorded(iter([b"1000,1,2", None, b"2000,3,4,5,6,7,8\n"])))
    assert Path("array.log").read_bytes() == b"1000,1,2\n2000,3,4,5,6,7,8\n"


def test_no_file_is_overwritten(lines):
    Path("array-2.log").write_bytes(b"mine")
    recorder = Recorder(lines, Path("array.log"), "array.log")
    recorder.stop()
    recorder.start()
    assert "array-2.log: exists already" in recorder.told()["problem"] and not recorder.told()["runs"]
    assert Path("array-2.log").read_bytes() == b"mine"
    with pytest.raises(InputError, match="exists already"):
        Recorder(lines, Path("array.log"), "array.log")
