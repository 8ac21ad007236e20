"""Stage: what people read: tables, figures and findings of one experiment in reports/<experiment>.

Everything with a measured time in it is in reports/<experiment>/speed; reports/<experiment>/accuracy is the
same in every run.
Usage: python -m pipeline.render EXPERIMENT
"""

import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow.parquet

from pipeline import (
    figures_glove,
    figures_speed,
    figures_strain,
    figures_touch,
    figures_velostat,
    files,
    images,
    params,
    paths,
    report_glove,
    report_glove_findings,
    report_glove_recorded,
    report_speed,
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
from pipeline.experiments import glove
from pipeline.figures import style

CODE = Path(__file__).resolve().parent
GRASPED = "mobile_phone"  # in figure 10
SEQUENCE_FRAMES = 50  # of figure 13
WRONG = ("accuracy", "Images named wrongly (%)")  # errors of the experiments on images
# The module that an experiment's networks are trained by.
FITTING = {
    "touch": "fitting",
    "strain": "series_fitting",
    "glove": "image_fitting",
    "glove_recorded": "image_fitting",
}


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

    files.write_table(accuracy / "table1.csv", report_touch.score_table(scores, settings, conditions))
    files.write_text(accuracy / "table1.md", report_touch.table_one(scores, settings, conditions))
    files.write_text(accuracy / "training.md", report_touch.training(fits, settings))
    trained = [fit for runs in fits.values() for fit in runs if fit.stop_reason != "closed_form"]
    differences = _own_differences("touch", settings)
    unseen = report_touch.unseen_products(
        tables.matrix(table["x"])[:, -settings["sensor"]["rows"] * settings["sensor"]["cols"] :].astype(float),
        tables.names(table[tables.split_column(protocol, seed)]),
        tables.names(table["condition"]),
        settings["sensor"],
    )
    files.write_text(
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

    panels = {f"{name} touch": (protocol, name) for name in report_touch.TABLE_CONDITIONS if name in conditions}
    published = report_touch.published_times(latency, settings)
    _write_speed(target, settings, scores, latency, panels, ("rmse", "RMSE (kPa)"), end=published)


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

    files.write_table(accuracy / "table.csv", report_velostat.score_table(scores, settings, groups))
    files.write_text(accuracy / "table.md", report_velostat.score_text(scores, settings, groups))
    files.write_text(accuracy / "README.md", report_velostat.findings(scores, settings, groups, best))
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

    _write_speed(target, settings, scores, latency, {"all recordings": (protocol, "all")}, ("rmse", "RMSE (N)"))


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

    files.write_table(accuracy / "table1.csv", report_strain.score_table(scores, settings))
    parameters = {key: fit.parameters for key, fit in fits.items()}
    files.write_text(accuracy / "table1.md", report_strain.table_one(scores, settings, parameters))
    for name, study in studies.items():
        files.write_table(accuracy / f"{name}.csv", study)
    files.write_text(
        accuracy / "README.md",
        report_strain.findings(
            scores,
            settings,
            studies,
            {k: v for k, v in late.items() if k != "task_0"},
            _own_differences("strain", settings),
        ),
    )

    train_s = {
        (model, task): results.read_training_times("strain", model, task) for model in models for task in tests
    }
    files.write_text(target / "speed" / "table1_times.md", report_strain.table_times(train_s, settings))
    panels = {task.replace("_", " "): (task, task) for task in tests}
    _write_speed(target, settings, scores, latency, panels, ("error", "Error (mm)"), report_strain.TRANSFER_COSTS)


def render_strain_recorded(settings: dict, target: Path) -> None:
    """Write the report of `strain_recorded` into the new folder `target`; settings: its block of params.yaml."""
    accuracy = target / "accuracy"
    scores, latency, table, _, _ = _read("strain_recorded", settings)
    models = list(settings["models"])
    tested = {protocol: condition for protocol, condition, _ in scores.measured()}
    files.write_table(accuracy / "table.csv", report_strain.score_table(scores, settings))
    files.write_text(accuracy / "table.md", report_strain_recorded.score_text(scores, settings, tested))
    files.write_text(accuracy / "README.md", report_strain_recorded.findings(scores, settings, tested))
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
    panels = {protocol.replace("_", " "): (protocol, tested[protocol]) for protocol in views}
    measure = ("press_error", "Error per press (mm)")
    _write_speed(target, settings, scores, latency, panels, measure, report_strain.TRANSFER_COSTS)


def render_glove(settings: dict, target: Path) -> None:
    """Write the report of `glove` into the new folder `target`; settings: its block of params.yaml."""
    accuracy = target / "accuracy"
    scores, latency, table, _, _ = _read("glove", settings)
    objects, protocols = images.classes(table), report_glove.main_protocols(settings)
    counts, stag = report_glove.read_counts(), report_glove.read_stag()
    augmentation = {metric: report_glove.read_augmentation(settings, metric) for metric in report_glove.METRICS}
    fits = report_glove.read_fits("glove", settings)
    shown = {dataset: "sp_resnet" for dataset in protocols if "sp_resnet" in settings["models"]}
    confusions = report_glove.read_confusions("glove", settings, table, shown)
    compared = [model for model in ("sp_resnet", "resnet3x3") if model in settings["models"]]
    frames = {
        dataset: report_glove.scores_by_frames(table, protocols[dataset], settings, compared)
        for dataset in ("combined", "pressure")
    }

    files.write_table(accuracy / "table1.csv", report_glove.score_table(scores, settings, report_glove.published()))
    files.write_text(accuracy / "table1.md", report_glove.table_one(scores, settings, counts))
    files.write_table(accuracy / "table2.csv", report_glove.augmentation_table(augmentation))
    files.write_text(accuracy / "table2.md", report_glove.table_two(augmentation["macro_precision"], settings))
    by_frames = [rows.assign(condition=dataset) for dataset, rows in frames.items()]
    files.write_table(accuracy / "figure15.csv", pd.concat(by_frames))
    files.write_text(
        accuracy / "README.md",
        report_glove_findings.findings(
            scores,
            settings,
            counts=counts,
            augmentation=augmentation["macro_precision"],
            confusions=confusions,
            objects=objects,
            frames=frames,
            stag=stag,
            trained=[fit for datasets in fits.values() for runs in datasets.values() for fit in runs],
            differences=_own_differences("glove", settings),
        ),
    )

    names, sessions = tables.names(table["condition"]), tables.names(table["recording"])
    grasped = GRASPED if GRASPED in objects else objects[0]
    rows = np.flatnonzero(names == grasped)
    rows = rows[sessions[rows] == sessions[rows[0]]]
    grasp = rows[len(rows) // 2]
    pictures = {
        dataset: tables.matrix(table[dataset])[grasp].reshape(images.SIDE, images.SIDE) for dataset in images.MODALITIES
    }
    title = f"Figure 10: tactile images, {grasped.replace('_', ' ')}, {sessions[grasp]}"
    figures_glove.tactile_images(accuracy / "figure10.png", pictures, glove.STRAIN, title)
    sequences = _sequences(settings, objects)
    title = f"Figure 13: the last {SEQUENCE_FRAMES} frames of each object's last session; below the line, joint means"
    figures_glove.tactile_sequences(accuracy / "figure13.png", sequences, glove.PRESSURE_CELLS, title)
    _draw_confusions(accuracy, "figure14", settings, confusions, shown, objects)
    if compared:
        title = "Figure 15, on our own data: macro precision against the number of input frames"
        figures_glove.precision_by_frames(accuracy / "figure15.png", frames, title)
    if len(stag):
        title = "Figure 15: the STAG data set"
        figures_glove.precision_by_frames(accuracy / "figure15_stag.png", {"STAG": stag}, title)
    _draw_learning(accuracy, settings, fits)
    panels = {dataset: (protocol, dataset) for dataset, protocol in protocols.items()}
    _write_speed(target, settings, scores, latency, panels, WRONG)


def render_glove_recorded(settings: dict, target: Path) -> None:
    """Write the report of `glove_recorded` into the new folder `target`; settings: its block of params.yaml."""
    accuracy = target / "accuracy"
    scores, latency, table, _, _ = _read("glove_recorded", settings)
    objects, fits = images.classes(table), report_glove.read_fits("glove_recorded", settings)
    best = report_glove_recorded.best_networks(scores, settings)
    confusions = report_glove.read_confusions("glove_recorded", settings, table, best)
    files.write_table(accuracy / "table.csv", report_glove.score_table(scores, settings, {}).drop(columns="published"))
    files.write_text(accuracy / "table.md", report_glove_recorded.score_text(scores, settings, objects))
    files.write_text(
        accuracy / "README.md",
        report_glove_recorded.findings(
            scores,
            settings,
            confusions=confusions,
            objects=objects,
            probe=report_glove_recorded.read_probe(),
            trained=[fit for datasets in fits.values() for runs in datasets.values() for fit in runs],
            differences=_own_differences("glove_recorded", settings),
        ),
    )
    _draw_confusions(accuracy, "confusion", settings, confusions, best, objects)
    _draw_learning(accuracy, settings, fits)
    names, protocols = report_glove_recorded.DATASETS, report_glove.main_protocols(settings)
    panels = {names[dataset]: (protocol, dataset) for dataset, protocol in protocols.items()}
    _write_speed(target, settings, scores, latency, panels, WRONG)


def _sequences(settings: dict, objects: list[str]) -> dict[str, np.ndarray]:
    """Object -> conductance in mS (sensors, frames) in its last session: pressure cells, then the wired joints."""
    path = paths.require(paths.frames("glove"), "python -m pipeline.ingest glove")
    frames = pyarrow.parquet.read_table(path, columns=["condition", "recording", "pressure", "strain"])
    names, sessions = tables.names(frames["condition"]), tables.names(frames["recording"])
    ohm = settings["sensor"]["reference_ohm"]
    pressure, strain = (1e3 * glove.conductance(tables.matrix(frames[c]), ohm) for c in ("pressure", "strain"))
    joints = glove.joint_means(strain.reshape(-1, 15, 9)).reshape(len(names), -1)
    values = np.column_stack([pressure, joints[:, joints.any(axis=0)]])
    found = {}
    for one in objects:
        own = np.flatnonzero(names == one)
        last = own[sessions[own] == max(sessions[own])]
        found[one] = values[last[-SEQUENCE_FRAMES:]].T
    return found


def _own_differences(experiment: str, settings: dict) -> list[tuple[str, str]]:
    """The differences from its paper in the files of one experiment."""
    files = [FITTING[experiment], f"experiments/{experiment}", f"scenes/{experiment}"]
    own = {f"{CODE.name}/{file}.py" for file in (*files, *(f"models/{model}" for model in settings["models"]))}
    return [(file, text) for file, text in read_differences(CODE) if file in own]


def _draw_confusions(
    folder: Path, name: str, settings: dict, confusions: dict[str, np.ndarray], models: dict[str, str], objects: list
) -> None:
    """<name>_<dataset>.png, the confusions of all seeds together; models: dataset -> whose they are."""
    split = next(iter(report_glove.splits(settings))).replace("_", " ")
    for dataset, counts in confusions.items():
        runs = f"{len(counts)} {'run' if len(counts) == 1 else 'runs'}"
        title = f"{dataset.capitalize()}: answers of {style(models[dataset]).label}, split by {split}, {runs} together"
        figures_glove.confusion_matrix(folder / f"{name}_{dataset}.png", counts.sum(axis=0), objects, title)


def _draw_learning(folder: Path, settings: dict, fits: dict[str, dict[str, list[results.Fit]]]) -> None:
    """learning_curves.png of the main split; none without a network."""
    protocols = report_glove.main_protocols(settings)
    chosen = {m: {dataset: own[protocol] for dataset, protocol in protocols.items()} for m, own in fits.items()}
    split = next(iter(report_glove.splits(settings))).replace("_", " ")
    if chosen:
        title = f"Validation loss, split by {split}, one line a seed (lower is better)"
        figures_glove.learning_curves(folder / "learning_curves.png", chosen, title)


def _read(experiment: str, settings: dict) -> tuple[results.Scores, dict, pyarrow.Table, str, int]:
    """(scores, latency, dataset, main protocol, its first seed): what every report starts from."""
    protocol = next(iter(settings["protocols"]))
    seed = settings["protocols"][protocol]["seeds"][0]
    read = results.Scores(experiment, settings), results.read_latency(experiment, settings)
    return *read, results.read_windows(experiment), protocol, seed


def _by_force(name: str) -> tuple:
    """pike1_force_5 before pike1_force_10."""
    return tuple((0, int(part), "") if part.isdigit() else (1, 0, part) for part in name.split("_"))


def _write_speed(
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
    table = report_speed.speed_table(scores, settings, latency, panels, measure)
    files.write_table(folder / "table2.csv", table)
    files.write_text(folder / "table2.md", report_speed.speed_text(table, settings["latency"]["calls"], note) + end)
    figures_speed.chart(folder / "tradeoff.png", table, "p50_ms")
    figures_speed.chart(folder / "training.png", table, "train_s")


def main() -> None:
    """Render the experiment named on the command line; its folder in reports/ is replaced whole."""
    stages = {
        "touch": render_touch,
        "velostat_recorded": render_velostat_recorded,
        "strain": render_strain,
        "strain_recorded": render_strain_recorded,
        "glove": render_glove,
        "glove_recorded": render_glove_recorded,
    }
    values = params.load()
    experiment = params.experiment_argument(sys.argv, "render", values)
    target = paths.REPORTS / experiment
    reason = why_not_run(experiment)
    with files.replacing_folder(target) as draft:
        for part in ("accuracy", "speed"):
            (draft / part).mkdir()
            if reason:
                text = f"# {experiment}: not run\n\n{reason[0].upper()}{reason[1:]}.\n"
                files.write_text(draft / part / "README.md", text)
        if reason is None:
            stages[experiment](values[experiment], draft)
    print(f"reports/{experiment}: {sum(path.is_file() for path in target.rglob('*'))} files")


if __name__ == "__main__":
    run_stage(main)
