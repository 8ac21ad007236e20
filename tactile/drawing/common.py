"""Draw courses over time, true against predicted values, maps and confusions. Each function writes one PNG."""

import textwrap
from collections.abc import Mapping, Sequence
from itertools import cycle
from pathlib import Path
from typing import Any, NamedTuple

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.colors import Normalize, PowerNorm
from matplotlib.ticker import MaxNLocator

from tactile.drawing import style
from tactile.drawing.labels import model_name
from tactile.drawing.style import MEASURED, model_style

CHANNELS = (style.BLUE, style.ORANGE, style.GREEN, style.VERMILION, style.PURPLE, style.BLACK)  # colours
GAP = 3.0  # median intervals; no line is drawn over a longer one
LEAST_PERCENT = 1.0  # a cell of a confusion matrix is labelled from here on
SIDE_IN = 1.55  # of a map, inches
MARGIN = 0.3  # of the range of true values, by which predicted ones may leave it in a cloud of points


def legend_below(figure: plt.Figure, handles: Mapping[str, Any], columns: int) -> None:
    """Put one legend of all panels below them; handles: name -> what was drawn."""
    figure.legend(handles.values(), handles, loc="outside lower center", ncols=max(1, min(columns, len(handles))))


class Course(NamedTuple):
    """A panel of `courses`: arrays of shape (n,) by time."""

    name: str  # of its vertical axis
    time_s: np.ndarray
    truth: np.ndarray | None
    predicted: Mapping[str, np.ndarray]  # model -> values
    title: str = ""
    readings: np.ndarray | None = None  # (n, channels), drawn instead


def courses(path: Path, title: str, panels: Sequence[Course], xlabel: str, sharey: bool = False) -> None:
    """Draw readings, true and predicted values over time, one panel below the other; long gaps stay open."""
    figure, axes = style.panels(len(panels), 1, 9, 2.2, 0.8, sharey=sharey)
    handles = {}
    for ax, (name, time_s, truth, predicted, heading, readings) in zip(axes[:, 0], panels, strict=True):
        steps = np.diff(time_s)
        breaks = np.flatnonzero(steps > GAP * np.median(steps)) + 1 if len(steps) else np.empty(0, int)
        at = np.insert(time_s.astype(float), breaks, np.nan)
        if readings is not None:
            for k, (channel, colour) in enumerate(zip(readings.T, cycle(CHANNELS), strict=False)):
                values = np.insert(channel.astype(float), breaks, np.nan)
                ax.plot(at, values, color=colour, linewidth=0.9, label=f"strand {k + 1}")
            ax.legend(loc="upper left", bbox_to_anchor=(1, 1))
        for model, values in predicted.items():
            look = model_style(model)
            drawn: dict[str, Any] = {"color": look.color, "linestyle": look.linestyle, "linewidth": 1.2}
            (handles[look.label],) = ax.plot(at, np.insert(values.astype(float), breaks, np.nan), **drawn)
        if truth is not None:
            drawn = MEASURED | {"linewidth": 1.1}
            (handles["measured"],) = ax.plot(at, np.insert(truth.astype(float), breaks, np.nan), **drawn)
        ax.set(ylabel=name, title=heading)
    axes[-1, 0].set_xlabel(xlabel)
    legend_below(figure, handles, 5)
    figure.suptitle(style.literal(title))
    style.save(figure, path)


class Cloud(NamedTuple):
    """A panel of `agreement`: true and predicted values, (n,)."""

    title: str
    truth: np.ndarray
    predicted: np.ndarray
    model: str


def agreement(path: Path, title: str, rows: Mapping[str, Sequence[Cloud]], unit: str) -> None:
    """Draw predicted against true values, one row of panels per name, all on the same axes; unit: of both."""
    truth = np.concatenate([cloud.truth for clouds in rows.values() for cloud in clouds])
    low, high = truth.min(initial=0), max(truth.max(initial=0), 1e-9)
    columns, room = max(map(len, rows.values())), high - low
    figure, axes = style.panels(len(rows) * columns, columns, 2.1 * columns + 0.6, 2.2, 0.7, sharex=True, sharey=True)
    for line_of_axes, (name, clouds) in zip(axes, rows.items(), strict=True):
        for ax, cloud in zip(line_of_axes, clouds, strict=True):
            ax.plot([low, high], [low, high], color=style.GREY, linewidth=0.8)
            ax.plot(cloud.truth, cloud.predicted, ".", color=model_style(cloud.model).color, markersize=2.5)
            ax.set(xlim=(low - 0.05 * room, high + 0.05 * room), ylim=(low - MARGIN * room, high + MARGIN * room))
            if ax.get_subplotspec().is_first_row():
                ax.set_title("\n".join([textwrap.fill(model_name(cloud.model), 20), cloud.title]).rstrip())
            if ax.get_subplotspec().is_last_row():
                ax.set_xlabel(f"true ({unit})")
        line_of_axes[0].set_ylabel("\n".join(filter(None, [name, f"predicted ({unit})"])))
    figure.suptitle(style.literal(title))
    style.save(figure, path)


class Maps(NamedTuple):
    """What maps are of, and how it is coloured."""

    truth: str  # heading of the true maps
    unit: str
    label: str  # of the bar of colours
    highest: float  # in `unit`, of the darkest colour
    power: float = 1.0  # of the share of `highest` that a colour stands for; below 1 small values show, too
    peaks: bool = False  # the largest value of each map is written below it


PRESSURE = "Pressure (kPa), on a scale of square roots"


def pressures(truth: np.ndarray) -> Maps:
    """Return how maps of pressure beside these true ones are drawn, in kPa."""
    return Maps("Label", "kPa", PRESSURE, max(float(truth.max()), 1.0), power=0.5, peaks=True)


def maps(
    path: Path,
    title: str,
    caption: str,
    names: Sequence[str],
    readings: np.ndarray,
    truth: np.ndarray,
    predicted: Mapping[str, np.ndarray],
    sensor: Mapping,
    of: Maps,
) -> None:
    """Draw one frame a row: its reading, its true map, and the maps that models predict, with their RMSE.

    names: of the n frames; readings: (n, elements) in counts; truth and each of `predicted`, by model: (n, map_rows,
    map_cols). All maps have one scale of colours, and so have all readings. title: what was chosen; caption: what the
    predictions are of.
    """
    extent = (0, sensor["cols"] * sensor["pitch_mm"], 0, sensor["rows"] * sensor["pitch_mm"])
    columns = {"Reading": readings.reshape(-1, sensor["rows"], sensor["cols"]), of.truth: truth}
    columns |= {model_name(model): values for model, values in predicted.items()}
    size = {"figsize": (SIDE_IN * len(columns) + 1.2, (SIDE_IN + 0.2) * len(names) + 1.6)}
    figure, axes = plt.subplots(len(names), len(columns), squeeze=False, sharex=True, sharey=True, **size)
    scales = {True: Normalize(0, readings.max()), False: PowerNorm(of.power, 0, of.highest, clip=True)}
    drawn = {}
    for (heading, values), column in zip(columns.items(), axes.T, strict=True):
        counts = heading == "Reading"
        look = {"origin": "lower", "extent": extent, "cmap": "Greys" if counts else "Blues", "norm": scales[counts]}
        for k, ax in enumerate(column):
            drawn[counts] = ax.imshow(values[k].astype(float), **look)
            if not counts:
                ax.set_xlabel(_below(values[k], None if heading == of.truth else truth[k], of), labelpad=2)
            ax.set(xticks=[], yticks=[])
            ax.grid(False)
            ax.spines[:].set(visible=True, color=style.GREY, linewidth=0.6)
        column[0].set_title(heading, fontweight="bold")
    for name, ax in zip(names, axes[:, 0], strict=True):
        ax.set_ylabel(name, rotation=0, ha="right", va="center", labelpad=6)
    look = {"location": "bottom", "shrink": 0.9, "aspect": 30, "pad": 0.01}
    figure.colorbar(drawn[True], ax=axes[:, :1], label="Counts", extend="min", **(look | {"aspect": 10}))
    ticks = [at for at in MaxNLocator(5).tick_values(0, of.highest) if at <= of.highest]
    figure.colorbar(drawn[False], ax=axes[:, 1:], label=of.label, extend="both", ticks=ticks, **look)
    side = f"{extent[1] / 10:g} cm x {extent[3] / 10:g} cm"
    figure.suptitle(style.literal(f"{title}; each is {side}\n{caption}"))
    style.save(figure, path)


def _below(values: np.ndarray, truth: np.ndarray | None, of: Maps) -> str:
    """Return what stands below a map: its peak, and its RMSE where it is a prediction; or that the model failed."""
    if not np.isfinite(values).all():
        return "failed"
    said = [f"peak {values.max():.0f}"] if of.peaks else []
    if truth is not None:
        error = np.sqrt(np.square(values.astype(float) - truth).mean())
        said.append(f"RMSE {error:.0f}" if of.peaks else f"RMSE {error:.1f}")
    return f"{', '.join(said)} {of.unit}" if said else ""


def confusion_matrix(
    path: Path, counts: np.ndarray, objects: Sequence[str], title: str, what: str = "object", items: str = "images"
) -> None:
    """Draw how often an object (row) is given each name (column), in percent of its images.

    counts: (classes, classes) images; cells from LEAST_PERCENT are labelled. what, items: words for both.
    """
    total = counts.sum(axis=1, keepdims=True)
    percent = 100 * np.divide(counts, total, out=np.zeros(counts.shape), where=total > 0)
    names = [style.literal(name.replace("_", " ")) for name in objects]
    side = (0.4 if len(names) <= 20 else 0.335) * len(names)
    figure, ax = plt.subplots(figsize=(side + 2, side + 1.6))
    picture = ax.imshow(percent, cmap="Blues", vmin=0, vmax=100)
    for row, column in np.argwhere(percent >= LEAST_PERCENT):
        value = percent[row, column]
        ax.text(column, row, f"{value:.0f}", ha="center", va="center", fontsize=8, color="w" if value > 55 else "k")
    places = np.arange(len(names))
    ax.set_xticks(places, names, rotation=90)
    ax.set_yticks(places, names)
    ax.set_xticks(places[1:] - 0.5, minor=True)
    ax.set_yticks(places[1:] - 0.5, minor=True)
    ax.grid(False)
    ax.grid(which="minor")
    ax.tick_params(which="minor", length=0)
    ax.set(xlabel="Name given by the model", ylabel=style.literal(what.capitalize()), title=style.literal(title))
    of = style.literal(f"Share of the {what}'s {items} (%)")
    figure.colorbar(picture, ax=ax, label=of, shrink=0.6, aspect=30, pad=0.02)
    style.save(figure, path)
