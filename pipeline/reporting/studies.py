"""Write what the studies found, for people: rightsize, physics and twins, each a folder of reports/.

Each function writes README.md and figures into an empty folder, and returns the table that reports/<name>.csv holds, if
there is one beside the folder.
"""

import json
from collections.abc import Mapping
from pathlib import Path
from string import Formatter

import numpy as np
import pandas as pd

from pipeline.claims import physics as physics_verdicts
from pipeline.claims import sizes as sizes_verdicts
from pipeline.reporting import tables
from pipeline.reporting.figures import physics as physics_figures
from pipeline.reporting.figures import sizes as sizes_figures
from pipeline.reporting.figures import twins as twins_figures
from pipeline.reporting.texts import render
from pipeline.results import one_table, shards
from pipeline.results.studies import FAMILIES, effects
from tactile import experiments
from tactile.base import files
from tactile.base.paths import Workspace
from tactile.drawing.labels import experiment_name, model_name, task_name
from tactile.drawing.markdown import number
from tactile.experiments import facts
from tactile.scoring import estimates
from tactile.scoring.estimates import kept_rows

TWINS = ["statistic", "unit", "source", "recording", "value", "meaning", "note"]  # of data/<experiment>/twins.csv
SIDES = ("recorded", "simulated")
SUMMARY = ["experiment", "statistic", "unit", *(f"{side}{end}" for side in SIDES for end in ("", "_low", "_high"))]
SUMMARY += ["inside", "meaning", "note"]  # columns of reports/twins.csv


def rightsize(workspace: Workspace, folder: Path, values: Mapping) -> pd.DataFrame:
    """Judge the ladders of all experiments; the table is claims.sizes.JUDGED."""
    parts, together = [], [pd.DataFrame(columns=sizes_verdicts.JUDGED)]
    evidence = one_table.Results(shards.read(workspace))
    for experiment in dict.fromkeys(family.experiment for family in FAMILIES.values()):
        runs = sizes_verdicts.read(workspace, evidence, experiment)
        if runs.empty:
            parts.append({"experiment": experiment, "missing": True})
            continue
        judged = sizes_verdicts.judge(runs)
        references = sizes_verdicts.references(evidence, runs)
        sizes_figures.curves(folder / f"{experiment}.png", experiment_name(experiment), judged, references)
        for family, rows in judged.groupby("family", sort=False):
            told = {"experiment": experiment, "title": sizes_title(family), "table": tables.rightsize(rows)}
            parts.append(told | {"trained": trained(family, references), "missing": False})
        together.append(judged)
    files.write_text(folder / "README.md", render("rightsize", parts=parts))
    return _joined(together).assign(size=lambda table: table["size"].map("{:g}".format))


def _joined(tables: list[pd.DataFrame]) -> pd.DataFrame:
    """Return the rows of all tables; the first is empty and has the columns, for where it is the only one."""
    return pd.concat(tables[1:] or tables, ignore_index=True)


def sizes_title(family: str) -> str:
    """Return the heading of a family's ladder."""
    return f"{model_name(FAMILIES[family].model)}: {sizes_verdicts.SCALES[family].size_name}"


def trained(family: str, references: dict[tuple[str, str], sizes_verdicts.Reference]) -> str:
    """Return the errors of the fully trained model beside a ladder of shorter trainings; nothing for other ladders."""
    errors = [
        (at, one.trained) for (name, at), one in references.items() if name == family and np.isfinite(one.trained)
    ]
    return "; ".join(f"{task_name(at)} {number(error, 3 if error < 1 else 2)}" for at, error in errors)


def physics(workspace: Workspace, folder: Path, values: Mapping) -> pd.DataFrame:
    """Judge the effects of all scenes; the table has one row per effect, condition and model."""
    parts, rows = [], [pd.DataFrame(columns=physics_verdicts.REPORTED)]
    for experiment, block in values["physics"].items():
        title = experiment_name(experiment)
        scores = physics_verdicts.read(workspace, experiment, effects(values, experiment), block["models"])
        if scores.empty:
            parts.append({"experiment": experiment, "title": title, "missing": True})
            continue
        switches = values[experiment]["simulate"]["effects"]
        own = pd.DataFrame(physics_verdicts.report_rows(experiment, physics_verdicts.assess(scores), switches))
        error, unit, _ = tables.physics_error(experiment)
        drawn = f"{title}: an effect of the scene left out"
        physics_figures.matrices(folder / f"{experiment}.png", drawn, own, f"{error} in {unit}")
        parts.append(
            {"experiment": experiment, "title": title, "missing": False, "error": error, "unit": unit}
            | {"seeds": scores["seed"].nunique(), "scene": json.dumps(block["scene"]).replace('"', "")}
            | {"table": tables.physics(own), "errors": tables.physics_errors(own)}
        )
        rows.append(own)
    margin = f"{100 * physics_verdicts.MARGIN:.0f}"
    files.write_text(folder / "README.md", render("physics", parts=parts, margin=margin))
    return _joined(rows)


def twins(workspace: Workspace, folder: Path, _: Mapping) -> pd.DataFrame:
    """Compare all scenes with their recordings; the table is SUMMARY.

    Settings are not read: the recordings and scenes are as they are.

    Where recordings are absent, their side of the former reports/twins.csv stays; of touch both sides do, as its scene
    is pressed with the recorded forces.
    """
    measured = {
        name: estimates.read_csv(workspace.twins(name), TWINS, f"python -m pipeline.stages.twins {name}")
        for name in experiments.having("twin")
    }
    absent = [name for name, table in measured.items() if "recorded" not in set(table["source"])]
    kept, parts, together = kept_rows(workspace.reports / "twins.csv", absent), [], []
    for name, table in measured.items():
        before, figure = kept[kept["experiment"] == name], f"{name}.png"
        summary = summarised(name, table, before) if len(table) else as_summary(before)
        if known := summary["inside"].notna().any():
            twins_figures.positions(folder / figure, facts(name).twin.title, summary)
        missing = "The recordings were not fetched" if summary["recorded"].isna().all() else ""
        reason = "" if known else missing or "The data are your own logs, not simulated"
        twin = facts(name).twin
        part = {
            "title": twin.title,
            "reason": reason,
            "figure": figure if known else "",
            "table": tables.twins(summary),
        }
        parts.append(part | {"said": told(twin.said, summary)})
        together.append(summary)
    files.write_text(folder / "README.md", render("twins", parts=parts))
    return pd.concat(together, ignore_index=True)


def told(said: str, summary: pd.DataFrame) -> str:
    """Return the words on a comparison with its numbers in them; nothing where one of these is not known.

    said: names them as {statistic[column]}, of the columns of `summary`.
    """
    rows = {row["statistic"]: row for row in summary[summary["inside"].notna()].to_dict("records")}
    named = {field.partition("[")[0] for _, field, *_ in Formatter().parse(said) if field}
    return said.format_map(rows) if named <= set(rows) else ""


def summarised(experiment: str, table: pd.DataFrame, kept: pd.DataFrame) -> pd.DataFrame:
    """Return one row per statistic: median, lowest and highest of the recordings and of the simulated ones.

    table: data/<experiment>/twins.csv; kept: rows of a former reports/twins.csv, for their recorded side. `inside`
    tells whether the simulated median lies within the recorded range; it is missing where one side is.
    """
    rows = []
    for statistic, values in table.groupby("statistic", sort=False):
        row = {"experiment": experiment, "statistic": statistic, "unit": str(values["unit"].iloc[0])}
        for side in SIDES:
            numbers = values[values["source"] == side]["value"].to_numpy(float)
            ends = (np.median(numbers), numbers.min(), numbers.max()) if len(numbers) else (np.nan,) * 3
            row |= dict(zip((side, f"{side}_low", f"{side}_high"), ends, strict=True))
        for former in kept[kept["statistic"] == statistic].to_dict("records") if len(kept) else []:
            row |= {name: former[name] for name in ("recorded", "recorded_low", "recorded_high")}
        known = np.isfinite(row["recorded"]) and np.isfinite(row["simulated"])
        inside = row["recorded_low"] <= row["simulated"] <= row["recorded_high"]
        note = values["note"].iloc[0]
        row |= {"inside": inside if known else None, "meaning": values["meaning"].iloc[0]}
        rows.append(row | {"note": note if isinstance(note, str) else ""})
    return as_summary(pd.DataFrame(rows))


def as_summary(rows: pd.DataFrame) -> pd.DataFrame:
    """Return rows of reports/twins.csv with its columns and their types."""
    return rows.reindex(columns=SUMMARY).astype({"inside": "boolean"}).fillna({"note": ""})
