"""Draw the change of every model's error where an effect is left out of a simulated scene."""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.colors import LinearSegmentedColormap

from pipeline.reporting.figures import style
from pipeline.reporting.verdicts.physics import CHANGES, EQUIVALENT, MARGIN, Judgement
from pipeline.reporting.words.labels import effect_name, model_name, task_name

FULL = 0.3  # change of the error at which the colour is full
COLOURS = LinearSegmentedColormap.from_list("change", [style.BLUE, "white", style.VERMILION])
MARKS = {EQUIVALENT: " =", CHANGES: " *"}  # behind an effect's name


def matrices(path: Path, title: str, judgements: list[Judgement], unit: str) -> None:
    """Draw one matrix per condition, effects by models: the change of the error and the half of its interval, in %.

    White: the whole interval lies inside the margin. Bold: the whole interval lies outside. `unit`: of the error.
    """
    changes = judgements[0].changes
    conditions = list(dict.fromkeys(change.condition for change in changes))
    models = list(dict.fromkeys(change.model for change in changes))
    figure, axes = plt.subplots(
        1,
        len(conditions),
        figsize=(3.4 + len(conditions) * (0.62 * len(models) + 0.3), 1.9 + 0.36 * len(judgements)),
        sharey=True,
        squeeze=False,
    )
    for ax, condition in zip(axes[0], conditions, strict=True):
        colours = np.zeros((len(judgements), len(models)))
        for row, judged in enumerate(judgements):
            for change in judged.changes:
                if change.condition != condition:
                    continue
                column = models.index(change.model)
                failed = np.isnan(change.relative)
                if not change.equivalent:
                    colours[row, column] = FULL if failed else np.clip(change.relative, -FULL, FULL)
                half = (change.high - change.low) / 2
                ax.text(
                    column,
                    row,
                    "failed" if failed else f"{round(100 * change.relative) + 0.0:+.0f} ± {100 * half:.0f}",
                    ha="center",
                    va="center",
                    fontsize=6.5,
                    color="white" if abs(colours[row, column]) > 0.8 * FULL else "black",
                    weight="bold" if change.beyond else "normal",
                )
        picture = ax.imshow(colours, cmap=COLOURS, vmin=-FULL, vmax=FULL, aspect="auto")
        labels = [model_name(model) for model in models]
        ax.set_xticks(range(len(models)), labels, rotation=50, ha="right", rotation_mode="anchor")
        ax.set_title(task_name(condition))
        ax.set_xticks(np.arange(len(models) + 1) - 0.5, minor=True)
        ax.set_yticks(np.arange(len(judgements) + 1) - 0.5, minor=True)
        ax.grid(False)
        ax.grid(True, which="minor", color="#DDDDDD", linewidth=0.6)
        ax.tick_params(which="both", length=0)
        ax.spines[:].set_visible(False)
    names = [effect_name(judged.effect) + MARKS.get(judged.verdict, "") for judged in judgements]
    axes[0, 0].set_yticks(range(len(judgements)), names)
    axes[0, 0].set_ylabel("effect left out\n(=: equivalent, *: changes errors)")
    bar = figure.colorbar(
        picture, ax=axes[0].tolist(), ticks=[-FULL, 0, FULL], format=lambda x, _: f"{100 * x:+.0f} %", pad=0.01
    )
    bar.set_label("change of the error")
    note = (
        f"Numbers: change of the error ({unit}) in % ± half of its 90 % interval; "
        f"white: the interval lies within {100 * MARGIN:.0f} %, bold: it lies outside"
    )
    figure.suptitle(f"{title}\n{note}", fontsize=9)
    style.save(figure, path)
