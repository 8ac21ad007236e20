"""Tell whether the channels of a recording go together as in training, by the correlation of their changes.

Two strands of a finger that bends change together, or against each other, whatever the motion's places and speeds are;
which ones do so is a property of the sensor. Models trained on the first 64 % of nine simulated and two recorded series
(six or seven strands), tried on what they did not see:

readings                                 300   1,000   3,000   6,000
false alarms                           0/438   0/125    1/38    0/14
told: two channels exchanged, all pairs  .19     .65     .95     .94
told: a channel 0.6 times as large       .05     .32     .63     .68
told: a channel 1.3 times as large         0     .12     .18     .23
told: a channel re-zeroed                  0       0       0       0

Of the recorded strands the other day is no false alarm, with 90 to 100 % of the exchanges told; nor are slides after
training on slides in another task. Another simulated finger is told always, and so are presses after slides: the
sentence does not hold these apart from exchanged channels. Whoever rescales a channel by 1.3 or re-zeroes it by less
than the margins of tactile/base/ranges.py is not noticed. Exchanged elements of an array or cells of a glove cannot be
told: what changes together there is what is touched (distances of 25 simulated elements are 0.1 to 0.3 with and without
the exchange), so that their models keep none. Nor do those of strands, where most exchanges would not be told.
"""

import itertools
from collections.abc import Iterator, Sequence
from typing import Annotated

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, model_validator

LAGS = (1, 5, 25)  # readings, over which changes are tried
LENGTHS = (300, 1000, 3000, 10_000, 30_000)  # readings of stretches; in shorter ones anything may happen
PIECES = 6  # of a length, at least, tell how far stretches of the training lie apart
MARGIN = 2.0  # of the largest distance of so few; with 1.5, 4 of 38 stretches of 3,000 readings are false alarms
TOLD = 0.5  # share of exchanges that have to be told
CHANNELS = 3  # at least: of two an exchange changes no correlation
PAIRS = 200  # at most, that are exchanged to try it out


class Correlation(BaseModel):
    """How the channels of a model's training went together."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    columns: list[Annotated[int, Field(ge=0)]]  # places in a reading of the channels
    lag: Annotated[int, Field(ge=1, le=max(LAGS))]  # readings
    correlation: list[list[float]]  # of changes over the lag, (channels, channels)
    spread: list[Annotated[float, Field(gt=0)]]  # standard deviation of these changes, in the unit of a reading
    lengths: list[int]  # of stretches, rising
    most_apart: list[float]  # largest distance of a stretch that is taken as unchanged, for each length
    most_gain: list[float]  # largest log ratio of a channel's changes to those of the others, for each length

    @model_validator(mode="after")
    def _fits_together(self) -> "Correlation":
        n = len(self.columns)
        if n < CHANNELS or len(set(self.columns)) < n or len(self.spread) != n:
            raise ValueError("columns and spread should have one entry for each channel")
        if len(self.correlation) != n or any(len(row) != n for row in self.correlation):
            raise ValueError("correlation should have a row and a column for each channel")
        rising = 0 < len(self.lengths) == len(set(self.lengths)) and sorted(self.lengths) == self.lengths
        if not rising or not len(self.lengths) == len(self.most_apart) == len(self.most_gain):
            raise ValueError("lengths should rise, and most_apart and most_gain have one entry for each")
        return self

    def limits(self, n: int) -> tuple[float, float] | None:
        """Return most_apart and most_gain for n readings; None where these are too few."""
        place = int(np.searchsorted(self.lengths, n, side="right")) - 1
        return None if place < 0 else (self.most_apart[place], self.most_gain[place])


def of(stretches: Sequence[np.ndarray], columns: Sequence[int]) -> Correlation | None:
    """Return how the channels went together in stretches of readings (n, columns) without a gap, or None.

    None where there are too few channels or readings, and where most exchanges of two channels would not be told.
    """
    if len(columns) < CHANNELS:
        return None
    chosen = [np.asarray(x, float)[:, columns] for x in stretches]
    tried = [found for lag in LAGS if (found := _at_lag(chosen, columns, lag)) is not None]
    told, best = max(tried, key=lambda each: each[0], default=(0.0, None))
    return best if told >= TOLD else None


def _at_lag(stretches: Sequence[np.ndarray], columns: Sequence[int], lag: int) -> tuple[float, Correlation] | None:
    """Return the share of exchanges that are told, and the correlation of changes over `lag` readings."""
    total = _products(stretches, lag)
    if total is None or (np.diag(total) <= 0).any():
        return None
    known: list[tuple[int, float, float]] = []
    last: list[np.ndarray] = []
    for length in LENGTHS:
        pieces = [x[k : k + length] for x in stretches for k in range(0, len(x) - length + 1, length)]
        if len(pieces) < PIECES:
            break
        last = [made for piece in pieces if (made := _products([piece], lag)) is not None]
        distances = [_distance(total - piece, piece) for piece in last if (np.diag(total - piece) > 0).all()]
        apart, gain = (MARGIN * max(np.abs(each[k]).max() for each in distances) for k in (0, 1))
        known.append((length, float(apart), float(gain)))
    if not known:
        return None
    lengths, most_apart, most_gain = map(list, zip(*known, strict=True))
    all_pairs = _pairs(len(columns))
    pairs = all_pairs if len(all_pairs) <= PAIRS else np.random.default_rng(0).permutation(all_pairs)[:PAIRS]
    told = [
        _distance(total, last[number % len(last)][_exchanged(len(columns), *pair)])[0].max() > most_apart[-1]
        for number, pair in enumerate(pairs)
    ]
    spread = np.sqrt(np.diag(total))
    return float(np.mean(told)), Correlation(
        columns=list(columns),
        lag=lag,
        correlation=(total / np.outer(spread, spread)).round(6).tolist(),
        spread=(spread / np.sqrt(max(1, sum(len(x) - lag for x in stretches if len(x) > lag)))).tolist(),
        lengths=lengths,
        most_apart=most_apart,
        most_gain=most_gain,
    )


def _pairs(channels: int) -> list[tuple[int, int]]:
    return list(itertools.combinations(range(channels), 2))


def _exchanged(channels: int, one: int, other: int) -> tuple[np.ndarray, ...]:
    """Return the index of a matrix (channels, channels) in which two channels are exchanged."""
    order = np.arange(channels)
    order[[one, other]] = other, one
    return np.ix_(order, order)


def _products(stretches: Sequence[np.ndarray], lag: int) -> np.ndarray | None:
    """Return the sum of products of the channels' changes, (channels, channels); None where there are none."""
    changes = [x[lag:] - x[:-lag] for x in stretches if len(x) > lag]
    changes = [each - each.mean(axis=0) for each in changes]
    return sum(each.T @ each for each in changes) if changes else None


def _distance(trained: np.ndarray, here: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return of each channel how far its correlations differ, and the log ratio of its changes, less their median.

    trained, here: sums of products, (channels, channels); channels without a change have a correlation of 0.
    """
    scales = [np.sqrt(np.maximum(np.diag(each), np.finfo(float).tiny)) for each in (trained, here)]
    differ = here / np.outer(scales[1], scales[1]) - trained / np.outer(scales[0], scales[0])
    np.fill_diagonal(differ, 0.0)
    per_reading = np.log(scales[1] / scales[0])
    return np.sqrt((differ**2).sum(axis=1) / (len(differ) - 1)), per_reading - np.median(per_reading)


def stretches(x: np.ndarray, begins: np.ndarray, without: np.ndarray) -> Iterator[np.ndarray]:
    """Yield readings x (n, columns) in parts; begins, without: (n,) bool, a part begins here, a reading is left out."""
    edges = np.flatnonzero(begins | without | np.append(False, without[:-1]))
    for part, out in zip(np.split(x, edges), np.split(without, edges), strict=True):
        if len(part) and not out.any():
            yield part


def sentences(of_training: Correlation | None, parts: Sequence[np.ndarray], names: Sequence[str]) -> list[str]:
    """Return the one thing to be said of how channels go together in stretches of a recording; [] where nothing is.

    parts: readings (n, columns) without a gap; names: of the columns.
    """
    if of_training is None:
        return []
    chosen = [np.asarray(part, float)[:, of_training.columns] for part in parts]
    here = _products(chosen, of_training.lag)
    limits = of_training.limits(sum(map(len, chosen)))
    if here is None or limits is None or not np.isfinite(here).all():
        return []
    spread, of_column = np.array(of_training.spread), [names[k] for k in of_training.columns]
    trained = np.array(of_training.correlation) * np.outer(spread, spread)
    apart, gain = _distance(trained, here)
    worst, furthest = int(apart.argmax()), int(np.abs(gain).argmax())
    causes = "another sensor, or another kind of motion"
    if apart[worst] > limits[0]:
        pairs = {pair: _distance(trained, here[_exchanged(len(here), *pair)])[0].max() for pair in _pairs(len(here))}
        one, other = min(pairs, key=pairs.__getitem__)
        if pairs[one, other] <= limits[0]:
            causes = f"with {of_column[one]} and {of_column[other]} exchanged they would"
        return [
            f"the channels do not change together as in training (correlations of {of_column[worst]} differ by "
            f"{apart[worst]:.2f}, in training by {limits[0] / MARGIN:.2f} at most): {causes}"
        ]
    if np.abs(gain[furthest]) > limits[1]:
        low, high = np.exp([-limits[1] / MARGIN, limits[1] / MARGIN])
        return [
            f"{of_column[furthest]} changes {np.exp(gain[furthest]):.2f} times as much, against the "
            f"other channels, as in training, where stretches have {low:.2f} to {high:.2f} times: another scale, "
            f"{causes}"
        ]
    return []
