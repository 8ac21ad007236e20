"""How time and memory grow with the size of the data and of the sensor: reports/growth.csv and its charts."""

import csv
from pathlib import Path
from typing import NamedTuple

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.ticker import NullLocator

from tactile.base import files
from tactile.drawing import style

COLUMNS = ("task", "against", "size", "size_unit", "seconds", "mb", "time_exponent", "memory_exponent")
DATA, ELEMENTS = "data", "elements"


class Sizes(NamedTuple):
    """What is measured: the smallest size of each kind, and by what it is multiplied; tasks of TENFOLD have one more.

    The largest size is measured once, the others `repeats` times.
    """

    factors: tuple[int, ...]
    tenfold: int  # ten times the largest factor
    log_mb: float
    frames: int
    windows: int
    samples: int
    sides: tuple[int, ...]  # elements in a row of the array
    repeats: int

    def factors_of(self, task: str) -> list[int]:
        """Return the factors of a task."""
        return [*self.factors, *([self.tenfold] if task in TENFOLD else [])]

    def repeats_of(self, task: str, factor: float) -> int:
        """Return how often a task is measured at a factor."""
        return 1 if task in TENFOLD and factor == self.tenfold else self.repeats


FULL = Sizes((1, 4, 16), 160, 16, 60_000, 1000, 6000, (5, 10, 16), 3)
TINY = Sizes((1, 2, 4), 6, 1, 10_000, 16, 500, (2, 3), 1)
# What takes less than two minutes at ten times the largest size; an epoch of LoMP would take six.
TENFOLD = ("ingest", "cnn_epoch", "lomp_predictions", "lstm_epochs")
LARGEST_LOG_MB = 1280  # 20 hours: a recording is at most 28 long, and more data are more recordings

LOOKS = {  # what is drawn, how, and what it is called
    "ingest": (style.VERMILION, "o", "-", "ingest"),
    "dataset": (style.BLUE, "s", "--", "window + dataset"),
    "lomp_epoch": (style.GREEN, "^", "-.", "an epoch of LoMP"),
    "cnn_epoch": (style.ORANGE, "P", "-", "an epoch of the CNN"),
    "lomp_predictions": (style.SKY, "v", "-", "LoMP on many windows"),
    "lstm_epochs": (style.PURPLE, "D", ":", "three epochs of the strain LSTM"),
    "lomp_epoch_elements": (style.GREEN, "^", "-.", "an epoch of LoMP, 512 windows"),
    "lomp_latency": (style.ORANGE, "v", "-", "100 predictions of LoMP"),
}


class Point(NamedTuple):
    """One measurement: `mb` is the largest memory, of all processes, less that of the imports."""

    task: str
    against: str  # DATA or ELEMENTS
    size: float
    size_unit: str
    seconds: float
    mb: float


def exponent(sizes: list[float], values: list[float]) -> float:
    """p of values ~ sizes ** p, by least squares of the logarithms; NaN with fewer than two sizes."""
    if len(set(sizes)) < 2:
        return float("nan")
    return float(np.polyfit(np.log(sizes), np.log(values), 1)[0])


def write(folder: Path, points: list[Point]) -> None:
    """growth.csv in `folder`, earlier points of the same tasks replaced, and the charts in benchmarks/ of all of it."""
    path, kept = folder / "growth.csv", []
    if path.exists():
        with open(path, newline="", encoding="ascii") as file:
            rows = [row for row in csv.DictReader(file) if row["task"] not in {point.task for point in points}]
        number = ("size", "seconds", "mb")
        kept = [Point(*(float(row[key]) if key in number else row[key] for key in Point._fields)) for row in rows]
    points = kept + points
    rows = []
    for point in points:
        own = [other for other in points if other.task == point.task]
        sizes = [other.size for other in own]
        slopes = (exponent(sizes, [getattr(other, key) for other in own]) for key in ("seconds", "mb"))
        rows.append((*point, *slopes))
    files.write_csv(path, COLUMNS, rows)
    for against, label in ((DATA, "size of the data, times the smallest"), (ELEMENTS, "elements of the array")):
        chosen = [point for point in points if point.against == against]
        if chosen:
            chart(folder / "benchmarks" / f"{against}.png", chosen, label)


def chart(path: Path, points: list[Point], label: str) -> None:
    """Time and memory against size, a line a task, both axes logarithmic, the exponents in the legends."""
    path.parent.mkdir(parents=True, exist_ok=True)
    figure, axes = plt.subplots(1, 2, figsize=(9.5, 4.6))
    for ax, key, title in zip(axes, ("seconds", "mb"), ("Time (s)", "Memory beyond the imports (MB)"), strict=True):
        for task in dict.fromkeys(point.task for point in points):
            own = sorted((point for point in points if point.task == task), key=lambda point: point.size)
            sizes, values = [point.size for point in own], [getattr(point, key) for point in own]
            places = sizes if own[0].against == ELEMENTS else [size / sizes[0] for size in sizes]
            color, marker, line, name = LOOKS[task]
            power = f"{name}: size$^{{{exponent(sizes, values):.2f}}}$"
            ax.plot(places, values, color=color, marker=marker, linestyle=line, label=power)
        ax.set_xscale("log")
        ax.set_yscale("log")
        low, high = ax.get_ylim()
        ax.set_ylim(low / 1.3, high * 1.3)
        style.plain_log(ax.yaxis)
        ax.set_xticks(sorted({place for line in ax.lines for place in line.get_xdata()}))
        ax.xaxis.set_major_formatter("{x:g}")
        ax.xaxis.set_minor_locator(NullLocator())
        ax.set_xlabel(label)
        ax.set_title(title)
        ax.legend(loc="upper center", bbox_to_anchor=(0.5, -0.16))
    style.save(figure, path)
