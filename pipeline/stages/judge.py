"""Stage: a verdict on every claim of the three papers.

Writes reports/claims.csv, one row a claim in full precision, and reports/claims.md, which says the same to people and,
for each claim that is not reproduced, what was tried to find the reason.
Usage: python -m pipeline.stages.judge
"""

from collections.abc import Mapping
from dataclasses import replace

import pandas as pd

from pipeline.base import files, params, paths
from pipeline.base.errors import run_stage
from pipeline.reporting.claims import COUNTED, VERDICTS, count_rows, ours_text, value_text
from pipeline.reporting.markdown import table
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
    """The claims of all papers."""
    return [*touch_verdicts.claims(), *strain_verdicts.claims(), *glove_verdicts.claims()]


def on_own_logs(one: Claim, values: Mapping) -> Claim:
    """The claim as it stands where params.yaml names a folder of the user's own logs in place of the simulator."""
    if one.data == "recorded" or values[EXPERIMENTS[one.paper]]["source"] == "simulated":
        return one
    return replace(one, data="recorded", why=None)  # what was tried was tried on the simulated scene


def rows(found: list[tuple[Claim, Judgement]]) -> pd.DataFrame:
    """claims.csv."""
    return pd.DataFrame(
        [
            (
                *(one.text, one.paper, one.section, one.data, one.published),
                *(judged.ours, judged.low, judged.high, judged.verdict, judged.reason),
                *(one.key, int(one.printed), one.unit, judged.over, int(one.measured)),
            )
            for one, judged in found
        ],
        columns=COLUMNS,
    )


def text(found: list[tuple[Claim, Judgement]], evidence: Evidence) -> str:
    """claims.md."""
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
        table(["Paper", "Data", "Kind", *COUNTED, "claims"], count_rows(rows(found), ["paper", "data", "kind"])),
    ]
    for paper, title in PAPERS.items():
        own = [(one, judged) for one, judged in found if one.paper == paper]
        lines.append(f"## {title}\n")
        header = ["Claim", "Section", "Data", "Published", "Ours", "Unit", "Verdict", "Reason"]
        cells = [
            [
                one.text + (" *" if one.measured else ""),
                one.section,
                one.data,
                value_text(one.published, one.unit),
                ours_text(*judged[:3], one.unit),
                one.unit,
                judged.verdict,
                "; ".join(filter(None, [judged.reason, "" if judged.over.endswith(" seeds") else judged.over])),
            ]
            for one, judged in own
        ]
        lines.append(table(header, cells))
        missed: dict[str, list[str]] = {}
        for one, judged in own:
            if judged.verdict == NOT_REPRODUCED:
                mark = " [recorded]" if one.data == "recorded" else ""
                head = f"**{one.text.rstrip('.')}**{mark} ({judged.reason})"
                missed.setdefault(one.explained(evidence), []).append(head)
        if missed:
            lines.append(f"### {title}: what was tried where a claim is not reproduced\n")
        for why, heads in missed.items():
            lines.append("\n".join([*(f"- {head}" for head in heads), f"\n{why}\n"]))
    return "\n".join(lines).rstrip("\n") + "\n"


def main() -> None:
    """Judge all claims by what the stages wrote."""
    values = params.load()
    evidence = Evidence(values)
    found = [(one, one.judged(evidence)) for one in (on_own_logs(one, values) for one in all_claims())]
    files.write_table(paths.REPORTS / "claims.csv", rows(found))
    files.write_text(paths.REPORTS / "claims.md", text(found, evidence))
    verdicts = [judged.verdict for _, judged in found]
    print(f"{len(found)} claims: {', '.join(f'{verdicts.count(v)} {v}' for v in VERDICTS)}")


if __name__ == "__main__":
    run_stage(main)
