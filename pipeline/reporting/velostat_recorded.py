"""Write reports/velostat_recorded: how well force is read from the recorded taxel."""

from collections.abc import Mapping, Sequence
from itertools import product
from pathlib import Path

import numpy as np
import pandas as pd

from pipeline.base import files
from pipeline.base.paths import Workspace
from pipeline.datasets import schemas
from pipeline.reporting import experiment, sentences
from pipeline.reporting.figures import velostat as velostat_figures
from pipeline.reporting.words.labels import model_name
from pipeline.reporting.words.markdown import code, interval, table
from pipeline.scoring.results import Scores, read_predictions

POOLED = "repetition"  # the protocol that fits all recordings together; the others are named like one recording
METRICS = {
    "rmse": ("RMSE of force (N, lower is better)", "N"),
    "r2": ("R2 of force (higher is better)", "1"),
}


def write(workspace: Workspace, target: Path, settings: Mapping) -> None:
    """Write the report of `velostat_recorded`; see `experiment`."""
    accuracy = target / "accuracy"
    scores, latency, dataset, protocol, seed = experiment.read(workspace, "velostat_recorded", settings)
    test = schemas.names(dataset[schemas.split_column(protocol, seed)]) == "test"
    recordings = sorted(set(schemas.names(dataset["recording"])[test]))
    groups = ["all", *sorted({name.split("/")[0] for name in recordings}, key=_by_force)]
    best = best_model(scores, settings)
    predicted = {
        model: read_predictions(workspace, "velostat_recorded", model, protocol, seed, dataset)
        for model in settings["models"]
    }

    files.write_table(accuracy / "table.csv", score_table(scores, settings, groups))
    files.write_text(accuracy / "table.md", score_text(scores, settings, groups))
    # The recordings that the best model (or, if all failed, the first) reads best, in the middle and worst.
    judge = best or next(iter(settings["models"]))
    order = sorted(
        recordings,
        key=lambda name: scores.estimate(protocol, name.split("/")[0], judge, "r2").mean,
        reverse=True,
    )
    chosen = [order[k] for k in sorted({0, len(order) // 2, len(order) - 1})]
    drawn = {model: force for model, force in predicted.items() if model in ("linear", best)}
    errors = velostat_figures.force_over_time(accuracy / "figure.png", dataset, test, drawn, chosen)
    captions = {"figure": figure_caption(errors)}
    files.write_text(accuracy / "README.md", findings(scores, settings, groups, best, captions))

    panels = {"all recordings": (protocol, "all")}
    experiment.write_speed(workspace, target, settings, scores, latency, panels, ("rmse", "RMSE (N)"))


def _by_force(name: str) -> tuple:
    """Sort pike1_force_5 before pike1_force_10."""
    return tuple((0, int(part), "") if part.isdigit() else (1, 0, part) for part in name.split("_"))


def places(settings: Mapping, groups: Sequence[str]) -> list[tuple[str, str]]:
    """Return every (protocol, condition) that has scores; groups: the conditions of the pooled protocol."""
    return [
        (protocol, group)
        for protocol in settings["protocols"]
        for group in (groups if protocol == POOLED else [protocol])
    ]


def score_table(scores: Scores, settings: Mapping, groups: Sequence[str]) -> pd.DataFrame:
    """Return table.csv: one row per protocol, recording group, model and metric, in full precision."""
    runs = [(*place, *run) for place in places(settings, groups) for run in product(settings["models"], METRICS)]
    return experiment.score_table(scores, runs, {metric: unit for metric, (_, unit) in METRICS.items()})


def score_text(scores: Scores, settings: Mapping, groups: Sequence[str]) -> str:
    """Write table.md: one table per metric for either way of fitting, recordings down, models across."""
    text = [
        "# Recorded Velostat taxel: force from the reading\n",
        "Fitted on the first repetition (exp1), tested on the second (exp2). Mean [95 % t interval] over seeds; "
        "the split is the same for every seed, so a model without random start has no interval.\n",
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
    """Return the model with the lowest mean RMSE over all test recordings, None if all have a failed run."""
    errors = {m: scores.estimate(POOLED, "all", m, "rmse") for m in settings["models"]}
    usable = [m for m, error in errors.items() if error.runs and not error.failed]
    return min(usable, key=lambda m: errors[m].mean) if usable else None


def figure_caption(errors: Mapping[str, Mapping[str, float]]) -> str:
    """Return the caption of the force over time. errors: recording -> model -> RMSE (N) of the stretch drawn."""
    return sentences.caption(
        *(f"{code(name)}: {sentences.best(sentences.one_run(of), 'RMSE', 'N')}" for name, of in errors.items())
    )


def findings(
    scores: Scores, settings: Mapping, groups: Sequence[str], best: str | None, captions: Mapping[str, str]
) -> str:
    """Write README.md: what the numbers say. captions: of the figures, by file name without .png."""
    figures = "\n".join(["", "## Figures\n", *sentences.figure_lines(captions)])
    lines = ["# Recorded Velostat taxel: results\n"]
    lines.append("[Table](table.md), [speed](../speed/table2.md).\n")
    if best is None:
        return "\n".join([*lines, "- Every model has a failed run.", figures]) + "\n"
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
            first, second = (max(r2_by_model, key=r2_by_model.get) for r2_by_model in (alone, together))
            lines.append(
                f"- {group}: best R2 {alone[first]:.3f} ({model_name(first)}) fitted alone, "
                f"{together[second]:.3f} ({model_name(second)}) with all recordings in one fit."
            )
    lines.append(
        "- Where the single fit is worse than the fit alone, recordings disagree about the reading that a force "
        "gives: tip, place on the taxel and rest value differ between them. R2 of a recording with small forces "
        "is low even for small errors in N."
    )
    return "\n".join([*lines, figures]) + "\n"
