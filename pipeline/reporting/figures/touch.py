"""Draw the figures of the LoMP paper. Every function writes one PNG; predictions are one run's, see `scoring.kept`."""

from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.lines import Line2D

from pipeline.reporting.figures import curves
from pipeline.results import kept
from pipeline.scenes import material
from tactile.datasets import labels
from tactile.drawing import style
from tactile.drawing.labels import model_name
from tactile.drawing.style import MEASURED, model_style

FILM_AREA_M2 = 1e-4  # the paper's 1 cm x 1 cm sample (section II-A)
TOUCH_MODELS = ("lomp", "rnn", "cnn", "convlstm")  # of figure 6
PEAK_MODELS = ("linear", "cnn", "rnn", "lomp")  # of figure 4


class Windows(NamedTuple):
    """Windows of the test part of a run that are drawn, n of them, each described at its last frame."""

    condition: np.ndarray  # (n,)
    recording: np.ndarray  # (n,)
    press: np.ndarray  # (n,)
    t_s: np.ndarray  # (n,)
    force_n: np.ndarray  # (n, touches), NaN where there is no such touch; x_mm, y_mm likewise
    x_mm: np.ndarray
    y_mm: np.ndarray
    counts: np.ndarray  # (n, elements)
    pressed: np.ndarray  # (n,) bool: a touch is pressed above touch.window.contact_threshold_n
    touched: np.ndarray  # (n,) bool: the maps' values at the touches are kept
    mapped: np.ndarray  # (n,) bool: the maps are kept


def windows_of(rows: pd.DataFrame, settings: Mapping) -> tuple[Windows, dict[str, pd.DataFrame]]:
    """Return the windows of a protocol, and model -> what is kept of its maps, a row a window; the first is LABEL.

    rows: of `Report.drawn`; settings: the block `touch` of params.yaml.
    """
    rows = rows[(rows["window"] != kept.WHOLE) & (rows["model"] != kept.READING)].sort_values("window", kind="stable")
    maps = {model: rows[rows["model"] == model] for model in [kept.LABEL, *settings["models"]]}
    label = maps[kept.LABEL]
    force, x, y, counts = (np.stack(label[name]) for name in ("force_n", "x_mm", "y_mm", "counts"))
    windows = Windows(
        *(label[name].to_numpy() for name in ("condition", "recording", "press", "t_s")), force, x, y, counts,
        (np.nan_to_num(force) > settings["window"]["contact_threshold_n"]).any(axis=1),
        *(label[name].map(len).to_numpy() > 0 for name in ("at_touches", "map")),
    )  # fmt: skip
    return windows, {model: values for model, values in maps.items() if len(values)}


def characteristic_curve(path: Path, scale: float) -> None:
    """Draw figure 2b: resistance of the fitted film over pressure, without and with its memory; scale: in ohm."""
    film = material.load_material()
    dt, kpa_a_newton = 0.001, 1e-3 / FILM_AREA_M2
    kpa = np.geomspace(1, 400, 400)
    static = scale * np.exp(film.rest - material.static_conductance(film, kpa / kpa_a_newton))
    ramp = np.linspace(0, 400, round(0.25 / dt))
    cycle = np.concatenate([ramp, ramp[::-1]])
    looped = scale * np.exp(material.log_resistance(film, cycle / kpa_a_newton, dt))
    figure, ax = plt.subplots(figsize=(7, 4.3))
    ax.plot(kpa, static, **MEASURED, label="static curve (no memory)")
    middle = len(ramp)
    ax.plot(cycle[:middle], looped[:middle], color=style.BLUE, label="loading, 0 to 400 kPa in 0.25 s")
    ax.plot(cycle[middle:], looped[middle:], color=style.VERMILION, linestyle="-.", label="unloading in 0.25 s")
    ax.set(
        xlabel="Pressure on a film of 1 cm x 1 cm (kPa)",
        ylabel="Resistance (ohm)",
        yscale="log",
        xlim=(0, 400),
        title="Figure 2b: characteristic curve of the Velostat model fitted to recordings",
    )
    figure.legend(loc="outside lower center", ncols=3)
    style.save(figure, path)


def peak_pressure(path: Path, windows: Windows, maps: Mapping[str, pd.DataFrame], caption: str) -> None:
    """Draw figure 4: largest value of true and predicted map, and L1 loss, over windows of test presses, one apart.

    maps: see `windows_of`; caption: what they are of.
    """
    chosen = np.flatnonzero((windows.condition == kept.SOME) & windows.pressed)[: kept.PEAKS]
    peaks = {model: values["peak"].to_numpy(float)[chosen] for model, values in maps.items()}
    losses = {model: values["mean_absolute"].to_numpy(float)[chosen] for model, values in maps.items()}
    models = [model for model in PEAK_MODELS if model in maps] or [model for model in maps if model != kept.LABEL][:4]
    columns = min(2, len(models))
    rows = -(-len(models) // columns)
    look = {"figsize": (4.8 * columns, 3.2 * rows + 0.8), "height_ratios": [2, 1] * rows}
    figure, axes = plt.subplots(2 * rows, columns, sharex=True, squeeze=False, **look)
    at, borders = np.arange(len(chosen)), np.flatnonzero(np.diff(windows.press[chosen])) + 1
    parted = np.insert(at.astype(float), borders, np.nan)  # no line from one press to the next
    limit, top_loss = (
        1.05 * max(np.nanmax(values[model], initial=1e-3, where=np.isfinite(values[model])) for model in of)
        for values, of in ((peaks, [kept.LABEL, *models]), (losses, models))
    )
    pairs = list(zip(axes[::2].flat, axes[1::2].flat, strict=True))
    for model, (upper, lower) in zip(models, pairs, strict=False):
        look = model_style(model)
        for shown, drawn in ((peaks[kept.LABEL], MEASURED), (peaks[model], {"color": look.color, "linewidth": 1.2})):
            upper.plot(parted, np.insert(shown, borders, np.nan), **drawn, marker=".")
        lower.bar(at, losses[model], color=look.color, width=1.0)
        upper.set(title=look.label + _failure(peaks[model]), ylim=(0, limit))
        lower.set(ylim=(0, top_loss))
    for upper, lower in zip(axes[::2, 0], axes[1::2, 0], strict=True):
        upper.set_ylabel("Peak pressure\n(kPa)")
        lower.set_ylabel("L1 loss\n(kPa)")
    for lower in axes[-1]:
        lower.set_xlabel("Window in contact (test presses, in order)")
    for pair in pairs[len(models) :]:
        for ax in pair:
            ax.set_axis_off()
    handles = [Line2D([], [], **MEASURED), Line2D([], [], color=style.GREY)]
    names = ["label (largest value of the map)", "prediction (coloured; largest value of the map)"]
    figure.legend(handles, names, loc="outside lower center", ncols=2)
    title = "Figure 4: one touch, true and predicted peak pressure, and mean L1 loss of the map"
    figure.suptitle(style.literal(f"{title}\n{caption}"))
    style.save(figure, path)


def press_location(path: Path, readings: pd.DataFrame, settings: Mapping) -> None:
    """Draw figure 5: counts of an element over pressure for press locations along x within the element.

    readings: the rows of READING in `Report.drawn`.
    """
    sensor, pitch = settings["sensor"], settings["sensor"]["pitch_mm"]
    force, x, y, counts = (np.stack(readings[name])[:, 0] for name in ("force_n", "x_mm", "y_mm", "counts"))
    under, elements = kept.elements_at(x, y, sensor), kept.middle_elements(sensor)
    figure, axes = style.panels(len(elements), len(elements), 3.6 * len(elements), 4, 0, sharex=True, sharey=True)
    colours = (style.BLUE, style.GREEN, style.ORANGE, style.VERMILION, style.PURPLE, style.SKY)
    points: dict[str, list[tuple[plt.Axes, np.ndarray, np.ndarray]]] = {}
    for ax, element in zip(axes[0], elements, strict=True):
        centre_x, inside = (element % sensor["cols"] + 0.5) * pitch, under == element
        for place in np.unique(np.round(x[inside], 1)):
            rows_here = inside & (np.abs(x - place) < 0.051)
            kpa = labels.pressure_kpa(force[rows_here], settings["label"]["tip_radius_mm"])
            points.setdefault(f"{place - centre_x:+.1f} mm", []).append((ax, counts[rows_here], kpa))
        ax.set(title=f"Element {element}", xlabel="ADC counts of the element")
    axes[0, 0].set_ylabel("Pressure under the tip (kPa)")
    # Offsets are to the element's centre, so the same ones occur in every element.
    order = sorted(points, key=lambda name: float(name.split()[0]))
    handles = []
    for k, name in enumerate(order):
        look = {"s": 9, "color": colours[k % 6], "marker": "os^Dv*"[k % 6]}
        handles.append([ax.scatter(read, kpa, **look) for ax, read, kpa in points[name]][-1])
    title = "press location along x, from the element's centre"
    figure.legend(handles, order, loc="outside lower center", ncols=min(len(order), 6) or 1, title=title)
    figure.suptitle("Figure 5: sensor behaviour for press locations within one element, loading and unloading")
    style.save(figure, path)


def double_touch(path: Path, windows: Windows, maps: Mapping[str, pd.DataFrame], sensor: Mapping, caption: str) -> None:
    """Draw figure 6: pressure at both pressed elements and their counts over time, for a stretch of presses.

    maps: see `windows_of`; caption: what they are of.
    """
    chosen = np.flatnonzero(windows.touched)
    values = {model: np.stack(rows["at_touches"].iloc[chosen]) for model, rows in maps.items()}
    time = windows.t_s[chosen] - windows.t_s[chosen[0]]
    drawn = [model for model in TOUCH_MODELS if model in maps]
    figure, axes = plt.subplots(3, 1, figsize=(10, 8), sharex=True, height_ratios=[2, 2, 1.4])
    elements = []
    for touch, ax in enumerate(axes[:2]):
        place = windows.x_mm[chosen, touch], windows.y_mm[chosen, touch]
        elements.append(kept.elements_at(*place, sensor))
        truth = values[kept.LABEL][:, touch]
        for model in drawn:
            look = model_style(model)
            ax.plot(
                time,
                values[model][:, touch],
                color=look.color,
                linestyle=look.linestyle,
                marker=look.marker,
                markersize=4,
            )
        ax.plot(time, truth, **MEASURED)
        ax.set_ylabel(f"Touch {touch + 1} ({('CNC', 'hand')[touch]})\npressure (kPa)")
        low, high = ax.get_ylim()
        ax.set_ylim(max(low, -0.5 * truth.max()), min(high, 2.5 * truth.max()))
    for element, colour, marker, dashes in zip(elements, (style.BLACK, style.GREY), ".+", ("-", "--"), strict=True):
        axes[2].plot(time, windows.counts[chosen, element], color=colour, marker=marker, linestyle=dashes)
    axes[2].set(xlabel="Time (s)", ylabel="ADC counts")
    axes[2].legend(axes[2].lines, ["element of touch 1", "element of touch 2"], loc="upper left", bbox_to_anchor=(1, 1))
    for ax in axes:
        style.press_borders(ax, time, windows.press[chosen])
    for press in np.unique(windows.press[chosen]):
        rows = np.flatnonzero(windows.press[chosen] == press)
        strongest = rows[np.nansum(windows.force_n[chosen[rows]], axis=1).argmax()]
        words = f"elements {elements[0][strongest]} and {elements[1][strongest]}"
        axes[0].text(time[rows].mean(), 1.02, words, transform=axes[0].get_xaxis_transform(), ha="center")
    handles = [Line2D([], [], **MEASURED)]
    for look in map(model_style, drawn):
        handles.append(Line2D([], [], color=look.color, linestyle=look.linestyle, marker=look.marker))
    names = ["label", *(model_name(model) + _failure(values[model]) for model in drawn)]
    axes[0].legend(handles, names, loc="upper left", bbox_to_anchor=(1, 1))
    title = "Figure 6: two touches, largest value of label and predicted map within each pressed element"
    figure.suptitle(style.literal(f"{title}\n{caption}"))
    style.save(figure, path)


def error_distribution(path: Path, windows: Windows, maps: Mapping[str, pd.DataFrame], caption: str) -> None:
    """Draw figure 7: mean squared error per window, for one touch and for two, on a logarithmic axis.

    maps: see `windows_of`; caption: what they are of.
    """
    names = {kept.SOME: "one touch (test presses)", kept.SEVERAL: "two touches"}
    conditions = [name for name in names if (windows.condition == name).any()]
    added = " and when a second touch is added" if kept.SEVERAL in conditions else ""
    errors = {
        model: {
            names[name]: rows["mean_square"].to_numpy(float)[windows.pressed & (windows.condition == name)]
            for name in conditions
        }
        for model, rows in maps.items()
        if model != kept.LABEL
    }
    xlabel = "Mean squared error of a window in contact (kPa², lower is better)"
    curves.boxes(path, errors, f"Figure 7: error with one touch{added}", caption, xlabel, "windows")


def _failure(values: np.ndarray) -> str:
    return "" if np.isfinite(values).all() else ": failed"
