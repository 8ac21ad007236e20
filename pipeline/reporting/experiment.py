"""What the reports of all experiments have in common: what they start from, and the folder of measured times."""

from pathlib import Path

import pyarrow.parquet

from pipeline.base import files, params
from pipeline.reporting import speed as speed_report
from pipeline.reporting.differences import read_differences
from pipeline.reporting.figures import speed as speed_figures
from pipeline.scoring import results

CODE = Path(__file__).resolve().parents[1]
FITTING = {
    "train": ["regressors"],
    "train_series": ["lstm", "series_regressors"],
    "train_images": ["image_classifier"],
}  # by training stage


def read(experiment: str, settings: dict) -> tuple[results.Scores, dict, pyarrow.Table, str, int]:
    """(scores, latency, dataset, main protocol, its first seed): what every report starts from."""
    protocol = next(iter(settings["protocols"]))
    seed = settings["protocols"][protocol]["seeds"][0]
    scores, latency = results.Scores(experiment, settings), results.read_latency(experiment, settings)
    return scores, latency, results.read_windows(experiment), protocol, seed


def own_differences(experiment: str, settings: dict) -> list[tuple[str, str]]:
    """The differences from its paper in the files of one experiment."""
    shared = [
        *(f"learning/{file}" for file in FITTING[params.training_stage(experiment)]),
        f"experiments/{experiment}",
        f"scenes/{experiment}",
    ]
    own = {f"{CODE.name}/{file}.py" for file in (*shared, *(f"models/{model}" for model in settings["models"]))}
    return [(file, text) for file, text in read_differences(CODE) if file in own]


def write_speed(
    target: Path,
    settings: dict,
    scores: results.Scores,
    latency: dict,
    panels: dict[str, tuple[str, str]],
    measure: tuple[str, str],
    note: str = "",
    end: str = "",
) -> None:
    """All of the folder `speed`; panels, measure: see `report_speed.speed_table`; note, end: more of table2.md."""
    folder = target / "speed"
    table = speed_report.speed_table(scores, settings, latency, panels, measure)
    files.write_table(folder / "table2.csv", table)
    files.write_text(folder / "table2.md", speed_report.speed_text(table, settings["latency"]["calls"], note) + end)
    speed_figures.chart(folder / "tradeoff.png", table, "p50_ms")
    speed_figures.chart(folder / "training.png", table, "train_s")
