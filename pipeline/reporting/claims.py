"""Write the claims of all papers with their verdicts: claims.csv, claims.md, and their lines on the page."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

import pandas as pd

from pipeline.reporting.verdicts import glove as glove_verdicts
from pipeline.reporting.verdicts import strain as strain_verdicts
from pipeline.reporting.verdicts import touch as touch_verdicts
from pipeline.reporting.verdicts.rules import (
    EXPERIMENTS,
    NOT_REPRODUCED,
    NOT_TESTABLE,
    PAPERS,
    REPRODUCED,
    TOLERANCE,
    Claim,
    Evidence,
    Judgement,
)
from pipeline.reporting.words.markdown import number, size, table

RULES = (
    ("direction", "the whole 95 % interval of the difference, paired by seed, lies on the claimed side of 0"),
    ("several directions", "every one of them is; the weakest is shown"),
    ("number", f"our mean is within {100 * TOLERANCE:.0f} % of the published one, whatever the interval"),
    ("no difference, no increase", "the whole interval lies inside, or below, the margin that is named"),
    ("count", "equal at the precision that is printed"),
    ("measured time", f"the ratio of medians is more than {100 * TOLERANCE:.0f} % on the claimed side of 1"),
)
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


def all_claims() -> list[Claim]:
    """List the claims of all papers."""
    return [*touch_verdicts.claims(), *strain_verdicts.claims(), *glove_verdicts.claims()]


def on_own_logs(claim: Claim, values: Mapping) -> Claim:
    """Return the claim as it stands where params.yaml names the user's own logs in place of the simulator."""
    if claim.data == "recorded" or values[EXPERIMENTS[claim.paper]]["source"] == "simulated":
        return claim
    return replace(claim, data="recorded", why=None)  # what was tried was tried on the simulated scene


def rows(verdicts: list[tuple[Claim, Judgement]]) -> pd.DataFrame:
    """Return claims.csv."""
    return pd.DataFrame(
        {
            "claim": claim.text,
            "paper": claim.paper,
            "section": claim.section,
            "data": claim.data,
            "published": claim.published,
            "ours": judged.ours,
            "low": judged.low,
            "high": judged.high,
            "verdict": judged.verdict,
            "reason": judged.reason,
            "key": claim.key,
            "printed": int(claim.printed),
            "unit": claim.unit,
            "over": judged.over,
            "measured": int(claim.measured),
        }
        for claim, judged in verdicts
    )


def text(verdicts: list[tuple[Claim, Judgement]], evidence: Evidence) -> str:
    """Write claims.md."""
    lines = [
        "# A verdict on every claim\n",
        "Every sentence of the papers that can be true or false of numbers, in our words, and every number of their "
        "tables. Reproduced means:\n",
        *(f"- {kind}: {rule}." for kind, rule in RULES),
        "\nIn a claim that compares, the number is the difference, in the claimed direction, unless brackets say what "
        "it is. Intervals are 95 % t intervals over seeds unless the reason names something else, and are not widened "
        "for the number of claims. With three seeds they are wide: `undecided` means that so few runs cannot tell. A "
        "claim whose runs failed, or whose recordings are not there, is not testable. Rows marked * rest on measured "
        "times and differ between runs and machines.\n",
        "## Counts\n",
        table(["Paper", "Data", "Kind", *COUNTED, "claims"], count_rows(rows(verdicts), ["paper", "data", "kind"])),
    ]
    for paper, title in PAPERS.items():
        of_paper = [(claim, judged) for claim, judged in verdicts if claim.paper == paper]
        lines.append(f"## {title}\n")
        header = ["Claim", "Section", "Data", "Published", "Ours", "Unit", "Verdict", "Reason"]
        cells = [
            [
                claim.text + (" *" if claim.measured else ""),
                claim.section,
                claim.data,
                value_text(claim.published, claim.unit),
                ours_text(*judged[:3], claim.unit),
                claim.unit,
                judged.verdict,
                "; ".join(filter(None, [judged.reason, "" if judged.over.endswith(" seeds") else judged.over])),
            ]
            for claim, judged in of_paper
        ]
        lines.append(table(header, cells))
        missed: dict[str, list[str]] = {}
        for claim, judged in of_paper:
            if judged.verdict == NOT_REPRODUCED:
                mark = " [recorded]" if claim.data == "recorded" else ""
                head = f"**{claim.text.rstrip('.')}**{mark} ({judged.reason})"
                missed.setdefault(claim.explained(evidence), []).append(head)
        if missed:
            lines.append(f"### {title}: what was tried where a claim is not reproduced\n")
        for why, heads in missed.items():
            lines.append("\n".join([*(f"- {head}" for head in heads), f"\n{why}\n"]))
    return "\n".join(lines).rstrip("\n") + "\n"
