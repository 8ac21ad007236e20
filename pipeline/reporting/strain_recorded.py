"""Write reports/strain_recorded: real sensors with real drift, within a day and across days."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from pipeline.base import files
from pipeline.base.paths import Workspace
from pipeline.datasets import schemas
from pipeline.reporting import experiment
from pipeline.reporting.figures import common
from pipeline.reporting.report import Report
from pipeline.reporting.strain import AXES, TRANSFER_COSTS, score_table
from pipeline.reporting.words.labels import plain
from pipeline.scoring.results import read_predictions, read_windows

DRAWN = ("lstm_direct", "lstm_highpass", "press_difference")
MOST_PRESSES = 300  # of a protocol, evenly over its test part
MEASURES = {  # of a task: heading -> metric
    "z": {"Error (mm)": "error", "R2": "r2_z"},
    "xyz": {"Error (mm)": "error", "R2 x": "r2_x", "R2 y": "r2_y"},
    "xy": {"Error (mm)": "error", "R2 x": "r2_x", "R2 y": "r2_y"}
    | {f"R2 {axis}, per press": f"press_r2_{axis}" for axis in "xy"},
}


def write(workspace: Workspace, target: Path, settings: Mapping) -> None:
    """Write the report of `strain_recorded`; see `experiment`."""
    accuracy, report = target / "accuracy", Report(workspace, "strain_recorded", settings)
    tested = {protocol: day for protocol, day in report.scored()}
    files.write_table(accuracy / "table.csv", score_table(report))
    places = {protocol: day for protocol, day in tested.items() if protocol.endswith("_xy")}
    rows = {plain(protocol): presses(workspace, settings, protocol) for protocol in places}
    title = f"Place of test presses (up to {MOST_PRESSES}), mean over the second half of a press's samples"
    if any(rows.values()):
        common.agreement(accuracy / "figure.png", title, rows, "mm")
    protocols = [(name, *name.rsplit("_", 1)) for name in settings["protocols"]]
    report.write(accuracy / "README.md", "strain_recorded", protocols=protocols, tested=tested, measures=MEASURES)
    panels = {plain(protocol): (protocol, day) for protocol, day in places.items()}
    measure = ("press_error", "Error per press (mm)")
    experiment.write_speed(workspace, report, target, settings, panels, measure, TRANSFER_COSTS)


def presses(workspace: Workspace, settings: Mapping, protocol: str) -> list[common.Cloud]:
    """Return true and predicted places of the presses that the first run of a protocol tests on, by model and axis."""
    seed, dataset = settings["protocols"][protocol]["seeds"][0], read_windows(workspace, "strain_recorded")
    tested = schemas.names(dataset[schemas.split_column(protocol, seed)]) == "test"
    rows = np.flatnonzero(tested & (dataset["press"].to_numpy() >= 0))
    truth = schemas.matrix(dataset["y"])[rows]
    _, first, size = np.unique(dataset["press"].to_numpy()[rows], return_index=True, return_counts=True)
    chosen = np.unique(np.linspace(0, len(first) - 1, min(MOST_PRESSES, len(first))).astype(int))
    halves = [slice(first[k] + size[k] // 2, first[k] + size[k]) for k in chosen]
    clouds = []
    for model in (model for model in DRAWN if model in settings["models"]):
        guess = read_predictions(workspace, "strain_recorded", model, protocol, seed, dataset)[rows]
        true, predicted = (np.array([values[half].mean(axis=0) for half in halves]) for values in (truth, guess))
        clouds += [common.Cloud(AXES[k], true[:, k], predicted[:, k], model) for k in range(2)]
    return clouds
