"""Write the claims of all papers with their verdicts: claims.csv, claims.md, and their lines on the page."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

import pandas as pd

from pipeline.reporting.verdicts import glove as glove_verdicts
from pipeline.reporting.verdicts import strain as strain_verdicts
from pipeline.reporting.verdicts import touch as touch_verdicts
from pipeline.reporting.verdicts.rules import (
    AGREEMENT,
    BAND,
    CONTRADICTED,
    EXPERIMENTS,
    NUMBER,
    PAPERS,
    SENTENCE,
    TOLERANCE,
    UNDECIDED,
    VERDICTS,
    Claim,
    Evidence,
    Judgement,
)
from pipeline.reporting.words.markdown import number, size, table

RULES = (
    ("direction", "the difference, paired by seed, is on the claimed side of 0, or of the limit that is named"),
    ("several directions", "every one of them is; contradicted, if one is not; the weakest is shown"),
    ("order", f"more than {100 * AGREEMENT:.0f} % of the pairs come in the printed order"),
    (
        "number",
        f"our error is within {100 * BAND:.0f} % of the printed one (of a precision of 95 %, the error is 5 points)",
    ),
    ("no difference, no increase", "the value is inside, or below, the margin that is named"),
    ("count", "equal at the precision that is printed"),
    ("measured time", f"the ratio of medians is more than {100 * TOLERANCE:.0f} % on the claimed side of 1"),
)
COUNTED = (SENTENCE, NUMBER)  # kinds


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

    claims: rows of claims.csv, of which those of the kinds COUNTED are; by: paper, data, kind or some of them. Each row
    has the names of its group, a count per verdict, and the number of claims.
    """
    claims = claims[claims["kind"].isin(COUNTED)].assign(paper=lambda table: table["paper"].map(PAPERS))
    groups = [*claims.groupby(list(by), sort=False), (["All", *[""] * (len(by) - 1)], claims)]
    rows = []
    for names, group in groups:
        verdicts = list(group["verdict"])
        rows.append([*names, *map(str, (*map(verdicts.count, VERDICTS), len(verdicts)))])
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
            "id": claim.id,
            "claim": claim.text,
            "paper": claim.paper,
            "section": claim.section,
            "data": claim.data,
            "kind": claim.kind,
            "published": claim.published,
            "ours": judged.ours,
            "low": judged.low,
            "high": judged.high,
            "unit": claim.unit,
            "verdict": judged.verdict,
            "strict": judged.strict,
            "compatible": {None: "", True: "yes", False: "no"}[judged.compatible],
            "reason": judged.reason,
            "over": judged.over,
            "measured": int(claim.measured),
        }
        for claim, judged in verdicts
    )


def reason_text(judged: Judgement) -> str:
    """Return a verdict's reason, with what its interval is over where that is not seeds."""
    over = "" if judged.over.endswith(" seeds") else judged.over
    compatible = {None: "", True: "compatible with the paper", False: "not compatible with the paper"}
    return "; ".join(filter(None, [judged.reason, over, compatible[judged.compatible]]))


def text(verdicts: list[tuple[Claim, Judgement]], evidence: Evidence) -> str:
    """Write claims.md."""
    lines = [
        "# A verdict on every claim\n",
        "Every sentence of the papers that can be true or false of numbers, in our words, and every number of their "
        "tables. A rule asks where our 95 % interval lies: all of it where the claim says, `reproduced`; all of it "
        "elsewhere, `contradicted`; partly here, partly there, `undecided`: so few runs cannot tell. By kind of "
        "claim:\n",
        *(f"- {kind}: {rule}." for kind, rule in RULES),
        "\nIn a claim that compares, the number is the difference, in the claimed direction, unless brackets say what "
        "it is. Intervals are t intervals over seeds unless the reason names something else, and are not widened for "
        "the number of claims. A paper printed single numbers: a difference is `compatible` where our interval "
        "includes the printed one. A printed number is judged on the split that the paper used, as far as its text "
        "says; `strict` is the verdict on the stricter one, where nothing is on two sides. A claim whose runs failed, "
        "or whose recordings are not there, is `not testable`. Not counted are counts of operations and parameters, "
        "claims that hold by construction of a scene, and the numbers that a scene was tuned to (`calibrated`). Rows "
        "marked * rest on measured times and differ between runs and machines.\n",
        "## Counts\n",
        table(["Paper", "Data", "Kind", *VERDICTS, "claims"], count_rows(rows(verdicts), ["paper", "data", "kind"])),
    ]
    for paper, title in PAPERS.items():
        of_paper = [(claim, judged) for claim, judged in verdicts if claim.paper == paper]
        lines.append(f"## {title}\n")
        header = ["Claim", "Section", "Data", "Kind", "Published", "Ours", "Unit", "Verdict", "Strict", "Reason"]
        cells = [
            [
                claim.text + (" *" if claim.measured else ""),
                claim.section,
                claim.data,
                claim.kind,
                value_text(claim.published, claim.unit),
                ours_text(*judged[:3], claim.unit),
                claim.unit,
                judged.verdict,
                judged.strict or "-",
                reason_text(judged),
            ]
            for claim, judged in of_paper
        ]
        lines.append(table(header, cells))
        missed: dict[str, list[str]] = {}
        for claim, judged in of_paper:
            if judged.verdict in (CONTRADICTED, UNDECIDED):
                mark = " [recorded]" if claim.data == "recorded" else ""
                head = f"**{claim.text.rstrip('.')}**{mark} ({judged.verdict}; {judged.reason})"
                missed.setdefault(claim.explained(evidence), []).append(head)
        if missed:
            lines.append(f"### {title}: what was tried where a claim is not reproduced\n")
        for why, heads in missed.items():
            lines.append("\n".join([*(f"- {head}" for head in heads), f"\n{why}\n"]))
    return "\n".join(lines).rstrip("\n") + "\n"
