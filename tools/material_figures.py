"""Draw the fit of the Velostat model: reading over force and over time, measured and modelled."""

from pathlib import Path
from typing import NamedTuple

import matplotlib.pyplot as plt
import numpy as np

from pipeline.reporting.figures.style import BLUE, GREY, VERMILION


class Course(NamedTuple):
    """One recording on its time grid, as measured and as modelled from force and place; arrays of shape (steps,)."""

    name: str
    force_n: np.ndarray
    measured: np.ndarray  # reading, in the recorder's units
    modelled: np.ndarray
    r_squared: float  # of the log reading
    press_s: list[float]  # start of each press


# The look of matplotlib, not of style.py: the figures stay as they were drawn when the model was fitted.
@plt.style.context("default")
def draw_loops(path: Path, courses: list[Course]) -> None:
    """Draw the reading over the force, one panel per recording, to `path` (PNG)."""
    figure, axes = plt.subplots(2, 2, figsize=(10, 8.4), sharex=True, sharey=True, layout="constrained")
    for axis, course in zip(axes.flat, courses, strict=True):
        force = np.maximum(course.force_n, 0.05)
        axis.plot(force, course.measured, color=BLUE, lw=0.8, alpha=0.6, label="measured, 16 presses")
        axis.plot(force, course.modelled, color=VERMILION, lw=0.8, alpha=0.8, label="modelled from force and place")
        axis.set(xscale="log", yscale="log", title=f"{course.name} exp2, R² = {course.r_squared:.3f}")
        axis.grid(color="#dddddd", lw=0.6)
    axes[0, 0].legend(loc="lower left")
    figure.supxlabel("force (N); below 0.05 N drawn at 0.05 N")
    figure.supylabel("reading (recorder's units)")
    figure.savefig(path, dpi=110)
    plt.close(figure)


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
