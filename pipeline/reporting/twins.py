"""Write for people how recordings and the scenes that stand for them compare: reports/twins."""

import shutil
from pathlib import Path

import numpy as np
import pandas as pd

from pipeline.base import files
from pipeline.base.paths import Workspace
from pipeline.reporting.figures import twins as twins_figure
from pipeline.reporting.sentences import caption, picture
from pipeline.reporting.words import markdown
from pipeline.reporting.words.labels import capitalised, plain
from pipeline.scoring import results
from pipeline.scoring.kept import kept_rows

TITLES = {
    "touch": "Touch: the recorded Velostat taxel and the array's element",
    "strain": "Strain: the recorded strands and the finger's",
    "glove": "Glove: recorded grasps of a robot hand and those of the glove",
}
COLUMNS = ["statistic", "unit", "source", "recording", "value", "meaning", "note"]  # of data/<experiment>/twins.csv
SIDES = ("recorded", "simulated")
SUMMARY = ["experiment", "statistic", "unit", *(f"{side}{end}" for side in SIDES for end in ("", "_low", "_high"))]
SUMMARY += ["inside", "meaning", "note"]  # columns of reports/twins.csv


def write(workspace: Workspace, folder: Path, former: Path) -> pd.DataFrame:
    """Write README.md and one figure per experiment into the empty `folder`, and return reports/twins.csv.

    former: the folder that is replaced. Where recordings are absent, their side of its twins.csv and its figure stay.
    """
    tables = {
        name: results.read_csv(workspace.twins(name), COLUMNS, f"python -m pipeline.stages.twins {name}")
        for name in TITLES
    }
    absent = [name for name, table in tables.items() if set(table["source"]) == {"simulated"}]
    kept = kept_rows(former.with_suffix(".csv"), absent)
    summary = {
        name: summarised(name, table, kept[kept["experiment"] == name] if name in absent else None)
        for name, table in tables.items()
    }
    for name, table in tables.items():
        if set(SIDES) <= set(table["source"]):
            twins_figure.positions(folder / f"{name}.png", TITLES[name], table, summary[name])
        elif summary[name]["inside"].notna().any() and (former / f"{name}.png").is_file():
            shutil.copy(former / f"{name}.png", folder)
    files.write_text(folder / "README.md", readme(summary))
    return pd.concat(summary.values(), ignore_index=True)


def summarised(experiment: str, table: pd.DataFrame, kept: pd.DataFrame | None = None) -> pd.DataFrame:
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
        for former in [] if kept is None or kept.empty else kept[kept["statistic"] == statistic].to_dict("records"):
            row |= {name: former[name] for name in ("recorded", "recorded_low", "recorded_high")}
        known = np.isfinite(row["recorded"]) and np.isfinite(row["simulated"])
        inside = row["recorded_low"] <= row["simulated"] <= row["recorded_high"]
        row |= {"inside": inside if known else None}
        rows.append(row | {"meaning": values["meaning"].iloc[0], "note": _text(values["note"].iloc[0])})
    return pd.DataFrame(rows, columns=SUMMARY).astype({"inside": "boolean"})


def _text(value) -> str:
    """Return a cell of text, empty where the CSV has none."""
    return value if isinstance(value, str) else ""


def readme(summary: dict[str, pd.DataFrame]) -> str:
    """Return README.md; summary: experiment -> rows of reports/twins.csv."""
    parts = [
        "# Are the scenes like the recordings?\n",
        "Each simulated scene stands for a sensor of which there are recordings. The same model-free statistics are "
        "taken of both: no model, no label map and no verdict is involved. A recorded value is the median over "
        "recordings, with the lowest and the highest; a simulated value is in range if its median lies between these "
        "two. [All numbers](../twins.csv).\n",
    ]
    for experiment, table in summary.items():
        parts.append(f"## {TITLES[experiment]}\n")
        known = table["inside"].dropna()
        if not len(known):
            missing = "The recordings were not fetched" if table["recorded"].isna().all() else ""
            parts.append(f"{missing or 'The data are your own logs, not simulated'}: there is nothing to compare.\n")
            continue
        parts += [
            f"{picture(experiment, figure_caption(table))}\n",
            markdown.table(["Statistic", "Unit", "Recorded", "Simulated", "In range"], _rows(table)),
            *[f"- {name_of(row.statistic)}: {row.meaning}" for row in table.itertuples()],
            "",
        ]
        outside = table[table["inside"].eq(False)]
        if len(outside):
            parts.append("Out of range, and what is done about it:\n")
            parts += [f"- {name_of(row.statistic)}: {row.note or 'nothing yet.'}" for row in outside.itertuples()]
            parts.append("")
    return "\n".join(parts)


def figure_caption(table: pd.DataFrame) -> str:
    """Return the caption of an experiment's figure; table: its rows of reports/twins.csv, some with both sides."""
    both = table[table["inside"].notna()]
    outside = both[both["inside"].eq(False)]
    inside = f"{len(both) - len(outside)} of {len(both)} simulated values lie in the recorded range"
    if outside.empty:
        return caption(inside)
    width = (outside["recorded_high"] - outside["recorded_low"]).to_numpy(float)
    below, above = outside["recorded_low"] - outside["simulated"], outside["simulated"] - outside["recorded_high"]
    distance = np.maximum(below, above).to_numpy(float) / np.where(width > 0, width, 1.0)
    farthest = outside.iloc[int(distance.argmax())]
    unit = unit_of(farthest["unit"])
    ends = f"{farthest['recorded_low']:.3g} to {farthest['recorded_high']:.3g} recorded"
    return caption(
        inside,
        f"farthest outside is {plain(farthest['statistic'])}: {farthest['simulated']:.3g} simulated, {ends}"
        + (f" ({unit})" if unit else ""),
    )


def name_of(statistic: str) -> str:
    """Return the name of a statistic at the start of a line."""
    return capitalised(plain(statistic))


def unit_of(unit: str) -> str:
    """Return a unit as people read it: nothing for a plain number, and what a logarithm is of."""
    return {"1": "", "log": "log of the reading", "deg": "degrees"}.get(unit, unit)


def _rows(table: pd.DataFrame) -> list[list[str]]:
    """Return the cells of one experiment's table."""
    return [
        [
            name_of(row["statistic"]),
            unit_of(row["unit"]),
            *(_range(row[side], row[f"{side}_low"], row[f"{side}_high"]) for side in SIDES),
            {True: "yes", False: "**no**"}[bool(row["inside"])],
        ]
        for _, row in table.iterrows()
    ]


def _range(middle: float, low: float, high: float) -> str:
    """Return `median (lowest to highest)`."""
    return f"{middle:.3g} ({low:.3g} to {high:.3g})"
