"""Draw the size ladders of reports/rightsize: error against size, one panel per ladder and condition."""

from collections.abc import Mapping
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.ticker import EngFormatter, LogLocator, NullFormatter, NullLocator

from pipeline.claims.sizes import NAMES, SCALES, Reference, error_of, unit_of
from pipeline.results.studies import FAMILIES
from tactile.drawing import style
from tactile.drawing.labels import capitalised, model_name, task_name

LEAST = 0.6  # of the smallest error is where the axis ends: a longer interval runs out of the panel


def curves(path: Path, title: str, judged: pd.DataFrame, references: Mapping[tuple[str, str], Reference]) -> None:
    """Draw one experiment's ladders, one row of panels per family, one panel per condition.

    judged: rows of claims.sizes.JUDGED; references: (family, condition) -> Reference. The x axis is the number of
    parameters, for windows the number of frames: the parameters hardly depend on it.
    """
    families, conditions = list(dict.fromkeys(judged["family"])), list(dict.fromkeys(judged["condition"]))
    figure, axes = plt.subplots(
        len(families), len(conditions), figsize=(1.2 + 3.4 * len(conditions), 0.9 + 3.0 * len(families)), squeeze=False
    )
    handles = {}
    for row, name in zip(axes, families, strict=True):
        for ax, condition in zip(row, conditions, strict=True):
            ladder = judged[(judged["family"] == name) & (judged["condition"] == condition)].sort_values("size")
            _panel(ax, name, ladder, references[name, condition], handles)
            ax.set_title(f"{model_name(FAMILIES[name].model)}, {task_name(condition)}")
        metric, unit = judged[judged["family"] == name].iloc[0][["metric", "unit"]]
        row[0].set_ylabel(f"{capitalised(NAMES[metric])} ({unit_of(metric, unit)})")
    figure.legend(handles.values(), handles, loc="outside lower center", ncols=3)
    figure.suptitle(f"{title}: test error against the size of a model")
    style.save(figure, path)


def _panel(ax: plt.Axes, family: str, ladder: pd.DataFrame, reference: Reference, handles: dict) -> None:
    scale, metric = SCALES[family], ladder.iloc[0]["metric"]
    across = ladder["size" if family == "window" else "params"].to_numpy(float)
    value, low, high = (error_of(ladder[column], metric).to_numpy(float) for column in ("value", "low", "high"))
    low, high = np.minimum(low, high), np.maximum(low, high)  # an error of 1 - a fraction swaps them
    spread = np.array([value - low, high - value])
    spread[0] = np.minimum(spread[0], 0.95 * value)  # the axis is logarithmic
    spread = np.nan_to_num(spread)
    handles["mean over seeds, 95 % interval"] = ax.errorbar(
        across, value, spread, color=style.BLUE, marker="o", markersize=5, capsize=3, linewidth=1.3
    )
    # One run tells no smallest size that is enough, nor does the largest of a ladder.
    chosen = ((ladder["chosen"] == 1) & np.isfinite(low) & (ladder["size"] < ladder["size"].max())).to_numpy()
    published = (ladder["size"] == scale.published).to_numpy()
    ring = {"marker": "o", "s": 170, "facecolors": "none", "linewidths": 2.2, "color": style.VERMILION}
    handles["smallest that is enough, if not the largest"] = ax.scatter(across[chosen], value[chosen], **ring, zorder=3)
    diamond = {"marker": "D", "s": 48, "linewidths": 1, "color": style.BLACK}
    handles["published size"] = ax.scatter(across[published], value[published], **diamond, zorder=3)
    bottom = np.nanmin([*(value - spread[0]), reference.trained])
    bottom = max(bottom, LEAST * np.nanmin([*value, reference.trained]))
    top = np.nanmax([*(value + spread[1]), reference.constant])
    failed, gone = (ladder["failed"] > 0).to_numpy(), ~np.isfinite(value)
    if failed.any():
        handles["a run failed, or all"] = ax.scatter(
            across[failed], np.where(gone, top, value)[failed], s=70, marker="x", color=style.BLACK, zorder=4
        )
    if np.isfinite(reference.constant):
        handles["constant model"] = ax.axhline(reference.constant, color=style.GREY, linestyle=":")
    if np.isfinite(reference.trained):
        handles["model of the tables, fully trained"] = ax.axhline(
            reference.trained, color=style.GREEN, linestyle=(0, (5, 1.5))
        )
    ax.set(xscale="log", yscale="log", xlim=(across.min() / 1.6, across.max() * 1.6), ylim=(bottom / 1.25, top * 1.25))
    if family == "window":
        ax.set_xlabel("Frames of a window")
        ax.set_xticks(across, [f"{size:g}" for size in across])
        ax.xaxis.set_minor_locator(NullLocator())
    else:
        for x, y, size in zip(across, np.where(gone, top, value + spread[1]), ladder["size"], strict=True):
            ax.annotate(
                f"{size:g}", (x, y), (0, 9), textcoords="offset points", ha="center", fontsize=8,
                bbox={"facecolor": "white", "edgecolor": "none", "pad": 0.5},
            )  # fmt: skip
        ax.set_xlabel(f"Parameters (label: {scale.size_name})")
        ax.xaxis.set_major_locator(LogLocator(subs=(1, 3)))
        ax.xaxis.set_major_formatter(EngFormatter(sep=""))  # 300k, 1M
        ax.xaxis.set_minor_formatter(NullFormatter())
    ax.yaxis.set_major_locator(LogLocator(subs=(1, 1.5, 2, 3, 4, 6, 8)))
    ax.yaxis.set_major_formatter("{x:g}")
    ax.yaxis.set_minor_locator(NullLocator())
