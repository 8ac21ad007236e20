"""Figures of reports/rightsize: error against size, a panel a ladder and condition."""

from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.ticker import EngFormatter, LogLocator, NullFormatter, NullLocator

from pipeline.reporting.figures import style
from pipeline.reporting.verdicts import sizes as sizes_verdicts

LEAST = 0.6  # of the smallest error is where the axis ends: a longer interval runs out of the panel


class Reference(NamedTuple):
    """Errors that a panel is read against, NaN if unknown: the constant model's and the fully trained model's."""

    constant: float
    trained: float


def curves(path: Path, title: str, judged: pd.DataFrame, references: Mapping[tuple[str, str], Reference]) -> None:
    """One experiment's ladders, a row of panels a family, a panel a condition.

    judged: rows of enough.JUDGED; references: (family, condition) -> Reference. The x axis is the number of
    parameters, for windows the number of frames: the parameters hardly depend on it.
    """
    families, conditions = list(dict.fromkeys(judged["family"])), list(dict.fromkeys(judged["condition"]))
    figure, axes = plt.subplots(
        len(families), len(conditions), figsize=(1.2 + 3.4 * len(conditions), 0.9 + 3.0 * len(families)), squeeze=False
    )
    handles = {}
    for row, name in zip(axes, families, strict=True):
        for ax, condition in zip(row, conditions, strict=True):
            own = judged[(judged["family"] == name) & (judged["condition"] == condition)].sort_values("size")
            _panel(ax, name, own, references[name, condition], handles)
            ax.set_title(f"{sizes_verdicts.label(name)}, {condition.replace('_', ' ')}")
        metric, unit = judged[judged["family"] == name].iloc[0][["metric", "unit"]]
        row[0].set_ylabel(f"Test error, {sizes_verdicts.NAMES[metric]} ({sizes_verdicts.unit_of(metric, unit)})")
    figure.legend(handles.values(), handles, loc="outside lower center", ncols=3)
    figure.suptitle(title)
    style.save(figure, path)


def _panel(ax: plt.Axes, name: str, own: pd.DataFrame, reference: Reference, handles: dict) -> None:
    scale, metric = sizes_verdicts.SCALES[name], own.iloc[0]["metric"]
    across = own["size" if name == "window" else "params"].to_numpy(float)
    value, low, high = (
        sizes_verdicts.error_of(own[column], metric).to_numpy(float) for column in ("value", "low", "high")
    )
    spread = np.abs(np.array([value - low, high - value]))  # an error of 1 - a fraction swaps low and high
    spread[0] = np.minimum(spread[0], 0.95 * value)  # the axis is logarithmic
    handles["mean over seeds, 95 % interval"] = ax.errorbar(
        across, value, np.nan_to_num(spread), color=style.BLUE, marker="o", markersize=5, capsize=3, linewidth=1.3
    )
    chosen, published = (own["chosen"] == 1).to_numpy(), (own["size"] == scale.published).to_numpy()
    for mark, where, how in (
        ("smallest that is enough", chosen, {"marker": "o", "s": 170, "facecolors": "none", "linewidths": 2.2}),
        ("published size", published, {"marker": "D", "s": 48, "linewidths": 1}),
    ):
        colour = style.VERMILION if mark.startswith("smallest") else style.BLACK
        handles[mark] = ax.scatter(across[where], value[where], **({"color": colour} | how), zorder=3)
    bottom, top = (
        np.nanmin([*(value - np.nan_to_num(spread[0])), reference.trained]),
        np.nanmax([*(value + np.nan_to_num(spread[1]))]),
    )
    top = np.nanmax([top, reference.constant])
    bottom = max(bottom, LEAST * np.nanmin([*value, reference.trained]))
    failed, gone = (own["failed"] > 0).to_numpy(), ~np.isfinite(value)
    if failed.any():
        handles["a run failed, or all"] = ax.scatter(
            across[failed], np.where(gone, top, value)[failed], s=70, marker="x", color=style.BLACK, zorder=4
        )
    if np.isfinite(reference.constant):
        handles["constant (floor)"] = ax.axhline(reference.constant, color=style.GREY, linestyle=":")
    if np.isfinite(reference.trained):
        handles["model of the tables, fully trained"] = ax.axhline(
            reference.trained, color=style.GREEN, linestyle=(0, (5, 1.5))
        )
    tops = np.where(gone, top, value + np.nan_to_num(spread[1]))
    for x, y, size in zip(across, tops, own["size"], strict=True) if name != "window" else ():
        ax.annotate(
            f"{size:g}", (x, y), (0, 9), textcoords="offset points", ha="center", fontsize=8,
            bbox={"facecolor": "white", "edgecolor": "none", "pad": 0.5},
        )  # fmt: skip
    ax.set(xscale="log", yscale="log", xlim=(across.min() / 1.6, across.max() * 1.6), ylim=(bottom / 1.25, top * 1.25))
    ax.set_xlabel("Frames of a window" if name == "window" else f"Parameters (label: {scale.size_name})")
    if name == "window":
        ax.set_xticks(across, [f"{size:g}" for size in across])
        ax.xaxis.set_minor_locator(NullLocator())
    else:
        ax.xaxis.set_major_locator(LogLocator(subs=(1, 3)))
        ax.xaxis.set_major_formatter(EngFormatter(sep=""))  # 300k, 1M
        ax.xaxis.set_minor_formatter(NullFormatter())
    ax.yaxis.set_major_locator(LogLocator(subs=(1, 1.5, 2, 3, 4, 6, 8)))
    ax.yaxis.set_major_formatter("{x:g}")
    ax.yaxis.set_minor_locator(NullLocator())
