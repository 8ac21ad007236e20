"""Logs of every kind of layout are read with the block that `sniff` proposes, or refused with a true sentence."""

import gzip
import json
import re

import numpy as np
import pytest
from builders.touched_sensors import touched
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from tactile.base.errors import InputError
from tactile.experiments import strain, touch
from tactile.live.source import Lines, replay
from tactile.logs import layout, parse, sniff
from tactile.logs.formats import Column, Format
from tactile.own import logs as own_logs

ROWS = 90
DAQ = strain.formats({"sensor": {"channels": 3}})["daq.log"]
ROBOT = strain.formats({"sensor": {"channels": 3, "tasks": {"a": ["x"]}}})["robot.log"]
ARRAY = touch.array_format({"sensor": {"rows": 4, "cols": 4}, "ingest": {"highest_count": 1023}})
T = 5 + 0.05 * np.arange(ROWS)
VOLTS = np.round(2 + 0.3 * np.sin(np.arange(ROWS * 3).reshape(ROWS, 3)), 5)
COUNTS = np.random.default_rng(0).integers(0, 1024, (ROWS, 16))
PLACES = np.round(20 + 15 * np.sin(np.arange(ROWS) / 7), 3)


def csv(values, separator=","):
    return separator.join(map(str, values))


def volts(line):
    """A log of the DAQ from the time and the volts of each line."""
    return "".join(line(t, v) + "\n" for t, v in zip(T, VOLTS, strict=True))


def counts(line):
    """A log of the array from the microseconds and the counts of each frame."""
    return "".join(line(round(t * 1e6), v) + "\n" for t, v in zip(T, COUNTS, strict=True))


def clock(t):
    return f"12:01:{t:06.3f}"


def places(line):
    """A log of the robot from the time, x and the number of each line."""
    return "".join(line(t, x, k) + "\n" for k, (t, x) in enumerate(zip(T, PLACES, strict=True)))


LVM = "LabVIEW Measurement\nSeparator\tTab\nX_Dimension\tTime\tTime\tTime\nDelta_X\t0.05\t0.05\t0.05\n***End***\n"
NANOSECONDS = 1_700_000_000_000_000_000
READ = {  # kind: format, file, layout that is proposed
    "tabs, LabVIEW": (DAQ, LVM + volts(lambda t, v: f"{t:.6f}\t{csv(v, chr(9))}"), {"separator": "\t"}),
    "decimal commas": (
        DAQ,
        volts(lambda t, v: f"{t:.4f};{csv(v, ';')}".replace(".", ",")),
        {"separator": ";", "decimal": ","},
    ),
    "no time, LabVIEW": (DAQ, LVM + volts(lambda t, v: f"\t{csv(v, chr(9))}"), {"separator": "\t", "rate_hz": 20.0}),
    "quoted, thousands": (DAQ, volts(lambda t, v: f'"{1000 + t:,.4f}",{csv(v)}'), {"separator": ","}),
    "bytes of Python": (DAQ, volts(lambda t, v: f"b'{t:.4f},{csv(v)}\\r\\n'"), {"separator": "text"}),
    "units behind": (DAQ, volts(lambda t, v: f"{t:.3f} s {csv(v, ' V ')} V"), {"separator": "text"}),
    "nanoseconds": (
        DAQ,
        volts(lambda t, v: f"{NANOSECONDS + round(t * 1e9)},{csv(v)}"),
        {"separator": ",", "time_unit": "ns"},
    ),
    "time repeats": (
        DAQ,
        volts(lambda t, v: f"{t:.1f},{csv(v)}"),
        {"separator": ",", "repeats": "spread"},
    ),
    "values of other times": (
        DAQ,
        volts(lambda t, v: f"{t:.3f},{csv(np.where(np.arange(3) == round(t * 20 - 100) % 3, v, np.nan))}"),
        {"separator": ",", "missing": "previous"},
    ),
    "robot, metres by name": (
        ROBOT,
        "timestamp pose_0 pose_1 pose_2\n" + places(lambda t, x, k: f"{t:.3f} {x / 1000:.6f} 0.1 0.2"),
        {"separator": " ", "time": "timestamp", "columns": ["pose_0"], "scale": 1000},
    ),
    "rostopic": (
        ROBOT,
        "%time,field.seq,field.frame_id,field.position.x\n"
        + places(lambda t, x, k: f"{NANOSECONDS + round(t * 1e9)},{k},base,{x}"),
        {"separator": ",", "time": "%time", "time_unit": "ns", "columns": ["field.position.x"]},
    ),
    "title block, quotes": (
        ROBOT,
        "Specimen,1\nRate,20.0,mm/min\n\nTime,Extension\n(s),(mm)\n"
        + places(lambda t, x, k: f'"{t:.3f}","{x}"'),
        {"separator": ","},
    ),
    "time of day": (
        ARRAY,
        counts(lambda t, v: f"{clock(t / 1e6)} -> {csv(v)}"),
        {"separator": "text", "time_pattern": "%H:%M:%S.%f"},
    ),
    "date in brackets": (
        ARRAY,
        counts(lambda t, v: f"[2024-01-12 {clock(t / 1e6)}] {csv(v)}"),
        {"separator": "text", "time_pattern": "%Y-%m-%d %H:%M:%S.%f"},
    ),
    "American date, half of a day": (
        ARRAY,
        counts(lambda t, v: f"01/13/2024 {clock(t / 1e6)} PM\t{csv(v, chr(9))}"),
        {"separator": "\t", "time_pattern": "%m/%d/%Y %I:%M:%S.%f %p"},
    ),
    "ISO time with nanoseconds and zone": (
        ARRAY,
        counts(lambda t, v: f"2024-01-12T{clock(t / 1e6)}000000+01:00,{csv(v)}"),
        {"separator": ",", "strip": [sniff.ZONE], "time_pattern": "%Y-%m-%dT%H:%M:%S.%f"},
    ),
    "words, milliseconds": (
        ARRAY,
        counts(lambda t, v: f"I ({t // 1000}) MAT: {csv(v)}"),
        {"separator": "text", "time_unit": "ms"},
    ),
    "brackets": (ARRAY, counts(lambda t, v: f"{t},{v.tolist()}"), {"separator": "text"}),
    "names": (
        ARRAY,
        counts(lambda t, v: f"t:{t}," + csv(f"v{k}:{one}" for k, one in enumerate(v))),
        {"separator": "text"},
    ),
    "JSON lines": (ARRAY, counts(lambda t, v: json.dumps({"t": t, "v": v.tolist()})), {"separator": "text"}),
    "checksum": (
        ARRAY,
        counts(lambda t, v: f"$MAT,{t},{csv(v)}*{t % 256:02X}"),
        {"separator": "text", "strip": [sniff.CHECKSUM]},
    ),
    "index, floats": (
        ARRAY,
        counts(lambda t, v: f"{t // 50_000 - 100},{t},{csv(v.astype(float))}"),
        {"separator": ",", "time": 2, "columns": "3..18", "width": 18},
    ),
    "label behind": (ARRAY, counts(lambda t, v: f"{t},{csv(v)},cup"), {"separator": "text"}),
    "lines of a frame, marked": (
        ARRAY,
        counts(lambda t, v: "flag\n" + "\n".join(map(csv, v.reshape(4, 4)))),
        {"separator": ",", "lines_per_frame": 4, "frame_begins": "flag", "rate_hz": None},
    ),
    "lines of a frame, apart": (
        ARRAY,
        counts(lambda t, v: "\n".join(csv(row, "\t") + "\t" for row in v.reshape(4, 4)) + "\n"),
        {"separator": "\t", "lines_per_frame": 4, "frame_begins": "", "rate_hz": None},
    ),
    "lines of a frame, timed": (
        ARRAY,
        counts(lambda t, v: csv([f"Time,{t / 1e6:.3f}", *(f"R,{csv(row)}" for row in v.reshape(4, 4))], "\n")),
        {"separator": "text", "lines_per_frame": 4, "width": 4, "frame_begins": "Time,(.*)", "time_unit": "s"},
    ),
    "no time": (ARRAY, counts(lambda t, v: csv(v, " ")), {"separator": " ", "rate_hz": None}),
    "CR": (ARRAY, counts(lambda t, v: f"{t},{csv(v)}").replace("\n", "\r"), {"separator": ","}),
    "LF CR": (ARRAY, counts(lambda t, v: f"{t},{csv(v)}").replace("\n", "\n\r"), {"separator": ","}),
    "CR CR LF": (ARRAY, counts(lambda t, v: f"{t},{csv(v)}").replace("\n", "\r\r\n"), {"separator": ","}),
    "commas at the end": (ARRAY, counts(lambda t, v: f"{t},{csv(v)},"), {"separator": ","}),
    "empty lines": (ARRAY, counts(lambda t, v: f"{t},{csv(v)}\n"), {"separator": ","}),
    "tail of commas": (ARRAY, counts(lambda t, v: f"{t},{csv(v)}") + ("," * 16 + "\n") * 40, {"separator": ","}),
    "gzip": (ARRAY, gzip.compress(counts(lambda t, v: f"{t},{csv(v)}").encode()), {"separator": ","}),
    "UTF-16": (ARRAY, counts(lambda t, v: f"{t},{csv(v)}").encode("utf-16"), {"encoding": "utf-16", "separator": ","}),
}  # fmt: skip


def written(folder, content, name="device.log"):
    (folder / name).write_bytes(content if isinstance(content, bytes) else content.encode())
    return folder / name


@pytest.mark.parametrize("kind", READ)
def test_a_layout_is_found_and_read(kind, tmp_path):
    fmt, content, wanted = READ[kind]
    path = written(tmp_path, content)
    found = sniff.proposed(path, fmt)
    assert found.layout == wanted
    laid_out = wanted | ({"rate_hz": 20.0} if wanted.get("rate_hz", 0) is None else {})
    rows, rejects = parse.read_log(path, fmt, layout=laid_out)
    truth = {"daq": VOLTS, "robot": PLACES[:, None], "array": COUNTS}[
        "daq" if fmt is DAQ else "robot" if fmt is ROBOT else "array"
    ]
    values = np.column_stack([rows[name].to_numpy() for name in fmt.names[1:]])
    apart_s = np.diff(rows[fmt.time].to_numpy() / parse.second(fmt))
    assert apart_s == pytest.approx(np.full(len(apart_s), 0.05), abs=0.03 if "repeats" in kind else 1e-6)
    if kind == "values of other times":  # each is held for three lines, and the first rows lack one
        assert rejects.num_rows == 0 and len(values) == ROWS - 2
        assert [(values[k, c] == VOLTS[k + 2, c]) for k in range(9) for c in [(k + 2) % 3]] == [True] * 9
        return
    assert values == pytest.approx(truth, abs=1e-9) and rejects.num_rows == 0


REFUSED = {  # kind: format, file, words
    "binary": (ARRAY, b"".join(b"\xaa\xab" + v.astype(">u2").tobytes() for v in COUNTS), "holds binary data"),
    "no line end": (ARRAY, csv(COUNTS.ravel(), "\t"), "the device ends no line; end each frame"),
    "time with five digits": (
        DAQ,
        volts(lambda t, v: f"{1.7e9 + t:.5g},{csv(v)}"),
        r"the time, 1\.7e\+09, is the same in every line: .* too few digits",
    ),
    "time in steps of a second": (
        DAQ,
        volts(lambda t, v: f"{t:.0f},{csv(v)}"),
        "too few digits: it rises in steps of 1 s",
    ),
    "converter's counts": (
        touch.LOAD_CELL,
        "".join(f"{round(t * 1e6)},{-259532 + 9 * k}\n" for k, t in enumerate(T)),
        "-259532 is a count of the load cell's converter",
    ),
    "lines of a frame, unmarked": (
        ARRAY,
        counts(lambda t, v: "\n".join(map(csv, v.reshape(4, 4)))),
        "no line between the frames says where one begins",
    ),
    "broken gzip": (ARRAY, gzip.compress(COUNTS.tobytes())[:-500], "its gzip compression is broken"),
}


@pytest.mark.parametrize("kind", REFUSED)
def test_a_log_that_cannot_be_read_is_refused_with_the_reason(kind, tmp_path):
    fmt, content, words = REFUSED[kind]
    assert re.search(words, sniff.proposed(written(tmp_path, content), fmt))


def test_a_time_that_counts_milliseconds_is_no_index(tmp_path):
    """Beside a reading that rises as evenly; without a name that says so it counts the lines."""
    lines = "".join(f"{k},{k / 100:.2f}\n" for k in range(100))
    found = sniff.proposed(written(tmp_path, lines), ROBOT)
    assert found.layout == {"separator": ",", "columns": [2], "width": 2, "rate_hz": None}
    assert "column 1, which rises by 1, counts the frames" in found.guesses[0]
    found = sniff.proposed(written(tmp_path, "t_ms,x_mm\n" + lines), ROBOT)
    assert found.layout == {"separator": ",", "time_unit": "ms"}


def test_nothing_is_proposed_for_another_sensor(tmp_path):
    wide = "".join(f"{t:.4f},{csv(v)},1.5,{k % 7}\n" for k, (t, v) in enumerate(zip(T, VOLTS, strict=True)))
    assert sniff.proposed(written(tmp_path, wide), DAQ) is None
    assert sniff.proposed(written(tmp_path, "ready\nready\n"), DAQ) is None


@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    kind=st.sampled_from(sorted(READ)),
    cut=st.tuples(st.floats(0, 1), st.integers(0, 400)),
    noise=st.binary(max_size=12),
)
@example(kind="JSON lines", cut=(0.5, 0), noise=b"\r")
def test_damage_ends_in_rows_and_rejects_or_in_one_sentence(kind, cut, noise, tmp_path):
    fmt, content, laid_out = READ[kind]
    content = content if isinstance(content, bytes) else content.encode()
    at = int(cut[0] * len(content))
    path = written(tmp_path, content[:at] + noise + content[at + cut[1] :])
    sniff.proposed(path, fmt)
    try:
        rows, rejects = parse.read_log(
            path, fmt, layout=laid_out | ({"rate_hz": 20.0} if without_rate(laid_out) else {})
        )
    except InputError as error:
        assert str(error).startswith(str(path))
        return
    numbers = rows["line"].to_pylist() + rejects["line"].to_pylist()
    assert len(set(numbers)) == len(numbers) and rejects["line"].to_pylist() == sorted(rejects["line"].to_pylist())
    for column in fmt.columns:
        values = rows[column.name].to_numpy()
        assert ((values >= column.low) & (values <= column.high)).all()


@pytest.mark.parametrize("separator", [",", "text"])
def test_torn_lines_are_rejects_with_their_numbers(separator, tmp_path):
    lines = counts(lambda t, v: f"{t},{csv(v)}").splitlines()
    lines[20], lines[40], lines[60] = lines[20][:30], lines[40].replace(",", ",x", 1), "ready"
    path = written(tmp_path, "t_us,cells\n\n" + "\n".join(lines))
    rows, rejects = parse.read_log(path, ARRAY, layout={"separator": separator})
    assert rejects["line"].to_pylist() == [23, 43, 63] and rows.num_rows == ROWS - 3
    assert rejects["text"].to_pylist() == [lines[20], lines[40], "ready"]
    assert rows["line"].to_pylist()[:2] == [3, 4]


def test_columns_by_number_hold_a_line_to_its_width(tmp_path):
    """A line that is torn behind the last column that is read would give a cut number."""
    path = written(tmp_path, "0.1,7,5.123,9\n0.2,7,5.456,9\n0.3,7,5.7\n0.4,7,5.789,9\n")
    rows, rejects = parse.read_log(path, ROBOT, layout={"columns": [3], "width": 4})
    assert rows["x_mm"].to_pylist() == [5.123, 5.456, 5.789] and rejects["line"].to_pylist() == [3]


def test_torn_frames_are_rejects_and_keep_their_time(tmp_path):
    frames = ["flag", "1,2", "3,4", "flag", "5,6", "flag", "7,8", "9,10", "11,12", "flag", "13,14", "15,16"]
    fmt = Format(
        (Column("t_us", "us", 0, 4e15, True), *(Column(f"v{k}", "counts", 0, 99, True) for k in range(4))), "t_us"
    )
    laid_out = {"lines_per_frame": 2, "frame_begins": "flag", "rate_hz": 10}
    rows, rejects = parse.read_log(written(tmp_path, "\n".join(frames)), fmt, layout=laid_out)
    assert rejects["line"].to_pylist() == [5, 9] and set(rejects["reason"].to_pylist()) == {parse.COLUMNS}
    assert rows["v0"].to_pylist() == [1, 7, 13] and rows["v3"].to_pylist() == [4, 10, 16]
    assert rows["t_us"].to_pylist()[:2] == [0, 200_000]


def test_readings_are_scaled_and_turned(tmp_path):
    path = written(tmp_path, "0.1,100,1\n0.2,200,3\n")
    fmt = Format(
        (Column("t_us", "us", 0, 4e15, True), Column("v0", "counts", 0, 1023, True), Column("fz", "N", -10, 10)), "t_us"
    )
    laid_out = {"time_unit": "s", "scale": [0.5, -2], "offset": [1, 0], "rises_when_pressed": False}
    rows, _ = parse.read_log(path, fmt, layout=laid_out)
    assert rows["t_us"].to_pylist() == [100_000, 200_000]
    assert rows["v0"].to_pylist() == [1023 - 51, 1023 - 101] and rows["fz"].to_pylist() == [2, 6]


def test_a_header_further_on_may_not_differ(tmp_path):
    """The same one, and a banner of as many words, are none that differ."""
    fmt = Format((Column("t_us", "us", 0, 4e15, True), Column("fz_n", "N", -1000, 1000)), "t_us")
    text = "Time (us),Force (N)\n1,2\n2,3\n{}\n3,4\n"
    for line in ("Time (us),Force (N)", "HX711, ready"):
        rows, rejects = parse.read_log(written(tmp_path, text.format(line)), fmt, layout={"separator": ","})
        assert rows.num_rows == 3 and rejects["line"].to_pylist() == [4]
    for line in ("Time (us),Force (kN)", "Time (us),Torque"):
        with pytest.raises(InputError, match=r"line 4 names the columns Time .*, but line 1 Time \(us\), Force"):
            parse.read_log(written(tmp_path, text.format(line)), fmt, layout={"separator": ","})


def test_readings_that_were_filled_are_counted(tmp_path):
    fmt = Format((Column("t_s", "s", 0, 1e9), *(Column(f"u{k}", "V", -10, 10) for k in range(2))), "t_s")
    path = written(tmp_path, "0,1,5\n1,,5\n2,nan,5\n3,4,5\n4,,5\n5,4,5\n")
    assert layout.filled(path, {"missing": "previous"}, fmt) == {"u0": (3, 2)}
    report = own_logs.read_one(path, fmt, {"missing": "previous"}).report
    assert report["filled"] == {"u0": (3, 2)} and report["accepted"] == 6


def test_midnight_is_passed(tmp_path):
    path = written(tmp_path, "23:59:59.5,1\n23:59:59.9,2\n00:00:00.3,3\n")
    rows, rejects = parse.read_log(path, ROBOT, layout={"time": 1, "time_pattern": "%H:%M:%S.%f"})
    assert np.diff(rows["t_s"].to_numpy()) == pytest.approx([0.4, 0.4]) and rejects.num_rows == 0


@pytest.mark.parametrize(
    ("laid_out", "words"),
    [
        ({"separator": ";"}, "no line is laid out as `format`"),
        ({"columns": ["force"]}, "no line names the column force of its format"),
        ({"columns": [2, 3], "width": 3}, "names 2 columns, but the sensor has 1 reading"),
        ({"scale": [1, 2]}, "has 2 scales or offsets for 1 reading"),
    ],
)
def test_a_layout_that_does_not_fit_is_refused(laid_out, words, tmp_path):
    with pytest.raises(InputError, match=words):
        parse.read_log(written(tmp_path, "0.1,1\n0.2,2\n"), ROBOT, layout=laid_out)


def test_live_reads_as_ingest_does(tmp_path):
    """In pieces of any size, and replayed."""
    for kind in ("time of day", "lines of a frame, apart", "CR", "time repeats"):
        fmt, content, laid_out = READ[kind]
        laid_out = laid_out | ({"rate_hz": 20.0} if without_rate(laid_out) else {})
        path = written(tmp_path, content)
        rows, _ = parse.read_log(path, fmt, layout=laid_out)
        data = path.read_bytes()
        lines = Lines(fmt, "port", "a model", (), laid_out)
        readings = [reading for k in range(0, len(data), 11) for reading in lines.take(data[k : k + 11])]
        values = np.column_stack([rows[name].to_numpy() for name in fmt.names[1:]])
        assert len(readings) >= ROWS - 4 and not lines.rejects
        assert np.array([reading.values for reading in readings]) == pytest.approx(values[: len(readings)])
        if kind != "time repeats":
            again = Lines(fmt, "log", "a model", (), laid_out)
            replayed = [one for line in replay(path, fmt, False, 1e6, laid_out=laid_out) for one in again.take(line)]
            assert [one.t_s for one in replayed] == [one.t_s for one in readings]


def without_rate(laid_out):
    return laid_out.get("rate_hz", 0) is None


def test_further_load_cells_have_the_layout_of_the_first():
    ingest = {"format": {"load_cell.log": {"separator": ";"}}}
    assert layout.of(ingest, "load_cell_2.log") == {"separator": ";"} and layout.of(ingest, "cnc_2.log") is None


STAMPS_US = {"its own time": 1, "times of 40 ms": 40_000, "times of 1 s": 1_000_000}


def laid_out(tmp_path, channels, noise, stamp_us, copies):
    """What is read of a log of 20 ms a frame, with its times cut to steps, where lines of one time are spread.

    copies: how often each line is printed.
    """
    time_s, counts = touched(channels=channels, noise=noise, seed=1)
    stamps = np.round(time_s * 1e6).astype(int) // stamp_us * stamp_us
    lines = [f"{t}," + ",".join(f"{v:.0f}" for v in row) for t, row in zip(stamps, counts, strict=True)]
    path = tmp_path / "array.log"
    path.write_text("\n".join(line for line, times in zip(lines, copies, strict=True) for _ in range(times)) + "\n")
    fmt = touch.array_format({"sensor": {"rows": 1, "cols": channels}, "ingest": {"highest_count": 1023}})
    rows, rejects = parse.read_log(path, fmt, limit=0.02, layout={"separator": ",", "repeats": "spread"})
    return counts, rows, rejects


@pytest.mark.parametrize("stamp", STAMPS_US)
@pytest.mark.parametrize("noise", [0, 0.2, 1])
@pytest.mark.parametrize("channels", [1, 2, 16])
def test_equal_lines_of_one_time_are_frames_of_a_sensor_at_rest(tmp_path, channels, noise, stamp):
    counts, rows, rejects = laid_out(tmp_path, channels, noise, STAMPS_US[stamp], np.ones(2000, int))
    assert rows.num_rows == len(counts) and rejects.num_rows == 0
    assert rows["v0"].to_numpy().tolist() == counts[:, 0].tolist()


@pytest.mark.parametrize("times", [2, 3])
@pytest.mark.parametrize("noise", [0, 0.2, 1])
@pytest.mark.parametrize("channels", [1, 2, 16])
def test_copies_of_lines_are_no_frames(tmp_path, channels, noise, times):
    counts, rows, rejects = laid_out(tmp_path, channels, noise, 1, np.full(2000, times))
    assert rows["v0"].to_numpy().tolist() == counts[:, 0].tolist()
    assert np.diff(rows["t_us"].to_numpy()).tolist() == [20_000] * 1999
    assert rejects["reason"].unique().to_pylist() == [parse.DUPLICATE] and rejects.num_rows == (times - 1) * 2000
    assert rejects["line"].to_numpy().tolist() == [k for k in range(1, 2000 * times + 1) if k % times != 1]


@pytest.mark.parametrize("stamp", ["its own time", "times of 40 ms"])
def test_some_copies_of_lines_are_no_frames(tmp_path, stamp):
    copies = 1 + (np.random.default_rng(0).random(2000) < 0.03)
    counts, rows, rejects = laid_out(tmp_path, 16, 1, STAMPS_US[stamp], copies)
    assert rows["v0"].to_numpy().tolist() == counts[:, 0].tolist() and rejects.num_rows == copies.sum() - 2000


@pytest.mark.parametrize("stamp", ["times of 40 ms", "times of 1 s"])
def test_copies_among_lines_of_one_time_are_no_frames(tmp_path, stamp):
    counts, rows, _ = laid_out(tmp_path, 16, 1, STAMPS_US[stamp], np.full(2000, 2))
    assert rows["v0"].to_numpy().tolist() == counts[:, 0].tolist()
    assert np.median(np.diff(rows["t_us"].to_numpy())) == 20_000


@pytest.mark.parametrize("time", ["1e999999", "-1e999999", "9e99999999", "1e-999999", "1e41"])
@pytest.mark.parametrize("unit", ["s", "min"])
def test_a_time_beyond_all_times_is_a_line_that_cannot_be_read(time, unit, tmp_path):
    lines = [f"{k / 1000},{k % 7}" for k in range(400)]
    wrong = [*lines[:200], f"{time},4", *lines[200:]]
    read = []
    for name, some in (("a.log", lines), ("b.log", wrong)):
        (tmp_path / name).write_text("\n".join(some) + "\n")
        read.append(parse.read_log(tmp_path / name, ROBOT, layout={"separator": ",", "time_unit": unit})[0])
    assert read[0].drop(["line"]).equals(read[1].drop(["line"]))
