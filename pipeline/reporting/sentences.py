"""Sentences that the findings of several experiments share."""

from collections.abc import Mapping, Sequence

from pipeline.reporting.labels import model_name
from pipeline.reporting.markdown import interval, number
from pipeline.scoring.results import Fit, Scores


def yardstick(scores: Scores, settings: Mapping, run: tuple[str, str], what: str, unit: str) -> str:
    """The one number that the scene's difficulty was set by, beside the published one.

    run: its protocol and condition; what: condition, metric and split in words; unit: `%` shows a fraction in percent.
    """
    chosen = settings["yardstick"]
    if settings["source"] != "simulated":
        return "- The data are recorded, so no yardstick was used."
    if chosen["model"] not in settings["models"]:
        return f"- Yardstick of the scene: {chosen['model']} is not among the models, so it cannot be compared."
    ours, published = scores.estimate(*run, chosen["model"], chosen["metric"]), chosen["published"]
    if unit == "%":
        ours, published = ours.percent(), 100 * published
    return (
        f"- Yardstick of the scene, the one number that it was set by: {model_name(chosen['model'])}, {what}: ours "
        f"{interval(ours)}, published {number(published)} {unit} ({100 * (ours.mean / published - 1):+.0f} %). All "
        "other numbers are predictions."
    )


def stops(trained: Sequence[Fit]) -> str:
    """How many of the runs trained in epochs stopped for which reason."""
    reasons = [fit.stop_reason for fit in trained]
    return (
        f"Of {len(reasons)} runs trained in epochs, {reasons.count('patience')} stopped by patience, "
        f"{reasons.count('max_epochs')} reached the allowed number of epochs and {reasons.count('diverged')} diverged."
    )


def differences_section(differences: Sequence[tuple[str, str]]) -> list[str]:
    """Where our code departs from the papers; differences: (file, text)."""
    found = [f"- `{file}`: {text}" for file, text in differences] or ["- Nowhere."]
    return ["\n## Where the code differs from the papers\n", *found]
