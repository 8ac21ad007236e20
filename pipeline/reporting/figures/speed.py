"""Draw the charts of speed against accuracy from the table of pipeline/reporting/speed.py."""

import textwrap
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.axis import Axis
from matplotlib.lines import Line2D
from matplotlib.patheffects import withStroke
from matplotlib.ticker import LogLocator, MaxNLocator, NullFormatter, NullLocator

from pipeline.reporting.figures import style
from pipeline.reporting.figures.style import model_style
from pipeline.reporting.words.labels import FRONTS, SPREAD

NAME_WIDTH = 19  # characters of a line of a model's name
REACHES = (4, 9, 15, 22, 30, 40, 52, 66, 82)  # px from a marker's edge to its name
LEADER = 12  # px from a marker's edge, from where on a line joins a name to its marker
TOP = 0.965  # height of a failed model's mark, share of the axis


def chart(path: Path, table: pd.DataFrame, time: str) -> None:
    """Draw error against a measured time, one panel per panel of the table, all models named, the Pareto front joined.

    table: see `speed.speed_table`; time: a key of `labels.FRONTS`. Both axes are logarithmic.
    """
    panels = list(dict.fromkeys(table["panel"]))
    columns = len(panels) if len(panels) < 4 else 2
    width = 6.6 if columns == 1 else 4.9 * columns
    # Pixels as in the file: names are placed in them.
    figure, axes = style.panels(len(panels), columns, width, 4.3, 0.9, dpi=style.DPI)
    batch = table["batch"].iloc[0]
    name, xlabel = {
        "p50_ms": ("Speed", f"Median time of a prediction, batch {batch} (ms), log scale"),
        "train_s": ("Training time", "Training time, median over seeds (s), log scale"),
    }[time]
    points = {}
    for ax, panel in zip(axes.flat, panels, strict=False):
        rows = table[table["panel"] == panel]
        points[ax] = _points(ax, rows, time)
        first = rows.iloc[0]
        seeds = first["runs"] + first["failed"]
        ax.set(title=f"{panel} ({seeds} {'seed' if seeds == 1 else 'seeds'})", xlabel=xlabel)
        ax.set_ylabel(f"{first['measure']}, mean and 95 % interval, log scale")
    figure.suptitle(f"{name} against accuracy (lower left is better)")
    handles = _key(table)
    figure.legend(
        handles=handles, loc="outside lower center", ncols=min(2 + 2 * columns, len(handles)), columnspacing=1.4
    )
    figure.canvas.draw()
    figure.set_layout_engine("none")  # the axes stay where they are
    for ax, markers in points.items():
        _name(ax, markers)
    style.save(figure, path)


def marker_area(params: float) -> float:
    """Return an area in square points: the diameter grows with the logarithm of the number of parameters."""
    return (6 + 1.4 * np.log10(max(params, 1))) ** 2


def _key(table: pd.DataFrame) -> list[Line2D]:
    """Return a legend of filled, hollow and large markers."""
    dot = {"marker": "o", "linestyle": "", "color": style.BLACK, "markersize": 7}
    handles = [
        Line2D([], [], color=style.GREY, linewidth=1.2, label="Pareto front"),
        Line2D([], [], **dot, label="on the front"),
        Line2D([], [], **dot, markerfacecolor="white", label="dominated"),
    ]
    if table["failed"].any():
        handles.append(Line2D([], [], marker="x", linestyle="", color=style.VERMILION, label="failed"))
    decades = np.log10(np.maximum([table["params"].min(), table["params"].max()], 1))
    for power in sorted({int(decades[0]), int(decades.mean()), int(decades[1])}):
        dot["markersize"] = np.sqrt(marker_area(10**power))
        unit = "parameters" if power else "parameter"
        handles.append(Line2D([], [], **dot, markerfacecolor="#CCCCCC", label=f"{10**power:,} {unit}"))
    return handles


def _points(ax: plt.Axes, rows: pd.DataFrame, time: str) -> list[tuple[str, float, float, float]]:
    """Draw one panel, and return (name, time, error, marker area) of every model, the error NaN where it failed."""
    good = rows[rows["failed"] == 0]
    positive = good["error"][good["error"] > 0]
    least = positive.min() / 3 if len(positive) else 1.0  # where an error of zero is drawn, said in its name
    heights = good["error"].clip(lower=least)
    bottom, top = heights.min(), heights.max()
    if len(good):
        low, high = (good[end].fillna(heights) for end in ("low", "high"))
        bottom, top = max(low.min(), bottom / 2) / 1.2, min(high.max(), 2 * top) * 1.15
    else:
        bottom, top = 0.1, 1.0
    ax.set(xscale="log", yscale="log")
    if len(good) < len(rows):
        top *= (top / bottom) ** 0.12
    ax.set_ylim(bottom, top)
    times = rows[time]
    length = max(times.max() / times.min(), 4)
    ax.set_xlim(times.min() / length**0.12, times.max() * length**0.3)  # names need room on the right
    style.plain_log(ax.xaxis)
    if len(good):
        _ticks(ax.yaxis)
    else:
        ax.yaxis.set_major_locator(NullLocator())
        ax.yaxis.set_minor_locator(NullLocator())

    points = []
    for line in rows.itertuples():
        at, look, area = getattr(line, time), model_style(line.model), marker_area(line.params)
        name = textwrap.fill(look.label, NAME_WIDTH)
        if line.failed:
            edge = ax.get_xaxis_transform()
            ax.scatter(at, TOP, 50, style.VERMILION, marker="x", transform=edge, linewidths=2, zorder=4)
            runs = line.failed + line.runs
            name += f": failed\n({line.failed} of {runs} {'run' if runs == 1 else 'runs'})"
            points.append((name, at, np.nan, 50.0))
            continue
        height = max(line.error, least)
        measured = [getattr(line, name) for name in SPREAD[time]]
        ax.plot(measured, (height, height), color=look.color, linewidth=1.3, zorder=2)
        if np.isfinite(line.low):
            _interval(ax, at, max(line.low, least / 1e3), max(line.high, height), look.color)
        on = getattr(line, FRONTS[time])
        order = 5 - area / 1e3  # small ones stay visible on large ones
        if on:
            ax.scatter(at, height, area, look.color, edgecolors=style.BLACK, linewidths=0.8, zorder=order)
        else:  # a ring with black lines on both sides, so that light colours stand out; its outer edge as if filled
            ring = (np.sqrt(area) - 1.5) ** 2
            ax.scatter(at, height, ring, "white", edgecolors=style.BLACK, linewidths=2.4, zorder=order)
            ax.scatter(at, height, ring, "none", edgecolors=look.color, linewidths=1.3, zorder=order)
        points.append((name if line.error > 0 else f"{name}: 0", at, height, area))
    front = good[good[FRONTS[time]] == 1].sort_values([time, "error"])
    if len(front):
        right = ax.get_xlim()[1]
        steps = heights[front.index]
        ax.plot(
            [*front[time].iloc[:1], *front[time], right], [top, *steps, steps.iloc[-1]],
            drawstyle="steps-post", color=style.GREY, linewidth=1.2, zorder=1,
        )  # fmt: skip
    return points


def _interval(ax: plt.Axes, at: float, low: float, high: float, colour: str) -> None:
    """Draw an error bar; an end outside the axis is an arrowhead at its edge."""
    bottom, top = ax.get_ylim()
    ends = np.clip((low, high), bottom, top)
    ax.plot((at, at), ends, color=colour, linewidth=1.3, zorder=2)
    for end, wanted, head in ((ends[0], low, "v"), (ends[1], high, "^")):
        cut = end != wanted
        ax.plot(at, end, head if cut else "_", color=colour, markersize=7 if cut else 6, zorder=2, clip_on=False)


def _ticks(axis: Axis) -> None:
    """Write plain numbers at a logarithmic axis of errors, enough of them however short it is."""
    low, high = axis.get_view_interval()
    if high > 30 * low:
        style.plain_log(axis)
        return
    axis.set_major_locator(
        MaxNLocator(6, steps=(1, 2, 2.5, 5, 10)) if high < 5 * low else LogLocator(subs=(1, 2, 3, 5, 7))
    )
    axis.set_minor_locator(NullLocator())
    axis.set_major_formatter("{x:g}")
    axis.set_minor_formatter(NullFormatter())


def _name(ax: plt.Axes, points: list[tuple[str, float, float, float]]) -> None:
    """Write every name near its marker, joined by a line where it is not beside it; points: see `_points`."""
    frame = ax.get_window_extent().extents
    top = frame[1] + TOP * (frame[3] - frame[1])
    at = np.array([ax.transData.transform((x, 1 if np.isnan(y) else y)) for _, x, y, _ in points])
    at[[np.isnan(y) for _, _, y, _ in points], 1] = top
    radius = np.array([np.sqrt(area) / 2 * ax.figure.dpi / 72 + 2 for *_, area in points])
    halo = [withStroke(linewidth=2, foreground="white")]
    look = {"xycoords": "figure pixels", "va": "bottom", "fontsize": 8, "linespacing": 0.95, "zorder": 6}
    labels = [ax.annotate(name, (0, 0), path_effects=halo, **look) for name, *_ in points]
    sizes = np.array([(box.width, box.height) for box in (label.get_window_extent() for label in labels)])
    drawn = [(*(place - r), *(place + r), 12.0) for place, r in zip(at, radius, strict=True)]
    for line in ax.lines:  # error bars and the front
        path = ax.transData.transform(line.get_path().vertices)
        if line.get_drawstyle() == "steps-post":
            path = np.repeat(path, 2, axis=0)
            path = np.column_stack([path[1:, 0], path[:-1, 1]])
        for start, end in zip(path[:-1], path[1:], strict=True):
            drawn.append((*(np.minimum(start, end) - 2), *(np.maximum(start, end) + 2), 12.0))
    boxes = place_names(at, radius, sizes, np.array(drawn), frame + np.array([4, 4, 0, 0]))
    for label, box, place, r in zip(labels, boxes, at, radius, strict=True):
        label.set_position(box[:2])
        near = np.clip(place, box[:2], box[2:])
        far = np.hypot(*(near - place))
        if far > r + LEADER:
            edge = place + (near - place) * r / far
            line = Line2D(*zip(edge, near, strict=True), color=style.GREY, linewidth=0.7, transform=None, zorder=1.5)
            ax.figure.add_artist(line)


def place_names(
    at: np.ndarray, radius: np.ndarray, sizes: np.ndarray, drawn: np.ndarray, frame: np.ndarray
) -> np.ndarray:
    """Place names: boxes (n, 4) as left, bottom, right, top, in pixels, that cover little and never each other.

    at: (n, 2) middles of the markers; radius: (n,) of them; sizes: (n, 2) of the names; drawn: (m, 5) boxes of what
    should stay visible and how bad it is to cover it; frame: (4,) where names may lie. Each name in turn takes the
    cheapest of many places round its marker, given where the others are, until none moves.
    """
    turns = np.arange(0, 2 * np.pi, np.pi / 16)
    across, up = np.tile(np.cos(turns), len(REACHES)), np.tile(np.sin(turns), len(REACHES))
    reach = np.repeat(REACHES, len(turns)).astype(float)
    boxes = np.full((len(at), 4), np.nan)
    for _ in range(12):
        before = boxes.copy()
        for k in range(len(at)):
            width, height = sizes[k]
            left = at[k, 0] + across * (radius[k] + reach) - width * (1 - across) / 2
            bottom = at[k, 1] + up * (radius[k] + reach) - height * (1 - up) / 2
            choices = np.column_stack([left, bottom, left + width, bottom + height])
            others = np.delete(boxes, k, axis=0)
            others = others[np.isfinite(others).all(axis=1)]
            padded = choices + np.array([-5, -4, 5, 4])
            cost = reach / 6 + 40 * (_shared(padded, others) > 0).sum(axis=1)
            cost += 0.02 * _shared(padded, others).sum(axis=1) + _shared(padded, drawn[:, :4]) @ drawn[:, 4] / 100
            cost += width * height - _shared(choices, frame[None])[:, 0]
            # The line to the marker: through no other name and no other marker.
            near = np.clip(at[k], choices[:, :2], choices[:, 2:])
            for part in np.linspace(0.15, 1, 8):
                spot = at[k] + part * (near - at[k])
                for group in (others, np.delete(drawn[: len(at), :4], k, axis=0)):
                    cost += 4 * _within(spot, group).sum(axis=1)
            # Nearer to a foreign marker than to its own, a name would be read as the other one's.
            to_marker = np.hypot(*(near - at[k]).T) - radius[k]
            for other in np.delete(np.arange(len(at)), k):
                gap = np.hypot(*(np.clip(at[other], choices[:, :2], choices[:, 2:]) - at[other]).T) - radius[other]
                cost += 4.0 * ((gap < to_marker + 8) & (gap < 2 * LEADER))
            boxes[k] = choices[cost.argmin()]
        if np.array_equal(boxes, before):
            break
    return boxes


def _shared(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Return the area that boxes (n, 4) and (m, 4) share, (n, m)."""
    low = np.maximum(one[:, None, :2], other[None, :, :2])
    high = np.minimum(one[:, None, 2:4], other[None, :, 2:4])
    return np.maximum(high - low, 0).prod(axis=2)


def _within(spots: np.ndarray, boxes: np.ndarray) -> np.ndarray:
    """Tell whether spots (n, 2) lie in boxes (m, 4), (n, m)."""
    return ((spots[:, None] > boxes[None, :, :2]) & (spots[:, None] < boxes[None, :, 2:])).all(axis=2)
