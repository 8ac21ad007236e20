"""Write the stability tests for people, in reports/stability: where each model fails, and which trainings failed.

The rules are in pipeline/reporting/verdicts/stability.py.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path

import pandas as pd

from pipeline.base import files
from pipeline.base.availability import why_not_run
from pipeline.base.errors import InputError
from pipeline.reporting.figures import stability as stability_figures
from pipeline.reporting.verdicts import stability as stability_verdicts
from pipeline.reporting.verdicts.stability import ERRORS, FAILED, FAILURES, HOLDS, TRAININGS, WORSE
from pipeline.reporting.words import markdown
from pipeline.reporting.words.labels import model_name

# Conditions that are drawn in the figure of another one.
JOINED = {"single_anew": "single", "several": "double"}
# Perturbation -> what its severity is, for an axis and for a list.
SEVERITIES = {
    "noise": ("share of the range", "white noise; standard deviation as share of the sensor's range"),
    "gain_drift": ("spread of log gain", "each element's response scaled; standard deviation of the log of the factor"),
    "offset_drift": ("share of the range", "each element shifted; standard deviation as share of the sensor's range"),
    "dead": ("dead elements", "elements that read the lowest value; strands of strain come loose and read the supply"),
    "stuck": ("stuck elements", "elements that repeat one old reading"),
    "dead_line": ("dead rows or columns", "rows or columns that read the lowest value"),
    "lost_frames": ("share of frames", "share of frames lost; the one before is repeated"),
    "jitter": ("frames", "frames taken early or late; standard deviation in frames"),
    "specimen": ("other sensor, number", "number of another sensor of the same make"),
    "peak_pressure": ("relative change", "all pressures times 1 + severity"),
    "press_speed": ("factor, as a power of 2", "presses faster or slower by 2 to the severity"),
    "tip_radius": ("change in mm", "change of the tip's radius in mm; the labels go with it"),
    "touches": ("touches at once", "touches at once"),
    "distance": ("mm", "distance in mm between two touches"),
    "time": ("minutes", "age of the samples in minutes since the start of the test part; nothing is perturbed"),
    "rate": ("factor, as a power of 2", "sampling rate changed by 2 to the severity"),
    "speed": ("factor, as a power of 2", "motion faster or slower by 2 to the severity"),
    "half": ("dead elements", "as dead, but only from the middle of the test part on"),
    "shift": ("mm", "the object lies nearer to the fingers by so many mm"),
    "turn": ("degrees", "the object lies turned on the palm by so many degrees"),
    "grip": ("factor, as a power of 2", "margin of the grip over the slip force times 2 to the severity"),
}
UNNAMED = ("severity", "see params.yaml")


def write(values: Mapping, folder: Path) -> None:
    """Write figures, tables and texts of all experiments of params.yaml (`values`) into the empty `folder`."""
    failures, trainings, pictures, absent = [], [], {}, {}
    for experiment in values["experiments"]:
        if reason := why_not_run(experiment):
            absent[experiment] = reason[0].upper() + reason[1:]
            continue
        if experiment not in values["stress"]:
            raise InputError(f"params.yaml, stress: there is no block '{experiment}'; add one")
        settings = values[experiment]
        table = stability_verdicts.read(experiment, settings, values["stress"][experiment])
        judged = stability_verdicts.failures(table, experiment, values["stress"][experiment]["usable"])
        failures.append(judged)
        trainings.append(stability_verdicts.training_failures(experiment, settings))
        _, error, unit = ERRORS[experiment]
        ylabel = error if unit == "1" else f"{error} ({unit})"
        pictures[experiment] = []
        for name, title, panels_of_figure in panels(table, experiment):
            stability_figures.small_multiples(folder / name, panels_of_figure, title, ylabel)
            pictures[experiment].append(name)
        for place, rows in judged.groupby(["protocol", "condition"], sort=False):
            name = "_".join([experiment, *words(*place), "heat_map"]) + ".png"
            if stability_figures.heat_map(folder / name, rows, heading(experiment, *place)):
                pictures[experiment].append(name)
    judged = pd.concat(failures, ignore_index=True) if failures else pd.DataFrame(columns=FAILURES)
    trained = pd.concat(trainings, ignore_index=True) if trainings else pd.DataFrame(columns=TRAININGS)
    files.write_table(folder / "failures.csv", judged)
    files.write_table(folder / "training.csv", trained)
    files.write_text(folder / "README.md", findings(judged, trained, pictures, absent))
    files.write_text(folder / "failures.md", failure_text(judged))
    files.write_text(folder / "training.md", training_text(trained))


def panels(table: pd.DataFrame, experiment: str) -> list[tuple[str, str, list]]:
    """Return (file name, title, panels) of each figure: one figure per protocol and group of conditions."""
    figures: dict[tuple, list] = {}
    for (protocol, condition, perturbation), models in stability_verdicts.curves(table).items():
        group = JOINED.get(condition, condition)
        name = perturbation.replace("_", " ") + (f", {condition.replace('_', ' ')}" if group != condition else "")
        panel = (name, SEVERITIES.get(perturbation, UNNAMED)[0], models)
        figures.setdefault((protocol, group), []).append(panel)
    return [
        ("_".join([experiment, *words(*place)]) + ".png", heading(experiment, *place), drawn)
        for place, drawn in figures.items()
    ]


def cell(row) -> str:
    """Return the table cell of one row of FAILURES."""
    if row.verdict in (HOLDS, FAILED):
        return row.verdict
    return f"{row.fails_at:g}" + (" (worse than constant)" if row.verdict == WORSE else "")


def failure_text(failures: pd.DataFrame) -> str:
    """Return failures.md: a table per experiment and condition, with a row per perturbation and a column per model."""
    parts = [
        "# Where the models fail\n",
        "The first severity at which a model's error is above what is usable (`stress` of params.yaml), or worse than "
        "that of the constant model; 0: so before anything is perturbed. In brackets the relative error: over "
        "that of the constant model, mean over the perturbed severities.\n",
    ]
    for place, rows in failures.groupby(["experiment", "protocol", "condition"], sort=False):
        models = list(dict.fromkeys(rows["model"]))
        lines = []
        for perturbation, judged in rows.groupby("perturbation", sort=False):
            cells = {row.model: f"{cell(row)} [{row.relative:.2f}]" for row in judged.itertuples()}
            lines.append([perturbation, *(cells[model] for model in models)])
        parts.append(f"## {heading(*place)}\n")
        parts.append(markdown.table(["perturbation", *map(model_name, models)], lines))
    parts.append("## Severities\n")
    meanings = {name: SEVERITIES.get(name, UNNAMED)[1] for name in failures["perturbation"].unique()}
    parts.append("\n".join(f"- `{name}`: {meaning}" for name, meaning in meanings.items()) + "\n")
    return "\n".join(parts)


def heading(experiment: str, protocol: str, condition: str) -> str:
    """Return the heading of one protocol and condition of an experiment."""
    return f"{experiment}: " + ", ".join(word.replace("_", " ") for word in words(protocol, condition))


def words(protocol: str, condition: str) -> list[str]:
    """Return protocol and condition; the protocol alone where it says the condition, too."""
    return [protocol] if condition in ("all", protocol) or protocol.endswith(f"_{condition}") else [protocol, condition]


def training_text(trainings: pd.DataFrame) -> str:
    """Return training.md: the table of training failures."""
    header = ["experiment", "model", "runs", "diverged", "no usable epoch", "scores", "NaN", "worse than constant"]
    lines = [[row[0], model_name(row[1]), *map(str, row[2:])] for row in trainings.itertuples(index=False, name=None)]
    return (
        "# Trainings that failed\n\nRuns: protocols times seeds. Scores: the error of every run in every condition of "
        "its clean test data.\n\n" + markdown.table(header, lines)
    )


def findings(
    failures: pd.DataFrame, trainings: pd.DataFrame, pictures: Mapping[str, Sequence[str]], absent: Mapping[str, str]
) -> str:
    """Return README.md: which models fail first and last under each perturbation.

    pictures: experiment -> names of its figures; absent: experiment -> why it was not run.
    """
    parts = [
        "# Stability: trained models where methods fail\n",
        "Every model as it was trained, on test data that is perturbed step by step. Models are ranked by their "
        "relative error: over the constant model's under the same perturbation, mean over severities and "
        "perturbations; 1 is no better than the constant model. A model fails at the first severity at which its error "
        "is above what is usable (`stress` of params.yaml: a value in kPa, N, mm or share of images that a user would "
        "set) or worse than the constant model's; severities are explained in [failures.md](failures.md). "
        "[Trainings that failed](training.md).\n",
    ]
    for experiment in dict.fromkeys([*failures["experiment"], *absent]):
        if experiment in absent:
            parts.append(f"## {experiment}: not run\n\n{absent[experiment]}.\n")
            continue
        rows = failures[failures["experiment"] == experiment]
        for (protocol, condition), judged in rows.groupby(["protocol", "condition"], sort=False):
            parts.append(f"## {heading(experiment, protocol, condition)}\n")
            parts.append("\n".join(f"- {line}" for line in sentences(judged)) + "\n")
        links = ", ".join(f"[{name}]({name})" for name in pictures[experiment])
        parts.append(f"Figures: {links}\n")
    total = trainings[["runs", "diverged", "no_usable_epoch", "scores", "worse_than_constant"]].sum().astype(int)
    text = f"- {total.diverged} of {total.runs} runs diverged, {total.no_usable_epoch} left no usable weights.\n"
    text += f"- {total.worse_than_constant} of {total.scores} clean scores are worse than the constant model's"
    if total.worse_than_constant:
        worst = trainings.loc[trainings["worse_than_constant"].idxmax()]
        text += f", most of {model_name(worst.model)} in {worst.experiment} ({worst.worse_than_constant})"
    return "\n".join([*parts, "## Training\n", f"{text}.\n"])


def sentences(judged: pd.DataFrame) -> list[str]:
    """Say of one condition which models are bad before any perturbation, how long each holds, and who fails first."""
    lines = []
    broken = judged[judged["verdict"] == FAILED]["model"].unique()
    if len(broken):
        lines.append(f"Failed in training, not judged: {names(broken)}.")
    bad = [model for model, rows in judged.groupby("model", sort=False) if (rows["step"] == 0).all()]
    if bad:
        lines.append(f"Not usable, or no better than a constant, before anything is perturbed: {names(bad)}.")
    order = stability_verdicts.ranking(judged)
    if len(order):
        ranked = ", ".join(f"{model_name(model)} {value:.2f}" for model, value in order.items())
        lines.append(f"Relative error, the lowest first: {ranked}.")
    sound = judged[~judged["model"].isin([*broken, *bad])]
    if sound.empty:
        return lines
    held = sound.groupby("model", sort=False)["verdict"].agg(lambda verdicts: int((verdicts == HOLDS).sum()))
    total = sound["perturbation"].nunique()
    if total > 1:
        most, least = (held[held == value].index for value in (held.max(), held.min()))
        lines.append(
            f"Of {total} perturbations, {names(most)} {hold(most)} the most to the end ({held.max()}), "
            f"{names(least)} the fewest ({held.min()})."
        )
    for perturbation, rows in sound.groupby("perturbation", sort=False):
        lines.append(f"`{perturbation}`: {one_perturbation(rows)}")
    return lines


def one_perturbation(rows: pd.DataFrame) -> str:
    """Say which models fail first and last under one perturbation, and which is best at its last severity."""
    end, failed, holding = rows["last_severity"].iloc[0], rows[rows["step"].notna()], rows[rows["step"].isna()]
    best = rows.loc[rows["last_error"].idxmin()]
    _, error, unit = ERRORS[best["experiment"]]
    value = f"{best['last_error']:.3g}" + ("" if unit == "1" else f" {unit}")
    lowest = f"lowest {error if error.isupper() else error.lower()} at {end:g}: {names([best['model']])} ({value})."
    if failed.empty:
        return f"all hold up to {end:g}; {lowest}"
    first, last = (failed[failed["step"] == step] for step in (failed["step"].min(), failed["step"].max()))
    start, stop = (group["fails_at"].iloc[0] for group in (first, last))
    if len(first) == len(rows):
        return f"all fail at {start:g}; {lowest}"
    text = f"first {names(first['model'])} ({start:g})"
    if len(holding):
        return f"{text}; {names(holding['model'])} {hold(holding)} up to {end:g}; {lowest}"
    return f"{text}; last {names(last['model'])} ({stop:g}); {lowest}"


def names(models: Sequence[str]) -> str:
    """Return the models as the figures call them, between slashes: some names have commas."""
    return " / ".join(map(model_name, models))


def hold(models: Sequence) -> str:
    """Return the form of `hold` that goes with the number of models."""
    return "holds" if len(models) == 1 else "hold"
