"""Draw speed against accuracy as SVG inside a page: every model's row shows under the pointer or the keyboard's focus.

It is written by hand because every model needs an element of its own, with words, that the pointer and the keyboard
reach, and the page loads nothing: matplotlib's SVG has no such elements, and plotly or bokeh would add megabytes of
script to it. Markers and colours are those of the figures.
"""

from collections.abc import Mapping, Sequence
from html import escape
from itertools import chain
from math import ceil, floor, isfinite, log10

import pandas as pd
from matplotlib.markers import MarkerStyle

from pipeline.reporting.figures.style import model_style
from pipeline.reporting.speed import ESTIMATE
from pipeline.reporting.words.labels import FRONTS, SPREAD, model_name
from pipeline.reporting.words.markdown import interval, number, size
from pipeline.scoring.results import Estimate

WIDTH, HEIGHT = 380, 300  # of a chart's coordinates
LEFT, RIGHT, TOP, BOTTOM = 46, 14, 12, 42  # px around the axes
RADIUS = 6.5  # px of a marker
COSTS = ("batch", "p50_ms", "p95_ms", "large_batch", "predictions_per_s", "train_s", "params", "macs", "size_bytes")
# Columns that the charts need.
COLUMNS = ("panel", "model", "measure", *ESTIMATE, *COSTS, *chain(*SPREAD.values()), *FRONTS.values())
AXES = {"p50_ms": "Median time of a prediction (ms)", "train_s": "Training time (s)"}


def charts(table: pd.DataFrame, name: str) -> str:
    """Return all panels of a speed table (see `speed.speed_table`), against both times, with one legend."""
    figures = [
        f"<figure><figcaption>{escape(panel)}: {escape(AXES[time].lower())}</figcaption>"
        f"{chart(rows, time, f'{name}, {panel}')}</figure>"
        for time in FRONTS
        for panel, rows in table.groupby("panel", sort=False)
    ]
    columns = 3 if table["panel"].nunique() == 3 else 2
    return (
        f'<div class="charts"><p class="readout" aria-live="polite">Point at a model, or move to it with the Tab key: '
        f'its row shows here.</p><div class="panels" style="--columns: {columns}">{"".join(figures)}</div>'
        f"{legend(table)}</div>"
    )


def legend(table: pd.DataFrame) -> str:
    """Return marker and name of every model, and the meaning of filled and hollow."""
    items = [
        f'<li data-model="{escape(model)}"><svg viewBox="-9 -9 18 18" width="18" height="18" aria-hidden="true">'
        f"{marker(model, 0, 0, True)}</svg>{escape(model_name(model))}</li>"
        for model in dict.fromkeys(table["model"])
    ]
    return (
        f'<ul class="legend">{"".join(items)}</ul><p class="note">Lower left is better; both axes are logarithmic. '
        "Filled: on the Pareto front (grey line), no other model equals it in both and beats it in one. Hollow: "
        "dominated. Bars: 95 % intervals, cut off at the axis. A red cross at the top edge: a model with failed runs."
        "</p>"
    )


def chart(rows: pd.DataFrame, time: str, name: str) -> str:
    """Return one panel. rows: those of the speed table; time: a key of `labels.FRONTS`."""
    good = rows[rows["failed"] == 0]
    errors = good["error"][good["error"] > 0]
    least = errors.min() / 3 if len(errors) else 0.1  # where an error of zero is drawn
    x_ends = rows[time].min() / 1.6, rows[time].max() * 1.6
    y_ends = (least, 1.0)
    if len(good):
        heights = good["error"].clip(lower=least)
        low, high = (good[end].fillna(heights) for end in ("low", "high"))
        y_ends = max(low.min(), heights.min() / 2) / 1.2, max(heights.max(), min(high.max(), 2 * heights.max())) * 1.25

    def x(value: float) -> float:
        share = log10(value / x_ends[0]) / log10(x_ends[1] / x_ends[0])
        return round(LEFT + share * (WIDTH - LEFT - RIGHT), 1)

    def y(value: float) -> float:
        value = min(max(value, y_ends[0]), y_ends[1])
        share = log10(value / y_ends[0]) / log10(y_ends[1] / y_ends[0])
        return round(HEIGHT - BOTTOM - share * (HEIGHT - TOP - BOTTOM), 1)

    bottom, right = HEIGHT - BOTTOM, WIDTH - RIGHT
    parts = [f'<path class="axis" d="M{LEFT} {TOP}V{bottom}H{right}"/>']
    for value in ticks(*x_ends):
        parts.append(f'<path class="grid" d="M{x(value)} {TOP}V{bottom}"/>')
        parts.append(f'<text x="{x(value)}" y="{bottom + 15}" text-anchor="middle">{value:g}</text>')
    for value in ticks(*y_ends) if len(good) else ():
        parts.append(f'<path class="grid" d="M{LEFT} {y(value)}H{right}"/>')
        parts.append(f'<text x="{LEFT - 5}" y="{y(value) + 4}" text-anchor="end">{value:g}</text>')
    middle, measure = (LEFT + right) / 2, rows["measure"].iloc[0]
    parts.append(f'<text x="{middle}" y="{HEIGHT - 8}" text-anchor="middle">{escape(AXES[time])}</text>')
    turned = f"translate(12 {(TOP + bottom) / 2})rotate(-90)"
    parts.append(f'<text transform="{turned}" text-anchor="middle">{escape(measure)}</text>')
    front = good[good[FRONTS[time]] == 1].sort_values([time, "error"])
    if len(front):
        steps = "".join(f"H{x(row[time])}V{y(row['error'])}" for row in front.to_dict("records"))
        parts.append(f'<path class="front" d="M{x(front[time].iloc[0])} {TOP}{steps}H{right}"/>')
    # The slowest first: Tab goes from left to right, and small markers are not hidden.
    for row in rows.sort_values(time, kind="stable").to_dict("records"):
        words, at = escape(describe(row, time)), x(row[time])
        if row["failed"]:
            drawn = f'<path class="failed" d="M{at - 5} {TOP}l10 10m0 -10l-10 10"/>'
        else:
            drawn = marker(row["model"], at, y(row["error"]), row[FRONTS[time]] == 1)
            if isfinite(row["low"]):
                drawn = f'<path class="interval" d="M{at} {y(row["low"])}V{y(row["high"])}"/>{drawn}'
            low, high = (x(row[name]) for name in SPREAD[time])
            drawn = f'<path class="interval" d="M{low} {y(row["error"])}H{high}"/>{drawn}'
        parts.append(
            f'<g class="point" tabindex="0" role="img" data-model="{escape(row["model"])}" aria-label="{words}">'
            f"<title>{words}</title>{drawn}</g>"
        )
    label = escape(f"{name}: {measure} against {AXES[time].lower()}, {len(rows)} models")
    return f'<svg class="chart" viewBox="0 0 {WIDTH} {HEIGHT}" role="group" aria-label="{label}">{"".join(parts)}</svg>'


def describe(row: Mapping, time: str) -> str:
    """Return one row of the speed table as a sentence."""
    error = interval(Estimate(*(row[key] for key in ESTIMATE)))
    on = "on the front" if row[FRONTS[time]] == 1 else "not on the front"
    return (
        f"{model_name(row['model'])}, {row['panel']}: {row['measure']} {error}; {row['p50_ms']:.3g} ms median and "
        f"{row['p95_ms']:.3g} ms 95th percentile at batch {row['batch']}, {row['predictions_per_s']:,.0f} predictions "
        f"a second at batch {row['large_batch']}; training {number(row['train_s'])} s; {size(row['params'])} "
        f"parameters; MACs {size(row['macs'])}; file {size(row['size_bytes'])} bytes; {on}"
    )


def marker(model: str, x: float, y: float, filled: bool) -> str:
    """Return a model's marker, as in the figures, around (x, y); hollow where not `filled`."""
    look = model_style(model)
    shape = MarkerStyle(look.marker)
    path = shape.get_path().transformed(shape.get_transform())
    vertices = [part for part in path.to_polygons(closed_only=False) if len(part) > 1]
    reach = max(abs(part).max() for part in vertices)
    drawn = "".join(
        "M" + "L".join(f"{x + RADIUS * px / reach:.1f} {y - RADIUS * py / reach:.1f}" for px, py in part)
        + ("Z" if shape.is_filled() else "")
        for part in vertices
    )  # fmt: skip
    if not shape.is_filled():
        return f'<path d="{drawn}" fill="none" stroke="{look.color}" stroke-width="{3 if filled else 1.8}"/>'
    if filled:
        return f'<path d="{drawn}" fill="{look.color}" stroke="#000"/>'
    # Dark lines on both sides of the colour, so that light ones stand out.
    return (
        f'<path d="{drawn}" fill="#fff" stroke="#000" stroke-width="3.4"/>'
        f'<path d="{drawn}" fill="#fff" stroke="{look.color}" stroke-width="1.8"/>'
    )


def ticks(low: float, high: float) -> Sequence[float]:
    """Return round numbers inside a logarithmic axis: decades if there are three, else 1-2-5, else all digits."""
    powers, inside = range(floor(log10(low)), ceil(log10(high)) + 1), []
    for digits in ((1,), (1, 2, 5), range(1, 10)):
        values = [float(f"{digit}e{power}") for power in powers for digit in digits]
        inside = [value for value in values if low <= value <= high]
        if len(inside) >= 3:
            return inside
    return inside if len(inside) == 2 else [float(f"{value:.3g}") for value in (low * 1.001, high * 0.999)]
