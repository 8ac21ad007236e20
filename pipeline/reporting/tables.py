"""Turn the tables of reports/ into cells of text: the same for Markdown and for the page."""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
import pandas as pd

from pipeline.claims.sizes import NAMES, SCALES, error_of, unit_of
from tactile.drawing.labels import capitalised, effect_name, model_name, statistic_name, task_name
from tactile.drawing.markdown import interval, number, size
from tactile.experiments import facts
from tactile.scoring.estimates import Estimate

PHYSICS = {"rmse": "RMSE", "error": "distance", "accuracy": "images classified incorrectly"}  # metric -> the error
TWIN_UNITS = {"1": "-", "log": "log of the reading", "deg": "degrees"}


class Table(NamedTuple):
    """A heading for each column, and rows of as many cells."""

    header: list[str]
    rows: list[list[str]]


def rightsize(ladder: pd.DataFrame) -> Table:
    """Return one row per size, with error and verdict in each condition; ladder: a family's rows of rightsize.csv."""
    first, scale = ladder.iloc[0], SCALES[ladder.iloc[0]["family"]]
    conditions, rows = list(dict.fromkeys(ladder["condition"])), []
    for number_of, own in ladder.groupby("size"):
        name = f"{number_of:g}" + (" (published)" if number_of == scale.published else "")
        cells = [name, size(own.iloc[0]["params"]), size(own.iloc[0]["macs"])]
        for condition in conditions:
            found = own[own["condition"] == condition]
            cells += ladder_cells(found.iloc[0]) if len(found) else ["-", "-"]
        rows.append(cells)
    error = f"{NAMES[first['metric']]} ({unit_of(first['metric'], first['unit'])})"
    header = [capitalised(scale.size_name), "Parameters", "Multiply-accumulates"]
    for condition in map(task_name, conditions):
        header += [f"{capitalised(condition)}: {error}", f"{capitalised(condition)}: verdict"]
    return Table(header, rows)


def ladder_cells(row: pd.Series) -> list[str]:
    """Return error and verdict of one row of rightsize.csv; the smallest size that is enough has a *."""
    value, *ends = (error_of(row[name], row["metric"]) for name in ("value", "low", "high"))
    error = Estimate(value, min(ends), max(ends), row["runs"], row["failed"])
    return [interval(error, 3 if value < 1 else 2), row["verdict"] + ("*" if row["chosen"] else "")]


def physics(judged: pd.DataFrame) -> Table:
    """Return one row per effect with the change whose interval reaches farthest; judged: rows of physics.csv."""
    rows = []
    for effect, changes in judged.groupby("effect", sort=False):
        reach = np.maximum(-changes["low"], changes["high"]).fillna(changes["relative"].abs())  # one seed: no interval
        most = changes.loc[reach.where(changes["relative"].notna(), np.inf).idxmax()]
        ends = [
            f"{round(100 * most[end]) + 0.0:+.0f} %" for end in ("relative", "low", "high") if most[end] == most[end]
        ]
        change = f"{ends[0]} [{ends[1]}, {ends[2]}]" if ends[1:] else ends[0] if ends else "failed"
        where = f"{model_name(most['model'])}, {task_name(most['condition'])}"
        swapped = len([pair for pair in str(most["swapped"] or "").split("; ") if pair not in ("", "nan")])
        rows.append(
            [capitalised(effect_name(effect)), change, where, str(swapped), most["verdict"], most["consequence"]]
        )
    header = ["Effect left out", "Largest change of an error [90 % interval]", "Of which model, where"]
    return Table([*header, "Pairs of models that change places", "Verdict", "What follows"], rows)


def physics_error(experiment: str) -> tuple[str, str, int]:
    """Return the name and the unit of an experiment's error, and how many of these one of physics.csv is."""
    metric, unit = facts(experiment).metric, facts(experiment).output_unit
    return (PHYSICS[metric], "%", 100) if metric == "accuracy" else (PHYSICS[metric], unit, 1)


def physics_errors(judged: pd.DataFrame) -> Table:
    """Return the geometric mean of each model's error with all effects; judged: an experiment's rows of physics.csv."""
    _, unit, times = physics_error(judged["experiment"].iloc[0])
    first = judged[judged["effect"] == judged["effect"].iloc[0]]
    before = first.pivot(index="model", columns="condition", values="before")
    conditions, models = dict.fromkeys(first["condition"]), dict.fromkeys(first["model"])
    cells = [[model_name(name), *(failing(times * before.loc[name, at]) for at in conditions)] for name in models]
    return Table(["Model", *(f"{capitalised(task_name(name))} ({unit})" for name in conditions)], cells)


def failing(value: float) -> str:
    """Return an error, or that its run failed."""
    return number(value) if np.isfinite(value) else "failed"


def twins(summary: pd.DataFrame) -> Table:
    """Return one row per statistic, recorded and simulated; summary: an experiment's rows of twins.csv."""
    rows = []
    for row in summary.to_dict("records"):
        inside = "-" if pd.isna(row["inside"]) else "yes" if row["inside"] else "no"
        note = row["note"] if isinstance(row["note"], str) and row["note"] else "-"
        spans = [span(row, side) for side in ("recorded", "simulated")]
        name, unit = capitalised(statistic_name(row["statistic"])), TWIN_UNITS.get(str(row["unit"]), row["unit"])
        rows.append([name, unit, *spans, inside, row["meaning"], note if inside == "no" else "-"])
    return Table(
        ["Statistic", "Unit", "Recorded", "Simulated", "In range", "What it is", "Why it is out of range"], rows
    )


def span(row: Mapping, side: str) -> str:
    """Return `median (lowest to highest)` of the recorded or the simulated side of a row of twins.csv."""
    middle, low, high = (row[f"{side}{end}"] for end in ("", "_low", "_high"))
    return "-" if pd.isna(middle) else f"{middle:.3g} ({low:.3g} to {high:.3g})"
