"""Build the first section of the page: how many claims came out, and every claim with its verdict."""

from html import escape

import pandas as pd

from pipeline.base import paths
from pipeline.base.errors import InputError
from pipeline.reporting import claims as claim_text
from pipeline.reporting.page.hypertext import Pages, cell, folded, read, sections, table
from pipeline.reporting.verdicts.rules import (
    CALIBRATED,
    CONTRADICTED,
    NOT_TESTABLE,
    PAPERS,
    REPRODUCED,
    UNDECIDED,
    VERDICTS,
)
from pipeline.scoring.results import read_csv

SIGNS = {  # CSS class, sign
    REPRODUCED: ("yes", "✓"),
    CONTRADICTED: ("no", "✗"),
    UNDECIDED: ("unclear", "?"),
    NOT_TESTABLE: ("open", "–"),
    CALIBRATED: ("open", "="),
}
COLUMNS = ["claim", "paper", "section", "data", "kind", "published", "ours", "low", "high", "verdict", "reason", "unit"]
COLUMNS += ["measured", *claim_text.BY_SCALE]


def badge(verdict: str) -> str:
    """Return a verdict in a colour and, for those who do not see it, a sign and the word."""
    style, sign = SIGNS[verdict]
    return f'<span class="badge {style}"><span aria-hidden="true">{sign}\u00a0</span>{escape(verdict)}</span>'


def read_claims() -> pd.DataFrame:
    """Read claims_by_scale.csv, recorded data first. Raises InputError for a paper or a verdict that nobody knows."""
    path, made_by = paths.REPORTS / "claims_by_scale.csv", "python -m pipeline.stages.judge"
    claims = read_csv(path, COLUMNS, made_by)
    for column in ("reason", *claim_text.BY_SCALE):
        claims[column] = claims[column].astype(object).where(claims[column].notna(), "")
    for column, known in (("paper", PAPERS), ("verdict", SIGNS)):
        unknown = sorted(set(claims[column].astype(str)) - set(known))
        if unknown:
            raise InputError(f"reports/{path.name}: {column} '{unknown[0]}' is unknown; run `{made_by}` again")
    return claims.sort_values("data", kind="stable")


def count_table(claims: pd.DataFrame) -> str:
    """Return a table of verdicts by data and paper."""
    header = ["Data", "Paper", *VERDICTS, "Claims"]
    lines = [
        ({"class": "total"} if "all" in row[:2] else {}, list(map(cell, row)))
        for row in claim_text.count_rows(claims, ["paper"])
    ]
    return table("Verdicts by data and paper", header, lines)


def claim_table(claims: pd.DataFrame) -> str:
    """Return a table of every claim with its verdict; a row's attributes are what the filter asks for."""
    header = ["Verdict", "Claim", "Paper", "Section", "Data", "Published", "Ours [95 % interval]", "Unit"]
    lines = []
    for row in claims.itertuples():
        filtered_by = {"paper": row.paper, "verdict": row.verdict, "data": row.data, "kind": row.kind}
        attributes = {f"data-{name}": value for name, value in filtered_by.items()}
        cells = [
            cell(badge(row.verdict), html=True),
            cell(row.claim + (" *" if row.measured else "")),
            *map(cell, (PAPERS[row.paper], str(row.section), row.data)),
            cell(claim_text.value_text(row.published, row.unit), row.published),
            cell(claim_text.ours_text(row.ours, row.low, row.high, row.unit), row.ours),
            cell(row.unit),
            *(cell(getattr(row, column) or "-") for column in claim_text.BY_SCALE),
            cell(row.reason),
        ]
        lines.append((attributes, cells))
    return table("Every claim", [*header, *claim_text.BY_SCALE.values(), "Reason"], lines)


def filters(claims: pd.DataFrame) -> str:
    """Return the controls of the table of claims; of use only where scripts run."""
    choices = {
        "paper": {key: PAPERS[key] for key in claims["paper"].unique()},
        "verdict": {verdict: verdict for verdict in SIGNS},
        "data": {key: key for key in claims["data"].unique()},
        "kind": {key: key for key in claims["kind"].unique()},
    }
    selects = []
    for name, words in choices.items():
        options = "".join(f'<option value="{escape(key)}">{escape(word)}</option>' for key, word in words.items())
        options = f'<option value="">all</option>{options}'
        selects.append(f'<label>{name.capitalize()} <select name="{name}">{options}</select></label>')
    return (
        f'<form class="filters" hidden>{"".join(selects)}<label>Words <input type="search" name="words"></label>'
        f'<output aria-live="polite">{len(claims)} of {len(claims)} claims</output></form>'
    )


def section(pages: Pages) -> str:
    """Return the section: how many claims came out, every claim, the rules, and what was tried."""
    claims, text = read_claims(), read("claims.md")
    counted = claims[claims["kind"].isin(claim_text.COUNTED)]
    tiles = ""
    for data, of_data in counted.groupby("data"):
        numbers = "".join(
            f'<li class="{SIGNS[verdict][0]}"><strong>{int((of_data["verdict"] == verdict).sum())}</strong> '
            f"{badge(verdict)}</li>"
            for verdict in VERDICTS
        )
        tiles += f'<h3>On {escape(data)} data</h3><ul class="tiles">{numbers}</ul>'
    rules = pages.render(sections(text)[0][1], "", 2, "Rules")
    tried = "".join(
        folded(heading, pages.render(sections(body)[0][1], "", 3, heading))
        for heading, body in sections(text, "### ")
        if heading
    )
    return (
        f'<section id="verdicts"><h2>A verdict on every claim</h2>{tiles}{count_table(claims)}'
        f'{folded("The rules", rules)}<h3 id="claims">Every claim</h3>{filters(claims)}{claim_table(claims)}'
        f"<h3>Where a claim is not reproduced</h3>{tried}</section>"
    )
