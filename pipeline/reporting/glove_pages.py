"""The reports of `glove` and `glove_recorded`, written into a new folder."""

from pathlib import Path

import numpy as np
import pandas as pd

from pipeline import experiments
from pipeline.base import files, paths
from pipeline.datasets import images, schemas
from pipeline.reporting import (
    experiment as experiment_report,
)
from pipeline.reporting import (
    glove as glove_report,
)
from pipeline.reporting import (
    glove_findings,
)
from pipeline.reporting import (
    glove_recorded as glove_recorded_report,
)
from pipeline.reporting.figures import glove as glove_figures
from pipeline.reporting.figures import style
from pipeline.reporting.labels import model_name
from pipeline.scoring import results

GRASPED = "mobile_phone"  # in figure 10
SEQUENCE_FRAMES = 50  # of figure 13
WRONG = ("accuracy", "Images named wrongly (%)")


def write_glove(settings: dict, target: Path) -> None:
    """Write the report of `glove` into the new folder `target`; settings: its block of params.yaml."""
    accuracy = target / "accuracy"
    scores, latency, table, _, _ = experiment_report.read("glove", settings)
    objects, protocols = images.classes(table), glove_report.main_protocols(settings)
    counts, stag = glove_report.read_counts(), glove_report.read_stag()
    augmentation = {metric: glove_report.read_augmentation(settings, metric) for metric in glove_report.METRICS}
    fits = glove_report.read_fits("glove", settings)
    shown = {dataset: "sp_resnet" for dataset in protocols if "sp_resnet" in settings["models"]}
    confusions = glove_report.read_confusions("glove", settings, table, shown)
    compared = [model for model in ("sp_resnet", "resnet3x3") if model in settings["models"]]
    frames = {
        dataset: glove_report.scores_by_frames(table, protocols[dataset], settings, compared)
        for dataset in ("combined", "pressure")
    }

    files.write_table(accuracy / "table1.csv", glove_report.score_table(scores, settings, glove_report.published()))
    files.write_text(accuracy / "table1.md", glove_report.table_one(scores, settings, counts))
    files.write_table(accuracy / "table2.csv", glove_report.augmentation_table(augmentation))
    files.write_text(accuracy / "table2.md", glove_report.table_two(augmentation["macro_precision"], settings))
    by_frames = [rows.assign(condition=dataset) for dataset, rows in frames.items()]
    files.write_table(accuracy / "figure15.csv", pd.concat(by_frames))
    files.write_text(
        accuracy / "README.md",
        glove_findings.findings(
            scores,
            settings,
            counts=counts,
            augmentation=augmentation["macro_precision"],
            confusions=confusions,
            objects=objects,
            frames=frames,
            stag=stag,
            trained=[fit for datasets in fits.values() for runs in datasets.values() for fit in runs],
            differences=experiment_report.own_differences("glove", settings),
        ),
    )

    glove = experiments.module("glove")
    names, sessions = schemas.names(table["condition"]), schemas.names(table["recording"])
    grasped = GRASPED if GRASPED in objects else objects[0]
    rows = np.flatnonzero(names == grasped)
    rows = rows[sessions[rows] == sessions[rows[0]]]
    grasp = rows[len(rows) // 2]
    pictures = {
        dataset: schemas.matrix(table[dataset])[grasp].reshape(images.SIDE, images.SIDE)
        for dataset in images.MODALITIES
    }
    title = style.literal(f"Figure 10: tactile images, {grasped.replace('_', ' ')}, {sessions[grasp]}")
    glove_figures.tactile_images(accuracy / "figure10.png", pictures, glove.STRAIN, title)
    sequences = _sequences(settings, objects)
    title = f"Figure 13: the last {SEQUENCE_FRAMES} frames of each object's last session; below the line, joint means"
    glove_figures.tactile_sequences(accuracy / "figure13.png", sequences, glove.PRESSURE_CELLS, title)
    _draw_confusions(accuracy, "figure14", settings, confusions, shown, objects)
    if compared:
        title = "Figure 15, on our own data: macro precision against the number of input frames"
        glove_figures.precision_by_frames(accuracy / "figure15.png", frames, title)
    if len(stag):
        title = "Figure 15: the STAG data set"
        glove_figures.precision_by_frames(accuracy / "figure15_stag.png", {"STAG": stag}, title)
    _draw_learning(accuracy, settings, fits)
    panels = {dataset: (protocol, dataset) for dataset, protocol in protocols.items()}
    experiment_report.write_speed(target, settings, scores, latency, panels, WRONG)


def write_glove_recorded(settings: dict, target: Path) -> None:
    """Write the report of `glove_recorded` into the new folder `target`; settings: its block of params.yaml."""
    accuracy = target / "accuracy"
    scores, latency, table, _, _ = experiment_report.read("glove_recorded", settings)
    objects, fits = images.classes(table), glove_report.read_fits("glove_recorded", settings)
    best = glove_recorded_report.best_networks(scores, settings)
    confusions = glove_report.read_confusions("glove_recorded", settings, table, best)
    files.write_table(accuracy / "table.csv", glove_report.score_table(scores, settings, {}).drop(columns="published"))
    files.write_text(accuracy / "table.md", glove_recorded_report.score_text(scores, settings, objects))
    files.write_text(
        accuracy / "README.md",
        glove_recorded_report.findings(
            scores,
            settings,
            confusions=confusions,
            objects=objects,
            probe=glove_recorded_report.read_probe(),
            trained=[fit for datasets in fits.values() for runs in datasets.values() for fit in runs],
            differences=experiment_report.own_differences("glove_recorded", settings),
        ),
    )
    _draw_confusions(accuracy, "confusion", settings, confusions, best, objects)
    _draw_learning(accuracy, settings, fits)
    names, protocols = glove_recorded_report.DATASETS, glove_report.main_protocols(settings)
    panels = {names[dataset]: (protocol, dataset) for dataset, protocol in protocols.items()}
    experiment_report.write_speed(target, settings, scores, latency, panels, WRONG)


def _sequences(settings: dict, objects: list[str]) -> dict[str, np.ndarray]:
    """Object -> conductance in mS (sensors, frames) in its last session: pressure cells, then the wired joints."""
    path = paths.require(paths.frames("glove"), "python -m pipeline.stages.ingest glove")
    frames = schemas.read(path, columns=["condition", "recording", "pressure", "strain"])
    names, sessions = schemas.names(frames["condition"]), schemas.names(frames["recording"])
    glove, ohm = experiments.module("glove"), settings["sensor"]["reference_ohm"]
    pressure, strain = (1e3 * glove.conductance(schemas.matrix(frames[c]), ohm) for c in ("pressure", "strain"))
    joints = glove.joint_means(strain.reshape(-1, 15, 9)).reshape(len(names), -1)
    values = np.column_stack([pressure, joints[:, joints.any(axis=0)]])
    found = {}
    for one in objects:
        own = np.flatnonzero(names == one)
        last = own[sessions[own] == max(sessions[own])]
        found[one] = values[last[-SEQUENCE_FRAMES:]].T
    return found


def _draw_confusions(
    folder: Path, name: str, settings: dict, confusions: dict[str, np.ndarray], models: dict[str, str], objects: list
) -> None:
    """<name>_<dataset>.png, the confusions of all seeds together; models: dataset -> whose they are."""
    split = next(iter(glove_report.splits(settings))).replace("_", " ")
    for dataset, counts in confusions.items():
        runs = f"{len(counts)} {'run' if len(counts) == 1 else 'runs'}"
        title = f"{dataset.capitalize()}: answers of {model_name(models[dataset])}, split by {split}, {runs} together"
        glove_figures.confusion_matrix(folder / f"{name}_{dataset}.png", counts.sum(axis=0), objects, title)


def _draw_learning(folder: Path, settings: dict, fits: dict[str, dict[str, list[results.Fit]]]) -> None:
    """learning_curves.png of the main split; none without a network."""
    protocols = glove_report.main_protocols(settings)
    chosen = {m: {dataset: own[protocol] for dataset, protocol in protocols.items()} for m, own in fits.items()}
    split = next(iter(glove_report.splits(settings))).replace("_", " ")
    if chosen:
        title = f"Validation loss, split by {split}, one line a seed (lower is better)"
        glove_figures.learning_curves(folder / "learning_curves.png", chosen, title)
