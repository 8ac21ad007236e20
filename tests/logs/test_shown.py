"""Lines of a log are shown as they were printed, and under each what the reader made of its numbers."""

import gzip

import numpy as np
import pytest

from tactile.experiments import glove, strain, touch
from tactile.logs import parse, shown
from tactile.logs.formats import Column, Format

DAQ = strain.formats({"sensor": {"channels": 2}})["daq.log"]
ARRAY = touch.array_format({"sensor": {"rows": 4, "cols": 6}, "ingest": {"highest_count": 1023}})
VOLTS = [(0.5, 2.1, 1.9), (1.0, 2.2, 1.8), (1.5, 2.3, -2.75), (2.0, 2.2, 1.8)]


def said(path, content, fmt, laid_out=None):
    """What is shown of a log of these bytes."""
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    rows, rejects = parse.read_log(path, fmt, layout=laid_out)
    lines = list(shown.lines(path, rows, rejects, fmt, laid_out))
    assert all(len(line) <= 120 for line in lines), lines
    return lines


def volts(line, end="\n", head=""):
    return head + end.join(line(*row) for row in VOLTS) + end


READ = [
    "-> t_s 0.5 s; u0 2.1, u1 1.9 V",
    "-> t_s 1.5 s, 1.000 s after line 1; u0 2.3, u1 -2.75 V",
]
PLAIN = volts("{},{},{}".format)


@pytest.mark.parametrize(
    ("content", "laid_out", "first", "largest"),
    [
        (PLAIN, None, "0.5,2.1,1.9", "1.5,2.3,-2.75"),
        (gzip.compress(PLAIN.encode(), mtime=0), {"separator": ","}, "0.5,2.1,1.9", "1.5,2.3,-2.75"),
        (PLAIN.encode("utf-16"), {"separator": ",", "encoding": "utf-16"}, "0.5,2.1,1.9", "1.5,2.3,-2.75"),
        (PLAIN.replace("\n", "\r"), {"separator": ","}, "0.5,2.1,1.9", "1.5,2.3,-2.75"),
        (
            volts("{};{};{}".format).replace(".", ","),
            {"separator": ";", "decimal": ","},
            "0,5;2,1;1,9",
            "1,5;2,3;-2,75",
        ),
        (
            volts(lambda t, u, v: f"{1e3 * t:.0f} ms u={u} v={v}"),
            {"separator": "text", "time_unit": "ms"},
            "500 ms u=2.1 v=1.9",
            "1500 ms u=2.3 v=-2.75",
        ),
    ],
)
def test_lines_of_any_layout(tmp_path, content, laid_out, first, largest):
    lines = said(tmp_path / "daq.log", content, DAQ, laid_out)
    assert lines == [f"    line 1: {first}", f"    {READ[0]}", f"    line 3 (largest): {largest}", f"    {READ[1]}"]


@pytest.mark.parametrize(
    ("laid_out", "value"),
    [
        ({"separator": "text", "scale": 4.4482216152605}, "fz_n 11.7433 N (printed times 4.44822)"),
        (
            {"separator": "text", "scale": 4.4482216152605, "offset": -1},
            "fz_n 10.7433 N (printed times 4.44822 plus -1)",
        ),
    ],
)
def test_the_gain_is_shown(tmp_path, laid_out, value):
    content = "".join(f"{t},Reading: {lbs} lbs\n" for t, lbs in ((0, 0.5), (1_650_000, 2.64), (3_300_000, 0.25)))
    lines = said(tmp_path / "load_cell.log", content, touch.LOAD_CELL, laid_out)
    assert lines[2:4] == [
        "    line 2 (largest): 1650000,Reading: 2.64 lbs",
        f"    -> t_us 1650000 us = 1.650 s, 1.650 s after line 1; {value}",
    ]


def test_counts_that_fall_are_shown_turned(tmp_path):
    fmt = touch.array_format({"sensor": {"rows": 1, "cols": 1}, "ingest": {"highest_count": 1023}})
    lines = said(tmp_path / "array.log", "0,1000\n20000,23\n", fmt, {"separator": ",", "rises_when_pressed": False})
    assert lines[-1].endswith("v0 1000 counts (turned, as it falls when pressed)")


def test_the_largest_of_many_readings_is_never_left_out(tmp_path):
    counts = np.full((9, 24), 100)
    counts[6, 11] = 987
    content = "".join(f"{20_000 * k}," + ",".join(map(str, row)) + "\n" for k, row in enumerate(counts))
    lines = said(tmp_path / "array.log", content, ARRAY)
    assert [line.partition(":")[0] for line in lines[::2]] == ["    line 1", "    line 5", "    line 7 (largest)"]
    assert "; v0 100, v1 100, " in lines[5] and ", v11 987, ..., v22 100, v23 100 counts" in lines[5]


def test_a_long_line_is_shown_with_both_ends(tmp_path):
    fmt = touch.array_format({"sensor": {"rows": 10, "cols": 10}, "ingest": {"highest_count": 1023}})
    content = "".join(f"{20_000 * k}," + ",".join(str(100 + j) for j in range(100)) + "\n" for k in range(2))
    lines = said(tmp_path / "array.log", content, fmt)
    assert lines[0].startswith("    line 1 (largest): 0,100,101,") or lines[0].startswith("    line 1: 0,100,101,")
    assert " ... " in lines[0] and lines[0].endswith(",198,199")


def test_frames_of_several_lines(tmp_path):
    fmt = glove.scanner_format({"sensor": {"areas": {"p": {"rows": 4, "cols": 2}}, "scale": "range"}})
    frames = "".join(f"t {k}\n" + "".join(f"{r} {k}{r}\n" for r in range(4)) for k in (1, 2, 3))
    laid_out = {"separator": " ", "lines_per_frame": 4, "frame_begins": "t (.*)", "time_unit": "s"}
    lines = said(tmp_path / "scanner.log", frames, fmt, laid_out)
    assert lines[:5] == [
        "    lines 1 to 5: t 1",
        "                  0 10",
        "                  ...",
        "                  3 13",
        "    -> t_us 1000000 us = 1.000 s; p0 0, p1 10, p2 1, p3 11, p4 2, p5 12, p6 3, p7 13",
    ]
    assert lines[-5].startswith("    lines 11 to 15 (largest): t 3")


def test_words_are_shown_as_words(tmp_path):
    words = {}
    fmt = Format((DAQ.columns[0], Column("object", "", -1e9, 1e9, words=words)), time="t_s")
    lines = said(tmp_path / "object.log", "0,cup\n1,ball\n", fmt, {"separator": ","})
    assert lines[1] == "    -> t_s 0 s; object cup" and lines[3].endswith("object ball")


def test_one_line_of_each_reason_of_rejects(tmp_path):
    content = "0,1,2\n0.1,1,2\nready\n0.2,1\n0.3,1,99\n0.2\n0.4,1,2\n0.5,1,2\n0.5,1,2\n"
    lines = said(tmp_path / "daq.log", content, DAQ)
    assert lines[-4:] == [
        "    line 3 left out, banner or text: ready",
        "    line 4 left out, column count: 0.2,1",
        "    line 5 left out, out of range: 0.3,1,99",
        "    line 9 left out, duplicate: 0.5,1,2",
    ]


@pytest.mark.parametrize("content", ["a=1 b\n\x1b[0mb\nc\nd\n", "a=1 b\n\x1b[0mb\nc\nd\n".encode("utf-16")])
def test_a_log_that_cannot_be_read_is_shown_as_it_is(tmp_path, content):
    path = tmp_path / "array.log"
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    assert list(shown.first_lines(path)) == [
        "    line 1 not read: a=1 b",
        "    line 2 not read: \\x1b[0mb",
        "    line 3 not read: c",
    ]
