"""Stage: the size ladders of all experiments judged: reports/rightsize.csv, and reports/rightsize for people.

Usage: python -m pipeline.stages.render_rightsize
"""

from collections.abc import Mapping
from pathlib import Path

import pandas as pd

from pipeline.base import files, params, paths
from pipeline.base.errors import run_stage
from pipeline.reporting import markdown
from pipeline.reporting.figures import sizes as sizes_figures
from pipeline.reporting.figures.sizes import Reference
from pipeline.reporting.verdicts import sizes as sizes_verdicts
from pipeline.scoring import ladders
from pipeline.scoring.results import Estimate, Scores

INTRODUCTION = """# How small a model each scene needs

Each of the papers' models at several sizes; everything else stays the same within a ladder. The smallest size is
enough if its mean test error is at most the best size's mean plus one standard error of that mean. Runs of a ladder
differ in the seed, and with it in the start and, for touch and glove, in the split. Values are mean [95 % t interval];
lower is better. A size with a failed run is never chosen. A size that falls short does so after this training: a
longer one might lift it. The errors are those of the test part: they decide what is said here and are used for nothing
else. All numbers: [rightsize.csv](../rightsize.csv) (for the glove it has macro precision as a fraction, of which more
is better; here it is 1 - macro precision in %).
"""
SHORT = {  # how a ladder's training differs from that of the tables
    "window": "at most {max_epochs} epochs",
    "lstm": "{streams} parallel streams, {max_epochs} epochs",
}


def references(experiment: str, values: Mapping, judged: pd.DataFrame) -> dict[tuple[str, str], Reference]:
    """(family, condition) -> errors of the constant and of the fully trained model, NaN where there is none.

    A ladder whose models are fully trained needs no other.
    """
    settings, found = values[experiment], {}
    scores = Scores(experiment, settings)
    for (name, condition), own in judged.groupby(["family", "condition"], sort=False):
        metric, protocol = own.iloc[0]["metric"], ladders.protocol(experiment, condition)
        models = ("constant", ladders.FAMILIES[name].model if name in SHORT else "")
        means = [
            scores.estimate(protocol, condition, model, metric).mean if model in settings["models"] else float("nan")
            for model in models
        ]
        found[name, condition] = Reference(*(sizes_verdicts.error_of(mean, metric) for mean in means))
    return found


def shown_error(row: pd.Series) -> str:
    """`mean [low, high]` of one row of enough.JUDGED, or that it failed."""
    value, *ends = (sizes_verdicts.error_of(row[name], row["metric"]) for name in ("value", "low", "high"))
    return markdown.interval(Estimate(value, min(ends), max(ends), row["runs"], row["failed"]), digits(value))


def digits(error: float) -> int:
    """Decimals of an error in its unit."""
    return 3 if error < 1 else 2


def finding(own: pd.DataFrame) -> str:
    """One ladder's verdict in a sentence; own: its rows of enough.JUDGED."""
    first = own.iloc[0]
    scale, unit = sizes_verdicts.SCALES[first["family"]], sizes_verdicts.unit_of(first["metric"], first["unit"])
    where = f"{first['experiment'].capitalize()}, {first['condition'].replace('_', ' ')}"
    start = f"- {where}, {sizes_verdicts.label(first['family'])}, {scale.size_name}: "
    if not own["chosen"].any():
        return start + "every size has a failed run, so none can be chosen."
    small = own[own["chosen"] == 1].iloc[0]
    sound = own[own["failed"] == 0]
    best = sound.loc[sizes_verdicts.error_of(sound["value"], first["metric"]).idxmin()]
    text = f"{small['size']:g} ({markdown.size(small['params'])} parameters) is the smallest that is enough, "
    text += f"{shown_error(small)} {unit}"
    if best["size"] != small["size"]:
        text += f", the best ({best['size']:g}) {shown_error(best)} {unit}"
    elif best["size"] == own["size"].max():
        text += ", the best and the largest of the ladder"
    else:
        text += ", the best"
    published = own[own["size"] == scale.published]
    if published.empty:
        return f"{start}{text}. The published {scale.published:g} is not in this ladder."
    paper = published.iloc[0]
    if paper["size"] == small["size"]:
        return f"{start}{text}. That is the published size: nothing smaller is enough."
    if paper["size"] < small["size"]:
        above = (
            sizes_verdicts.error_of(paper["value"], paper["metric"])
            / sizes_verdicts.error_of(best["value"], best["metric"])
            - 1
        )
        return (
            f"{start}{text}. The published {scale.published:g} has {small['params'] / paper['params']:.3g} times fewer "
            f"parameters; by this rule they are too few: {shown_error(paper)} {unit}, {100 * above:.0f} % above the "
            "best."
        )
    if first["family"] == "window":
        ratio = f"{scale.published / small['size']:.3g} times as many frames"
    else:
        ratio = f"{paper['params'] / small['params']:.3g} times as many parameters"
    return f"{start}{text}. The published {scale.published:g} has {ratio} and {shown_error(paper)} {unit}."


def ladder_table(own: pd.DataFrame) -> str:
    """One family's sizes, a column a condition; own: its rows of enough.JUDGED."""
    scale, first = sizes_verdicts.SCALES[own.iloc[0]["family"]], own.iloc[0]
    conditions, rows = list(dict.fromkeys(own["condition"])), []
    for size, part in own.groupby("size"):
        cells = []
        for condition in conditions:
            found = part[part["condition"] == condition]
            cells.append(
                shown_error(found.iloc[0]) + ("*" if found.iloc[0]["chosen"] else "") if len(found) else "none"
            )
        mark = " (published)" if size == scale.published else ""
        one = part.iloc[0]
        rows.append([f"{size:g}{mark}", markdown.size(one["params"]), markdown.size(one["macs"]), *cells])
    error = f"{sizes_verdicts.NAMES[first['metric']]} ({sizes_verdicts.unit_of(first['metric'], first['unit'])})"
    header = [scale.size_name.capitalize(), "Parameters", "Multiply-accumulates"]
    header += [f"{condition.replace('_', ' ')}: {error}" for condition in conditions]
    return markdown.table(header, rows)


def training_note(name: str, own: pd.DataFrame, values: Mapping, found: Mapping) -> str:
    """How a family was trained, and what that costs against the fully trained model of the tables."""
    scale, first = sizes_verdicts.SCALES[name], own.iloc[0]
    if name not in SHORT:
        return "Every size is trained as the model of the tables; at its own size it is that model itself.\n"
    if name == "lstm":
        training = values["strain"]["study"]["capacity"]["training"]
    else:
        training = values["rightsize"]["touch"][name]["training"]
    unit = sizes_verdicts.unit_of(first["metric"], first["unit"])
    parts = []
    for condition, part in own.groupby("condition", sort=False):
        published = part[part["size"] == scale.published]
        reached = shown_error(published.iloc[0]) if len(published) else "not in the ladder"
        trained = found[name, condition].trained
        full = markdown.number(trained, digits(trained))
        parts.append(f"{condition.replace('_', ' ')} {reached} {unit} against {full} {unit}")
    return (
        f"A shorter training than in the tables, the same for every size: {SHORT[name].format(**training)}. What that "
        f"costs, at the published size ({scale.published:g}) against the fully trained model of params.yaml: "
        f"{'; '.join(parts)}.\n"
    )


def report(judged: pd.DataFrame, values: Mapping, found: Mapping[tuple[str, str], Reference]) -> str:
    """README.md."""
    parts = [INTRODUCTION, "## Findings\n"]
    ladder = ["experiment", "family", "condition"]
    parts.append("\n".join(finding(own) for _, own in judged.groupby(ladder, sort=False)) + "\n")
    for experiment, part in judged.groupby("experiment", sort=False):
        parts.append(f"## {experiment.capitalize()}\n\n![Error against size]({experiment}.png)\n")
        for name, own in part.groupby("family", sort=False):
            parts.append(f"### {sizes_verdicts.label(name)}: {sizes_verdicts.SCALES[name].size_name}\n")
            parts.append(training_note(name, own, values, found))
            parts.append(ladder_table(own))
    return "\n".join([*parts, "\\* the smallest size that is enough.\n"])


def write_csv(path: Path, judged: pd.DataFrame) -> None:
    """enough.JUDGED in full precision; a mean that does not exist is `nan`, as in scores.csv."""
    files.write_table(path, judged.assign(size=[f"{size:g}" for size in judged["size"]]), missing="nan")


def main() -> None:
    """Judge and render all ladders; reports/rightsize is replaced whole."""
    values = params.load()
    judged = {
        experiment: sizes_verdicts.judge(sizes_verdicts.read(experiment, values)) for experiment in ladders.METRIC
    }
    found = {experiment: references(experiment, values, table) for experiment, table in judged.items()}
    everything = pd.concat(judged.values(), ignore_index=True)
    known = {key: value for own in found.values() for key, value in own.items()}
    with files.replacing_folder(paths.REPORTS / "rightsize") as draft:
        for experiment, table in judged.items():
            title = f"{experiment.capitalize()}: how small a model is enough? (lower is better)"
            sizes_figures.curves(draft / f"{experiment}.png", title, table, found[experiment])
        files.write_text(draft / "README.md", report(everything, values, known))
    write_csv(paths.REPORTS / "rightsize.csv", everything)


if __name__ == "__main__":
    run_stage(main)
