"""Put the faults that serial lines suffer on their way into a log at known places.

The simulator writes down every fault (`faults.csv`), so that tests can compare the rejects table with it.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np


class Fault(NamedTuple):
    """One injected fault: 1-based line number in the written file (a missing line: the line it should follow)."""

    line: int
    kind: str


def inject(lines: Sequence[str], rates: Mapping[str, float], rng: np.random.Generator) -> tuple[list[str], list[Fault]]:
    """Return `lines` (comma-separated numbers, time first) with faults at the given rates, and the faults.

    rates: torn, duplicated, missing, out_of_range, out_of_order (each the probability per line). The first
    two and last two lines stay whole, so that the log spans the time that the device saw.
    """
    kinds = ("torn", "duplicated", "missing", "out_of_range", "out_of_order")
    edges = np.cumsum([rates[kind] for kind in kinds])
    fate = np.searchsorted(edges, rng.random(len(lines)), side="right")
    fate[:2] = fate[-2:] = len(kinds)
    written: list[str] = []
    faults: list[Fault] = []
    held = None  # a line that arrives one place late
    for line, which in zip(lines, fate, strict=True):
        kind = kinds[which] if which < len(kinds) and held is None else None
        if kind == "out_of_order":
            held = line
            continue
        if kind == "missing":
            faults.append(Fault(len(written), kind))
            continue
        if kind == "torn":
            # Cut before the last separator: a cut inside the last number could leave a valid line.
            written.append(line[: rng.integers(1, line.rindex(",") + 1)])
            faults.append(Fault(len(written), kind))
            continue
        if kind == "out_of_range":
            written.append(line[: line.rindex(",") + 1] + "99999")
            faults.append(Fault(len(written), kind))
            continue
        written.append(line)
        if kind == "duplicated":
            written.append(line)
            faults.append(Fault(len(written), kind))
        if held is not None:
            written.append(held)
            faults.append(Fault(len(written), "out_of_order"))
            held = None
    return written, faults
