"""Draw the predictions of the recorded Velostat taxel."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pyarrow as pa
from matplotlib.lines import Line2D

from pipeline.datasets import schemas
from pipeline.reporting.figures import style
from pipeline.reporting.figures.style import MEASURED, model_style

SHOWN_S = 15  # of a recording, around its largest force
GAP = 3.0  # median intervals between windows; lines are interrupted at longer ones


def force_over_time(
    path: Path, windows: pa.Table, test: np.ndarray, predicted: Mapping[str, np.ndarray], recordings: Sequence[str]
) -> dict[str, dict[str, float]]:
    """Draw measured and predicted force (N) over time, one panel per recording.

    test: (n,) bool; predicted: model -> (n, 1) in N. Returns recording -> model -> RMSE (N) of what is drawn.
    """
    errors: dict[str, dict[str, float]] = {name: {} for name in recordings}
    recording = schemas.names(windows["recording"])
    truth, time = schemas.matrix(windows["y"])[:, 0], windows["t_s"].to_numpy()
    figure, axes = style.panels(len(recordings), 1, 9, 2.2, 1)
    for ax, name in zip(axes[:, 0], recordings, strict=True):
        rows = np.flatnonzero(test & (recording == name))
        middle = time[rows[truth[rows].argmax()]]
        rows = rows[np.abs(time[rows] - middle) <= SHOWN_S / 2]
        at = time[rows] - time[rows[0]]
        steps = np.diff(at)
        breaks = np.flatnonzero(steps > GAP * np.median(steps)) + 1 if len(steps) else []
        at = np.insert(at, breaks, np.nan)
        for model, force in predicted.items():
            errors[name][model] = float(np.sqrt(np.square(force[rows, 0] - truth[rows]).mean()))
            look = model_style(model)
            ax.plot(at, np.insert(force[rows, 0], breaks, np.nan), color=look.color, linestyle=look.linestyle)
        ax.plot(at, np.insert(truth[rows], breaks, np.nan), **(MEASURED | {"linewidth": 1.1}))
        ax.set(ylabel="Force (N)", title=name)
    axes[-1, 0].set_xlabel("Time (s)")
    looks = [model_style(model) for model in predicted]
    handles = [Line2D([], [], color=look.color, linestyle=look.linestyle) for look in looks]
    handles, names = [Line2D([], [], **MEASURED), *handles], ["measured", *(look.label for look in looks)]
    figure.legend(handles, names, loc="outside lower center", ncols=len(handles))
    figure.suptitle("Measured and predicted force on test recordings")
    style.save(figure, path)
    return errors
