"""Test a target on each group by models that were trained, and chosen, on the other groups.

The groups that train are divided once more: each part is predicted by models of the other parts. These predictions
choose the penalty of ridge regression and the row of the table that is the product's answer, and their errors calibrate
its 90 % intervals. The group that is tested is read once, after that.
"""

from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from sklearn.metrics import precision_recall_fscore_support

from tactile.scoring import conformal, estimates, metrics
from tactile.targets import models
from tactile.targets.features import Windows
from tactile.targets.models import Row

MOST_TESTS = 10  # of more groups, several are tested together
INNER = 4  # parts of what trains
FEWEST = 3  # groups that an interval is of
CHOSEN = "chosen on the other groups"
RMSE, R2, HALF_WIDTH, CLASSES = "RMSE", "R2", "half width of an interval", "classes in a set"
SCALES = {
    RMSE: estimates.LOG,
    R2: estimates.R2,
    HALF_WIDTH: estimates.LOG,
    CLASSES: estimates.LOG,
}  # all others are shares
COVERAGE = "coverage"
COLUMNS = ["test", "model", "metric", "unit", "value", "n"]


class Tested(NamedTuple):
    """What the tests of all groups came to."""

    scores: pd.DataFrame  # with COLUMNS
    chosen: dict[str, str]  # test -> the row that the other groups chose
    warnings: list[str]
    groups: int  # that are apart from each other; tests within one group tell nothing of others
    fold: np.ndarray  # (n,) number of the test that held a window out, in the order of `chosen`
    guess: np.ndarray  # (n, outputs) of windows by the model that the other groups chose


def test_groups(windows: Windows, kind: str, unit: str, by: str, trees: int) -> Tested:
    """Test every group; kind, unit: of the target; by: what a group is; trees: of a forest."""
    rows, scores, chosen, said = models.rows(kind, trees), [], {}, np.empty_like(windows.y)
    fold, names, warnings = tests(windows, by)
    for number, name in enumerate(names):
        trains, test = np.flatnonzero(fold != number), np.flatnonzero(fold == number)
        inner = parts(windows, trains)
        warnings += missing(windows, trains, test, name)
        guesses, held_out = {}, {}
        for row in rows:
            estimator, held_out[row.name] = fitted(row, windows, trains, inner, kind)
            x = windows.columns(row.view)[test]
            guesses[row.name] = models.predicted(estimator, x, windows.y.shape[1])
            del estimator  # before the next one comes, see `fitted`
        best = max(guesses, key=lambda row: headline(kind, windows.y[trains], held_out[row]))
        chosen[name], said[test] = best, guesses[best]
        for row, guess in (*guesses.items(), (CHOSEN, guesses[best])):
            scores += [(name, row, *score) for score in scored(windows, test, guess, kind, unit)]
        of_intervals = covered(windows, trains, held_out[best], test, guesses[best], kind, unit)
        scores += [(name, CHOSEN, *score) for score in of_intervals]
    found = pd.DataFrame(scores, columns=COLUMNS)
    groups = len(windows.groups)
    coverage = found[(found["metric"] == COVERAGE) & np.isfinite(found["value"])].set_index("test")["value"]
    what = "interval" if kind == "continuous" else "set"
    if words := held(coverage, by):
        warnings.append(f"A 90 % {what} is off: {words}.")
    if len(coverage) and (words := within(groups - 1, by, what)):  # the group that is tested calibrates nothing
        warnings.append(f"In each test, a 90 % {what} is calibrated {words}.")
    return Tested(found, chosen, list(dict.fromkeys(warnings)), groups, fold, said)


def held(coverage: Mapping[str, float], by: str) -> str:
    """Say the coverage that has to stand wherever an interval does, as conformal.held; coverage: test -> share."""
    return conformal.held(coverage, "parts" if by == "time" else conformal.plural(by))


def within(groups: int, by: str, what: str) -> str:
    """Say within what an interval or a set holds, calibrated on so many groups; empty where it is on several."""
    if by == "time":
        return f"within the same recordings: no {what} for another recording"
    return f"within one {by}: no {what} for another {by}" if groups <= 1 else ""


def tests(windows: Windows, by: str) -> tuple[np.ndarray, list[str], list[str]]:
    """Return the number of the test that each window is of (n,), the tests' names, and what is to be said of them."""
    groups, warnings = windows.groups, []
    if by == "time":
        warnings.append(
            "The test shares its recordings with the training: parts of one recording are more alike than recordings "
            "of another day or person, on whom the scores will be lower."
        )
    if len(groups) == 1:
        warnings.append(
            f"There is one {by} only, '{groups[0]}', so the test shares it with the training: consecutive parts of it "
            f"are tested. Record another {by} to know what the sensor is worth there."
        )
        return parts(windows, np.arange(len(windows.y))), [f"part {k + 1}" for k in range(INNER)], warnings
    if len(groups) <= MOST_TESTS:
        return windows.group, groups, warnings
    joined = [", ".join(groups[k::MOST_TESTS]) for k in range(MOST_TESTS)]
    return windows.group % MOST_TESTS, [f"{k + 1}: {name}" for k, name in enumerate(joined)], warnings


def missing(windows: Windows, trains: np.ndarray, test: np.ndarray, name: str) -> Iterator[str]:
    """Yield a sentence where a test has classes that no other group has."""
    known, asked = (windows.y[rows].any(axis=0) for rows in (trains, test))
    lacking = [one for one, here, there in zip(windows.classes, asked, known, strict=False) if here and not there]
    if lacking:
        yield f"'{', '.join(lacking)}' is in no group but '{name}', so there it cannot be recognised."


def parts(windows: Windows, rows: np.ndarray) -> np.ndarray:
    """Return the part, 0 to INNER - 1, of each of some windows (m,): whole groups, or where these are of one, of units.

    The windows of one group are divided in the order of time, those of each class for themselves; a press, grasp or
    piece is in one part, unless a class has fewer of them than there are parts.
    """
    numbers, place = np.unique(windows.group[rows], return_inverse=True)
    if len(numbers) > 1:
        return place % INNER
    label = windows.y[rows].argmax(axis=1) if windows.classes else np.zeros(len(rows), int)
    part, unit = np.empty(len(rows), int), windows.unit[rows]
    for one in np.unique(label):
        here = np.flatnonzero(label == one)
        units, rank = np.unique(unit[here], return_inverse=True)
        part[here] = rank * INNER // len(units) if len(units) >= INNER else np.arange(len(here)) * INNER // len(here)
    return part


class Final(NamedTuple):
    """The model for new recordings, fitted to all groups."""

    row: Row
    estimator: Any  # with `predict`
    bound: float  # as of `calibrated`
    units: int  # presses, grasps or pieces that the bound is of


def final(windows: Windows, kind: str, trees: int) -> Final:
    """Return what all groups choose as a test's other groups do, calibrated on the errors of models of other parts."""
    everything, best, score = np.arange(len(windows.y)), None, -np.inf
    inner = parts(windows, everything)
    for row in models.rows(kind, trees):
        estimator, held_out = fitted(row, windows, everything, inner, kind)
        if (reached := headline(kind, windows.y, held_out)) > score:
            bound, score = calibrated(windows.y, held_out, windows.unit, kind), reached
            best = Final(row, estimator, bound, len(np.unique(windows.unit)))
    return best


def calibrated(truth: np.ndarray, held_out: np.ndarray, unit: np.ndarray | None, kind: str) -> float:
    """Return the half width of a 90 % interval of numbers, or the score from which on a class is in a 90 % set.

    truth, held_out: (n, outputs), the second of models that did not see these windows; unit: (n,) of what is
    exchangeable, None: each row. Infinity, and of classes 0, where there are too few units to tell.
    """
    if kind == "continuous":
        return conformal.half_width((truth - held_out).ravel(), unit)
    return conformal.class_threshold(held_out, truth.argmax(axis=1), unit)


def fitted(row: Row, windows: Windows, trains: np.ndarray, inner: np.ndarray, kind: str) -> tuple[Any, np.ndarray]:
    """Return a model of the windows that train, with the penalty that predicts each part best from the other parts.

    Also what these models of the other parts predict, (m, outputs).
    """
    x, y, held_out = windows.columns(row.view)[trains], windows.y[trains], None
    for part in np.unique(inner):
        here = inner == part
        # The models are gone before the next ones come: a forest of 200 classes takes gigabytes.
        guesses = [models.predicted(estimator, x[here], y.shape[1]) for estimator in row.fit(x[~here], y[~here])]
        held_out = np.empty((len(guesses), *y.shape)) if held_out is None else held_out
        held_out[:, here] = guesses
    best = max(range(len(held_out)), key=lambda k: headline(kind, y, held_out[k]))
    return row.fit(x, y)[best], held_out[best]


def headline(kind: str, y: np.ndarray, guess: np.ndarray) -> float:
    """Return what a model is chosen by, higher is better: -RMSE, share of right windows, F1 of windows."""
    if kind == "continuous":
        return -float(np.sqrt(np.mean(np.square(guess - y))))
    truth, answer = y.argmax(axis=1), guess.argmax(axis=1)
    return f1(truth == 1, answer == 1)[2] if kind == "event" else float(np.mean(truth == answer))


def f1(truth: np.ndarray, answer: np.ndarray) -> tuple[float, float, float]:
    """Return precision, recall and F1 of answers (n,) bool; 0 where there is nothing to be right about."""
    return precision_recall_fscore_support(truth, answer, average="binary", zero_division=0.0)[:3]


def scored(windows: Windows, rows: np.ndarray, guess: np.ndarray, kind: str, unit: str) -> list[metrics.Row]:
    """Return the scores of a test; guess: (m, outputs) of its windows `rows` (m,).

    * continuous: RMSE in the target's unit, and R2 of the test's windows;
    * class: share of right votes of a press or grasp, the mean of the scores of its windows, and of right windows;
    * event: precision, recall and F1 of windows and of events. An event is a stretch of windows in a row; it is found
      where a predicted stretch overlaps with it.

    A test without an event has no scores of events.
    """
    y = windows.y[rows]
    if kind == "continuous":
        rows = metrics.overall(y, guess, unit)
        return [(name, *row) for name, (_, *row) in zip((RMSE, R2), rows, strict=True)]
    truth, answer = y.argmax(axis=1), guess.argmax(axis=1)
    if kind == "class":
        votes, of = (voted(windows.unit[rows], each).argmax(axis=1) for each in (guess, y))
        right = [("right votes", votes == of), ("right windows", truth == answer)]
        return [(name, "1", float(each.mean()), len(each)) for name, each in right]
    happens, said = truth == 1, answer == 1
    if not happens.any():
        return []
    events, found = (stretches(each, windows.recording[rows]) for each in (happens, said))
    precision, recall = met(found, happens), met(events, said)
    both = 2 * precision * recall / (precision + recall) if precision + recall else 0.0
    names, of_windows = ("precision", "recall", "F1"), f1(happens, said)
    return [
        *((f"{name} of windows", "1", float(value), len(y)) for name, value in zip(names, of_windows, strict=True)),
        ("precision of events", "1", precision, len(found)),
        ("recall of events", "1", recall, len(events)),
        ("F1 of events", "1", both, len(events)),
    ]


def met(events: list[np.ndarray], others: np.ndarray) -> float:
    """Return the share of events in which another, (n,) bool, happens at least once; 0 without events."""
    return float(np.mean([others[rows].any() for rows in events])) if events else 0.0


def voted(unit: np.ndarray, scores: np.ndarray) -> np.ndarray:
    """Return the mean scores (units, classes) of the windows of each unit; unit: (n,); scores: (n, classes)."""
    _, place, count = np.unique(unit, return_inverse=True, return_counts=True)
    sums = np.zeros((len(count), scores.shape[1]))
    np.add.at(sums, place, scores)
    return sums / count[:, None]


def stretches(happens: np.ndarray, recording: np.ndarray) -> list[np.ndarray]:
    """Return the windows of each event: rows in a row, of one recording, at which it happens (n,) bool."""
    begins = happens & np.concatenate([[True], ~happens[:-1] | (recording[1:] != recording[:-1])])
    number = np.cumsum(begins)
    return [np.flatnonzero(happens & (number == k)) for k in range(1, number.max(initial=0) + 1)]


def covered(
    windows: Windows,
    trains: np.ndarray,
    held_out: np.ndarray,
    test: np.ndarray,
    guess: np.ndarray,
    kind: str,
    unit: str,
) -> list[metrics.Row]:
    """Return how often 90 % intervals, or sets of classes, hold the truth of a test, and their size.

    They are calibrated on the windows that train, predicted by models of the other parts; what is exchangeable is a
    press, a grasp or a piece of a series. Of classes, votes have sets. NaN: too few of them to tell a size.
    """
    of, asked, y = windows.unit[trains], windows.unit[test], windows.y
    known, truth = y[trains], y[test]
    if kind == "continuous":
        size = calibrated(known, held_out, of, kind)
        inside, name, told = np.abs(truth - guess).ravel() <= size, HALF_WIDTH, np.isfinite(size)
    else:
        if kind == "class":
            known, held_out = voted(of, known), voted(of, held_out)
            truth, guess, of = voted(asked, truth), voted(asked, guess), None
        threshold = calibrated(known, held_out, of, kind)
        sets = conformal.class_sets(guess, threshold)
        inside, name, unit, told = sets[np.arange(len(sets)), truth.argmax(axis=1)], CLASSES, "1", threshold > 0
        size = float(sets.sum(axis=1).mean())
    share, size = (float(inside.mean()), size) if told else (np.nan, np.nan)
    return [(COVERAGE, "1", share, len(truth)), (name, unit, size, len(truth))]


def over_tests(tested: Tested, model: str, metric: str) -> estimates.Estimate:
    """Return mean and 95 % interval of a score over tests; without an interval below FEWEST groups."""
    scores = tested.scores[(tested.scores["model"] == model) & (tested.scores["metric"] == metric)]
    found = estimates.estimate(scores["value"], SCALES.get(metric, estimates.SHARE))
    return found if min(found.runs, tested.groups) >= FEWEST else found._replace(low=np.nan, high=np.nan)
