"""The reports of `strain` and `strain_recorded`, written into a new folder."""

from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa

from pipeline.base import files
from pipeline.datasets import schemas
from pipeline.reporting import (
    experiment as experiment_report,
)
from pipeline.reporting import (
    strain as strain_report,
)
from pipeline.reporting import (
    strain_recorded as strain_recorded_report,
)
from pipeline.reporting.figures import strain as strain_figures
from pipeline.scoring import results


def write_strain(settings: dict, target: Path) -> None:
    """Write the report of `strain` into the new folder `target`; settings: its block of params.yaml."""
    accuracy = target / "accuracy"
    scores, latency, table, _, _ = experiment_report.read("strain", settings)
    models, tasks = list(settings["models"]), list(settings["protocols"])
    parameters = {
        (model, task): results.read_fit("strain", model, task, block["seeds"][0]).parameters
        for model in models
        for task, block in settings["protocols"].items()
    }
    studies = {name: strain_report.read_study(name) for name in ("samples", "drift", "capacity")}
    by_time = {task: _errors_by_time(settings, table, task) for task in tasks}
    late = {
        task: {model: (results.estimate(runs[:, 0]), results.estimate(runs[:, -1])) for model, runs in errors.items()}
        for task, errors in by_time.items()
        if task != "task_0"
    }
    files.write_table(accuracy / "table1.csv", strain_report.score_table(scores, settings))
    files.write_text(accuracy / "table1.md", strain_report.table_one(scores, settings, parameters))
    for name, study in studies.items():
        files.write_table(accuracy / f"{name}.csv", study)
    differences = experiment_report.own_differences("strain", settings)
    files.write_text(accuracy / "README.md", strain_report.findings(scores, settings, studies, late, differences))

    for task, number in (("task_1", 5), ("task_2", 6)):
        if task in tasks:
            _draw_performance(accuracy, settings, table, task, number)
    strain_figures.latent_space(accuracy / "figure7.png", strain_report.read_latents())
    share = (np.arange(strain_report.TIME_BINS) + 0.5) / strain_report.TIME_BINS
    minutes = share * np.ptp(table["t_s"].to_numpy()[_test_rows(settings, table, "task_1")]) / 60
    strain_figures.error_over_time(accuracy / "time.png", {task: by_time[task] for task in late}, minutes)
    _draw_studies(accuracy, settings, scores, studies)

    train_s = {(model, task): results.read_training_times("strain", model, task) for model in models for task in tasks}
    files.write_text(target / "speed" / "table1_times.md", strain_report.table_times(train_s, settings))
    panels = {task.replace("_", " "): (task, task) for task in tasks}
    experiment_report.write_speed(
        target, settings, scores, latency, panels, ("error", "Error (mm)"), strain_report.TRANSFER_COSTS
    )


def _test_rows(settings: dict, table: pa.Table, task: str) -> np.ndarray:
    """Rows of the dataset that the first seed of a task tests on; all seeds have the same."""
    column = schemas.split_column(task, settings["protocols"][task]["seeds"][0])
    return np.flatnonzero(schemas.names(table[column]) == "test")


def _errors_by_time(settings: dict, table: pa.Table, task: str) -> dict[str, np.ndarray]:
    """Model -> mean error in mm (seeds, TIME_BINS) in equal parts of the test part, in the order of time."""
    rows, truth = _test_rows(settings, table, task), schemas.matrix(table["y"])
    bins = np.array_split(rows, strain_report.TIME_BINS)
    found = {}
    for model in settings["models"]:
        seeds = settings["protocols"][task]["seeds"]
        runs = [results.read_predictions("strain", model, task, seed, table) for seed in seeds]
        found[model] = np.array([[strain_report.mean_error(truth[part], run[part]) for part in bins] for run in runs])
    return found


def _draw_performance(folder: Path, settings: dict, table: pa.Table, task: str, number: int) -> None:
    """Figure `number`, and the task's part of figure 8."""
    rows, seed = _test_rows(settings, table, task), settings["protocols"][task]["seeds"][0]
    compared = [model for model in ("lstm_direct", "lstm_transfer") if model in settings["models"]]
    guesses = {model: results.read_predictions("strain", model, task, seed, table)[rows] for model in compared}
    time_s, volts, truth = (
        table["t_s"].to_numpy()[rows],
        schemas.matrix(table["v"])[rows],
        schemas.matrix(table["y"])[rows],
    )
    outputs = [k for k in range(3) if all(np.isfinite(guess[:, k]).all() for guess in guesses.values())]
    run = f"{task.replace('_', ' ')}, test part, seed {seed}"
    if "lstm_direct" in compared:
        title, own = f"Figure {number}: direct training, {run}", {"lstm_direct": guesses["lstm_direct"]}
        strain_figures.performance(folder / f"figure{number}.png", title, time_s, volts, truth, own, outputs)
    title = f"Figure 8: direct training and transfer, {run}"
    strain_figures.performance(folder / f"figure8_{task}.png", title, time_s, volts[:, :0], truth, guesses, outputs)


def _draw_studies(folder: Path, settings: dict, scores: results.Scores, studies: dict[str, pd.DataFrame]) -> None:
    """samples.png, capacity.png and drift.png."""
    floor = {}
    if "constant" in settings["models"]:
        floor = {task: scores.estimate(task, task, "constant", "error").mean for task in settings["study"]["tasks"]}
    labels = {"title": "Fewer samples: error against the size of the training set", "xlabel": "Training samples"}
    strain_figures.curves(folder / "samples.png", studies["samples"], "samples", "model", labels, floor)
    labels = {"title": "Capacity: error of direct training against the size of the LSTM", "xlabel": "Units of the LSTM"}
    strain_figures.curves(folder / "capacity.png", studies["capacity"], "units", None, labels, floor)
    grouped = studies["drift"].groupby(["protocol", "target", "input"], sort=False)["value"]
    strain_figures.decoding(folder / "drift.png", {key: results.estimate(values) for key, values in grouped})


def write_strain_recorded(settings: dict, target: Path) -> None:
    """Write the report of `strain_recorded` into the new folder `target`; settings: its block of params.yaml."""
    accuracy = target / "accuracy"
    scores, latency, table, _, _ = experiment_report.read("strain_recorded", settings)
    models = list(settings["models"])
    tested = {protocol: condition for protocol, condition, _ in scores.measured()}
    files.write_table(accuracy / "table.csv", strain_report.score_table(scores, settings))
    files.write_text(accuracy / "table.md", strain_recorded_report.score_text(scores, settings, tested))
    files.write_text(accuracy / "README.md", strain_recorded_report.findings(scores, settings, tested))
    truth, press = schemas.matrix(table["y"]), table["press"].to_numpy()
    views = {}
    for protocol in tested:
        if protocol.endswith("_xy"):
            seed = settings["protocols"][protocol]["seeds"][0]
            part = schemas.names(table[schemas.split_column(protocol, seed)])
            rows = np.flatnonzero((part == "test") & (press >= 0))
            views[protocol] = (
                truth[rows],
                press[rows],
                {m: results.read_predictions("strain_recorded", m, protocol, seed, table)[rows] for m in models},
            )
    strain_figures.presses(accuracy / "figure.png", views)
    panels = {protocol.replace("_", " "): (protocol, tested[protocol]) for protocol in views}
    measure = ("press_error", "Error per press (mm)")
    experiment_report.write_speed(target, settings, scores, latency, panels, measure, strain_report.TRANSFER_COSTS)
