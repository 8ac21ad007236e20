"""Draw the charts of speed against accuracy from the table of pipeline/reporting/speed.py."""

import math
from collections.abc import Iterable, Mapping
from itertools import product
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.axis import Axis
from matplotlib.lines import Line2D
from matplotlib.patheffects import withStroke
from matplotlib.ticker import LogLocator, MaxNLocator, NullFormatter, NullLocator

from pipeline.results.times import one_machine
from tactile.drawing import style
from tactile.drawing.labels import FRONTS, MACHINES, SPREAD, TIMES
from tactile.drawing.style import model_style

TOP = 0.97  # height of a failed model's mark, share of the axis
REACH = 1.7  # times an error: so much of its interval is shown; that of few seeds may reach over decades
ROOM = 0.06  # beside what is drawn, share of an axis
FLOOR = "constant"  # is a line; where its error is far above the others, its number alone
FLOOR_LINE = {"color": style.BLACK, "linestyle": ":", "linewidth": 1.2}
FAR = 1.5  # times the largest error of the others
SMALL = 8  # points, of names
Marks = Mapping[str, tuple[float, float]]  # model -> its place in a panel, in data
AWAY = (7, 13, 21, 30, 42, 56, 72)  # of a name from its mark, points
DIRECTIONS = [(math.cos(k * math.pi / 8), math.sin(k * math.pi / 8)) for k in (0, 8, *range(1, 8), *range(9, 16))]


def chart(path: Path, table: pd.DataFrame, time: str, name: str) -> None:
    """Draw error against a measured time, one panel per panel of the table, the Pareto front joined.

    table: see `speed.speed_table`; time: a key of `labels.FRONTS`; name: of the experiment, for the title. Both axes
    are logarithmic. A model on the front is filled; one with a failed run is a cross of its colour at the top edge. The
    constant model is a line. One without a time is left out, and nothing is drawn where none has a time. Raises
    InputError where the times are of more than one machine.
    """
    table = table[table[time].notna() & (table["runs"] + table["failed"] > 0)]
    machine = one_machine(table[MACHINES[time]], f"{name}, {TIMES[time]}")
    panels = list(dict.fromkeys(table["panel"][table["model"] != FLOOR]))
    if not panels:
        return
    columns = len(panels) if len(panels) < 4 else 2
    figure, axes = style.panels(len(panels), columns, max(6.6, 4.6 * columns), 4.2, 1.2)
    named = {}
    for ax, panel in zip(axes.flat, panels, strict=False):
        rows = table[table["panel"] == panel]
        first = rows.iloc[0]
        named[ax] = draw(ax, rows, time)
        runs = rows["runs"] + rows["failed"]
        said = " to ".join(map(str, sorted({runs.min(), runs.max()}))) + (" seed" if runs.max() == 1 else " seeds")
        if time == "train_s":
            said += f", budget: {', '.join(dict.fromkeys(rows['budget']))}"
        ax.set(title=f"{panel}, {said}", xlabel=TIMES[time], ylabel=first["measure"])
    handles = [Line2D([], [], color=style.GREY, linewidth=1.2, label="Pareto front")]
    if any(line.get_linestyle() == FLOOR_LINE["linestyle"] for ax in named for line in ax.lines):
        handles.append(Line2D([], [], **FLOOR_LINE, label=model_style(FLOOR).label))
    if (table["failed"] > 0).any():
        handles.append(
            Line2D([], [], marker="x", linestyle="", color=style.BLACK, label="cross at the top: a run failed")
        )
    if time == "train_s" and table["half_train_s"].notna().any():
        half = {"color": style.BLACK, "linewidth": 1.0, "marker": "o", "markersize": 4, "markerfacecolor": "white"}
        handles.append(Line2D([], [], **half, label="small: at half of the budget"))
    with_interval = " with 95 % interval over the seeds" if np.isfinite(table["low"]).any() else ""
    what = TIMES[time].partition(" (")[0].lower()
    figure.suptitle(
        f"{name}: error{with_interval} against {what}, measured on {machine}\n"
        "filled: on the Pareto front (lower left is better)"
    )
    figure.legend(handles=handles, loc="outside lower center", ncols=len(handles))
    figure.draw_without_rendering()  # names are placed where the layout has put the axes
    for ax, marks in named.items():
        name_marks(ax, marks)
    style.save(figure, path)


def draw(ax: plt.Axes, rows: pd.DataFrame, time: str) -> Marks:
    """Draw one panel, and return what has a name in it.

    An interval that leaves the axis ends in an arrowhead, and an error of 0 is at the lower edge.
    """
    floor, rows = rows[rows["model"] == FLOOR], rows[rows["model"] != FLOOR]
    good = rows[rows["failed"] == 0]
    least = good["error"][good["error"] > 0].min() / 3 if (good["error"] > 0).any() else 0.1
    heights = good["error"].clip(lower=least)
    half = rows[rows["half_error"].gt(0) & (rows["failed"] == 0)] if time == "train_s" else rows[:0]
    lows, highs = good["low"].clip(lower=heights / REACH), good["high"].clip(heights, heights * REACH)
    constant = float(floor["error"].where(floor["failed"] == 0).max())
    near = [max(constant, least)] if constant <= FAR * max([*heights, *highs.dropna()], default=np.inf) else []
    tall = [*heights, *lows, *highs, *half["half_error"], *near]
    bottom, top = ends(tall) if len(tall) else (0.1, 1.0)
    across = ends([*rows[[time, *SPREAD[time]]].to_numpy().ravel(), *half["half_train_s"]])
    ax.set(xscale="log", yscale="log", ylim=(bottom, top), xlim=across)
    style.plain_log(ax.xaxis)
    plain_errors(ax.yaxis)
    if near:
        ax.axhline(*near, **FLOOR_LINE, zorder=1)
    elif np.isfinite(constant):
        said = f"{model_style(FLOOR).label}: {constant:.3g}, above"
        ax.text(0.99, 0.99, said, transform=ax.transAxes, ha="right", va="top", fontsize=SMALL)
    marks = {}
    for row in rows.itertuples():
        look, at = model_style(row.model), getattr(row, time)
        if row.failed:
            ax.plot(at, TOP, "x", color=look.color, markersize=8, mew=2, transform=ax.get_xaxis_transform(), zorder=4)
            marks[row.model] = at, bottom * (top / bottom) ** TOP
            continue
        height, filled = max(row.error, least), getattr(row, FRONTS[time]) == 1
        marks[row.model] = at, height
        ax.plot([getattr(row, name) for name in SPREAD[time]], (height, height), color=look.color, linewidth=1.3)
        if np.isfinite(row.low):
            wanted = (max(row.low, least / 1e3), max(row.high, height))
            drawn = np.clip(wanted, bottom, top)
            ax.plot((at, at), drawn, color=look.color, linewidth=1.3, zorder=2)
            for end, want, head in zip(drawn, wanted, "v^", strict=True):
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
    return marks


def name_marks(ax: plt.Axes, marks: Marks) -> None:
    """Write the name of each mark where it covers least; one that is not beside its mark has a line to it.

    The layout of the figure is to be known.
    """
    point, inside = ax.figure.dpi / 72, ax.get_window_extent().extents
    places = {model: ax.transData.transform(place) for model, place in marks.items()}
    around = point * np.array(list(product((-4, 0, 4), repeat=2)))
    dots = np.concatenate([*(_dots(line, 3 * point) for line in ax.lines), *(at + around for at in places.values())])
    ways = np.array([(away, *way) for away, way in product(AWAY, DIRECTIONS)])
    taken = np.array([text.get_window_extent().extents for text in ax.texts]).reshape(-1, 4)
    for model, at in places.items():
        look = model_style(model)
        measured = ax.text(0, 0, look.label, fontsize=SMALL)
        size = measured.get_window_extent().size
        measured.remove()
        low = at + ways[:, :1] * point * ways[:, 1:] - size * (1 - ways[:, 1:]) / 2
        boxes = np.hstack([low, low + size])
        covered = ((boxes[:, None, :2] - point < dots) & (dots < boxes[:, None, 2:] + point)).all(axis=2).sum(axis=1)
        overlap = _shared(boxes[:, None], taken[None]).sum(axis=1)
        outside = size.prod() - _shared(boxes, inside)
        cost = covered + 100 * (overlap + outside) / size.prod() + 6 * ways[:, 0] / AWAY[-1]
        best = int(cost.argmin())
        taken = np.vstack([taken, boxes[best]])
        line = {"arrowstyle": "-", "color": look.color, "linewidth": 0.7, "shrinkA": 0, "shrinkB": 3}
        line["relpos"] = tuple((1 - ways[best, 1:]) / 2)
        ax.annotate(
            look.label, marks[model], (low[best] - at) / point, textcoords="offset points", fontsize=SMALL, zorder=5,
            arrowprops=line if ways[best, 0] > AWAY[0] else None, in_layout=False, annotation_clip=False,
            path_effects=[withStroke(linewidth=2, foreground="white")],
        )  # fmt: skip


def _dots(line: Line2D, step: float) -> np.ndarray:
    """Return places along a line, (n, 2) in pixels, about `step` from each other."""
    corners = line.get_transform().transform(line.get_xydata())
    if line.get_drawstyle() != "default":  # a staircase
        corners = np.column_stack([np.repeat(corners[:, 0], 2)[1:], np.repeat(corners[:, 1], 2)[:-1]])
    along = np.concatenate([[0], np.cumsum(np.hypot(*np.diff(corners, axis=0).T))])
    at = np.arange(0, along[-1] + step, step)
    return np.column_stack([np.interp(at, along, side) for side in corners.T])


def _shared(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Return the areas that boxes share; one, other: (..., 4) left, bottom, right, top."""
    sides = np.minimum(one[..., 2:], other[..., 2:]) - np.maximum(one[..., :2], other[..., :2])
    return sides.clip(min=0).prod(axis=-1)


def ends(values: Iterable[float]) -> tuple[float, float]:
    """Return the limits of a logarithmic axis that show all values, and some room beside; NaN is none."""
    known = [value for value in values if np.isfinite(value)]
    room = max((max(known) / min(known)) ** ROOM, 1.05)
    return min(known) / room, max(known) * room


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
