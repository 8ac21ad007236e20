"""Draw sheets: loading curve, rest over time and a press of usual size, one row for each sensor."""

from collections.abc import Sequence
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from tactile.base.errors import InputError
from tactile.drawing import style
from tactile.sheet.cycles import FEWEST_ON_THE_WAY, LEVELS
from tactile.sheet.quantities import PERCENT, Known, Sheet, full_scale_output, mean

PANELS = ("Loading curve", "Rest before a press", "A short press of usual size")
BESIDE_S = 1.0  # drawn before and after a press
MANY = 200  # presses of a recording, from which on each is a dot, and their median a line
MEDIANS = 40  # along such a recording
DRAWN = (1, 99)  # percentiles of the rests that a panel reaches
MARGIN = 0.2  # beyond them, as a share of what lies between


def draw(path: Path, sheets: Sequence[Sheet]) -> None:
    """Draw the sheets of sensors with loading cycles to `path` (PNG); InputError where none has any."""
    shown, columns = [sheet for sheet in sheets if not sheet.given.untold], len(PANELS)
    if not shown:
        raise InputError(f"{path}: nothing to draw; {sheets[0].given.untold}")
    path.parent.mkdir(parents=True, exist_ok=True)
    figure, axes = style.panels(columns * len(shown), columns, 3.6 * columns, 2.5, 0.2)
    for row, sheet in zip(axes, shown, strict=True):
        for ax, title, panel in zip(row, PANELS, (loading, rests, typical_press), strict=True):
            ax.set_title(f"{style.literal(sheet.given.sensor.name)}: {title.lower()}")
            panel(ax, sheet.given)
    style.save(figure, path)


def untold(ax: plt.Axes, reason: str) -> None:
    """Say in a panel why the logs cannot tell what it would show."""
    ax.set_axis_off()
    ax.text(0.5, 0.5, reason, ha="center", va="center", color=style.GREY, transform=ax.transAxes)


def loading(ax: plt.Axes, given: Known) -> None:
    """Draw the mean loading and unloading curve over all elements, in % of the response, over % of the stimulus."""
    ways = {"loading": (given.cycles.up, style.BLUE, "-"), "unloading": (given.cycles.down, style.VERMILION, "--")}
    response = np.broadcast_to(given.cycles.response[:, None], given.cycles.up.shape)
    drawn = {}
    for name, (way, colour, dashes) in ways.items():
        known = np.where(np.isfinite(way), response, np.nan)
        share = PERCENT * mean(np.where(np.isfinite(known), way, np.nan), known)
        if np.isfinite(share).any():
            middle = np.nanmedian(share[:, np.isfinite(share).any(axis=0)], axis=1)
            drawn[name] = ax.plot([0, *PERCENT * LEVELS, 100], [0, *middle, 100], dashes, color=colour, label=name)
    if not drawn:
        fewest = f"a press has fewer than {FEWEST_ON_THE_WAY} readings\nbetween 10 and 90 % of its stimulus"
        untold(ax, f"No loading curve, because\n{fewest}")
        return
    ax.plot([0, 100], [0, 100], ":", color=style.GREY, linewidth=1)
    ax.set(xlabel="Stimulus (% of a press)", ylabel="Reading (% of its change)")
    ax.legend(loc="upper left")


def rests(ax: plt.Axes, given: Known) -> None:
    """Draw the median over elements of the rest before each press, less a recording's median, in % FS over minutes.

    The axis leaves out the farthest of many rests and says how many these are.
    """
    cycles, output, every = given.cycles, full_scale_output(given), []
    for log in np.unique(cycles.log):
        rows = cycles.log == log
        change = PERCENT * (cycles.rest[rows] - np.median(cycles.rest[rows], axis=0)) * given.sign / output
        change = np.nanmedian(change[:, np.isfinite(output)], axis=1)
        minutes = (cycles.time_s[rows] - given.sensor.logs[log].time_s[0]) / 60
        every.append(change)
        if len(change) < MANY:
            ax.plot(minutes, change, color=style.BLUE, linewidth=0.6, alpha=0.7)
            continue
        ax.plot(minutes, change, ".", color=style.SKY, markersize=1.5, alpha=0.5)
        parts = zip(np.array_split(minutes, MEDIANS), np.array_split(change, MEDIANS), strict=True)
        ax.plot(*np.transpose([(np.median(at), np.median(part)) for at, part in parts]), color=style.BLUE)
    every = np.concatenate(every)
    low, high = np.percentile(every, DRAWN)
    beyond = (every < low - MARGIN * (high - low)) | (every > high + MARGIN * (high - low))
    if len(every) >= MANY and beyond.any():
        ax.set_ylim(low - MARGIN * (high - low), high + MARGIN * (high - low))
        ax.set_title(f"{ax.get_title()}\n({beyond.sum()} of {len(every)} up to {np.abs(every).max():.0f} %, not drawn)")
    ax.set(xlabel="Time since the start of a recording (min)", ylabel="Change of the rest (% FS)")


def typical_press(ax: plt.Axes, given: Known) -> None:
    """Draw a press of usual size: stimulus and the element that answers most, in % of the press, over s.

    Of the half of the presses whose responses are nearest to their median it is the shortest: a slow one goes up and
    down on its way.
    """
    cycles = given.cycles
    size = np.nanmax(np.nan_to_num(cycles.response), axis=1)
    usual = np.argsort(np.abs(size - np.median(size)))[: (len(size) + 1) // 2]
    chosen = int(usual[np.argmin((cycles.end_s - cycles.time_s)[usual])])
    log, element = given.sensor.logs[cycles.log[chosen]], int(np.nanargmax(np.nan_to_num(cycles.response[chosen])))
    first_s, last_s = cycles.time_s[chosen] - BESIDE_S, cycles.end_s[chosen] + BESIDE_S
    shown = (log.time_s > first_s) & (log.time_s < last_s)
    time = log.time_s[shown] - cycles.time_s[chosen]
    stimulus = log.stimulus[shown] / cycles.stimulus[chosen]
    reading = (log.reading[shown, element] - cycles.rest[chosen, element]) / cycles.response[chosen, element]
    reading = reading * np.sign(np.median(reading[stimulus > 0.9]))  # the response has no sign
    ax.plot(time, PERCENT * stimulus, "--", color=style.GREY, label="stimulus")
    ax.plot(time, PERCENT * reading, color=style.BLUE, label="reading")
    ax.set(xlabel="Time (s)", ylabel="% of the press")
    ax.legend(loc="lower center")
