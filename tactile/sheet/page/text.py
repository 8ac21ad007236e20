"""Write sheets as Markdown, one alone or several side by side, and as JSON."""

import json
from collections.abc import Sequence

import numpy as np

from tactile.drawing import templates
from tactile.drawing.markdown import literal, table
from tactile.sheet.estimates import Estimate
from tactile.sheet.quantities import QUANTITIES, Sheet


def markdown(sheets: Sequence[Sheet], figure: str = "") -> str:
    """Return the page of one sheet or of several; figure: the name of its picture, "" for none."""
    rows = [[name, *(cell(sheet.lines[name]) for sheet in sheets)] for name in QUANTITIES if len(sheets) > 1]
    return templates.render(
        templates.TEXTS,
        "sheet",
        names=[sheet.given.sensor.name for sheet in sheets],
        side_by_side=table(["Quantity", *(sheet.given.sensor.name for sheet in sheets)], rows) if rows else "",
        sheets=[(literal(sheet.given.sensor.name), *of_one(sheet)) for sheet in sheets],
        definitions=[(name, " ".join(quantity.__doc__.split())) for name, quantity in QUANTITIES.items()],
        figure=figure,
    )


def of_one(sheet: Sheet) -> tuple[list[str], str, list[tuple[str, str]]]:
    """Return what a sheet is of, its table, and what the logs cannot tell: (quantities, reason)."""
    rows = [
        [name, cell(line, interval=False), interval(line), between(line), str(line.n)]
        for name, line in sheet.lines.items()
        if np.isfinite(line.value)
    ]
    header = ["Quantity", "Value", "95 % interval", "Elements", "n"]
    reasons = dict.fromkeys(line.reason for line in sheet.lines.values() if line.reason)
    untold = [
        (", ".join(name for name, line in sheet.lines.items() if line.reason == reason), reason) for reason in reasons
    ]
    return of_what(sheet), table(header, rows), untold


def of_what(sheet: Sheet) -> list[str]:
    """Return sentences: recordings, elements, presses and the full scale."""
    given, sensor = sheet.given, sheet.given.sensor
    count = len(sensor.logs)
    recordings = "One recording" if count == 1 else f"{count} recordings"
    elements = "one element" if sensor.elements == 1 else f"{sensor.elements} elements"
    rate = 1 / given.cycles.interval_s
    said = [f"{recordings} of {elements}, {significant(rate)} readings a second, in {sensor.unit}."]
    if sensor.stimulus and np.isfinite(given.full_scale):
        said.append(
            f"The strongest presses reach {significant(given.full_scale)} {sensor.stimulus}; the sheet is of "
            f"{len(given.cycles.time_s)} that come near it from rest and go back."
        )
    if given.dead:
        listed = ", ".join(str(element) for element in given.dead)
        said.append(f"Elements that hardly answer, left out: {listed}, counted from 0.")
    return [*said, sensor.note] if sensor.note else said


def cell(line: Estimate, interval: bool = True) -> str:
    """Return a line's value with its unit, and its interval; "cannot tell" where it has none."""
    if not np.isfinite(line.value):
        return "cannot tell"
    value = f"{'' if line.told else f'{line.bound} '}{significant(line.value)} {line.unit}"
    return value + (f" {_ends(line.low, line.high)}" if interval and line.told and np.isfinite(line.low) else "")


def interval(line: Estimate) -> str:
    """Return a line's interval, or a dash."""
    return _ends(line.low, line.high) if line.told and np.isfinite(line.low) else "-"


def between(line: Estimate) -> str:
    """Return the smallest and the largest value over elements, or a dash."""
    return f"{significant(line.smallest)} to {significant(line.largest)}" if np.isfinite(line.smallest) else "-"


def _ends(low: float, high: float) -> str:
    return f"[{significant(low)}, {significant(high)}]"


def significant(value: float) -> str:
    """Return three significant digits without a power of ten."""
    rounded = float(f"{value:.3g}")
    return np.format_float_positional(rounded + 0.0, trim="-")


def as_json(sheets: Sequence[Sheet]) -> str:
    """Return the sheets, by name, in full precision; null where there is no number."""
    return json.dumps({sheet.given.sensor.name: _plain(sheet) for sheet in sheets}, indent=1)


def _plain(sheet: Sheet) -> dict:
    given, sensor = sheet.given, sheet.given.sensor
    lines = {}
    for name, line in sheet.lines.items():
        numbers = {key: _number(getattr(line, key)) for key in ("value", "low", "high", "smallest", "largest")}
        bound = "" if line.told or not np.isfinite(line.value) else line.bound
        lines[name] = numbers | {"unit": line.unit, "n": line.n, "bound": bound, "reason": line.reason}
    return {
        "unit": sensor.unit,
        "stimulus": sensor.stimulus,
        "full_scale": _number(given.full_scale),
        "recordings": len(sensor.logs),
        "elements": sensor.elements,
        "dead_elements": given.dead,
        "presses": len(given.cycles.time_s),
        "quantities": lines,
    }


def _number(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
