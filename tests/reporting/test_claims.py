"""What the reports say of claims."""

import re

import numpy as np
import pandas as pd
import pytest
from builders.project import ROOT

from pipeline.claims import entries, judge
from pipeline.reporting import claims, texts
from tactile.base import params

COLUMNS = ["id", "kind", "data", "verdict", "ours"]
CLAIMS = pd.DataFrame(
    [
        ("lomp/a", "sentence", "simulated", "undecided", 1.0),
        ("lomp/b", "sentence", "simulated", "reproduced", 2.0),
        ("lomp/c", "number", "simulated", "off", 3.0),
        ("lomp/a/recorded", "sentence", "recorded", "contradicted", 4.0),
        ("lomp/d", "number", "simulated", "calibrated", 5.0),
        ("lomp/e", "number", "simulated", "outside", 6.0),
        ("lomp/f", "count", "simulated", "reproduced", 7.0),
        ("lomp/g", "beyond", "simulated", "beyond", 8.0),
    ],
    columns=COLUMNS,
)


def test_recorded_claims_are_counted_before_simulated_ones_and_apart(workspace):
    rows = claims.count_rows(workspace, CLAIMS.assign(paper="lomp"), ["paper"])
    assert [row[:2] for row in rows] == [
        ["recorded", "LoMP (touch)"],
        ["recorded", "all"],
        ["simulated", "LoMP (touch)"],
        ["simulated", "all"],
        ["all", ""],
    ]
    assert [row[-1] for row in rows] == ["1", "1", "3", "3", "4"]


def test_on_own_logs_a_claim_is_of_recorded_data(workspace):
    values = params.load(ROOT / "params.yaml")
    claim, *_ = entries.read(workspace)[0]
    assert judge.on_own_logs(claim, values) == claim and claim.data == "simulated"
    own = judge.on_own_logs(claim, {"touch": {"source": "data/own/mine"}})
    assert (own.id, own.data, own.tried) == (f"{claim.id}/recorded", "recorded", "")


@pytest.mark.parametrize(
    ("numbers", "reason", "row"),
    [
        ((1.5, -4.85, 7.85, 1.5), "why", ["1.50", "1.50 [-4.85, 7.85] kPa", "undecided", "why"]),
        ((2.0, 2.0, 2.0, np.nan), "", ["-", "2.00 [2.00, 2.00] kPa", "undecided", "-"]),
        ((np.nan, np.nan, np.nan, 1.5), "nobody knows", ["1.50", "-", "undecided", "nobody knows"]),
    ],
)
def test_a_claim_is_a_row_with_its_verdict_and_reason(numbers, reason, row):
    given = dict(zip(["ours", "low", "high", "published"], numbers, strict=True))
    given |= {"claim": "A.", "unit": "kPa", "verdict": "undecided", "reason": reason, "control": ""}
    assert claims.short_row(pd.Series(given)) == ["A.", *row]
    with_control = given | {"control": "Linear in place of LoMP", "control_value": -0.25}
    why = "; ".join(filter(None, [reason, "control: Linear in place of LoMP (-0.250)"]))
    assert claims.short_row(pd.Series(with_control)) == ["A.", *row[:-1], why]


def test_what_was_tried_stands_where_a_claim_is_not_reproduced(workspace):
    rows = CLAIMS.assign(
        paper="lomp", claim="A.", section="I", published=1.0, low=0.0, high=2.0, unit="kPa", measured=0,
        reason="why", over="seeds", seeds=3, power=0.25, budget="full", protocol="press",
        control="Linear in place of LoMP", control_value=0.5, draw_low=0.25, draw_high=3.0, flips_at=0.75,
    )  # fmt: skip
    text = claims.text(workspace, rows, {"lomp/a": "It was turned around.", "lomp/b": "Not shown."})
    tried = text.split("what was tried where a claim is not reproduced")[1]
    assert "- **A** (undecided; why)\n\nIt was turned around." in tried and "Not shown." not in text
    assert (
        len(re.findall(r"\| 0.250 to 3.00 \| +0.750 \| Linear in place of LoMP \(0.500\) \|", text)) == len(rows) - 1
    ), "all but what is beyond the paper"
    assert tried.count("Not investigated.") == 1
    (waiting,) = re.findall(r"\n\| A\. .*", text.split("## Open claims")[1].split("\n## ")[0])
    assert [cell.strip() for cell in waiting.split("|")[1:-1]] == ["A.", "simulated", "25 %", "3 seeds", "why"]


def test_what_is_beyond_the_papers_has_its_own_section(workspace):
    rows = CLAIMS.assign(
        paper="lomp", claim=CLAIMS["id"], section="I", published=1.0, low=0.0, high=2.0, unit="kPa", measured=0,
        reason="it does not hold", over="seeds", seeds=3, power=0.25, budget="full", protocol="press",
        control="Linear in place of LoMP", control_value=0.5, draw_low=0.25, draw_high=3.0, flips_at=0.75,
    )  # fmt: skip
    text = claims.text(workspace, rows, {"lomp/g": "It was turned around."})
    section, papers = text.split("## Beyond the papers")[1].split("\n## LoMP")
    (line,) = [line for line in section.splitlines() if "lomp/" in line]
    assert [cell.strip() for cell in line.split("|")[1:-1]] == [
        "lomp/g", "simulated", "8.00 [0.000, 2.00]", "kPa", "it does not hold",
    ]  # fmt: skip
    assert "| lomp/g" not in papers and "It was turned around." in papers


def test_every_claim_that_a_report_asks_for_is_there(workspace):
    known = {claim.id.split("/")[1] for claim in entries.read(workspace)[0]}
    pages = [path.read_text() for path in texts.FOLDER.glob("*.md")]
    asked = {
        name for text in pages for names in re.findall(r"r\.verdicts\((.+?)\)", text) for name in names.split(", ")
    }
    assert len(asked) > 60 and {name.strip('"') for name in asked} <= known
