"""Write for people which effects of the simulated scenes the results need: reports/physics."""

import json
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pandas as pd

from pipeline.base import files
from pipeline.reporting.figures import physics as physics_figures
from pipeline.reporting.verdicts import physics as physics_verdicts
from pipeline.reporting.verdicts.physics import FAILED, NEEDED, NOT_NEEDED, Assessment, Judgement
from pipeline.reporting.words import markdown
from pipeline.reporting.words.labels import model_name
from pipeline.scoring.results import CONFIDENCE
from pipeline.scoring.variants import DEFAULT, NONE

TITLES = {"touch": "Touch", "strain": "Strain", "glove": "Glove"}
HELD = {True: "Holds.", False: "Does not hold.", None: "Seeds differ, so it does not count."}  # of a claim
ERRORS = {"rmse": "RMSE in kPa", "error": "distance in mm", "accuracy": "share of images named wrongly"}


def write(values: Mapping, folder: Path) -> pd.DataFrame:
    """Judge all experiments, write README.md and one figure each into the empty `folder`, and return physics.csv."""
    scores = {experiment: physics_verdicts.read(experiment, values) for experiment in values["physics"]}
    assessed = {experiment: physics_verdicts.assess(experiment, table) for experiment, table in scores.items()}
    for experiment, assessment in assessed.items():
        title = f"{TITLES[experiment]}: an effect of the scene left out"
        unit = ERRORS[scores[experiment]["metric"].iloc[0]]
        physics_figures.matrices(folder / f"{experiment}.png", title, assessment, unit)
    files.write_text(folder / "README.md", readme(assessed, scores, values))
    rows = [row for pair in assessed.items() for row in physics_verdicts.report_rows(*pair)]
    return pd.DataFrame(rows)


def readme(assessed: Mapping[str, Assessment], scores: Mapping[str, pd.DataFrame], values: Mapping) -> str:
    """Return README.md; assessed, scores: by experiment, values: params.yaml."""
    switches = {experiment: values[experiment]["simulate"]["effects"] for experiment in assessed}
    off = {experiment: [name for name, on in effects.items() if not on] for experiment, effects in switches.items()}
    parts = [
        "# No more physics than the scenes need\n",
        "Every effect of the three simulated scenes is left out in turn, and everything is done anew: logs, ingest, "
        "labels, training, scores of the test part. The scenes are small and the trainings short (params.yaml, "
        "`physics`), so errors are larger than in the tables of each experiment: do not compare the two.\n",
        "**The yardstick is another seed.** With all effects on, the scene is drawn with several seeds (specimen, "
        "motion, noise, split and start of training all differ). Without an effect, the mean of some of these seeds "
        "is compared with the mean of the same seeds with it; the yardstick is the same comparison between different "
        "seeds. An effect is **needed** if, without it,\n",
        "- a model's error changes by more than its *floor*, and in every seed in the same direction; or",
        f"- the order of the models (Kendall's tau, 1: the same) changes more than in {CONFIDENCE:.0%} of pairs of "
        "groups of other seeds; or",
        "- a claim that all seeds agree on turns over.\n",
        f"Errors are compared as ratios: the floor is the {CONFIDENCE:.0%} band of the logarithm of the ratio, "
        "t s sqrt(2 / m) for m seeds. The spread s is the model's own over all seeds, or the median of all models and "
        f"conditions where that is larger (some agree by luck); the least floor is {physics_verdicts.LEAST:.0%}.\n",
        "## What could be left out\n",
        *[_left_out(experiment, assessment, off[experiment]) for experiment, assessment in assessed.items()],
        "",
        "One effect is left out at a time; two that change nothing alone may do so together (`default` is the test "
        "of that: the scene as it is in params.yaml). An effect is judged by the models and claims below, on a scene "
        "of this size; what only a longer training shows is not seen.\n",
    ]
    for experiment, assessment in assessed.items():
        parts += _experiment(experiment, assessment, scores[experiment], values["physics"][experiment])
    return "\n".join(parts)


def _left_out(experiment: str, assessment: Assessment, off: list[str]) -> str:
    """Say in one line what is not needed, what failed, and what stays although nothing needs it."""
    alone = {judged.effect: judged.verdict for judged in assessment.effects}
    whole = alone.pop(DEFAULT, None)
    needed, spare, failed = ([e for e, said in alone.items() if said == v] for v in (NEEDED, NOT_NEEDED, FAILED))
    purposes = {effect: physics_verdicts.PURPOSE.get((experiment, effect)) for effect in spare}
    free = [f"`{effect}`" for effect, purpose in purposes.items() if not purpose]
    kept = [f"`{effect}` stays: {purpose}" for effect, purpose in purposes.items() if purpose]
    text = f"- {TITLES[experiment]}: {len(needed)} of {len(alone)} effects are needed. "
    text += f"Change nothing when left out alone: {', '.join(free)}. " if free else ""
    text += f"Change nothing either, but {'; '.join(kept)}. " if kept else ""
    text += f"Not known, a run failed: {', '.join(f'`{effect}`' for effect in failed)}. " if failed else ""
    if whole:
        consequence = {
            NOT_NEEDED: "which changes nothing.",
            NEEDED: "which changes the results: switch some of them on.",
            FAILED: "and what that changes is not known, for a run failed.",
        }[whole]
        text += f"Off by default, all at once: {', '.join(f'`{effect}`' for effect in off)}, {consequence}"
    return text.rstrip()


def _experiment(experiment: str, assessment: Assessment, scores: pd.DataFrame, settings: Mapping) -> list[str]:
    conditions = list(assessment.floor_tau)
    header = ["effect left out", *[f"tau, {name.replace('_', ' ')}" for name in conditions]]
    header += ["largest change (floors)", "of", "claims that turn over", "verdict"]
    rows = [_row(judged, conditions) for judged in assessment.effects]
    floor = ["*floor: other seeds*", *[f"≥ {markdown.number(value)}" for value in assessment.floor_tau.values()]]
    rows.append([*floor, "1.00", "", "", ""])
    claims = [
        f"- {claim.name}: {claim.sentence}. {HELD[assessment.claims[claim.name]]}"
        for claim in physics_verdicts.CLAIMS[experiment]
        if claim.name in assessment.claims
    ]
    untested = [claim.name for claim in physics_verdicts.CLAIMS[experiment] if claim.name not in assessment.claims]
    if untested:
        claims.append(f"- Not tested, for a model or condition is missing: {', '.join(untested)}.")
    metric, scene = scores["metric"].iloc[0], settings["scene"]
    size = f"Scene, in place of `{experiment}` in params.yaml: `{json.dumps(scene).replace(chr(34), '')}`."
    if {"rows", "cols"} & set(scene.get("sensor", {})):
        size += " Crosstalk comes from fewer elements than in the whole array."
    return [
        f"## {TITLES[experiment]}\n",
        f"Error: {ERRORS[metric]}; {len(settings['floor_seeds'])} seeds with all effects, "
        f"{len(settings['effect_seeds'])} without each; [all numbers](../physics.csv). {size}\n",
        f"![{TITLES[experiment]}: change of every model's error]({experiment}.png)\n",
        markdown.table(header, rows),
        "Error of every model with all effects (geometric mean, smallest to largest over seeds):\n",
        _floors(scores, conditions),
        "Claims as they are tested here, with all effects on:\n",
        *claims,
        "",
    ]


def _row(judged: Judgement, conditions: list[str]) -> list[str]:
    most = judged.largest()
    change = "failed" if np.isnan(most.floors) else f"{most.floors:+.2f} ({most.relative:+.0%})"
    if abs(most.floors) > 1 and not most.steady:
        change += ", seeds differ"
    return [
        f"**{judged.effect}**" if judged.verdict == NEEDED else judged.effect,
        *(markdown.number(judged.tau[condition]) for condition in conditions),
        change,
        f"{model_name(most.model)}, {most.condition.replace('_', ' ')}",
        "; ".join(judged.flipped) or "none",
        judged.verdict,
    ]


def _floors(scores: pd.DataFrame, conditions: list[str]) -> str:
    """Return a table of the errors with all effects on, one row per model."""
    table = physics_verdicts.errors(scores)
    whole = table[table["effect"] == NONE]
    rows = []
    for model, runs in whole.groupby("model", sort=False):
        cells = []
        for condition in conditions:
            errors = runs[runs["condition"] == condition]["error"]
            middle, low, high = map(markdown.number, (np.exp(np.log(errors).mean()), errors.min(), errors.max()))
            cells.append(f"{middle} ({low} to {high})" if np.isfinite(errors).all() else "failed")
        rows.append([model_name(model), *cells])
    return markdown.table(["Model", *[name.replace("_", " ") for name in conditions]], rows)
