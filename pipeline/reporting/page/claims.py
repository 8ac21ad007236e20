"""Build the part of the page with every claim: how many came out, each with its verdict, the rules, what was tried."""

from collections.abc import Mapping

import pandas as pd
from markupsafe import Markup

from pipeline.base.errors import InputError
from pipeline.base.paths import Workspace
from pipeline.claims import entries
from pipeline.claims.rules import UNDECIDED, VERDICTS
from pipeline.reporting import claims as claim_text
from pipeline.reporting.page.hypertext import SIGNS, Figure, anchor, figure, fill, markdown
from pipeline.scoring.results import read_csv

COLUMNS = ["id", "claim", "paper", "section", "data", "kind", "published", "ours", "low", "high", "verdict", "reason"]
COLUMNS += ["unit", "measured", "protocol", "power", "seeds", "budget"]
HEADER = ["Verdict", "Claim", "Paper", "Section", "Data", "Protocol", "Published", "Ours [95 % interval]", "Unit"]
HEADER += ["Power", "Runs", "Budget", "Reason"]


def read(workspace: Workspace) -> pd.DataFrame:
    """Read claims.csv, recorded data first. Raises InputError for a paper or a verdict that nobody knows."""
    path, made_by = workspace.reports / "claims.csv", "python -m pipeline.stages.judge"
    claims = read_csv(path, COLUMNS, made_by)
    for column in ("reason", "budget"):
        claims[column] = claims[column].astype(object).where(claims[column].notna(), "")
    for column, known in (("paper", entries.papers(workspace)), ("verdict", SIGNS)):
        unknown = sorted(set(claims[column].astype(str)) - set(known))
        if unknown:
            raise InputError(f"reports/{path.name}: {column} '{unknown[0]}' is unknown; run `{made_by}` again")
    return claims.sort_values("data", kind="stable")


def cards(workspace: Workspace, claims: pd.DataFrame, answers: Mapping[str, Mapping], captions: Mapping) -> list[dict]:
    """Return what the card of each paper says; answers, captions: of content.yaml. A paper may not have been run."""
    by_id, titles = claims.set_index("id"), claim_text.titles(workspace)
    there = {
        paper: asked
        for paper, asked in answers.items()
        if asked["claim"] in by_id.index and (workspace.reports / asked["figure"]).parent.exists()
    }
    made = []
    for paper, asked in there.items():
        row, own = by_id.loc[asked["claim"]], claims[claims["paper"] == paper]
        unit = "" if row["unit"] == "1" else f" {row['unit']}"
        ours = claim_text.ours_text(row["ours"], row["low"], row["high"], row["unit"]) + unit
        published = claim_text.value_text(row["published"], row["unit"])
        counted = claim_text.counted(own)
        bars = [
            (data, [(verdict, int((rows["verdict"] == verdict).sum())) for verdict in VERDICTS])
            for data, rows in counted.groupby("data")
        ]
        made.append(
            {"paper": paper, "title": titles[paper], "verdict": row["verdict"], "question": asked["question"]}
            | {"number": ours if row["ours"] == row["ours"] else ""}
            | {"what": asked["number"], "published": "" if published == "-" else published + unit, "counts": bars}
            | {"why": row["reason"] if row["verdict"] == UNDECIDED else "", "claims": len(own)}
            | {"figure": picture(workspace, asked["figure"], captions.get(asked["figure"], asked["question"]))}
        )
    return made


def picture(workspace: Workspace, source: str, caption: str) -> Figure | None:
    """Return a figure, or None where the study that draws it is still to be computed."""
    return figure(workspace, source, caption) if (workspace.reports / source).exists() else None


def row_of(row, paper: entries.Paper) -> dict:
    """Return a claim as a row of the table: its verdict, further cells, and attributes that the filter asks for."""
    experiment = paper.recorded if row.data == claim_text.RECORDED else paper.simulated
    cells = [
        row.claim + (" *" if row.measured else ""),
        Markup('<a href="#{}">{}</a>').format(experiment, paper.title),
        str(row.section),
        row.data,
        row.protocol,
        claim_text.value_text(row.published, row.unit),
        claim_text.ours_text(row.ours, row.low, row.high, row.unit),
        "" if row.unit == "1" else row.unit,
        claim_text.power_text(row.power),
        str(row.seeds),
        row.budget or "-",
        row.reason,
    ]
    asked = {f"data-{key}": getattr(row, key) for key in ("paper", "verdict", "data", "kind")}
    return {"verdict": row.verdict, "cells": cells, "attributes": {"id": f"claim-{anchor(row.id)}"} | asked}


def section(workspace: Workspace, claims: pd.DataFrame) -> Markup:
    """Return the section: how many claims came out, every claim, the rules, and what was tried; claims: see `read`."""
    listed, papers = entries.read(workspace)
    tried = {claim.id: claim.tried for claim in listed}
    choices = {
        "paper": [(key, papers[key].title) for key in claims["paper"].unique()],
        "data": [(key, key) for key in claims["data"].unique()],
        "verdict": [(verdict, verdict) for verdict in SIGNS],
        "kind": [(key, key) for key in claims["kind"].unique()],
    }
    return fill(
        "claims",
        counts=(["Data", "Paper", *VERDICTS, "Claims"], claim_text.count_rows(workspace, claims, ["paper"])),
        rules=claim_text.RULES,
        filters=list(choices.items()),
        header=HEADER,
        rows=[row_of(row, papers[row.paper]) for row in claims.itertuples()],
        tried=[
            (papers[paper].title, [(heads, markdown(why, f"Tried, {paper}")) for why, heads in groups])
            for paper, own in claims.groupby("paper", sort=False)
            if (groups := claim_text.missed(own, tried))
        ],
    )
