"""Keep the model of a target, and predict with it: the readings of a log in, numbers or classes with intervals out.

A folder has target.json, the card, and the fitted estimator as skops, which executes no code when it is read.
"""

from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple

import numpy as np
import pyarrow as pa
from pydantic import BaseModel, ConfigDict, Field, model_validator

from tactile.base import cards, correlation, files, foreign, provenance, ranges
from tactile.base.cards import Words
from tactile.base.correlation import Correlation
from tactile.base.errors import InputError
from tactile.datasets import images, schemas
from tactile.experiments import facts, log_name, module, sensor_format
from tactile.learning.window_statistics import KINDS
from tactile.logs import unmeasured
from tactile.scoring import conformal, metrics
from tactile.settings.targets import Target
from tactile.targets import features, models, read, validate
from tactile.targets.features import Windows
from tactile.targets.read import Data, Readings
from tactile.targets.validate import Final, Tested

CARD, WEIGHTS = cards.TARGET, "estimator.skops"
AGAIN = "train it again with `tactile own FOLDER`"
TRUSTED = ("sklearn.tree._tree.Tree",)  # learning/structure.py checks its nodes
LONGEST_S = 3600.0  # of a window
MOST_ELEMENTS = 1 << 20
READ = ("sensor", "ingest")  # blocks of settings that say how a log is read
SAME_RATE = 1.1  # ratio of times from reading to reading, as inference.timing.TOLERANCE
SOME_VALUES = 1 << 22  # of statistics at once, 16 MB


class Log(BaseModel):
    """A recording that a model was fitted to."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    name: Words  # its path below the sensor's folder
    sha256: cards.Digest  # of the sensor's log, files.content_sha256
    tests: list[Words]  # in which it was held out


class Card(BaseModel):
    """All that a saved model of a target needs beside its estimator, and what it was tested to be worth."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    experiment: Literal["touch", "strain", "glove"]
    sensor: Words
    target: Target
    settings: dict[str, dict]  # READ
    window_s: Annotated[float, Field(gt=0, le=LONGEST_S)]
    elements: Annotated[int, Field(ge=1, le=MOST_ELEMENTS)]
    model: Words  # the row of the table that all groups chose
    view: Literal["level", "above the start", "without level"]  # of the statistics, features.VIEWS
    classes: list[Words]  # in the order of the scores; [] of numbers
    bound: Annotated[float, Field(ge=0)] | None = (
        None  # half width of an interval, or least score of a class in a set; None: cannot tell
    )
    units: Annotated[int, Field(ge=0)]  # presses, grasps or pieces of a series that the bound is of
    by: Words  # what a group is
    groups: list[Words]  # that it was fitted to
    scores: dict[Words, float]  # metric -> mean over tests of groups apart, chosen on the other groups
    commit: Words
    version: Words | None = None  # of this project; None: the card was written before 0.2.0
    files: cards.Files  # of the package, by name: the estimator's, and the card itself
    interval_s: Annotated[float, Field(gt=0)] | None = (
        None  # from one reading of the training to the next; None: not known
    )
    correlation: Correlation | None = None  # of the channels in training; None: not known, or it tells nothing
    trained_on: Annotated[list[ranges.Columns], Field(min_length=1)] | None = (
        None  # None: nobody knows which readings lie outside the training
    )
    logs: list[Log] | None = None  # None: nobody knows which logs it was fitted to
    tests: dict[Words, dict[Words, float]] = {}  # test -> metric -> value, by the model that the other groups chose

    @model_validator(mode="before")
    @classmethod
    def _of_version_0_2(cls, given: Any) -> Any:
        """Read `level`, true or false, which cards had in place of `view`."""
        if not isinstance(given, dict) or not isinstance(given.get("level"), bool) or "view" in given:
            return given
        view = features.LEVEL if given["level"] else features.NO_LEVEL
        return {name: value for name, value in given.items() if name != "level"} | {"view": view}


class Kept(NamedTuple):
    """A saved model of a target."""

    card: Card
    estimator: Any


class Predicted(NamedTuple):
    """What is predicted for n readings; guess (n, 1) or (n, classes)."""

    guess: np.ndarray
    low: np.ndarray  # (n,) of the 90 % interval of numbers; NaN: cannot tell, or outside
    high: np.ndarray  # (n,)
    sets: np.ndarray  # (n, classes) bool: the 90 % set; all: cannot tell
    outside: np.ndarray  # (n,) bool: a reading of the window lies outside the training, so that no set is told either


def write(folder: Path, final: Final, windows: Windows, scores: Mapping[str, float], **described) -> None:
    """Write a model to `folder`, which exists; described: the fields of `Card` that neither of them tells."""
    from tactile.learning import estimators  # here, because the import of torch takes seconds

    estimators.write(folder, final.estimator)
    told = final.bound > 0 if windows.classes else np.isfinite(final.bound)
    card = Card(
        version=provenance.version(),
        elements=windows.x.shape[2],
        model=final.row.name,
        view=final.row.view,
        classes=windows.classes,
        bound=final.bound if told else None,
        units=final.units,
        groups=windows.groups,
        scores={name: float(value) for name, value in scores.items() if np.isfinite(value)},
        files={estimators.ESTIMATOR_FILE: files.sha256(folder / estimators.ESTIMATOR_FILE)},
        **described,
    )
    cards.write(folder / CARD, card, exclude_none=True)


def trained_on(data: Data, experiment: str, settings: Mapping) -> list[ranges.Columns]:
    """Return the ranges of the readings that count; settings: the block of the experiment."""
    x = np.concatenate([each.reading[each.press >= 0] for each in data.series])
    kind = module(experiment).KIND
    if kind == "images":
        areas = {name: area.cells for name, area in images.areas(settings).items()}
        return ranges.of_areas(x, areas, list(areas))
    mean_margin = ranges.MEAN_MARGIN_OF_TOUCHES if kind == "windows" else ranges.MEAN_MARGIN
    return [ranges.of(x, "v", 0, range(x.shape[1]), mean_margin)]


def logs(folder: Path, data: Data, experiment: str, windows: Windows) -> list[Log]:
    """Return the recordings below a sensor's folder that windows are of, with the tests in which they were held out."""
    fold, names, _ = validate.tests(windows, data.by)
    found = []
    for number in np.unique(windows.recording):
        name, held_out = data.series[number].name, np.unique(fold[windows.recording == number])
        digest = files.content_sha256(folder / name / log_name(experiment))
        found.append(Log(name=name, sha256=digest, tests=[names[k] for k in held_out]))
    return found


def tests(tested: Tested) -> dict[str, dict[str, float]]:
    """Return test -> metric -> value of the models that the other groups chose."""
    of_chosen = tested.scores[tested.scores["model"] == validate.CHOSEN]
    return {
        name: {metric: float(value) for metric, value in zip(rows["metric"], rows["value"], strict=True)}
        for name, rows in of_chosen[np.isfinite(of_chosen["value"])].groupby("test", sort=False)
    }


def load(folder: Path) -> Kept:
    """Return the model in a folder; InputError where card or estimator is damaged, or does not fit the other."""
    from tactile.learning import estimators

    card = read_card(folder)
    outputs = max(1, len(card.classes))
    estimator = estimators.read(folder, TRUSTED)
    with foreign.reading(folder / estimators.ESTIMATOR_FILE, f"a model of {CARD}", AGAIN):
        zeros = np.zeros((1, KINDS, card.elements), np.float32)
        nothing = features.columns(zeros, zeros[:, 0], card.view)
        estimators.check_prediction(lambda x: models.predicted(estimator, x, outputs), nothing, outputs)
    return Kept(card, estimator)


def read_card(folder: Path) -> Card:
    """Return the card in a folder; InputError where it is broken or does not fit itself, or is not the estimator's."""
    path = folder / CARD
    card = cards.read(path, Card, (WEIGHTS,), AGAIN)
    check(card, path)
    return card


def check(card: Card, path: Path) -> None:
    """Raise InputError, which names `path`, where the parts of a card do not fit one another."""
    cards.check_blocks(path, "settings", card.experiment, card.settings, READ, AGAIN)
    try:
        columns = len(sensor_format(card.experiment, card.settings).names) - 1
    except Exception as error:  # what the code of an experiment makes of settings that no sensor has
        raise InputError(f"{path}, settings: {foreign.reason(error)}; {AGAIN}") from error
    seen = list(range(columns))
    named = [each.name for each in models.rows(card.target.kind, 1)]
    order = card.settings["sensor"].get("order", [])
    facts = {
        "elements": (card.elements == columns, f"by settings.sensor it is {columns}"),
        "settings.sensor.order": (sorted(order) in ([], seen), "it has to name each column once, or none"),
        "model": (card.model in named, f"it is one of {', '.join(named)}"),
        "classes": (
            not card.classes if card.target.kind == "continuous" else 1 < len(card.classes) == len(set(card.classes)),
            "a number has none, and what is no number has two or more, each once",
        ),
        "trained_on": (
            card.trained_on is None or ranges.places(card.trained_on) == seen,
            "it has a range for each element",
        ),
        "correlation.columns": (
            card.correlation is None or set(card.correlation.columns) <= set(seen),
            f"a reading has the columns 0 to {columns - 1}",
        ),
    }
    for key, (holds, words) in facts.items():
        if not holds:
            raise InputError(f"{path}, {key}: {words}; {AGAIN}")


def predict(kept: Kept, log: Readings) -> Predicted:
    """Return a prediction for every reading of a log; InputError for another number of elements."""
    card, n = kept.card, len(log.time_s)
    if log.reading.shape[1] != card.elements:
        raise InputError(
            f"{log.reading.shape[1]} readings a line, but the model of {card.sensor} takes {card.elements}"
        )
    some = max(1, SOME_VALUES // (6 * card.elements))
    parts, start = [], features.start(log.time_s, log.reading) if n else None
    for first in range(0, n, some):
        ends = np.arange(first, min(first + some, n))
        found = features.statistics(log.time_s, log.segment, log.reading, ends, card.window_s)
        x = features.columns(found, start, card.view)
        parts.append(models.predicted(kept.estimator, x, max(1, len(card.classes))))
    guess, outside = np.concatenate(parts), _outside(log, card, unmeasured_rows(log))
    if card.classes:
        none = np.full(n, np.nan)
        return Predicted(guess, none, none, conformal.class_sets(guess, card.bound or 0.0), outside)
    half = np.where(outside, np.nan, np.nan if card.bound is None else card.bound)
    return Predicted(guess, guess[:, 0] - half, guess[:, 0] + half, np.empty((n, 0), bool), outside)


def interval_s(data: Data) -> float:
    """Return the usual time from one reading to the next (s)."""
    return float(np.median(np.concatenate([np.diff(each.time_s) for each in data.series])))


def correlated(data: Data, experiment: str) -> Correlation | None:
    """Return how the channels go together, of strands; elements and cells go together as they are touched."""
    if module(experiment).KIND != "series":
        return None
    nowhere = [np.zeros(len(each.time_s), bool) for each in data.series]
    parts = [
        part
        for each, none in zip(data.series, nowhere, strict=True)
        for part in correlation.stretches(each.reading, schemas.gaps_before(each.time_s, each.segment), none)
    ]
    return correlation.of(parts, range(data.series[0].reading.shape[1]))


def unmeasured_rows(log: Readings) -> np.ndarray:
    """Return which readings of a log are no measurement, (n,) bool."""
    return unmeasured.rows(unmeasured.found(log.time_s, log.reading), len(log.time_s))


def notes(log: Readings, card: Card) -> list[str]:
    """Return sentences on what is no measurement, on another rate, and on channels unlike those of the training."""
    names = sensor_format(card.experiment, card.settings).names[1:]
    found = unmeasured.found(log.time_s, log.reading)
    said, n = unmeasured.sentences(found, log.time_s, names), len(log.time_s)
    here_s = float(np.median(np.diff(log.time_s))) if n > 1 else card.interval_s
    alike = card.interval_s is None or 1 / SAME_RATE <= here_s / card.interval_s <= SAME_RATE
    if not alike:
        said.append(
            f"the log has {1 / here_s:.3g} readings a second by its times, the model's training "
            f"{1 / card.interval_s:.3g}: expect larger errors than the card's, or mend the unit of the times"
        )
    elif card.correlation is not None:
        begins = schemas.gaps_before(log.time_s, log.segment)
        parts = [*correlation.stretches(log.reading, begins, unmeasured.rows(found, n))]
        said += correlation.sentences(card.correlation, parts, names)
    return said


def _outside(log: Readings, card: Card, none: np.ndarray) -> np.ndarray:
    """Return whether a reading of the window that ends with each one lies outside the training, (n,) bool.

    none: (n,) bool, readings that are no measurement, which are outside whatever they are.
    """
    ends = np.arange(len(log.time_s))
    before = np.append(0, np.cumsum(ranges.outside(log.reading, card.trained_on) | none))
    return before[ends + 1] > before[features.firsts(log.time_s, log.segment, ends, card.window_s)]


def schema(card: Card) -> pa.Schema:
    """Return the columns of a table of predictions, one row per reading."""
    numbers = {"predicted": pa.float64(), "low": pa.float64(), "high": pa.float64()}
    names = pa.list_(pa.string())
    classes = {"predicted": schemas.NAME, "score": pa.list_(pa.float64(), len(card.classes)), "set": names}
    known = {} if card.trained_on is None else {"outside_training": pa.bool_()}
    return pa.schema({"recording": schemas.NAME, "t_s": pa.float64()} | (classes if card.classes else numbers) | known)


def table(name: str, log: Readings, said: Predicted, card: Card) -> pa.Table:
    """Return the rows of a recording with this name."""
    columns = {"recording": schemas.repeated(name, len(log.time_s)), "t_s": log.time_s}
    if card.classes:
        names, order = np.array(card.classes), np.argsort(-said.guess, axis=1, kind="stable")
        columns["predicted"] = names[order[:, 0]]
        columns["score"] = schemas.lists(said.guess, pa.float64())
        sets = [[str(names[k]) for k in row if of[k]] for row, of in zip(order, said.sets, strict=True)]
        columns["set"] = [None if out else each for each, out in zip(sets, said.outside, strict=True)]
    else:
        columns |= {"predicted": said.guess[:, 0], "low": said.low, "high": said.high}
    if card.trained_on is not None:
        columns["outside_training"] = said.outside
    return pa.table(columns)


def summary(name: str, path: Path, log: Readings, said: Predicted, card: Card) -> dict:
    """Return what a recording came to: readings, rejected lines by reason, range or counts of predictions.

    Of a class also the vote of the whole recording.
    """
    found = {
        "recording": name,
        "log": str(path),
        "readings": len(log.time_s),
        "seconds": round(float(schemas.steps(log.time_s).sum()), 3),
        "rejected_lines": dict(Counter(log.rejects["reason"].to_pylist())),
    }
    if card.classes:
        best = Counter(card.classes[k] for k in said.guess.argmax(axis=1))
        found["predicted"] = dict(best.most_common())
        if card.target.kind == "class":
            found["vote"] = card.classes[int(said.guess.mean(axis=0).argmax())]
    else:
        found["predicted"] = {"least": float(said.guess.min()), "most": float(said.guess.max())}
    if card.trained_on is not None:
        unit = card.settings["sensor"].get("unit", facts(card.experiment).unit)
        lacking = "set" if card.classes else "interval"
        by_range = _outside(log, card, np.zeros(len(log.time_s), bool))
        found |= ranges.summary(log.reading, by_range, card.trained_on, unit, lacking)
        found["share_outside_training"] = float(said.outside.mean())
    if told := notes(log, card):
        found["notes"] = told
    return found


def scored(path: Path, log: Readings, said: Predicted, card: Card) -> dict:
    """Return what the summary of a recording says of scores: {} without a truth, else `scores`, metric -> value.

    A recording that the model was fitted to has none, but the reason as `not_scored`, and as `held_out` the scores of
    the tests in which it was held out, their mean where it was in several; `held_out_of` names them. Errors as
    `read.truth_of`.
    """
    digest = files.content_sha256(path) if card.logs else ""
    known = [test for each in card.logs or [] if each.sha256 == digest for test in each.tests]
    if not known:
        found = scores(path.parent, log, said, card)
        return {"scores": found} if found else {}
    held_out = [card.tests[name] for name in dict.fromkeys(known) if name in card.tests]
    metrics_ = dict.fromkeys(metric for each in held_out for metric in each)
    means = {
        heading(metric, card): float(np.mean([each[metric] for each in held_out if metric in each]))
        for metric in metrics_
    }
    test = f"test of {known[0]}" if len(held_out) == 1 else f"{len(held_out)} tests that it is in"
    found = {"scores": None, "not_scored": cards.SEEN}
    return found | ({"held_out": means, "held_out_of": test} if means else {})


def heading(metric: str, card: Card) -> str:
    """Return the name of a metric, with its unit where that is the target's."""
    return f"{metric} ({card.target.unit})" if metric in (validate.RMSE, validate.HALF_WIDTH) else metric


def scores(folder: Path, log: Readings, said: Predicted, card: Card) -> dict[str, float]:
    """Return the scores of single readings, with the share of intervals or sets that hold the truth; {} without truth.

    Readings outside the training have no interval or set, and do not count in that share.
    """
    target = card.target
    beside = target.file is not None and (folder / target.file).is_file()
    called = None if target.folder is None else folder.absolute().parts[-3 + target.folder]
    if not beside and called not in card.classes:
        return {}
    truth, known = read.truth_of(folder.absolute(), target, card.experiment, card.settings, log.time_s, log.segment)
    truth, guess = truth[known], said.guess[known]
    if target.kind == "continuous":
        rows = metrics.overall(truth[:, None], guess, target.unit)
        names = (heading(validate.RMSE, card), validate.R2)
        inside = (said.low[known] <= truth) & (truth <= said.high[known])
        found = {each: value for each, (_, _, value, _) in zip(names, rows, strict=True) if np.isfinite(value)}
    else:
        answer, truth = np.array(card.classes)[guess.argmax(axis=1)], truth.astype(str)
        inside = (said.sets[known] & (truth[:, None] == np.array(card.classes))).any(axis=1)
        found = {"right": float(np.mean(answer == truth))}
        if target.kind == "event":
            names = ("precision", "recall", "F1")
            found |= dict(zip(names, map(float, validate.f1(truth == "True", answer == "True")), strict=True))
    told = ~said.outside[known]
    return found | ({validate.COVERAGE: float(inside[told].mean())} if card.bound is not None and told.any() else {})


def interval(card: Card) -> str:
    """Say what the intervals or sets are of, on how much they were calibrated, and where they do not hold."""
    on = f"calibrated on {card.units} presses or pieces of recordings, by models of other parts of the groups"
    percent, what = f"{100 * conformal.LEVEL:.0f} %", "set" if card.classes else "interval"
    if card.bound is None:
        return f"{card.target.name}: no {percent} {what} can be told; {on}"
    coverage = {test: scores[validate.COVERAGE] for test, scores in card.tests.items() if validate.COVERAGE in scores}
    limits = validate.held(coverage, card.by), validate.within(len(card.groups), card.by, what)
    on = "; ".join([on, *filter(None, limits)])
    if card.classes:
        return f"{card.target.name}: {percent} set, of all with a score of {card.bound:.3g} or more; {on}"
    return f"{card.target.name}: {percent} interval, +- {card.bound:.3g} {card.target.unit}; {on}"
