"""The units that stand with readings, wherever: in names such as `Fz (lbf)` or `u0_mv`, behind a number, in a column.

A unit that is written down says more than the size of the values: a force of 3.3 may be in lbf, kgf or N.
"""

import functools
import re
from collections.abc import Sequence
from typing import NamedTuple

from tactile.base.errors import InputError
from tactile.logs.formats import Column

SIZES = {  # quantity -> unit -> its size; exact, by the international pound and inch and standard gravity
    "force": {"N": 1, "mN": 1e-3, "kN": 1e3, "MN": 1e6, "uN": 1e-6, "cN": 1e-2, "daN": 10, "dyn": 1e-5}
    | dict.fromkeys(("lbf", "lb"), 4.4482216152605)
    | dict.fromkeys(("ozf", "oz"), 0.27801385095378125)
    | dict.fromkeys(("kgf", "kg"), 9.80665)
    | dict.fromkeys(("gf", "g"), 9.80665e-3)
    | dict.fromkeys(("mgf", "mg"), 9.80665e-6)
    | {"tonne": 9806.65},
    "length": {"mm": 1, "cm": 10, "dm": 100, "m": 1000, "um": 1e-3}
    | {"in": 25.4, "inch": 25.4, "ft": 304.8, "mil": 0.0254, "thou": 0.0254},
    "voltage": {"V": 1, "mV": 1e-3, "uV": 1e-6, "nV": 1e-9, "kV": 1e3, "MV": 1e6},
    "resistance": {"ohm": 1, "mohm": 1e-3, "kohm": 1e3, "Mohm": 1e6},
    "time": {"ns": 1, "us": 1e3, "ms": 1e6, "s": 1e9, "min": 6e10, "h": 3.6e12, "d": 8.64e13, "100ns": 100},
    "angle": {"deg": 1, "rad": 57.29577951308232, "mrad": 0.05729577951308232},
    "pressure": {"kPa": 1e3, "Pa": 1, "hPa": 1e2, "MPa": 1e6, "bar": 1e5, "mbar": 1e2, "psi": 6894.757293168361}
    | {"mmHg": 133.322387415, "N/mm2": 1e6, "N/cm2": 1e4},
}
SIGNS = str.maketrans(
    {"\u00b5": "u", "\u03bc": "u", "\u03a9": "ohm", "\u2126": "ohm", "\u00b0": "deg", "\u00b2": "2", "\u2033": '"'}
)
_PREFIXES = {"": "", "milli": "m", "micro": "u", "nano": "n", "kilo": "k", "centi": "c", "mega": "M"}
_IN_FULL = {"newton": "N", "meter": "m", "metre": "m", "gram": "g", "volt": "V", "ohm": "ohm", "second": "s"}
OTHERWISE = {
    "sec": "s", "secs": "s", "msec": "ms", "msecs": "ms", "usec": "us", "usecs": "us", "nsec": "ns", "nsecs": "ns",
    "millis": "ms", "micros": "us", "mins": "min", "minute": "min", "minutes": "min", "hr": "h", "hrs": "h",
    "hour": "h", "hours": "h", "day": "d", "days": "d", "100 ns": "100ns",
    "lbs": "lb", "pound": "lb", "pounds": "lb", "ounce": "oz", "ounces": "oz", "lb-f": "lbf", "kg-f": "kgf",
    "inches": "inch", "\"": "inch", "foot": "ft", "feet": "ft", "mils": "mil", "micron": "um", "microns": "um",
    "tonnes": "tonne",
    "dyne": "dyn", "dynes": "dyn", "volts": "V", "degree": "deg", "degrees": "deg", "radians": "rad", "radian": "rad",
}  # fmt: skip
OTHERWISE |= {
    f"{long}{word}{plural}": prefix + unit
    for word, unit in _IN_FULL.items()
    for long, prefix in _PREFIXES.items()
    for plural in ("", "s")
    if any(prefix + unit in sizes for sizes in SIZES.values())
}
KNOWN = {unit: quantity for quantity, sizes in SIZES.items() for unit in sizes}
ANY_CASE = {unit.lower(): unit for unit in reversed(KNOWN)} | OTHERWISE  # mN before MN
_OF_LETTERS = [
    unit
    for unit in (*ANY_CASE, "\u00b5m", "\u03bcm", "\u00b5v", "\u03bcv", "m\u03a9", "k\u03a9")
    if len(unit) > 1 and unit.isalpha()
]
# behind a number without a blank
ATTACHED = rf"(?i:{'|'.join(sorted(_OF_LETTERS, key=len, reverse=True))})|[NVmgsh\u03a9\u2126]"
_DAY_S, _CENTURY_S = 86_400, 36_525 * 86_400
ABSOLUTE = (  # unit, what the time then is, seconds from its zero to 2000-01-01
    ("s", "seconds since 1970", 946_684_800),
    ("ms", "milliseconds since 1970", 946_684_800),
    ("us", "microseconds since 1970", 946_684_800),
    ("ns", "nanoseconds since 1970", 946_684_800),
    ("100ns", "ticks of 100 ns since the year 1 (.NET)", 730_119 * _DAY_S),
    ("100ns", "ticks of 100 ns since 1601 (FILETIME)", 145_731 * _DAY_S),
    ("d", "days as Excel counts them", 36_526 * _DAY_S),
    ("d", "days as MATLAB counts them (datenum)", 730_486 * _DAY_S),
    ("s", "seconds since 1904 (LabVIEW)", 35_064 * _DAY_S),
    ("s", "seconds of GPS", 7_300 * _DAY_S),
)
PLAUSIBLE_S = (1 / 5000, 5.0)  # between two lines
NO_UNIT = ("", "1", "any", "counts")  # of columns whose readings may be in anything
NO_UNITS_OF_TIME = re.compile(  # what brackets behind a time say beside a unit: a zone, a zero
    r"(utc|gmt|z|local( time)?|unix|posix|epoch|since .*|[a-z]{1,4}[sd]t|cet|cest|wet|[a-z]+/[a-z_]+)?"
    r"([+-][0-9]{1,2}(:?[0-9]{2})?)?",
    re.IGNORECASE,
)
WORDS = (
    "in",
    "m",
    "s",
    "g",
    "h",
    "d",
    "min",
    "mil",
    "ft",
)  # after a blank or an underscore also a word or an index, unless of the right quantity
BRACKETED = re.compile(r"[\[(]\s*([^\[\]()]*?)\s*[\])]\s*$")
ENDING = re.compile(r"(?<=[^\W_])[ _/]+([^\W\d_]+)$")
INDEX = re.compile(r"\d*|f?[xyz]", re.IGNORECASE)  # pose[0], pos (x)


@functools.lru_cache(10_000)
def known(text: str) -> str | None:
    """Return the unit that a text is, as SIZES has it; None for one that is not in there.

    Its first letter tells mV from MV; beyond that capitals do not count.
    """
    text = text.translate(SIGNS).strip(" .")
    if text in KNOWN:
        return text
    alike = (unit for unit in KNOWN if unit[0] == text[:1] and unit.lower() == text.lower())
    return next(alike, ANY_CASE.get(text.lower()))


def quantity(text: str) -> str | None:
    """Return what a unit measures, as SIZES has it; None for a text that is no known unit."""
    unit = known(text)
    return KNOWN[unit] if unit else None


def bracketed(name: str) -> str | None:
    """Return the text in brackets at the end of a name, which is a unit, known or not; None without."""
    found = BRACKETED.search(name)
    return None if found is None or INDEX.fullmatch(found[1]) else found[1]


def named(name: str, wanted: str) -> str | None:
    """Return the unit at the end of a column's name, as it is written there; None for a name that holds none.

    wanted: the unit of the column.
    """
    if (text := bracketed(name)) is not None:
        return text
    if (ending := ENDING.search(name.strip())) is None:
        return None
    unit = known(ending[1])
    if not unit or (unit in WORDS and KNOWN[unit] != quantity(wanted)):
        return None
    return ending[1]


def factor(said: str | None, column: Column, where: str) -> float | None:
    """Return the factor from a unit that is written with a column to the column's own; None where there is none.

    where: the begin of a sentence, which says file, line and what is written there. Raises InputError for a unit that
    cannot be converted.
    """
    if said is None or column.unit in NO_UNIT:
        return None
    unit, wanted = known(said), known(column.unit)
    if quantity(column.unit) == "time" and unit is None:
        if NO_UNITS_OF_TIME.fullmatch(said):
            return None
        unit = known(re.split(r"[\s,;]", said)[0])  # ms since start
    if unit is None or wanted is None or KNOWN[unit] != KNOWN[wanted]:
        what = f"a unit of {KNOWN[unit]}" if unit else "no unit that is known here"
        expected = f"expected {column.unit}, or {_listed(wanted)}" if wanted else f"expected {column.unit}"
        key = "`time_unit`" if column.unit in SIZES["time"] else f"the factor to {column.unit} as `scale`"
        raise Unit(
            f"{where} for {column.name}, but '{said}' is {what} ({expected}); write {key} into the block of this log, "
            "of `ingest.format` in settings.yaml or of origin.yaml, if only the word is wrong or the factor is known; "
            "else convert the readings and the word"
        )
    sizes = SIZES[KNOWN[wanted]]
    return float(f"{sizes[unit] / sizes[wanted]:.15g}")


class Unit(InputError):
    """A unit that is written in a log is another than that which its readings are read in."""


def check(said: str | None, column: Column, where: str) -> None:
    """Raise Unit where a unit is written with a column that is another than the column's own; where: as of `factor`."""
    size = factor(said, column, where)
    if said is not None and size not in (None, 1):
        key = f"scale: {size:.15g}" if quantity(column.unit) != "time" else f"time_unit: {of_time(said)}"
        raise Unit(
            f"{where}, but {column.name} is in {column.unit}; write `{key}` into the block of this log in "
            "`ingest.format` of settings.yaml, or convert the readings and the word"
        )


def absolute(time: float, interval: float) -> dict[str, str]:
    """Return unit -> what times are that fall between 2000 and 2100 in it, with lines a plausible time apart.

    time: of the middle of a log; interval: between its lines. Usually there is one unit or, of times with a zero of
    their own, none.
    """
    found: dict[str, str] = {}
    for unit, what, least_s in ABSOLUTE:
        second = SIZES["time"]["s"] / SIZES["time"][unit]
        in_century = least_s <= time / second <= least_s + _CENTURY_S
        if in_century and PLAUSIBLE_S[0] <= interval / second <= PLAUSIBLE_S[1]:
            found.setdefault(unit, what)
    return found


def zero(time: float, unit: str) -> int:
    """Return 1970 in ticks or days of a calendar in which a time is between 2000 and 2100; 0 of any other time."""
    second = SIZES["time"]["s"] / SIZES["time"][unit]
    for one, _, least_s in ABSOLUTE:
        if one == unit in ("100ns", "d") and least_s <= time / second <= least_s + _CENTURY_S:
            return round((least_s - ABSOLUTE[0][2]) * second)
    return 0


def of_time(said: str) -> str | None:
    """Return the unit of time that a text is or begins with."""
    return known(said) or known(re.split(r"[\s,;]", said)[0])


def of_header(names: Sequence[str], below: bool = False) -> list[str]:
    """Return the names of a header, of a line of units alone with each in brackets.

    below: it stands below another header, so that it is one of units where one of them is known.
    """
    of_units = [known(name) is not None for name in names]
    return [f"({name})" for name in names] if all(of_units) or (below and any(of_units)) else list(names)


def are_units(names: Sequence[str], below: bool) -> bool:
    """Tell whether one of the fields of a line is a unit; below: of a line below the names, where it needs no brackets.

    Above them stands a title.
    """
    return any(known(bracketed(name) or (name if below else "")) for name in names)


class Beside(NamedTuple):
    """The words that stand beside one number of a line."""

    name: str  # before it
    near: str | None  # the unit, known or not, right behind it, with nothing but blanks between
    sure: bool  # of `near`, that it can be nothing else
    behind: str | None  # a known unit as a column of its own, behind it
    ahead: str | None  # the same, before it

    def unit(self, column: Column) -> str | None:
        """Return the unit that stands with a reading of a column, as it is written there; None without."""
        wanted = quantity(column.unit)
        if self.near and (self.sure or known(self.near) not in WORDS or quantity(self.near) == wanted):
            return self.near
        fits = (text for text in (self.behind, self.ahead) if text and quantity(text) == wanted)
        return next(fits, named(self.name, column.unit))


NOTHING = Beside("", None, False, None, None)


def alike(one: str | None, other: str | None) -> bool:
    """Tell whether two known units are the same by another name, as lb and lbf."""
    if not one or not other or KNOWN[one] != KNOWN[other]:
        return False
    return SIZES[KNOWN[one]][one] == SIZES[KNOWN[other]][other]


def of_columns(found: Sequence[Beside], places: Sequence[int], columns: Sequence[Column]) -> list[str | None]:
    """Return the unit that stands with each column, as it is written there; None without.

    found: of each number of a line; places: of the columns among them. A unit that is a column of its own and fits
    neither of its neighbours belongs to the one before: it must not be overlooked.
    """
    said = [found[place].unit(column) for place, column in zip(places, columns, strict=True)]
    for k, (place, column) in enumerate(zip(places, columns, strict=True)):
        text, after = found[place].behind, place + 1
        if said[k] is None and text and len(text) > 1 and column.unit not in SIZES["time"]:
            taken = after in places and said[places.index(after)] == text
            said[k] = None if taken else text
    return said


_WORD = r"""(?:[^\W\d_]|[%\u00b0])[^\s,;|:=(){}\[\]<>"']*"""
_ATTACHED = re.compile(rf"""{_WORD}|["\u2033](?![^\W\d_])""")
_SPACED = re.compile(rf"""[ \t]+({_WORD})(?![ \t"']*[:=])""")
_ALONE = re.compile(rf"""(?:^|(?<=[,;|\t(){{}}\[\]"':=])[ ]*)({_WORD})(?=[ "')}}\]]*[,;|\t\n}}])""")
_KEY = re.compile(r"""["']?\bunits?\b["']?[ ]*[:=]""", re.IGNORECASE)
_NAME = re.compile(
    r"([^\W\d_][\w .%/-]*?(?:[ ]*[\[(][\w %/.\u00b0\u00b5\u03bc\u03a9-]*[\])])?)"
    r"""[ \t]*["']?[ \t]*[:=]?[ \t"'\[({<]*$"""
)
_LONGEST_NAME = 60  # characters


def _is_alone(text: str) -> bool:
    """Tell whether a column is a unit; a time's in small letters, for US and ST are what scales say while they move."""
    unit = known(text)
    return unit is not None and (KNOWN[unit] != "time" or text.islower())


def beside(gaps: tuple[str, ...]) -> tuple[Beside, ...]:
    """Return the words beside each of n numbers; gaps: the n + 1 texts around them.

    Of `x 1.0 m 2.0` without a word at the end, m is a name; of `1.0 m 2.0 m` it is a unit.
    """
    count = len(gaps) - 1
    gaps = tuple(_KEY.sub("", gap) for gap in gaps)
    names_first = bool(_NAME.search(gaps[0][-_LONGEST_NAME:])) and not re.match(rf"[ \t]*(?:{_WORD})", gaps[-1])
    near: list[tuple[str | None, bool]] = []
    rests = [gaps[0]]  # what is left of each gap
    for k, gap in enumerate(gaps[1:]):
        found, sure = _ATTACHED.match(gap), True
        if found and found[0] in ('"', "\u2033") and gaps[k].endswith(found[0]):
            found = None  # the number is in quotation marks
        if found is None and (spaced := _SPACED.match(gap)):
            more = re.search(r"[^\W\d_]", gap[spaced.end() :]) is not None
            sure = k == count - 1
            if sure or (known(spaced[1]) and (more or not names_first)):
                found = spaced
        near.append((found[found.lastindex or 0].strip(" .") if found else None, sure))
        rests.append(gap[found.end() :] if found else gap)
    rests[-1] += "\n"
    alone = [[text for text in _ALONE.findall(rest) if _is_alone(text)] for rest in rests]
    return tuple(
        Beside(
            found[1] if (found := _NAME.search(rests[k][-_LONGEST_NAME:])) else "",
            *near[k],
            alone[k + 1][0] if alone[k + 1] else None,
            alone[k][-1] if alone[k] else None,
        )
        for k in range(count)
    )


def _listed(wanted: str) -> str:
    """Return the other units of a quantity, for a sentence."""
    return ", ".join(unit for unit in SIZES[KNOWN[wanted]] if unit != wanted)
