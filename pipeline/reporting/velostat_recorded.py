"""Write reports/velostat_recorded: how well force is read from the recorded taxel."""

import re
from collections.abc import Mapping, Sequence
from itertools import product
from pathlib import Path

import numpy as np

from pipeline.base import files
from pipeline.base.paths import Workspace
from pipeline.datasets import schemas
from pipeline.reporting import experiment
from pipeline.reporting.figures import common
from pipeline.reporting.report import Report
from pipeline.scoring.results import read_predictions, read_windows

POOLED = "repetition"  # the protocol that fits all recordings together; the others are named like one recording
UNITS = {"rmse": "N", "r2": "1"}
SHOWN_S = 15  # of a recording, around its largest force


def write(workspace: Workspace, target: Path, settings: Mapping) -> None:
    """Write the report of `velostat_recorded`; see `experiment`."""
    accuracy, report = target / "accuracy", Report(workspace, "velostat_recorded", settings)
    groups = sorted(report.conditions(POOLED), key=_by_force)
    pooled = [(POOLED, group) for group in groups]
    alone = [(protocol, protocol) for protocol in settings["protocols"] if protocol != POOLED]
    order = {protocol: pooled if protocol == POOLED else [(protocol, protocol)] for protocol in settings["protocols"]}
    places = [place for of in order.values() for place in of]
    runs = [(*place, *run) for place in places for run in product(report.models, UNITS)]
    files.write_table(accuracy / "table.csv", report.scores(runs, UNITS))
    draw(workspace, accuracy / "figure.png", settings, report, groups)
    ways = {"one fit for all recordings": pooled, "each recording fitted alone": alone}
    report.write(accuracy / "README.md", "velostat_recorded", ways=ways)
    panels = {"all recordings": (POOLED, "all")}
    experiment.write_speed(workspace, report, target, settings, panels, ("rmse", "RMSE (N)"))


def _by_force(name: str) -> tuple:
    """Sort `all` first, and pike1_force_5 before pike1_force_10."""
    parts = ((0, int(part), "") if part.isdigit() else (1, 0, part) for part in name.split("_"))
    return name != "all", *parts


def draw(workspace: Workspace, path: Path, settings: Mapping, report: Report, groups: Sequence[str]) -> None:
    """Draw the test recordings that the best model reads best, in the middle and worst, around their largest forces."""
    windows, seed = read_windows(workspace, "velostat_recorded"), settings["protocols"][POOLED]["seeds"][0]
    errors = {model: report.estimate(POOLED, "all", model, "rmse") for model in report.models}
    usable = [model for model, error in errors.items() if error.runs and not error.failed] or report.models[:1]
    best = min(usable, key=lambda model: errors[model].mean)
    models = [model for model in report.models if model in ("linear", best)]
    predicted = {
        model: read_predictions(workspace, "velostat_recorded", model, POOLED, seed, windows)[:, 0] for model in models
    }
    tested = schemas.names(windows[schemas.split_column(POOLED, seed)]) == "test"
    recording, truth, time = schemas.names(windows["recording"]), schemas.matrix(windows["y"])[:, 0], windows["t_s"]
    names = sorted(set(recording[tested]))
    by_r2 = {name: report.estimate(POOLED, name.split("/")[0], best, "r2").mean for name in names}
    order = sorted(names, key=by_r2.get, reverse=True)
    panels, time = [], time.to_numpy()
    for k in sorted({0, len(order) // 2, len(order) - 1}):
        name, read = order[k], "best" if k == 0 else "worst" if k == len(order) - 1 else "in between"
        rows = np.flatnonzero(tested & (recording == name))
        rows = rows[np.abs(time[rows] - time[rows[truth[rows].argmax()]]) <= SHOWN_S / 2]
        values = {model: force[rows] for model, force in predicted.items()}
        panels.append(
            common.Course("Force (N)", time[rows] - time[rows[0]], truth[rows], values, f"Read {read}: {called(name)}")
        )
    title = "Measured and predicted force on test recordings; gaps: rest that is in no test window"
    common.courses(path, title, panels, "Time (s)", sharey=True)


def called(recording: str) -> str:
    """Return the name of a recording in words: `pike1_force_20/exp2` is `pike 1, 20 N, repetition 2`."""
    found = re.fullmatch(r"pike(\d+)_force_(\d+)/exp(\d+)", recording)
    return "pike {}, {} N, repetition {}".format(*found.groups()) if found else recording
