"""Build the part of the page with every claim: how many came out, each with its verdict, the rules, what was tried."""

import pandas as pd
from markupsafe import Markup

from pipeline.claims import entries
from pipeline.claims.rules import VERDICTS
from pipeline.reporting import claims as claim_text
from pipeline.reporting.page.hypertext import SIGNS, anchor, fill, markdown
from tactile.base.errors import InputError
from tactile.base.paths import Workspace
from tactile.drawing.labels import split_name
from tactile.scoring.estimates import read_csv

COLUMNS = ["id", "claim", "paper", "section", "data", "kind", "published", "ours", "low", "high", "verdict", "reason"]
COLUMNS += ["unit", "measured", "protocol", "over", "seeds", "budget", "control", "control_value"]
HEADER = ["Verdict", "Claim", "Published", "Ours [95 % interval]", "Why"]


def read(workspace: Workspace) -> pd.DataFrame:
    """Read claims.csv, recorded data first. Raises InputError for a paper or a verdict that nobody knows."""
    path, made_by = workspace.reports / "claims.csv", "python -m pipeline.stages.judge"
    claims = read_csv(path, COLUMNS, made_by)
    for column in ("reason", "budget", "control"):
        claims[column] = claims[column].astype(object).where(claims[column].notna(), "")
    for column, known in (("paper", entries.papers(workspace)), ("verdict", SIGNS)):
        unknown = sorted(set(claims[column].astype(str)) - set(known))
        if unknown:
            raise InputError(f"reports/{path.name}: {column} '{unknown[0]}' is unknown; run `{made_by}` again")
    return claims.sort_values("data", kind="stable")


def row_of(row, paper: entries.Paper) -> dict:
    """Return a claim as a row of the table: its verdict, further cells, and attributes that the filter asks for."""
    unit = "" if row.unit in ("1", "count") else f" {row.unit}"
    published, ours = (
        text if text == "-" else text + unit
        for text in (
            claim_text.value_text(row.published, row.unit),
            claim_text.ours_text(row.ours, row.low, row.high, row.unit),
        )
    )
    split = split_name(row.protocol)
    runs, budget = claim_text.runs_text(row.seeds, row.over), f"budget {row.budget}"
    place = [paper.title, str(row.section), f"{row.data} data", split and f"split {split}"]
    place += [runs] if row.seeds else []
    place += [budget] if row.budget else []
    claim = Markup('{}<span class="place">{}</span>')
    text = claim.format(row.claim + (" *" if row.measured else ""), ", ".join(filter(None, place)))
    asked = {f"data-{key}": getattr(row, key) for key in ("paper", "verdict", "data", "kind")}
    attributes = {"id": f"claim-{anchor(row.id)}"} | asked
    why = claim_text.short_row(row)[-1]
    return {"verdict": row.verdict, "cells": [text, published, ours, why], "attributes": attributes}


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
