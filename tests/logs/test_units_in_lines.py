"""A unit that stands in the lines of a log becomes a scale, or the log is refused by that word."""

import numpy as np
import pytest

from tactile.base.errors import InputError
from tactile.experiments import strain, touch
from tactile.logs import parse, sniff, units
from tactile.own import logs as own_logs

SETTINGS = {"ingest": {"max_reject_fraction": 0.02}}
N = 80
T = [0.05 * k for k in range(1, N + 1)]
DAQ = strain.formats({"sensor": {"channels": 3}})["daq.log"]
CELL, CNC = touch.LOAD_CELL, touch.CNC
WORDS = {fmt.names[1]: quantity for fmt, quantity in ((CELL, "force"), (CNC, "length"), (DAQ, "voltage"))}
WAYS = {  # how a unit stands with the readings of a line
    "behind": lambda t, v, unit: f"{t},Reading: " + " ".join(f"{x!r} {unit}" for x in v),
    "attached": lambda t, v, unit: f"{t} " + " ".join(f"c{k}={x!r}{unit}" for k, x in enumerate(v)),
    "in columns": lambda t, v, unit: f"{t}," + ",".join(f"{x!r},{unit}" for x in v),
    "in columns before": lambda t, v, unit: f"{t};" + ";".join(f"{unit};{x!r}" for x in v),
    "in keys": lambda t, v, unit: f'{{"t": {t}, ' + ", ".join(f'"c{k}_{unit}": {x!r}' for k, x in enumerate(v)) + "}",
    "in brackets": lambda t, v, unit: f"{t}, " + ", ".join(f"load ({unit}): {x!r}" for x in v),
    "said once": lambda t, v, unit: f"{t}," + ",".join(map(repr, v)) + f" {unit}",
}


def truth(fmt):
    """Readings in the log's own unit, (N, columns)."""
    return 4 + 3 * np.sin(np.array(T)[:, None] * np.arange(1, len(fmt.columns)))


def stamps(fmt):
    return [f"{t:.4f}" if fmt.time == "t_s" else str(round(1e6 * t)) for t in T]


def written(path, lines):
    path.write_text("\n".join(lines) + "\n")
    return path


def log(path, fmt, line, size=1.0):
    """A log of lines `line(time, readings)`, readings divided by the size of their unit."""
    values = (truth(fmt) / size).tolist()
    return written(path, [line(t, v) for t, v in zip(stamps(fmt), values, strict=True)])


def values_of(path, fmt, laid_out):
    rows, rejects = parse.read_log(path, fmt, layout=laid_out)
    return np.column_stack([rows[name].to_numpy() for name in fmt.names if name != fmt.time]), rejects


OTHERS = [
    (fmt, unit) for fmt in (CELL, CNC, DAQ) for unit in units.SIZES[WORDS[fmt.names[1]]] if unit not in ("N", "mm", "V")
]
EACH = [(way, fmt, unit) for way in ("attached", "in columns") for fmt, unit in OTHERS]
EACH += [(way, fmt, unit) for way in WAYS for fmt, unit in ((CELL, "lb"), (CNC, "m"), (DAQ, "mV"))]


@pytest.mark.parametrize(("way", "fmt", "unit"), dict.fromkeys(EACH))
def test_each_unit_is_read_wherever_it_stands(way, fmt, unit, tmp_path):
    sizes = units.SIZES[WORDS[fmt.names[1]]]
    path = log(tmp_path / "a.log", fmt, lambda t, v: WAYS[way](t, v, unit), sizes[unit])
    found = own_logs.proposed("touch", path, fmt, SETTINGS, None)
    assert any(unit in sentence for sentence in found.said) and "scale" in found.layout
    values, _ = values_of(path, fmt, found.layout)
    assert values == pytest.approx(truth(fmt), rel=1e-9)
    bare = {key: value for key, value in found.layout.items() if key != "scale"}
    with pytest.raises(units.Unit, match=rf"line 1 has '{unit}'|line 1 .*{unit}"):  # whoever wrote the block
        parse.read_log(path, fmt, layout=bare)
    with pytest.raises(units.Unit, match="scale in its format is 3.3"):
        parse.read_log(path, fmt, layout=bare | {"scale": 3.3})


@pytest.mark.parametrize("way", ["behind", "attached", "in columns"])
@pytest.mark.parametrize(
    ("word", "unit"),
    [("lbs", "lb"), ("KG", "kg"), ("Kgf", "kgf"), ("pounds", "lb"), ("grams", "g"), ("OZ", "oz"), ("Newtons", "N")],
)
def test_a_unit_by_another_name(word, unit, way, tmp_path):
    path = log(tmp_path / "a.log", CELL, lambda t, v: WAYS[way](t, v, word), units.SIZES["force"][unit])
    values, _ = values_of(path, CELL, own_logs.proposed("touch", path, CELL, SETTINGS, None).layout)
    assert values == pytest.approx(truth(CELL), rel=1e-9)


@pytest.mark.parametrize(
    ("text", "unit"),
    [("µm", "um"), ("\u03bcV", "uV"), ("k\u2126", "kohm"), ("mOhm", "mohm"), ("MOhm", "Mohm"), ('"', "inch")]
    + [("mN", "mN"), ("MN", "MN"), ("uv", "uV"), ("lbs.", "lb"), ("Hours", "h"), ("milliseconds", "ms"), ("Nm", None)],
)
def test_spellings(text, unit):
    assert units.known(text) == unit


@pytest.mark.parametrize(
    ("line", "said"),
    [
        (lambda t, v: f"{t},{v[0]!r} stone", "'stone' is no unit that is known here"),
        (lambda t, v: f"{t},{v[0]!r}%", "'%' is no unit"),
        (lambda t, v: f"{t},{v[0]!r} counts", "'counts' is no unit"),
        (lambda t, v: f"{t},{v[0]!r},kPa", "'kPa' is a unit of pressure"),
        (lambda t, v: f"{t},{v[0]!r} mm/s", "'mm/s' is no unit"),
        (lambda t, v: f"{t} mm,{v[0]!r}", "'mm' for t_us, but 'mm' is a unit of length"),
    ],
)
def test_a_word_that_is_no_unit_of_the_reading_is_named(line, said, tmp_path):
    path = log(tmp_path / "a.log", CELL, line)
    assert said in own_logs.proposed("touch", path, CELL, SETTINGS, None)
    with pytest.raises(units.Unit, match=said.replace("%", ".")):
        parse.read_log(path, CELL, layout={"separator": "text"})
    if "t_us" not in said:  # a factor that the user writes is the user's word
        values, _ = values_of(path, CELL, {"separator": "text", "scale": 2.0})
        assert values == pytest.approx(2 * truth(CELL))


def test_names_and_labels_are_no_units(tmp_path):
    for line in (
        lambda t, v: f"{t},Reading: {v[0]!r}",
        lambda t, v: f"{t},ST,GS,{v[0]!r},OK",
        lambda t, v: f"x {t} N {v[0]!r}",
        lambda t, v: f"{t},{v[0]!r},{'rest' if v[0] < 4 else 'press'}",
        lambda t, v: f"{t} {v[0]!r} {'rest' if v[0] < 4 else 'press'}",
    ):
        path = log(tmp_path / "a.log", CELL, line)
        found = own_logs.proposed("touch", path, CELL, SETTINGS, None)
        assert found.layout.get("scale", 1) == 1
        values, rejects = values_of(path, CELL, found.layout)
        assert values == pytest.approx(truth(CELL)) and rejects.num_rows == 0


def test_readings_of_a_line_in_several_units(tmp_path):
    path = log(tmp_path / "a.log", CNC, lambda t, v: f"{t} x={v[0] / 10!r}cm y={v[1] / 1000!r}m z={v[2]!r}mm")
    found = own_logs.proposed("touch", path, CNC, SETTINGS, None)
    assert found.layout["scale"] == [10, 1000, 1]
    assert values_of(path, CNC, found.layout)[0] == pytest.approx(truth(CNC))
    counts = touch.array_format({"sensor": {"rows": 1, "cols": 2}, "ingest": {"highest_count": 1023}})
    written(path, [f"{t} 12 mV 3 V" for t in stamps(counts)])  # of counts, whose unit does not matter else
    with pytest.raises(units.Unit, match="readings in V and mV; write a list of `scale`"):
        parse.read_log(path, counts, layout={"separator": "text"})


@pytest.mark.parametrize("line", ["{},{:.6f} {}", "{},{:.6f},{}", "{} f={:.6f}{}"])
def test_a_unit_that_changes_on_the_way_is_never_read_as_the_first(line, tmp_path):
    for change in (10, N - 1):
        lines = [
            line.format(t, *((v * 1000, "g") if k < change else (v, "kg")))
            for k, (t, v) in enumerate(zip(stamps(CELL), truth(CELL)[:, 0], strict=True))
        ]
        path = written(tmp_path / "a.log", lines)
        said = f"line {change + 1} has 'kg' for fz_n, but line 1 has 'g'"
        assert said in own_logs.proposed("touch", path, CELL, SETTINGS, None)
        with pytest.raises(units.Unit, match=said):
            parse.read_log(path, CELL, layout={"separator": "text", "scale": 0.00980665})


def test_a_unit_that_appears_on_the_way_is_refused_and_a_torn_one_is_a_reject(tmp_path):
    lines = [f"{t},{v!r} {'lbs' if k > 40 else ''}" for k, (t, v) in enumerate(zip(stamps(CELL), T, strict=True))]
    with pytest.raises(units.Unit, match="line 42 has 'lbs' for fz_n, but line 1 has no unit"):
        parse.read_log(written(tmp_path / "a.log", lines), CELL, layout={"separator": "text"})
    lines = [f"{t},{v!r} lbs" for t, v in zip(stamps(CELL), T, strict=True)]
    lines[30], lines[60] = lines[30].removesuffix("bs"), lines[60].removesuffix(" lbs")
    rows, rejects = parse.read_log(
        written(tmp_path / "a.log", lines), CELL, layout={"separator": "text", "scale": 4.4482216152605}
    )
    assert rejects["line"].to_pylist() == [31, 61] and set(rejects["reason"].to_pylist()) == {"another unit"}
    assert rows.num_rows == N - 2


@pytest.mark.parametrize("below", ["us,stone", "us,kPa", "min,N"])
def test_a_row_of_units_below_the_names_is_believed(below, tmp_path):
    rows = [f"{t},{v!r}" for t, v in zip(stamps(CELL), T, strict=True)]
    for layout_of in (None, {"separator": ","}):
        with pytest.raises(InputError, match="line 2 names the column"):
            parse.read_log(written(tmp_path / "a.log", ["Time,Load", below, *rows]), CELL, layout=layout_of)


def test_a_line_of_many_words_is_read_in_no_time(tmp_path):
    """Words are looked at from their end; a hostile line must not take hours."""
    found = units.beside(("a b " * 200_000, " N" + " c=d" * 200_000))
    assert found[0].near == "N"


def test_what_scales_print_beside_the_number(tmp_path):
    """`US` while they move is no microsecond, a sign has blanks behind it, and a word that never changes is said."""
    force = (truth(CELL)[:, 0] - 4).tolist()
    lines = [
        f"{t},{'US' if k % 3 else 'ST'},GS,{'-' if v < 0 else '+'}  {abs(v):.6f}kg"
        for k, (t, v) in enumerate(zip(stamps(CELL), force, strict=True))
    ]
    path = written(tmp_path / "a.log", lines)
    found = own_logs.proposed("touch", path, CELL, SETTINGS, None)
    values, rejects = values_of(path, CELL, found.layout)
    assert values[:, 0] == pytest.approx(9.80665 * np.array(force), abs=1e-4) and rejects.num_rows == 0
    path = log(tmp_path / "a.log", CELL, lambda t, v: f"{t},{v[0]!r},stone")
    assert "that 'stone' behind the readings is no unit" in sniff.proposed(path, CELL).guesses
