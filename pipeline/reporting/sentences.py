"""Write captions that state what a figure shows, for stability, sizes, physics, twins, speed and the page.

Which model is best, with a number and its unit, is computed from what is drawn.
"""

from collections.abc import Mapping, Sequence

from pipeline.reporting.words.labels import capitalised, model_name
from pipeline.reporting.words.markdown import number
from pipeline.scoring.results import Estimate, estimate

FEW = 3  # models that a caption names


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
