"""Score recordings press by press, or grasp by grasp: what intervals of recorded data are over.

Seeds of a recorded experiment are starts of networks on the same test part, or folds, each with a test part of its own;
how far a number would differ with other presses is told by drawing the presses anew, with repetition (bootstrap; Efron
1979), the same ones for every model.
Of recordings of several persons, persons are drawn anew, and of each that is drawn what is theirs. Of metrics other
than the main one a person is one unit: how persons differ holds already how frames of one differ, and rows are few.

Scores under stress keep the losses of few blocks of units, as text in the row of the score, see `written`.
"""

import functools
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np
import pandas as pd
import pyarrow as pa

from tactile import experiments
from tactile.base.facts import FOLDS, Facts
from tactile.base.paths import Workspace
from tactile.datasets import images, schemas
from tactile.scoring import metrics
from tactile.scoring.estimates import FEWEST, read_predictions, read_windows

MOST_UNITS = 100  # of a condition: presses in a row are one where there are more
MOST_OF_SUBJECT = 10  # likewise of one person: how persons differ weighs more
MOST_BLOCKS = 10  # of a test part under stress
BLOCK = r"\d+(\.\d+)?(e[+-]\d\d)?:[1-9]\d{0,9}"  # loss and count
APART = "/"  # between the blocks of one person and those of the next
WRITTEN = rf"({BLOCK}( ({APART} )?{BLOCK})*)?"  # form of the blocks of a score under stress
SUFFIX = "_of_unit"  # of the metric's name; the variant is the unit, or <variant>/<unit>
DRAWS = 1000
DRAW = "draw"  # name of the index of values that are draws, not runs
WHOLE = -1  # in that index: no draw, but what was measured


def rows(workspace: Workspace, experiment: str, settings: Mapping, protocols: Sequence[str]) -> Iterator[Mapping]:
    """Yield a row of the one table for every unit of the test part; value: mean squared error (of `rmse`), mean, share.

    settings: the experiment's block; protocols: those that are scored so. Where rows are of persons, a row for each
    person and further metric follows, of the function <SCORES>_by_frame of `metrics`.
    """
    table, module = read_windows(workspace, experiment), experiments.module(experiment)
    facts, condition, unit = module.FACTS, schemas.names(table["condition"]), _numbers(table)
    subject = schemas.names(table[facts.subject]) if facts.subject else None
    truth = table["label"].to_numpy() if facts.metric == "accuracy" else schemas.matrix(table["y"])
    most = MOST_OF_SUBJECT if facts.subject else MOST_UNITS
    for protocol in protocols:
        for seed in settings["protocols"][protocol]["seeds"]:
            for model in settings["models"]:
                predicted = read_predictions(workspace, experiment, model, protocol, seed, table)
                if not np.isfinite(predicted).any():  # a failed run
                    continue
                wrong = losses(facts.metric, truth, predicted)
                known = np.isfinite(wrong) & (unit >= 0)
                shares = {facts.metric: (wrong[known], np.ones(known.sum()))}
                if subject is not None:
                    further = getattr(metrics, f"{module.SCORES}_by_frame")
                    shares |= further(schemas.matrix(table["y"])[known], predicted[known], settings)
                pooled = facts.pooled
                if facts.metric == "accuracy":  # images of all objects, which are the conditions of a dataset
                    pooled = (images.modality(protocol),)
                for name in pooled or np.unique(condition[known]):
                    chosen = known if pooled else known & (condition == name)
                    for metric, (share, of) in shares.items():
                        fewer = most if metric == facts.metric else 1
                        block, whose = _blocks(unit[chosen], None if subject is None else subject[chosen], fewer)
                        parts = pd.DataFrame({"share": share, "of": of})[chosen[known]]
                        first = seed * MOST_UNITS if facts.seeds == FOLDS else 0
                        sums = parts.groupby(_named(block, whose, first), observed=True).sum()
                        for number, each in sums[sums["of"] > 0].iterrows():
                            yield {
                                "experiment": experiment, "protocol": protocol, "condition": name, "model": model,
                                "variant": number, "metric": metric + SUFFIX, "seed": seed,
                                "unit": "", "value": float(f"{each['share'] / each['of']:.6g}"), "n": round(each["of"]),
                            }  # fmt: skip


def _numbers(table: pa.Table) -> np.ndarray:
    """Return the number of the press, or of the grasp, of each row of a dataset, (n,); -1 where it has none."""
    name = np.char.add(np.char.add(schemas.names(table["condition"]), "/"), schemas.names(table["recording"]))
    press = table["press"].to_numpy() if "press" in table.column_names else np.zeros(len(name), int)
    recording = np.unique(name, return_inverse=True)[1]
    number = np.unique(np.stack([recording, press]), axis=1, return_inverse=True)[1].reshape(-1)
    return np.where(press >= 0, number, -1)


def _named(block: np.ndarray, whose: Sequence[str | None], first: int = 0) -> pd.Categorical:
    """Return the names of blocks of units, (n,): unit_0, unit_1 ..., or of persons unit_P01_0 ...; see `_blocks`.

    first: the number of the first one, of nobody's units.
    """
    names = [
        f"unit_{first + k}" if one is None else f"unit_{one}_{whose[:k].count(one)}" for k, one in enumerate(whose)
    ]
    return pd.Categorical.from_codes(block, names)


def _blocks(unit: np.ndarray, subject: np.ndarray | None, most: int) -> tuple[np.ndarray, list[str | None]]:
    """Return the number of the block of each row, (n,) from 0 on, and whose each block is.

    unit, subject: (n,). Several units in a row are one block where there are more than `most` (of one person).
    """
    block = np.zeros(len(unit), int)
    whose: list[str | None] = []
    for one in [None] if subject is None else np.unique(subject):
        rows = np.full(len(unit), True) if one is None else subject == one
        number = np.unique(unit[rows], return_inverse=True)[1]
        number //= -(-(number.max(initial=0) + 1) // most)
        block[rows] = len(whose) + number
        whose += [one] * (number.max(initial=-1) + 1)
    return block, whose


def losses(metric: str, truth: np.ndarray, predicted: np.ndarray) -> np.ndarray:
    """Return squared error, distance in mm, or whether it is right, (n,); NaN where nothing is predicted.

    truth: (n, outputs), of accuracy the places of the right classes (n,); predicted: (n, outputs).
    """
    if metric == "accuracy":
        right = (predicted.argmax(axis=1) == truth).astype(float)
        return np.where(np.isfinite(predicted).all(axis=1), right, np.nan)
    gap = predicted.astype(float) - truth
    asked = np.isfinite(gap).any(axis=0)
    gap = gap[:, asked]
    return np.square(gap).mean(axis=1) if metric == "rmse" else np.linalg.norm(gap, axis=1)


class Units(NamedTuple):
    """What the rows of the test part of a run are of."""

    rows: np.ndarray  # (n,) of the dataset, rising
    unit: np.ndarray  # (n,) number of the press or grasp; what is between presses is of the one before
    subject: np.ndarray | None  # (n,) of whom they are

    @classmethod
    def of(cls, rows: np.ndarray, table: pa.Table, facts: Facts) -> "Units":
        """Return the units of rows (n,) of a dataset; table: condition, recording, press and subject of these rows."""
        unit = _numbers(table)
        held = np.maximum.accumulate(np.where(unit >= 0, np.arange(len(unit)), 0))
        return cls(rows, unit[held], schemas.names(table[facts.subject]) if facts.subject else None)

    def written(self, rows: np.ndarray, loss: np.ndarray) -> str:
        """Return the mean losses of blocks as text, `loss:count` apart by a space, persons apart by APART.

        rows: (m,) of the dataset, some of the test part; loss: (m,). There are MOST_BLOCKS at most, or one a person.
        """
        place = np.searchsorted(self.rows, rows)
        subject = None if self.subject is None else self.subject[place]
        persons = 1 if subject is None else len(np.unique(subject))
        block, whose = _blocks(self.unit[place], subject, max(1, MOST_BLOCKS // persons))
        count = np.bincount(block)
        told = [f"{mean:.4g}:{n}" for mean, n in zip(np.bincount(block, loss) / count, count, strict=True)]
        ends = [f" {APART}" if one != after else "" for one, after in zip(whose, [*whose[1:], whose[-1]], strict=True)]
        return " ".join(f"{one}{end}" for one, end in zip(told, ends, strict=True))


def called(facts: Facts, kind: str, persons: int) -> str:
    """Return what draws are over in words; kind: of the input, `KIND`; persons: how many of whom it is recorded."""
    units = "frames" if not facts.stream else "grasps" if kind == "images" else "presses"
    if not facts.subject:
        return units
    return f"{facts.subject}s" if persons >= FEWEST else f"{units} of {persons} {facts.subject}{'s' * (persons > 1)}"


def of_written(text: str, metric: str) -> tuple[np.ndarray, tuple[int, ...]]:
    """Return the metric over blocks drawn anew, (DRAWS,), and how many blocks each person has; text: see `Units`.

    Fewer than FEWEST persons tell nothing of others: blocks alone are drawn then, of each person as many as there are.
    """
    persons = [part.split() for part in text.split(APART)]
    sizes = tuple(map(len, persons))
    loss, count = np.array([pair.split(":") for part in persons for pair in part], float).T
    drawn = _times_drawn(sizes)
    return _metric(drawn @ (loss * count) / (drawn @ count), metric), sizes


@functools.lru_cache(maxsize=64)
def _times_drawn(sizes: tuple[int, ...]) -> np.ndarray:
    """Return how often each draw has each block, (DRAWS, blocks); sizes: blocks of each person."""
    picked, counted = _picked(sizes, FEWEST)
    return np.array(
        [np.bincount(one[of], minlength=sum(sizes)) for one, of in zip(picked, counted, strict=True)], float
    )


def _picked(sizes: Sequence[int] | np.ndarray, fewest: int = 1) -> tuple[np.ndarray, np.ndarray]:
    """Return the places of the units of each draw, (DRAWS, m), and which of them count, bool.

    Persons are drawn, and of each that is drawn its units. sizes: units of each person, which stand together. Persons
    fewer than `fewest` are all kept.
    """
    if len(sizes) == 1:
        picked = np.random.default_rng(sizes[0]).integers(sizes[0], size=(DRAWS, sizes[0]))
        return picked, np.full(picked.shape, True)
    rng, shape, size = np.random.default_rng(len(sizes)), (DRAWS, len(sizes)), np.array(sizes)
    persons = rng.integers(len(size), size=shape) if len(size) >= fewest else np.tile(np.arange(len(size)), (DRAWS, 1))
    first, own, places = np.cumsum(size) - size, size[persons][..., None], np.arange(size.max())
    picked = first[persons][..., None] + (rng.random((*shape, len(places))) * own).astype(int)
    return picked.reshape(DRAWS, -1), np.broadcast_to(places < own, picked.shape).reshape(DRAWS, -1)


def _metric(loss: np.ndarray, metric: str) -> np.ndarray:
    """Return the metric of mean losses."""
    return np.sqrt(loss) if metric.endswith("rmse") else loss


def drawn(table: pd.DataFrame, metric: str) -> pd.Series:
    """Return the metric over units drawn anew, (DRAWS,), each unit averaged over seeds; table: its rows of one model.

    Where units are of several persons, persons are drawn, and for each that is drawn its units: rows of several
    protocols that test on different persons may stand together. The same units give the same draws, and as many persons
    the same persons, so that models are paired, and conditions and metrics by person. Few persons of unlike weight make
    the mean of draws a percent off, so that at WHOLE, beside the draws, is the metric over all units as they are.
    """
    mean = table.groupby("variant")["value"].mean()
    weight = table.groupby("variant")["n"].first().astype(float)
    order = sorted(mean.index, key=lambda name: (name.rpartition("_")[0], int(name.rpartition("_")[2])))
    value, weight = mean[order].to_numpy(), weight[order].to_numpy()
    sizes = np.unique([name.rpartition("_")[0] for name in order], return_counts=True)[1]
    picked, counted = _picked(sizes)
    drawn_weight = np.where(counted, weight[picked], 0)
    result = (drawn_weight * value[picked]).sum(axis=1) / drawn_weight.sum(axis=1)
    if len(sizes) == 1:
        return pd.Series(_metric(result, metric), index=pd.RangeIndex(DRAWS, name=DRAW))
    result = np.array([np.average(value, weights=weight), *result])
    return pd.Series(_metric(result, metric), index=pd.RangeIndex(WHOLE, DRAWS, name=DRAW))
