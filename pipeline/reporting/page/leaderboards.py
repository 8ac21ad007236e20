"""Build the leaderboards: one table per task, with error, printed error, times, size and stability of all models."""

from collections.abc import Mapping

import pandas as pd
from markupsafe import Markup

from pipeline.base.paths import Workspace
from pipeline.reporting.page import charts
from pipeline.reporting.page.templates import Cell, Row, part
from pipeline.reporting.speed import ESTIMATE
from pipeline.reporting.verdicts import stability
from pipeline.reporting.words.labels import model_name
from pipeline.reporting.words.markdown import interval, number, size
from pipeline.scoring import published
from pipeline.scoring.results import Estimate, read_csv

STRESSED = ["experiment", "protocol", "condition", "perturbation", "model", "relative"]  # columns of failures.csv


def printed(experiment: str, model: str, condition: str) -> float:
    """Return the error that the paper prints for a model, in the unit of the speed table; NaN where there is none."""
    if experiment == "touch":
        return published.rmse(model, condition)
    if experiment == "strain":
        return published.latent(model, condition, "test error")
    return 100 - published.precision(model, condition) if experiment == "glove" else float("nan")


def cells(experiment: str, row: Mapping, relative: float, best: bool) -> list[Cell]:
    """Return the cells of one model; relative: its error over the constant model's under stress, NaN where unknown."""
    error = Estimate(*(row[key] for key in ESTIMATE))
    paper = printed(experiment, row["model"], row["condition"])
    return [
        Cell(model_name(row["model"])),
        Cell(interval(error), error.mean, best=best),
        Cell(number(paper), paper),
        Cell(f"{row['p50_ms']:.3f}", row["p50_ms"]),
        Cell(number(row["train_s"], 1), row["train_s"]),
        Cell(size(row["params"]), row["params"]),
        Cell(size(row["size_bytes"]), row["size_bytes"]),
        Cell(number(relative), relative),
    ]


def board(experiment: str, task: str, rows: pd.DataFrame, relative: pd.Series) -> Markup:
    """Return the table of one task. rows: of the speed table; relative: by model, see `stability.ranking`."""
    good = rows[rows["failed"] == 0]["error"]
    # Papers on gloves print precision, not the share of images: beside ours stands what is missing to 100 %.
    paper = "Published (100 - precision, %)" if experiment == "glove" else "Published"
    header = ["Model", rows["measure"].iloc[0], paper, "Prediction (ms)", "Training (s)", "Parameters"]
    header += ["File (bytes)", "Error under stress"]
    table = [
        Row(cells(experiment, row, float(relative.get(row["model"], float("nan"))), row["error"] == good.min()))
        for row in rows.to_dict("records")
    ]
    return part("table", task, header, table, "leaderboard")


def leaderboards(workspace: Workspace, experiment: str, name: str) -> Markup:
    """Return the leaderboards of an experiment, one per panel of its speed table; name: of the experiment."""
    made_by = f"python -m pipeline.stages.render {experiment}"
    columns = (*charts.COLUMNS, "protocol", "condition")
    speeds = read_csv(workspace.reports / experiment / "speed" / "table2.csv", columns, made_by)
    stress = read_csv(workspace.reports / "stability" / "failures.csv", STRESSED, "dvc repro")
    parts = []
    for panel, rows in speeds.groupby("panel", sort=False):
        place = [experiment, *rows[["protocol", "condition"]].iloc[0]]
        relative = stability.ranking(stress[stress[STRESSED[:3]].eq(place).all(axis=1)])
        parts.append(board(experiment, f"{name}, {panel}", rows, relative))
    return Markup("\n").join(parts)
