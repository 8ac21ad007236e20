"""Draw and write what the reports of all experiments have in common: learning curves, and the folder `speed`.

The report of a simulated experiment is the module of its name in this folder. Its `write(workspace, target, settings)`
writes the folders `accuracy` and `speed`, which exist, in the new folder `target`; settings: the experiment's block.
Those of recordings are written by `recorded`.
"""

from collections.abc import Mapping
from pathlib import Path

from pipeline.base import files
from pipeline.base.paths import Workspace
from pipeline.reporting import speed as speed_report
from pipeline.reporting.figures import common
from pipeline.reporting.figures import speed as speed_figures
from pipeline.reporting.report import Report
from pipeline.reporting.words.labels import experiment_name
from pipeline.scoring import results


def learning_curves(
    workspace: Workspace, path: Path, experiment: str, settings: Mapping, groups: Mapping[str, str], unit: str
) -> None:
    """Draw the learning curves of all models with epochs; groups: name -> protocol; unit: of the loss."""
    fits = {
        model: {
            name: [
                results.read_fit(workspace, experiment, model, protocol, seed)
                for seed in settings["protocols"][protocol]["seeds"]
            ]
            for name, protocol in groups.items()
        }
        for model in settings["models"]
    }
    title = "Learning curves, one line per seed (lower is better)"
    if any(len(run.history) > 1 for of in fits.values() for runs in of.values() for run in runs):
        common.learning_curves(path, fits, title, unit)


def write_speed(
    workspace: Workspace,
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
    table = speed_report.speed_table(report, settings, speed_report.timed(report, settings), panels, measure)
    files.write_table(folder / "table2.csv", table)
    files.write_text(folder / "table2.md", speed_report.speed_text(table, note) + end)
    speed_figures.chart(folder / "tradeoff.png", table, "p50_ms", name)
    speed_figures.chart(folder / "training.png", table, "train_s", name)
