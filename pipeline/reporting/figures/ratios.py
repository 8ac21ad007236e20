"""Draw the first chart of README and page: our errors over the published ones, one panel per paper."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.ticker import FixedLocator, NullLocator

from tactile.drawing import style
from tactile.drawing.labels import model_name

LOOKS = ((style.BLUE, "o"), (style.VERMILION, "s"), (style.GREEN, "D"))  # of conditions
REACH = 5.0  # factor from 1; a ratio beyond it is an arrowhead at the edge with its number
TICKS = (0.2, 0.5, 1, 2, 5)


class Point(NamedTuple):
    """An error that a paper prints, and ours of the same model, as they are judged: mean and 95 % interval."""

    model: str
    published: float
    ours: float
    low: float
    high: float


def chart(path: Path, panels: Mapping[str, Mapping[str, Sequence[Point]]], band: float) -> None:
    """Draw ours over published, mean and interval, on a logarithmic axis; panels: title -> condition -> points.

    Models run from top to bottom in the order of the paper's table. Shaded is what lies within `band`, a share, of the
    published error, and within twice that.
    """
    models = {title: list(dict.fromkeys(at.model for own in of.values() for at in own)) for title, of in panels.items()}
    longest = max(map(len, models.values()), default=1)
    figure, axes = plt.subplots(1, len(panels), figsize=(4.1 * len(panels), 2.1 + 0.33 * longest), squeeze=False)
    for ax, (title, conditions) in zip(axes[0], panels.items(), strict=True):
        for share, shade in ((2 * band, "#EEF3F7"), (band, "#D3E2EE")):
            ax.axvspan(1 - share, 1 + share, color=shade, zorder=0)
        ax.axvline(1, color=style.GREY, linewidth=1)
        for k, ((condition, own), (colour, marker)) in enumerate(zip(conditions.items(), LOOKS, strict=False)):
            shift = 0.5 * ((k + 0.5) / len(conditions) - 0.5)
            look = {"color": colour, "marker": marker, "linestyle": ""}
            ax.plot([], [], label=condition, **look)
            for point in own:
                row, ratio = models[title].index(point.model) + shift, point.ours / point.published
                ends = np.clip(np.divide([point.low, point.high], point.published), 1 / REACH, REACH)
                ax.plot(ends, [row, row], color=colour, linewidth=1.6)
                if 1 / REACH <= ratio <= REACH:
                    ax.plot(ratio, row, markersize=6.5, markeredgecolor="white", markeredgewidth=0.6, **look)
                    continue
                edge, side = (1 / REACH, 1) if ratio < 1 else (REACH, -1)
                ax.plot(edge, row, "<" if side > 0 else ">", color=colour, markersize=7, clip_on=False)
                words = {"textcoords": "offset points", "ha": "left" if side > 0 else "right", "va": "center"}
                ax.annotate(f"{ratio:.2g}", (edge, row), (7 * side, 0), color=colour, **words)
        ax.set(xscale="log", xlim=(1 / REACH, REACH), ylim=(len(models[title]) - 0.4, -0.6), title=title)
        ax.set_xlabel("ours / published")
        ax.set_yticks(range(len(models[title])), map(model_name, models[title]))
        ax.xaxis.set_major_locator(FixedLocator(TICKS))
        ax.xaxis.set_minor_locator(NullLocator())
        ax.xaxis.set_major_formatter("{x:g}")
        ax.grid(False, axis="x")
        ax.legend(loc="upper center", bbox_to_anchor=(0.5, -0.13), ncols=len(conditions), handletextpad=0.2)
    figure.suptitle(
        "Our errors over the published ones, as they are judged; bars are 95 % intervals, shaded is what lies "
        f"within {100 * band:.0f} % and {200 * band:.0f} %"
    )
    style.save(figure, path)
