"""Read and write what the reports of all experiments have in common.

The report of an experiment is the module of its name in this folder. Its `write(target, settings)` writes the folders
`accuracy` and `speed`, which exist, in the new folder `target`; settings: the experiment's block of settings.
"""

import json
from collections.abc import Callable, Iterable, Mapping
from functools import reduce
from operator import getitem
from pathlib import Path

import pandas as pd
import pyarrow as pa

from pipeline import experiments
from pipeline.base import files, params, paths
from pipeline.base.paths import Workspace
from pipeline.reporting import speed as speed_report
from pipeline.reporting.figures import speed as speed_figures
from pipeline.reporting.sentences import read_differences
from pipeline.scoring import results

FITTING = {
    "windows": ["regressors"],
    "series": ["lstm", "series_regressors"],
    "images": ["image_classifier"],
}  # by kind of input
SCENES = {
    "touch": ["scenes/touch", "scenes/touch_contact", "scenes/touch_motion"],
    "strain": ["scenes/strain"],
    "glove": ["scenes/glove", "reporting/glove"],
    "glove_recorded": ["reporting/glove_recorded"],
}  # the files that write an experiment's simulated logs, draw its laws, or say what the paper leaves open


def read(workspace: Workspace, experiment: str, settings: Mapping) -> tuple[results.Scores, dict, pa.Table, str, int]:
    """Read (scores, latency, dataset, main protocol, its first seed): what every report starts from."""
    protocol = next(iter(settings["protocols"]))
    seed = settings["protocols"][protocol]["seeds"][0]
    scores, latency = (
        results.Scores(workspace, experiment, settings),
        results.read_latency(workspace, experiment, settings),
    )
    return scores, latency, results.read_windows(workspace, experiment), protocol, seed


def score_table(
    scores: results.Scores,
    runs: Iterable[tuple[str, str, str, str]],
    units: Mapping[str, str] | None = None,
    published: Callable[[str, str, str], float] | None = None,
) -> pd.DataFrame:
    """Return one row per (protocol, condition, model, metric) of `runs`: mean and interval in full precision.

    units: metric -> unit; published: (model, condition, metric) -> the paper's number. Without one, no such column.
    """
    rows = []
    for protocol, condition, model, metric in runs:
        row = {"protocol": protocol, "condition": condition, "model": model, "metric": metric}
        row |= {"unit": units[metric]} if units else {}
        row |= {"published": published(model, condition, metric)} if published else {}
        rows.append(row | scores.estimate(protocol, condition, model, metric)._asdict())
    return pd.DataFrame(rows)


def experiment_differences(workspace: Workspace, experiment: str, settings: Mapping) -> list[tuple[str, str]]:
    """Read the differences of one experiment from its paper: (file, text), first those in code, then amounts."""
    names = [
        *(f"learning/{name}" for name in FITTING[experiments.module(experiment).KIND]),
        f"experiments/{experiment}",
        *SCENES.get(experiment, []),
        *(f"models/{model}" for model in settings["models"]),
    ]
    return read_differences(paths.CODE, (f"{name}.py" for name in names)) + amounts(workspace, experiment, settings)


def amounts(workspace: Workspace, experiment: str, settings: Mapping) -> list[tuple[str, str]]:
    """Return the values of params.yaml that are not the papers': (file, text); settings: the experiment's block.

    The papers' amounts of data, epochs and runs are the values of scales/paper.yaml.
    """
    differences = []
    for keys, papers in params.scale_settings(workspace.scales, "paper", experiment, settings):
        ours = reduce(getitem, keys, settings)
        if ours != papers:
            name = ".".join([experiment, *keys])
            text = f"`{name}` is {json.dumps(ours)}; at the paper's scale {json.dumps(papers)}."
            differences.append((params.file_of(experiment), text))
    return differences


def write_speed(
    workspace: Workspace,
    target: Path,
    settings: Mapping,
    scores: results.Scores,
    latency: dict,
    panels: dict[str, tuple[str, str]],
    measure: tuple[str, str],
    note: str = "",
    end: str = "",
) -> None:
    """Write the folder `speed`; panels, measure: see `speed.speed_table`; note, end: more text of table2.md."""
    folder = target / "speed"
    table = speed_report.speed_table(workspace, scores, settings, latency, panels, measure)
    files.write_table(folder / "table2.csv", table)
    files.write_text(folder / "table2.md", speed_report.speed_text(table, settings["latency"]["calls"], note) + end)
    speed_figures.chart(folder / "tradeoff.png", table, "p50_ms")
    speed_figures.chart(folder / "training.png", table, "train_s")
