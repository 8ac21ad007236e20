"""Draw the figures of the LoMP paper from our data. Every function writes one PNG; predictions are one run's."""

from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import matplotlib.pyplot as plt
import numpy as np
import pyarrow as pa
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from pipeline.datasets import labels, schemas
from pipeline.reporting.figures import style
from pipeline.reporting.figures.style import MEASURED, model_style
from pipeline.reporting.words.labels import model_name
from pipeline.scenes import material

FILM_AREA_M2 = 1e-4  # the paper's 1 cm x 1 cm sample (section II-A)
TOUCH_MODELS = ("lomp", "rnn", "cnn", "convlstm")  # of figure 6
SHOWN_WINDOWS = 60  # of figure 4
SHOWN_PRESSES = 4  # of figure 6
MAP_NAMES = {  # condition -> its name in figure 8
    "single": "one touch",
    "double": "two touches",
    "three": "three touches",
    "slide": "two sliding touches",
    "tape": "rolled tape",
}


class Windows(NamedTuple):
    """What one run is tested on, as the figures need it: n windows, each described at its last frame."""

    rows: np.ndarray  # (n,) of the dataset
    condition: np.ndarray  # (n,)
    recording: np.ndarray  # (n,)
    press: np.ndarray  # (n,)
    t_s: np.ndarray  # (n,)
    force_n: np.ndarray  # (n, touches), NaN where there is no such touch; x_mm, y_mm likewise
    x_mm: np.ndarray
    y_mm: np.ndarray
    counts: np.ndarray  # (n, elements)
    truth: np.ndarray  # (n, map_rows, map_cols) in kPa
    pressed: np.ndarray  # (n,) bool: a touch is pressed above touch.window.contact_threshold_n


def windows_of(table: pa.Table, settings: Mapping, protocol: str, seed: int) -> Windows:
    """Return the test part of a run, on its own array of sensors; settings: the block `touch` of params.yaml."""
    label = settings["label"]
    rows = np.flatnonzero(schemas.names(table[schemas.split_column(protocol, seed)]) == "test")
    table = table.take(rows)
    force, x, y = (schemas.matrix(table[name]) for name in ("force_n", "x_mm", "y_mm"))
    return Windows(
        rows,
        schemas.names(table["condition"]),
        schemas.names(table["recording"]),
        table["press"].to_numpy(),
        table["t_s"].to_numpy(),
        force,
        x,
        y,
        schemas.matrix(table["x"]).reshape(table.num_rows, settings["window"]["frames"], -1)[:, -1],
        schemas.matrix(table["y"]).reshape(-1, label["map_rows"], label["map_cols"]),
        (np.nan_to_num(force) > settings["window"]["contact_threshold_n"]).any(axis=1),
    )


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


def peak_pressure(path: Path, windows: Windows, maps: Mapping[str, np.ndarray]) -> None:
    """Draw figure 4: largest value of true and predicted map, and L1 loss, over windows of test presses, one apart."""
    chosen = np.flatnonzero((windows.condition == "single") & windows.pressed)[:SHOWN_WINDOWS]
    truth = windows.truth[chosen]
    models = [model for model in maps if model != "constant"]
    columns = min(3, len(models))
    rows = -(-len(models) // columns)
    look = {"figsize": (4 * columns, 3 * rows), "height_ratios": [2, 1] * rows}
    figure, axes = plt.subplots(2 * rows, columns, sharex=True, squeeze=False, **look)
    at, borders = np.arange(len(chosen)), np.flatnonzero(np.diff(windows.press[chosen])) + 1
    parted = np.insert(at.astype(float), borders, np.nan)  # no line from one press to the next
    losses = {model: np.abs(maps[model][chosen] - truth).mean(axis=(1, 2)) for model in models}
    finite = np.concatenate(list(losses.values()))
    top_loss = finite[np.isfinite(finite)].max(initial=1e-3)
    values = np.concatenate([maps[model][chosen].ravel() for model in models])
    # An exploding model may leave the axes; the true course must stay readable.
    limit = 1.05 * min(values[np.isfinite(values)].max(initial=truth.max()), 2 * truth.max())
    pairs = list(zip(axes[::2].flat, axes[1::2].flat, strict=True))
    for k, (model, (upper, lower)) in enumerate(zip(models, pairs, strict=False)):
        look = model_style(model)
        for shown, drawn in ((truth, MEASURED), (maps[model][chosen], {"color": look.color, "linewidth": 1.2})):
            upper.plot(parted, np.insert(shown.max(axis=(1, 2)).astype(float), borders, np.nan), **drawn, marker=".")
        lower.bar(at, losses[model], color=look.color, width=1.0)
        upper.set(title=look.label + _failure(maps[model][chosen]), ylim=(0, limit))
        lower.set(ylim=(0, 1.05 * top_loss))
        if k % columns == 0:
            upper.set_ylabel("Peak pressure\n(kPa)")
            lower.set_ylabel("L1 loss\n(kPa)")
        if k + columns >= len(models):
            lower.set_xlabel("Window in contact (test presses, in order)")
            lower.xaxis.set_tick_params(labelbottom=True)
    for pair in pairs[len(models) :]:
        for ax in pair:
            ax.set_axis_off()
    handles = [Line2D([], [], **MEASURED), Line2D([], [], color=style.GREY)]
    names = ["label (largest value of the map)", "prediction (coloured; largest value of the map)"]
    figure.legend(handles, names, loc="outside lower center", ncols=2)
    figure.suptitle("Figure 4: single touch, true and predicted peak pressure, and mean L1 loss of the map")
    style.save(figure, path)


def press_location(path: Path, frames: pa.Table, settings: Mapping) -> None:
    """Draw figure 5: counts of an element over pressure for press locations along x within the element."""
    sensor, pitch = settings["sensor"], settings["sensor"]["pitch_mm"]
    frames = frames.filter(pa.array(schemas.names(frames["condition"]) == "single"))
    force, x, y = (schemas.matrix(frames[name])[:, 0] for name in ("force_n", "x_mm", "y_mm"))
    counts = schemas.matrix(frames["v"])
    pressed = force > settings["window"]["contact_threshold_n"]
    # Elements 12, 17 and 22 of the paper: the middle column from the middle row upwards.
    elements = [row * sensor["cols"] + sensor["cols"] // 2 for row in range(sensor["rows"] // 2, sensor["rows"])]
    figure, axes = style.panels(len(elements), len(elements), 3.6 * len(elements), 4, 0, sharex=True, sharey=True)
    colours = (style.BLUE, style.GREEN, style.ORANGE, style.VERMILION, style.PURPLE, style.SKY)
    points: dict[str, list[tuple[plt.Axes, np.ndarray, np.ndarray]]] = {}
    for ax, element in zip(axes[0], elements, strict=True):
        centre_y, centre_x = ((place + 0.5) * pitch for place in divmod(element, sensor["cols"]))
        inside = pressed & (np.abs(x - centre_x) < pitch / 2) & (np.abs(y - centre_y) < pitch / 2)
        rounded_y = np.round(y, 1)
        rows = np.unique(rounded_y[inside])
        if len(rows):
            inside &= rounded_y == rows[np.abs(rows - centre_y).argmin()]
        places, seen = np.unique(np.round(x[inside], 1), return_counts=True)
        places = places[seen >= 3]  # fewer frames are the CNC on its way
        for place in places:
            rows_here = inside & (np.abs(x - place) < 0.051)
            kpa = labels.pressure_kpa(force[rows_here], settings["label"]["tip_radius_mm"])
            points.setdefault(f"{place - centre_x:+.1f} mm", []).append((ax, counts[rows_here, element], kpa))
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


def _block_peak(maps: np.ndarray, x_mm: np.ndarray, y_mm: np.ndarray, sensor: Mapping) -> np.ndarray:
    """Return the largest value of maps (n, rows, cols) within the element under each (x_mm, y_mm), (n,)."""
    centre_x, centre_y = labels.cell_centres(sensor, {"map_rows": maps.shape[1], "map_cols": maps.shape[2]})
    element_of_cell = elements_at(*np.meshgrid(centre_x, centre_y), sensor)
    inside = element_of_cell == elements_at(x_mm, y_mm, sensor)[:, None, None]
    return np.where(inside, maps, -np.inf).max(axis=(1, 2))


def elements_at(x_mm: np.ndarray, y_mm: np.ndarray, sensor: Mapping) -> np.ndarray:
    """Return the number of the element under each place, row-major from the bottom row."""
    column = np.clip(x_mm // sensor["pitch_mm"], 0, sensor["cols"] - 1).astype(int)
    row = np.clip(y_mm // sensor["pitch_mm"], 0, sensor["rows"] - 1).astype(int)
    return row * sensor["cols"] + column


def double_touch(path: Path, windows: Windows, maps: Mapping[str, np.ndarray], sensor: Mapping) -> None:
    """Draw figure 6: pressure at both pressed elements and their counts over time, for a stretch of presses."""
    double = np.flatnonzero((windows.condition == "double") & ~np.isnan(windows.x_mm[:, :2]).any(axis=1))
    double = double[windows.recording[double] == windows.recording[double[0]]]
    presses = np.unique(windows.press[double])[:SHOWN_PRESSES]
    chosen = double[np.isin(windows.press[double], presses)]
    time = windows.t_s[chosen] - windows.t_s[chosen[0]]
    drawn = [model for model in TOUCH_MODELS if model in maps]
    figure, axes = plt.subplots(3, 1, figsize=(10, 8), sharex=True, height_ratios=[2, 2, 1.4])
    elements = []
    for touch, ax in enumerate(axes[:2]):
        place = windows.x_mm[chosen, touch], windows.y_mm[chosen, touch]
        elements.append(elements_at(*place, sensor))
        truth = _block_peak(windows.truth[chosen], *place, sensor)
        for model in drawn:
            look = model_style(model)
            estimated = _block_peak(maps[model][chosen], *place, sensor)
            ax.plot(time, estimated, color=look.color, linestyle=look.linestyle, marker=look.marker, markersize=4)
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
    for press in presses:
        rows = np.flatnonzero(windows.press[chosen] == press)
        strongest = rows[np.nansum(windows.force_n[chosen[rows]], axis=1).argmax()]
        words = f"elements {elements[0][strongest]} and {elements[1][strongest]}"
        axes[0].text(time[rows].mean(), 1.02, words, transform=axes[0].get_xaxis_transform(), ha="center")
    handles = [Line2D([], [], **MEASURED)]
    for look in map(model_style, drawn):
        handles.append(Line2D([], [], color=look.color, linestyle=look.linestyle, marker=look.marker))
    names = ["label", *(model_name(model) + _failure(maps[model][chosen]) for model in drawn)]
    axes[0].legend(handles, names, loc="upper left", bbox_to_anchor=(1, 1))
    figure.suptitle("Figure 6: double touch, largest value of label and predicted map within each pressed element")
    style.save(figure, path)


def error_distribution(path: Path, windows: Windows, maps: Mapping[str, np.ndarray]) -> None:
    """Draw figure 7: mean squared error per window, for one touch and for two, on a logarithmic axis."""
    conditions = [name for name in ("single", "double") if (windows.condition == name).any()]
    figure, ax = plt.subplots(figsize=(8, 0.62 * len(maps) + 1.6))
    for k, (model, predicted) in enumerate(maps.items()):
        for condition in conditions:
            rows = windows.pressed & (windows.condition == condition)
            mse = np.square(predicted[rows].astype(float) - windows.truth[rows]).mean(axis=(1, 2))
            mse = np.maximum(mse[np.isfinite(mse)], 1e-6)  # an exact prediction has no place on this axis
            if not len(mse):
                ax.text(0.5, k, "failed", transform=ax.get_yaxis_transform(), ha="center", va="center")
                continue
            double, colour = condition == "double", model_style(model).color
            look = {"orientation": "horizontal", "medianprops": {"color": style.BLACK, "linewidth": 1.6}}
            look |= {"widths": 0.3, "whis": (5, 95), "showfliers": False, "patch_artist": True}
            boxes = ax.boxplot(mse, positions=[k + (0.18 if double else -0.18)], **look)
            boxes["boxes"][0].set(facecolor=colour if double else "white", edgecolor=colour, linewidth=1.5)
    ax.set_yticks(range(len(maps)), [model_name(model) for model in maps])
    ax.invert_yaxis()
    ax.set(
        xscale="log",
        xlabel="Mean squared error of a window in contact (kPa², lower is better)",
        title=f"Figure 7: error with one touch{' and when a second touch is added' if 'double' in conditions else ''}\n"
        "(line: median, box: quartiles, whiskers: 5 % to 95 % of windows)",
    )
    looks = {
        "single": (Patch(facecolor="white", edgecolor=style.GREY), "single touch (test presses)"),
        "double": (Patch(facecolor=style.GREY), "double touch"),
    }
    handles, names = zip(*(looks[condition] for condition in conditions), strict=True)
    figure.legend(handles, names, loc="outside lower center", ncols=len(conditions))
    style.save(figure, path)


def shown_maps(windows: Windows) -> dict[str, int]:
    """Choose the windows of figure 8: name -> place among `windows`, of each condition the one pressed hardest.

    Of a slide it is one half way through it.
    """
    total = np.nansum(windows.force_n, axis=1)
    both = np.nan_to_num(windows.force_n[:, :2]).min(axis=1) if windows.force_n.shape[1] > 1 else total
    strengths = {"single": total, "double": both, "three": total, "tape": total}
    chosen = {}
    for condition, strength in strengths.items():
        rows = np.flatnonzero(windows.condition == condition)
        if len(rows):
            chosen[MAP_NAMES[condition]] = int(rows[strength[rows].argmax()])
    slide = np.flatnonzero(windows.condition == "slide")
    if len(slide):
        pressed = slide[total[slide] >= total[slide].max() / 2]
        chosen[MAP_NAMES["slide"]] = int(pressed[len(pressed) // 2])
    return chosen


def _failure(values: np.ndarray) -> str:
    return "" if np.isfinite(values).all() else ": failed"
