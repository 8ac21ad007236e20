"""Draw the stability tests: error against severity, one panel per perturbation, one curve per model."""

import textwrap
from collections.abc import Mapping
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.colors import LogNorm

from pipeline.claims.stability import FLOOR, ranking
from pipeline.reporting.figures import style
from pipeline.reporting.figures.style import BLACK, model_style
from pipeline.reporting.words.labels import perturbation
from pipeline.scoring.results import Estimate

COLUMNS = 4
LONG = 5.0  # an error that spans more than this factor is drawn on a logarithmic axis
FACTOR = 4.0  # that the colours of a heat map reach from 1, in both directions
READABLE = 2.9  # factor from 1 up to which black is read on them
HIGHEST = 10.0  # times the constant model's error: what is above leaves the panel

Panel = tuple[str, str, Mapping[str, Mapping[float, Estimate]]]  # title, severity's unit, model -> severity -> error


def small_multiples(path: Path, panels: list[Panel], title: str, ylabel: str) -> None:
    """Draw one panel per perturbation, its severities in equal steps, `clean` for 0; bands: lowest to highest seed.

    A model with failed runs is named as such, and its curve is of the others; where all failed, it has none.
    """
    figure, axes = style.panels(len(panels), COLUMNS, 11, 2.4, 1.2, sharey=True)
    lines, failed = {}, {}
    for ax, (name, unit, models) in zip(axes.flat, panels, strict=False):
        severities = list(next(iter(models.values())))
        if 0 in severities:
            severities.sort()
        steps = range(len(severities))
        for model, errors in models.items():
            look, floor = model_style(model), model == FLOOR
            mean, low, high = ([getattr(errors[at], part) for at in severities] for part in ("mean", "low", "high"))
            plain = {"color": BLACK, "linewidth": 2.2} if floor else {"marker": look.marker, "linewidth": 1.3}
            plain = {"color": look.color} | plain
            (lines[look.label],) = ax.plot(steps, mean, linestyle=look.linestyle, markersize=5, **plain)
            if not floor:
                ax.fill_between(steps, low, high, color=look.color, alpha=0.12, linewidth=0)
            failed[look.label] = max(failed.get(look.label, 0), *(seeds.failed for seeds in errors.values()))
        ax.set_title(textwrap.fill(name, 34))
        ax.set_xlabel(unit)
        ax.set_xticks(steps, [f"{severity:g}" if severity else "clean" for severity in severities])
    subtitle = _limit(axes[0, 0], panels)
    for ax in axes[:, 0]:
        ax.set_ylabel(ylabel)
    runs = next(seeds.runs + seeds.failed for errors in panels[0][2].values() for seeds in errors.values())
    seeds = "one seed" if runs == 1 else f"mean and range of {runs} seeds"
    figure.suptitle(f"{title}: error under perturbation (lower is better), {seeds}{subtitle}")
    names = [f"{name}: failed ({failed[name]} of {runs} runs)" if failed[name] else name for name in lines]
    columns = min(len(names), 150 // (max(map(len, names)) + 8))
    figure.legend(lines.values(), names, loc="outside lower center", ncols=columns)
    style.save(figure, path)


def heat_map(path: Path, judged: pd.DataFrame, title: str) -> bool:
    """Draw the relative error of every model (rows, the best first) under every perturbation (columns) of a condition.

    judged: rows of FAILURES of one condition. Nothing is drawn, and False returned, where no model can be ranked.
    """
    order = list(ranking(judged).index)
    if not order:
        return False
    table = judged.pivot(index="model", columns="perturbation", values="relative")
    table = table.loc[order, list(dict.fromkeys(judged["perturbation"]))]
    figure, ax = plt.subplots(figsize=(2.6 + 0.75 * table.shape[1], 1.6 + 0.34 * len(table)), layout="constrained")
    image = ax.imshow(table, cmap="RdYlBu_r", norm=LogNorm(1 / FACTOR, FACTOR), aspect="auto")
    for row, column in np.ndindex(table.shape):
        value = table.iloc[row, column]
        colour = BLACK if 1 / READABLE < value < READABLE else "white"
        ax.text(column, row, f"{value:.2f}" if value < 10 else ">10", ha="center", va="center", color=colour)
    ax.grid(False)
    ax.set_xticks(range(table.shape[1]), [perturbation(name)[0] for name in table.columns], rotation=40, ha="right")
    ax.set_yticks(range(len(table)), [model_style(model).label for model in order])
    figure.suptitle(f"{title}: error over the constant model's")  # `save` makes a narrow figure as wide
    bar = figure.colorbar(image, ax=ax, extend="both", label="relative error, log scale (1: no better)")
    bar.set_ticks([1 / FACTOR, 0.5, 1, 2, FACTOR], labels=["1/4", "1/2", "1", "2", "4"])
    bar.minorticks_off()
    style.save(figure, path)
    return True


def _limit(ax: plt.Axes, panels: list[Panel]) -> str:
    """Set the common y axis, and return the words that the title needs about it."""
    errors = [(model, levels) for _, _, models in panels for model, levels in models.items()]
    means = [(model, level.mean) for model, levels in errors for level in levels.values() if np.isfinite(level.mean)]
    finite = [mean for _, mean in means]
    floor = [mean for model, mean in means if model == FLOOR]
    top = min(max(finite, default=1.0), HIGHEST * max(floor, default=np.inf))
    lowest = min((error for error in finite if error > 0), default=top)
    if min(finite, default=0.0) > 0 and top > LONG * lowest:
        ax.set_yscale("log")
        ax.set_ylim(0.85 * lowest, 1.2 * top)
        style.plain_log(ax.yaxis)
    else:
        ax.set_ylim(0, 1.05 * top)
    return "" if max(finite, default=0.0) <= top else f"; above {HIGHEST:g} times the constant model's: not drawn"
