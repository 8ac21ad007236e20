"""Write sentences that the reports of several experiments share, and collect where the code differs from a paper.

A caption states what its figure shows: which model is best, with a number and its unit, computed from what is drawn.
"""

import re
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

import numpy as np

from pipeline.reporting.words.labels import capitalised, model_name
from pipeline.reporting.words.markdown import interval, number
from pipeline.scoring import classification
from pipeline.scoring.results import Estimate, Fit, Scores, estimate

FEW = 3  # models that a caption names
MARK = re.compile(r"Differs from paper:\s*(.*)")


def replicates(settings: Mapping, specimen: str) -> str:
    """Say what differs between seeds; specimen: what a scene has several of, such as an array."""
    simulated = f"another {specimen}, other motions and noise, " if settings["source"] == "simulated" else ""
    return f"each with {simulated}another split and another start"


def yardstick(
    scores: Scores, settings: Mapping, rest: str, others: Mapping[str, tuple[Mapping, float]] | None = None
) -> str:
    """Return the line on the one ratio of errors that the scene's difficulty was set by, beside the published one.

    rest: what the scene's other settings come from; others: name -> block like the yardstick's and published value of
    ratios that were not set.
    """
    chosen = settings["yardstick"]
    if settings["source"] != "simulated":
        return "- The data are recorded, so no yardstick was used."
    if absent := [chosen[role] for role in ("model", "over") if chosen[role] not in settings["models"]]:
        return f"- Calibration target: {' and '.join(absent)} not among the models, so it cannot be compared."
    ours, published = error_ratio(scores, chosen), chosen["published"]
    not_set = [
        f"{name} {number(error_ratio(scores, block).mean)} ({number(printed)})"
        for name, (block, printed) in (others or {}).items()
        if block["model"] in settings["models"]
    ]
    metric = "" if chosen["metric"] == "error" else f" ({chosen['metric'].replace('_', ' ')})"
    return (
        "- Calibration target, the published number that the simulator was tuned to: "
        f"error{metric} of {model_name(chosen['model'])} over that of {model_name(chosen['over'])}, "
        f"{chosen['condition'].replace('_', ' ')}, protocol {chosen['protocol'].replace('_', ' ')}: "
        f"ours {interval(ours, 3)}, published {number(published, 3)} "
        f"({100 * (ours.mean / published - 1):+.0f} %). `{chosen['knob']}` was set by it, on validation parts "
        f"(`tactile calibrate --help`). {rest} What models score is a prediction of these."
        + (f" Such ratios that were not set (published): {'; '.join(not_set)}." if not_set else "")
    )


def error_ratio(scores: Scores, chosen: Mapping) -> Estimate:
    """Return the ratio of two models' errors over seeds; chosen: a block like `<experiment>.yardstick`."""
    errors = []
    for role in ("model", "over"):
        values = np.array(scores.runs(chosen["protocol"], chosen["condition"], chosen[role], chosen["metric"]))
        errors.append(1 - values if chosen["metric"] in classification.METRICS else values)
    return estimate(errors[0] / errors[1])


def stops(trained: Sequence[Fit]) -> str:
    """Return the sentence on how many of the runs trained in epochs ended as set."""
    reasons = [fit.stop_reason for fit in trained]
    return (
        f"Of {len(reasons)} runs trained in epochs, {reasons.count('completed')} went through their set number of "
        f"epochs and {reasons.count('diverged')} diverged."
    )


def usable(values: Mapping[str, Estimate], more_is_better: bool = False) -> list[str]:
    """Return the models without a failed run, the best mean first."""
    whole = [model for model, value in values.items() if value.runs and not value.failed]
    return sorted(whole, key=lambda model: values[model].mean, reverse=more_is_better)


def overlap(first: Estimate, second: Estimate) -> bool:
    """Return whether the intervals of two models overlap; False where one of them has none: then nothing is known."""
    return first.low <= second.high and second.low <= first.high


def listed(names: Sequence[str]) -> str:
    """Return names as a list in a sentence; between slashes where one of them has a comma."""
    if any("," in name for name in names):
        return " / ".join(names)
    return " and ".join(filter(None, [", ".join(names[:-1]), *names[-1:]]))


def some(models: Sequence[str]) -> str:
    """Return the names of a few models, or how many they are."""
    return listed([model_name(model) for model in models]) if len(models) <= FEW else f"{len(models)} models"


def best(values: Mapping[str, Estimate], what: str, unit: str, digits: int = 2, more_is_better: bool = False) -> str:
    """Say which model has the best value of `what`, which one is next, and whose intervals overlap with the best one's.

    The text is a part of a sentence, without a full stop. unit: behind the value, a space before it; it may be empty.
    """

    def value_of(model: str) -> str:
        return f"{number(values[model].mean, digits)} {unit}".strip()

    if not values:
        return "none of the models that it shows was run"
    order = usable(values, more_is_better)
    broken = [model for model in values if model not in order]
    failed = f"; runs failed for {some(broken)}" if broken else ""
    if not order:
        return f"no model has {what} in all runs{failed}"
    first, *others = order
    word = "highest" if more_is_better else "smallest"
    if not others:
        return f"the {what} of {model_name(first)} is {value_of(first)}{failed}"
    equal = [model for model in order if value_of(model) == value_of(first)]
    if len(equal) > 1:
        text = f"{some(equal)} have the {word} {what}, {value_of(first)}"
        others = [model for model in others if model not in equal]
        return f"{text}{f'; {model_name(others[0])} is next, {value_of(others[0])}' if others else ''}{failed}"
    text = f"{model_name(first)} has the {word} {what}, {value_of(first)}; {model_name(others[0])} is next, "
    text += value_of(others[0])
    close = [model for model in others if overlap(values[first], values[model])]
    if close == others[:1]:
        text += ", and their intervals overlap"
    elif close:
        text += f"; the intervals of {some(close)} overlap with that of {model_name(first)}"
    return text + failed


def one_run(values: Mapping[str, float]) -> dict[str, Estimate]:
    """Return model -> estimate of the value of one run, which has no interval; failed where it is not finite."""
    return {model: estimate([value]) for model, value in values.items()}


def caption(*parts: str) -> str:
    """Join parts into sentences, each with a capital letter and a full stop; empty ones are left out."""
    return " ".join(f"{capitalised(part)}." for part in parts if part)


def learning_caption(fits: Mapping[str, Sequence[Fit]], unit: str, digits: int = 2) -> str:
    """Return the caption of learning curves: the lowest validation loss, and how often the last epoch had it.

    fits: model -> its runs; those without epochs are left out.
    """
    trained = {model: runs for model, runs in fits.items() if any(len(run.history) > 1 for run in runs)}
    if not trained:
        return caption("no model is trained in epochs")
    losses = {model: estimate([least_loss(run) for run in runs]) for model, runs in trained.items()}
    everything = [run for runs in trained.values() for run in runs]
    last = sum(run.best_epoch == run.epochs for run in everything)
    return caption(
        best(losses, "validation loss", unit, digits),
        f"the last epoch was the best, and kept, in {last} of {len(everything)} runs",
    )


def least_loss(run: Fit) -> float:
    """Return the validation loss of the epoch that was kept; NaN where none was."""
    kept = run.history.loc[run.history["epoch"] == run.best_epoch, "validation_loss"]
    return float(kept.iloc[0]) if len(kept) else np.nan


def split_unit(measure: str) -> tuple[str, str]:
    """Split the name of a measure with its unit in brackets, as an axis shows it: `RMSE (kPa)`."""
    name, _, unit = measure.rpartition(" (")
    return (name, unit.rstrip(")")) if name else (measure, "")


def figure_lines(captions: Mapping[str, str]) -> list[str]:
    """Return a line per figure with a link to it; captions: name of the file without .png -> caption."""
    return [f"- [{name}.png]({name}.png): {text}" for name, text in captions.items()]


def picture(name: str, text: str) -> str:
    """Return a line that shows a figure (name of the file without .png) with its caption."""
    return f"![{name}]({name}.png) {text}"


def read_differences(folder: Path, names: Iterable[str]) -> list[tuple[str, str]]:
    """Read (file, text) of every mark, anywhere in a line, by file and line; names: files in `folder`.

    A comment goes on over following lines that are comments; in a docstring, up to an empty line or the end.
    """
    differences = []
    for path in sorted(folder / name for name in names):
        lines = path.read_text(encoding="utf-8").splitlines()
        for k, line in enumerate(lines):
            match = MARK.search(line)
            if not match:
                continue
            text = [match[1]]
            comment = "#" in line[: match.start(1)]
            for following in lines[k + 1 :]:
                following = following.strip()
                if '"""' in text[-1] or not following or following.startswith('"""') or MARK.search(following):
                    break
                if comment and not following.startswith("#"):
                    break
                text.append(following.lstrip("# "))
            joined = re.split(r'"""| Raises ', " ".join(text))[0].strip()
            differences.append((path.relative_to(folder.parent).as_posix(), joined))
    return differences


def differences_section(differences: Sequence[tuple[str, str]]) -> list[str]:
    """Return the lines on where our code departs from the papers; differences: (file, text)."""
    lines = [f"- `{file}`: {text}" for file, text in differences] or ["- Nowhere."]
    return ["\n## Where the code differs from the papers\n", *lines]
