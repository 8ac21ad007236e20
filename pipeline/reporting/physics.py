"""Text of reports/physics: which effects of the simulated scenes the results need."""

import json
from collections.abc import Mapping

import numpy as np
import pandas as pd

from pipeline.reporting import markdown
from pipeline.reporting.labels import model_name
from pipeline.reporting.verdicts import physics as physics_verdicts
from pipeline.reporting.verdicts.physics import FAILED, NEEDED, NOT_NEEDED, Assessment, Judgement
from pipeline.scoring.variants import DEFAULT

TITLES = {"touch": "Touch", "strain": "Strain", "glove": "Glove"}
ERRORS = {"rmse": "RMSE in kPa", "error": "distance in mm", "accuracy": "share of images named wrongly"}


def readme(found: Mapping[str, Assessment], scores: Mapping[str, pd.DataFrame], values: Mapping) -> str:
    """README.md; found, scores: by experiment, values: params.yaml."""
    settings = values["physics"]
    switches = {experiment: values[experiment]["simulate"]["effects"] for experiment in found}
    off = {experiment: [name for name, on in own.items() if not on] for experiment, own in switches.items()}
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
        f"- the order of the models (Kendall's tau, 1: the same) changes more than in "
        f"{physics_verdicts.CONFIDENCE:.0%} of pairs"
        " of groups of other seeds; or",
        "- a claim that all seeds agree on turns over.\n",
        f"Errors are compared as ratios: the floor is the {physics_verdicts.CONFIDENCE:.0%} band of the logarithm of "
        f"the ratio, "
        "t s sqrt(2 / m) for m seeds. The spread s is the model's own over all seeds, or the median of all models and "
        f"conditions where that is larger (some agree by luck); the least floor is {physics_verdicts.LEAST:.0%}.\n",
        "## What could be left out\n",
        *[_left_out(experiment, one, off[experiment]) for experiment, one in found.items()],
        "",
        "One effect is left out at a time; two that change nothing alone may do so together (`default` is the test "
        "of that: the scene as it is in params.yaml). An effect is judged by the models and claims below, on a scene "
        "of this size; what only a longer "
        "training shows is not seen.\n",
    ]
    for experiment, one in found.items():
        parts += _experiment(experiment, one, scores[experiment], settings[experiment])
    return "\n".join(parts)


def _left_out(experiment: str, assessment: Assessment, off: list[str]) -> str:
    """One line an experiment: what is not needed, what failed, and what stays although nothing needs it."""
    alone = [one for one in assessment.effects if one.effect != DEFAULT]
    by_verdict = {verdict: [one for one in alone if one.verdict == verdict] for verdict in (NEEDED, NOT_NEEDED, FAILED)}
    purposes = {one.effect: physics_verdicts.PURPOSE.get((experiment, one.effect)) for one in by_verdict[NOT_NEEDED]}
    free = [f"`{effect}`" for effect, purpose in purposes.items() if not purpose]
    kept = [f"`{effect}` stays: {purpose}" for effect, purpose in purposes.items() if purpose]
    text = f"- {TITLES[experiment]}: "
    text += f"{len(by_verdict[NEEDED])} of {len(alone)} effects are needed. "
    text += f"Change nothing when left out alone: {', '.join(free)}. " if free else ""
    text += f"Change nothing either, but {'; '.join(kept)}. " if kept else ""
    failed = [f"`{one.effect}`" for one in by_verdict[FAILED]]
    text += f"Not known, a run failed: {', '.join(failed)}. " if failed else ""
    whole = [one.verdict for one in assessment.effects if one.effect == DEFAULT]
    if whole:
        said = {
            NOT_NEEDED: "which changes nothing.",
            NEEDED: "which changes the results: switch some of them on.",
            FAILED: "and what that changes is not known, for a run failed.",
        }
        text += f"Off by default, all at once: {', '.join(f'`{name}`' for name in off)}, {said[whole[0]]}"
    return text.rstrip()


def _experiment(experiment: str, assessment: Assessment, scores: pd.DataFrame, settings: Mapping) -> list[str]:
    conditions = list(assessment.floor_tau)
    header = ["effect left out", *[f"tau, {name.replace('_', ' ')}" for name in conditions]]
    header += ["largest change (floors)", "of", "claims that turn over", "verdict"]
    rows = [[_bold(one), *_row(one, conditions), one.verdict] for one in assessment.effects]
    floor = ["*floor: other seeds*", *[f"≥ {markdown.number(value)}" for value in assessment.floor_tau.values()]]
    rows.append([*floor, "1.00", "", "", ""])
    claims = [
        f"- {claim.name}: {claim.sentence}. {_said(assessment.claims[claim.name])}"
        for claim in physics_verdicts.CLAIMS[experiment]
        if claim.name in assessment.claims
    ]
    untested = [claim.name for claim in physics_verdicts.CLAIMS[experiment] if claim.name not in assessment.claims]
    if untested:
        claims.append(f"- Not tested, for a model or condition is missing: {', '.join(untested)}.")
    metric, scene = scores["metric"].iloc[0], settings["scene"]
    size = f"Scene, in place of `{experiment}` in params.yaml: `{json.dumps(scene).replace(chr(34), '')}`."
    if "sensor" in scene:
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


def _bold(one: Judgement) -> str:
    return f"**{one.effect}**" if one.verdict == NEEDED else one.effect


def _row(one: Judgement, conditions: list[str]) -> list[str]:
    most = one.largest()
    failed = most.floors != most.floors
    change = "failed" if failed else f"{most.floors:+.2f} ({most.relative:+.0%})"
    if abs(most.floors) > 1 and not most.steady:
        change += ", seeds differ"
    of = f"{model_name(most.model)}, {most.condition.replace('_', ' ')}"
    return [*[markdown.number(one.tau[name]) for name in conditions], change, of, "; ".join(one.flipped) or "none"]


def _said(holds: bool | None) -> str:
    return "Seeds differ, so it does not count." if holds is None else "Holds." if holds else "Does not hold."


def _floors(scores: pd.DataFrame, conditions: list[str]) -> str:
    table = physics_verdicts.errors(scores)
    whole = table[table["effect"] == physics_verdicts.NONE]
    rows = []
    for model in dict.fromkeys(whole["model"]):
        cells = []
        for condition in conditions:
            own = whole[(whole["model"] == model) & (whole["condition"] == condition)]["error"]
            low, high = markdown.number(own.min()), markdown.number(own.max())
            failed = own.isin([float("inf")]).any()
            middle = markdown.number(float(np.exp(np.log(own).mean())))
            cells.append("failed" if failed else f"{middle} ({low} to {high})")
        rows.append([model_name(model), *cells])
    return markdown.table(["Model", *[name.replace("_", " ") for name in conditions]], rows)
