"""Tables and numbers in Markdown that also read well as raw text. Scores are rounded here, nowhere else."""

import re
from collections.abc import Sequence

import numpy as np

from pipeline.scoring.results import Estimate


def table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A table with padded columns: the first to the left, the others to the right; `|` in a cell is no border."""
    header, *rows = ([cell.replace("|", r"\|") for cell in row] for row in [header, *rows])
    widths = [max(len(row[k]) for row in [header, *rows]) for k in range(len(header))]
    dashes = ["-" * widths[0], *("-" * (width - 1) + ":" for width in widths[1:])]
    lines = []
    for row in [header, dashes, *rows]:
        first, *others = (
            cell.ljust(width) if k == 0 else cell.rjust(width)
            for k, (cell, width) in enumerate(zip(row, widths, strict=True))
        )
        lines.append("| " + " | ".join([first, *others]) + " |")
    return "\n".join(lines) + "\n"


def literal(name: str) -> str:
    """A name that a user chose, as it is: none of its characters has a meaning in Markdown. For a line's middle."""
    return re.sub(r"([\\`*_\[\]<>&$~])", r"\\\1", name)


def code(name: str) -> str:
    """A name that a user chose, as a code span, whatever backquotes are in it."""
    fence = "`" * (1 + max(map(len, re.findall("`+", name)), default=0))
    space = " " if "`" in name else ""
    return f"{fence}{space}{name}{space}{fence}"


def number(value: float, digits: int = 2) -> str:
    """Fixed decimals up to 100,000, above that three digits and a power of ten; a dash for NaN."""
    if np.isnan(value):
        return "-"
    value = round(value, digits) + 0.0  # no -0.00
    return f"{value:.{digits}f}" if abs(value) < 1e5 else f"{value:.2e}"


def interval(estimate: Estimate, digits: int = 2) -> str:
    """`mean [low, high]`; only the mean of a single run; a failure is said, never left out."""
    text = number(estimate.mean, digits)
    if estimate.runs > 1:
        text += f" [{number(estimate.low, digits)}, {number(estimate.high, digits)}]"
    if estimate.failed:
        total = estimate.runs + estimate.failed
        failure = f"failed ({estimate.failed} of {total} runs)"
        return f"{failure}; others {text}" if estimate.runs else failure
    return text


def size(value: float) -> str:
    """A count with thousands separators, or `not counted`."""
    return "not counted" if np.isnan(value) else f"{round(value):,}"
