"""Draw the change of every model's error where an effect is left out of a simulated scene."""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.patches import Rectangle

from pipeline.claims.physics import CHANGES, EQUIVALENT, MARGIN
from tactile.drawing import style
from tactile.drawing.labels import effect_name, model_name, task_name

FULL = 0.3  # change of the error at which the colour is full
COLOURS = LinearSegmentedColormap.from_list("change", [style.BLUE, "white", style.VERMILION])
MARKS = {EQUIVALENT: (" =", "no error changes"), CHANGES: (" *", "errors change")}  # behind an effect's name


def matrices(path: Path, title: str, judged: pd.DataFrame, unit: str) -> None:
    """Draw one matrix per condition, effects by models: the change of the error and the half of its interval, in %.

    White: the whole interval lies inside the margin. Coloured: all of it lies outside. Hatched: it lies on both sides.
    judged: an experiment's rows of physics.csv; unit: of the error.
    """
    conditions, models, effects = (list(dict.fromkeys(judged[name])) for name in ("condition", "model", "effect"))
    width = 3.4 + len(conditions) * (0.78 * len(models) + 0.3)
    shape = {"figsize": (width, 1.9 + 0.36 * len(effects)), "sharey": True, "squeeze": False}
    figure, axes = plt.subplots(1, len(conditions), **shape)
    for ax, condition in zip(axes[0], conditions, strict=True):
        colours = np.zeros((len(effects), len(models)))
        for change in judged[judged["condition"] == condition].itertuples():
            place = effects.index(change.effect), models.index(change.model)
            failed = np.isnan(change.relative)
            outside = failed or change.low > MARGIN or change.high < -MARGIN
            if outside:
                colours[place] = FULL if failed else np.clip(change.relative, -FULL, FULL)
            elif not change.equivalent:
                corner = place[1] - 0.5, place[0] - 0.5
                ax.add_patch(
                    Rectangle(corner, 1, 1, facecolor="#F2F2F2", edgecolor="#CFCFCF", hatch="////", linewidth=0)
                )
            text = f"{round(100 * change.relative) + 0.0:+.0f} ± {50 * (change.high - change.low):.0f}".removesuffix(
                " ± nan"
            )
            colour = "white" if abs(colours[place]) > 0.8 * FULL else "black"
            look = {"ha": "center", "va": "center", "fontsize": 8, "color": colour}
            ax.text(place[1], place[0], "failed" if failed else text, **look)
        picture = ax.imshow(colours, cmap=COLOURS, vmin=-FULL, vmax=FULL, aspect="auto")
        labels = [model_name(model) for model in models]
        ax.set_xticks(range(len(models)), labels, rotation=50, ha="right", rotation_mode="anchor")
        ax.set_title(task_name(condition))
        ax.set_xticks(np.arange(len(models) + 1) - 0.5, minor=True)
        ax.set_yticks(np.arange(len(effects) + 1) - 0.5, minor=True)
        ax.grid(False)
        ax.grid(True, which="minor", color="#DDDDDD", linewidth=0.6)
        ax.tick_params(which="both", length=0)
        ax.spines[:].set_visible(False)
    verdicts = dict(zip(judged["effect"], judged["verdict"], strict=True))
    names = [effect_name(key) + MARKS.get(verdicts[key], ("",))[0] for key in effects]
    axes[0, 0].set_yticks(range(len(effects)), names)
    percent = {"ticks": [-FULL, 0, FULL], "format": lambda x, _: f"{100 * x:+.0f} %"}
    figure.colorbar(picture, ax=axes[0].tolist(), pad=0.01, label="Change of the error", **percent)
    marked = "; ".join(f"{mark.strip()} {said}" for key, (mark, said) in MARKS.items() if key in verdicts.values())
    note = (
        f"change of the error ({unit}) in %, ± half of its 90 % interval\n"
        f"interval white: within {100 * MARGIN:.0f} %; coloured: beyond; hatched: on both sides"
    )
    figure.suptitle("\n".join(filter(None, [title, note, marked])))
    style.save(figure, path)
