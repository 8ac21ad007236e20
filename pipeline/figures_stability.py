"""Figures of the stability tests: error against severity, a panel a perturbation, a curve a model."""

from collections.abc import Mapping
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from pipeline.figures import plain_log, save, style
from pipeline.results import Estimate

COLUMNS = 4
LONG = 5.0  # an error that spans more than this factor is drawn on a logarithmic axis

Panel = tuple[str, str, Mapping[str, Mapping[float, Estimate]]]  # title, what severity is, model -> severity -> error


def small_multiples(path: Path, panels: list[Panel], title: str, ylabel: str) -> None:
    """One panel a perturbation, severities in equal steps from the clean level, 0, outwards; bands: over the seeds."""
    rows = -(-len(panels) // COLUMNS)
    figure, axes = plt.subplots(
        rows, COLUMNS, figsize=(11, 2.5 * rows + 0.9), sharey=True, squeeze=False, layout="constrained"
    )
    means = [
        one.mean
        for _, _, models in panels
        for own in models.values()
        for one in own.values()
        if np.isfinite(one.mean) and one.mean > 0
    ]
    logarithmic = bool(means) and max(means) > LONG * min(means)
    drawn = {}
    for ax, (name, unit, models) in zip(axes.flat, panels, strict=False):
        for model, own in models.items():
            look = style(model)
            place = np.arange(len(own))
            mean, low, high = (
                np.array([getattr(one, part) for one in own.values()]) for part in ("mean", "low", "high")
            )
            (line,) = ax.plot(
                place, mean, color=look.color, marker=look.marker, linestyle=look.linestyle, markersize=5, linewidth=1.3
            )
            ax.fill_between(place, np.maximum(low, 0.2 * mean), high, color=look.color, alpha=0.12, linewidth=0)
            drawn.setdefault(look.label, line)
        ax.set_title(name)
        ax.set_xlabel(unit, fontsize=8)
        severities = list(next(iter(models.values())))
        ax.set_xticks(range(len(severities)), [f"{one:g}" for one in severities])
    for ax in axes.flat[len(panels) :]:
        ax.set_axis_off()
    if logarithmic:
        axes[0, 0].set_yscale("log")
        axes[0, 0].set_ylim(0.85 * min(means), 1.3 * max(means))
        plain_log(axes[0, 0].yaxis)
    else:
        axes[0, 0].set_ylim(0, None)
    for row in axes:
        row[0].set_ylabel(ylabel)
    figure.suptitle(title, fontsize=10)
    figure.legend(drawn.values(), drawn.keys(), loc="outside lower center", ncols=min(len(drawn), 6))
    save(figure, path)
