"""Write for people which effects of the simulated scenes matter to the models: reports/physics."""

import json
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pandas as pd

from pipeline.base import files
from pipeline.reporting.figures import physics as physics_figures
from pipeline.reporting.verdicts import physics as physics_verdicts
from pipeline.reporting.verdicts.physics import FAILED, MARGIN, Judgement
from pipeline.reporting.words import markdown
from pipeline.reporting.words.labels import model_name
from pipeline.scoring.variants import NONE

TITLES = {"touch": "Touch", "strain": "Strain", "glove": "Glove"}
ERRORS = {"rmse": "RMSE in kPa", "error": "distance in mm", "accuracy": "share of images classified incorrectly"}


def write(values: Mapping, folder: Path) -> pd.DataFrame:
    """Judge all experiments, write README.md and one figure each into the empty `folder`, and return physics.csv."""
    scores = {experiment: physics_verdicts.read(experiment, values) for experiment in values["physics"]}
    assessed = {experiment: physics_verdicts.assess(table) for experiment, table in scores.items()}
    switches = {experiment: values[experiment]["simulate"]["effects"] for experiment in assessed}
    for experiment, judgements in assessed.items():
        title = f"{TITLES[experiment]}: an effect of the scene left out"
        unit = ERRORS[scores[experiment]["metric"].iloc[0]]
        physics_figures.matrices(folder / f"{experiment}.png", title, judgements, unit)
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
        f"{MARGIN:.0%} (two one-sided tests) and no two models change places. It **changes errors** if one "
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
    size = f"Scene, in place of `{experiment}` in params.yaml: `{json.dumps(scene).replace(chr(34), '')}`."
    if {"rows", "cols"} & set(scene.get("sensor", {})):
        size += " Crosstalk comes from fewer elements than in the whole array."
    header = ["effect left out", "largest change [90 % interval]", "of", "models that change places", "verdict"]
    rows = [_row(experiment, judged, switches[judged.effect]) for judged in judgements]
    return [
        f"## {TITLES[experiment]}\n",
        f"Error: {ERRORS[metric]}; {len(settings['seeds'])} paired seeds; [all numbers](../physics.csv). {size}\n",
        f"![{TITLES[experiment]}: change of every model's error]({experiment}.png)\n",
        markdown.table([*header, "what follows"], rows),
        "Error of every model with all effects (geometric mean, smallest to largest over seeds):\n",
        _whole(scores),
    ]


def _row(experiment: str, judged: Judgement, on: bool) -> list[str]:
    most = judged.largest()
    change = "failed"
    if judged.verdict != FAILED:
        change = f"{most.relative:+.0%} [{most.low:+.0%}, {most.high:+.0%}]"
    return [
        judged.effect,
        change,
        f"{model_name(most.model)}, {most.condition.replace('_', ' ')}",
        str(len(judged.swapped)),
        judged.verdict,
        physics_verdicts.consequence(experiment, judged, on),
    ]


def _whole(scores: pd.DataFrame) -> str:
    """Return a table of the errors with all effects on, one row per model."""
    whole = physics_verdicts.errors(scores)
    whole = whole[whole["effect"] == NONE]
    conditions = list(dict.fromkeys(whole["condition"]))
    rows = []
    for model, runs in whole.groupby("model", sort=False):
        cells = []
        for condition in conditions:
            errors = runs[runs["condition"] == condition]["error"]
            middle, low, high = map(markdown.number, (np.exp(np.log(errors).mean()), errors.min(), errors.max()))
            cells.append(f"{middle} ({low} to {high})" if np.isfinite(errors).all() else "failed")
        rows.append([model_name(model), *cells])
    return markdown.table(["Model", *[name.replace("_", " ") for name in conditions]], rows)
