"""The look of all figures: nine colours and grey, one fixed style a model, and files that never carry a date."""

import zlib
from pathlib import Path
from typing import NamedTuple

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
from matplotlib.ticker import LogLocator, NullFormatter

DPI = 150
BLACK, GREY = "#000000", "#777777"
ORANGE, SKY, GREEN, YELLOW = "#E69F00", "#56B4E9", "#009E73", "#F0E442"
BLUE, VERMILION, PURPLE = "#0072B2", "#D55E00", "#CC79A7"
WINE, OLIVE, INDIGO = "#882255", "#999933", "#332288"  # of Tol's muted scheme: `touch` has eleven models
MEASURED = {"color": BLACK, "linestyle": "--", "linewidth": 1.5}


class Style(NamedTuple):
    """How one model is drawn and what it is called."""

    label: str
    color: str
    marker: str
    linestyle: str


STYLES = {
    "constant": Style("Constant (mean)", GREY, "x", ":"),
    "linear": Style("Linear", ORANGE, "o", "-"),
    "poly": Style("Polynomial", WINE, "^", "--"),
    "tree": Style("Decision tree", YELLOW, "s", "-"),
    "rbf": Style("RBF-Net", OLIVE, "D", (0, (1, 1))),
    "cnn": Style("CNN", GREEN, "v", "-."),
    "vgg": Style("VGG-16", SKY, "P", "-"),
    "convlstm": Style("ConvLSTM", PURPLE, "h", (0, (4, 1, 1, 1))),
    "rnn": Style("RNN", BLUE, "<", (0, (5, 1.5))),
    "lomp": Style("LoMP", VERMILION, "*", "-"),
    "lomp_stream": Style("LoMP streaming", INDIGO, "d", (0, (5, 1.5))),
    "ridge": Style("Ridge, raw window", ORANGE, "o", "-"),
    "esn": Style("Echo state network", GREEN, "v", "-."),
    "lstm_direct": Style("LSTM, direct", BLUE, "s", "-"),
    "lstm_transfer": Style("LSTM, transfer (Adam)", VERMILION, "^", "--"),
    "lstm_highpass": Style("LSTM on high-passed voltages", SKY, "*", (0, (5, 1.5))),
    "press_difference": Style("Extra trees, press minus rest", BLACK, "P", (0, (1, 1))),
    "lstm_transfer_ridge": Style("LSTM, transfer (closed form)", PURPLE, "D", (0, (4, 1, 1, 1))),
    "naive_bayes": Style("Naive Bayes", ORANGE, "o", ":"),
    "resnet18": Style("ResNet-18", GREEN, "v", "-."),
    "mobilenet": Style("MobileNet", SKY, "P", (0, (5, 1.5))),
    "resnet3x3": Style("ResNet_3x3", BLUE, "D", "--"),
    "sp_resnet_nogcam": Style("SP-ResNet (no GCAM)", PURPLE, "h", (0, (4, 1, 1, 1))),
    "sp_resnet": Style("SP-ResNet", VERMILION, "*", "-"),
}

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


def style(model: str) -> Style:
    """The style of a model; a new model gets one that depends on its name alone."""
    if model in STYLES:
        return STYLES[model]
    place = zlib.crc32(model.encode())
    colours = (BLUE, VERMILION, GREEN, PURPLE, SKY, ORANGE)
    return Style(model, colours[place % len(colours)], "Xd>8p"[place // 7 % 5], (0, (2, 1)))


def literal(name: str) -> str:
    """Text for matplotlib that shows `name` as it is: `$` does not start a formula."""
    return name.replace("$", r"\$")


def plain_log(axis: matplotlib.axis.Axis) -> None:
    """Plain numbers on a logarithmic axis that has its limits: 1, 2, 5, 10; only decades if it is long."""
    low, high = axis.get_view_interval()
    axis.set_major_locator(LogLocator(subs=(1, 2, 5) if high < 1e3 * low else (1,)))
    axis.set_major_formatter("{x:g}")
    axis.set_minor_formatter(NullFormatter())


def save(figure: plt.Figure, path: Path) -> None:
    """Write a PNG whose bytes depend on the figure alone, and close the figure.

    A figure of few panels is made as wide as its title and legend.
    """
    figure.draw_without_rendering()
    widest = max((part.get_window_extent().width for part in [*figure.texts, *figure.legends]), default=0) / figure.dpi
    if widest > figure.get_figwidth():
        figure.set_figwidth(widest + 0.2)
    figure.savefig(path, dpi=DPI, metadata={"Software": None})
    plt.close(figure)


def press_borders(ax: plt.Axes, time_s, press) -> None:
    """Thin lines between presses; time_s, press: (n,) in order of time."""
    for k in range(1, len(press)):
        if press[k] != press[k - 1]:
            ax.axvline((time_s[k - 1] + time_s[k]) / 2, color="#BBBBBB", linewidth=0.8, zorder=0)
