"""Draw the fit of the Velostat model: reading over force and over time, measured and modelled."""

from pathlib import Path
from typing import NamedTuple

import matplotlib.pyplot as plt
import numpy as np

from tactile.drawing.style import BLUE, GREY, VERMILION, save


class Course(NamedTuple):
    """One recording on its time grid, as measured and as modelled from force and place; arrays of shape (steps,)."""

    name: str
    force_n: np.ndarray
    measured: np.ndarray  # reading, in the recorder's units
    modelled: np.ndarray
    r_squared: float  # of the log reading
    press_s: list[float]  # start of each press


LEAST_N = 0.05  # what is below is drawn there
BEFORE_S = 0.5  # a press is found when its force has risen
SHOWN = (0, 5, 10)  # presses of a recording whose loops are drawn; all of them hide each other
LOOKS = ((BLUE, "-", "measured"), (VERMILION, "--", "modelled from force and place"))


def draw_loops(path: Path, courses: list[Course], step_s: float) -> None:
    """Draw the reading over the force in some presses, one panel per recording, to `path` (PNG); step_s: of the grid.

    The log of the reading is what is modelled, and its R2, over all presses, what the titles say.
    """
    figure, axes = plt.subplots(2, 2, figsize=(8, 6.6), sharex=True, sharey=True)
    for axis, course in zip(axes.flat, courses, strict=True):
        steps = [round((start - BEFORE_S) / step_s) for start in course.press_s]
        for press in SHOWN:
            rows = slice(steps[press], steps[press + 1])
            for (colour, dashes, label), reading in zip(LOOKS, (course.measured, course.modelled), strict=True):
                force = np.maximum(course.force_n[rows], LEAST_N)
                axis.plot(force, reading[rows], color=colour, linestyle=dashes, linewidth=1.1, label=label)
        axis.set(xscale="log", yscale="log", title=f"{course.name}: R2 {course.r_squared:.3f}")
    figure.legend(*(part[:2] for part in axes[0, 0].get_legend_handles_labels()), loc="outside lower center", ncols=2)
    for axis in axes[-1]:
        axis.set_xlabel(f"Force (N), from {LEAST_N:g} N on")
    for axis in axes[:, 0]:
        axis.set_ylabel("Reading (recorder's units)")
    figure.suptitle("Three presses of each recording of repetition 2, which the fit has not seen")
    save(figure, path)


# The look of matplotlib, not of style.py: the figure stays as it was drawn when the model was fitted.
@plt.style.context("default")
def draw_courses(path: Path, courses: list[Course], step_s: float) -> None:
    """Draw the reading over time, each whole recording and two of its presses, to `path` (PNG); step_s: of the grid."""
    figure, axes = plt.subplots(
        len(courses), 2, figsize=(13, 12), sharey=True, layout="constrained", width_ratios=(2.2, 1)
    )
    for row, course in zip(axes, courses, strict=True):
        seconds = np.arange(len(course.force_n)) * step_s
        for axis in row:
            axis.plot(seconds, course.measured, color=BLUE, lw=1.3, label="measured")
            axis.plot(seconds, course.modelled, color=VERMILION, lw=1.0, label="modelled from force and place")
            axis.set_yscale("log")
            axis.grid(color="#dddddd", lw=0.6)
        row[0].set_title(f"{course.name} exp2, R² = {course.r_squared:.3f}")
        row[0].set_ylabel("reading (recorder's units)")
        row[0].set_xlim(0, seconds[-1])
        row[1].set_xlim(course.press_s[8] - 0.5, course.press_s[10] - 0.5)
        row[1].set_title("presses 9 and 10, with force (grey)")
        force_axis = row[1].twinx()
        force_axis.plot(seconds, course.force_n, color=GREY, lw=1.0, ls="--")
        force_axis.set_ylabel("force (N)")
        force_axis.set_ylim(0, 2.2 * course.force_n.max())
    axes[0, 0].legend(loc="lower right")
    for axis in axes[-1]:
        axis.set_xlabel("time (s)")
    figure.savefig(path, dpi=100)
    plt.close(figure)
