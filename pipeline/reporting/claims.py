"""Say how a claim's numbers and the counts of verdicts read, in reports/claims.md and on the reviewer's page."""

from collections.abc import Iterable, Sequence

import pandas as pd

from pipeline.reporting.verdicts.rules import NOT_REPRODUCED, NOT_TESTABLE, PAPERS, REPRODUCED, Claim, Evidence
from pipeline.reporting.words.markdown import number, size

VERDICTS = (REPRODUCED, NOT_REPRODUCED, NOT_TESTABLE)
COUNTED = (*VERDICTS, "of not reproduced: undecided")  # columns of a table of counts


def is_undecided(verdict: str, reason: str) -> bool:
    """Tell whether a claim is not reproduced for want of runs alone."""
    return verdict == NOT_REPRODUCED and "undecided" in reason and "contradicted" not in reason


def kind(printed: bool) -> str:
    """Return the kind of a claim; printed: whether it repeats a number of a table."""
    return "number of a table" if printed else "sentence"


def value_text(value: float, unit: str) -> str:
    """Return a claim's number, rounded; a dash for NaN."""
    if unit == "count":
        return "-" if value != value else size(value)
    return number(value, 3 if abs(value) < 1 else 2)


def ours_text(ours: float, low: float, high: float, unit: str) -> str:
    """Return our value with its interval, if there is one."""
    text = value_text(ours, unit)
    return text if low != low else f"{text} [{value_text(low, unit)}, {value_text(high, unit)}]"


def count_rows(claims: pd.DataFrame, by: Sequence[str]) -> list[list[str]]:
    """Return the rows of a table of counts, the last one of all claims together.

    claims: rows of claims.csv; by: paper, data, kind or some of them. Each row has the names of its group, a count per
    verdict, how many of those not reproduced are undecided, and the number of claims.
    """
    claims = claims.assign(paper=claims["paper"].map(PAPERS), kind=claims["printed"].map(kind))
    groups = [*claims.groupby(list(by), sort=False), (["All", *[""] * (len(by) - 1)], claims)]
    rows = []
    for names, group in groups:
        verdicts = list(group["verdict"])
        undecided = sum(map(is_undecided, verdicts, group["reason"]))
        rows.append([*names, *map(str, (*map(verdicts.count, VERDICTS), undecided, len(verdicts)))])
    return rows


def claim_sentences(claims: Iterable[Claim], keys: Iterable[str], evidence: Evidence) -> list[str]:
    """Return a line per claim, in the order of `keys`: our number, the published one, and the verdict of claims.csv."""
    by_key = {claim.key: claim for claim in claims}
    return [claim_sentence(by_key[key], evidence) for key in keys]


def claim_sentence(claim: Claim, evidence: Evidence) -> str:
    """Return the line of one claim."""
    judged = claim.judged(evidence)
    numbers = ""
    if judged.ours == judged.ours:
        unit = f" {claim.unit}" if claim.unit not in ("1", "count") else ""
        paper = f" (paper: {value_text(claim.published, claim.unit)})" if claim.published == claim.published else ""
        numbers = f" {ours_text(*judged[:3], claim.unit)}{unit}{paper}:"
    reason = f" ({judged.reason})" if judged.reason else ""
    return f"- {claim.text.rstrip('.')}:{numbers} {judged.verdict}{reason}."
