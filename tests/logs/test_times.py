"""A log has the same times whatever encoding its clock prints, or it is refused; a counter is no clock."""

from datetime import datetime, timedelta

import numpy as np
import pytest

from tactile.base.errors import InputError
from tactile.experiments import strain, touch
from tactile.logs import diagnosis, layout, parse, sniff, units
from tactile.own import logs as own_logs
from tactile.settings.shared import Layout

SETTINGS = {"ingest": {"max_reject_fraction": 0.01}}
N = 240
DAQ = strain.formats({"sensor": {"channels": 3}})["daq.log"]
ARRAY = touch.array_format({"sensor": {"rows": 1, "cols": 4}, "ingest": {"highest_count": 1023}})
VOLTS = np.round(2 + 0.3 * np.sin(np.arange(3 * N).reshape(N, 3)), 4)
COUNTS = np.random.default_rng(0).integers(0, 1024, (N, 4))
BEGIN = datetime(2024, 1, 12, 12)


def log(path, line, step_s=0.05, values=VOLTS, above=()):
    """A log of lines `line(seconds, readings, number)`."""
    rows = [line(step_s * k, ",".join(map(str, v)), k) for k, v in enumerate(values)]
    path.write_text("\n".join([*above, *rows]) + "\n")
    return path


def read(path, fmt=DAQ, found=None):
    """(times from the first in s, readings, rejects) by what is proposed."""
    found = found or own_logs.proposed("strain", path, fmt, SETTINGS, None)
    rows, rejects = parse.read_log(path, fmt, layout=own_logs.trial(found))
    times = rows[fmt.time].to_numpy() / parse.second(fmt)
    return times - times[0], np.column_stack([rows[c].to_numpy() for c in fmt.names if c != fmt.time]), rejects


def since(year, month=1, day=1, begin=BEGIN):
    """Seconds from a day to BEGIN."""
    return round((begin - datetime(year, month, day)).total_seconds())


ENCODINGS = {  # how a device prints its time, at t seconds
    "s since 1970": lambda t: f"{since(1970) + t:.4f}",
    "ms since 1970": lambda t: f"{1000 * since(1970) + round(1e3 * t)}",
    "us since 1970": lambda t: f"{10**6 * since(1970) + round(1e6 * t)}",
    "ns since 1970": lambda t: f"{10**9 * since(1970) + round(1e9 * t)}",
    "ticks of .NET": lambda t: f"{10**7 * since(1) + round(1e7 * t)}",
    "FILETIME": lambda t: f"{10**7 * since(1601) + round(1e7 * t)}",
    "days of Excel": lambda t: f"{(since(1899, 12, 30) + t) / 86_400:.11f}",
    "days of MATLAB": lambda t: f"{366 + (since(1) + t) / 86_400 + 0:.11f}",
    "s since 1904": lambda t: f"{since(1904) + t:.4f}",
    "s of GPS": lambda t: f"{since(1980, 1, 6) + t:.4f}",
}


@pytest.mark.parametrize("fmt", [DAQ, ARRAY])
@pytest.mark.parametrize("step_s", [0.002, 0.05, 1.5])
@pytest.mark.parametrize("encoding", ENCODINGS)
def test_an_absolute_time_is_read_in_each_encoding(encoding, step_s, fmt, tmp_path):
    values = VOLTS if fmt is DAQ else COUNTS
    path = log(tmp_path / "a.log", lambda t, v, k: f"{ENCODINGS[encoding](t)},{v}", step_s, values)
    times, found, rejects = read(path, fmt)
    assert times == pytest.approx(step_s * np.arange(N), abs=2e-5)  # of a float of 1e9 s, and a day of 11 decimals
    assert (found == values).all() and rejects.num_rows == 0


def test_the_table_of_encodings_is_right():
    for _, what, least_s in units.ABSOLUTE:
        begin = {"1904": (1904,), "1601": (1601,), "year 1 ": (1,), "Excel": (1899, 12, 30), "GPS": (1980, 1, 6)}
        zero = next((day for word, day in begin.items() if word in what), (1970,))
        if "MATLAB" not in what:  # whose day 1 is in the year 0
            assert least_s == since(*zero, begin=datetime(2000, 1, 1)), what
    assert set(Layout.model_fields["time_unit"].annotation.__args__) == set(units.SIZES["time"])
    assert layout.NANOSECONDS["min"] == 60 * 10**9 and layout.NANOSECONDS["100ns"] == 100


def test_two_encodings_that_fit_are_asked_for(tmp_path, monkeypatch):
    monkeypatch.setattr(units, "ABSOLUTE", (*units.ABSOLUTE, ("min", "minutes of a fiction", -(10**12))))
    monkeypatch.setattr(units, "_CENTURY_S", 10**13)
    path = log(tmp_path / "a.log", lambda t, v, k: f"{since(1970) + 0.05 * k:.4f},{v}", 0.05)
    assert "could be" in str(own_logs.proposed("strain", path, DAQ, SETTINGS, None))


@pytest.mark.parametrize("name", ["Time ({})", "t [{}]", "elapsed_{}"])
@pytest.mark.parametrize(
    ("unit", "size"), [("min", 60), ("h", 3600), ("d", 86_400), ("minutes", 60), ("Hours", 3600), ("msec", 1e-3)]
)
def test_a_time_in_the_unit_of_its_header(unit, size, name, tmp_path):
    header = f"{name.format(unit)},a,b,c"
    path = log(tmp_path / "a.log", lambda t, v, k: f"{t / size:.10f},{v}", above=[header])
    assert read(path)[0] == pytest.approx(0.05 * np.arange(N), abs=1e-5)
    if "_" not in name:
        for laid_out in (None, {"separator": ","}):
            with pytest.raises(InputError, match=r"line 1 names the column '.*t_s is in s; write `time_unit: "):
                parse.read_log(path, DAQ, layout=laid_out)


@pytest.mark.parametrize("word", ["jiffies", "ticks", "samples", "kPa"])
def test_a_time_in_an_unknown_unit_is_refused_by_it(word, tmp_path):
    path = log(tmp_path / "a.log", lambda t, v, k: f"{100 * t:.0f},{v}", above=[f"Time ({word}),a,b,c"])
    assert f"'{word}' is " in own_logs.proposed("strain", path, DAQ, SETTINGS, None)
    with pytest.raises(InputError, match=f"'{word}' is .*expected s"):
        parse.read_log(path, DAQ)


@pytest.mark.parametrize("word", ["UTC", "GMT+2", "local", "CET", "Europe/Berlin", "since 1970"])
def test_a_zone_is_no_unit(word, tmp_path):
    path = log(tmp_path / "a.log", lambda t, v, k: f"{t:.2f},{v}", above=[f"Time ({word}),a,b,c"])
    assert read(path)[0] == pytest.approx(0.05 * np.arange(N), abs=1e-6)


def test_unknown_words_do_not_matter_where_the_times_tell_their_encoding(tmp_path):
    path = log(
        tmp_path / "a.log", lambda t, v, k: f"{ENCODINGS['ticks of .NET'](t)},{v}", above=["Timestamp (ticks),a,b,c"]
    )
    assert read(path)[0] == pytest.approx(0.05 * np.arange(N), abs=1e-5)


COUNTERS = {  # of the k-th line
    "from 0": lambda k: k,
    "from a million": lambda k: 1_000_000 + k,
    "of 8 bits": lambda k: k % 256,
    "of 16 bits": lambda k: (65_400 + k) % 65_536,
    "with skips": lambda k: k + k // 40,
}


@pytest.mark.parametrize("counter", COUNTERS)
def test_a_counter_is_no_time(counter, tmp_path):
    count = COUNTERS[counter]
    for fmt, values in ((DAQ, VOLTS), (ARRAY, COUNTS)):
        path = log(tmp_path / "a.log", lambda t, v, k: f"{count(k)},{v}", values=values)
        found = sniff.proposed(path, fmt)
        assert found.layout["rate_hz"] is None and "rises by 1, counts the frames and is no time" in found.guesses[0]
        assert ("skips" in found.guesses[0]) == (counter == "with skips")
        assert (read(path, fmt, found)[1] == values).all()
        at = [f"{0.05 * k:.2f}" if fmt is DAQ else str(50_000 * k) for k in range(N)]
        path.write_text("".join(f"{count(k)},{at[k]},{','.join(map(str, v))}\n" for k, v in enumerate(values)))
        times, found, _ = read(path, fmt)
        assert times == pytest.approx(0.05 * np.arange(N), abs=1e-6) and (found == values).all()


@pytest.mark.parametrize(
    "line", ["Sample rate: 20 Hz", "SECONDS_PER_FRAME 0.05", "fps=20", "Sampling interval (s),0.05"]
)
def test_the_rate_of_a_counter_stands_in_the_header(line, tmp_path):
    path = log(tmp_path / "a.log", lambda t, v, k: f"{k},{v}", above=[line, "n,a,b,c"])
    times, values, _ = read(path)
    assert times == pytest.approx(0.05 * np.arange(N)) and (values == VOLTS).all()
    frames = "".join(f"Frame {k + 1}\n{v[0]},{v[1]}\n{v[2]},{v[3]}\n" for k, v in enumerate(COUNTS))
    (tmp_path / "a.log").write_text(f"{line}\n\n{frames}")
    times, values, _ = read(tmp_path / "a.log", ARRAY)
    assert times == pytest.approx(0.05 * np.arange(N)) and (values == COUNTS).all()


def test_a_time_that_is_called_so_is_no_counter(tmp_path):
    for header, unit in (("t_ms,a,b,c", 1e-3), ("Time (s),a,b,c", 1)):
        path = log(tmp_path / "a.log", lambda t, v, k: f"{k},{v}", above=[header])
        assert read(path)[0] == pytest.approx(unit * np.arange(N))


def test_seconds_and_their_parts_in_two_columns_are_refused(tmp_path):
    for digits, word in ((9, "nanoseconds"), (6, "microseconds"), (3, "milliseconds")):
        parts = [k % 20 * 5 * 10**digits // 100 for k in range(N)]
        rows = [
            f"{17 + k // 20},{part},{v[0]},{v[1]},{v[2]}\n"
            for k, (part, v) in enumerate(zip(parts, VOLTS, strict=True))
        ]
        for above in ("", "sec,part,a,b,c\n"):
            (tmp_path / "a.log").write_text(above + "".join(rows))
            assert f"columns 1 and 2 are one time, 17 s and 0 {word}" in sniff.proposed(tmp_path / "a.log", DAQ)


@pytest.mark.parametrize("step_s", [0.1, 0.02, 0.5])
@pytest.mark.parametrize("form", ["{0}T{1}", "{0} {1}", "{1}", "[{0} {1}]"])
def test_whole_seconds_have_no_fraction(form, step_s, tmp_path):
    def line(t, v, k):
        at = BEGIN + timedelta(microseconds=round(1e6 * t))
        return f"{form.format(at.date(), at.time())},{v}"  # isoformat: no fraction at whole seconds

    times, values, rejects = read(log(tmp_path / "a.log", line, step_s))
    assert times == pytest.approx(step_s * np.arange(N), abs=1e-6)
    assert (values == VOLTS).all() and rejects.num_rows == 0


def test_a_time_of_whole_seconds_alone_is_refused_and_tenths_are_spread(tmp_path):
    path = log(tmp_path / "a.log", lambda t, v, k: f"{BEGIN + timedelta(seconds=k // 20):%H:%M:%S},{v}")
    assert "rises in steps of 1 s, and up to 20 lines have the same time" in sniff.proposed(path, DAQ)
    path = log(tmp_path / "a.log", lambda t, v, k: f"{BEGIN + timedelta(seconds=k // 4 / 10)!s:.21},{v}", 0.025)
    assert sniff.proposed(path, DAQ).layout["repeats"] == "spread"
    assert read(path)[0] == pytest.approx(0.025 * np.arange(N), abs=0.06)
    path = log(tmp_path / "a.log", lambda t, v, k: f"{BEGIN + timedelta(seconds=t):%H:%M:%S},{v}", 1.0, COUNTS)
    times, values, _ = read(path, ARRAY)  # 12:00:00,512 is no fraction behind a comma
    assert times == pytest.approx(np.arange(N)) and (values == COUNTS).all()


@pytest.mark.parametrize("sign", ["/", "-"])
@pytest.mark.parametrize("first", ["%d{0}%m{0}%Y", "%m{0}%d{0}%Y"])
@pytest.mark.parametrize(
    "begin", [datetime(2024, 1, 12, 23, 59), datetime(2024, 1, 1, 23, 59), datetime(2024, 5, 4, 23, 59)]
)
def test_day_and_month_are_told_by_the_whole_log(begin, first, sign, tmp_path):
    """Midnight is far behind the lines of which the layout is found."""
    pattern = f"{first.format(sign)} %H:%M:%S.%f"
    values = np.tile(VOLTS, (6, 1))
    path = log(tmp_path / "a.log", lambda t, v, k: f"{begin + timedelta(seconds=t):{pattern}},{v}", values=values)
    assert sniff.proposed(path, DAQ).layout["time_pattern"] == pattern
    times, _, rejects = read(path)
    assert times == pytest.approx(0.05 * np.arange(6 * N), abs=1e-6) and rejects.num_rows == 0
    other = log(tmp_path / "b.log", lambda t, v, k: f"{begin + timedelta(seconds=t / 10):{pattern}},{v}")
    assert sniff.proposed(other, DAQ).layout["time_pattern"] == pattern  # by the log beside it


def test_decimal_commas_between_commas(tmp_path):
    path = log(tmp_path / "a.log", lambda t, v, k: ",".join(f"{x:.4f}" for x in (t, *VOLTS[k])).replace(".", ","))
    times, values, _ = read(path)
    assert times == pytest.approx(0.05 * np.arange(N)) and (values == VOLTS).all()
    path.write_text(path.read_text() + "13,0000,2,1,5\n")  # torn
    assert read(path)[2]["line"].to_pylist() == [N + 1]


@pytest.mark.parametrize("way", [lambda v: v.sum() % 256, lambda v: -v.sum() % 256, lambda v: np.bitwise_xor.reduce(v)])
def test_a_checksum_is_no_reading(way, tmp_path):
    path = log(tmp_path / "a.log", lambda t, v, k: f"{round(1e6 * t)},{v},{way(COUNTS[k])}", values=COUNTS)
    found = sniff.proposed(path, ARRAY)
    assert found.layout["columns"] == [2, 3, 4, 5] and "column 6, the " in found.guesses[0]
    assert (read(path, ARRAY)[1] == COUNTS).all()
    unlike, alike = sniff.unlike_columns(path)
    assert alike == [2, 3, 4, 5] and len(unlike) == 1 and "column 6 is the" in unlike[0]


def test_the_sentence_for_ticks_names_them():
    rows = [[ENCODINGS["FILETIME"](0.05 * k), *map(str, v)] for k, v in enumerate(VOLTS)]
    assert "ticks of 100 ns since 1601" in diagnosis.columns(rows, rows[9], DAQ)
