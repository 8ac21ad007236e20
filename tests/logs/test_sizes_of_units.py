"""Sizes of units against numbers written out by hand: an oracle that is the code's own table finds no fault in it.

By the International Yard and Pound Agreement (1 lb = 0.45359237 kg, 1 in = 25.4 mm), standard gravity (9.80665 m/s2,
CGPM 1901) and NIST Special Publication 811, appendix B.
"""

import datetime
import decimal
import math

import pytest

from tactile.experiments import strain, touch
from tactile.logs import parse, units
from tactile.logs.formats import Column
from tactile.own import logs as own_logs

GRAVITY = 9.80665
SIZES = {
    "force": {
        **{"N": 1, "mN": 0.001, "kN": 1000, "MN": 1_000_000, "uN": 0.000001, "cN": 0.01, "daN": 10, "dyn": 0.00001},
        **{"lbf": 0.45359237 * GRAVITY, "lb": 0.45359237 * GRAVITY},
        **{"ozf": 0.45359237 / 16 * GRAVITY, "oz": 0.45359237 / 16 * GRAVITY},
        **{"kgf": GRAVITY, "kg": GRAVITY, "gf": GRAVITY / 1000, "g": GRAVITY / 1000},
        **{"mgf": GRAVITY / 1_000_000, "mg": GRAVITY / 1_000_000, "tonne": 1000 * GRAVITY},
    },
    "length": {
        **{"mm": 1, "cm": 10, "dm": 100, "m": 1000, "um": 0.001},
        **{"in": 25.4, "inch": 25.4, "ft": 12 * 25.4, "mil": 0.0254, "thou": 0.0254},
    },
    "voltage": {"V": 1, "mV": 0.001, "uV": 0.000001, "nV": 0.000000001, "kV": 1000, "MV": 1_000_000},
    "resistance": {"ohm": 1, "mohm": 0.001, "kohm": 1000, "Mohm": 1_000_000},
    "time": {
        **{"ns": 1, "us": 1000, "ms": 1_000_000, "s": 1_000_000_000, "100ns": 100},
        **{"min": 60_000_000_000, "h": 3_600_000_000_000, "d": 86_400_000_000_000},
    },
    "angle": {"deg": 1, "rad": 180 / math.pi, "mrad": 0.18 / math.pi},
    "pressure": {
        **{"Pa": 1, "hPa": 100, "kPa": 1000, "MPa": 1_000_000, "bar": 100_000, "mbar": 100},
        **{"psi": 0.45359237 * GRAVITY / 0.0254**2, "mmHg": 133.322387415, "N/mm2": 1_000_000, "N/cm2": 10_000},
    },
}
WRITTEN = {  # as people write them
    **{"newton": "N", "Newtons": "N", "millinewtons": "mN", "pounds": "lb", "LBS": "lb", "ounces": "oz", "grams": "g"},
    **{"kilograms": "kg", "metres": "m", "millimeter": "mm", "micrometres": "um", "microns": "um", "inches": "inch"},
    **{"feet": "ft", "mils": "mil", "volts": "V", "millivolts": "mV", "\u00b5V": "uV", "\u03bcs": "us", "ohms": "ohm"},
    **{"k\u03a9": "kohm", "M\u2126": "Mohm", "seconds": "s", "msec": "ms", "microseconds": "us", "minutes": "min"},
    **{"hrs": "h", "days": "d", "\u00b0": "deg", "radians": "rad", "KPA": "kPa", "N/mm\u00b2": "N/mm2", "mN": "mN"},
    **{"MN": "MN", "mV": "mV", "MV": "MV", "dynes": "dyn", "tonnes": "tonne"},
}
ZEROS = {  # what a time counts from, as dates
    "seconds since 1970": (1970, 1, 1),
    "milliseconds since 1970": (1970, 1, 1),
    "microseconds since 1970": (1970, 1, 1),
    "nanoseconds since 1970": (1970, 1, 1),
    "ticks of 100 ns since the year 1 (.NET)": (1, 1, 1),
    "ticks of 100 ns since 1601 (FILETIME)": (1601, 1, 1),
    "days as Excel counts them": (1899, 12, 30),
    "seconds since 1904 (LabVIEW)": (1904, 1, 1),
    "seconds of GPS": (1980, 1, 6),
}
YEAR_ZERO_DAYS = 366  # of MATLAB, whose day 1 is the first of the year 0, a leap year


def test_every_unit_has_its_size():
    assert {of: set(sizes) for of, sizes in units.SIZES.items()} == {of: set(sizes) for of, sizes in SIZES.items()}
    for quantity, sizes in SIZES.items():
        assert units.SIZES[quantity] == pytest.approx(sizes, rel=1e-12), quantity


@pytest.mark.parametrize("text", WRITTEN)
def test_a_unit_is_known_as_people_write_it(text):
    assert units.known(text) == WRITTEN[text]


def test_absolute_times_count_from_their_dates():
    zeros = {what: seconds for _, what, seconds in units.ABSOLUTE}
    later = datetime.date(2000, 1, 1)
    wanted = {what: (later - datetime.date(*date)).days * 86_400 for what, date in ZEROS.items()}
    days_of_year_one = (later - datetime.date(1, 1, 1)).days
    wanted["days as MATLAB counts them (datenum)"] = (days_of_year_one + YEAR_ZERO_DAYS + 1) * 86_400
    assert zeros == wanted


OHMS = {"sensor": {"channels": 3, "unit": "ohm", "tasks": {}}}
LOGS = {  # quantity -> format of a log, its columns as a header names them
    "force": (touch.LOAD_CELL, ["Fz"]),
    "length": (touch.CNC, ["x", "y", "z"]),
    "voltage": (strain.formats({"sensor": {"channels": 3, "tasks": {}}})["daq.log"], ["u0", "u1", "u2"]),
    "resistance": (strain.formats(OHMS)["daq.log"], ["u0", "u1", "u2"]),
}
PRINTED = {  # what a log prints, and what that is in N, mm, V, ohm, us, deg, kPa
    "force": {
        **{"N": ("12.5", 12.5), "mN": ("12.5", 0.0125), "kN": ("0.0125", 12.5), "MN": ("0.000125", 125.0)},
        **{"uN": ("12500000", 12.5), "cN": ("125", 1.25), "daN": ("1.25", 12.5), "dyn": ("125000", 1.25)},
        **{"lbf": ("2.5", 11.12055403815125), "lb": ("1.25", 5.560277019075625)},
        **{"ozf": ("4", 1.112055403815125), "oz": ("8", 2.22411080763025), "kgf": ("1.5", 14.709975)},
        **{"kg": ("0.5", 4.903325), "gf": ("250", 2.4516625), "g": ("12.5", 0.122583125)},
        **{"mgf": ("50000", 0.4903325), "mg": ("20000", 0.196133), "tonne": ("0.0125", 122.583125)},
    },
    "length": {
        **{"mm": ("12.5", 12.5), "cm": ("1.25", 12.5), "dm": ("0.125", 12.5), "m": ("0.0125", 12.5)},
        **{"um": ("125", 0.125), "in": ("0.5", 12.7), "inch": ("1.5", 38.1), "ft": ("0.25", 76.2)},
        **{"mil": ("500", 12.7), "thou": ("250", 6.35)},
    },
    "voltage": {
        **{"V": ("1.25", 1.25), "mV": ("12.5", 0.0125), "uV": ("12.5", 0.0000125), "nV": ("125", 0.000000125)},
        **{"kV": ("0.00125", 1.25), "MV": ("0.00000125", 1.25)},
    },
    "resistance": {"ohm": ("12.5", 12.5), "mohm": ("12.5", 0.0125), "kohm": ("1.25", 1250), "Mohm": ("0.125", 125000)},
    "time": {
        **{"ns": ("20000000", 20000), "us": ("20000", 20000), "ms": ("20", 20000), "s": ("0.02", 20000)},
        **{"min": ("0.0005", 30000), "h": ("0.00001", 36000), "d": ("0.000001", 86400), "100ns": ("200000", 20000)},
    },
    "angle": {"deg": ("12.5", 12.5), "rad": ("0.5", 28.64788975654116), "mrad": ("100", 5.729577951308232)},
    "pressure": {
        **{"Pa": ("1250", 1.25), "hPa": ("12.5", 1.25), "kPa": ("12.5", 12.5), "MPa": ("0.0125", 12.5)},
        **{"bar": ("0.5", 50), "mbar": ("12.5", 1.25), "psi": ("2", 13.789514586336722)},
        **{"mmHg": ("10", 1.33322387415), "N/mm2": ("0.0125", 12.5), "N/cm2": ("1.25", 12.5)},
    },
}
EXACT = 1e-12  # of the true value


def test_every_unit_has_a_printed_value():
    assert {of: set(rows) for of, rows in PRINTED.items()} == {of: set(sizes) for of, sizes in SIZES.items()}


def read(path, fmt, header, rows):
    """Return what is read of a log of words; `tactile check` proposes its layout."""
    path.write_text("\n".join(",".join(row) for row in [header, *rows]) + "\n")
    layout = own_logs.proposed("touch", path, fmt, {"ingest": {"max_reject_fraction": 0.01}}, None).layout
    return parse.read_log(path, fmt, layout=layout)[0]


@pytest.mark.parametrize(("quantity", "unit"), [(of, unit) for of in LOGS for unit in PRINTED[of]])
def test_a_printed_reading_is_its_true_value(quantity, unit, tmp_path):
    """The first line prints the value, those that follow a thousandth of it more each."""
    (fmt, names), (printed, true) = LOGS[quantity], PRINTED[quantity][unit]
    values = [format(decimal.Decimal(printed) * (1000 + k) / 1000, "f") for k in range(200)]
    stamps = [f"{0.02 * k:.2f}" if fmt.time == "t_s" else str(20_000 * k) for k in range(1, 201)]
    rows = [[at, *[value] * len(names)] for at, value in zip(stamps, values, strict=True)]
    found = read(tmp_path / "a.log", fmt, [fmt.time, *(f"{name} ({unit})" for name in names)], rows)
    for column in fmt.names[1:]:
        given = found[column].to_numpy()
        assert given[0] == pytest.approx(true, rel=EXACT, abs=0)
        assert given[100] == pytest.approx(1.1 * true, rel=EXACT, abs=0) and len(given) == 200


@pytest.mark.parametrize("unit", PRINTED["time"])
def test_a_printed_time_is_its_true_value(unit, tmp_path):
    printed, true = PRINTED["time"][unit]
    rows = [[format(decimal.Decimal(printed) * k, "f"), str(5 + k % 7)] for k in range(1, 201)]
    found = read(tmp_path / "a.log", touch.LOAD_CELL, [f"t ({unit})", "fz (N)"], rows)
    assert found["t_us"].to_numpy()[[0, 99, 199]].tolist() == [true, 100 * true, 200 * true]


@pytest.mark.parametrize(("quantity", "unit"), [(of, unit) for of in ("angle", "pressure") for unit in PRINTED[of]])
def test_a_printed_truth_is_its_true_value(quantity, unit):
    column = Column("truth", {"angle": "deg", "pressure": "kPa"}[quantity], -1e6, 1e6)
    printed, true = PRINTED[quantity][unit]
    assert float(printed) * (units.factor(unit, column, "a.log") or 1) == pytest.approx(true, rel=EXACT, abs=0)


@pytest.mark.parametrize(
    ("time", "unit", "of_1970"),
    [
        (45_000.5, "d", 25_569),  # of a spreadsheet, in 2023
        (738_000.25, "d", 719_529),  # of MATLAB
        (638_400_000_000_000_000, "100ns", 621_355_968_000_000_000),  # of .NET
        (45_000.5, "s", 0),
        (12.0, "d", 0),
    ],
)
def test_1970_in_ticks_and_days_of_a_calendar(time, unit, of_1970):
    assert units.zero(time, unit) == of_1970
