"""Keep the model of a target, and predict with it: the readings of a log in, numbers or classes with intervals out.

A folder has target.json, the card, and the fitted estimator as skops, which executes no code when it is read.
"""

from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pyarrow as pa
from pydantic import BaseModel, ConfigDict

from pipeline.base import cards, files
from pipeline.base.errors import InputError
from pipeline.datasets import schemas
from pipeline.scoring import conformal, metrics
from pipeline.settings.targets import Target
from pipeline.targets import features, models, read, validate
from pipeline.targets.features import Windows
from pipeline.targets.read import Readings
from pipeline.targets.validate import Final

CARD = "target.json"
TRUSTED = ("sklearn.tree._tree.Tree",)  # node indices are not checked on loading: load your own files only
READ = ("sensor", "ingest")  # blocks of settings that say how a log is read
SOME_VALUES = 1 << 22  # of statistics at once, 16 MB


class Card(BaseModel):
    """All that a saved model of a target needs beside its estimator, and what it was tested to be worth."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    experiment: str
    sensor: str
    target: Target
    settings: dict[str, dict]  # READ
    window_s: float
    elements: int
    model: str  # the row of the table that all groups chose
    level: bool  # whether it sees the level, or only what a drift of the rest leaves alone
    classes: list[str]  # in the order of the scores; [] of numbers
    bound: float | None = None  # half width of an interval, or least score of a class in a set; None: cannot tell
    units: int  # presses, grasps or pieces of a series that the bound is of
    by: str  # what a group is
    groups: list[str]  # that it was fitted to
    scores: dict[str, float]  # metric -> mean over tests of groups apart, chosen on the other groups
    commit: str
    sha256: str  # of the estimator's file


class Kept(NamedTuple):
    """A saved model of a target."""

    card: Card
    estimator: Any


class Predicted(NamedTuple):
    """What is predicted for n readings; guess (n, 1) or (n, classes)."""

    guess: np.ndarray
    low: np.ndarray  # (n,) of the 90 % interval of numbers; NaN: cannot tell
    high: np.ndarray  # (n,)
    sets: np.ndarray  # (n, classes) bool: the 90 % set; all: cannot tell


def write(folder: Path, final: Final, windows: Windows, scores: Mapping[str, float], **described) -> None:
    """Write a model to `folder`, which exists; described: the fields of `Card` that neither of them tells."""
    from pipeline.learning import estimators  # here, because the import of torch takes seconds

    estimators.write(folder, final.estimator)
    told = final.bound > 0 if windows.classes else np.isfinite(final.bound)
    card = Card(
        elements=windows.x.shape[2],
        model=final.row.name,
        level=final.row.level,
        classes=windows.classes,
        bound=final.bound if told else None,
        units=final.units,
        groups=windows.groups,
        scores={name: float(value) for name, value in scores.items() if np.isfinite(value)},
        sha256=files.sha256(folder / estimators.ESTIMATOR_FILE),
        **described,
    )
    files.write_text(folder / CARD, card.model_dump_json(indent=1, exclude_none=True) + "\n")


def load(folder: Path) -> Kept:
    """Return the model in a folder; InputError where card or estimator is damaged, or is not the other's."""
    from pipeline.learning import estimators

    weights, again = folder / estimators.ESTIMATOR_FILE, "train it again with `tactile own FOLDER`"
    card = cards.read(folder / CARD, Card, weights, again)
    return Kept(card, estimators.read(folder, TRUSTED))


def predict(kept: Kept, log: Readings) -> Predicted:
    """Return a prediction for every reading of a log; InputError for another number of elements."""
    card, n = kept.card, len(log.time_s)
    if log.reading.shape[1] != card.elements:
        raise InputError(
            f"{log.reading.shape[1]} readings a line, but the model of {card.sensor} takes {card.elements}"
        )
    some = max(1, SOME_VALUES // (6 * card.elements))
    parts = []
    for first in range(0, n, some):
        ends = np.arange(first, min(first + some, n))
        found = features.statistics(log.time_s, log.segment, log.reading, ends, card.window_s)
        x = features.columns(found, card.level)
        parts.append(models.predicted(kept.estimator, x, max(1, len(card.classes))))
    guess = np.concatenate(parts)
    if card.classes:
        none = np.full(n, np.nan)
        return Predicted(guess, none, none, conformal.class_sets(guess, card.bound or 0.0))
    half = np.nan if card.bound is None else card.bound
    return Predicted(guess, guess[:, 0] - half, guess[:, 0] + half, np.empty((n, 0), bool))


def schema(card: Card) -> pa.Schema:
    """Return the columns of a table of predictions, one row per reading."""
    numbers = {"predicted": pa.float64(), "low": pa.float64(), "high": pa.float64()}
    names = pa.list_(pa.string())
    classes = {"predicted": schemas.NAME, "score": pa.list_(pa.float64(), len(card.classes)), "set": names}
    return pa.schema({"recording": schemas.NAME, "t_s": pa.float64()} | (classes if card.classes else numbers))


def table(name: str, log: Readings, said: Predicted, card: Card) -> pa.Table:
    """Return the rows of a recording with this name."""
    columns = {"recording": schemas.repeated(name, len(log.time_s)), "t_s": log.time_s}
    if card.classes:
        names, order = np.array(card.classes), np.argsort(-said.guess, axis=1, kind="stable")
        columns["predicted"] = names[order[:, 0]]
        columns["score"] = schemas.lists(said.guess, pa.float64())
        columns["set"] = [[str(names[k]) for k in row if of[k]] for row, of in zip(order, said.sets, strict=True)]
    else:
        columns |= {"predicted": said.guess[:, 0], "low": said.low, "high": said.high}
    return pa.table(columns)


def summary(name: str, path: Path, log: Readings, said: Predicted, card: Card) -> dict:
    """Return what a recording came to: readings, rejected lines by reason, range or counts of predictions, scores.

    Of a class also the vote of the whole recording. Scores are there where the truth lies beside the log, or is the
    name of a folder that is a class; errors as `read.truth_of`.
    """
    found = {
        "recording": name,
        "log": str(path),
        "readings": len(log.time_s),
        "seconds": round(float(log.time_s[-1] - log.time_s[0]), 3),
        "rejected_lines": dict(Counter(log.rejects["reason"].to_pylist())),
    }
    if card.classes:
        best = Counter(card.classes[k] for k in said.guess.argmax(axis=1))
        found["predicted"] = dict(best.most_common())
        if card.target.kind == "class":
            found["vote"] = card.classes[int(said.guess.mean(axis=0).argmax())]
    else:
        found["predicted"] = {"least": float(said.guess.min()), "most": float(said.guess.max())}
    if scores := scored(path.parent, log, said, card):
        found["scores"] = scores
    return found


def scored(folder: Path, log: Readings, said: Predicted, card: Card) -> dict[str, float]:
    """Return the scores of single readings, with the share of intervals or sets that hold the truth; {} without."""
    target = card.target
    beside = target.file is not None and (folder / target.file).is_file()
    called = None if target.folder is None else folder.absolute().parts[-3 + target.folder]
    if not beside and called not in card.classes:
        return {}
    truth, known = read.truth_of(folder.absolute(), target, card.experiment, card.settings, log.time_s, log.segment)
    truth, guess = truth[known], said.guess[known]
    if target.kind == "continuous":
        rows = metrics.overall(truth[:, None], guess, target.unit)
        names = (f"{validate.RMSE} ({target.unit})", validate.R2)
        inside = (said.low[known] <= truth) & (truth <= said.high[known])
        scores = {each: value for each, (_, _, value, _) in zip(names, rows, strict=True) if np.isfinite(value)}
    else:
        answer, truth = np.array(card.classes)[guess.argmax(axis=1)], truth.astype(str)
        inside = (said.sets[known] & (truth[:, None] == np.array(card.classes))).any(axis=1)
        scores = {"right": float(np.mean(answer == truth))}
        if target.kind == "event":
            names = ("precision", "recall", "F1")
            scores |= dict(zip(names, map(float, validate.f1(truth == "True", answer == "True")), strict=True))
    return scores | ({} if card.bound is None else {validate.COVERAGE: float(inside.mean())})


def interval(card: Card) -> str:
    """Say what the intervals or sets are of, and on how much they were calibrated."""
    on = f"calibrated on {card.units} presses or pieces of recordings, by models of other parts of the groups"
    percent = f"{100 * conformal.LEVEL:.0f} %"
    if card.bound is None:
        return f"{card.target.name}: no {percent} {'set' if card.classes else 'interval'} can be told; {on}"
    if card.classes:
        return f"{card.target.name}: {percent} set, of all with a score of {card.bound:.3g} or more; {on}"
    return f"{card.target.name}: {percent} interval, +- {card.bound:.3g} {card.target.unit}; {on}"
