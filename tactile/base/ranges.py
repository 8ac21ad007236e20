"""Say which readings lie outside those of a model's training, where nobody knows how far it is off.

A reading is outside where one of its columns, or the mean over them, lies beyond its range in training by more than a
margin. The mean sees what no single column does: an array whose rest has shifted looks pressed a little everywhere.
"""

from collections.abc import Iterator, Mapping, Sequence
from functools import cached_property
from typing import Annotated

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, model_validator

from tactile.base.cards import Words

# Margins beyond which at most 1 % of the test part of the training's own sensor lies. Measured on the first protocols
# of the look, of recorded strands within a day, in %:
#
#                                    touch     recorded taxel  strain          strands  glove   recorded hand
# a column, 0 % of the widest range    0.7                0.1     0.5              0.1     13              13
#                        5 %           0.1                0.1     0.3                0    5.0             7.0
#                       10 %             0                  0       0                0    0.6             2.9
#                       15 %             0                  0       0                0      0             0.6
#                       25 %             0                  0       0                0      0             0.6
# 10 % of the column's own range         0                  0     0.2                0    6.3             5.2
# the mean, 0 % of its range            23                0.1     0.2                0      0               0
#                        5 %            14                0.1       0                0      0               0
#                       10 %            11                  0       0                0      0               0
#                       25 %           4.2                  0       0                0      0               0
#                       50 %           0.5                  0       0                0      0               0
#
# Some cells of a glove nearly nothing touches in training, so that their own range is no measure. Models of touch are
# trained on single touches and tested on several at once, which add up in the mean.
MARGIN = 0.15  # of the range of the widest column of a kind, so that a column that was constant has one, too
MEAN_MARGIN = 0.1  # of the range of the mean
MEAN_MARGIN_OF_TOUCHES = 0.5
PART = 1 << 14  # readings that are compared at once
Number = Annotated[float, Field(ge=-1e12, le=1e12)]


class Columns(BaseModel):
    """What the readings of a model's training were in the columns of one kind, such as the cells of one area."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    name: Words  # of a column without its number: v, of an area its first letter
    first: Annotated[int, Field(ge=0)]  # place in a reading of the column with number 0
    columns: Annotated[list[Annotated[int, Field(ge=0)]], Field(min_length=1)]  # numbers of those that the model sees
    low: list[Number]  # of each of them
    high: list[Number]
    margin: Annotated[Number, Field(gt=0)]
    mean_low: Number  # of the mean over them in one reading
    mean_high: Number
    mean_margin: Annotated[Number, Field(gt=0)]

    @model_validator(mode="after")
    def _fits_together(self) -> "Columns":
        if not len(self.columns) == len(self.low) == len(self.high) == len(set(self.columns)):
            raise ValueError("columns, low and high should have one entry for each column")
        pairs = zip([*self.low, self.mean_low], [*self.high, self.mean_high], strict=True)
        if any(low > high for low, high in pairs):
            raise ValueError("low should not be above high")
        return self

    @cached_property
    def arrays(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Return the places of the columns in a reading, and low, high and margin of each, behind them of the mean."""
        margins = [self.margin] * len(self.low) + [self.mean_margin]
        ends = np.array([*self.low, self.mean_low]), np.array([*self.high, self.mean_high])
        return self.first + np.array(self.columns), *ends, np.array(margins)


def of(readings: np.ndarray, name: str, first: int, columns: Sequence[int], mean_margin: float) -> Columns:
    """Return the ranges of the columns of one kind in readings (n, columns), n > 0; mean_margin: share of its range."""
    low, high = readings.min(axis=0).astype(float), readings.max(axis=0).astype(float)
    mean = readings.mean(axis=1, dtype=float)
    least = float(np.spacing(np.float32(np.abs(readings).max())))  # as far as the numbers tell, where nothing varied
    return Columns(
        name=name,
        first=first,
        columns=list(columns),
        low=low.tolist(),
        high=high.tolist(),
        margin=max(MARGIN * float((high - low).max()), least),
        mean_low=float(mean.min()),
        mean_high=float(mean.max()),
        mean_margin=max(mean_margin * float(np.ptp(mean)), least),
    )


def excess(readings: np.ndarray, trained_on: Sequence[Columns]) -> np.ndarray:
    """Return how many margins readings (n, columns) lie beyond the training, (n, checks); more than 1: outside.

    The checks are those of `_checks`.
    """
    found = []
    for kind in trained_on:
        places, low, high, margin = kind.arrays
        values = np.asarray(readings)[:, places].astype(float)
        values = np.column_stack([values, values.mean(axis=1)])
        found.append(np.maximum(low - values, values - high) / margin)
    return np.concatenate(found, axis=1)


def _parts(readings: np.ndarray) -> Iterator[np.ndarray]:
    """Yield some readings at a time: what is computed of them takes several times their memory."""
    for first in range(0, len(readings), PART):
        yield readings[first : first + PART]


def outside(readings: np.ndarray, trained_on: Sequence[Columns] | None) -> np.ndarray:
    """Return which readings (n, columns) lie outside the training, (n,) bool; none where nothing is known of it."""
    if trained_on is None:
        return np.zeros(len(readings), bool)
    parts = (np.any(excess(part, trained_on) > 1, axis=1) for part in _parts(readings))
    return np.concatenate([np.zeros(0, bool), *parts])


def summary(
    readings: np.ndarray, outside: np.ndarray, trained_on: Sequence[Columns], unit: str, lacking: str
) -> dict[str, float | str]:
    """Return what a summary of predictions says: the share outside and, where there are any, `sentence`."""
    said: dict[str, float | str] = {"share_outside_training": float(outside.mean()) if len(outside) else 0.0}
    if outside.any():
        said["outside_training"] = sentence(readings, outside, trained_on, unit, lacking)
    return said


def sentence(readings: np.ndarray, outside: np.ndarray, trained_on: Sequence[Columns], unit: str, lacking: str) -> str:
    """Say how many readings (n, columns) are outside (n,) bool, some of them, and which is furthest.

    unit: of a reading, `any`: not known; lacking: what such readings do not have, as `interval`.
    """
    furthest = []  # excess of each part, row and check of it
    for first, part in zip(range(0, len(readings), PART), _parts(readings), strict=True):
        far = excess(part, trained_on)
        if not np.isnan(far).all():
            row, k = np.unravel_index(np.nanargmax(far), far.shape)
            furthest.append((far[row, k], first + row, k))
    _, row, k = max(furthest, key=lambda each: each[0])
    what, of_reading, low, high = _checks(trained_on)[k]
    unit = "" if unit == "any" else f" {unit}"
    value = float(np.mean(readings[row, of_reading], dtype=float))
    return (
        f"{outside.sum()} of {len(outside)} readings lie outside what the model was trained on, furthest in "
        f"{what}: {value:.4g}{unit}, in training {low:.4g} to {high:.4g}{unit}; these readings have no {lacking}"
    )


def _checks(trained_on: Sequence[Columns]) -> list[tuple[str, list[int], float, float]]:
    """Return of each check its name, the columns that it is the mean of, and its range in training."""
    found = []
    for kind in trained_on:
        places = [kind.first + number for number in kind.columns]
        for number, place, low, high in zip(kind.columns, places, kind.low, kind.high, strict=True):
            found.append((f"column {kind.name}{number}", [place], low, high))
        found.append((f"the mean of {_all_of(kind)}", places, kind.mean_low, kind.mean_high))
    return found


def _all_of(kind: Columns) -> str:
    """Name the columns of a kind."""
    least, most = min(kind.columns), max(kind.columns)
    return f"{kind.name}{least} to {kind.name}{most}" if most > least else f"{kind.name}{least}"


def places(trained_on: Sequence[Columns]) -> list[int]:
    """Return the places in a reading of the columns that have a range."""
    return [kind.first + number for kind in trained_on for number in kind.columns]


def words(trained_on: Sequence[Columns], unit: str) -> str:
    """Say what the ranges are; unit: as of `sentence`."""
    unit, said = "" if unit == "any" else f" {unit}", []
    for kind in trained_on:
        ends, mean = (min(kind.low), max(kind.high), kind.margin), (kind.mean_low, kind.mean_high, kind.mean_margin)
        checks = ((_all_of(kind), ends), ("their mean", mean))[: len(kind.columns)]  # one column is its own mean
        said += [
            f"{low:.4g} to {high:.4g}{unit} in {what} (margin {margin:.3g})" for what, (low, high, margin) in checks
        ]
    return ", ".join(said)


def of_areas(readings: np.ndarray, areas: Mapping[str, int], seen: Sequence[str]) -> list[Columns]:
    """Return the ranges of readings (n, columns) of areas that lie one after the other, of those that are `seen`.

    areas: name -> number of columns.
    """
    found, first = [], 0
    for name, count in areas.items():
        if name in seen:
            found.append(of(readings[:, first : first + count], name[0], first, range(count), MEAN_MARGIN))
        first += count
    return found
