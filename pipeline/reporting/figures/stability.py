"""Draw the stability tests: error over severity, one panel per test, one curve per model."""

import textwrap
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.lines import Line2D

from pipeline.claims.stability import LOG
from tactile.drawing import style
from tactile.drawing.style import BLACK, GREY, model_style

COLUMNS = 4  # of panels at most
DRAWN = 5  # models a panel at most: those with the least clean error
APART, MARGIN = 0.13, 0.04  # of an axis: between two of its numbers, and beyond its ends
HIGHEST = 1.6  # times the constant model's clean error: what is above leaves the panel


class Curve(NamedTuple):
    """The error of one model over the severities of one test, (k,) each; low and high are NaN without an interval."""

    severities: np.ndarray
    mean: np.ndarray
    low: np.ndarray
    high: np.ndarray
    half: Sequence[tuple[float, float]]  # severity at which half of the skill is lost, and the error there


class Floor(NamedTuple):
    """The error of the constant model over the severities of one test, (k,) each."""

    severities: np.ndarray
    mean: np.ndarray


class Panel(NamedTuple):
    """One test: its name, the unit of its severities, the axis by which they are interpolated, and a curve a model."""

    title: str
    unit: str
    axis: str
    curves: Mapping[str, Curve]
    floor: Floor


def small_multiples(path: Path, panels: Sequence[Panel], floor: float, ylabel: str, title: str) -> None:
    """Draw one panel per test on the true axis of its severities; floor: clean error of the constant model.

    Its error under the test is dotted. A ring is where half of the skill is lost. Bands are 95 % intervals of the mean.
    """
    columns = -(-len(panels) // -(-len(panels) // COLUMNS))  # no row is much shorter than another
    figure, axes = style.panels(len(panels), columns, 2.75 * columns, 2.3, 1.2, sharey=True)
    lines = {}
    for ax, panel in zip(axes.flat, panels, strict=False):
        for model, curve in panel.curves.items():
            look = model_style(model)
            (lines[look.label],) = ax.plot(
                curve.severities, curve.mean, color=look.color, marker=look.marker, linestyle=look.linestyle,
                markersize=4, linewidth=1.3,
            )  # fmt: skip
            ax.fill_between(curve.severities, curve.low, curve.high, color=look.color, alpha=0.15, linewidth=0)
            for at, error in curve.half:
                ax.plot(at, error, "o", markersize=8, markerfacecolor="none", color=look.color)
        (lines["Constant"],) = ax.plot(*panel.floor, color=BLACK, linestyle=":", linewidth=1.2)
        _severity_axis(ax, panel)
        ax.set_title(textwrap.fill(panel.title, 34))
    ring = {"linestyle": "", "marker": "o", "markersize": 8, "markerfacecolor": "none", "color": GREY}
    lines["half of the skill lost"] = Line2D([], [], **ring)
    shown = np.concatenate([curve.mean for panel in panels for curve in panel.curves.values()])
    axes[0, 0].set_ylim(0, min(1.05 * max(np.nanmax(shown), floor), HIGHEST * floor))
    for ax in axes[:, 0]:
        ax.set_ylabel(textwrap.fill(ylabel, 26))
    figure.suptitle(title)
    entries = min(len(lines), 36 * columns // (max(map(len, lines)) + 8)) or 1
    figure.legend(lines.values(), lines, loc="outside lower center", ncols=entries)
    style.save(figure, path)


def _severity_axis(ax: plt.Axes, panel: Panel) -> None:
    """Set the axis of severities: straight from 0 to the smallest one, and logarithmic above it where that is LOG."""
    levels = sorted({float(each) for curve in panel.curves.values() for each in curve.severities})
    if panel.axis == LOG:
        ax.set_xscale("symlog", linthresh=min(abs(each) for each in levels if each), linscale=0.5)
    places = ax.xaxis.get_transform().transform(np.array(levels))
    width, ticks = places[-1] - places[0], []
    for at in sorted(range(len(levels)), key=lambda each: (levels[each] != 0, each % (len(levels) - 1) != 0)):
        if all(abs(places[at] - places[other]) > APART * width for other in ticks):
            ticks.append(at)
    margin = np.array([places[0] - MARGIN * width, places[-1] + MARGIN * width])
    ax.set_xlim(ax.xaxis.get_transform().inverted().transform(margin))
    ax.set_xticks([levels[at] for at in sorted(ticks)], [f"{levels[at]:g}" for at in sorted(ticks)])
    ax.minorticks_off()
    ax.axvline(0, color=GREY, linewidth=0.6)
    ax.set_xlabel(panel.unit)
