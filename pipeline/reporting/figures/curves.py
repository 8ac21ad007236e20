"""Draw what several experiments show alike: curves, bars and boxes of the models. Each function writes one PNG."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.patches import Patch

from pipeline.results.claim_inputs import HALF
from tactile.drawing import style
from tactile.drawing.common import legend_below
from tactile.drawing.labels import model_name
from tactile.drawing.style import model_style
from tactile.scoring import estimates

COLOURS = (style.BLUE, style.VERMILION, style.BLACK)  # of groups of runs
LEAST_SQUARE = 1e-6  # squared error on a logarithmic axis
LONG = 32  # letters of a legend's entry, of which four do not stand side by side


def learning_curves(
    path: Path, curves: pd.DataFrame, groups: Mapping[str, str], title: str, unit: str, epochs: Mapping[str, int]
) -> None:
    """Draw validation loss over the epochs, one panel per model, one line per training.

    curves: as of `Report.curves`; groups: name -> protocol, each in a colour; of `half` budgets lines are dotted. Where
    there is one group, its training loss is drawn, too. epochs: model -> those of its paper, marked where a training
    has had as many.
    """
    models, handles = list(dict.fromkeys(curves["model"])), {}
    columns = max(1, min(3, len(models)))
    figure, axes = style.panels(len(models), columns, 3.7 * columns, 2.8, 0.8)
    for ax, model in zip(axes.flat, models, strict=False):
        own = curves[curves["model"] == model]
        for colour, (group, protocol) in zip(COLOURS, groups.items(), strict=False):
            of_group = own[own["protocol"] == protocol]
            for (budget, _), run in of_group.groupby(["budget", "seed"], sort=False):
                name, look = (group, "-") if budget != HALF else (f"{group}, half of the epochs", ":")
                drawn = {"color": colour, "linestyle": look, "linewidth": 1.1, "alpha": 0.7}
                (handles[name],) = ax.plot(run["epoch"], run["validation_loss"], **drawn)
                if len(groups) == 1 and budget != HALF:
                    drawn = {"color": style.GREY, "linestyle": "--", "linewidth": 0.8}
                    (handles["training loss"],) = ax.plot(run["epoch"], run["train_loss"], **drawn)
        if epochs.get(model, np.inf) <= own["epoch"].max():
            handles["epochs of the paper"] = ax.axvline(epochs[model], color=style.PURPLE, linewidth=1.5)
        ax.set(title=model_name(model), yscale="log", xlabel="Epoch")
        style.plain_log(ax.yaxis)
        ax.xaxis.get_major_locator().set_params(integer=True)
    for ax in axes[:, 0]:
        ax.set_ylabel(f"Loss ({unit})")
    legend_below(figure, handles, 4)
    figure.suptitle(style.literal(title))
    style.save(figure, path)


class Line(NamedTuple):
    """A line of `curves`: one value per seed at every x, and how it is drawn."""

    label: str
    x: Sequence[float]
    values: Sequence[Sequence[float]]
    look: Mapping[str, Any]


def line(model: str, values: Mapping[float, Sequence[float]], **look: Any) -> Line:
    """Return the line of a model in its own style; values: x -> seeds; look: what differs from that style."""
    label, colour, marker, dashes = model_style(model)
    own = {"color": colour, "marker": marker, "linestyle": dashes}
    return Line(look.pop("label", label), list(values), list(values.values()), own | look)


def curves(
    path: Path,
    panels: Mapping[str, Sequence[Line]],
    title: str,
    names: tuple[str, str],
    scale: str,
    log: bool = False,
    limits: tuple[float | None, float | None] = (None, None),
    ticks: Sequence[float] = (),
) -> None:
    """Draw lines of means and their seeds as dots, one panel per title; names: of both axes; limits: of y; ticks: of x.

    scale: of the values, as of `estimates.estimate`.

    An interval of few seeds would hide the lines, and on a logarithmic axis leave it. A failed run, NaN, has no dot.
    """
    figure, axes = style.panels(len(panels), len(panels), 4.7 * len(panels), 3.9, 0)
    handles = {}
    for ax, (panel, lines) in zip(axes[0], panels.items(), strict=True):
        for label, x, values, look in lines:
            good = [np.asarray(seeds, float)[np.isfinite(seeds)] for seeds in values]
            mean = [estimates.estimate(seeds, scale).mean for seeds in good]
            (handles[label],) = ax.plot(x, mean, markersize=5, **look)
            dots = np.repeat(x, list(map(len, good))), np.concatenate(good)
            ax.plot(*dots, ".", color=look["color"], alpha=0.5, markersize=4, zorder=1)
        ax.set(xlabel=names[0], title=panel)
        if log:
            ax.set(xscale="log", yscale="log")
            style.plain_log(ax.xaxis, ticks)
            style.plain_log(ax.yaxis)
        elif len(ticks):
            ax.set_xticks(ticks)
        (low, high), (least, most) = ax.get_ylim(), limits
        ax.set_ylim(low if least is None else least, high if most is None else min(high, most))
    axes[0][0].set_ylabel(names[1])
    legend_below(figure, handles, 4 if len(panels) > 1 and max(map(len, handles)) < LONG else 2)
    figure.suptitle(title)
    style.save(figure, path)


def bars(
    path: Path, panels: Mapping[str, Mapping[str, Mapping[str, Sequence[float]]]], title: str, name: str, limits: tuple
) -> None:
    """Draw bars of means of R2 and their seeds as dots; panels: title -> group along x -> bar -> seeds.

    name, limits: of y. A seed below the axis is a triangle at its lower edge, and a mean there is a bar to the edge
    with its number.
    """
    figure, axes = style.panels(len(panels), len(panels), 4.6 * len(panels), 3.7, 0, sharey=True)
    for ax, (panel, groups) in zip(axes[0], panels.items(), strict=True):
        kinds = list(dict.fromkeys(bar for of in groups.values() for bar in of))
        width = 0.8 / len(kinds)
        for k, (bar, colour) in enumerate(zip(kinds, (style.GREY, style.BLUE, style.VERMILION), strict=False)):
            seeds, edge = [np.asarray(of[bar], float) for of in groups.values()], 0.8 * limits[0]
            place = np.arange(len(groups)) + (k - (len(kinds) - 1) / 2) * width
            means = np.array([estimates.estimate(values, estimates.R2).mean for values in seeds])
            ax.bar(place, np.maximum(means, edge), width, color=colour, alpha=0.75, label=bar)
            for x, mean in zip(place[means < edge], means[means < edge], strict=True):
                ax.text(x, edge / 2, f"\N{MINUS SIGN}{-mean:.1f}", ha="center", va="center", fontsize="small")
            at, dots = np.repeat(place, list(map(len, seeds))), np.concatenate(seeds)
            ax.plot(at, np.where(dots < edge, np.nan, dots), ".", color=style.BLACK, markersize=4)
            ax.plot(at, np.where(dots < edge, edge, np.nan), "v", color=style.BLACK, markersize=4)
        ax.axhline(0, color=style.BLACK, linewidth=0.8)
        ax.set_xticks(np.arange(len(groups)), list(groups))
        ax.set(title=panel, ylim=limits)
    axes[0][0].set_ylabel(name)
    bars_drawn, labels = axes[0][0].get_legend_handles_labels()
    legend_below(figure, dict(zip(labels, bars_drawn, strict=True)), 3)
    figure.suptitle(title)
    style.save(figure, path)


def boxes(
    path: Path,
    errors: Mapping[str, Mapping[str, np.ndarray]],
    title: str,
    caption: str,
    xlabel: str,
    things: str,
) -> None:
    """Draw how errors spread on a logarithmic axis, a row a model, a box a group; a later group is of a fuller colour.

    errors: model -> group -> (n,), the same groups of every model; things: what the n are, in the plural. The title
    says what a box shows.
    """
    groups = {group: len(values) for group, values in next(iter(errors.values())).items() if len(values)}
    figure, ax = plt.subplots(figsize=(8, 0.31 * max(2, len(groups)) * len(errors) + 1.6))
    step, shares = 0.72 / max(2, len(groups)), dict(zip(groups, np.linspace(0, 1, len(groups)), strict=True))
    for k, (model, of_model) in enumerate(errors.items()):
        for place, group in enumerate(groups):
            values = of_model[group][np.isfinite(of_model[group])]
            values = np.maximum(values, LEAST_SQUARE)  # an exact prediction has no place on this axis
            if not len(values):
                ax.text(0.5, k, "failed", transform=ax.get_yaxis_transform(), ha="center", va="center")
                continue
            colour = model_style(model).color
            look = {"orientation": "horizontal", "medianprops": {"color": style.BLACK, "linewidth": 1.6}}
            look |= {"widths": step / 1.2, "whis": (5, 95), "showfliers": False, "patch_artist": True}
            drawn = ax.boxplot(values, positions=[k + step * (place - (len(groups) - 1) / 2)], **look)
            drawn["boxes"][0].set(facecolor=style.mixed(colour, shares[group]), edgecolor=colour, linewidth=1.5)
    ax.set_yticks(range(len(errors)), [model_name(model) for model in errors])
    ax.invert_yaxis()
    read = f"(line: median, box: quartiles, whiskers: 5 % to 95 % of {things})"
    ax.set(xscale="log", xlabel=xlabel, title=style.literal(f"{title}\n{read}\n{caption}"))
    handles = {}
    for group, count in groups.items():
        face, edge = style.mixed(style.GREY, shares[group]), style.GREY if shares[group] < 1 else None
        handles[f"{group}, {count} {things}"] = Patch(facecolor=face, edgecolor=edge)
    legend_below(figure, handles, len(handles))
    style.save(figure, path)
