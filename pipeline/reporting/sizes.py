"""Write the size ladders of all experiments for people, in reports/rightsize, and as reports/rightsize.csv."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pandas as pd

from pipeline.base import files
from pipeline.base.paths import Workspace
from pipeline.reporting.figures import sizes as sizes_figures
from pipeline.reporting.sentences import caption, picture
from pipeline.reporting.verdicts import sizes as sizes_verdicts
from pipeline.reporting.verdicts.sizes import NAMES, SCALES, SHORTER, UNCLEAR, Reference, error_of, label, unit_of
from pipeline.reporting.words import markdown
from pipeline.reporting.words.labels import capitalised, task_name
from pipeline.scoring import ladders
from pipeline.scoring.results import Estimate

INTRODUCTION = """# How small a model each scene needs

Each of the papers' models at several sizes; everything else stays the same within a ladder. The smallest size is
enough if its test error is certainly at most 5 % above the best size's: the whole interval of the ratio, paired by
seed. Sizes whose interval has both sides of that are not told apart. Runs of a ladder differ in the seed, and with it
in all that a seed draws. Values are mean [95 % t interval]; lower is better. A size with a failed run is never chosen.
A size that falls short does so after this training: a longer one might lift it. The errors are those of the test part:
they decide what is said here and are used for nothing else. All numbers: [rightsize.csv](../rightsize.csv) (for the
glove it has macro precision as a fraction, of which more is better; here it is what macro precision lacks to 100 %).
"""


def write(workspace: Workspace, values: Mapping, folder: Path) -> pd.DataFrame:
    """Judge all ladders, write README.md and one figure per experiment into the empty `folder`, and return JUDGED."""
    tables, references = [], {}
    for experiment in ladders.METRIC:
        judged = sizes_verdicts.judge(sizes_verdicts.read(workspace, experiment, values))
        known = sizes_verdicts.references(workspace, experiment, values, judged)
        title = f"{experiment.capitalize()}: how small a model is enough? (lower is better)"
        sizes_figures.curves(folder / f"{experiment}.png", title, judged, known)
        tables.append(judged)
        references |= known
    everything = pd.concat(tables, ignore_index=True)
    files.write_text(folder / "README.md", report(everything, values, references))
    return everything


def write_csv(path: Path, judged: pd.DataFrame) -> None:
    """Write JUDGED in full precision; a mean that does not exist is `nan`, as in scores.csv."""
    files.write_table(path, judged.assign(size=[f"{size:g}" for size in judged["size"]]), missing="nan")


def shown_error(row: pd.Series) -> str:
    """Return `mean [low, high]` of one row of JUDGED, or that it failed."""
    value, *ends = (error_of(row[name], row["metric"]) for name in ("value", "low", "high"))
    return markdown.interval(Estimate(value, min(ends), max(ends), row["runs"], row["failed"]), digits(value))


def excess_text(row: pd.Series) -> str:
    """Return the error over the best size's of one row of JUDGED, in %."""
    mean, low, high = (100 * row[name] for name in ("excess", "excess_low", "excess_high"))
    return f"{mean:+.1f} %" + ("" if np.isnan(low) else f" [{low:.1f}, {high:.1f}]")


def digits(error: float) -> int:
    """Return the decimals of an error in its unit."""
    return 3 if error < 1 else 2


def finding(ladder: pd.DataFrame) -> str:
    """Return one ladder's verdict in a sentence; ladder: its rows of JUDGED."""
    first = ladder.iloc[0]
    family, metric, scale = first["family"], first["metric"], SCALES[first["family"]]
    unit = unit_of(metric, first["unit"])
    where = f"{capitalised(first['experiment'])}, {task_name(first['condition'])}"
    start = f"- {where}, {label(family)} by {scale.size_name}: "
    if not ladder["chosen"].any():
        return start + "every size has a failed run, so none can be chosen."
    small = ladder[ladder["chosen"] == 1].iloc[0]
    sound = ladder[ladder["failed"] == 0]
    best = sound.loc[error_of(sound["value"], metric).idxmin()]
    text = f"{start}{small['size']:g} ({markdown.size(small['params'])} parameters) is the smallest that is enough, "
    text += f"{shown_error(small)} {unit}"
    if best["size"] != small["size"]:
        text += f", the best ({best['size']:g}) {shown_error(best)} {unit}"
    elif best["size"] == ladder["size"].max():
        text += ", the best and the largest: the ladder is too short to say that more does not help"
    else:
        text += ", the best"
    unclear = ladder[(ladder["verdict"] == UNCLEAR) & (ladder["size"] < small["size"])]
    if len(unclear):
        sizes = ", ".join(f"{row['size']:g} ({excess_text(row)})" for _, row in unclear.iterrows())
        text += f"; smaller and not told apart from within 5 %: {sizes}"
    published = ladder[ladder["size"] == scale.published]
    if published.empty:
        return f"{text}. The published {scale.published:g} is not in this ladder."
    paper = published.iloc[0]
    if paper["size"] == small["size"]:
        return f"{text}. That is the published size: nothing smaller is certainly enough."
    if paper["size"] < small["size"]:
        above = error_of(paper["value"], metric) / error_of(best["value"], metric) - 1
        return (
            f"{text}. The published {scale.published:g} has {small['params'] / paper['params']:.3g} times fewer "
            f"parameters and is {paper['verdict']}: {shown_error(paper)} {unit}, {100 * above:.0f} % above the best."
        )
    if family == "window":
        ratio = f"{scale.published / small['size']:.3g} times as many frames"
    else:
        ratio = f"{paper['params'] / small['params']:.3g} times as many parameters"
    return f"{text}. The published {scale.published:g} has {ratio} and {shown_error(paper)} {unit}."


def figure_caption(judged: pd.DataFrame) -> str:
    """Return the caption of an experiment's figure: the smallest size that is enough, by model and condition."""
    parts = []
    for (family, condition), ladder in judged.groupby(["family", "condition"], sort=False):
        start = f"{label(family)}, {task_name(condition)}: "
        if not ladder["chosen"].any():
            parts.append(f"{start}every size has a failed run")
            continue
        small = ladder[ladder["chosen"] == 1].iloc[0]
        error = error_of(small["value"], small["metric"])
        text = f"{start}the smallest size that is enough is {small['size']:g} ({SCALES[family].size_name})"
        text += f", error {markdown.number(error, digits(error))} {unit_of(small['metric'], small['unit'])}"
        parts.append(text + (", the largest tried" if small["size"] == ladder["size"].max() else ""))
    return caption(*parts)


def ladder_table(judged: pd.DataFrame) -> str:
    """Return a table of one family's sizes, one column per condition; judged: its rows of JUDGED."""
    first, scale = judged.iloc[0], SCALES[judged.iloc[0]["family"]]
    conditions, lines = list(dict.fromkeys(judged["condition"])), []
    for size, rows in judged.groupby("size"):
        cells = {row["condition"]: shown_error(row) + ("*" if row["chosen"] else "") for _, row in rows.iterrows()}
        mark = " (published)" if size == scale.published else ""
        costs = [markdown.size(rows.iloc[0][cost]) for cost in ("params", "macs")]
        lines.append([f"{size:g}{mark}", *costs, *(cells.get(condition, "none") for condition in conditions)])
    error = f"{NAMES[first['metric']]} ({unit_of(first['metric'], first['unit'])})"
    header = [scale.size_name.capitalize(), "Parameters", "Multiply-accumulates"]
    header += [f"{capitalised(task_name(condition))}: {error}" for condition in conditions]
    return markdown.table(header, lines)


def training_note(family: str, judged: pd.DataFrame, values: Mapping, references: Mapping) -> str:
    """Say how a family was trained, and how far its error is from that of the fully trained model of the tables."""
    if family not in SHORTER:
        return "Every size is trained as the model of the tables; at its own size it is that model itself.\n"
    scale, first = SCALES[family], judged.iloc[0]
    if family == "lstm":
        training = "{streams} parallel streams, {epochs} epochs".format(
            **values["strain"]["study"]["capacity"]["training"]
        )
    else:
        training = "{epochs} epochs".format(**values["rightsize"]["touch"][family]["training"])
    unit = unit_of(first["metric"], first["unit"])
    parts = []
    for condition, ladder in judged.groupby("condition", sort=False):
        published = ladder[ladder["size"] == scale.published]
        reached = shown_error(published.iloc[0]) if len(published) else "not in the ladder"
        trained = references[family, condition].trained
        full = markdown.number(trained, digits(trained))
        parts.append(f"{task_name(condition)} {reached} {unit} against {full} {unit}")
    return (
        f"A shorter training than in the tables, the same for every size: {training}. What that "
        f"costs, at the published size ({scale.published:g}) against the fully trained model of params.yaml: "
        f"{'; '.join(parts)}.\n"
    )


def report(judged: pd.DataFrame, values: Mapping, references: Mapping[tuple[str, str], Reference]) -> str:
    """Return README.md."""
    parts = [INTRODUCTION, "## Findings\n"]
    ladder = ["experiment", "family", "condition"]
    parts.append("\n".join(finding(rows) for _, rows in judged.groupby(ladder, sort=False)) + "\n")
    for experiment, part in judged.groupby("experiment", sort=False):
        parts.append(f"## {experiment.capitalize()}\n\n{picture(experiment, figure_caption(part))}\n")
        for family, rows in part.groupby("family", sort=False):
            parts.append(f"### {label(family)}: {SCALES[family].size_name}\n")
            parts += [training_note(family, rows, values, references), ladder_table(rows)]
    return "\n".join([*parts, "\\* the smallest size that is enough.\n"])
