"""Build the first screen of the page: one answer per paper, our errors over the published ones, speed."""

import re
from collections.abc import Mapping
from typing import NamedTuple

import pandas as pd
from markupsafe import Markup

from pipeline.base import params
from pipeline.base.paths import Workspace
from pipeline.claims import entries
from pipeline.claims.entries import NUMBER
from pipeline.claims.rules import BAND, CONTRADICTED, NOT_TESTABLE, REPRODUCED, VERDICTS
from pipeline.reporting import claims as claim_text
from pipeline.reporting.page import charts, verdicts
from pipeline.reporting.page.hypertext import Pages
from pipeline.reporting.page.templates import fill
from pipeline.reporting.sentences import caption
from pipeline.reporting.speed import chart_caption
from pipeline.reporting.words.labels import model_name
from pipeline.scoring.results import read_csv


class Question(NamedTuple):
    """What a reader brings to a paper, and the claim whose verdict answers it."""

    question: str
    claim: str  # its id in claims.csv
    number: str  # what the claim's number is, in words
    figure: str  # of reports/


QUESTIONS = {
    "lomp": Question(
        "Does LoMP see two touches after training on one?",
        "lomp/lomp-best-double",
        "below the next best model on double touch",
        "touch/accuracy/figure8.png",
    ),
    "latent": Question(
        "Is the latent space of strain sensors free of drift?",
        "latent/drift-free-true-drift-task_2",
        "is how much of the true drift a read-out finds in it (R2, task 2)",
        "strain/accuracy/drift.png",
    ),
    "sp_resnet": Question(
        "How precisely does SP-ResNet name what a glove holds?",
        "sp_resnet/precision-combined-sp_resnet",
        "precision on pressure and strain together",
        "glove/accuracy/figure14_combined.png",
    ),
}
ANSWERS = {REPRODUCED: "Yes: ", CONTRADICTED: "No: "}  # to a question that is not about a number
# Claims on a printed error: condition and model in their ids.
PRINTED = (
    re.compile(r"^\w+/rmse-(?P<condition>[a-z]+)-(?P<model>\w+)$"),
    re.compile(r"^\w+/error-(?P<model>\w+)-(?P<condition>\w+)$"),
    re.compile(r"^\w+/precision-(?P<condition>[a-z]+)-(?P<model>\w+)$"),
)
REACH = 8.0  # ratios beyond this, either way, are drawn at the edge


def card(workspace: Workspace, pages: Pages, paper: str, claims: pd.DataFrame) -> dict:
    """Return what a paper's card says."""
    asked, of_paper = QUESTIONS[paper], claims[claims["paper"] == paper]
    row = of_paper.set_index("id").loc[asked.claim]
    unit = "" if row["unit"] == "1" else f" {row['unit']}"
    answer = "" if row["kind"] == NUMBER else ANSWERS.get(row["verdict"], "")
    number = f"{answer}{claim_text.ours_text(row['ours'], row['low'], row['high'], row['unit'])}{unit}"
    published = claim_text.value_text(row["published"], row["unit"])
    paper_says = "" if published == "-" else f"; in the paper {published}{unit}"
    why = f" ({row['reason'].partition(':')[0]})" if row["verdict"] == NOT_TESTABLE else ""
    return {
        "paper": paper,
        "title": entries.papers(workspace)[paper].title,
        "question": asked.question,
        "verdict": row["verdict"],
        "number": number,
        "answer": f"{asked.number}{paper_says}{why}.",
        "figure": asked.figure,
        "caption": pages.caption(asked.figure),
        "size": pages.size(asked.figure),
        "counts": verdicts.counts_by_data(of_paper),
        "claims": len(of_paper),
    }


def ratio(value: float, published: float, unit: str) -> float:
    """Return our error over the published one; of a share in %, the error is what is missing to 100 %."""
    return (100 - value) / (100 - published) if unit == "%" else value / published


def compared(workspace: Workspace, claims: pd.DataFrame) -> dict:
    """Return the data of the chart of our errors over the published ones; claims: see `verdicts.read_claims`."""
    rows, titles = [], claim_text.titles(workspace)
    for row in claims[claims["data"] == "simulated"].itertuples():
        match = next(filter(None, (pattern.match(row.id) for pattern in PRINTED)), None)
        if match is None:
            continue
        ratios = [ratio(value, row.published, row.unit) for value in (row.ours, row.low, row.high)]
        ours, *ends = [value if value == value else None for value in ratios]
        strict = ratio(row.strict_ours, row.published, row.unit)
        panel = f"{titles[row.paper]}: {match['condition'].replace('_', ' ')}"
        numbers = claim_text.ours_text(row.ours, row.low, row.high, row.unit)
        rows.append(
            {
                "panel": panel,
                "model": match["model"],
                "label": model_name(match["model"]),
                "ours": ours,
                "low": min(ends) if None not in ends else None,
                "high": max(ends) if None not in ends else None,
                "strict": strict if strict == strict else None,
                "words": f"{model_name(match['model'])}, {panel}: {numbers} {row.unit}, published "
                f"{claim_text.value_text(row.published, row.unit)} {row.unit}; {row.verdict}",
            }
        )
    rows = [row for row in rows if row["ours"] is not None or row["strict"] is not None]
    panels = list(dict.fromkeys(row["panel"] for row in rows))
    return {"band": BAND, "reach": REACH, "panels": panels, "rows": rows, "models": charts.looks(rows)}


def compared_caption(rows: list[Mapping]) -> str:
    """Return the caption of the chart of our errors over the published ones; rows: those that it draws."""
    ratios = [row["ours"] for row in rows if row["ours"] is not None]
    inside = sum(abs(value - 1) <= BAND for value in ratios)
    larger = sum(value > 1 + BAND for value in ratios)
    return caption(
        f"of {len(ratios)} errors, ours lie in the band for {inside}, above it for {larger} and below it for "
        f"{len(ratios) - inside - larger}"
    )


def speed(workspace: Workspace, values: Mapping) -> pd.DataFrame | None:
    """Return the speed table with one panel per paper, its last main condition; None where none was run."""
    tables = []
    for paper in entries.papers(workspace).values():
        experiment = paper.simulated
        path = workspace.reports / experiment / "speed" / "table2.csv"
        if experiment not in values["experiments"] or not path.exists():
            continue
        table = read_csv(path, charts.COLUMNS, f"python -m pipeline.stages.render {experiment}")
        panel = table["panel"].iloc[-1]
        tables.append(table[table["panel"] == panel].assign(panel=f"{paper.title}: {panel}"))
    return pd.concat(tables, ignore_index=True) if tables else None


def scale_words(workspace: Workspace, values: Mapping) -> str:
    """Name the scale of the simulated experiments."""
    simulated = [paper.simulated for paper in entries.papers(workspace).values()]
    scales = {
        params.scale_of(workspace.scales, name, values[name]) for name in simulated if name in values["experiments"]
    }
    names = {"paper": "the papers'", "other": "their own settings'", "both": "the papers'"}
    return " and ".join(sorted(names.get(scale, scale) for scale in scales - ({"both"} if len(scales) > 1 else set())))


def section(workspace: Workspace, pages: Pages, values: Mapping) -> Markup:
    """Return the first screen; values: params.yaml."""
    claims = verdicts.read_claims(workspace)
    ids = set(claims["id"])
    present = [
        paper
        for paper, asked in QUESTIONS.items()
        if asked.claim in ids and (workspace.reports / asked.figure).exists()  # an experiment may not have been run
    ]
    ours, speeds = compared(workspace, claims), speed(workspace, values)
    return fill(
        "answers",
        claims=len(verdicts.counted(claims)),
        at_papers=int((verdicts.counted(claims)["scale"] == "paper").sum()),
        scale=scale_words(workspace, values),
        cards=[card(workspace, pages, paper, claims) for paper in present],
        verdicts=VERDICTS,
        band=f"{100 * BAND:.0f}",
        compared=ours,
        compared_caption=compared_caption(ours["rows"]),
        speed={} if speeds is None else charts.data(speeds, "Speed against accuracy", ["p50_ms"]),
        speed_caption="" if speeds is None else chart_caption(speeds, "p50_ms"),
    )
