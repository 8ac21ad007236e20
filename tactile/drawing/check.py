"""Draw a folder of logs: signals of the first recordings over time, rejected lines, and places that were pressed."""

import re
from collections.abc import Mapping, Sequence
from itertools import cycle
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import pyarrow as pa
from matplotlib.collections import PatchCollection
from matplotlib.patches import Rectangle

from tactile import experiments
from tactile.base.facts import Panel
from tactile.datasets import images, schemas
from tactile.drawing import style

LINES = (
    (style.BLUE, "-"),
    (style.VERMILION, "--"),
    (style.GREEN, "-."),
    (style.BLACK, ":"),
    (style.PURPLE, "-"),
    (style.SKY, "--"),
    (style.ORANGE, "-."),
    (style.GREY, "-"),
)
ALL_DRAWN, STRONGEST = 64, 20  # columns of a log


SILENT = 20  # median intervals; no line is drawn over a longer silence


def draw(path: Path, experiment: str, recordings: Sequence, settings: Mapping) -> None:
    """Draw recordings (tactile/commands/check.py: `Checked`) side by side, one column each, to `path` (PNG)."""
    module = experiments.module(experiment)
    panels = module.FACTS.panels or areas_of(settings)
    mapped = module.KIND == "windows" and any(recording.frames is not None for recording in recordings)
    rows, columns = len(panels) + mapped, len(recordings)
    figure, axes = style.panels(rows * columns, columns, 1.5 + 4.5 * columns, 2.3, int(mapped))
    for column, recording in enumerate(recordings):
        note = "" if recording.report else "\n(not aligned: each log from its own start)"
        axes[0, column].set_title(style.literal(recording.name) + note, pad=20, fontweight="bold")
        for ax, panel in zip(axes[:, column], panels, strict=False):
            ax.set_ylabel(panel.title + signals(ax, recording, panel))
            ax.set_xlabel("Time (s)")
        if mapped and recording.frames is not None:
            places(axes[-1, column], recording.frames, settings)
        elif mapped:
            axes[-1, column].set_axis_off()
    style.save(figure, path)


def areas_of(settings: Mapping) -> list[Panel]:
    """Return a panel per area of a sensor of images: every cell where there are few, else their mean."""
    panels = []
    for name, area in images.areas(settings).items():
        title, columns = f"Cells of\n{name}", rf"{name[0]}\d+"
        if area.cells <= len(LINES):
            panels.append(Panel(title, "scanner", columns))
        else:
            panels.append(Panel(f"{title}, mean", "scanner", columns, lambda cells: cells.mean(axis=1)))
    return panels


def signals(ax: plt.Axes, recording: Any, panel: Panel) -> str:
    """Draw the matching columns of the matching logs of a recording, and ticks at the bottom for rejected lines.

    Of more than ALL_DRAWN columns of a log the STRONGEST are drawn, those that change most. Returns what the title of
    the axis says of that.
    """
    looks, ticks, left_out = cycle(LINES), [], ""
    logs = {name: log for name, log in recording.logs.items() if re.fullmatch(panel.files + r"\.log", name)}
    for name, log in logs.items():
        time = reference_time(log, recording.report.get(name))
        silent = np.flatnonzero(np.abs(np.diff(time)) > SILENT * np.median(np.diff(time))) + 1
        columns = [column for column in log.rows.column_names if re.fullmatch(panel.columns, column)]
        values = {column: log.rows[column].to_numpy() for column in columns}
        if panel.combined:
            values = {"all": panel.combined(np.column_stack(list(values.values())))}
        if len(values) > ALL_DRAWN:
            left_out = f"\n(strongest {STRONGEST} of {len(values)})"
            strongest = sorted(values, key=lambda column: -np.ptp(values[column]))[:STRONGEST]
            values = {column: value for column, value in values.items() if column in strongest}
        for (column, value), (colour, dashes) in zip(values.items(), looks, strict=False):
            broken = np.insert(time, silent, np.nan), np.insert(value.astype(float), silent, np.nan)
            label = [name.removesuffix(".log")] * (len(logs) > 1 or len(values) == 1)
            label += [column.removesuffix("_mm")] * (len(values) > 1)
            ax.plot(*broken, color=colour, linestyle=dashes, linewidth=0.9, label=" ".join(label))
        ticks += np.interp(log.rejects["line"].to_numpy(), log.rows["line"].to_numpy(), time).tolist()
    if ticks:
        look = {"color": style.VERMILION, "markersize": 9, "markeredgewidth": 1.5, "label": "rejected"}
        ax.plot(ticks, np.full(len(ticks), 0.03), "|", transform=ax.get_xaxis_transform(), **look)
    if ax.lines:
        handles, names = ax.get_legend_handles_labels()
        first = [*range(min(len(LINES) - 2, len(handles)))]  # further lines look like one of these
        first += [len(handles) - 1] * (len(handles) - 1 not in first)
        above = {"loc": "lower left", "bbox_to_anchor": (0, 1.0), "ncols": len(LINES), "fontsize": 7}
        narrow = {"handlelength": 1.8, "columnspacing": 1.0, "borderaxespad": 0.1}
        ax.legend([handles[k] for k in first], [names[k] for k in first], **above, **narrow)
    return left_out


def reference_time(log: Any, report: Mapping | None) -> np.ndarray:
    """Return time in s, (n,), on the recording's reference clock where it is known, else since the log's first line."""
    time, segment = log.rows["time_s"].to_numpy().copy(), log.rows["segment"].to_numpy()
    clocks = report.get("clocks", [report.get("clock")]) if report else []
    if not any(clocks):
        return time if report else time - time[0]
    for number, clock in enumerate(clocks):
        time[segment == number] += clock["offset_ms"] / 1e3 if clock else np.nan
    return time


def places(ax: plt.Axes, frames: pa.Table, settings: Mapping) -> None:
    """Draw the array's elements from above, and the places of the tips while they pressed."""
    sensor = settings["sensor"]
    rest = (sensor["pitch_mm"] - sensor["element_mm"]) / 2
    count, last = sensor["rows"] * sensor["cols"], (0, sensor["cols"] - 1)
    outlines = []
    for k in range(count):
        row, col = divmod(k, sensor["cols"])
        corner = col * sensor["pitch_mm"] + rest, row * sensor["pitch_mm"] + rest
        outlines.append(Rectangle(corner, sensor["element_mm"], sensor["element_mm"], fill=False, color="#BBBBBB"))
        if count > ALL_DRAWN and not (row in (0, sensor["rows"] - 1) and col in last):
            continue  # of many the corners are named
        ax.annotate(f"v{k}", (corner[0] + 0.5, corner[1] + 0.5), fontsize=6, color=style.GREY)
    if count > ALL_DRAWN:  # 4096 patches take 10 s
        ax.add_collection(PatchCollection(outlines, match_original=True))
        ax.autoscale_view()
    else:
        for outline in outlines:
            ax.add_patch(outline)
    force, x, y = (schemas.matrix(frames[name]) for name in ("force_n", "x_mm", "y_mm"))
    pressed = force > settings["window"]["contact_threshold_n"]
    for touch, marker in zip(range(force.shape[1]), "ox+^s", strict=False):
        rows = pressed[:, touch]
        if rows.any():
            colour = LINES[touch][0]
            ax.plot(x[rows, touch], y[rows, touch], marker, color=colour, markersize=3, label=f"touch {touch + 1}")
    ax.set(xlabel="x (mm)", ylabel="y (mm)", aspect="equal")
    ax.grid(False)
    ax.legend(loc="lower left", bbox_to_anchor=(0, 1.0), ncols=4, fontsize=7)
