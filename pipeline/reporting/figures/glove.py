"""Draw what the SP-ResNet paper shows of its glove: a pressed cell, a bent joint, a grasp, the frames of sessions."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.colors import LogNorm

from tactile.datasets.images import HIGHEST, SIDE
from tactile.drawing import style
from tactile.drawing.labels import capitalised, task_name

SHOWN_BENDS_S = 10  # of figure 9b, at either end


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
    """Draw figure 9: mean conductance of a joint's cells at held angles, and over the first and the last of its bends.

    held, bends: (seconds, siemens), both (samples,); angles: those held one after the other, in degrees.
    """
    figure, axes = plt.subplots(1, 2, figsize=(11, 3.7), sharey=True)
    axes[0].plot(held[0], 1e3 * held[1], color=style.BLUE, linewidth=0.8)
    axes[0].set(title="a) Held angles", xlim=(0, held[0][-1]), ylim=(0, 1.2e3 * bends[1].max()))
    step = held[0][-1] / len(angles)
    for k, angle in enumerate(angles):
        inside = (held[0] >= k * step) & (held[0] < (k + 1) * step)
        axes[0].text((k + 0.5) * step, 1e3 * held[1][inside].max() + 0.02, f"{angle:g}°", ha="center", va="bottom")
    first, last = bends[0] < SHOWN_BENDS_S, bends[0] >= bends[0][-1] - SHOWN_BENDS_S
    for name, shown, drawn in (("first", first, {"color": style.BLUE}), ("last", last, style.MEASURED)):
        said = f"{name} {SHOWN_BENDS_S} s of {bends[0][-1]:.0f} s"
        axes[1].plot(bends[0][shown] - bends[0][shown][0], 1e3 * bends[1][shown], **drawn, label=said)
    axes[1].set(title="b) Bends")
    axes[1].legend(loc="upper right")
    for ax in axes:
        ax.set_xlabel("Time (s)")
    axes[0].set_ylabel("Mean conductance (mS)")
    figure.suptitle(title)
    style.save(figure, path)


def tactile_images(
    path: Path, pictures: Mapping[str, np.ndarray], areas: Mapping[str, tuple[slice, slice]], title: str
) -> None:
    """Draw figure 10 b to d: one grasp as bending of the joints (red), as pressure on the palm (blue), and as both.

    pictures: dataset -> (SIDE, SIDE), 0 to 255; areas: rows and columns of pressure and of strain, which alone are
    drawn where a picture has no other.
    """
    looks = {"pressure": "Blues", "strain": "Reds"}
    widths = [area[1].stop - area[1].start for area in (areas["strain"], areas["pressure"])] + [SIDE]
    figure, axes = plt.subplots(1, 3, figsize=(11, 4.2), width_ratios=widths)
    for ax, dataset in zip(axes, ("strain", "pressure", "combined"), strict=True):
        for name, place in areas.items():
            if dataset in (name, "combined"):
                rows, columns = ((side.start + 0.5, side.stop + 0.5) for side in place)
                picture = ax.imshow(
                    pictures[dataset][place], cmap=looks[name], vmin=0, vmax=HIGHEST, extent=(*columns, *rows[::-1])
                )
                bars = {"label": f"{capitalised(task_name(name))}, normalised", "fraction": 0.03, "pad": 0.02}
                if dataset == "combined":
                    figure.colorbar(picture, ax=axes, **bars)
        low, high = ((0.5, SIDE + 0.5),) * 2 if dataset == "combined" else (columns, rows)
        ax.set(title=capitalised(task_name(dataset)), xlabel="Column of the scan", xlim=low, ylim=high[::-1])
        ax.locator_params(integer=True)
        ax.grid(False)
    axes[0].set_ylabel("Row of the scan")
    figure.suptitle(title)
    style.save(figure, path)


def tactile_sequences(path: Path, sequences: Mapping[str, np.ndarray], cells: int, title: str) -> None:
    """Draw figure 13: one panel per object, the readings of every sensor in the last frames of a session.

    sequences: object -> conductance in mS (sensors, frames), 0 where nothing is wired; cells: how many of the sensors,
    the first ones, are pressure cells; the others are joints.
    """
    figure, axes = style.panels(len(sequences), 4, 12, 4.2, 0.6, sharex=True, sharey=True)
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
