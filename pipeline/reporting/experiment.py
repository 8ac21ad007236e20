"""Draw and write what the reports of all experiments have in common: learning curves, and the folder `speed`.

The report of a simulated experiment is the module of its name in this folder. Its `write(workspace, target, settings,
look)` writes the folders `accuracy` and `speed`, which exist, in the new folder `target`; settings: the experiment's
block; look: whether it is of what was computed here, in place of the evidence. Those of recordings: see `recorded`.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import pandas as pd

from pipeline.reporting import speed as speed_report
from pipeline.reporting.figures import curves
from pipeline.reporting.figures import speed as speed_figures
from pipeline.reporting.report import BUDGETS, Report
from pipeline.results.published import PRINTED
from tactile.base import files
from tactile.drawing.labels import experiment_name
from tactile.experiments import facts


class Parts(NamedTuple):
    """What a report of recordings has, beside its pictures."""

    table: pd.DataFrame  # of table.csv
    panels: Mapping[str, tuple[str, str]]  # of the speed: heading -> protocol and condition
    measure: tuple[str, str]  # of the speed: metric and its name
    words: Mapping  # further values of the template
    note: str = ""  # more text of the speed


def learning_curves(report: Report, path: Path, groups: Mapping[str, str], unit: str) -> None:
    """Draw the learning curves of all models with epochs; groups: name -> protocol; unit: of the loss."""
    losses, paper = report.curves(groups.values()), facts(report.experiment).paper
    if losses.empty:
        return
    printed = PRINTED[paper.key] if paper and paper.epochs else ()
    epochs = {model: paper.epochs for model in printed}
    runs = losses.groupby("budget")["seed"].nunique()
    said = ", ".join(
        f"{runs[at]} {'seed' if runs[at] == 1 else 'seeds'} of {BUDGETS[at]}" for at in BUDGETS if at in runs
    )
    title = f"Learning curves: validation loss, a line a training (lower is better)\n{said}"
    curves.learning_curves(path, losses, groups, title, unit, epochs)


def write_speed(
    report: Report,
    target: Path,
    settings: Mapping,
    panels: Mapping[str, tuple[str, str]],
    measure: tuple[str, str],
    note: str = "",
    end: str = "",
) -> None:
    """Write the folder `speed`; panels, measure: see `speed.speed_table`; note, end: more text of table2.md."""
    folder, name = target / "speed", experiment_name(report.experiment)
    if not panels:
        files.write_text(folder / "table2.md", "# Speed against accuracy\n\nNothing of it was computed.\n")
        return
    table = speed_report.speed_table(report, settings, speed_report.timed(report, settings), panels, measure)
    files.write_table(folder / "table2.csv", table)
    files.write_text(folder / "table2.md", speed_report.speed_text(table, note) + end)
    speed_figures.chart(folder / "tradeoff.png", table, "p50_ms", name)
    speed_figures.chart(folder / "training.png", table, "train_s", name)
