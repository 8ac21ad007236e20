"""Write tables and numbers in Markdown that also read well as raw text. Scores are rounded here, nowhere else.

The table is written by hand: tabulate, which pandas.to_markdown calls, leaves a `|` in a user's name as it is, where it
ends the cell.
"""

import re
from collections.abc import Sequence

import numpy as np

from tactile.scoring.estimates import R2, SHARE, Estimate, scale_of

COUNTS = ("params", "macs")  # metrics that are whole numbers


def table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return a table with padded columns: the first to the left, the others to the right; a `|` is escaped."""
    lines = [[cell.replace("|", r"\|") for cell in row] for row in [header, *rows]]
    first, *others = (max(map(len, column)) for column in zip(*lines, strict=True))
    lines.insert(1, ["-" * first, *("-" * (width - 1) + ":" for width in others)])
    template = " | ".join([f"{{:<{first}}}", *(f"{{:>{width}}}" for width in others)])
    return "".join(f"| {template.format(*line)} |\n" for line in lines)


def literal(name: str) -> str:
    """Return a name that a user chose so that none of its characters has a meaning in the middle of a line."""
    return re.sub(r"([\\`*_\[\]<>&$~])", r"\\\1", name)


def number(value: float, digits: int = 2) -> str:
    """Return fixed decimals up to 100,000, above that three digits and a power of ten; a dash for NaN."""
    if np.isnan(value):
        return "-"
    value = round(value, digits) + 0.0  # no -0.00
    return f"{value:.{digits}f}" if abs(value) < 1e5 else f"{value:.2e}"


def interval(estimate: Estimate, digits: int = 2) -> str:
    """Return `mean [low, high]`, or only the mean where there is no interval; a failure is said, never left out."""
    text = number(estimate.mean, digits)
    if not np.isnan(estimate.low):
        text += f" [{number(estimate.low, digits)}, {number(estimate.high, digits)}]"
    if estimate.failed:
        total = estimate.runs + estimate.failed
        failure = f"failed ({estimate.failed} of {total} runs)"
        return f"{failure}; others {text}" if estimate.runs else failure
    return text


def size(value: float) -> str:
    """Return a count with thousands separators; a dash for NaN."""
    return "-" if np.isnan(value) else f"{round(value):,}"


def score(value: Estimate, metric: str, digits: int = 2, percent: bool = False, runs: int = 0) -> str:
    """Return the estimate of a metric as words; a failed run is said, and where fewer than `runs` were made, how many.

    digits: of all but shares and R2, which have three where they are not in percent.
    """
    if not value.runs + value.failed:
        return "not run"
    if metric in COUNTS and value.runs:
        return size(value.mean)
    digits = digits if percent or scale_of(metric) not in (SHARE, R2) else 3
    said = interval(value.percent() if percent else value, digits)
    return said if value.runs + value.failed >= runs else f"{said}, of {value.runs + value.failed}"
