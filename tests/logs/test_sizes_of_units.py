"""Sizes of units against numbers written out by hand: an oracle that is the code's own table finds no fault in it.

By the International Yard and Pound Agreement (1 lb = 0.45359237 kg, 1 in = 25.4 mm), standard gravity (9.80665 m/s2,
CGPM 1901) and NIST Special Publication 811, appendix B.
"""

import datetime
import math

import pytest

from pipeline.logs import units

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
