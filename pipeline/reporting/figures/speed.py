"""Draw the charts of speed against accuracy from the table of pipeline/reporting/speed.py."""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.axis import Axis
from matplotlib.lines import Line2D
from matplotlib.ticker import LogLocator, MaxNLocator, NullFormatter, NullLocator

from pipeline.reporting.figures import style
from pipeline.reporting.figures.style import model_style
from pipeline.reporting.words.labels import FRONTS, SPREAD, TIMES

TOP = 0.97  # height of a failed model's mark, share of the axis


def chart(path: Path, table: pd.DataFrame, time: str) -> None:
    """Draw error against a measured time, one panel per panel of the table, the Pareto front joined.

    table: see `speed.speed_table`; time: a key of `labels.FRONTS`. Both axes are logarithmic. A model on the front is
    filled; one with a failed run is a cross of its colour at the top edge.
    """
    panels = list(dict.fromkeys(table["panel"]))
    columns = len(panels) if len(panels) < 4 else 2
    figure, axes = style.panels(len(panels), columns, max(6.6, 4.4 * columns), 3.8, 1.6)
    for ax, panel in zip(axes.flat, panels, strict=False):
        rows = table[table["panel"] == panel]
        first = rows.iloc[0]
        draw(ax, rows, time)
        seeds = rows["runs"] + rows["failed"]
        title = f"{panel}, seeds: {' to '.join(map(str, sorted({seeds.min(), seeds.max()})))}"
        if time == "train_s":
            title += f", budget: {', '.join(dict.fromkeys(rows['budget']))}"
        ax.set(title=title, xlabel=f"{TIMES[time]}, log scale")
        ax.set_ylabel(f"{first['measure']}, log scale")
    handles = [Line2D([], [], color=style.GREY, linewidth=1.2, label="Pareto front")]
    handles.append(Line2D([], [], marker="x", linestyle="", color=style.BLACK, label="cross at the top: a run failed"))
    if time == "train_s" and table["half_train_s"].notna().any():
        half = {"color": style.BLACK, "linewidth": 1.0, "marker": "o", "markersize": 4, "markerfacecolor": "white"}
        handles.append(Line2D([], [], **half, label="small: at half of the budget"))
    for look in map(model_style, dict.fromkeys(table["model"])):
        handles.append(Line2D([], [], marker=look.marker, linestyle="", color=look.color, label=look.label))
    figure.suptitle("Error with 95 % interval against time; filled: on the Pareto front (lower left is better)")
    figure.legend(handles=handles, loc="outside lower center", ncols=min(2 * columns + 1, 5))
    style.save(figure, path)


def draw(ax: plt.Axes, rows: pd.DataFrame, time: str) -> None:
    """Draw one panel; an interval that leaves the axis ends in an arrowhead, and an error of 0 is at the lower edge."""
    good, times = rows[rows["failed"] == 0], rows[time]
    least = good["error"][good["error"] > 0].min() / 3 if (good["error"] > 0).any() else 0.1
    heights = good["error"].clip(lower=least)
    bottom, top = (heights.min() / 1.7, 1.7 * heights.max()) if len(good) else (0.1, 1.0)
    half = rows[rows["half_error"].gt(0) & (rows["failed"] == 0)] if time == "train_s" else rows[:0]
    top, shortest = max(top, 1.2 * half["half_error"].max()) if len(half) else top, min([*times, *half["half_train_s"]])
    ax.set(xscale="log", yscale="log", ylim=(bottom, top), xlim=(shortest / 1.6, 1.6 * times.max()))
    style.plain_log(ax.xaxis)
    plain_errors(ax.yaxis)
    for row in rows.itertuples():
        look, at = model_style(row.model), getattr(row, time)
        if row.failed:
            ax.plot(at, TOP, "x", color=look.color, markersize=8, mew=2, transform=ax.get_xaxis_transform(), zorder=4)
            continue
        height, filled = max(row.error, least), getattr(row, FRONTS[time]) == 1
        ax.plot([getattr(row, name) for name in SPREAD[time]], (height, height), color=look.color, linewidth=1.3)
        if np.isfinite(row.low):
            wanted = (max(row.low, least / 1e3), max(row.high, height))
            ends = np.clip(wanted, bottom, top)
            ax.plot((at, at), ends, color=look.color, linewidth=1.3, zorder=2)
            for end, want, head in zip(ends, wanted, "v^", strict=True):
                ax.plot(at, end, head if end != want else "_", color=look.color, clip_on=False, zorder=2)
        edge = style.BLACK if filled and look.marker != "x" else look.color
        face = look.color if filled else "white"
        ax.plot(at, height, look.marker, markersize=9, color=face, markeredgecolor=edge, mew=1.2, zorder=3)
    for row in half.itertuples():
        look, at = model_style(row.model), ((row.half_train_s, row.train_s), (row.half_error, max(row.error, least)))
        ax.plot(*at, color=look.color, linewidth=0.9, zorder=2)
        ax.plot(at[0][0], at[1][0], look.marker, color=look.color, markerfacecolor="white", markersize=4, zorder=3)
    front = good[good[FRONTS[time]] == 1].sort_values([time, "error"])
    if len(front):
        steps = heights[front.index]
        across = [front[time].iloc[0], *front[time], ax.get_xlim()[1]]
        ax.step(across, [top, *steps, steps.iloc[-1]], where="post", color=style.GREY, linewidth=1.2, zorder=1)


def plain_errors(axis: Axis) -> None:
    """Write plain numbers at a logarithmic axis of errors, enough of them however short it is."""
    low, high = axis.get_view_interval()
    if high > 30 * low:
        style.plain_log(axis)
        return
    short = MaxNLocator(6, steps=(1, 2, 2.5, 5, 10)) if high < 5 * low else LogLocator(subs=(1, 2, 3, 5, 7))
    axis.set_major_locator(short)
    axis.set_minor_locator(NullLocator())
    axis.set_major_formatter("{x:g}")
    axis.set_minor_formatter(NullFormatter())
