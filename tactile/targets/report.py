"""Write what the tests of targets of one's own came to: a page of Markdown, scores and a picture of each."""

import re
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd

from tactile.base import files
from tactile.drawing import common, templates
from tactile.drawing.markdown import interval, literal, number, table
from tactile.scoring.estimates import Estimate
from tactile.settings.targets import Target
from tactile.targets import figures, validate
from tactile.targets.features import Windows
from tactile.targets.validate import CHOSEN, Tested

MOST_CLASSES = 12  # that are named
PREDICTIONS = "predictions.csv"


class Section(NamedTuple):
    """One target of one sensor."""

    sensor: str
    target: Target
    by: str  # what a group is
    length_s: float  # of a window
    reason: str  # why it is as long
    windows: Windows
    tested: Tested
    recordings: list[str]  # whose windows these are, by their number


def write(folder: Path, title: str, sections: Sequence[Section], sheet: str) -> None:
    """Write README.md, scores.csv and a picture of each target; sheet: a sentence on the data sheet."""
    pictures = [draw(folder, section) for section in sections]
    page = templates.render(
        templates.TEXTS,
        "own_target",
        title=title,
        sheet=sheet,
        sections=[(one, *shown(one), picture) for one, picture in zip(sections, pictures, strict=True)],
    )
    files.write_text(folder / "README.md", page)
    scores = [one.tested.scores.assign(sensor=one.sensor, target=one.target.name) for one in sections]
    table_of_all = pd.concat(scores)[["sensor", "target", *validate.COLUMNS]]
    files.write_text(folder / "scores.csv", table_of_all.to_csv(index=False))


def draw(folder: Path, section: Section) -> str:
    """Draw what is said of groups that were held out, predicted over true numbers or confusions; return the file."""
    tested, windows, target = section.tested, section.windows, section.target
    name = re.sub(r"[^a-z0-9]+", "_", f"{section.sensor} {target.name}".lower()).strip("_") + ".png"
    if not windows.classes:
        pairs = ((windows.y[tested.fold == k, 0], tested.guess[tested.fold == k, 0]) for k in range(len(tested.chosen)))
        title = f"{target.name} on a {section.by} that was held out"
        figures.agreement(folder / name, title, target.unit, dict(zip(tested.chosen, pairs, strict=True)))
        return name
    truth, said = windows.y, tested.guess
    if votes := target.kind == "class":
        truth, said = (validate.voted(windows.unit, each) for each in (truth, said))
    counts = np.zeros((len(windows.classes),) * 2)
    np.add.at(counts, (truth.argmax(axis=1), said.argmax(axis=1)), 1)
    title, items = f"{target.name} on a {section.by} that was held out", "votes" if votes else "windows"
    common.confusion_matrix(folder / name, counts, windows.classes, title, target.name, items)
    return name


def predictions(section: Section) -> pd.DataFrame:
    """Return what the model that the other groups chose says of each window of a group that it has not seen."""
    tested, windows = section.tested, section.windows
    place = {
        "test": np.array(list(tested.chosen))[tested.fold],
        "recording": np.array(section.recordings)[windows.recording],
        "t_s": windows.time_s,
    }
    if not windows.classes:
        return pd.DataFrame(place | {"true": windows.y[:, 0], "predicted": tested.guess[:, 0]})
    names, best = np.array(windows.classes), tested.guess.argmax(axis=1)
    score = np.take_along_axis(tested.guess, best[:, None], axis=1)[:, 0]
    return pd.DataFrame(place | {"true": names[windows.y.argmax(axis=1)], "predicted": names[best], "score": score})


def shown(section: Section) -> tuple[str, str, str, str]:
    """Return what is asked in words, the table of models, that of tests, and what intervals are of."""
    tested, windows = section.tested, section.windows
    scores, unit = tested.scores, section.target.unit
    metrics = list(dict.fromkeys(scores[scores["model"] != CHOSEN]["metric"]))
    models = list(dict.fromkeys(scores["model"]))
    heads = {metric: f"{metric} ({unit})" for metric in (validate.RMSE, validate.HALF_WIDTH)}
    rows = [[model, *(cell(validate.over_tests(tested, model, metric)) for metric in metrics)] for model in models]
    by_model = table(["Model", *(heads.get(metric, metric) for metric in metrics)], rows) if metrics else ""
    own = scores[scores["model"] == CHOSEN]
    every = list(dict.fromkeys(own["metric"]))
    rows = []
    for test, row in tested.chosen.items():
        values = own[own["test"] == test].set_index("metric")["value"].reindex(every)
        rows.append([literal(test), row, *(number(value, digits(value)) for value in values)])
    rows.append(["mean", "", *(cell(validate.over_tests(tested, CHOSEN, metric)) for metric in every)])
    by_test = table(["Test", "Chosen", *(heads.get(metric, metric) for metric in every)], rows)
    count = f"{len(tested.chosen)} tests{' of one group' if tested.groups == 1 else ''}"
    over = f"Means (of RMSE and widths geometric) and their 95 % intervals are over the {count}."
    if tested.groups < validate.FEWEST:
        over = f"How far the scores would differ with other groups, {count} cannot tell: there is no interval."
    kinds = windows.classes if section.target.kind == "class" else []
    listed = ", ".join(map(literal, kinds[:MOST_CLASSES])) + (" and others" if len(kinds) > MOST_CLASSES else "")
    asked = {
        "continuous": f"A number, in {literal(unit)}.",
        "class": f"One of {len(kinds)} classes: {listed}.",
        "event": "Something that happens or not.",
    }[section.target.kind]
    return asked, by_model, by_test, over


def cell(found: Estimate) -> str:
    """Return a mean with its interval; "cannot tell" without a test that has a value."""
    known = found._replace(failed=0)  # a test without an event, or too short to calibrate, is no failure
    return interval(known, digits(found.mean)) if found.runs else "cannot tell"


def digits(value: float) -> int:
    """Return the decimals that show three digits of a value; three of what is below 1, unless it is very small."""
    if not np.isfinite(value) or value == 0:
        return 2
    size = abs(value)
    return 3 if 0.01 <= size < 1 else int(np.clip(2 - np.floor(np.log10(size)), 0, 6))
