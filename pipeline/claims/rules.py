"""Judge: one rule for each kind of claim. Nothing else in this project says whether a claim is reproduced.

A rule asks where the 95 % interval of one value per seed lies: all of it where the claim says it is, `reproduced`; all
of it elsewhere, `contradicted`; on both sides of the limit, `undecided`. So the less is known, the fewer claims are
either of the first. Where two models are compared the values are paired by seed, whose data they share. Intervals are
not widened for the number of claims. `not testable` is a claim whose numbers are missing, failed or have no spread.

A rule takes `values` (name -> one value per seed), `printed` (name -> the published value, NaN where there is none),
and the options of the claim; several values are judged together.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
import pandas as pd

from pipeline.scoring import results

REPRODUCED, CONTRADICTED, UNDECIDED, NOT_TESTABLE = "reproduced", "contradicted", "undecided", "not testable"
VERDICTS = (REPRODUCED, CONTRADICTED, UNDECIDED, NOT_TESTABLE)
CALIBRATED = "calibrated"
TOLERANCE = 0.1  # of a ratio of measured times: less is no difference
BAND = 0.15  # of a printed error: what ours may differ by
AGREEMENT = 0.8  # share of pairs in the printed order
SHOWN = 3  # names in a reason
Values, Printed = Mapping[str, pd.Series], Mapping[str, float]


class NotTestable(Exception):
    """Why a claim cannot be judged; ours: our number all the same, NaN where there is none."""

    def __init__(self, reason: str, ours: float = np.nan):
        super().__init__(reason)
        self.ours = ours


@dataclass(frozen=True)
class Judgement:
    """Our value with its interval (NaN where there is none), the verdict that follows, and why; runs: it is over."""

    ours: float
    low: float
    high: float
    verdict: str
    reason: str = ""
    runs: int = 0


def interval(values: pd.Series, scale: str = results.PLAIN, trials: int = 0) -> results.Estimate:
    """Return mean and interval over the seeds that every side of a difference has; scale, trials: as of `estimate`.

    Raises NotTestable where there is no interval.
    """
    mean = results.estimate(values.dropna(), scale, trials)
    if mean.runs < 2:
        raise NotTestable("one run has no interval" if mean.runs else "there are no values to compare")
    if np.isnan(mean.low):
        raise NotTestable(f"all {mean.runs} runs have one value, {mean.mean:.4g}, which tells nothing of their spread")
    return mean


def only(values: Mapping[str, object]):
    """Return the one value of a rule that judges no more than one."""
    (value,) = values.values()
    return value


def side(low: float, high: float, limit: float) -> str:
    """Return the verdict of an interval on the claim that a value is above a limit."""
    return REPRODUCED if low > limit else CONTRADICTED if high < limit else UNDECIDED


def several(verdicts: Mapping[str, str]) -> tuple[str, str]:
    """Return the verdict on several directions, reproduced if all are and contradicted if one is, and its reason."""
    verdict = next(each for each in (CONTRADICTED, UNDECIDED, REPRODUCED) if each in verdicts.values())
    parts = [f"{list(verdicts.values()).count(REPRODUCED)} of {len(verdicts)} hold"]
    for word in (UNDECIDED, CONTRADICTED):
        names = [name for name, said in verdicts.items() if said == word]
        more = f" and {len(names) - SHOWN} more" if len(names) > SHOWN else ""
        parts += [f"{word}: {', '.join(names[:SHOWN])}{more}"] if names else []
    return verdict, "; ".join(parts)


def above(values: Values, printed: Printed, *, limit: float = 0.0, scale: str = results.PLAIN) -> Judgement:
    """Judge a direction: the value is above the limit. Of several all must be; the weakest is shown."""
    means = {name: interval(runs, scale) for name, runs in values.items()}
    verdict, reason = several({name: side(mean.low, mean.high, limit) for name, mean in means.items()})
    weakest = min(means, key=lambda name: means[name].low)
    if len(means) == 1:
        where = {UNDECIDED: "the interval includes", CONTRADICTED: "the interval is below"}
        reason = f"{where.get(verdict, 'needs more than')} {limit:g}" if limit or verdict in where else ""
    elif verdict == REPRODUCED:
        reason = f"weakest: {weakest}"
    mean = means[weakest]
    return Judgement(mean.mean, mean.low, mean.high, verdict, reason, mean.runs)


def below(values: Values, printed: Printed, *, limit: float, scale: str = results.PLAIN) -> Judgement:
    """Judge that a value is below the limit: no increase beyond a margin. Of several all must be."""
    means = {name: interval(runs, scale) for name, runs in values.items()}
    verdict, reason = several({name: side(-mean.high, -mean.low, -limit) for name, mean in means.items()})
    weakest = max(means, key=lambda name: means[name].high)
    reason = f"margin {limit:g}" if len(means) == 1 else f"limit {limit:g}; {reason}"
    mean = means[weakest]
    return Judgement(mean.mean, mean.low, mean.high, verdict, reason, mean.runs)


def near(values: Values, printed: Printed, *, best: float = 0.0) -> Judgement:
    """Judge a printed number: all of the interval is within BAND of it, on the scale of errors.

    best: the value of no error, such as 100 %; of 95 % right, the band is a share of the 5 % wrong.
    """
    runs, published = only(values), only(printed)
    try:
        mean = interval(runs)
    except NotTestable as error:
        raise NotTestable(str(error), float(runs.mean())) from None
    inside = within(values, printed, around=published, margin=BAND * abs(published - best))
    off = (mean.mean - best) / (published - best) - 1
    reason = f"{'error ' if best else ''}{100 * off:+.0f} % from the published one; the band is {100 * BAND:.0f} %"
    return Judgement(mean.mean, mean.low, mean.high, inside.verdict, reason, mean.runs)


def within(values: Values, printed: Printed, *, around: float, margin: float) -> Judgement:
    """Judge that nothing differs: all of the interval is within the margin of `around`."""
    mean = interval(only(values))
    low, high, verdict = around - margin, around + margin, UNDECIDED
    if low <= mean.low and mean.high <= high:
        verdict = REPRODUCED
    elif mean.low > high or mean.high < low:
        verdict = CONTRADICTED
    return Judgement(mean.mean, mean.low, mean.high, verdict, f"margin {margin:g} around {around:g}", mean.runs)


def place(values: Values, printed: Printed) -> Judgement:
    """Judge a place in an order, a whole number: it is nearer to the printed one than to another."""
    runs, published = only(values).dropna(), only(printed)
    if len(runs) > 1 and runs.nunique() == 1:
        verdict = REPRODUCED if runs.iloc[0] == published else CONTRADICTED
        return Judgement(runs.iloc[0], np.nan, np.nan, verdict, "in every run", len(runs))
    return within(values, printed, around=published, margin=0.5)


def order(values: Values, printed: Printed) -> Judgement:
    """Judge an order: more than AGREEMENT of the pairs come in the printed one, the highest first."""
    ranked = sorted(values, key=lambda name: -printed[name])
    pairs = [(one, other) for k, one in enumerate(ranked) for other in ranked[k + 1 :]]
    gaps = pd.DataFrame({f"{one} above {other}": values[one] - values[other] for one, other in pairs}).dropna()
    certain = sum(interval(gaps[name]).low > 0 for name in gaps)
    share = interval((gaps > 0).mean(axis=1), results.SHARE, len(pairs))
    reason = f"{int((gaps.mean() > 0).sum())} of {len(pairs)} pairs are in the paper's order by their means"
    verdict = side(share.low, share.high, AGREEMENT)
    return Judgement(share.mean, share.low, share.high, verdict, f"{reason}, {certain} for certain", share.runs)


def ranked(values: Values, printed: Printed, *, worst: int) -> Judgement:
    """Judge that the first of two values is above 0, and that the second, its rank, is among the `worst` first."""
    (name, gap), (_, rank) = values.items()
    judged = above({name: gap}, printed)
    reason, late = "; ".join(filter(None, [judged.reason, f"rank {rank.iloc[0]:.0f}"])), rank.iloc[0] > worst
    verdict = CONTRADICTED if judged.verdict == REPRODUCED and late else judged.verdict
    return Judgement(judged.ours, judged.low, judged.high, verdict, reason, judged.runs)


def equal(values: Values, printed: Printed, *, step: float) -> Judgement:
    """Judge a count: equal at the precision that is printed; step: a unit of its last digit."""
    ours, published = float(only(values).iloc[0]), only(printed)
    same = abs(ours - published) <= step / 2
    reason = "" if same else f"{100 * (ours / published - 1):+.1f} % from the published count"
    return Judgement(ours, np.nan, np.nan, REPRODUCED if same else CONTRADICTED, reason)


def fewer(values: Values, printed: Printed) -> Judgement:
    """Judge a ratio of counts: below 1."""
    ours = float(only(values).iloc[0])
    return Judgement(ours, np.nan, np.nan, REPRODUCED if ours < 1 else CONTRADICTED)


def slower(values: Values, printed: Printed, *, tolerance: float = TOLERANCE) -> Judgement:
    """Judge ratios of measured medians, which have no interval: all are above 1 + tolerance; the smallest is shown."""
    ratios = {name: float(value.iloc[0]) for name, value in values.items()}
    wrong = [name for name, ratio in ratios.items() if not ratio > 1 + tolerance]
    verdict, reason = REPRODUCED, "one measurement, no interval"
    if wrong:
        verdict = UNDECIDED if all(abs(ratios[name] - 1) <= tolerance for name in wrong) else CONTRADICTED
        reason = f"{'too close' if verdict == UNDECIDED else 'not'}: {', '.join(wrong)}; {reason}"
    return Judgement(min(ratios.values()), np.nan, np.nan, verdict, reason)


def measured_near(values: Values, printed: Printed) -> Judgement:
    """Judge a measured number without an interval: within BAND of the printed one, or not."""
    ours, published = float(only(values).iloc[0]), only(printed)
    off = ours / published - 1
    reason = f"{100 * off:+.0f} % from the published one; the band is {100 * BAND:.0f} %; one measurement, no interval"
    return Judgement(ours, np.nan, np.nan, REPRODUCED if abs(off) <= BAND else CONTRADICTED, reason)


def calibrated(values: Values, printed: Printed) -> Judgement:
    """Return the number that a scene was tuned to, which is no evidence, whatever it is."""
    mean = results.estimate(only(values))
    reason = "a setting of the scene was chosen by it, on validation parts"
    return Judgement(mean.mean, mean.low, mean.high, CALIBRATED, reason, mean.runs if mean.runs > 1 else 0)


Rule = Callable[..., Judgement]
RULES: dict[str, Rule] = {
    rule.__name__: rule
    for rule in (above, below, near, within, place, order, ranked, equal, fewer, slower, measured_near, calibrated)
}
