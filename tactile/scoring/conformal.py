"""Say how far off a prediction may be: split-conformal intervals, and sets of classes, calibrated on held-out data.

Split conformal prediction (Papadopoulos et al. 2002; Lei et al. 2018, algorithm 2; Vovk, Gammerman and Shafer 2005)
takes scores of how far predictions missed the truth on data that the model was not fitted to. Of n exchangeable scores
the one of rank ceil((n + 1) level) bounds the next score with a probability of at least `level`, whatever the model and
the distribution.

The frames of one press are not exchangeable with those of the next: they resemble one another, so that a thousand
frames of ten presses tell little more than ten numbers. Here the unit is therefore the group (press, grasp, block of a
series), and what is promised is the coverage of a random frame of a new group: each of n groups weighs 1 / (n + 1),
shared equally by its frames, and the rest of the weight lies at infinity (hierarchical conformal prediction: Lee,
Barber and Willett 2023, "Distribution-free inference with hierarchical data"). With one frame in every group this is
the rank above. One score per group, its largest error, would promise a whole press without a miss, which is far more
than a 90 % interval says; one random frame per group throws away the others and depends on the draw.
"""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from scipy import stats

from tactile.scoring.estimates import CONFIDENCE, clopper_pearson

LEVEL = 0.9  # share of truths that an interval is to hold
PLAUSIBLE = (0.86, 0.94)  # a measured coverage outside is flagged
ROUNDING = 1e-9  # of sums of weights: 9 / 10 reaches 0.9


def least(level: float = LEVEL) -> int:
    """Return the number of groups below which there is no interval: level / (1 - level), 9 for 90 %."""
    return int(np.ceil(level / (1 - level) - ROUNDING))


def quantile(scores: np.ndarray, groups: np.ndarray | None = None, level: float = LEVEL) -> float:
    """Return the bound that the score of a random row of a new group keeps with probability `level`.

    scores: (n,) of held-out rows, larger where a prediction missed by more; groups: (n,) of what is exchangeable, None
    where every row is a group of its own. Infinity, which stands for "cannot tell", for fewer than `least`
    groups. Raises ValueError for a score that is NaN.
    """
    if np.isnan(scores).any():
        raise ValueError("a score is NaN: leave out rows without a prediction, and models whose training failed")
    if not len(scores):
        return np.inf
    _, place, size = np.unique(
        np.arange(len(scores)) if groups is None else groups, return_inverse=True, return_counts=True
    )
    order = np.argsort(scores, kind="stable")
    reached = np.cumsum(1 / ((len(size) + 1) * size[place[order]]))
    enough = np.flatnonzero(reached >= level - ROUNDING)
    return float(scores[order[enough[0]]]) if len(enough) else np.inf


def half_width(
    errors: np.ndarray,
    groups: np.ndarray | None = None,
    scale: np.ndarray | float = 1.0,
    level: float = LEVEL,
) -> float:
    """Return the half width of an interval around a prediction, in units of `scale`; infinity: cannot tell.

    errors: (n,) truth - prediction of held-out rows; groups: as of `quantile`; scale: (n,) positive numbers that are
    known from the prediction alone and rise with it as errors do, such as `root` (normalised conformal prediction,
    Papadopoulos, Gammerman and Vovk 2008). The interval of a new prediction is prediction +- half width x its scale.
    """
    return quantile(np.abs(errors) / scale, groups, level)


def root(predicted: np.ndarray, floor: float) -> np.ndarray:
    """Return sqrt(prediction + floor), a scale for quantities from 0 up, whose floor is what is just noticed; (n,).

    Of presses on arrays (`dvc repro`, three models each of touch and the recorded taxel), intervals of this scale were
    on average the narrowest, and held the truth about as often in the lowest as in the highest third of predictions;
    those of a scale of 1 held it too seldom of hard presses, those of prediction + floor too seldom of light ones.
    """
    return np.sqrt(np.maximum(predicted, 0) + floor)


def class_threshold(
    probabilities: np.ndarray, labels: np.ndarray, groups: np.ndarray | None = None, level: float = LEVEL
) -> float:
    """Return the probability from which on a class belongs to the set of a prediction.

    0, which gives sets of all classes, where it cannot tell, and where true classes too often have no probability.
    It is one minus the quantile of 1 - probability of the true class (least ambiguous sets: Sadinle, Lei and Wasserman
    2019), which gives the smallest sets on average of all that hold the truth as often. Adaptive sets (Romano, Sesia
    and Candes 2020) would need random numbers to be exact, and give one reading two answers.

    probabilities: (n, classes) of held-out rows; labels: (n,) numbers of their classes; groups: as of `quantile`.
    """
    bound = quantile(1 - probabilities[np.arange(len(labels)), labels].astype(float), groups, level)
    return float(max(0.0, 1 - bound))


def class_sets(probabilities: np.ndarray, threshold: float) -> np.ndarray:
    """Return which classes belong to the set of each prediction, (n, classes) bool; probabilities: (n, classes).

    The likeliest class always does: a set of nothing helps nobody. A model that is right more often than `level` has
    sets of one class that hold the truth more often than asked for. NaN has a set of all classes.
    """
    belongs = ~(probabilities < threshold)
    belongs[np.arange(len(belongs)), np.nan_to_num(probabilities, nan=-1.0).argmax(axis=1)] = True
    return belongs


class Coverage(NamedTuple):
    """How often intervals or sets held the truth, the mean over groups, with its interval."""

    share: float  # NaN without a row
    low: float
    high: float
    groups: int
    rows: int

    @property
    def flagged(self) -> bool:
        """Tell whether the share is outside PLAUSIBLE."""
        return flagged(self.share)


def flagged(share: float) -> bool:
    """Tell whether a measured coverage is outside PLAUSIBLE."""
    return not PLAUSIBLE[0] <= share <= PLAUSIBLE[1]


def held(shares: Mapping[str, float], groups: str) -> str:
    """Say the coverage that has to stand wherever an interval does: the lowest of those that are flagged; "": none is.

    shares: of each test that has one; groups: what is held out in them, such as presses.
    """
    outside = {test: share for test, share in shares.items() if flagged(share)}
    if not outside:
        return ""
    lowest = min(outside, key=outside.__getitem__)
    return f"on held-out {groups} it held {100 * outside[lowest]:.3g} % ({lowest})"


def coverage(inside: np.ndarray, groups: np.ndarray | None = None) -> Coverage:
    """Return how often the truth lay inside, each group with the same weight, and its 95 % interval.

    inside: (n,) bool of rows of a test part; groups: (n,), None where every row is one. The interval is the binomial
    one of Clopper and Pearson (1934) with as many trials as groups. Where a group holds several frames, its share is
    no plain yes or no and varies less than one, so that the interval is rather too wide.
    """
    if not len(inside):
        return Coverage(np.nan, np.nan, np.nan, 0, 0)
    _, place = np.unique(np.arange(len(inside)) if groups is None else groups, return_inverse=True)
    shares = np.bincount(place, weights=inside) / np.bincount(place)
    n, share = len(shares), float(shares.mean())
    low, high = map(float, clopper_pearson(share, n))
    return Coverage(share, low, high, n, len(inside))


def expected(calibrated: int, tested: int, level: float = LEVEL) -> tuple[float, float]:
    """Return within which shares a coverage lies in 95 % of all cases where the groups are exchangeable.

    Calibrated on n groups, the number of m others that are inside is beta-binomial: a share of them drawn from
    Beta(k, n + 1 - k) with k = ceil((n + 1) level), then m trials (Vovk 2012, "Conditional validity of inductive
    conformal predictors"). calibrated: n, at least `least`; tested: m.
    """
    k = int(np.ceil((calibrated + 1) * level - ROUNDING))
    inside = stats.betabinom(tested, k, calibrated + 1 - k).interval(CONFIDENCE)
    return float(inside[0] / tested), float(inside[1] / tested)


def plural(group: str, count: int = 2) -> str:
    """Return the name of a group for so many of them: press, grasp, or block of 10 s."""
    first, *rest = group.split(" ")
    return group if count == 1 else " ".join([first + ("es" if first.endswith("s") else "s"), *rest])
