"""Write the stability tests for people, in reports/stability: where each model fails, and which trainings failed.

The rules are in pipeline/reporting/verdicts/stability.py.
"""

import shutil
from collections.abc import Mapping, Sequence
from pathlib import Path

import pandas as pd

from pipeline.base import files
from pipeline.base.availability import why_not_run
from pipeline.base.errors import InputError
from pipeline.base.paths import Workspace
from pipeline.reporting.figures import stability as stability_figures
from pipeline.reporting.sentences import best, caption, figure_lines, one_run, some
from pipeline.reporting.verdicts import stability as stability_verdicts
from pipeline.reporting.verdicts.stability import ERRORS, FAILED, FAILURES, HOLDS, TRAININGS
from pipeline.reporting.words.labels import (
    capitalised,
    condition_name,
    experiment_name,
    model_name,
    perturbation_name,
)
from pipeline.scoring.kept import kept_rows

# Conditions that are drawn in the figure of another one.
JOINED = {"single_anew": "single", "several": "double"}
# Perturbation -> what its severity is, for an axis and for a list.
SEVERITIES = {
    "noise": ("share of the range", "white noise; standard deviation as share of the sensor's range"),
    "gain_drift": ("spread of log gain", "each element's response scaled; standard deviation of the log of the factor"),
    "offset_drift": ("share of the range", "each element shifted; standard deviation as share of the sensor's range"),
    "dead": (
        "number of elements",
        "elements that read the lowest value; strands of strain come loose and read the supply",
    ),
    "stuck": ("number of elements", "elements that repeat one old reading"),
    "dead_line": ("number of rows or columns", "rows or columns that read the lowest value"),
    "lost_frames": ("share of frames", "share of frames lost; the one before is repeated"),
    "jitter": ("frames", "frames taken early or late; standard deviation in frames"),
    "specimen": ("other sensor, number", "number of another sensor of the same make"),
    "peak_pressure": ("relative change", "all pressures times 1 + severity"),
    "press_speed": ("factor, as a power of 2", "presses faster or slower by 2 to the severity"),
    "tip_radius": ("change in mm", "change of the tip's radius in mm; the labels go with it"),
    "touches": ("number of touches", "touches at once"),
    "distance": ("mm", "distance in mm between two touches"),
    "time": ("minutes", "age of the samples in minutes since the start of the test part; nothing is perturbed"),
    "rate": ("factor, as a power of 2", "sampling rate changed by 2 to the severity"),
    "speed": ("factor, as a power of 2", "motion faster or slower by 2 to the severity"),
    "half": ("number of elements", "as dead elements, but only from the middle of the test part on"),
    "shift": ("mm", "the object lies nearer to the fingers by so many mm"),
    "turn": ("degrees", "the object lies turned on the palm by so many degrees"),
    "grip": ("factor, as a power of 2", "margin of the grip over the slip force times 2 to the severity"),
}
WRONG = "share of images classified incorrectly"  # the error of an image classifier
UNNAMED = ("severity", "see params.yaml")


def write(workspace: Workspace, values: Mapping, folder: Path, former: Path) -> None:
    """Write figures, tables and texts of all experiments of the settings (`values`) into the empty `folder`.

    former: the folder that is replaced; of experiments that were not run, what it holds is kept.
    """
    failures, trainings, pictures, absent = [], [], {}, {}
    not_run = {name: reason for name in values["experiments"] if (reason := why_not_run(workspace, name))}
    kept = {name: kept_rows(former / f"{name}.csv", not_run) for name in ("failures", "training")}
    for experiment in values["experiments"]:
        if experiment in not_run:
            judged, trained = (table[table["experiment"] == experiment] for table in kept.values())
            if judged.empty:
                absent[experiment] = not_run[experiment][0].upper() + not_run[experiment][1:]
                continue
            failures.append(judged)
            trainings.append(trained)
            pictures[experiment] = kept_figures(former, folder, experiment, judged)
            continue
        if experiment not in values["stress"]:
            raise InputError(f"params.yaml, stress: there is no block '{experiment}'; add one")
        settings = values[experiment]
        table = stability_verdicts.read(workspace, experiment, settings, values["stress"][experiment])
        judged = stability_verdicts.failures(table, experiment, values["stress"][experiment]["usable"])
        failures.append(judged)
        trainings.append(stability_verdicts.training_failures(workspace, experiment, settings))
        _, error, unit = ERRORS[experiment]
        ylabel = WRONG.capitalize() if unit == "1" else f"{error} ({unit})"
        captions = {}
        for name, title, panels_of_figure in panels(table, experiment):
            stability_figures.small_multiples(folder / name, panels_of_figure, in_a_sentence(title), ylabel)
            captions[name] = curves_caption(judged[grouped(judged) == name], title)
        for place, rows in judged.groupby(["protocol", "condition"], sort=False):
            name, title = "_".join([experiment, *words(*place), "heat_map"]) + ".png", heading(experiment, *place)
            if stability_figures.heat_map(folder / name, rows, in_a_sentence(title)):
                captions[name] = heat_map_caption(rows, title)
        pictures[experiment] = {name.removesuffix(".png"): text for name, text in captions.items()}
    judged = pd.concat(failures, ignore_index=True) if failures else pd.DataFrame(columns=FAILURES)
    trained = pd.concat(trainings, ignore_index=True) if trainings else pd.DataFrame(columns=TRAININGS)
    files.write_table(folder / "failures.csv", judged)
    files.write_table(folder / "training.csv", trained)
    files.write_text(folder / "README.md", findings(judged, trained, pictures, absent))


def kept_figures(former: Path, folder: Path, experiment: str, judged: pd.DataFrame) -> dict[str, str]:
    """Copy the figures of an experiment from folder to folder, and return their captions as `findings` takes them.

    judged: its rows of FAILURES.
    """
    curves, maps = {}, {}
    for place, rows in judged.groupby(["protocol", "condition"], sort=False):
        name, title = curves_file(experiment, *place), heading(experiment, *place)
        curves[name.removesuffix(".png")] = curves_caption(rows, title)
        maps[name.removesuffix(".png") + "_heat_map"] = heat_map_caption(rows, title)
    captions = {name: text for name, text in (curves | maps).items() if (former / f"{name}.png").is_file()}
    for name in captions:
        shutil.copy(former / f"{name}.png", folder)
    return captions


def panels(table: pd.DataFrame, experiment: str) -> list[tuple[str, str, list]]:
    """Return (file name, title, panels) of each figure: one figure per protocol and group of conditions."""
    figures: dict[tuple, list] = {}
    for (protocol, condition, perturbation), models in stability_verdicts.curves(table).items():
        group = JOINED.get(condition, condition)
        where = f", {condition_name(experiment, protocol, condition)}" if group != condition else ""
        panel = (capitalised(perturbation_name(perturbation) + where), SEVERITIES.get(perturbation, UNNAMED)[0], models)
        figures.setdefault((protocol, group), []).append(panel)
    return [(curves_file(experiment, *place), heading(experiment, *place), drawn) for place, drawn in figures.items()]


def curves_file(experiment: str, protocol: str, condition: str) -> str:
    """Return the file of the figure in which a condition's curves are drawn."""
    return "_".join([experiment, *words(protocol, JOINED.get(condition, condition))]) + ".png"


def grouped(judged: pd.DataFrame) -> pd.Series:
    """Return the file that each row of FAILURES is drawn in."""
    places = zip(judged["experiment"], judged["protocol"], judged["condition"], strict=True)
    return pd.Series([curves_file(*place) for place in places], index=judged.index)


def heat_map_caption(judged: pd.DataFrame, title: str) -> str:
    """Return the caption of the heat map of one condition; judged: its rows of FAILURES."""
    relative = one_run(dict(stability_verdicts.ranking(judged)))
    under = judged["perturbation"].nunique()
    perturbations = f"{under} {'perturbation' if under == 1 else 'perturbations'}"
    lowest = best(relative, f"mean error under {perturbations}", "times the constant model's")
    return caption(f"{in_a_sentence(title)}: {lowest}")


def in_a_sentence(title: str) -> str:
    """Return a heading as the start of a caption or title, which has a colon of its own."""
    return title.replace(": ", ", ", 1)


def curves_caption(judged: pd.DataFrame, title: str) -> str:
    """Return the caption of the curves of one figure, by how many perturbations each model withstands.

    judged: rows of FAILURES of all conditions that are drawn in it.
    """
    sound = judged[judged["verdict"] != FAILED]
    if sound.empty:
        return caption(f"{in_a_sentence(title)}: every model failed in training")
    return caption(f"{in_a_sentence(title)}: {survival(sound)}")


def survival(sound: pd.DataFrame) -> str:
    """Say which models stay usable up to the last severity under the most perturbations, and which under the fewest."""
    held = sound.groupby("model", sort=False)["verdict"].agg(lambda verdicts: int((verdicts == HOLDS).sum()))
    total = len(sound[["condition", "perturbation"]].drop_duplicates())
    most, least = held.max(), held.min()
    if most == 0:
        return f"no model stays usable up to the last severity of any perturbation ({total})"
    if most == least:
        whose = "the model stays" if len(held) == 1 else f"all {len(held)} models stay"
        return f"{whose} usable up to the last severity under {most} of {total} perturbations"
    first, last = (list(held[held == value].index) for value in (most, least))
    return (
        f"{some(first)} {stay(first)} usable up to the last severity under {most} of {total} perturbations, the most; "
        f"{some(last)} under {least}, the fewest"
    )


def error_text(experiment: str, value: float) -> str:
    """Return an error with its unit."""
    _, _, unit = ERRORS[experiment]
    return f"{100 * value:.3g} %" if unit == "1" else f"{value:.3g} {unit}"


def heading(experiment: str, protocol: str, condition: str) -> str:
    """Return the heading of one protocol and condition of an experiment."""
    return f"{experiment_name(experiment)}: {condition_name(experiment, protocol, condition)}"


def words(protocol: str, condition: str) -> list[str]:
    """Return protocol and condition for a file's name; the protocol alone where it says the condition, too."""
    return [protocol] if condition in ("all", protocol) or protocol.endswith(f"_{condition}") else [protocol, condition]


def findings(
    failures: pd.DataFrame,
    trainings: pd.DataFrame,
    pictures: Mapping[str, Mapping[str, str]],
    absent: Mapping[str, str],
) -> str:
    """Return README.md: which models fail first and last under each perturbation.

    pictures: experiment -> name of a figure's file without .png -> caption; absent: experiment -> why it was not run.
    """
    parts = [
        "# Stability: trained models where methods fail\n",
        "Every model as it was trained, on test data that is perturbed step by step. Models are ranked by their "
        "relative error: the error over the constant model's under the same perturbation, mean over severities and "
        "perturbations; 1 is no better than the constant model. A model fails at the first severity at which its error "
        "is above what is usable (`stress` of params.yaml: a value in kPa, N, mm or share of images that a user would "
        "set) or worse than the constant model's. All errors by severity: [failures.csv](failures.csv); trainings that "
        "failed: [training.csv](training.csv).\n",
    ]
    for experiment in dict.fromkeys([*failures["experiment"], *absent]):
        if experiment in absent:
            parts.append(f"## {experiment_name(experiment)}: not run\n\n{absent[experiment]}.\n")
            continue
        rows = failures[failures["experiment"] == experiment]
        for (protocol, condition), judged in rows.groupby(["protocol", "condition"], sort=False):
            parts.append(f"## {heading(experiment, protocol, condition)}\n")
            parts.append("\n".join(f"- {line}" for line in sentences(judged)) + "\n")
        parts.append("\n".join(figure_lines(pictures[experiment])) + "\n")
    total = trainings[["runs", "diverged", "no_usable_epoch", "scores", "worse_than_constant"]].sum().astype(int)
    text = f"- {total.diverged} of {total.runs} runs diverged, {total.no_usable_epoch} left no usable weights.\n"
    text += f"- {total.worse_than_constant} of {total.scores} clean scores are worse than the constant model's"
    if total.worse_than_constant:
        worst = trainings.loc[trainings["worse_than_constant"].idxmax()]
        where = f"{model_name(worst.model)} in {experiment_name(worst.experiment)}"
        text += f", most of {where} ({worst.worse_than_constant})"
    meanings = {name: SEVERITIES.get(name, UNNAMED)[1] for name in failures["perturbation"].unique()}
    severities = [f"- {capitalised(perturbation_name(name))}: {meaning}." for name, meaning in meanings.items()]
    return "\n".join([*parts, "## Training\n", f"{text}.\n", "## Severities\n", *severities]) + "\n"


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
        lines.append(f"Relative error, the smallest first: {ranked}.")
    sound = judged[~judged["model"].isin([*broken, *bad])]
    if sound.empty:
        return lines
    if sound["perturbation"].nunique() > 1:
        lines.append(f"{capitalised(survival(sound))}.")
    for perturbation, rows in sound.groupby("perturbation", sort=False):
        unit = SEVERITIES.get(perturbation, UNNAMED)[0]
        lines.append(f"{capitalised(perturbation_name(perturbation))} ({unit}): {one_perturbation(rows)}")
    return lines


def one_perturbation(rows: pd.DataFrame) -> str:
    """Say which models fail first and last under one perturbation, and which is best at its last severity."""
    end, failed, holding = rows["last_severity"].iloc[0], rows[rows["step"].notna()], rows[rows["step"].isna()]
    lowest = rows.loc[rows["last_error"].idxmin()]
    experiment, model = lowest["experiment"], lowest["model"]
    _, error, unit = ERRORS[experiment]
    measure = WRONG if unit == "1" else error if error.isupper() else error.lower()
    value = error_text(experiment, lowest["last_error"])
    best_at_end = f"{model_name(model)} has the smallest {measure} at {end:g}, {value}."
    if failed.empty:
        return f"{every(rows)} usable up to {end:g}. {best_at_end}"
    first, last = (failed[failed["step"] == step] for step in (failed["step"].min(), failed["step"].max()))
    start, stop = (group["fails_at"].iloc[0] for group in (first, last))
    if len(first) == len(rows):
        text = f"{names(rows['model'])} fails" if len(rows) == 1 else f"all {len(rows)} models fail"
        return f"{text} at {start:g}. {best_at_end}"
    text = f"{names(first['model'])} {fail(first)} first, at {start:g}"
    if len(holding):
        return f"{text}; {names(holding['model'])} {stay(holding)} usable up to {end:g}. {best_at_end}"
    return f"{text}; {names(last['model'])} {fail(last)} last, at {stop:g}. {best_at_end}"


def every(rows: pd.DataFrame) -> str:
    """Return the subject and verb of what all models of some rows do."""
    return f"{names(rows['model'])} stays" if len(rows) == 1 else f"all {len(rows)} models stay"


def names(models: Sequence[str]) -> str:
    """Return the models as the figures call them, between slashes: some names have commas."""
    return " / ".join(map(model_name, models))


def stay(models: Sequence) -> str:
    """Return the form of `stay` that goes with the number of models."""
    return "stays" if len(models) == 1 else "stay"


def fail(models: Sequence) -> str:
    """Return the form of `fail` that goes with the number of models."""
    return "fails" if len(models) == 1 else "fail"
