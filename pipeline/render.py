"""Stage: what people read: tables, figures and findings of one experiment in reports/<experiment>.

Everything with a measured time in it is in reports/<experiment>/speed; reports/<experiment>/accuracy is the
same in every run.
Usage: python -m pipeline.render EXPERIMENT
"""

import shutil
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow.parquet

from pipeline import (
    figures_strain,
    figures_touch,
    figures_velostat,
    params,
    paths,
    report_strain,
    report_strain_recorded,
    report_touch,
    report_velostat,
    results,
    tables,
)
from pipeline.availability import why_not_run
from pipeline.differences import read_differences
from pipeline.errors import run_stage
from pipeline.report_touch import write_text

CODE = Path(__file__).resolve().parent


def render_touch(settings: dict, target: Path) -> None:
    """Write the report of `touch` into the new folder `target`; settings: its block of params.yaml."""
    accuracy = target / "accuracy"
    scores, latency, table, protocol, seed = _read("touch", settings)
    windows = figures_touch.windows_of(table, settings, protocol, seed)
    present = set(windows.condition)
    known = ("single", "double", "three", "slide", "tape")
    conditions = [name for name in known if name in present] + sorted(present - set(known))
    fits = {
        (model, name): [results.read_fit("touch", model, name, number) for number in block["seeds"]]
        for model in settings["models"]
        for name, block in settings["protocols"].items()
    }
    maps = {
        model: results.read_predictions("touch", model, protocol, seed, table).reshape(windows.truth.shape)
        for model in settings["models"]
    }
    frames_path = paths.require(paths.frames("touch"), "python -m pipeline.ingest touch")
    frames = pyarrow.parquet.read_table(frames_path, columns=["condition", "v", "force_n", "x_mm", "y_mm"])

    _write_csv(accuracy / "table1.csv", report_touch.score_table(scores, settings, conditions))
    write_text(accuracy / "table1.md", report_touch.table_one(scores, settings, conditions))
    write_text(accuracy / "training.md", report_touch.training(fits, settings))
    trained = [fit for runs in fits.values() for fit in runs if fit.stop_reason != "closed_form"]
    differences = read_differences(CODE)
    unseen = report_touch.unseen_products(
        tables.matrix(table["x"])[:, -settings["sensor"]["rows"] * settings["sensor"]["cols"] :].astype(float),
        tables.names(table[tables.split_column(protocol, seed)]),
        tables.names(table["condition"]),
        settings["sensor"],
    )
    write_text(
        accuracy / "README.md", report_touch.findings(scores, settings, conditions, trained, differences, unseen)
    )

    figures_touch.learning_curves(
        accuracy / "learning_curves.png",
        {model: fits[model, protocol] for model in settings["models"]},
        protocol,
    )
    figures_touch.characteristic_curve(accuracy / "figure2b.png", settings)
    figures_touch.peak_pressure(accuracy / "figure4.png", windows, maps, settings)
    figures_touch.press_location(accuracy / "figure5.png", frames, settings)
    if "double" in conditions:
        figures_touch.double_touch(accuracy / "figure6.png", windows, maps, settings)
    figures_touch.error_distribution(accuracy / "figure7.png", windows, maps, settings)
    if present & set(figures_touch.SEVERAL_TOUCHES):
        figures_touch.pressure_maps(accuracy / "figure8.png", windows, maps, settings)

    time_ms = _write_speed(target / "speed", latency, settings, "touch")
    errors = {
        condition: {
            model: scores.estimate(protocol, condition, model, "rmse") for model in settings["models"]
        }
        for condition in report_touch.TABLE_CONDITIONS
        if condition in conditions
    }
    figures_touch.speed_against_accuracy(
        target / "speed" / "tradeoff.png", time_ms, errors, settings["latency"]["batches"][0]
    )


def render_velostat_recorded(settings: dict, target: Path) -> None:
    """Write the report of `velostat_recorded` into the new folder `target`; settings: its block of params."""
    accuracy = target / "accuracy"
    scores, latency, table, protocol, seed = _read("velostat_recorded", settings)
    test = tables.names(table[tables.split_column(protocol, seed)]) == "test"
    recordings = sorted(set(tables.names(table["recording"])[test]))
    groups = ["all", *sorted({name.split("/")[0] for name in recordings}, key=_by_force)]
    best = report_velostat.best_model(scores, settings)
    drawn = [model for model in settings["models"] if model in ("linear", best)]
    predicted = {
        model: results.read_predictions("velostat_recorded", model, protocol, seed, table)
        for model in settings["models"]
    }

    _write_csv(accuracy / "table.csv", report_velostat.score_table(scores, settings, groups))
    write_text(accuracy / "table.md", report_velostat.score_text(scores, settings, groups))
    write_text(accuracy / "README.md", report_velostat.findings(scores, settings, groups, best))
    # The recordings that the best model (or, if all failed, the first) reads best, in the middle and worst.
    judge = best or next(iter(settings["models"]))
    order = sorted(
        recordings,
        key=lambda name: scores.estimate(protocol, name.split("/")[0], judge, "r2").mean,
        reverse=True,
    )
    chosen = [order[k] for k in sorted({0, len(order) // 2, len(order) - 1})]
    figures_velostat.force_over_time(
        accuracy / "figure.png", table, test, {model: predicted[model] for model in drawn}, chosen
    )

    time_ms = _write_speed(target / "speed", latency, settings, "velostat_recorded")
    error = {model: scores.estimate(protocol, "all", model, "rmse").mean for model in settings["models"]}
    figures_velostat.speed_against_accuracy(
        target / "speed" / "tradeoff.png", time_ms, error, settings["latency"]["batches"][0]
    )


def render_strain(settings: dict, target: Path) -> None:
    """Write the report of `strain` into the new folder `target`; settings: its block of params.yaml."""
    accuracy = target / "accuracy"
    scores, latency, table, _, _ = _read("strain", settings)
    models = list(settings["models"])
    fits = {
        (model, task): results.read_fit("strain", model, task, block["seeds"][0])
        for model in models
        for task, block in settings["protocols"].items()
    }
    studies = {name: report_strain.read_study(name) for name in ("samples", "drift", "capacity")}
    compared = [model for model in ("lstm_direct", "lstm_transfer") if model in models]
    truth, time_s = tables.matrix(table["y"]), table["t_s"].to_numpy()
    tests = {}
    late, by_time = {}, {}
    for task, block in settings["protocols"].items():
        seed = block["seeds"][0]
        rows = np.flatnonzero(tables.names(table[tables.split_column(task, seed)]) == "test")
        tests[task] = rows
        guesses = {
            model: [results.read_predictions("strain", model, task, one, table)[rows] for one in block["seeds"]]
            for model in models
        }
        bins = np.array_split(np.arange(len(rows)), report_strain.TIME_BINS)
        by_time[task] = {
            model: np.array([[report_strain.mean_error(truth[rows[b]], one[b]) for b in bins] for one in runs])
            for model, runs in guesses.items()
        }
        late[task] = {
            model: (results.estimate(runs[:, 0]), results.estimate(runs[:, -1]))
            for model, runs in by_time[task].items()
        }
        volts = tables.matrix(table["v"])[rows]
        first = {model: guesses[model][0] for model in compared}
        number = {"task_1": 5, "task_2": 6}.get(task)
        outputs = [k for k in range(3) if np.isfinite(guesses[models[0]][0][:, k]).all()]
        view = (time_s[rows], volts, truth[rows])
        if number and "lstm_direct" in models:
            title = f"Figure {number}: direct training, {task.replace('_', ' ')}, test part, seed {seed}"
            figures_strain.performance(
                accuracy / f"figure{number}.png", title, *view, {"lstm_direct": first["lstm_direct"]}, outputs
            )
        if number:
            title = f"Figure 8: direct training and transfer, {task.replace('_', ' ')}, test part, seed {seed}"
            view = (time_s[rows], volts[:, :0], truth[rows])
            figures_strain.performance(accuracy / f"figure8_{task}.png", title, *view, first, outputs)
    share = (np.arange(report_strain.TIME_BINS) + 0.5) / report_strain.TIME_BINS
    minutes = share * np.ptp(time_s[tests["task_1"]]) / 60
    figures_strain.error_over_time(
        accuracy / "time.png", {task: by_time[task] for task in ("task_1", "task_2") if task in by_time}, minutes
    )
    figures_strain.latent_space(accuracy / "figure7.png", report_strain.read_latents())
    floor = {}
    if "constant" in models:
        floor = {task: scores.estimate(task, task, "constant", "error").mean for task in settings["study"]["tasks"]}
    labels = {"title": "Fewer samples: error against the size of the training set", "xlabel": "Training samples"}
    figures_strain.curves(accuracy / "samples.png", studies["samples"], "samples", "model", labels, floor)
    labels = {"title": "Capacity: error of direct training against the size of the LSTM", "xlabel": "Units of the LSTM"}
    figures_strain.curves(accuracy / "capacity.png", studies["capacity"], "units", None, labels, floor)
    grouped = studies["drift"].groupby(["protocol", "target", "input"], sort=False)["value"]
    figures_strain.decoding(accuracy / "drift.png", {key: results.estimate(values) for key, values in grouped})

    _write_csv(accuracy / "table1.csv", report_strain.score_table(scores, settings))
    parameters = {key: fit.parameters for key, fit in fits.items()}
    write_text(accuracy / "table1.md", report_strain.table_one(scores, settings, parameters))
    for name, study in studies.items():
        _write_csv(accuracy / f"{name}.csv", study)
    write_text(
        accuracy / "README.md",
        report_strain.findings(
            scores, settings, studies, {k: v for k, v in late.items() if k != "task_0"}, read_differences(CODE)
        ),
    )

    train_s = {
        (model, task): results.read_training_times("strain", model, task) for model in models for task in tests
    }
    write_text(target / "speed" / "table1_times.md", report_strain.table_times(train_s, settings))
    time_ms = _write_speed(target / "speed", latency, settings, "strain")
    errors = {
        task.replace("_", " "): {model: scores.estimate(task, task, model, "error") for model in models}
        for task in tests
    }
    batch = settings["latency"]["batches"][0]
    labels = {"xlabel": f"Median time of a sample, batch {batch} (ms)", "ylabel": "Error (mm)"}
    figures_strain.speed_against_accuracy(target / "speed" / "tradeoff.png", time_ms, errors, labels)


def render_strain_recorded(settings: dict, target: Path) -> None:
    """Write the report of `strain_recorded` into the new folder `target`; settings: its block of params.yaml."""
    accuracy = target / "accuracy"
    scores, latency, table, _, _ = _read("strain_recorded", settings)
    models = list(settings["models"])
    tested = {protocol: condition for protocol, condition, _ in scores.measured()}
    _write_csv(accuracy / "table.csv", report_strain.score_table(scores, settings))
    write_text(accuracy / "table.md", report_strain_recorded.score_text(scores, settings, tested))
    write_text(accuracy / "README.md", report_strain_recorded.findings(scores, settings, tested))
    truth, press = tables.matrix(table["y"]), table["press"].to_numpy()
    views = {}
    for protocol in tested:
        if protocol.endswith("_xy"):
            seed = settings["protocols"][protocol]["seeds"][0]
            part = tables.names(table[tables.split_column(protocol, seed)])
            rows = np.flatnonzero((part == "test") & (press >= 0))
            views[protocol] = (
                truth[rows],
                press[rows],
                {m: results.read_predictions("strain_recorded", m, protocol, seed, table)[rows] for m in models},
            )
    figures_strain.presses(accuracy / "figure.png", views)
    time_ms = _write_speed(target / "speed", latency, settings, "strain_recorded")
    errors = {
        protocol.replace("_", " "): {m: scores.estimate(protocol, tested[protocol], m, "press_error") for m in models}
        for protocol in views
    }
    batch = settings["latency"]["batches"][0]
    labels = {"xlabel": f"Median time of a sample, batch {batch} (ms)", "ylabel": "Error per press (mm)"}
    figures_strain.speed_against_accuracy(target / "speed" / "tradeoff.png", time_ms, errors, labels)


def _read(experiment: str, settings: dict) -> tuple[results.Scores, dict, pyarrow.Table, str, int]:
    """(scores, latency, dataset, main protocol, its first seed): what every report starts from."""
    protocol = next(iter(settings["protocols"]))
    seed = settings["protocols"][protocol]["seeds"][0]
    read = results.Scores(experiment, settings), results.read_latency(experiment, settings)
    return *read, results.read_windows(experiment), protocol, seed


def _by_force(name: str) -> tuple:
    """pike1_force_5 before pike1_force_10."""
    return tuple((0, int(part), "") if part.isdigit() else (1, 0, part) for part in name.split("_"))


def _write_csv(path: Path, table: pd.DataFrame) -> None:
    table.to_csv(path, index=False, lineterminator="\n", float_format=_repr)


def _repr(value: float) -> str:
    """The shortest text that reads back as the same number."""
    return repr(float(value))


def _write_speed(folder: Path, latency: dict, settings: dict, experiment: str) -> dict[str, float]:
    """Write table2.csv and table2.md; returns the median ms at the first batch size, by model."""
    _write_csv(folder / "table2.csv", report_touch.speed_table(latency, settings, experiment))
    write_text(folder / "table2.md", report_touch.table_two(latency, settings, experiment))
    first = settings["latency"]["batches"][0]
    return {model: float(np.float64(latency[model, first]["p50_ms"])) for model in settings["models"]}


def main() -> None:
    """Render the experiment named on the command line; its folder in reports/ is replaced whole."""
    stages = {
        "touch": render_touch,
        "velostat_recorded": render_velostat_recorded,
        "strain": render_strain,
        "strain_recorded": render_strain_recorded,
    }
    values = params.load()
    experiment = params.experiment_argument(sys.argv, "render", values)
    target = paths.REPORTS / experiment
    draft = target.with_name(f"{experiment}.unfinished")
    shutil.rmtree(draft, ignore_errors=True)
    for part in ("accuracy", "speed"):
        (draft / part).mkdir(parents=True)
    reason = why_not_run(experiment)
    if reason is None:
        stages[experiment](values[experiment], draft)
    else:
        for part in ("accuracy", "speed"):
            write_text(
                draft / part / "README.md", f"# {experiment}: not run\n\n{reason[0].upper()}{reason[1:]}.\n"
            )
    shutil.rmtree(target, ignore_errors=True)
    draft.rename(target)
    print(f"reports/{experiment}: {sum(path.is_file() for path in target.rglob('*'))} files")


if __name__ == "__main__":
    run_stage(main)
