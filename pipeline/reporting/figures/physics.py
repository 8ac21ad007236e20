"""Draw the change of every model's error where an effect is left out of a simulated scene."""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.colors import LinearSegmentedColormap

from pipeline.reporting.figures import style
from pipeline.reporting.verdicts.physics import NEEDED, Assessment
from pipeline.reporting.words.labels import model_name

FULL = 3.0  # floors at which the colour is full
# White up to one floor, then two hues; the sign is in the numbers, so that nothing is lost in grey.
EDGE = 0.5 - 0.5 / FULL
STEPS = [(0, style.BLUE), (EDGE, "#D9E8F2"), (EDGE, "white"), (1 - EDGE, "white"), (1 - EDGE, "#F8E3D6")]
COLOURS = LinearSegmentedColormap.from_list("change", [*STEPS, (1, style.VERMILION)], N=600)


def matrices(path: Path, title: str, assessment: Assessment, unit: str) -> None:
    """Draw one matrix per condition, effects by models: numbers are the change of the error in %, colours in floors.

    The last column is Kendall's tau. White: not more than one floor. `unit`: of the error, for the note below.
    """
    conditions = list(assessment.floor_tau)
    effects = assessment.effects
    models = list(dict.fromkeys(change.model for change in effects[0].changes))
    width = 1.7 + len(conditions) * (0.52 * (len(models) + 1) + 0.35)
    figure, axes = plt.subplots(
        1, len(conditions), figsize=(width, 1.9 + 0.34 * len(effects)), sharey=True, squeeze=False
    )
    for ax, condition in zip(axes[0], conditions, strict=True):
        floors = np.zeros((len(effects), len(models) + 1))
        for row, judged in enumerate(effects):
            for change in judged.changes:
                if change.condition != condition:
                    continue
                column = models.index(change.model)
                floors[row, column] = np.clip(np.nan_to_num(change.floors, nan=FULL), -FULL, FULL)
                _number(ax, column, row, change.relative * 100, change.counts, abs(floors[row, column]) > 2.5)
            changed = judged.tau[condition] < assessment.floor_tau[condition] - 1e-9
            weight = "bold" if changed else "normal"
            ax.text(
                len(models), row, f"{judged.tau[condition]:.2f}", ha="center", va="center", fontsize=7, weight=weight
            )
        picture = ax.imshow(floors, cmap=COLOURS, vmin=-FULL, vmax=FULL, aspect="auto")
        ax.axvline(len(models) - 0.5, color=style.GREY, linewidth=0.8)
        labels = [model_name(model) for model in models]
        ax.set_xticks(range(len(models) + 1), [*labels, "order: tau"], rotation=50, ha="right", rotation_mode="anchor")
        ax.set_title(f"{condition.replace('_', ' ')} (other seeds: tau ≥ {assessment.floor_tau[condition]:.2f})")
        ax.set_xticks(np.arange(len(models) + 2) - 0.5, minor=True)
        ax.set_yticks(np.arange(len(effects) + 1) - 0.5, minor=True)
        ax.grid(False)
        ax.grid(True, which="minor", color="#DDDDDD", linewidth=0.6)
        ax.tick_params(which="both", length=0)
        ax.spines[:].set_visible(False)
    names = [judged.effect.replace("_", " ") + (" *" if judged.verdict == NEEDED else "") for judged in effects]
    axes[0, 0].set_yticks(range(len(effects)), names)
    axes[0, 0].set_ylabel("effect left out (*: needed)")
    bar = figure.colorbar(picture, ax=axes[0].tolist(), ticks=[-FULL, -1, 0, 1, FULL], pad=0.01, shrink=0.9)
    bar.set_label("change of the error, in floors\n(1: what other seeds do)")
    note = f"Numbers: change of the error ({unit}) in %, bold where it counts: beyond one floor, in every seed alike"
    figure.suptitle(f"{title}\n{note}", fontsize=9)
    style.save(figure, path)


def _number(ax: plt.Axes, column: int, row: int, percent: float, beyond: bool, dark: bool) -> None:
    """Write the number of one cell, or that a run failed."""
    text = "failed" if np.isnan(percent) else f"{round(percent):+d}" if round(percent) else "0"
    colour, weight = "white" if dark else "black", "bold" if beyond else "normal"
    ax.text(column, row, text, ha="center", va="center", fontsize=7, color=colour, weight=weight)
