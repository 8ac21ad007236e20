"""Draw the pictures of the page's first screen: small, of one paper each, readable on a phone."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from tactile.drawing import style

plt = style.plt
FILE = "answer.png"  # in the accuracy folder of an experiment
SIZE = 3.8, 2.0  # inches; shown 290 pixels wide or wider, where 9 points are 9 pixels


def pressed(path: Path, title: str, maps: Mapping[str, np.ndarray], sensor: Mapping) -> None:
    """Draw maps (map_rows, map_cols) in kPa side by side, in the colours of the first one, by name."""
    extent = (0, sensor["cols"] * sensor["pitch_mm"], 0, sensor["rows"] * sensor["pitch_mm"])
    figure, axes = plt.subplots(1, len(maps), figsize=SIZE, squeeze=False)
    highest = float(next(iter(maps.values())).max())
    for ax, (name, values) in zip(axes[0], maps.items(), strict=True):
        image = ax.imshow(values.astype(float), origin="lower", extent=extent, vmin=0, vmax=highest, cmap="viridis")
        ax.set(xticks=[], yticks=[], title=name)
    figure.colorbar(image, ax=axes, label="kPa", shrink=0.7)
    figure.suptitle(title, fontsize=plt.rcParams["font.size"])
    style.save(figure, path)


def bars(path: Path, title: str, xlabel: str, rows: Sequence[tuple[str, Sequence[float]]], widest: float) -> None:
    """Draw a bar for the mean of each row, the first one on top, and a dot for each value; widest: of the axis."""
    figure, ax = plt.subplots(figsize=SIZE)
    for place, (_, values) in enumerate(rows):
        ax.barh(place, np.mean(values), color=style.BLUE, alpha=0.7)
        ax.plot(values, np.full(len(values), place), "o", color=style.BLACK, markersize=2.5)
    ax.set_yticks(range(len(rows)), [name for name, _ in rows])
    ax.invert_yaxis()
    ax.set(xlabel=xlabel, xlim=(min(0, *(min(values) for _, values in rows)) * 1.05, widest))
    figure.suptitle(title, fontsize=plt.rcParams["font.size"])
    style.save(figure, path)
