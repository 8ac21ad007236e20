"""Build the part of the page with every claim: how many came out, each with its verdict, the rules, what was tried."""

import pandas as pd
from markupsafe import Markup

from pipeline.base.errors import InputError
from pipeline.base.paths import Workspace
from pipeline.claims import entries
from pipeline.claims.rules import VERDICTS
from pipeline.reporting import claims as claim_text
from pipeline.reporting.page.hypertext import Pages, anchor, read, sections
from pipeline.reporting.page.templates import SIGNS, Cell, Row, fill, part
from pipeline.scoring.results import read_csv

COLUMNS = ["id", "claim", "paper", "section", "data", "kind", "published", "ours", "low", "high", "verdict", "reason"]
COLUMNS += ["unit", "measured", "scale", "strict_ours", *claim_text.BY_SCALE]
HEADER = ["Verdict", "Claim", "Paper", "Section", "Data", "Published", "Ours [95 % interval]", "Unit"]
HEADER += [*claim_text.BY_SCALE.values(), "Reason"]


def read_claims(workspace: Workspace) -> pd.DataFrame:
    """Read claims_by_scale.csv, recorded data first. Raises InputError for a paper or a verdict that nobody knows."""
    path, made_by = workspace.reports / "claims_by_scale.csv", "python -m pipeline.stages.judge"
    claims = read_csv(path, COLUMNS, made_by)
    for column in ("reason", *claim_text.BY_SCALE):
        claims[column] = claims[column].astype(object).where(claims[column].notna(), "")
    for column, known in (("paper", entries.papers(workspace)), ("verdict", SIGNS)):
        unknown = sorted(set(claims[column].astype(str)) - set(known))
        if unknown:
            raise InputError(f"reports/{path.name}: {column} '{unknown[0]}' is unknown; run `{made_by}` again")
    return claims.sort_values("data", kind="stable")


def counted(claims: pd.DataFrame) -> pd.DataFrame:
    """Return the claims that count among the verdicts: no arithmetic, nothing calibrated, nothing by construction."""
    return claims[claims["kind"].isin(claim_text.COUNTED)]


def counts_by_data(claims: pd.DataFrame) -> list[tuple[str, list[tuple[str, int]]]]:
    """Return (data, [(verdict, number of claims)]), recorded data first, for a bar of verdicts."""
    return [
        (str(data), [(verdict, int((of_data["verdict"] == verdict).sum())) for verdict in VERDICTS])
        for data, of_data in counted(claims).groupby("data")
    ]


def claim_row(row, paper: entries.Paper) -> Row:
    """Return a claim of a paper as a row of the table; its attributes are what the filter asks for, and its anchor."""
    filtered_by = {"paper": row.paper, "verdict": row.verdict, "data": row.data, "kind": row.kind}
    experiment = paper.recorded if row.data == claim_text.RECORDED else paper.simulated
    cells = [
        Cell(part("badge", row.verdict)),
        Cell(row.claim + (" *" if row.measured else "")),
        Cell(Markup('<a href="#{}">{}</a>').format(experiment, paper.title)),
        Cell(str(row.section)),
        Cell(row.data),
        Cell(claim_text.value_text(row.published, row.unit), row.published),
        Cell(claim_text.ours_text(row.ours, row.low, row.high, row.unit), row.ours),
        Cell("" if row.unit == "1" else row.unit),
        *(Cell(getattr(row, column) or "-") for column in claim_text.BY_SCALE),
        Cell(row.reason),
    ]
    named = [cell._replace(column=name) for cell, name in zip(cells, HEADER, strict=True)]
    return Row(named, {"id": f"claim-{anchor(row.id)}"} | {f"data-{key}": value for key, value in filtered_by.items()})


def section(workspace: Workspace, pages: Pages) -> Markup:
    """Return the section: how many claims came out, every claim, the rules, and what was tried."""
    claims, text, papers = read_claims(workspace), read(workspace, "claims.md"), entries.papers(workspace)
    choices = {
        "paper": [(key, papers[key].title) for key in claims["paper"].unique()],
        "data": [(key, key) for key in claims["data"].unique()],
        "verdict": [(verdict, verdict) for verdict in SIGNS],
        "kind": [(key, key) for key in claims["kind"].unique()],
    }
    return fill(
        "claims",
        count_header=["Data", "Paper", *VERDICTS, "Claims"],
        counts=[
            Row([Cell(text) for text in row], {"class": "total"} if "all" in row[:2] else {})
            for row in claim_text.count_rows(workspace, claims, ["paper"])
        ],
        rules=pages.render(sections(text)[0][1], "", 2, "Rules"),
        filters=list(choices.items()),
        header=HEADER,
        rows=[claim_row(row, papers[row.paper]) for row in claims.itertuples()],
        tried=[
            (heading, pages.render(sections(body)[0][1], "", 3, heading))
            for heading, body in sections(text, "### ")
            if heading
        ],
    )
