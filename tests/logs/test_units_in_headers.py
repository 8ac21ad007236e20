"""A log is read as the same numbers whatever unit its header names, or it is refused by that unit."""

import numpy as np
import pytest

from tactile.base.errors import InputError
from tactile.experiments import strain, touch
from tactile.logs import parse, units
from tactile.own import logs as own_logs
from tactile.settings.targets import Target
from tactile.targets import read

SETTINGS = {"ingest": {"max_reject_fraction": 0.01}}
N = 200
TIMES_S = 0.02 * np.arange(1, N + 1)
FORMATS = {
    "force": touch.LOAD_CELL,
    "length": touch.CNC,
    "voltage": strain.formats({"sensor": {"channels": 3, "tasks": {}}})["daq.log"],
    "resistance": strain.formats({"sensor": {"channels": 3, "unit": "ohm", "tasks": {}}})["daq.log"],
}
NAMES = {"force": ["Fz"], "length": ["x", "y", "z"]}
WAYS = [("{} ({})", ","), ("{} [{}]", ";"), ("{}_{}", "\t")]


def readings(quantity):
    """Readings in the log's own unit, (N, columns)."""
    columns = len(FORMATS[quantity].columns) - 1
    return 5 + 3 * np.sin(TIMES_S[:, None] * np.arange(1, columns + 1))


def written(path, quantity, unit, way=WAYS[0], time="t_us", values=None):
    """A log of a quantity in a unit, which its header names."""
    form, separator = way
    wanted = FORMATS[quantity].columns[-1].unit
    values = readings(quantity) if values is None else values
    values = values * units.SIZES[quantity][wanted] / units.SIZES[quantity][unit]
    names = [form.format(name, unit) for name in NAMES.get(quantity, ["u0", "u1", "u2"])]
    seconds = FORMATS[quantity].time == "t_s"
    clock = TIMES_S if seconds else np.rint(1e6 * TIMES_S).astype(int)
    rows = [separator.join(map(str, [at, *map(float, row)])) for at, row in zip(clock, values, strict=True)]
    path.write_text("\n".join([separator.join(["t_s" if seconds else time, *names]), *rows]) + "\n")
    return path


def found_in(path, fmt):
    """What is proposed for a log, and its readings by it, or by its header alone where it is the product's own."""
    found = own_logs.proposed("touch", path, fmt, SETTINGS, None)
    rows, _ = parse.read_log(path, fmt, layout=found.layout)
    return found, np.column_stack([rows[column.name].to_numpy() for column in fmt.columns if column.name != fmt.time])


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize(("quantity", "unit"), [(of, unit) for of in FORMATS for unit in units.SIZES[of]])
def test_a_log_in_each_unit_is_read_as_the_same_numbers(quantity, unit, way, tmp_path):
    fmt = FORMATS[quantity]
    path = written(tmp_path / "a.log", quantity, unit, way)
    found, values = found_in(path, fmt)
    assert values == pytest.approx(readings(quantity), rel=1e-9)
    assert any(unit in sentence for sentence in found.said) == (unit != fmt.columns[-1].unit)
    for layout in (None, {"separator": way[1]}):  # its header, or a block without a scale
        try:
            rows, _ = parse.read_log(path, fmt, layout=layout)
        except InputError:
            continue
        assert rows[fmt.columns[-1].name].to_numpy() == pytest.approx(values[:, -1], rel=1e-9)


@pytest.mark.parametrize("header", ["Time,Force ({})", "Time (us),Load of cell ({})", "# t_us,Fz ({})", "t_us,Fz [{}]"])
@pytest.mark.parametrize(("unit", "said"), [("kPa", "pressure"), ("mm", "length"), ("stone", "known"), ("lbf", "N")])
def test_another_unit_is_never_read_as_newtons(header, unit, said, tmp_path):
    path = written(tmp_path / "load_cell.log", "force", "N")
    rows = path.read_text().split("\n", 1)[1]
    path.write_text(f"{header.format(unit)}\n{rows}")
    sentence = rf"load_cell.log: line 1 names the column .*{unit}.*{said}"
    with pytest.raises(InputError, match=sentence):
        parse.read_log(path, touch.LOAD_CELL, layout={"separator": ","})
    found = own_logs.proposed("touch", path, touch.LOAD_CELL, SETTINGS, None)
    assert isinstance(found, str) == (unit != "lbf") and (unit == "lbf" or said in found)
    if not (unit == "stone" and ("of cell" in header or "#" in header)):  # words in brackets, of a banner too
        with pytest.raises(InputError, match=sentence):
            parse.read_log(path, touch.LOAD_CELL)
    path.write_text(f"{header.format('N').replace('Fz', 'fz') if '#' in header else 'Time,Force (N)'}\n{rows}")
    assert parse.read_log(path, touch.LOAD_CELL)[0].num_rows == N


def test_the_name_wins_over_the_size_of_the_values_and_the_doubt_is_said(tmp_path):
    path = written(tmp_path / "daq.log", "voltage", "mV", values=readings("voltage") / 1000)
    found, values = found_in(path, FORMATS["voltage"])
    assert values.max() < 0.01 and "the header says mV, but then the largest reading is 0.008 V" in found.said[0]
    path = written(tmp_path / "load_cell.log", "force", "mN", values=4 * readings("force"))
    found, values = found_in(path, touch.LOAD_CELL)
    assert values == pytest.approx(4 * readings("force")) and not found.guesses


def test_a_time_is_in_the_unit_that_its_name_holds(tmp_path):
    path = written(tmp_path / "load_cell.log", "force", "N", time="time (ms)")
    found, _ = found_in(path, touch.LOAD_CELL)
    assert found.layout["time_unit"] == "ms" and any("apart" in sentence for sentence in found.said)


@pytest.mark.parametrize(
    "name", ["force", "force_left", "pose[0]", "pos (x)", "V", "x", "ch 1", "plugged in", "force_min"]
)
def test_a_name_without_a_unit_holds_none(name):
    assert units.named(name, "N") is None


def test_a_target_in_another_unit_is_refused(tmp_path):
    settings = SETTINGS | {"sensor": {"channels": 3, "tasks": {}}}
    target = Target(name="angle", unit="deg", kind="continuous", file="robot.log", column=2)
    rows = "".join(f"{at:.2f},{at / 4:.4f}\n" for at in TIMES_S)
    for unit in ("deg", "rad", "mm"):
        (tmp_path / "robot.log").write_text(f"t_s,angle ({unit})\n{rows}")
        if unit == "deg":
            _, values = read.column_of(tmp_path / "robot.log", target, "strain", settings)
            assert values == pytest.approx(TIMES_S / 4, abs=1e-4)
        else:
            with pytest.raises(InputError, match=rf"robot.log: line 1 names the column 'angle \({unit}\)'.*deg"):
                read.column_of(tmp_path / "robot.log", target, "strain", settings)
