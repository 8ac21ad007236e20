"""Write the report of recordings: how well models read them, with the pictures that their kind of input asks for."""

import re
from collections.abc import Mapping
from itertools import product
from pathlib import Path

import numpy as np

from pipeline.reporting import array, glove, strain
from pipeline.reporting import experiment as common_parts
from pipeline.reporting.experiment import Parts
from pipeline.reporting.glove import draw_confusions
from pipeline.reporting.report import Report
from pipeline.results import kept, studies
from pipeline.results.glove_results import NETWORKS, main_protocols, splits
from tactile import experiments
from tactile.base import files
from tactile.base.paths import Workspace
from tactile.drawing import common
from tactile.drawing.labels import plain, split_name, task_name
from tactile.scoring.estimates import estimate

POOLED = "repetition"  # the protocol that fits all recordings together; the others are named like one recording
UNITS = {"rmse": "N", "r2": "1"}
DRAWN = ("lstm_direct", "lstm_highpass", "press_difference")
MEASURES = {  # of a task: heading -> metric
    "z": {"Error (mm)": "error", "R2": "r2_z"},
    "xyz": {"Error (mm)": "error", "R2 x": "r2_x", "R2 y": "r2_y"},
    "xy": {"Error (mm)": "error", "R2 x": "r2_x", "R2 y": "r2_y"}
    | {f"R2 {axis}, per press": f"press_r2_{axis}" for axis in "xy"},
}


def write(workspace: Workspace, target: Path, experiment: str, settings: Mapping, look: bool) -> None:
    """Write the report of recordings into `accuracy` and `speed` of `target`, see pipeline/reporting/experiment.py.

    experiment, settings: its name and its block; the template has the same name.
    """
    accuracy, report = target / "accuracy", Report(workspace, experiment, settings, look)
    of_kind = {"windows": forces, "series": places, "images": confusions}
    of_persons = experiments.facts(experiment).subject
    draw = array.contacts if of_persons else of_kind[experiments.module(experiment).KIND]
    parts = draw(workspace, accuracy, settings, report)
    files.write_table(accuracy / "table.csv", parts.table)
    report.write(accuracy / "README.md", experiment, **parts.words)
    common_parts.write_speed(report, target, settings, parts.panels, parts.measure, parts.note)


def forces(workspace: Workspace, folder: Path, settings: Mapping, report: Report) -> Parts:
    """Draw measured and predicted force, and return the scores of recordings together and of each alone."""
    pooled = [(POOLED, group) for group in sorted(report.conditions(POOLED), key=_by_force)]
    alone = [(protocol, protocol) for protocol in settings["protocols"] if protocol != POOLED]
    runs = [(*place, *run) for place in (*pooled, *alone) for run in product(report.models, UNITS)]
    draw(report, folder / "figure.png")
    common_parts.learning_curves(report, folder / "learning_curves.png", {plain(POOLED): POOLED}, "N²")
    ways = {"one fit for all recordings": pooled, "each recording fitted alone": alone}
    speed = {"all recordings": (POOLED, "all")}
    return Parts(report.scores(runs, UNITS), speed, ("rmse", "RMSE (N)"), {"ways": ways})


def _by_force(name: str) -> tuple:
    """Sort `all` first, and pike1_force_5 before pike1_force_10."""
    parts = ((0, int(part), "") if part.isdigit() else (1, 0, part) for part in name.split("_"))
    return name != "all", *parts


def draw(report: Report, path: Path) -> None:
    """Draw the test recordings that the best model reads best, in the middle and worst, around their largest forces."""
    rows = report.drawn(POOLED)
    rows = rows[rows["window"] != kept.WHOLE].sort_values("window", kind="stable")
    label = rows[rows["model"] == kept.LABEL]
    if label.empty:
        return
    errors = {model: report.estimate(POOLED, "all", model, "rmse") for model in report.models}
    usable = [model for model, error in errors.items() if error.runs and not error.failed] or report.models[:1]
    best = min(usable, key=lambda model: errors[model].mean)
    shown = [model for model in report.models if model in ("linear", best) and (rows["model"] == model).any()]
    predicted = {model: rows["peak"][rows["model"] == model].to_numpy() for model in shown}
    recording, truth, time = (label[name].to_numpy() for name in ("recording", "peak", "t_s"))
    by_r2 = {name: report.estimate(POOLED, name.split("/")[0], best, "r2").mean for name in sorted(set(recording))}
    order, panels = sorted(by_r2, key=by_r2.get, reverse=True), []
    for k in sorted({0, len(order) // 2, len(order) - 1}):
        name, read = order[k], "best" if k == 0 else "worst" if k == len(order) - 1 else "in between"
        at = np.flatnonzero(recording == name)
        values = {model: force[at] for model, force in predicted.items()}
        panels.append(
            common.Course("Force (N)", time[at] - time[at[0]], truth[at], values, f"Read {read}: {called(name)}")
        )
    title = "Measured and predicted force on test recordings; gaps: rest that is in no test window"
    common.courses(path, f"{title}\n{report.caption(POOLED)}", panels, "Time (s)", sharey=True)


def called(recording: str) -> str:
    """Return the name of a recording in words: `pike1_force_20/exp2` is `pike 1, 20 N, repetition 2`."""
    found = re.fullmatch(r"pike(\d+)_force_(\d+)/exp(\d+)", recording)
    return "pike {}, {} N, repetition {}".format(*found.groups()) if found else recording


def places(workspace: Workspace, folder: Path, settings: Mapping, report: Report) -> Parts:
    """Draw predicted over true places of test presses, of the protocols that ask for x and y."""
    tested = {protocol: day for protocol, day in report.scored()}
    asked = {
        protocol: day for protocol, day in tested.items() if protocol in experiments.facts(report.experiment).drawn
    }
    rows = {split_name(protocol): presses(report, protocol) for protocol in asked}
    if rows := {name: clouds for name, clouds in rows.items() if clouds}:
        title = f"Place of test presses (up to {kept.MOST_PRESSES}), mean over the second half of a press's samples"
        caption = report.caption(next(iter(asked))).rpartition(", ")[0]
        common.agreement(folder / "figure.png", f"{title}\n{caption}", rows, "mm")
    groups = {split_name(protocol): protocol for protocol in list(asked)[:3]}
    common_parts.learning_curves(report, folder / "learning_curves.png", groups, "mm²")
    protocols = [(name, *name.rsplit("_", 1)) for name in settings["protocols"]]
    words = {"protocols": protocols, "tested": tested, "measures": MEASURES}
    speed = {split_name(protocol): (protocol, day) for protocol, day in asked.items()}
    measure = ("press_error", "Error per press (mm)")
    return Parts(strain.score_table(report), speed, measure, words, strain.TRANSFER_COSTS)


def presses(report: Report, protocol: str) -> list[common.Cloud]:
    """Return true and predicted places of the presses that the first run of a protocol tests on, by model and axis."""
    rows = report.drawn(protocol)
    rows = rows[rows["window"] != kept.WHOLE].sort_values("window", kind="stable")
    found = {model: rows["place_mm"][rows["model"] == model] for model in (kept.LABEL, *DRAWN)}
    found = {model: np.stack(values) for model, values in found.items() if len(values)}
    truth = found.pop(kept.LABEL, None)
    return [
        common.Cloud(strain.AXES[k], truth[:, k], guess[:, k], model)
        for model, guess in found.items()
        for k in range(2)
    ]


def confusions(workspace: Workspace, folder: Path, settings: Mapping, report: Report) -> Parts:
    """Draw what the best network of each dataset takes each object for, and the learning curves."""
    name, (protocols, best) = report.experiment, (main_protocols(settings), {})
    probe = studies.read(workspace, name, "joint_angles", ["input", "split", "seed", "metric", "value"])
    for dataset, protocol in protocols.items():
        values = {model: report.estimate(protocol, dataset, model, "accuracy") for model in report.models}
        good = [model for model in (*NETWORKS, "sp_resnet_nogcam") if model in values and not values[model].failed]
        if good := [model for model in good if values[model].runs]:
            best[dataset] = max(good, key=lambda model, values=values: values[model].mean)
    draw_confusions(report, folder, "confusion", best)
    groups = {task_name(dataset): protocol for dataset, protocol in protocols.items()}
    common_parts.learning_curves(report, folder / "learning_curves.png", groups, "nats")
    words = {
        "splits": splits(settings),
        "objects": report.kept["object"].nunique(),
        "probe": {
            name: {split: estimate(100 * own["value"]) for split, own in rows.groupby("split", sort=False)}
            for name, rows in probe.groupby("input", sort=False)
        },
    }
    speed = {task_name(dataset): (protocol, dataset) for dataset, protocol in protocols.items()}
    return Parts(glove.score_table(report), speed, glove.WRONG, words)
