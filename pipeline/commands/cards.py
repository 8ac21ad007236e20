"""Write the model card of every pretrained model, from its card.json, the evidence and the stress tests.

pretrained/EXPERIMENT/MODEL/README.md says in words what the model is for, how large its error is and on what, where it
fails, and how it is made again. To be called after the evidence, reports/stress.csv or a pretrained model has changed.

Examples:

    tactile cards
"""

import argparse
from pathlib import Path

import numpy as np

from pipeline.reporting.texts import render
from pipeline.results import shards, shown
from pipeline.results.claim_inputs import FULL
from tactile.base import files, paths, ranges
from tactile.base.paths import Workspace
from tactile.drawing import labels
from tactile.experiments import facts
from tactile.inference import card as cards
from tactile.inference import consistent, intervals
from tactile.scoring import conformal, estimates

TOGETHER = "all objects"
FLOOR = "constant"  # the model that a useful one must beat


def card_of(workspace: Workspace, folder: Path) -> str:
    """Return the model card of a pretrained model in Markdown. Errors: `consistent.read`, `estimates.read_csv`."""
    card = consistent.read(folder)
    metric = facts(card.experiment).metric
    lower, factor, unit = metric != "accuracy", factor_of(metric), facts(card.experiment).output_unit
    measure = f"{labels.MEASURES[metric]} in {unit if lower else '%'}"
    kept = shown.evidence(workspace)
    rows = []
    for score in card.scores:
        if score.metric != metric or score.value is None:
            continue
        runs, floor = (
            kept.runs(card.experiment, card.protocol, score.condition, model, metric, budget=FULL)
            for model in (card.model, FLOOR)
        )
        worse = [k for k in runs.index if k in floor and (runs[k] >= floor[k] if lower else runs[k] <= floor[k])]
        failed = {*runs.index[runs.isna()], *worse}
        again, constant = (said(estimates.estimate(each, estimates.scale_of(metric)), factor) for each in (runs, floor))
        task, value = labels.task_name(score.condition), f"{factor * score.value:.3g}"
        rows.append([task, value, again, f"{len(failed)} of {len(runs)}", constant])
    return render(
        "model_card",
        card=card,
        name=labels.model_name(card.model),
        measure=measure,
        more_epochs=more_epochs(workspace, card),
        intervals=intervals.sentences(card),
        coverage=covered(card),
        range=ranges.words(card.trained_on, card.inputs.unit) if card.trained_on else "",
        errors=(["Test part", "This model", "Trained again, mean [95 %]", "Failed", "A constant"], rows),
        elsewhere=elsewhere(workspace, card),
    )


def factor_of(metric: str) -> int:
    """Return what a score is multiplied by to be shown: shares are in %."""
    return 100 if metric in estimates.SHARES else 1


def more_epochs(workspace: Workspace, card: cards.Card) -> str:
    """Return the epochs of the evidence's trainings of a card's model and protocol, empty where they are the card's."""
    index = shards.table(shards.folder(workspace) / "index.csv", shards.INDEX)
    full = index[(index["experiment"] == card.experiment) & (index["budget"] == FULL)]["shard"]
    times = shards.table(shards.folder(workspace) / "times.csv", shards.TIMES)
    times = times[times["shard"].isin(full) & (times["model"] == card.model) & (times["protocol"] == card.protocol)]
    trained = times["epochs"].unique()
    own = str(card.settings.get("training", {}).get("epochs", ""))
    return "" if set(trained) <= {own} else " or ".join(sorted(trained, key=int))


def covered(card: cards.Card) -> list[list[str]]:
    """Return rows of how often the intervals of a card held the truth; test parts of too few groups tell nothing."""
    return [
        [
            TOGETHER if each.condition == "all" else labels.task_name(each.condition),
            each.output if each.case == intervals.ALWAYS else f"{each.output}, {each.case}",
            f"{each.width:.3g} {intervals.unit(each.output, card)}",
            f"{100 * each.share:.0f} [{100 * each.low:.0f}, {100 * each.high:.0f}]",
            str(each.groups),
            each.reason,
        ]
        for each in (card.calibration.coverage if card.calibration else [])
        if each.groups >= conformal.least()
    ]


def said(estimate: estimates.Estimate, factor: float) -> str:
    """Return a mean with its interval, times a factor, to three digits; a dash where nothing was run."""
    if not estimate.runs:
        return "-"
    interval = f" [{factor * estimate.low:.3g}, {factor * estimate.high:.3g}]" if np.isfinite(estimate.low) else ""
    return f"{factor * estimate.mean:.3g}{interval}"


def elsewhere(workspace: Workspace, card: cards.Card) -> list[list[str]]:
    """Return rows of what the same kind of model scores on another specimen, of reports/stress.csv.

    A row: what was tested; the score on its own specimen, on others, and of a constant on the others; and how much of
    its gain over a constant the model keeps there. These are models of `dvc repro`, with its small budget.
    """
    metric = facts(card.experiment).metric
    factor = factor_of(metric)
    columns = ["experiment", "condition", "model", "perturbation", "severity", "metric", "value"]
    table = estimates.read_csv(workspace.reports / "stress.csv", columns, "dvc repro collect")
    table = table[(table["experiment"] == card.experiment) & (table["perturbation"] == "specimen")]
    rows = []
    for condition, group in table[table["metric"] == metric].groupby("condition", sort=False):
        mean = group.groupby(["model", group["severity"] > 0])["value"].mean()
        own, other = mean[card.model, False], mean[card.model, True]
        share = (mean[FLOOR, True] - other) / (mean[FLOOR, False] - own)
        values = (f"{factor * value:.3g}" for value in (own, other, mean[FLOOR, True]))
        rows.append([labels.task_name(condition), *values, f"{100 * share:.0f} %"])
    return rows


def main(workspace: Workspace, given: argparse.Namespace) -> None:
    """Write the cards of all pretrained models."""
    pretrained = paths.require(workspace.root / "pretrained", "git checkout pretrained")
    for path in sorted(pretrained.glob(f"*/*/{cards.NAME}")):
        files.write_text(path.with_name("README.md"), card_of(workspace, path.parent))
        print(path.with_name("README.md"))
