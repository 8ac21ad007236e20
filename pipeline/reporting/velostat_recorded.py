"""What reports/velostat_recorded says: how well force is read from the recorded taxel."""

from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd

from pipeline.reporting.labels import model_name
from pipeline.reporting.markdown import interval, table
from pipeline.scoring.results import Scores

POOLED = "repetition"  # the protocol that fits all recordings together; the others are named like one recording
METRICS = {
    "rmse": ("RMSE of force (N, lower is better)", "N"),
    "r2": ("R2 of force (1, higher is better)", "1"),
}


def places(settings: Mapping, groups: Sequence[str]) -> list[tuple[str, str]]:
    """Every (protocol, condition) that has scores; groups: the conditions of the pooled protocol."""
    return [
        (protocol, group)
        for protocol in settings["protocols"]
        for group in (groups if protocol == POOLED else [protocol])
    ]


def score_table(scores: Scores, settings: Mapping, groups: Sequence[str]) -> pd.DataFrame:
    """table.csv: a row for every protocol, recording group, model and metric, in full precision."""
    rows = [
        (protocol, group, model, metric, unit, *scores.estimate(protocol, group, model, metric))
        for protocol, group in places(settings, groups)
        for model in settings["models"]
        for metric, (_, unit) in METRICS.items()
    ]
    names = ["protocol", "condition", "model", "metric", "unit", "mean", "low", "high", "runs", "failed"]
    return pd.DataFrame(rows, columns=names)


def score_text(scores: Scores, settings: Mapping, groups: Sequence[str]) -> str:
    """table.md: a table a metric for either way of fitting, recordings down, models across."""
    text = [
        "# Recorded Velostat taxel: force from the reading\n",
        "Fitted on the first repetition (exp1), tested on the second (exp2). Mean [95 % t interval] over seeds; "
        "the split is the same for every seed, so a model without random start has an interval of zero width.\n",
    ]
    ways = {
        "each recording fitted alone": [place for place in places(settings, groups) if place[0] != POOLED],
        "one fit for all recordings": [place for place in places(settings, groups) if place[0] == POOLED],
    }
    for way, chosen in ways.items():
        for metric, (title, _) in METRICS.items():
            text.append(f"## {title}, {way}\n")
            rows = [
                [group, *(interval(scores.estimate(protocol, group, m, metric), 3) for m in settings["models"])]
                for protocol, group in chosen
            ]
            text.append(table(["Recording", *(model_name(m) for m in settings["models"])], rows))
    return "\n".join(text)


def best_model(scores: Scores, settings: Mapping) -> str | None:
    """The model with the lowest mean RMSE over all test recordings, of those without a failed run."""
    found = {m: scores.estimate(POOLED, "all", m, "rmse") for m in settings["models"]}
    usable = [m for m, e in found.items() if e.runs and not e.failed]
    return min(usable, key=lambda m: found[m].mean) if usable else None


def findings(scores: Scores, settings: Mapping, groups: Sequence[str], best: str | None) -> str:
    """README.md: what the numbers say."""
    lines = ["# Recorded Velostat taxel: results\n"]
    lines.append("[Table](table.md), [speed](../speed/table2.md), [figure](figure.png).\n")
    if best is None:
        return "\n".join([*lines, "- Every model has a failed run.\n"])
    error, r2 = (scores.estimate(POOLED, "all", best, metric) for metric in ("rmse", "r2"))
    lines.append(
        f"- One fit for all recordings: {model_name(best)} is best, RMSE {interval(error, 3)} N, R2 {interval(r2, 3)}."
    )
    if "linear" in settings["models"] and best != "linear":
        linear = scores.estimate(POOLED, "all", "linear", "rmse")
        lines.append(f"- Linear: RMSE {interval(linear, 3)} N, {linear.mean / error.mean:.2f} times the best model's.")
    for group in groups:
        if group not in settings["protocols"]:
            continue
        alone = {m: scores.estimate(group, group, m, "r2").mean for m in settings["models"]}
        together = {m: scores.estimate(POOLED, group, m, "r2").mean for m in settings["models"]}
        if np.isfinite([*alone.values(), *together.values()]).all():
            first, second = (max(found, key=found.get) for found in (alone, together))
            lines.append(
                f"- {group}: best R2 {alone[first]:.3f} ({model_name(first)}) fitted alone, "
                f"{together[second]:.3f} ({model_name(second)}) with all recordings in one fit."
            )
    lines.append(
        "- Where the single fit is worse than the fit alone, recordings disagree about the reading that a force "
        "gives: tip, place on the taxel and rest value differ between them. R2 of a recording with small forces "
        "is low even for small errors in N."
    )
    return "\n".join(lines) + "\n"
