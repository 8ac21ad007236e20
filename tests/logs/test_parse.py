"""Raw logs: every line becomes a row or a reject with the right number and reason."""

import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from builders.log_formats import COUNTS, SPACED
from builders.project import ROOT
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tactile.base.errors import InputError
from tactile.live.source import Lines
from tactile.logs import parse
from tactile.logs.formats import Column, Format
from tactile.logs.parse import read_log


def write(tmp_path: Path, content: bytes) -> Path:
    path = tmp_path / "device.log"
    path.write_bytes(content)
    return path


def line_count(content: bytes) -> int:
    return content.count(b"\n") + bool(content and not content.endswith(b"\n"))


def rejects_of(content: bytes, tmp_path: Path, fmt: Format = COUNTS) -> list[tuple[int, str]]:
    rows, rejects = read_log(write(tmp_path, content), fmt)
    assert rows.num_rows + rejects.num_rows == line_count(content)
    both = rows["line"].to_pylist() + rejects["line"].to_pylist()
    assert sorted(both) == list(range(1, len(both) + 1))
    assert set(rejects["reason"].to_pylist()) <= set(parse.REASONS)
    return list(zip(rejects["line"].to_pylist(), rejects["reason"].to_pylist(), strict=True))


def frame(k: int) -> bytes:
    return f"{20_000 * k},{k % 1000},{(7 * k) % 1000}\n".encode()


FAULTS = {
    "empty": (b"\n", parse.EMPTY),
    "blank": (b"  \t\r\n", parse.EMPTY),
    "banner": (b"tactile array 5x5 ready\n", parse.TEXT),
    "banner with commas": (b"array, ready, go\n", parse.TEXT),
    "torn": (b"20070,12\n", parse.COLUMNS),
    "glued": (b"20070,12,1320090,13,14\n", parse.COLUMNS),
    "empty field": (b"20070,,13\n", parse.NOT_A_NUMBER),
    "empty last field": (b"20070,12,\n", parse.NOT_A_NUMBER),
    "letter": (b"20070,1x2,13\n", parse.NOT_A_NUMBER),
    "hexadecimal": (b"20070,0x12,13\n", parse.NOT_A_NUMBER),
    "nan": (b"20070,nan,13\n", parse.NOT_A_NUMBER),
    "infinite": (b"20070,-inf,13\n", parse.NOT_A_NUMBER),
    "fraction": (b"20070,12.5,13\n", parse.NOT_AN_INTEGER),
    "too high": (b"20070,1024,13\n", parse.OUT_OF_RANGE),
    "far too high": (b"20070,99999999999999999999999,13\n", parse.OUT_OF_RANGE),
    "negative": (b"20070,-1,13\n", parse.OUT_OF_RANGE),
    "NUL": (b"20070,1\x002,13\n", parse.UNREADABLE),
    "not UTF-8": (b"20070,1\xff,13\n", parse.UNREADABLE),
    "carriage return inside": (b"20070,12\r,13\n", parse.UNREADABLE),
    "quoted": (b'20070,"12",13\n', parse.NOT_A_NUMBER),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_a_bad_line_is_rejected_alone_with_its_reason(fault, tmp_path):
    line, reason = FAULTS[fault]
    content = b"".join(map(frame, range(10))) + line + b"".join(map(frame, range(11, 20)))
    assert rejects_of(content, tmp_path) == [(11, reason)]


def test_rows_are_typed_and_keep_their_values(tmp_path):
    rows, rejects = read_log(write(tmp_path, b"t_us,v0,v1\r\n0,1,2\r\n20000, 3 ,1023"), COUNTS)
    assert rejects.num_rows == 0
    assert rows.to_pydict() == {
        "t_us": [0, 20000], "v0": [1, 3], "v1": [2, 1023], "line": [2, 3], "segment": [0, 0],
    }  # fmt: skip
    assert [str(kind) for kind in rows.schema.types] == ["int64", "int16", "int16", "int32", "int16"]


def test_floats_and_spaces(tmp_path):
    content = b"803.5 1637849124.385191\n1e2 1637849124.4\n  1637849125.0\n5 1637849126 \nnan 1637849127.0\n"
    assert rejects_of(content, tmp_path, SPACED) == [(3, parse.COLUMNS), (4, parse.COLUMNS), (5, parse.NOT_A_NUMBER)]
    rows, _ = read_log(tmp_path / "device.log", SPACED)
    assert rows["reading"].to_pylist() == [803.5, 100.0]
    assert rows["unix_s"].to_pylist() == [1637849124.385191, 1637849124.4]


def test_text_of_a_reject_is_short_and_printable(tmp_path):
    rows, rejects = read_log(write(tmp_path, frame(0) + b"\x00\xff" * 300 + b"\n" + frame(1)), COUNTS)
    text = rejects["text"][0].as_py()
    assert text.startswith("\\x00\\xff") and len(text) == 200
    assert rejects["file"].to_pylist() == ["device.log"]


def test_duplicate_and_late_lines(tmp_path):
    order = [0, 1, 1, 2, 4, 3, 5, 6]
    found = rejects_of(b"".join(map(frame, order)), tmp_path)
    assert found == [(3, parse.DUPLICATE), (6, parse.OUT_OF_ORDER)]


def test_a_block_sent_twice_is_a_duplicate(tmp_path):
    order = [*range(10), *range(5, 10), *range(10, 30)]
    found = rejects_of(b"".join(map(frame, order)), tmp_path)
    assert found == [(line, parse.DUPLICATE) for line in range(11, 16)]


def test_a_time_far_in_the_future_costs_one_line(tmp_path):
    content = b"".join(map(frame, range(10))) + b"900000000,1,1\n" + b"".join(map(frame, range(10, 200)))
    assert rejects_of(content, tmp_path) == [(11, parse.OUT_OF_ORDER)]


@pytest.mark.parametrize(
    ("times", "remedy"),
    [
        ([*range(0, 300_000, 1000)], "divide the log"),
        ([*range(100), *range(150_000, 150_100)], "the clock jumps by 149901 s in line 101; remove that line if it is"),
        ([*range(0, 90_000, 1000), *range(190_000, 300_000, 1000)], "divide the log"),  # too long without the jump
    ],
)
def test_a_log_that_lasts_too_long_names_a_jump_only_where_that_is_why(times, remedy, tmp_path):
    content = b"".join(b"%d,1,2\n" % (1_000_000 * t) for t in times)
    with pytest.raises(InputError, match=rf"device.log: lasts \d+ s, more than the 100000 s of a log; {remedy}"):
        read_log(
            write(tmp_path, content), Format((Column("t_us", "us", 0, 1e15, integer=True), *COUNTS.columns[1:]), "t_us")
        )


def test_same_time_with_other_values_has_its_own_reason(tmp_path):
    assert rejects_of(frame(0) + frame(1) + b"20000,9,9\n" + frame(2), tmp_path) == [(3, parse.REPEATED)]


def test_a_clock_that_stands_still(tmp_path):
    content = b"".join(map(frame, range(10))) + frame(9) * 200_000 + b"".join(map(frame, range(10, 20)))
    rows, rejects = read_log(write(tmp_path, content), COUNTS)
    assert rows["t_us"].to_pylist() == [20_000 * k for k in range(20)]
    assert rejects["reason"].unique().to_pylist() == [parse.DUPLICATE]


@pytest.mark.parametrize("banner", [b"", b"array ready\n"])
def test_a_reset_starts_a_segment(banner, tmp_path):
    content = b"".join(map(frame, range(500, 900))) + banner + b"".join(map(frame, range(3, 303)))
    content += banner + b"".join(map(frame, range(300)))
    rows, rejects = read_log(write(tmp_path, content), COUNTS)
    assert np.bincount(rows["segment"].to_numpy()).tolist() == [400, 300, 300]
    assert rejects.num_rows == 2 * bool(banner)
    for segment in range(3):
        time = rows["t_us"].to_numpy()[rows["segment"].to_numpy() == segment]
        assert (np.diff(time) > 0).all()


def test_an_early_reset_is_seen_by_its_banner(tmp_path):
    content = b"".join(map(frame, range(5, 15))) + b"ready\n" + b"".join(map(frame, range(200)))
    rows, _ = read_log(write(tmp_path, content), COUNTS)
    assert np.bincount(rows["segment"].to_numpy()).tolist() == [10, 200]


def test_byte_order_mark_and_header_after_a_banner(tmp_path):
    rows, rejects = read_log(write(tmp_path, b"\xef\xbb\xbf" + frame(0) + b"t_us,v0,v1\n" + frame(1)), COUNTS)
    assert rows["line"].to_pylist() == [1, 3]
    assert rejects["reason"].to_pylist() == [parse.TEXT]


@pytest.mark.parametrize(
    ("content", "found"),
    [
        (b"", "the file is empty"),
        (b"t_us,v0,v1\n", "a header but no line of numbers"),
        (b"1,2\n3,4\n", "line 1 has 2 columns: '1,2', expected lines of 3 columns, t_us,v0,v1"),
        (bytes(range(256)) * 20, "line 1 has unreadable bytes"),
        (b"\n\n", "line 1 has empty line"),
    ],
)
def test_a_hopeless_file_is_one_sentence(content, found, tmp_path):
    with pytest.raises(InputError, match="device.log: ") as error:
        read_log(write(tmp_path, content), COUNTS)
    assert found in str(error.value)


def test_a_missing_file(tmp_path):
    with pytest.raises(InputError, match="none.log: log not found"):
        read_log(tmp_path / "none.log", COUNTS)


def test_reading_a_hopeless_file_stops_early(tmp_path, monkeypatch):
    monkeypatch.setattr(parse, "PIECE", 1000)
    monkeypatch.setattr(parse, "HOPELESS", 100)
    parsed, piece = [], parse._parse_piece
    monkeypatch.setattr(parse, "_parse_piece", lambda *a: parsed.append(1) or piece(*a))
    with pytest.raises(InputError, match="no line can be read"):
        read_log(write(tmp_path, b"1,2\n" * 100_000), COUNTS)
    assert len(parsed) < 50


def test_a_file_without_line_ends(tmp_path, monkeypatch):
    monkeypatch.setattr(parse, "PIECE", 1000)
    monkeypatch.setattr(parse, "LONGEST_LINE", 10_000)
    with pytest.raises(InputError, match="no line end"):
        read_log(write(tmp_path, b"\x00" * 50_000), COUNTS)


def test_exact_copies_do_not_count_as_lost_lines():
    parse.check_rejects(Path("a.log"), 200, {"column count": 2, parse.DUPLICATE: 100}, 0.02, "x.limit")
    with pytest.raises(InputError, match="3.0% of the 100 lines"):
        parse.check_rejects(Path("a.log"), 200, {"column count": 3, parse.DUPLICATE: 100}, 0.02, "x.limit")


def test_check_rejects_names_everything():
    parse.check_rejects(Path("a.log"), 100, {"column count": 2}, 0.02, "x.limit")
    with pytest.raises(InputError) as error:
        parse.check_rejects(Path("a.log"), 100, {"column count": 2, "out of order": 1}, 0.02, "x.limit")
    for word in ("a.log", "3.0%", "column count", "2.0%", "x.limit"):
        assert word in str(error.value)


FIELD = st.sampled_from([b"1", b"20", b"-3", b" 7 ", b"1023", b"5000", b"1e3", b"nan", b"0x1", b"+2", b"", b"\x00"])
LINE = st.one_of(
    st.lists(FIELD, min_size=1, max_size=4).map(b",".join),
    st.integers(0, 300).map(lambda k: frame(k)[:-1]),
    st.integers(0, 300).map(lambda k: frame(k)[: k % 9]),
    st.binary(max_size=12),
)


def test_all_rejects_have_number_and_reason_and_the_first_their_text(tmp_path, monkeypatch):
    faults = [line for line, _ in FAULTS.values()]
    content = b"".join(frame(3 * k) + faults[k % len(faults)] + frame(3 * k + 2) * 2 for k in range(200))
    path = write(tmp_path, content)
    accepted, whole = read_log(path, COUNTS)
    monkeypatch.setattr(parse, "TEXTS", 7)
    for piece in (parse.PIECE, 300, 100):
        monkeypatch.setattr(parse, "PIECE", piece)
        rows, rejects = read_log(path, COUNTS)
        assert rows.to_pydict() == accepted.to_pydict()
        assert rejects.drop_columns("text").equals(whole.drop_columns("text"))
        for reason in whole["reason"].unique().to_pylist():
            full, cut = (
                [row["text"] for row in table.to_pylist() if row["reason"] == reason] for table in (whole, rejects)
            )
            assert None not in full and cut == full[:7] + [None] * len(full[7:])


def test_rows_rejected_by_an_experiment_have_the_first_texts_too(tmp_path, monkeypatch):
    monkeypatch.setattr(parse, "TEXTS", 2)
    path = write(tmp_path, b"a\nb\nc\nd\n")
    none = parse.add_rejects(parse.REJECTS.empty_table(), path, np.zeros(0, np.int32), "of no use")
    found = parse.add_rejects(none, path, np.array([1, 3, 4], np.int32), "of no use", "x/device.log")
    assert found.schema.equals(parse.REJECTS) and none.num_rows == 0
    assert found.to_pylist() == [
        {"file": "x/device.log", "line": line, "reason": "of no use", "text": text}
        for line, text in ((1, "a"), (3, "c"), (4, None))
    ]


def test_a_log_that_will_be_refused_is_not_read_to_its_end(tmp_path, monkeypatch):
    monkeypatch.setattr(parse, "PIECE", 1000)
    parsed, piece = [], parse._parse_piece
    monkeypatch.setattr(parse, "_parse_piece", lambda *a: parsed.append(1) or piece(*a))
    path = write(tmp_path, b"".join(map(frame, range(20))) + b"torn\n" * 20_000)
    words = (
        r"device\.log: 9\d\.\d% of the first \d+ lines cannot be used, most often 'banner or text' .* raise x\.limit"
    )
    with pytest.raises(InputError, match=words):
        read_log(path, COUNTS, limit=0.02, key="x.limit")
    assert len(parsed) < 30
    path.write_bytes(b"torn\n" * 300 + b"".join(map(frame, range(20_000))))  # a bad start is made up for
    assert read_log(path, COUNTS, limit=0.02, key="x.limit")[0].num_rows == 20_000


@pytest.mark.slow
@settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    start=st.lists(st.one_of(st.integers(0, 40).map(frame), LINE.map(lambda line: line + b"\n")), max_size=60),
    good=st.integers(0, 300),
    limit=st.sampled_from([0.0, 0.02, 0.3, 0.9, 1.0]),
)
def test_a_log_is_refused_early_if_and_only_if_it_would_be_at_its_end(start, good, limit, tmp_path):
    content = frame(41) + b"".join(start) + b"".join(map(frame, range(50, 50 + good)))
    path = write(tmp_path, content)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(parse, "MOST_RESETS", 3)
        try:
            rows, rejects = read_log(path, COUNTS)
            lost = rejects.num_rows - rejects["reason"].to_pylist().count(parse.DUPLICATE)
            refused = lost > limit * (rows.num_rows + lost)
        except InputError:
            refused = True
        for piece, hopeless in ((parse.PIECE, 0), (50, 10**6)):
            patch.setattr(parse, "PIECE", piece)
            patch.setattr(parse, "HOPELESS", hopeless)
            try:
                again = read_log(path, COUNTS, limit=limit, key="x.limit")
            except InputError as error:
                assert refused, error
            else:
                assert not refused and again[0].equals(rows) and again[1].equals(rejects)


LINES = 1_000_000
FLOODS = {"the same line": (b"20000,1,2\n", 1), "every other line torn": (None, 2)}  # behind a good one


def flood(path: Path, name: str | None) -> Path:
    """A log of LINES lines; None: a clean one."""
    if name is None or FLOODS[name][0] is None:
        torn = b"" if name is None else b"xx7yz\n"
        count = LINES if name is None else LINES // 2
        path.write_bytes(b"".join(b"%d,%d,5\n%s" % (1000 * k, k % 1000, torn) for k in range(count)))
    else:
        line, count = FLOODS[name]
        path.write_bytes(frame(0) + line * (LINES // count))
    return path


def peak_and_time(path: Path, limit: float) -> tuple[float, float]:
    """MB above the imports and s of processor time that reading takes in a process of its own."""
    source = f"""
import time
from benchmarks.measure import _memory_mb
from pathlib import Path
from tactile.logs import parse
from tactile.base.errors import InputError
from builders.log_formats import COUNTS
memory, started = _memory_mb("VmRSS"), time.process_time()
try:
    parse.read_log(Path({str(path)!r}), COUNTS, limit={limit}, key="x.limit")
except InputError:
    pass
print(_memory_mb("VmHWM") - memory, time.process_time() - started)
"""
    environment = os.environ | {"PYTHONPATH": f"{ROOT}{os.pathsep}{ROOT / 'tests'}"}
    done = subprocess.run([sys.executable, "-c", source], env=environment, check=True, capture_output=True, text=True)
    return tuple(map(float, done.stdout.split()))


@pytest.fixture(scope="module")
def clean(tmp_path_factory):
    """MB and s of a clean log of LINES lines."""
    if not Path("/proc/self/status").is_file():
        pytest.skip("the largest memory of a process is read from /proc")
    return peak_and_time(flood(tmp_path_factory.mktemp("clean") / "device.log", None), 0.02)


@pytest.mark.slow
@pytest.mark.parametrize(("name", "limit"), [("the same line", 0.02), ("every other line torn", 1.0)])
def test_a_flood_of_rejects_costs_about_what_a_clean_log_does(name, limit, clean, tmp_path):
    """It cost up to five times the memory and fifty times the time. No more than 2 times on an idle machine."""
    mb, seconds = peak_and_time(flood(tmp_path / "device.log", name), limit)
    assert mb < 2 * clean[0] and seconds < 4 * clean[1]


@pytest.mark.slow
@settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(lines=st.lists(LINE.filter(lambda line: b"\n" not in line), max_size=12))
def test_a_line_is_judged_by_itself(lines, tmp_path):
    """What the fast routes accept is what the line-by-line rule accepts, whatever stands around the line."""
    content = b"".join(line + b"\n" for line in [b"0,1,2", *lines])
    _, rejects = read_log(write(tmp_path, content), COUNTS)
    sequence = {parse.DUPLICATE, parse.OUT_OF_ORDER, parse.REPEATED}
    judged = zip(rejects["line"].to_pylist(), rejects["reason"].to_pylist(), strict=True)
    found = {line: reason for line, reason in judged if reason not in sequence}
    alone = {k: parse._reason(line, COUNTS) for k, line in enumerate([b"0,1,2", *lines], start=1)}
    assert found == {k: reason for k, reason in alone.items() if reason}


@pytest.mark.parametrize("end", [b"", b"\n"])
def test_texts_are_those_of_the_lines(end, tmp_path, monkeypatch):
    monkeypatch.setattr(parse, "PIECE", 50)  # a few lines a piece
    lines = [b"%d,%s" % (k, b"x" * (k % 70)) for k in range(1, 200)]
    path = write(tmp_path, b"\n".join(lines) + end)
    for numbers in ([1], [199], [1, 2, 3, 70, 198, 199], list(range(1, 200)), []):
        assert parse.texts(path, numbers) == [lines[k - 1].decode() for k in numbers]


PLACES = Format((COUNTS.columns[0], *(Column(f"{axis}_mm", "mm", -10, 2000) for axis in "xyz")), "t_us")


def permuted(header: bytes) -> bytes:
    """Lines of PLACES, printed in the order in which `header` names the columns."""
    values = [{"t_us": 20_000 * k, "x_mm": k % 7, "y_mm": k % 11, "z_mm": -(k % 3)} for k in range(300)]
    names = header.decode().split(",")
    lines = [",".join(str(row[name]) for name in names).encode() for row in values]
    lines[50:53] = [lines[50][:5], lines[50], lines[50]]  # torn, then twice the same
    return b"\n".join([header, *lines, b"restart", header, *lines[:100]]) + b"\n"


@pytest.mark.parametrize("header", [b"t_us,z_mm,x_mm,y_mm", b"y_mm,z_mm,t_us,x_mm"])
def test_columns_are_read_by_their_names(header, tmp_path):
    rows, rejects = read_log(write(tmp_path, permuted(b"t_us,x_mm,y_mm,z_mm")), PLACES)
    other, others = read_log(write(tmp_path, permuted(header)), PLACES)
    assert other.equals(rows) and other["z_mm"].to_numpy().min() == -2 and rows["segment"][-1].as_py() == 1
    assert others.drop(["text"]).equals(rejects.drop(["text"])) and rejects.num_rows == 6


NEWLINE = b"\n"
HEADERS = {  # the order of the columns that a first line of PLACES tells; None: it is a banner; or what is said
    b"T_us; Z (mm),X [mm],Y (mm)": None,  # three fields
    b"T_us, Z (mm),X [mm],Y (mm)": "t_us z_mm x_mm y_mm",
    b'"t_us","z_mm","x_mm","y_mm"': "t_us z_mm x_mm y_mm",
    b"# t_us,z_mm,x_mm,y_mm": "t_us z_mm x_mm y_mm",
    b"Time,Ch1,Ch2,Ch3": "t_us x_mm y_mm z_mm",
    b"Time,Ch3,Ch2,Ch1": "line 1 names the columns Time, Ch3, Ch2, Ch1; known are t_us, x_mm, y_mm, z_mm; rename",
    b"Time,X,Y,Z": "line 1 names the columns Time, X, Y, Z; known are",
    b"t_us,x_mm,y_mm,depth": "line 1 names the column depth; known are .* or remove the header line if the columns are",
    b"t_us,x_mm,x_mm,z_mm": "line 1 names x_mm twice and not y_mm; rename",
    b"t_us,z_mm,y_mm": "line 1 names 3 columns without x_mm; rename",
    b"us,x_mm,y_mm,z_mm": None,  # the capture began within it
    b"t_us,x_mm,y_": None,  # torn
    b"# mat, v2, boot, ok": None,
    b"ready to go now, x_mm, y_mm, z_mm": None,  # a sentence
    b"=~=~ PuTTY log 2024.01.12 =~=~": None,
    b"(us),(mm),(mm),(mm)": None,
}


@pytest.mark.parametrize("line", HEADERS, ids=bytes.decode)
@pytest.mark.parametrize("above", [b"", b"\xef\xbb\xbf", b"boot\n12,3\n# rate: 50\n"], ids=["first", "mark", "banners"])
def test_what_a_header_is(line, above, tmp_path):
    expected = HEADERS[line]
    path = write(tmp_path, above + line + b"\n" + b"20000,1,2,-1\n40000,1,2,-1\n")
    if expected and " names " in expected:
        expected = expected.replace("line 1", f"line {1 + above.count(NEWLINE)}")
        with pytest.raises(InputError, match=f"device.log: {expected}"):
            read_log(path, PLACES)
    else:
        assert " ".join(parse.printed_format(path, PLACES).names) == (expected or "t_us x_mm y_mm z_mm")


def test_two_words_of_a_banner_are_no_header(tmp_path):
    cell = Format((COUNTS.columns[0], Column("fz_n", "N", -10, 10)), "t_us")
    assert read_log(write(tmp_path, b"HX711, ready\n1,2\n"), cell)[1]["reason"].to_pylist() == [parse.TEXT]
    assert read_log(write(tmp_path, b"Time,Force\n1,2\n"), cell)[1].num_rows == 0
    assert read_log(write(tmp_path, b"fz_n,t_us\n2,1\n"), cell)[0]["fz_n"].to_pylist() == [2.0]


def test_a_header_of_another_order_further_on_is_refused(tmp_path):
    content = frame(1) + b"t_us,v0,v1\n" + frame(2) + b"t_us,v1,v0\n" + frame(3)
    with pytest.raises(InputError, match=r"device\.log: line 4 names the columns in another order than those above"):
        read_log(write(tmp_path, content), COUNTS)


@pytest.mark.parametrize("line", [b"t_us,fz_mn", b"t_us,Fz (kN)"])
def test_a_header_of_another_unit_or_name_further_on_is_refused(line, tmp_path):
    cell = Format((COUNTS.columns[0], Column("fz_n", "N", -10, 10)), "t_us")
    rows = [b"%d,1\n" % (20_000 * k) for k in range(60)]
    content = b"t_us,fz_n\n" + b"".join(rows[:30]) + line + b"\n" + b"".join(rows[30:])
    with pytest.raises(InputError, match=rf"line 32 names the columns {re.escape(line.decode())}, which are others"):
        read_log(write(tmp_path, content), cell)
    assert read_log(write(tmp_path, content.replace(line, b"t_us, Fz (N)")), cell)[1]["line"].to_pylist() == [32]
    assert read_log(write(tmp_path, content.replace(line, b"HX711, ready")), cell)[1]["line"].to_pylist() == [32]


@pytest.mark.parametrize("begin", [2**32 - 100_000, 2**31 - 100_000], ids=["unsigned", "signed"])
def test_micros_that_begin_anew_go_on(begin, tmp_path):
    """A clock that was reset starts elsewhere, and is a new segment."""
    signed = begin < 2**31
    times = [(begin + 20_000 * k + 2**31 * signed) % 2**32 - 2**31 * signed for k in range(40)]
    fmt = Format((Column("t_us", "us", -(2.0**31), 4e15, True), COUNTS.columns[1]), "t_us")
    rows, rejects = read_log(write(tmp_path, b"".join(b"%d,%d\n" % (t, k) for k, t in enumerate(times))), fmt)
    assert rows["t_us"].to_pylist() == [begin + 20_000 * k for k in range(40)] and rejects.num_rows == 0
    assert set(rows["segment"].to_pylist()) == {0}
    live = Lines(fmt, "port", "a model")
    readings = live.take(b"".join(b"%d,%d\n" % (t, k) for k, t in enumerate(times)))
    assert [reading.t_s for reading in readings] == pytest.approx([begin / 1e6 + 0.02 * k for k in range(40)])
    restarted = [3_000_000_000 + 20_000 * k for k in range(200)] + [500_000 + 20_000 * k for k in range(200)]
    rows, _ = read_log(write(tmp_path, b"".join(b"%d,1\n" % t for t in restarted)), fmt)
    assert rows["t_us"].to_pylist() == restarted and set(rows["segment"].to_pylist()) == {0, 1}


def test_names_that_look_alike_are_refused():
    composed, marked = "caf\u00e9", "cafe\u0301"
    parse.check_names([Path("logs", composed, "a"), Path("logs", composed, "b"), Path("logs", "double", composed)])
    for other in (Path("logs", marked, "b"), Path("logs", composed, marked)):
        with pytest.raises(InputError, match=r"the folder name 'cafe\\u0301' looks like another, in other Unicode"):
            parse.check_names([Path("logs", composed, "a"), Path("logs", composed, composed), other])
