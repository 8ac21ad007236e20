"""Write reports/strain: Table I of the latent-space paper beside the published numbers, its figures, and studies."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pandas as pd

from pipeline.reporting import experiment
from pipeline.reporting.figures import answers, curves
from pipeline.reporting.figures import strain as figures
from pipeline.reporting.report import Report
from pipeline.results import kept, shards
from pipeline.results.strain_results import STUDIES, read_latents, read_study
from tactile.base import files
from tactile.base.paths import Workspace
from tactile.base.processes import processor
from tactile.drawing import common
from tactile.drawing.labels import plain
from tactile.experiments import strain as strain_experiment
from tactile.scoring.estimates import LOG

FIGURES = {"task_1": "figure5", "task_2": "figure6"}  # of direct training
AXES = "xyz"
TIMED = ("constant", "ridge", "esn", "lstm_direct", "lstm_transfer_ridge")  # models of time.png
LEAST_R2 = -0.25  # end of the axis of the decoders
SEEN = {"latent of model-0": "latent space"}  # what a decoder sees, beside the voltages, on the page's first screen
ERROR = "Test error (mm), mean and seeds"
TRANSFER_COSTS = (
    "Parameters and training times of the two transfer models are of the read-out alone; model-0, which they share, "
    "is trained before."
)


def write(workspace: Workspace, target: Path, settings: Mapping, look: bool) -> None:
    """Write the report of `strain`; see `experiment`."""
    accuracy, report = target / "accuracy", Report(workspace, "strain", settings, look)
    files.write_table(accuracy / "table1.csv", score_table(report))
    studies = {name: read_study(workspace, report.results.table, name) for name in STUDIES}
    known = {name: study for name, study in studies.items() if len(study)}
    for name, study in known.items():
        files.write_table(accuracy / f"{name}.csv", study)
    for task in FIGURES:
        draw_task(report, accuracy, task)
    if len(latents := read_latents(workspace)):
        figures.latent_space(accuracy / "figure7.png", latents)
    draw_time(report, accuracy / "time.png")
    groups = {plain(task): task for task in settings["protocols"]}
    experiment.learning_curves(report, accuracy / "learning_curves.png", groups, "mm²")
    draw_studies(accuracy, report, known)
    absent = [name for name in STUDIES if name not in known]
    of_base = {name.removeprefix("base_"): one for name, one in report.variants.items() if name.startswith("base_")}
    tasks = dict.fromkeys(task for one in of_base.values() for task in one.protocols)
    bases = [(task, base) for task in tasks for base in of_base]
    yardsticks = {name: settings[name] for name in ("yardstick", "yardstick_task_2")}
    report.write(accuracy / "README.md", "strain", bases=bases, absent=absent, **yardsticks)
    report.write(target / "speed" / "table1_times.md", "strain_times", machines=machines(report))
    panels = {plain(task): (task, task) for task in settings["protocols"]}
    experiment.write_speed(report, target, settings, panels, ("error", "Error (mm)"), TRANSFER_COSTS)


def machines(report: Report) -> dict[str, str]:
    """Return protocol -> the class of machine whose trainings the table of times is of, see `shards.read`."""
    if report.of_look:
        return dict.fromkeys(report.protocols, processor())
    runs = shards.trainings(report.workspace)
    runs = runs[runs["experiment"] == report.experiment]
    return {protocol: shards.timed_on(runs[runs["protocol"] == protocol]) for protocol in report.protocols}


def score_table(report: Report) -> pd.DataFrame:
    """Return one row per protocol, condition, model and metric that was scored, in full precision."""
    places = [(*place, metric) for place, metrics in report.scored().items() for metric in metrics]
    return report.scores((p, c, model, metric) for p, c, metric in places for model in report.models)


def draw_task(report: Report, folder: Path, task: str) -> None:
    """Draw figure 5 or 6 of direct training, the readings' drift of task 1, and the task's part of figure 8."""
    rows, caption = report.drawn(task), report.caption(task)
    rows = rows[rows["window"] != kept.WHOLE].sort_values("window", kind="stable")
    label = rows[rows["model"] == kept.LABEL]
    if label.empty:
        return
    time_s, since = label["t_s"].to_numpy(), "Time since the start of the test part (s)"
    volts, shown = np.stack(label["v"]), time_s <= kept.SHOWN_S
    truth = np.stack(label["place_mm"])[shown]
    guesses = {
        model: np.stack(rows["place_mm"][rows["model"] == model])
        for model in ("lstm_direct", "lstm_transfer")
        if (rows["model"] == model).any()
    }
    axes = strain_experiment.task(task, report.settings).outputs
    outputs = [k for k in range(len(axes)) if all(np.isfinite(guess[:, k]).all() for guess in guesses.values())]
    seen = volts[shown] - volts[shown].mean(axis=0)
    readings = [common.Course("Voltage, mean\nremoved (V)", time_s[shown], None, {}, readings=seen)]

    def of(models: tuple[str, ...]) -> list[common.Course]:
        return [
            common.Course(f"{AXES[axes[k]]} (mm)", time_s[shown], truth[:, k], {m: guesses[m][:, k] for m in models})
            for k in outputs
        ]

    if "lstm_direct" in guesses and outputs:
        name = FIGURES[task]
        title = f"Figure {name.removeprefix('figure')}: direct training\n{caption}"
        common.courses(folder / f"{name}.png", title, readings + of(("lstm_direct",)), since)
    if task == "task_1":
        thinned = (label["window"] - label["window"].iloc[0]).to_numpy() % kept.THINNED == 0
        title = f"Readings of the strands, {caption.partition(', ')[2]}"
        figures.drifting(folder / "figure5_drift.png", title, time_s[thinned], volts[thinned])
    if outputs:
        title = f"Figure 8: direct training and transfer\n{caption}"
        common.courses(folder / f"figure8_{task}.png", title, of(tuple(guesses)), since)


def draw_time(report: Report, path: Path) -> None:
    """Draw the errors of TIMED in tenths of the test part, which begins where training ended."""
    panels, captions = {}, []
    for task in FIGURES:
        rows = report.drawn(task)
        rows = rows[(rows["window"] == kept.WHOLE) & rows["model"].isin(set(TIMED) & set(report.models))]
        if len(rows):
            captions.append(report.caption(task))
            panels[plain(task)] = [
                curves.line(model, {at: [error] for at, error in zip(own["t_s"] / 60, own["error"], strict=True)})
                for model, own in rows.groupby("model", observed=True, sort=False)
            ]
    if panels:
        title = f"Error against time since training ended\n{captions[0].rpartition(', ')[0]}"
        names = ("Time since training ended (min)", "Error (mm) in a tenth of the test part")
        curves.curves(path, panels, title, names, LOG, ticks=range(0, 21, 5))


def draw_studies(folder: Path, report: Report, studies: Mapping[str, pd.DataFrame]) -> None:
    """Draw samples.png, capacity.png, strands.png and drift.png, of the studies that there are."""
    for name, column, title, xlabel in (
        ("samples", "samples", "Fewer samples: error against the size of the training set", "Training samples"),
        ("capacity", "units", "Capacity: error of direct training against the size of the LSTM", "Units of the LSTM"),
        ("strands", "strands", "Strands: error against how many of them all models see", "Strands"),
    ):
        if name not in studies:
            continue
        table, panels = studies[name], {}
        table = table if "model" in table else table.assign(model="lstm_direct")
        ticks = sorted(table[column].unique())
        for task, runs in table.groupby("protocol", sort=False):
            lines = [
                curves.line(model, {x: part["value"] for x, part in group.groupby(column)})
                for model, group in runs.groupby("model", sort=False)
            ]
            if "constant" in report.models:
                floor = [report.estimate(task, task, "constant", "error").mean]
                lines.append(curves.line("constant", dict.fromkeys(ticks, floor), marker=""))
            panels[plain(task)] = lines
        curves.curves(folder / f"{name}.png", panels, title, (xlabel, ERROR), LOG, log=True, ticks=ticks)
    if "drift" not in studies:
        return
    decoders: dict[str, dict[str, dict[str, pd.Series]]] = {}
    grouped = studies["drift"].groupby(["protocol", "target", "input"], sort=False)["value"]
    for (task, target, seen), values in sorted(grouped, key=lambda part: not part[0][2].startswith("raw")):
        decoders.setdefault(plain(task), {}).setdefault(target, {})[seen] = values
    title = "Is the latent space free of drift? (0: nothing can be read, 1: everything)"
    curves.bars(folder / "drift.png", decoders, title, "R2 of a linear decoder,\nheld-out blocks", (LEAST_R2, 1.05))
    rows = [
        (f"{task}: {SEEN.get(seen, 'voltages')}", values.clip(lower=0).to_list())  # less than the mean tells is nothing
        for task, of_task in decoders.items()
        for seen, values in of_task["true drift"].items()
        if seen in SEEN or seen.startswith("raw")
    ]
    answers.bars(
        folder / answers.FILE, "How much of the drift can be read (1: all of it)", "R2 of a linear model", rows, 1.05
    )
