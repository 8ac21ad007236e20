"""Draw the figures of the glove experiments, those of the SP-ResNet paper first. Every function writes one PNG."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.colors import LogNorm
from matplotlib.lines import Line2D

from pipeline.datasets.images import HIGHEST, SIDE
from pipeline.reporting.figures import style
from pipeline.reporting.figures.style import model_style
from pipeline.reporting.words.labels import form_name, model_name
from pipeline.scoring.results import Fit, estimate

COLOURS = {"pressure": style.BLUE, "strain": style.VERMILION, "combined": style.BLACK}  # of the datasets
DASHES = {"pressure": "-", "strain": "--", "combined": ":"}
LEAST_PERCENT = 1.0  # a cell of a confusion matrix is labelled from here on


def pressed_cell(path: Path, force: np.ndarray, siemens: np.ndarray, title: str) -> None:
    """Draw figure 7: resistance and conductance (siemens) of a pressure cell against the force on it (N)."""
    figure, axes = plt.subplots(1, 2, figsize=(9, 3.6))
    for ax, values, unit in (
        (axes[0], 1e-3 / siemens, "Resistance (kΩ)"),
        (axes[1], 1e3 * siemens, "Conductance (mS)"),
    ):
        ax.plot(force, values, color=style.BLUE)
        ax.set(xlabel="Force (N)", ylabel=unit, ylim=(0, 1.05 * values.max()))
    figure.suptitle(title)
    style.save(figure, path)


def bent_joint(path: Path, held: tuple, bends: tuple, angles: Sequence[float], title: str) -> None:
    """Draw figure 9: mean conductance of a joint's cells at held angles, and while it is bent again and again.

    held, bends: (seconds, siemens), both (samples,); angles: those held one after the other, in degrees.
    """
    figure, axes = plt.subplots(1, 2, figsize=(11, 3.7), sharey=True)
    for ax, (time_s, siemens), name in zip(axes, (held, bends), ("a) Held angles", "b) Bends"), strict=True):
        ax.plot(time_s, 1e3 * siemens, color=style.BLUE, linewidth=0.8)
        ax.set(xlabel="Time (s)", title=name, xlim=(0, time_s[-1]), ylim=(0, 1.2e3 * bends[1].max()))
    step = held[0][-1] / len(angles)
    for k, angle in enumerate(angles):
        inside = (held[0] >= k * step) & (held[0] < (k + 1) * step)
        axes[0].text((k + 0.5) * step, 1e3 * held[1][inside].max() + 0.02, f"{angle:g}°", ha="center", va="bottom")
    axes[0].set_ylabel("Mean conductance (mS)")
    figure.suptitle(title)
    style.save(figure, path)


def tactile_images(
    path: Path, pictures: Mapping[str, np.ndarray], strain_area: tuple[slice, slice], title: str
) -> None:
    """Draw figure 10 b to d: one grasp as joint bending strain (red), palm pressure (blue) and both.

    pictures: dataset -> (SIDE, SIDE), 0 to 255; strain_area: rows and columns of the joints.
    """
    joints, everywhere = np.zeros((SIDE, SIDE), dtype=bool), np.ones((SIDE, SIDE), dtype=bool)
    joints[strain_area] = True
    panels = {
        "b) Joint bending strain": ("strain", {"Strain": everywhere}),
        "c) Palm pressure": ("pressure", {"Pressure": everywhere}),
        "d) Combination": ("combined", {"Strain": joints, "Pressure": ~joints}),
    }
    figure, axes = plt.subplots(1, 3, figsize=(11, 3.7), sharey=True)
    drawn = {}
    for ax, (name, (dataset, parts)) in zip(axes, panels.items(), strict=True):
        for meaning, area in parts.items():
            drawn[meaning] = ax.imshow(
                np.ma.masked_array(pictures[dataset], ~area), cmap={"Strain": "Reds", "Pressure": "Blues"}[meaning],
                vmin=0, vmax=HIGHEST, extent=(0.5, SIDE + 0.5, SIDE + 0.5, 0.5),
            )  # fmt: skip
        ticks = [1, 8, 16, 24, 32]
        ax.set(title=name, xlabel="Column of the scan", xticks=ticks, yticks=ticks)
        ax.grid(False)
    axes[0].set_ylabel("Row of the scan")
    for meaning, picture in drawn.items():
        figure.colorbar(picture, ax=axes, label=f"{meaning}, normalised (0 to 255)", fraction=0.025, pad=0.01)
    figure.suptitle(title)
    style.save(figure, path)


def tactile_sequences(path: Path, sequences: Mapping[str, np.ndarray], cells: int, title: str) -> None:
    """Draw figure 13: one panel per object, the readings of every sensor in the last frames of a session.

    sequences: object -> conductance in mS (sensors, frames), 0 where nothing is wired; cells: how many of the sensors,
    the first ones, are pressure cells; the others are joints.
    """
    figure, axes = style.panels(len(sequences), 4, 12, 3.1, 0.6, sharex=True, sharey=True)
    low = min(values[values > 0].min() for values in sequences.values())
    high = max(values.max() for values in sequences.values())
    colours = plt.get_cmap("viridis").with_extremes(bad="#DDDDDD")
    for ax, (name, values) in zip(axes.flat, sequences.items(), strict=False):
        sensors, frames = values.shape
        picture = ax.imshow(
            np.ma.masked_equal(values, 0), norm=LogNorm(low, high), cmap=colours, aspect="auto",
            extent=(0.5, frames + 0.5, sensors + 0.5, 0.5), interpolation="nearest",
        )  # fmt: skip
        ax.axhline(cells + 0.5, color=style.VERMILION, linewidth=1)
        ax.set(title=style.literal(name.replace("_", " ")), yticks=[1, cells // 3, 2 * cells // 3, cells])
        ax.grid(False)
    for ax in axes[:, 0]:
        ax.set_ylabel("Sensor number")
    for ax in axes[-1]:
        ax.set_xlabel("Frame")
    bar = figure.colorbar(picture, ax=axes, label="Conductance (mS); grey: not wired", fraction=0.02, pad=0.01)
    style.plain_log(bar.ax.yaxis)
    figure.suptitle(title)
    style.save(figure, path)


def confusion_matrix(path: Path, counts: np.ndarray, objects: Sequence[str], title: str) -> None:
    """Draw figure 14: how often an object (row) is given each name (column), in percent of its images.

    counts: (classes, classes) images; cells from LEAST_PERCENT are labelled.
    """
    images = counts.sum(axis=1, keepdims=True)
    percent = 100 * np.divide(counts, images, out=np.zeros(counts.shape), where=images > 0)
    names = [style.literal(name.replace("_", " ")) for name in objects]
    side = (0.4 if len(names) <= 20 else 0.335) * len(names)
    figure, ax = plt.subplots(figsize=(side + 2, side + 1.6))
    picture = ax.imshow(percent, cmap="Blues", vmin=0, vmax=100)
    for row, column in np.argwhere(percent >= LEAST_PERCENT):
        value = percent[row, column]
        ax.text(column, row, f"{value:.0f}", ha="center", va="center", fontsize=8, color="w" if value > 55 else "k")
    places = np.arange(len(names))
    ax.set_xticks(places, names, rotation=90)
    ax.set_yticks(places, names)
    ax.set_xticks(places[1:] - 0.5, minor=True)
    ax.set_yticks(places[1:] - 0.5, minor=True)
    ax.grid(False)
    ax.grid(which="minor")
    ax.tick_params(which="minor", length=0)
    ax.set(xlabel="Name given by the model", ylabel="Object", title=title)
    figure.colorbar(picture, ax=ax, label="Share of the object's images (%)", shrink=0.6, aspect=30, pad=0.02)
    style.save(figure, path)


def precision_by_frames(path: Path, panels: Mapping[str, pd.DataFrame], title: str) -> None:
    """Draw figure 15: macro precision against the number of input frames, one panel per table.

    One line per model and form: of networks trained on all frames, and dotted with open marks of mean predictions.
    panels: title -> form, model, seed, frames, metric, value (fraction).
    """
    figure, axes = style.panels(len(panels), len(panels), 4.8 * len(panels) + 0.4, 4, 0)
    handles = {}
    for ax, (name, table) in zip(axes[0], panels.items(), strict=True):
        precision = table[table["metric"] == "macro_precision"]
        lines = precision.groupby(["model", "form"], sort=False)
        count = lines.ngroups
        for k, ((model, form), runs) in enumerate(lines):
            look, place = model_style(model), 0.12 * (k - (count - 1) / 2)  # side by side: intervals overlap
            estimates = {n: estimate(100 * part["value"]) for n, part in runs.groupby("frames")}
            mean, spread = style.spread(estimates.values())
            dotted = {"linestyle": ":", "markerfacecolor": "white"} if form == "mean" else {"linestyle": look.linestyle}
            handles[f"{look.label}, {form_name(form)}"] = ax.errorbar(
                np.array(list(estimates)) + place, mean, np.nan_to_num(spread), color=look.color, marker=look.marker,
                capsize=3, markersize=6, **dotted,
            )  # fmt: skip
        ax.set(xlabel="Number of input frames", title=name, xticks=sorted(set(precision["frames"])))
        ax.set_ylim(top=min(ax.get_ylim()[1], 101))  # an interval may pass 100 %
    axes[0][0].set_ylabel("Macro precision (%), mean and 95 % interval")
    figure.legend(handles.values(), handles, loc="outside lower center", ncols=2)
    figure.suptitle(title)
    style.save(figure, path)


def learning_curves(path: Path, fits: Mapping[str, Mapping[str, Sequence[Fit]]], title: str) -> None:
    """Draw validation loss over the epochs, one panel per network; fits: model -> dataset -> one fit per seed."""
    columns = min(3, len(fits))
    figure, axes = style.panels(len(fits), columns, 3.6 * columns, 2.9, 0.7, sharey=True)
    for ax, (model, datasets) in zip(axes.flat, fits.items(), strict=False):
        for dataset, runs in datasets.items():
            for fit in runs:
                epochs, loss = fit.history["epoch"], fit.history["validation_loss"]
                ax.plot(epochs, loss, color=COLOURS[dataset], linestyle=DASHES[dataset], linewidth=1.2)
                kept = fit.history[epochs == fit.best_epoch]
                ax.plot(kept["epoch"], kept["validation_loss"], "o", color=COLOURS[dataset], markersize=4)
        ax.set(title=model_name(model), yscale="log", xlabel="Epoch")
        style.plain_log(ax.yaxis)
        ax.xaxis.get_major_locator().set_params(integer=True)
    for ax in axes[:, 0]:
        ax.set_ylabel("Validation loss: cross-entropy (nats)")
    names = [name for name in COLOURS if any(name in datasets for datasets in fits.values())]
    handles = [Line2D([], [], color=COLOURS[name], linestyle=DASHES[name]) for name in names]
    handles.append(Line2D([], [], color=style.BLACK, marker="o", linestyle=""))
    figure.legend(handles, [*names, "epoch that was kept"], loc="outside lower center", ncols=len(handles))
    figure.suptitle(title)
    style.save(figure, path)
