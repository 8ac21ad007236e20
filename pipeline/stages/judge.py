"""Judge every claim of the three papers.

Writes reports/claims.csv, one row per claim in full precision, and reports/claims.md, which says the same to people
and, for each claim that is not reproduced, what was tried to find the reason.
Usage: python -m pipeline.stages.judge
"""

from collections.abc import Mapping
from dataclasses import replace

import pandas as pd

from pipeline.base import arguments, files, params, paths
from pipeline.base.errors import run_stage
from pipeline.reporting.claims import COUNTED, VERDICTS, count_rows, ours_text, value_text
from pipeline.reporting.verdicts import glove as glove_verdicts
from pipeline.reporting.verdicts import strain as strain_verdicts
from pipeline.reporting.verdicts import touch as touch_verdicts
from pipeline.reporting.verdicts.rules import (
    EXPERIMENTS,
    NOT_REPRODUCED,
    PAPERS,
    TOLERANCE,
    Claim,
    Evidence,
    Judgement,
)
from pipeline.reporting.words.markdown import table

COLUMNS = ["claim", "paper", "section", "data", "published", "ours", "low", "high", "verdict", "reason"]
COLUMNS += ["key", "printed", "unit", "over", "measured"]
RULES = (
    ("direction", "the whole 95 % interval of the difference, paired by seed, lies on the claimed side of 0"),
    ("several directions", "every one of them is; the weakest is shown"),
    ("number", f"our mean is within {100 * TOLERANCE:.0f} % of the published one, whatever the interval"),
    ("no difference, no increase", "the whole interval lies inside, or below, the margin that is named"),
    ("count", "equal at the precision that is printed"),
    ("measured time", f"the ratio of medians is more than {100 * TOLERANCE:.0f} % on the claimed side of 1"),
)


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


def main() -> None:
    """Judge all claims by the files that the stages wrote."""
    arguments.parse(__doc__)
    values = params.load()
    evidence = Evidence(values)
    claims = [on_own_logs(claim, values) for claim in all_claims()]
    verdicts = [(claim, claim.judged(evidence)) for claim in claims]
    files.write_table(paths.REPORTS / "claims.csv", rows(verdicts))
    files.write_text(paths.REPORTS / "claims.md", text(verdicts, evidence))
    words = [judged.verdict for _, judged in verdicts]
    print(f"{len(words)} claims: {', '.join(f'{words.count(word)} {word}' for word in VERDICTS)}")


if __name__ == "__main__":
    run_stage(main)
