"""Text and tables of the stability tests: where each model fails, and which trainings failed.

A model fails at the first severity at which its error, the mean over the seeds, is above twice its clean error, or
above that of the model `constant` under the same perturbation. Where the perturbation changes the truth itself, such
as presses twice as hard, the twofold is of the clean error times the growth of the constant model's error. The clean
error is that at severity 0; a perturbation without unperturbed version has its first level as reference. Severities
are walked from the smallest change, whatever its sign, to the largest.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
import pandas as pd

from pipeline.base import paths
from pipeline.base.errors import InputError
from pipeline.reporting import markdown
from pipeline.reporting.labels import model_name
from pipeline.scoring import results

FLOOR = "constant"
TIMES = 2.0  # the clean error: beyond, a model has failed
# Experiment -> the metric of stress.csv that stands for the error, the name of the error, and its unit.
ERRORS = {
    "touch": ("rmse", "RMSE", "kPa"),
    "velostat_recorded": ("rmse", "RMSE", "N"),
    "strain": ("error", "Error", "mm"),
    "strain_recorded": ("error", "Error", "mm"),
    "glove": ("accuracy", "1 - accuracy", "1"),
    "glove_recorded": ("accuracy", "1 - accuracy", "1"),
}
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
    "peak_pressure": ("factor less 1", "all pressures times 1 + severity"),
    "press_speed": ("log2 of the factor", "presses faster or slower by 2 to the severity"),
    "tip_radius": ("change in mm", "change of the tip's radius in mm; the labels go with it"),
    "touches": ("touches at once", "touches at once"),
    "distance": ("mm", "distance in mm between two touches"),
    "time": ("minutes", "age of the samples in minutes since the start of the test part; nothing is perturbed"),
    "rate": ("log2 of the factor", "sampling rate changed by 2 to the severity"),
    "speed": ("log2 of the factor", "motion faster or slower by 2 to the severity"),
    "half": ("dead elements", "as dead, but only from the middle of the test part on"),
    "shift": ("mm", "the object lies nearer to the fingers by so many mm"),
    "turn": ("degrees", "the object lies turned on the palm by so many degrees"),
    "grip": ("log2 of the factor", "margin of the grip over the slip force times 2 to the severity"),
}
UNNAMED = ("severity", "see params.yaml")
FAILURES = ("experiment", "protocol", "condition", "perturbation", "model", "fails_at", "step", "clean", "error")
FAILURES += ("verdict", "last_severity", "last_error")
TRAININGS = ("experiment", "model", "runs", "diverged", "no_usable_epoch", "scores", "nan", "worse_than_constant")
HOLDS, FAILED = "holds", "failed in training"


class Verdict(NamedTuple):
    """Where one model fails: severity and its place in the walk, NaN if nowhere; clean, error: before, and there."""

    severity: float
    step: float
    clean: float
    error: float
    reason: str


def read(experiment: str, settings: Mapping, stress: Mapping) -> pd.DataFrame:
    """stress.csv as protocol, condition, perturbation, severity, model, seed, error; one row a run.

    settings, stress: the experiment's blocks of params.yaml. Raises InputError for a missing or repeated row: every
    model, seed and severity of params.yaml has one in each condition.
    """
    made_by, path = f"python -m pipeline.stages.stress {experiment}", paths.stress(experiment)
    metric = ERRORS[experiment][0]
    key = ["protocol", "condition", "perturbation", "severity", "model", "seed"]
    table = results.read_csv(path, [*key, "metric", "value"], made_by)
    table = table[table["metric"] == metric]
    repeated = table[table.duplicated(key)]
    if len(repeated):
        row = ", ".join(str(value) for value in repeated.iloc[0][key])
        raise InputError(f"{results.shown(path)}: two rows for {row}; run `{made_by}` again")
    levels = table[["protocol", "condition", "perturbation", "severity"]].drop_duplicates()
    present = set(table[key].itertuples(index=False, name=None))
    for protocol in stress["protocols"]:
        own = levels[levels["protocol"] == protocol]
        if own.empty:
            raise InputError(f"{results.shown(path)}: no row for protocol {protocol}; run `{made_by}` again")
        for level in own.itertuples(index=False, name=None):
            for model in settings["models"]:
                for seed in stress.get("seeds", settings["protocols"][protocol]["seeds"]):
                    if (*level, model, seed) not in present:
                        row = ", ".join(map(str, (*level, model)))
                        raise InputError(f"{results.shown(path)}: no row for {row}, seed {seed}; run `{made_by}` again")
    error = 1 - table["value"] if metric == "accuracy" else table["value"]
    return table[key].assign(error=error).reset_index(drop=True)


class Level(NamedTuple):
    """Errors of the seeds at one severity: mean, lowest and highest of those that did not fail, and how many did."""

    mean: float
    low: float
    high: float
    runs: int
    failed: int


def level(errors: Sequence[float]) -> Level:
    """One error a seed; a run failed where it is not finite."""
    errors = np.asarray(errors, dtype=float)
    good = errors[np.isfinite(errors)]
    if not len(good):
        return Level(np.nan, np.nan, np.nan, 0, len(errors))
    return Level(float(good.mean()), float(good.min()), float(good.max()), len(good), len(errors) - len(good))


def walked(severities: Sequence[float]) -> list[float]:
    """In the order in which a model is led to its failure: from 0 outwards, or as listed where there is no 0."""
    listed = list(dict.fromkeys(severities))
    return sorted(listed, key=lambda value: (abs(value), value)) if 0 in listed else listed


def curves(table: pd.DataFrame) -> dict[tuple, dict[str, dict[float, Level]]]:
    """(protocol, condition, perturbation) -> model -> severity -> errors of the seeds, severities as walked."""
    found = {}
    for place, rows in table.groupby(["protocol", "condition", "perturbation"], sort=False):
        order = walked(rows["severity"])
        grouped = {key: level(values) for key, values in rows.groupby(["model", "severity"])["error"]}
        found[place] = {model: {one: grouped[model, one] for one in order} for model in rows["model"].unique()}
    return found


def verdict(own: Mapping[float, Level], floor: Mapping[float, Level] | None) -> Verdict:
    """Where a model with the errors `own` fails; floor: those of `constant`, if it is among the models."""
    first = next(iter(own))
    clean = own[first].mean
    if not all(np.isfinite(one.mean) and not one.failed for one in own.values()):
        return Verdict(np.nan, np.nan, clean, np.nan, FAILED)
    for step, (severity, found) in enumerate(own.items()):
        growth = max(1.0, floor[severity].mean / floor[first].mean) if floor and floor[first].mean > 0 else 1.0
        if floor and found.mean > floor[severity].mean:
            return Verdict(severity, step, clean, found.mean, "worse than constant")
        if found.mean > TIMES * clean * growth:
            return Verdict(severity, step, clean, found.mean, "above twice its clean error")
    return Verdict(np.nan, np.nan, clean, found.mean, HOLDS)


def failures(table: pd.DataFrame, experiment: str) -> pd.DataFrame:
    """One row for every condition, perturbation and model but `constant`: where it fails, and why."""
    found = []
    for (protocol, condition, perturbation), models in curves(table).items():
        for model, own in models.items():
            if model != FLOOR:
                judged = verdict(own, models.get(FLOOR))
                found.append(
                    (
                        experiment,
                        protocol,
                        condition,
                        perturbation,
                        model,
                        *judged,
                        list(own)[-1],
                        list(own.values())[-1].mean,
                    )
                )
    return pd.DataFrame(found, columns=FAILURES)


def panels(table: pd.DataFrame, experiment: str) -> list[tuple[str, str, list]]:
    """(file name, title, panels) of each figure of an experiment: one a protocol and group of conditions."""
    figures: dict[tuple, list] = {}
    for (protocol, condition, perturbation), models in curves(table).items():
        group = JOINED.get(condition, condition)
        name = perturbation.replace("_", " ") + (f", {condition.replace('_', ' ')}" if group != condition else "")
        panel = (name, SEVERITIES.get(perturbation, UNNAMED)[0], models)
        figures.setdefault((protocol, group), []).append(panel)
    found = []
    for (protocol, group), own in figures.items():
        title = heading(experiment, protocol, group)
        found.append(("_".join([experiment, *words(protocol, group)]) + ".png", title, own))
    return found


def cell(row) -> str:
    """How the tables show one row of `failures`."""
    if row.verdict in (HOLDS, FAILED):
        return row.verdict
    return f"{row.fails_at:g}" + (" (floor)" if row.verdict == "worse than constant" else "")


def failure_text(found: pd.DataFrame) -> str:
    """failures.md: a table for every experiment and condition; a row a perturbation, a column a model."""
    parts = [
        "# Where the models fail\n",
        "The first severity at which a model's error is above twice its clean error, or worse than that of the "
        "constant model (floor); 0 (floor): no better than the constant model before anything is perturbed.\n",
    ]
    for (experiment, protocol, condition), rows in found.groupby(["experiment", "protocol", "condition"], sort=False):
        models = list(dict.fromkeys(rows["model"]))
        lines = []
        for perturbation, own in rows.groupby("perturbation", sort=False):
            cells = {row.model: cell(row) for row in own.itertuples()}
            lines.append([perturbation, *(cells[model] for model in models)])
        parts.append(f"## {heading(experiment, protocol, condition)}\n")
        parts.append(markdown.table(["perturbation", *(model_name(model) for model in models)], lines))
    parts.append("## Severities\n")
    known = {name: SEVERITIES.get(name, UNNAMED)[1] for name in found["perturbation"].unique()}
    parts.append("\n".join(f"- `{name}`: {meaning}" for name, meaning in known.items()) + "\n")
    return "\n".join(parts)


def heading(experiment: str, protocol: str, condition: str) -> str:
    """What an experiment's protocol and condition are called in headings."""
    return f"{experiment}: " + ", ".join(word.replace("_", " ") for word in words(protocol, condition))


def words(protocol: str, condition: str) -> list[str]:
    """Protocol and condition; the protocol alone where it says the condition, too."""
    return [protocol] if condition in ("all", protocol) or protocol.endswith(f"_{condition}") else [protocol, condition]


def training_failures(experiment: str, settings: Mapping) -> pd.DataFrame:
    """One row a model: its runs, those that diverged or left no usable weights, scores that are missing or too bad.

    A score is the error of one protocol, condition and seed on clean test data; worse than constant: than that model.
    """
    scores, metric = results.Scores(experiment, settings), ERRORS[experiment][0]
    measured = [(protocol, condition) for protocol, condition, name in scores.measured() if name == metric]
    sign = -1 if metric == "accuracy" else 1
    found = []
    for model in settings["models"]:
        fits = [
            results.read_fit(experiment, model, protocol, seed)
            for protocol, block in settings["protocols"].items()
            for seed in block["seeds"]
        ]
        own = np.concatenate([scores.runs(*place, model, metric) for place in measured])
        worse = 0
        if FLOOR in settings["models"]:
            floor = np.concatenate([scores.runs(*place, FLOOR, metric) for place in measured])
            worse = int((sign * own > sign * floor).sum())
        diverged = sum(fit.stop_reason == "diverged" for fit in fits)
        unusable = sum(fit.best_epoch == 0 for fit in fits)
        row = (experiment, model, len(fits), diverged, unusable, len(own), int(np.isnan(own).sum()), worse)
        found.append(row)
    return pd.DataFrame(found, columns=TRAININGS)


def training_text(found: pd.DataFrame) -> str:
    """training.md: the table of training failures."""
    header = ["experiment", "model", "runs", "diverged", "no usable epoch", "scores", "NaN", "worse than constant"]
    lines = [[row[0], model_name(row[1]), *map(str, row[2:])] for row in found.itertuples(index=False, name=None)]
    return (
        "# Trainings that failed\n\nRuns: protocols times seeds. Scores: the error of every run in every condition of "
        "its clean test data.\n\n" + markdown.table(header, lines)
    )


def findings(found: pd.DataFrame, trained: pd.DataFrame, pictures: Mapping[str, Sequence[str]], absent: Mapping) -> str:
    """README.md: who fails first and last under each perturbation.

    pictures: experiment -> names of its figures; absent: experiment -> why it was not run.
    """
    parts = [
        "# Stability: trained models where methods fail\n",
        "Every model as it was trained, on test data that is perturbed step by step. It fails at the first severity at "
        "which its error is above twice its clean error or worse than the constant model's; severities are explained "
        "in [failures.md](failures.md). The rule compares a model with itself: one that is not much better than the "
        "constant model on clean data has little to lose, so who is best under stress is named, too. "
        "[Trainings that failed](training.md).\n",
    ]
    for experiment in dict.fromkeys([*found["experiment"], *absent]):
        if experiment in absent:
            parts.append(f"## {experiment}: not run\n\n{absent[experiment]}.\n")
            continue
        rows = found[found["experiment"] == experiment]
        for (protocol, condition), own in rows.groupby(["protocol", "condition"], sort=False):
            parts.append(f"## {heading(experiment, protocol, condition)}\n")
            parts.append("\n".join(f"- {line}" for line in sentences(own)) + "\n")
        links = ", ".join(f"[{name}]({name})" for name in pictures[experiment])
        parts.append(f"Figures: {links}\n")
    parts.append("## Training\n")
    runs, diverged, unusable = (int(trained[name].sum()) for name in ("runs", "diverged", "no_usable_epoch"))
    worse, scores = int(trained["worse_than_constant"].sum()), int(trained["scores"].sum())
    by = trained.groupby(["experiment", "model"], sort=False)["worse_than_constant"].sum()
    most = by.idxmax() if worse else None
    text = f"- {diverged} of {runs} runs diverged, {unusable} left no usable weights.\n"
    text += f"- {worse} of {scores} clean scores are worse than the constant model's"
    text += f", most of {model_name(most[1])} in {most[0]} ({by[most]}).\n" if most else ".\n"
    parts.append(text)
    return "\n".join(parts)


def sentences(own: pd.DataFrame) -> list[str]:
    """Of one condition: models that are bad before, how much each holds, and who fails first and last."""
    lines = []
    broken = own[own["verdict"] == FAILED]["model"].unique()
    if len(broken):
        lines.append(f"Failed in training, not judged: {names(broken)}.")
    bad = [model for model, rows in own.groupby("model", sort=False) if (rows["step"] == 0).all()]
    if bad:
        lines.append(f"No better than a constant before anything is perturbed, not judged: {names(bad)}.")
    own = own[~own["model"].isin([*broken, *bad])]
    if own.empty:
        return lines
    held = own.groupby("model", sort=False)["verdict"].agg(lambda verdicts: int((verdicts == HOLDS).sum()))
    total = own["perturbation"].nunique()
    if total > 1:
        most, least = (held[held == value].index for value in (held.max(), held.min()))
        lines.append(
            f"Of {total} perturbations, {names(most)} {verb(most, 'holds', 'hold')} the most to the end "
            f"({held.max()}), {names(least)} the fewest ({held.min()})."
        )
    for perturbation, rows in own.groupby("perturbation", sort=False):
        lines.append(f"`{perturbation}`: {one_perturbation(rows)}")
    return lines


def one_perturbation(rows: pd.DataFrame) -> str:
    """Who fails first and who last, of one perturbation in one condition, and who is best at its last severity."""
    last, failed, holding = rows["last_severity"].iloc[0], rows[rows["step"].notna()], rows[rows["step"].isna()]
    best = rows.loc[rows["last_error"].idxmin()]
    _, error, unit = ERRORS[best["experiment"]]
    value = f"{best['last_error']:.3g}" + ("" if unit == "1" else f" {unit}")
    lowest = f"lowest {error if error.isupper() else error.lower()} at {last:g}: {names([best['model']])} ({value})."
    if failed.empty:
        return f"all hold up to {last:g}; {lowest}"
    first, latest = (failed[failed["step"] == step] for step in (failed["step"].min(), failed["step"].max()))
    at = {number: own["fails_at"].iloc[0] for number, own in enumerate((first, latest))}
    if len(first) == len(rows):
        return f"all fail at {at[0]:g}; {lowest}"
    text = f"first {names(first['model'])} ({at[0]:g})"
    if len(holding):
        return f"{text}; {names(holding['model'])} {verb(holding, 'holds', 'hold')} up to {last:g}; {lowest}"
    return f"{text}; last {names(latest['model'])} ({at[1]:g}); {lowest}"


def names(models: Sequence[str]) -> str:
    """The models as the figures call them; some names have commas in them."""
    return " / ".join(model_name(model) for model in models)


def verb(models: Sequence[str], one: str, several: str) -> str:
    """The form that goes with the number of models."""
    return one if len(models) == 1 else several
