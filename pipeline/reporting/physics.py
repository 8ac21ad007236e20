"""Write for people which effects of the simulated scenes matter to the models: reports/physics."""

import json
from collections import Counter
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pandas as pd

from pipeline.base import files
from pipeline.base.paths import Workspace
from pipeline.reporting.figures import physics as physics_figures
from pipeline.reporting.sentences import caption, picture
from pipeline.reporting.verdicts import physics as physics_verdicts
from pipeline.reporting.verdicts.physics import CHANGES, EQUIVALENT, FAILED, MARGIN, UNKNOWN, Change, Judgement
from pipeline.reporting.words import markdown
from pipeline.reporting.words.labels import capitalised, effect_name, model_name, task_name
from pipeline.scoring.variants import NONE

TITLES = {"touch": "Touch", "strain": "Strain", "glove": "Glove"}
# Metric -> the name of the error, its unit, and by what it is multiplied to be in that unit.
ERRORS = {
    "rmse": ("RMSE", "kPa", 1),
    "error": ("distance", "mm", 1),
    "accuracy": ("images classified incorrectly", "%", 100),
}
VERDICTS = (CHANGES, EQUIVALENT, UNKNOWN, FAILED)


def write(workspace: Workspace, values: Mapping, folder: Path) -> pd.DataFrame:
    """Judge all experiments, write README.md and one figure each into the empty `folder`, and return physics.csv."""
    scores = {experiment: physics_verdicts.read(workspace, experiment, values) for experiment in values["physics"]}
    assessed = {experiment: physics_verdicts.assess(table) for experiment, table in scores.items()}
    switches = {experiment: values[experiment]["simulate"]["effects"] for experiment in assessed}
    for experiment, judgements in assessed.items():
        title = f"{TITLES[experiment]}: an effect of the scene left out"
        name, unit, _ = ERRORS[scores[experiment]["metric"].iloc[0]]
        physics_figures.matrices(folder / f"{experiment}.png", title, judgements, f"{name} in {unit}")
    files.write_text(folder / "README.md", readme(assessed, scores, values))
    rows = [row for name in assessed for row in physics_verdicts.report_rows(name, assessed[name], switches[name])]
    return pd.DataFrame(rows)


def readme(assessed: Mapping[str, list[Judgement]], scores: Mapping[str, pd.DataFrame], values: Mapping) -> str:
    """Return README.md; assessed, scores: by experiment, values: params.yaml."""
    parts = [
        "# No more physics than the scenes need\n",
        "Every effect of the three simulated scenes is left out in turn, and everything is done anew: logs, ingest, "
        "labels, training, scores of the test part. The scenes are small and the trainings short (params.yaml, "
        "`physics`), so errors are larger than in the tables of each experiment: do not compare the two.\n",
        "**Seeds are pairs.** A seed draws specimen, motion, noise, split and start of training; with and without an "
        "effect, all of these are the same. The ratio of a model's errors is taken seed by seed.\n",
        f"An effect is **equivalent** to its absence if the 90 % interval of every model's change lies within "
        f"{100 * MARGIN:.0f} % (two one-sided tests) and no two models change places. It **changes errors** if one "
        "interval lies outside altogether. Otherwise it **cannot be told**: the half-width of the interval is what "
        "these seeds could have missed. An effect that recordings show is kept, whatever the models make of it. "
        "An effect is left out only where it is equivalent in the scene of the tables; these scenes are smaller, so "
        "nothing is left out on their evidence alone.\n",
    ]
    for experiment, judgements in assessed.items():
        switches = values[experiment]["simulate"]["effects"]
        parts += _experiment(experiment, judgements, scores[experiment], values["physics"][experiment], switches)
    return "\n".join(parts)


def _experiment(
    experiment: str, judgements: list[Judgement], scores: pd.DataFrame, settings: Mapping, switches: Mapping
) -> list[str]:
    metric, scene = scores["metric"].iloc[0], settings["scene"]
    size = f"Settings of this scene that differ from `{experiment}` in params/{experiment}.yaml: "
    size += f"`{json.dumps(scene).replace(chr(34), '')}`."
    if {"rows", "cols"} & set(scene.get("sensor", {})):
        size += " Crosstalk comes from fewer elements than in the whole array."
    error, unit, _ = ERRORS[metric]
    header = ["Effect left out", "Largest change of an error [90 % interval]", "Of which model, where"]
    header += ["Pairs of models that change places", "Verdict", "What follows"]
    rows = [_row(experiment, judged, switches[judged.effect]) for judged in judgements]
    return [
        f"## {TITLES[experiment]}\n",
        f"Error: {error} in {unit}; {len(settings['seeds'])} paired seeds; [all numbers](../physics.csv). {size}\n",
        f"{picture(experiment, figure_caption(judgements))}\n",
        markdown.table(header, rows),
        "Error of every model with all effects (geometric mean, smallest to largest over seeds):\n",
        _whole(scores),
    ]


def figure_caption(judgements: list[Judgement]) -> str:
    """Return the caption of an experiment's matrix: the effect that changes an error most, and how many do what.

    A change whose interval reaches into the margin may be chance, and is not named.
    """
    told = [(judged.effect, change) for judged in judgements for change in judged.changes if change.beyond]
    text = f"no effect that is left out changes an error by certainly more than {100 * MARGIN:.0f} %"
    if told:
        effect, change = max(told, key=lambda pair: abs(np.log1p(pair[1].relative)))
        text = f"leaving out {effect_name(effect)} changes an error most: {change_text(change)} for "
        text += f"{model_name(change.model)}, {task_name(change.condition)}"
    counts = Counter(judged.verdict for judged in judgements)
    verdicts = ", ".join(f"{verdict} {counts[verdict]}" for verdict in VERDICTS if counts[verdict])
    return caption(text, f"verdicts on {len(judgements)} effects: {verdicts}")


def change_text(change: Change) -> str:
    """Return a change of an error with its interval."""
    return f"{percent(change.relative)} [{percent(change.low)}, {percent(change.high)}]"


def percent(share: float) -> str:
    """Return a change with its sign, in percent."""
    return f"{round(100 * share) + 0.0:+.0f} %"


def _row(experiment: str, judged: Judgement, on: bool) -> list[str]:
    most = judged.largest()
    change = "failed"
    if judged.verdict != FAILED:
        change = change_text(most)
    return [
        capitalised(effect_name(judged.effect)),
        change,
        f"{model_name(most.model)}, {task_name(most.condition)}",
        str(len(judged.swapped)),
        judged.verdict,
        physics_verdicts.consequence(experiment, judged, on),
    ]


def _whole(scores: pd.DataFrame) -> str:
    """Return a table of the errors with all effects on, one row per model."""
    _, unit, times = ERRORS[scores["metric"].iloc[0]]
    whole = physics_verdicts.errors(scores)
    whole = whole[whole["effect"] == NONE]
    conditions = list(dict.fromkeys(whole["condition"]))
    rows = []
    for model, runs in whole.groupby("model", sort=False):
        cells = []
        for condition in conditions:
            errors = times * runs[runs["condition"] == condition]["error"]
            middle, low, high = map(markdown.number, (np.exp(np.log(errors).mean()), errors.min(), errors.max()))
            cells.append(f"{middle} ({low} to {high})" if np.isfinite(errors).all() else "failed")
        rows.append([model_name(model), *cells])
    return markdown.table(["Model", *(f"{capitalised(task_name(name))} ({unit})" for name in conditions)], rows)
