"""Give all figures one look: a dozen colours and grey, one fixed style per model, and files that never carry a date."""

import zlib
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import matplotlib
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.colors import to_rgb
from matplotlib.ticker import FixedLocator, LogLocator, NullFormatter

from tactile.base import files
from tactile.drawing.labels import model_name

DPI = 150
BLACK, GREY = "#000000", "#777777"
# Each has a contrast of at least 3 to 1 with white.
ORANGE, SKY, GREEN, BROWN = "#C77700", "#2E8FCB", "#009E73", "#6B3E00"
BLUE, VERMILION, PURPLE = "#0072B2", "#D55E00", "#CC79A7"
WINE, OLIVE, INDIGO, TEAL, ROSE = "#882255", "#999933", "#332288", "#2F9A8A", "#CC6677"  # of Tol's muted scheme
MEASURED = {"color": BLACK, "linestyle": "--", "linewidth": 1.5}


class Style(NamedTuple):
    """How one model is drawn, and its name."""

    label: str
    color: str
    marker: str
    linestyle: str | tuple[int, tuple[float, ...]]  # its name, or offset and lengths of dashes and gaps


STYLES: dict[str, tuple[str, str, str | tuple[int, tuple[float, ...]]]] = {  # colour, marker, line
    "constant": (GREY, "x", ":"),
    "linear": (ORANGE, "o", "-"),
    "poly": (WINE, "^", "--"),
    "tree": (BROWN, "s", "-"),
    "linear_array": (ROSE, "X", "-"),
    "poly_array": (TEAL, ">", "--"),
    "tree_array": (BLACK, "p", "-"),
    "rbf": (OLIVE, "D", (0, (1, 1))),
    "cnn": (GREEN, "v", "-."),
    "vgg": (SKY, "P", "-"),
    "convlstm": (PURPLE, "h", (0, (4, 1, 1, 1))),
    "rnn": (BLUE, "<", (0, (5, 1.5))),
    "lomp": (VERMILION, "*", "-"),
    "lomp_stream": (INDIGO, "d", (0, (5, 1.5))),
    "lomp_shared": (INDIGO, "d", "--"),
    "ridge": (ORANGE, "o", "-"),
    "esn": (GREEN, "v", "-."),
    "lstm_direct": (BLUE, "s", "-"),
    "lstm_transfer": (VERMILION, "^", "--"),
    "lstm_highpass": (SKY, "*", (0, (5, 1.5))),
    "press_difference": (BLACK, "P", (0, (1, 1))),
    "lstm_transfer_ridge": (PURPLE, "D", (0, (4, 1, 1, 1))),
    "window_ridge": (OLIVE, "X", "--"),
    "window_trees": (BLACK, "p", "-."),
    "naive_bayes": (ORANGE, "o", ":"),
    "resnet18": (GREEN, "v", "-."),
    "mobilenet": (SKY, "P", (0, (5, 1.5))),
    "resnet3x3": (BLUE, "D", "--"),
    "sp_resnet_nogcam": (PURPLE, "h", (0, (4, 1, 1, 1))),
    "sp_resnet": (VERMILION, "*", "-"),
}

matplotlib.rcdefaults()  # whatever a matplotlibrc of the user says
plt.rcParams.update(
    {
        "figure.constrained_layout.use": True,
        "font.size": 9,
        "axes.titlesize": 9,
        "axes.spines.top": False,
        "axes.spines.right": False,
        "axes.grid": True,
        "grid.color": "#E6E6E6",
        "axes.axisbelow": True,
        "legend.frameon": False,
    }
)


def model_style(model: str) -> Style:
    """Return how a model is drawn; a new model gets a style that depends on its name alone."""
    if model in STYLES:
        return Style(model_name(model), *STYLES[model])
    place = zlib.crc32(model.encode())
    colours = (BLUE, VERMILION, GREEN, PURPLE, SKY, ORANGE)
    return Style(model_name(model), colours[place % len(colours)], "Xd>8p"[place // 7 % 5], (0, (2, 1)))


def mixed(colour: str, share: float) -> tuple[float, ...]:
    """Return a share of a colour mixed with white."""
    return tuple(float(1 - share * (1 - part)) for part in to_rgb(colour))


def literal(name: str) -> str:
    """Return text for matplotlib that shows `name` as it is: `$` does not start a formula."""
    return name.replace("$", r"\$")


def plain_log(axis: matplotlib.axis.Axis, at: Sequence[float] = ()) -> None:
    """Write plain numbers on a logarithmic axis that has its limits.

    `at` these values, otherwise at 1, 2, 5, 10, and only at decades if the axis is long.
    """
    low, high = axis.get_view_interval()
    axis.set_major_locator(FixedLocator(at) if at else LogLocator(subs=(1, 2, 5) if high < 1e3 * low else (1,)))
    axis.set_major_formatter("{x:g}")
    axis.set_minor_formatter(NullFormatter())


def panels(
    count: int, columns: int, width: float, height: float, margin: float, **options: Any
) -> tuple[plt.Figure, np.ndarray]:
    """Return a figure and its axes (rows, columns), `count` of them, row by row; the axes after these are invisible.

    width, margin: of the figure and above and below its panels; height: of one row; all in inches.
    """
    rows = max(1, -(-count // columns))
    figure, axes = plt.subplots(rows, columns, figsize=(width, height * rows + margin), squeeze=False, **options)
    for ax in axes.flat[count:]:
        ax.set_axis_off()
    return figure, axes


def save(figure: plt.Figure, path: Path) -> None:
    """Write a PNG whose bytes depend on the figure alone, and close the figure.

    A figure of few panels is made as wide as its title and legend.
    """
    figure.draw_without_rendering()
    widest = max((part.get_window_extent().width for part in [*figure.texts, *figure.legends]), default=0) / figure.dpi
    if widest > figure.get_figwidth():
        figure.set_figwidth(widest + 0.2)
    with files.replacing(path) as draft:
        figure.savefig(draft, format=path.suffix.removeprefix("."), dpi=DPI, metadata={"Software": None})
    plt.close(figure)


def press_borders(ax: plt.Axes, time_s: np.ndarray, press: np.ndarray) -> None:
    """Draw thin lines between presses; time_s, press: (n,) in order of time."""
    for k in range(1, len(press)):
        if press[k] != press[k - 1]:
            ax.axvline((time_s[k - 1] + time_s[k]) / 2, color="#BBBBBB", linewidth=0.8, zorder=0)
