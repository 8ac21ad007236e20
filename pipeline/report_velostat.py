"""What reports/velostat_recorded says: how well force is read from the recorded taxel."""

from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd

from pipeline.figures import style
from pipeline.markdown import interval, table
from pipeline.results import Scores

METRICS = {
    "rmse": ("RMSE of force (N, lower is better)", "N"),
    "r2": ("R2 of force (1, higher is better)", "1"),
}


def score_table(scores: Scores, settings: Mapping, groups: Sequence[str]) -> pd.DataFrame:
    """table.csv: a row for every protocol, recording group, model and metric, in full precision."""
    rows = [
        (protocol, group, model, metric, unit, *scores.estimate(protocol, group, model, metric))
        for protocol in settings["protocols"]
        for group in groups
        for model in settings["models"]
        for metric, (_, unit) in METRICS.items()
    ]
    names = ["protocol", "condition", "model", "metric", "unit", "mean", "low", "high", "runs", "failed"]
    return pd.DataFrame(rows, columns=names)


def score_text(scores: Scores, settings: Mapping, groups: Sequence[str]) -> str:
    """table.md: a table a metric, recording groups down, models across."""
    text = [
        "# Recorded Velostat taxel: force from the reading\n",
        "Fitted on the first repetition (exp1) of every recording, tested on the second (exp2). Mean "
        "[95 % t interval] over seeds; the split is the same for every seed, so a model without random "
        "start has an interval of zero width.\n",
    ]
    for protocol, block in settings["protocols"].items():
        for metric, (title, _) in METRICS.items():
            text.append(f"## {title}, split `{protocol}`, {len(block['seeds'])} seeds\n")
            rows = [
                [
                    group,
                    *(interval(scores.estimate(protocol, group, m, metric), 3) for m in settings["models"]),
                ]
                for group in groups
            ]
            text.append(table(["Recordings", *(style(m).label for m in settings["models"])], rows))
    return "\n".join(text)


def best_model(scores: Scores, settings: Mapping, protocol: str) -> str | None:
    """The model with the lowest mean RMSE over all test recordings, of those without a failed run."""
    found = {m: scores.estimate(protocol, "all", m, "rmse") for m in settings["models"]}
    usable = [m for m, e in found.items() if e.runs and not e.failed]
    return min(usable, key=lambda m: found[m].mean) if usable else None


def findings(scores: Scores, settings: Mapping, groups: Sequence[str], best: str | None) -> str:
    """README.md: what the numbers say."""
    protocol = next(iter(settings["protocols"]))
    lines = ["# Recorded Velostat taxel: results\n"]
    lines.append("[Table](table.md), [speed](speed/table2.md), [figure](figure.png).\n")
    if best is None:
        return "\n".join([*lines, "- Every model has a failed run.\n"])
    error, r2 = (scores.estimate(protocol, "all", best, metric) for metric in ("rmse", "r2"))
    lines.append(
        f"- {style(best).label} is best over all recordings: RMSE {interval(error, 3)} N, "
        f"R2 {interval(r2, 3)}."
    )
    if "linear" in settings["models"] and best != "linear":
        linear = scores.estimate(protocol, "all", "linear", "rmse")
        lines.append(
            f"- Linear: RMSE {interval(linear, 3)} N, {linear.mean / error.mean:.2f} times the best model's."
        )
    by_group = {g: scores.estimate(protocol, g, best, "r2").mean for g in groups if g != "all"}
    if by_group and np.isfinite(list(by_group.values())).all():
        worst, top = min(by_group, key=by_group.get), max(by_group, key=by_group.get)
        lines.append(
            f"- R2 of {style(best).label} goes from {by_group[worst]:.3f} ({worst}) to {by_group[top]:.3f} "
            f"({top}); R2 of a group of small forces is low even for small errors in N."
        )
    return "\n".join(lines) + "\n"
