"""Figures of the stability tests: error against severity, a panel a perturbation, a curve a model."""

from collections.abc import Mapping
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from pipeline.reporting.figures.style import BLACK, model_style, plain_log, save
from pipeline.reporting.stability import FLOOR, Level

COLUMNS = 4
LONG = 5.0  # an error that spans more than this factor is drawn on a logarithmic axis
HIGHEST = 10.0  # times the constant model's error: what is above leaves the panel

Panel = tuple[str, str, Mapping[str, Mapping[float, Level]]]  # title, what severity is, model -> severity -> error


def small_multiples(path: Path, panels: list[Panel], title: str, ylabel: str) -> None:
    """One panel a perturbation, its severities in equal steps, `clean` for 0; bands: lowest to highest seed.

    A model with failed runs is named as such, and its curve is of the others; where all failed, it has none.
    """
    rows = -(-len(panels) // COLUMNS)
    figure, axes = plt.subplots(rows, COLUMNS, figsize=(11, 2.4 * rows + 1.2), sharey=True, squeeze=False)
    drawn, failed = {}, {}
    for ax, (name, unit, models) in zip(axes.flat, panels, strict=False):
        severities = list(next(iter(models.values())))
        if 0 in severities:
            severities.sort()
        for model, own in models.items():
            look, floor = model_style(model), model == FLOOR
            place = np.arange(len(severities))
            mean, low, high = (
                np.array([getattr(own[one], part) for one in severities]) for part in ("mean", "low", "high")
            )
            (line,) = ax.plot(
                place,
                mean,
                color=BLACK if floor else look.color,
                marker=None if floor else look.marker,
                linestyle=look.linestyle,
                markersize=5,
                linewidth=2.2 if floor else 1.3,
            )
            if not floor:
                ax.fill_between(place, low, high, color=look.color, alpha=0.12, linewidth=0)
            drawn.setdefault(look.label, line)
            failed[look.label] = max(failed.get(look.label, 0), *(one.failed for one in own.values()))
        ax.set_title(name)
        ax.set_xlabel(unit, fontsize=8)
        ax.set_xticks(range(len(severities)), [f"{one:g}" if one else "clean" for one in severities])
    for ax in axes.flat[len(panels) :]:
        ax.set_axis_off()
    subtitle = _limit(axes[0, 0], panels)
    for row in axes:
        row[0].set_ylabel(ylabel)
    some = next(iter(next(iter(panels[0][2].values())).values()))
    seeds = some.runs + some.failed
    runs = "one seed" if seeds == 1 else f"mean and range of {seeds} seeds"
    figure.suptitle(f"{title}: error under perturbation (lower is better), {runs}{subtitle}", fontsize=10)
    names = [f"{name}: failed ({failed[name]} of {seeds} runs)" if failed[name] else name for name in drawn]
    figure.legend(
        drawn.values(), names, loc="outside lower center", ncols=min(len(names), 150 // (max(map(len, names)) + 8))
    )
    save(figure, path)


def _limit(ax: plt.Axes, panels: list[Panel]) -> str:
    """Set the common y axis; returns what the title must say about it."""
    errors = [(model, one.mean) for _, _, models in panels for model, own in models.items() for one in own.values()]
    finite = [value for _, value in errors if np.isfinite(value)]
    floor = [value for model, value in errors if model == FLOOR and np.isfinite(value)]
    top = min(max(finite, default=1.0), HIGHEST * max(floor, default=np.inf))
    lowest = min((value for value in finite if value > 0), default=top)
    if min(finite, default=0.0) > 0 and top > LONG * lowest:
        ax.set_yscale("log")
        ax.set_ylim(0.85 * lowest, 1.2 * top)
        plain_log(ax.yaxis)
    else:
        ax.set_ylim(0, 1.05 * top)
    return "" if max(finite, default=0.0) <= top else f"; above {HIGHEST:g} times the constant model's: not drawn"
