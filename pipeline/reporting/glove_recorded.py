"""Write reports/glove_recorded: naming what a robot hand holds, from its touch and its joint angles."""

from collections.abc import Mapping
from pathlib import Path

from pipeline.base import files
from pipeline.base.paths import Workspace
from pipeline.datasets import images
from pipeline.datasets.images import MODALITIES
from pipeline.reporting import experiment
from pipeline.reporting.glove import WRONG, draw_confusions, score_table
from pipeline.reporting.report import Report
from pipeline.scoring.glove_results import NETWORKS, main_protocols, splits
from pipeline.scoring.results import estimate, read_csv, read_windows

DATASETS = {"pressure": "pressure", "strain": "joint angles", "combined": "combined"}


def write(workspace: Workspace, target: Path, settings: Mapping) -> None:
    """Write the report of `glove_recorded`; see `experiment`.

    Differs from paper: left open there and chosen here: batches of 32 images.
    """
    accuracy, report = target / "accuracy", Report(workspace, "glove_recorded", settings)
    made_by = "python -m pipeline.studies.joint_angles glove_recorded"
    probe = read_csv(workspace.probe("glove_recorded"), ["input", "seed", "metric", "value"], made_by)
    files.write_table(accuracy / "table.csv", score_table(report))
    protocols, best = main_protocols(settings), {}
    for dataset, protocol in protocols.items():
        values = {model: report.estimate(protocol, dataset, model, "accuracy") for model in report.models}
        good = [model for model in (*NETWORKS, "sp_resnet_nogcam") if model in values and not values[model].failed]
        if good := [model for model in good if values[model].runs]:
            best[dataset] = max(good, key=lambda model, values=values: values[model].mean)
    draw_confusions(workspace, accuracy, "confusion", "glove_recorded", settings, best, DATASETS)
    groups = {DATASETS[dataset]: protocol for dataset, protocol in protocols.items()}
    curves = accuracy / "learning_curves.png"
    experiment.learning_curves(workspace, curves, "glove_recorded", settings, groups, "nats")
    report.write(
        accuracy / "README.md",
        "glove_recorded",
        splits=splits(settings),
        objects=len(images.classes(read_windows(workspace, "glove_recorded"))),
        probe={name: estimate(100 * rows["value"]) for name, rows in probe.groupby("input", sort=False)},
        names={dataset: DATASETS[dataset] for dataset in MODALITIES},
    )
    panels = {DATASETS[dataset]: (protocol, dataset) for dataset, protocol in protocols.items()}
    experiment.write_speed(workspace, report, target, settings, panels, WRONG)
