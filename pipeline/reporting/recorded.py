"""Write the report of recordings: how well models read them, with the pictures that their kind of input asks for."""

import re
from collections.abc import Mapping
from itertools import product
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd

from pipeline import experiments
from pipeline.base import files
from pipeline.base.paths import Workspace
from pipeline.datasets import images, schemas
from pipeline.reporting import experiment as common_parts
from pipeline.reporting import glove, strain
from pipeline.reporting.figures import common
from pipeline.reporting.glove import draw_confusions
from pipeline.reporting.report import Report
from pipeline.reporting.words.labels import plain
from pipeline.scoring.glove_results import NETWORKS, main_protocols, splits
from pipeline.scoring.results import estimate, read_csv, read_predictions, read_windows

POOLED = "repetition"  # the protocol that fits all recordings together; the others are named like one recording
UNITS = {"rmse": "N", "r2": "1"}
SHOWN_S = 15  # of a recording, around its largest force
DRAWN = ("lstm_direct", "lstm_highpass", "press_difference")
MOST_PRESSES = 300  # of a protocol, evenly over its test part
MEASURES = {  # of a task: heading -> metric
    "z": {"Error (mm)": "error", "R2": "r2_z"},
    "xyz": {"Error (mm)": "error", "R2 x": "r2_x", "R2 y": "r2_y"},
    "xy": {"Error (mm)": "error", "R2 x": "r2_x", "R2 y": "r2_y"}
    | {f"R2 {axis}, per press": f"press_r2_{axis}" for axis in "xy"},
}
DATASETS = {"pressure": "pressure", "strain": "joint angles", "combined": "combined"}


class Parts(NamedTuple):
    """What a report has, beside its pictures."""

    table: pd.DataFrame  # of table.csv
    panels: Mapping[str, tuple[str, str]]  # of the speed: heading -> protocol and condition
    measure: tuple[str, str]  # of the speed: metric and its name
    words: Mapping  # further values of the template
    note: str = ""  # more text of the speed


def write(workspace: Workspace, target: Path, experiment: str, settings: Mapping) -> None:
    """Write the report of recordings into `accuracy` and `speed` of `target`, see pipeline/reporting/experiment.py.

    experiment, settings: its name and its block; the template has the same name.
    """
    accuracy, report = target / "accuracy", Report(workspace, experiment, settings)
    draw = {"windows": forces, "series": places, "images": confusions}[experiments.module(experiment).KIND]
    parts = draw(workspace, accuracy, settings, report)
    files.write_table(accuracy / "table.csv", parts.table)
    report.write(accuracy / "README.md", experiment, **parts.words)
    common_parts.write_speed(workspace, report, target, settings, parts.panels, parts.measure, parts.note)


def forces(workspace: Workspace, folder: Path, settings: Mapping, report: Report) -> Parts:
    """Draw measured and predicted force, and return the scores of recordings together and of each alone."""
    pooled = [(POOLED, group) for group in sorted(report.conditions(POOLED), key=_by_force)]
    alone = [(protocol, protocol) for protocol in settings["protocols"] if protocol != POOLED]
    runs = [(*place, *run) for place in (*pooled, *alone) for run in product(report.models, UNITS)]
    draw(workspace, folder / "figure.png", settings, report)
    ways = {"one fit for all recordings": pooled, "each recording fitted alone": alone}
    speed = {"all recordings": (POOLED, "all")}
    return Parts(report.scores(runs, UNITS), speed, ("rmse", "RMSE (N)"), {"ways": ways})


def _by_force(name: str) -> tuple:
    """Sort `all` first, and pike1_force_5 before pike1_force_10."""
    parts = ((0, int(part), "") if part.isdigit() else (1, 0, part) for part in name.split("_"))
    return name != "all", *parts


def draw(workspace: Workspace, path: Path, settings: Mapping, report: Report) -> None:
    """Draw the test recordings that the best model reads best, in the middle and worst, around their largest forces."""
    windows, seed = read_windows(workspace, report.experiment), settings["protocols"][POOLED]["seeds"][0]
    errors = {model: report.estimate(POOLED, "all", model, "rmse") for model in report.models}
    usable = [model for model, error in errors.items() if error.runs and not error.failed] or report.models[:1]
    best = min(usable, key=lambda model: errors[model].mean)
    shown = [model for model in report.models if model in ("linear", best)]
    predicted = {m: read_predictions(workspace, report.experiment, m, POOLED, seed, windows)[:, 0] for m in shown}
    tested = schemas.names(windows[schemas.split_column(POOLED, seed)]) == "test"
    recording, truth = schemas.names(windows["recording"]), schemas.matrix(windows["y"])[:, 0]
    time, panels = windows["t_s"].to_numpy(), []
    names = sorted(set(recording[tested]))
    by_r2 = {name: report.estimate(POOLED, name.split("/")[0], best, "r2").mean for name in names}
    order = sorted(names, key=by_r2.get, reverse=True)
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


def places(workspace: Workspace, folder: Path, settings: Mapping, report: Report) -> Parts:
    """Draw predicted over true places of test presses, of the protocols that ask for x and y."""
    tested = {protocol: day for protocol, day in report.scored()}
    asked = {protocol: day for protocol, day in tested.items() if protocol.endswith("_xy")}
    rows = {plain(protocol): presses(workspace, settings, report.experiment, protocol) for protocol in asked}
    title = f"Place of test presses (up to {MOST_PRESSES}), mean over the second half of a press's samples"
    if any(rows.values()):
        common.agreement(folder / "figure.png", title, rows, "mm")
    protocols = [(name, *name.rsplit("_", 1)) for name in settings["protocols"]]
    words = {"protocols": protocols, "tested": tested, "measures": MEASURES}
    speed = {plain(protocol): (protocol, day) for protocol, day in asked.items()}
    measure = ("press_error", "Error per press (mm)")
    return Parts(strain.score_table(report), speed, measure, words, strain.TRANSFER_COSTS)


def presses(workspace: Workspace, settings: Mapping, experiment: str, protocol: str) -> list[common.Cloud]:
    """Return true and predicted places of the presses that the first run of a protocol tests on, by model and axis."""
    seed, dataset = settings["protocols"][protocol]["seeds"][0], read_windows(workspace, experiment)
    tested = schemas.names(dataset[schemas.split_column(protocol, seed)]) == "test"
    rows = np.flatnonzero(tested & (dataset["press"].to_numpy() >= 0))
    truth = schemas.matrix(dataset["y"])[rows]
    _, first, size = np.unique(dataset["press"].to_numpy()[rows], return_index=True, return_counts=True)
    chosen = np.unique(np.linspace(0, len(first) - 1, min(MOST_PRESSES, len(first))).astype(int))
    halves = [slice(first[k] + size[k] // 2, first[k] + size[k]) for k in chosen]
    clouds = []
    for model in (model for model in DRAWN if model in settings["models"]):
        guess = read_predictions(workspace, experiment, model, protocol, seed, dataset)[rows]
        true, predicted = (np.array([values[half].mean(axis=0) for half in halves]) for values in (truth, guess))
        clouds += [common.Cloud(strain.AXES[k], true[:, k], predicted[:, k], model) for k in range(2)]
    return clouds


def confusions(workspace: Workspace, folder: Path, settings: Mapping, report: Report) -> Parts:
    """Draw what the best network of each dataset takes each object for, and the learning curves."""
    name, (protocols, best) = report.experiment, (main_protocols(settings), {})
    made_by = f"python -m pipeline.studies.joint_angles {name}"
    probe = read_csv(workspace.probe(name), ["input", "seed", "metric", "value"], made_by)
    for dataset, protocol in protocols.items():
        values = {model: report.estimate(protocol, dataset, model, "accuracy") for model in report.models}
        good = [model for model in (*NETWORKS, "sp_resnet_nogcam") if model in values and not values[model].failed]
        if good := [model for model in good if values[model].runs]:
            best[dataset] = max(good, key=lambda model, values=values: values[model].mean)
    draw_confusions(workspace, folder, "confusion", name, settings, best, DATASETS)
    groups = {DATASETS[dataset]: protocol for dataset, protocol in protocols.items()}
    common_parts.learning_curves(workspace, folder / "learning_curves.png", name, settings, groups, "nats")
    words = {
        "splits": splits(settings),
        "objects": len(images.classes(read_windows(workspace, name))),
        "probe": {name: estimate(100 * rows["value"]) for name, rows in probe.groupby("input", sort=False)},
        "names": {dataset: DATASETS[dataset] for dataset in images.MODALITIES},
    }
    speed = {DATASETS[dataset]: (protocol, dataset) for dataset, protocol in protocols.items()}
    return Parts(glove.score_table(report), speed, glove.WRONG, words)
