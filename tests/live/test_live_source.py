"""Lines become readings as in ingest, one by one, and a recorded log is replayed at its speed."""

import argparse
import copy
from collections import Counter

import numpy as np
import pytest
from builders.live_models import COLS, ROWS, TOUCH, press, printed
from builders.project import ROOT

from tactile.base import params
from tactile.base.errors import InputError
from tactile.commands import live
from tactile.experiments import touch
from tactile.inference import consistent
from tactile.live import source
from tactile.live.source import Lines, line_format, line_layout, replay


@pytest.fixture
def lines(package) -> Lines:
    card = consistent.read(package("linear"))
    return Lines(line_format(card), "array.log", "touch/linear")


def test_bytes_in_any_pieces_are_the_same_readings(lines):
    data = printed(press(20))
    readings = [reading for k in range(0, len(data), 7) for reading in lines.take(data[k : k + 7])]
    assert [reading.values.tolist() for reading in readings] == press(20).tolist()
    assert [round(reading.t_s, 2) for reading in readings] == [round(1 + 0.02 * k, 2) for k in range(20)]
    assert [reading.restarted for reading in readings] == [True] + 19 * [False]


def test_lines_that_are_no_reading_are_counted_by_reason(lines):
    good = printed(press(3)).splitlines(keepends=True)
    bad = [b"array ready\n", b"1060000,1,2\n", b"1070000,1,2,3,4,5,x\n", b"1080000,1,2,3,4,5,9999\n", good[2]]
    readings = lines.take(b"".join([*good, *bad]))
    assert len(readings) == 3 and lines.count == 8
    assert lines.rejects == Counter(
        {"banner or text": 1, "column count": 1, "not a number": 1, "out of range": 1, "duplicate": 1}
    )
    assert lines.rejected.startswith("1040000,")


def test_a_reset_is_seen_after_lines_in_order(lines):
    lines.take(printed(press(10), begin_us=9_000_000))
    readings = lines.take(printed(press(10)))
    assert [reading.restarted for reading in readings] == [True] + 7 * [False]
    assert lines.rejects == {"out of order": 2}


def test_the_line_that_a_vanishing_device_began_is_lost(lines):
    first, second = printed(press(2)).splitlines(keepends=True)
    assert len(lines.take(first + second[:9])) == 1
    assert lines.take(None) == []
    assert len(lines.take(second)) == 1 and sum(lines.rejects.values()) == 1


def test_another_array_is_named(lines):
    narrow = b"".join(b"%d,1,2\n" % (1_000_000 + 20_000 * k) for k in range(25))
    with pytest.raises(InputError, match=rf"lines have 3 columns, but touch/linear takes {ROWS * COLS + 1} \(t_us,v0"):
        lines.take(narrow)


def test_noise_is_not_said_to_be_another_sensor(lines):
    """Of random bytes one line in 1,000 is a single digit, or another number of columns."""
    rng = np.random.default_rng(0)
    for _ in range(2000):
        assert lines.take(rng.bytes(4096)) == []
    assert lines._columns[1] > 20 and lines.count > 20_000
    with pytest.raises(InputError, match="lines have 3 columns"):
        lines.take(b"\n" + b"1000,1,2\n" * (2 * lines.count))


def test_a_log_is_replayed_at_its_speed(tmp_path, lines, monkeypatch):
    log, now = tmp_path / "array.log", [7.0]
    log.write_bytes(printed(press(26)))
    monkeypatch.setattr(source.time, "monotonic", lambda: now[0])
    monkeypatch.setattr(source.time, "sleep", lambda wait_s: now.append(now.pop() + wait_s))
    due_s = []
    for line in replay(log, lines.format, False, speed=2):
        assert line == log.read_bytes().splitlines(keepends=True)[len(due_s)]
        due_s.append(now[0] - 7)
    np.testing.assert_allclose(due_s, np.arange(26) * 0.02 / 2, atol=1e-9)
    with pytest.raises(InputError, match="log not found"):
        next(replay(tmp_path / "other.log", lines.format, False))


def test_a_header_says_in_which_order_the_columns_come(lines, tmp_path):
    order = [5, 1, 6, 3, 4, 2, 0]
    names = lines.format.names
    header = ",".join(names[k] for k in order).encode() + b"\n"
    rows = [line.split(b",") for line in printed(press(20)).splitlines()]
    data = b"boot\n" + header + b"".join(b",".join(row[k] for k in order) + b"\n" for row in rows)
    assert [reading.values.tolist() for reading in lines.take(data)] == press(20).tolist()
    assert lines.rejects == Counter({"banner or text": 2})
    (tmp_path / "array.log").write_bytes(data)
    assert b"".join(replay(tmp_path / "array.log", lines.format, False, speed=100)) == data
    late = header.replace(b"v5", b"vv") + b",".join(names[k].encode() for k in range(7)) + b"\n"
    readings = lines.take(late + printed(press(21), begin_us=9_000_000))
    assert readings[-1].values.tolist() == press(21)[-1].tolist(), "a torn header changes nothing, a whole one does"


def test_a_header_of_other_names_is_refused(lines):
    with pytest.raises(
        InputError, match="array.log: line 2 names the column force; known are t_us, v0, ..., v5; rename"
    ):
        lines.take(b"boot\n" + lines.format.header.replace("v3", "force").encode() + b"\n" + printed(press(2)))


def test_a_replay_of_what_is_no_log_fails(package, workspace, tmp_path, capsys):
    given = {"model": str(package("linear")), "port": None, "record": None, "speed": 1e6, "loop": False, "page": False}
    given |= {"csv": True, "udp": None, "http_port": 0, "baud": 115200, "settings": None}
    (tmp_path / "README.md").write_text("# A sensor\nwith 12 cells, and words\n")
    for name, words in (
        ("README.md", "README.md: no line is a reading of touch/linear"),
        ("none.log", "log not found"),
    ):
        with pytest.raises(InputError, match=words):
            live.main(workspace, argparse.Namespace(**given, replay=tmp_path / name))
    assert "http://" not in capsys.readouterr().err


def test_the_recorded_taxel_prints_its_reading_before_its_time():
    card = argparse.Namespace(
        experiment="velostat_recorded", model="linear", reading=params.load(ROOT / "params.yaml")["velostat_recorded"]
    )
    taxel = Lines(line_format(card), "a port", "velostat_recorded/linear", laid_out=line_layout(card))
    found = taxel.take(b"744.4561767578125 1637846037.742000\n744.5 1637846037.748926\n")
    assert [one.t_s for one in found] == [1637846037.742, 1637846037.748926] and not taxel.rejects
    assert [one.values.tolist() for one in found] == [[744.4561767578125], [744.5]]


def wide(n: int, laid_out: dict | None = None) -> Lines:
    """Lines of an array of n x n elements."""
    reading = copy.deepcopy(TOUCH)
    reading["sensor"] |= {"rows": n, "cols": n}
    return Lines(touch.array_format(reading), "array.log", "touch/linear", laid_out=laid_out)


@pytest.mark.parametrize("n", [5, 64, 128, 200])
@pytest.mark.parametrize("laid_out", [None, {"separator": ";", "time": 1}])
def test_a_line_may_be_as_long_as_its_columns_need(n, laid_out):
    """A line of 128 x 128 elements has 100 kB, in pieces of 4 kB; noise between lines is still given up."""
    lines, rng = wide(n, laid_out), np.random.default_rng(0)
    readings = rng.integers(0, 1024, (3, n * n))
    data = printed(readings).replace(b",", b";" if laid_out else b",")
    found = [reading for k in range(0, len(data), 4096) for reading in lines.take(data[k : k + 4096])]
    assert [reading.values.tolist() for reading in found] == readings.tolist()
    assert not lines.rejects
    noise = b"5" * 4096
    for _ in range(2 * lines.longest // len(noise) + 2):
        assert lines.take(noise) == []
        assert len(lines._rest) + len(lines._reader._rest if laid_out else "") <= lines.longest
    assert sum(lines.rejects.values()) >= 2
    (reading,) = lines.take(b"\n" + printed(readings[:1], begin_us=9_000_000).replace(b",", b";" if laid_out else b","))
    assert reading.values.tolist() == readings[0].tolist()
