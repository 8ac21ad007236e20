"""The units that names of columns hold, such as `Fz (lbf)`, `x [in]` or `u0_mv`, and their factors to those of a log.

The name of a column says more than the size of its values: a force of 3.3 may be in lbf, kgf or N.
"""

import re
from collections.abc import Sequence

from pipeline.base.errors import InputError
from pipeline.logs.formats import Column

SIZES = {  # quantity -> unit -> its size; exact, by the international pound and inch and standard gravity
    "force": {"N": 1, "mN": 1e-3, "kN": 1e3, "MN": 1e6, "lbf": 4.4482216152605, "lb": 4.4482216152605}
    | dict.fromkeys(("kgf", "kg"), 9.80665)
    | dict.fromkeys(("gf", "g"), 9.80665e-3),
    "length": {"mm": 1, "cm": 10, "m": 1000, "in": 25.4, "inch": 25.4, "um": 1e-3},
    "voltage": {"V": 1, "mV": 1e-3, "uV": 1e-6, "MV": 1e6},
    "resistance": {"ohm": 1, "kohm": 1e3, "Mohm": 1e6},
    "time": {"ns": 1, "us": 1e3, "ms": 1e6, "s": 1e9},
    "angle": {"deg": 1, "rad": 57.29577951308232},
    "pressure": {"kPa": 1e3, "Pa": 1, "hPa": 1e2, "MPa": 1e6, "bar": 1e5, "psi": 6894.757293168361},
}
SIGNS = str.maketrans({"\u00b5": "u", "\u03bc": "u", "\u03a9": "ohm", "\u2126": "ohm", "\u00b0": "deg"})
OTHERWISE = {"sec": "s", "seconds": "s", "lbs": "lb", "inches": "inch", "newtons": "N", "volts": "V", "degrees": "deg"}
KNOWN = {unit: quantity for quantity, sizes in SIZES.items() for unit in sizes}
ANY_CASE = {unit.lower(): unit for unit in reversed(KNOWN)} | OTHERWISE  # mN before MN
NO_UNIT = ("", "1", "any", "counts")  # of columns whose readings may be in anything
WORDS = ("in", "m", "s", "g")  # after a blank or an underscore also a word or an index, unless of the right quantity
BRACKETED = re.compile(r"[\[(]\s*([^\[\]()]*?)\s*[\])]\s*$")
ENDING = re.compile(r"(?<=[^\W_])[ _/]+([^\W\d_]+)$")
INDEX = re.compile(r"\d*|f?[xyz]", re.IGNORECASE)  # pose[0], pos (x)


def known(text: str) -> str | None:
    """Return the unit that a text is, as SIZES has it; None for one that is not in there."""
    text = text.translate(SIGNS)
    return text if text in KNOWN else ANY_CASE.get(text.lower())


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
    ending = ENDING.search(name.strip())
    unit = ending and known(ending[1])
    if not unit or (unit in WORDS and KNOWN[unit] != KNOWN.get(known(wanted))):
        return None
    return ending[1]


def factor(name: str, column: Column, where: str) -> float | None:
    """Return the factor from the unit that a column's name holds to the column's own; None where it holds none.

    Raises InputError, in a sentence that `where` begins (file and line), for a unit that cannot be converted.
    """
    said = None if column.unit in NO_UNIT else named(name, column.unit)
    if said is None or said == column.unit:
        return None if said is None else 1
    unit, wanted = known(said), known(column.unit)
    if unit is None and KNOWN.get(wanted) == "time":  # Time (UTC)
        return None
    if unit is None or wanted is None or KNOWN[unit] != KNOWN[wanted]:
        what = f"a unit of {KNOWN[unit]}" if unit else "no unit that is known here"
        expected = f"expected {column.unit}, or {_listed(wanted)}" if wanted else f"expected {column.unit}"
        raise InputError(
            f"{where} names the column '{name}' for {column.name}, but '{said}' is {what} ({expected}); convert the "
            f"readings and rename the column, or rename it alone if only its name is wrong"
        )
    sizes = SIZES[KNOWN[wanted]]
    return float(f"{sizes[unit] / sizes[wanted]:.15g}")


def check(name: str, column: Column, where: str) -> None:
    """Raise InputError where a name holds another unit than that of its column; where: as of `factor`."""
    size = factor(name, column, where)
    if size not in (None, 1):
        unit = known(named(name, column.unit))
        key = f"time_unit: {unit}" if KNOWN[unit] == "time" else f"scale: {size:.15g}"
        raise InputError(
            f"{where} names the column '{name}', but {column.name} is in {column.unit}; write `{key}` into the block "
            "of this log in `ingest.format` of settings.yaml, or convert the readings and rename the column"
        )


def of_header(names: Sequence[str]) -> list[str]:
    """Return the names of a header, of a line of units alone with each in brackets."""
    return [f"({name})" for name in names] if all(map(known, names)) else list(names)


def _listed(wanted: str) -> str:
    """Return the other units of a quantity, for a sentence."""
    return ", ".join(unit for unit in SIZES[KNOWN[wanted]] if unit != wanted)
