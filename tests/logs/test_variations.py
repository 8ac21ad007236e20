"""Logs as people print them, in 144 combinations of what varies: read with the numbers that were printed, or refused.

A layout is a separator with its decimal mark, a way to write the time, a counter, lines in between and a unit, drawn at
random of all 5,040 combinations.
"""

import datetime
import itertools
import random
import re

import numpy as np
import pytest

from tactile.experiments import strain, touch
from tactile.logs import parse
from tactile.logs.sniff import Proposal
from tactile.own import logs as own_logs

SETTINGS = {"ingest": {"max_reject_fraction": 0.02}}
N, COUNT = 400, 144
START = datetime.datetime(2024, 1, 12, 12, 1, 33)
T = 0.5 + 0.02 * np.arange(N)  # s
ARRAY = touch.array_format({"sensor": {"rows": 3, "cols": 3}, "ingest": {"highest_count": 1023}})
DAQ = strain.formats({"sensor": {"channels": 3}})["daq.log"]
KINDS = {  # format, readings (N, columns) in its own unit, decimals, units with their size
    "array": (ARRAY, np.rint(300 + 250 * np.sin(T[:, None] * np.arange(1, 10))), 0, {"": 1.0}),
    "cell": (touch.LOAD_CELL, 8 + 7 * np.sin(2 * T[:, None]), 5, {"": 1.0, "N": 1.0, "g": 9.80665e-3, "kg": 9.80665}),
    "strands": (DAQ, 2.5 + np.sin(T[:, None] * [1, 2, 3]), 5, {"": 1.0, "V": 1.0, "mV": 1e-3}),
}
SEPARATORS = {  # separator and decimal mark
    "comma": (",", "."),
    "semicolon": (";", "."),
    "tab": ("\t", "."),
    "blank": (" ", "."),
    "bar": ("|", "."),
    "German": (";", ","),
}


def clock(t: float) -> datetime.datetime:
    return START + datetime.timedelta(seconds=round(float(t), 6))


TIMES = {
    "us": lambda t: f"{t * 1e6:.0f}",
    "ms": lambda t: f"{t * 1e3:.0f}",
    "s": lambda t: f"{t:.3f}",
    "ISO": lambda t: clock(t).isoformat(timespec="milliseconds"),
    "date and time": lambda t: f"{clock(t):%Y-%m-%d %H:%M:%S.%f}",
    "time of day": lambda t: f"{clock(t):%H:%M:%S.%f}"[:-3],
    "seconds since 1970": lambda t: f"{clock(t).replace(tzinfo=datetime.UTC).timestamp():.3f}",
}
COUNTERS = {"none": None, "frame": lambda k: k, "of 8 bits": lambda k: k % 256}
BETWEEN = {
    "nothing": lambda k: [],
    "banner": lambda k: ["Device ready, firmware 1.4", "calibrating"] if k == 0 else [],
    "comments": lambda k: [f"# block {k // 50}"] if k % 50 == 0 else [],
    "empty lines": lambda k: [""] if k % 40 == 7 else [],
    "header": lambda k: [None] if k == 0 else [],  # names of the columns
}


def layouts(count: int = COUNT, seed: int = 0) -> list[dict[str, str]]:
    """Return layouts by what varies, drawn of all; no unit where blanks separate, as it would be a column."""
    found = [
        dict(zip(("kind", "separator", "time", "counter", "between", "unit"), values, strict=True))
        for kind in KINDS
        for values in itertools.product([kind], SEPARATORS, TIMES, COUNTERS, BETWEEN, KINDS[kind][3])
        if values[1] != "blank" or not values[-1]
    ]
    return random.Random(seed).sample(found, count)


def written(path, chosen: dict[str, str]):
    fmt, truth, decimals, units = KINDS[chosen["kind"]]
    separator, point = SEPARATORS[chosen["separator"]]
    stamp, count, unit = TIMES[chosen["time"]], COUNTERS[chosen["counter"]], chosen["unit"]
    names = ["time", *["frame"] * (count is not None)]
    names += [f"{name.partition('_')[0]}{f' [{unit}]' if unit else ''}" for name in fmt.names[1:]]
    lines = []
    for k, (t, values) in enumerate(zip(T, truth / units[unit], strict=True)):
        lines += [separator.join(names) if line is None else line for line in BETWEEN[chosen["between"]](k)]
        cells = [stamp(t).replace(".", point), *([str(count(k))] if count else [])]
        beside = f" {unit}" * bool(unit)
        cells += [f"{value:.{decimals}f}".replace(".", point) + beside for value in values]
        lines.append(separator.join(cells))
    path.write_text("\n".join(lines) + "\n")
    return path


def outcome(path, chosen: dict[str, str]) -> str:
    """Return 'read', 'wrong' with what differs, or 'refused' with the sentence."""
    fmt, truth, decimals, units = KINDS[chosen["kind"]]
    found = own_logs.proposed("touch", path, fmt, SETTINGS, None)
    if not isinstance(found, Proposal):
        return f"refused: {found}"
    if found.layout.get("rate_hz", 0) is None:
        return "refused: no times"
    rows, _ = parse.read_log(path, fmt, layout=found.layout)
    values = np.column_stack([rows[name].to_numpy() for name in fmt.names[1:]])
    time = rows[fmt.time].to_numpy() / (1e6 if fmt.time == "t_us" else 1.0)
    if len(values) != N:
        return f"wrong: {len(values)} rows of {N}"
    if not np.allclose(values, truth, atol=0.51 * 10.0**-decimals * units[chosen["unit"]], rtol=1e-6):
        return f"wrong: values {values[0]}, printed {truth[0]}, {found.layout}"
    if not np.allclose(np.diff(time), np.diff(T), atol=2e-3):
        return f"wrong: a line every {np.diff(time).mean():.4g} s, {found.layout}"
    return "read"


@pytest.mark.parametrize("part", range(4))
def test_what_is_printed_is_read_or_refused(part, tmp_path):
    """At most one of 36 is refused, by a sentence that names a line of it and its unit; no number is ever another."""
    found = {}
    for number, chosen in enumerate(layouts()[part::4]):
        found[number] = chosen, outcome(written(tmp_path / f"{number}.log", chosen), chosen)
    others = [(chosen, said) for chosen, said in found.values() if said != "read"]
    assert not [each for each in others if each[1].startswith("wrong")]
    assert len(others) <= 1, others
    assert all(re.search(rf"line \d+ has '{chosen['unit']}'", said) for chosen, said in others), others


def test_a_wrong_number_would_be_seen(tmp_path):
    chosen = layouts()[0]
    path = written(tmp_path / "a.log", chosen)
    printed = KINDS[chosen["kind"]][1]
    printed[7, 0] += 5.0
    try:
        assert outcome(path, chosen).startswith("wrong: values")
    finally:
        printed[7, 0] -= 5.0
