"""Gather what the charts of the page draw: speed against accuracy of every model, with a sentence for each point.

page/charts.js draws them with Observable Plot, which is inlined with d3 (490 kB; Vega-Lite would add 830 kB, Plotly's
basic bundle 1.1 MB) and lets a chart have its own symbols and be drawn again for another axis. Markers and colours are
those of the figures.
"""

from collections.abc import Mapping
from itertools import chain
from math import isfinite

import pandas as pd
from matplotlib.markers import MarkerStyle

from pipeline.reporting.speed import ESTIMATE
from pipeline.results.times import one_machine
from tactile.drawing.labels import FRONTS, MACHINES, SPREAD, TIMES, model_name
from tactile.drawing.markdown import interval, number, size
from tactile.drawing.style import model_style
from tactile.scoring.estimates import Estimate

PLACE = ("panel", "protocol", "condition", "model", "measure")
COSTS = ("batch", "p50_ms", "p95_ms", "large_batch", "predictions_per_s", "train_s", "params", "macs", "size_bytes")
COLUMNS = (*PLACE, *ESTIMATE, *COSTS, *chain(*SPREAD.values()), *FRONTS.values(), *MACHINES.values())  # of table2.csv


def data(table: pd.DataFrame, name: str) -> dict:
    """Return what charts.js draws of a speed table: one chart per panel and measured time, of models that have one.

    Raises InputError where the times of a chart are of more than one machine.
    """
    rows = []
    for time in TIMES:
        timed = table[table[time].notna()]
        for panel, of_panel in timed.groupby("panel"):
            one_machine(of_panel[MACHINES[time]], f"{name}, {panel}, {TIMES[time]}")
        for row in timed.to_dict("records"):
            error = {key: finite(row[key]) for key in ("error", "low", "high")}
            low, high = (finite(row[key]) for key in SPREAD[time])
            rows.append(
                {"panel": row["panel"], "model": row["model"], "label": model_name(row["model"]), "axis": time}
                | error
                | {"failed": int(row["failed"]), "time": finite(row[time]), "time_low": low, "time_high": high}
                | {"front": int(row[FRONTS[time]]), "measure": row["measure"], "words": describe(row, time)}
                | {"machine": row[MACHINES[time]]}
            )
    looks = {model: look(model) for model in dict.fromkeys(row["model"] for row in rows)}
    return {"name": name, "axes": TIMES, "rows": rows, "models": looks}


def finite(value: float) -> float | None:
    """Return a number with six digits, None where it is not finite: JSON has no NaN."""
    return float(f"{value:.6g}") if isfinite(value) else None


def look(model: str) -> dict:
    """Return a model's name, colour and marker: polygons within -1 to 1, y upwards, and whether they are closed."""
    style = model_style(model)
    shape = MarkerStyle(style.marker)
    path = shape.get_path().transformed(shape.get_transform())
    polygons = [polygon for polygon in path.to_polygons(closed_only=False) if len(polygon) > 1]
    reach = max(abs(polygon).max() for polygon in polygons)
    return {
        "label": style.label,
        "color": style.color,
        "polygons": [[[round(float(x), 3) for x in point] for point in polygon / reach] for polygon in polygons],
        "closed": bool(shape.is_filled()),
    }


def describe(row: Mapping, time: str) -> str:
    """Return one row of the speed table as a list of its numbers."""
    error = interval(Estimate(*(row[key] for key in ESTIMATE)))
    on = "on the front" if row[FRONTS[time]] == 1 else "not on the front"
    predicting = "predictions not timed"
    if isfinite(row["p50_ms"]):
        predicting = (
            f"{row['p50_ms']:.3g} ms median and {row['p95_ms']:.3g} ms 95th percentile at batch {row['batch']:.0f}, "
            f"{row['predictions_per_s']:,.0f} predictions per second at batch {row['large_batch']:.0f}"
        )
    training = f"training {number(row['train_s'])} s" if isfinite(row["train_s"]) else "training not timed"
    return (
        f"{model_name(row['model'])}, {row['panel']}: {row['measure']} {error}; {predicting}; {training}; parameters "
        f"{size(row['params'])}; multiply-accumulates {size(row['macs'])}; file {size(row['size_bytes'])} bytes; {on}"
    )
