"""Judge: one rule for each kind of claim. Nothing else says whether a claim is reproduced.

A rule asks where the 95 % interval of one value per seed lies. A sentence is `reproduced` where all of the interval is
where the sentence says it is, `contradicted` where all of it is elsewhere, and `undecided` where it is on both sides. A
printed number `matches` where all of the interval is within BAND of it, is `near` within twice that, and `off` where
none of the interval is within BAND. Two models are compared by differences paired by seed, whose data they share.

Where a sentence claims several directions, all must hold for it to be reproduced, which needs no correction; to
contradict it one must fail by Holm's test over all of them (Holm 1979), and the reason names it. `weak` are decided
sentences that do not pass Holm's test over all of these.

A rule takes `values` (name -> one value per seed), `printed` (name -> the published value, NaN where there is none),
and the options of the claim. `power` is the chance of a good verdict if the paper is exactly right.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import TypeAlias, TypeVar

import numpy as np
import pandas as pd
from scipy import stats

from pipeline.claims.equivalence import inside, lies_within
from tactile.scoring import estimates
from tactile.scoring.units import DRAW, WHOLE

REPRODUCED, CONTRADICTED, UNDECIDED = "reproduced", "contradicted", "undecided"
MATCHES, NEAR, OFF = "matches", "near", "off"
CALIBRATED, OUTSIDE, BEYOND = "calibrated", "outside", "beyond"
VERDICTS = (REPRODUCED, MATCHES, NEAR, CONTRADICTED, OFF, UNDECIDED)  # of what is counted
GOOD, BAD = (REPRODUCED, MATCHES, NEAR), (CONTRADICTED, OFF)
BAND = 0.15  # of a printed error: a number that matches differs by less, a near one by less than twice that
RANKS = 0.5  # rank correlation of an order with the printed one
ALPHA = (1 - estimates.CONFIDENCE) / 2  # of one side
DRAWS = 1000  # of a power
LIKELY = "a likely draw"  # of a printed number that one further specimen of ours may have
NOTHING = "there are no values to compare"
FIXED = "fixed"  # name of the index of a value that is known by arithmetic, as that of chance is: it has no spread
Values: TypeAlias = Mapping[str, pd.Series]
Printed: TypeAlias = Mapping[str, float]
One = TypeVar("One")


class Open(Exception):
    """Why a claim cannot be judged yet; ours: our number all the same, NaN where there is none; runs: it is over."""

    def __init__(self, reason: str, ours: float = np.nan, runs: int = 0):
        super().__init__(reason)
        self.ours, self.runs = ours, runs


@dataclass(frozen=True)
class Judgement:
    """Our value with its interval (NaN where there is none), the verdict that follows, and why; runs: it is over."""

    ours: float
    low: float
    high: float
    verdict: str
    reason: str = ""
    runs: int = 0
    power: float = np.nan
    trainings: int = 0  # behind draws of recordings
    p: float = np.nan  # two-sided, of the interval that decided; NaN where none did
    draw_low: float = np.nan  # of one further specimen, as a paper has one
    draw_high: float = np.nan
    flips_at: float = np.nan  # the limit, where it is ours, at which the verdict would be another
    control: str = ""  # what must not come out, and our number with it
    control_value: float = np.nan


def fixed(value: float) -> pd.Series:
    """Return a value that is known by arithmetic as one that a rule takes."""
    return pd.Series([value], index=pd.Index([0], name=FIXED))


def interval(values: pd.Series, scale: str = estimates.PLAIN) -> estimates.Estimate:
    """Return mean and interval over the seeds that every side of a difference has, or over draws of recordings.

    scale: as of `estimate`; of draws the quantiles are the interval, of a `fixed` value the value itself is.
    Raises Open where there is no interval.
    """
    if values.index.name == FIXED:
        value = float(values.iloc[0])
        return estimates.Estimate(value, value, value, 1, 0)
    if values.index.name == DRAW:
        drawn = values[values.index != WHOLE]
        low, high = np.quantile(drawn, (ALPHA, 1 - ALPHA))
        return estimates.Estimate(float(values.get(WHOLE, drawn.mean())), float(low), float(high), len(drawn), 0)
    mean = estimates.estimate(values.dropna(), scale)
    if mean.runs < estimates.FEWEST:
        problem = f"{mean.runs} of the {estimates.FEWEST} runs that an interval needs" if mean.runs else NOTHING
        raise Open(problem, mean.mean, mean.runs)
    if np.isnan(mean.low):
        problem = f"all {mean.runs} runs have one value, {mean.mean:.4g}, which tells nothing of their spread"
        raise Open(problem, mean.mean, mean.runs)
    return mean


def only(values: Mapping[str, One]) -> One:
    """Return the one value of a rule that judges no more than one."""
    (value,) = values.values()
    return value


def doubt(values: pd.Series, limit: float, scale: str, side: str) -> float:
    """Return the p value of a mean not on the side of a limit, `less` or `greater`: that of the test of its interval.

    A t test, for shares a binomial test of the effective trials; of draws their share beyond the limit.
    """
    if values.index.name == FIXED:
        return float((values.iloc[0] >= limit) if side == "less" else (values.iloc[0] <= limit))
    if values.index.name == DRAW:
        drawn = values[values.index != WHOLE]
        return float(((drawn >= limit) if side == "less" else (drawn <= limit)).mean())
    if scale == estimates.SHARE:
        shares = values.dropna().to_numpy()
        trials = float(estimates.effective_trials(shares))
        hits, misses = trials * shares.mean(), trials * (1 - shares.mean())
        if side == "less":
            return float(stats.beta.sf(limit, hits + 1, misses))
        return float(stats.beta.cdf(limit, hits, misses + 1))
    there, _ = estimates.SCALES[scale]
    rises = np.sign(there(limit + 0.01) - there(limit))
    return float(stats.ttest_1samp(rises * there(values.dropna()), rises * there(limit), alternative=side).pvalue)


def chance(values: pd.Series, limit: float, scale: str, side: str) -> float:
    """Return `doubt`, of draws the normal tail where that is more: of a thousand draws none may lie beyond a limit."""
    p = doubt(values, limit, scale, side)
    drawn = values[values.index != WHOLE]
    if values.index.name == DRAW and drawn.std() > 0:
        z = (drawn.mean() - limit) / drawn.std()
        p = max(p, float(stats.norm.cdf(z) if side == "less" else stats.norm.sf(z)))
    return p


def between(values: pd.Series, least: float, most: float, scale: str, verdict: str) -> float:
    """Return the two-sided p value of a verdict by two bounds: inside both where it is good, beyond one where not."""
    if verdict in GOOD:
        return 2 * max(chance(values, least, scale, "greater"), chance(values, most, scale, "less"))
    if verdict in BAD:
        return 2 * min(chance(values, least, scale, "less"), chance(values, most, scale, "greater"))
    return np.nan


def all_beyond(values: Values, limit: float, scale: str, side: str, verdict: str) -> float:
    """Return the two-sided p value of a verdict that all values are beyond a limit; side: `greater` or `less`."""
    other = {"greater": "less", "less": "greater"}[side]
    if verdict in GOOD:  # all must be
        return min(1.0, 2 * max(chance(runs, limit, scale, side) for runs in values.values()))
    if verdict in BAD:  # by Holm's test one is not
        return min(1.0, 2 * len(values) * min(chance(runs, limit, scale, other) for runs in values.values()))
    return np.nan


def ours(limit: float) -> bool:
    """Return whether a limit is one that we chose: 0 of a difference and 1 of a ratio are the sentence's own."""
    return limit not in (0, 1)


def said(limit: float) -> str:
    """Return a limit in words."""
    return f"limit {limit:g}{' (ours)' * ours(limit)}"


def flip(mean: estimates.Estimate, limit: float) -> float:
    """Return the limit nearest to ours at which a verdict is another, a bound of the interval that decides it."""
    return min(mean.low, mean.high, key=lambda bound: abs(bound - limit)) if ours(limit) else np.nan


def above(
    values: Values, printed: Printed, *, limit: float = 0.0, scale: str = estimates.PLAIN, unfinished: str = ""
) -> Judgement:
    """Judge a direction: the value is above the limit. Of several all must be; the one that decides is shown.

    unfinished: why a whole training would raise the values: then nothing contradicts the claim.
    """
    means = {name: interval(runs, scale) for name, runs in values.items()}
    doubts = {name: doubt(runs, limit, scale, "less") for name, runs in values.items()}
    decides, count = min(doubts, key=doubts.__getitem__), len(means)
    if all(mean.low > limit for mean in means.values()):
        verdict, decides = REPRODUCED, min(means, key=lambda name: means[name].low)
    elif count * doubts[decides] < ALPHA:  # the first step of Holm's test, which is enough for one to fail
        verdict = CONTRADICTED
    else:
        verdict = UNDECIDED
    held = sum(mean.low > limit for mean in means.values())
    word = {REPRODUCED: "the narrowest is", CONTRADICTED: "decided by", UNDECIDED: "the least certain is"}[verdict]
    reason = f"{held} of {count} hold; {word} {decides}" if count > 1 else said(limit) if limit else ""
    if unfinished and verdict == CONTRADICTED:
        verdict, reason = UNDECIDED, "; ".join(filter(None, [reason, f"a bound, as {unfinished}"]))
    power, mean = _power(values, printed, lambda low, high: np.all(low > limit, axis=-1), scale), means[decides]
    p = all_beyond(values, limit, scale, "greater", verdict)
    return Judgement(mean.mean, mean.low, mean.high, verdict, reason, mean.runs, power, p=p, flips_at=flip(mean, limit))


def below(values: Values, printed: Printed, *, limit: float, scale: str = estimates.PLAIN) -> Judgement:
    """Judge that a value is below the limit: no increase beyond a margin. Of several all must be."""
    means = {name: interval(runs, scale) for name, runs in values.items()}
    doubts = {name: doubt(runs, limit, scale, "greater") for name, runs in values.items()}
    decides, verdict = min(doubts, key=doubts.__getitem__), UNDECIDED
    if all(mean.high < limit for mean in means.values()):
        verdict, decides = REPRODUCED, max(means, key=lambda name: means[name].high)
    elif len(means) * doubts[decides] < ALPHA:
        verdict = CONTRADICTED
    reason = said(limit) + (f"; decided by {decides}" if len(means) > 1 else "")
    power, mean = _power(values, printed, lambda low, high: np.all(high < limit, axis=-1), scale), means[decides]
    p = all_beyond(values, limit, scale, "less", verdict)
    return Judgement(mean.mean, mean.low, mean.high, verdict, reason, mean.runs, power, p=p, flips_at=flip(mean, limit))


def scale_of_printed(runs: pd.Series, best: float) -> str:
    """Return the scale of a printed number: a share, an error or a ratio of errors, or a gain, which may be below 0."""
    return estimates.SHARE if best else estimates.LOG if (runs.dropna() > 0).all() else estimates.PLAIN


def near(values: Values, printed: Printed, *, best: float = 0.0) -> Judgement:
    """Judge a printed number in three steps, on the scale of errors: it matches, is near, or is off.

    best: the value of no error, such as 100 %; of 95 % right, the band is a share of the 5 % wrong.
    """
    runs, published, whole = only(values), only(printed), best or 1
    scale = scale_of_printed(runs, best)
    mean = interval(runs / whole, scale)
    mean = mean._replace(mean=whole * mean.mean, low=whole * mean.low, high=whole * mean.high)
    band = BAND * abs(published - best)
    close, fair = (lies_within(mean.low, mean.high, published - width, published + width) for width in (band, 2 * band))
    verdict = MATCHES if close else NEAR if fair else OFF if close is False else UNDECIDED
    off = (mean.mean - best) / (published - best) - 1
    reason = f"{'error ' if best else ''}{100 * off:+.0f} % from the published one"
    least, most = (published - 2 * band) / whole, (published + 2 * band) / whole
    ratios = {"": runs / whole}, {"": published / whole}
    power = _power(*ratios, lambda low, high: np.all(inside(low, high, least, most), axis=-1), scale)
    width = (1 if verdict == OFF else 2) * band / whole
    p = between(runs / whole, published / whole - width, published / whole + width, scale, verdict)
    low, high = (np.nan, np.nan)
    if runs.index.name != DRAW:
        low, high = (whole * end for end in estimates.prediction(runs / whole, scale))
    if low <= published <= high:
        reason += f"; {LIKELY}"
    return Judgement(mean.mean, mean.low, mean.high, verdict, reason, mean.runs, power, 0, p, low, high)


def about(values: Values, printed: Printed) -> Judgement:
    """Judge a number in a sentence ("about doubles"): near it or better reproduces the sentence."""
    found = near(values, printed)
    verdict = REPRODUCED if found.verdict in (MATCHES, NEAR) else CONTRADICTED if found.verdict == OFF else UNDECIDED
    reason = found.reason.removesuffix(f"; {LIKELY}")
    return replace(found, verdict=verdict, reason=reason, draw_low=np.nan, draw_high=np.nan)


def within(
    values: Values, printed: Printed, *, around: float, margin: float, scale: str = estimates.PLAIN
) -> Judgement:
    """Judge that nothing differs: all of the interval is within the margin of `around`."""
    mean, bounds = interval(only(values), scale), (around - margin, around + margin)
    verdict = {True: REPRODUCED, False: CONTRADICTED, None: UNDECIDED}[lies_within(mean.low, mean.high, *bounds)]
    power = _power(values, printed, lambda low, high: np.all(inside(low, high, *bounds), axis=-1), scale)
    p = between(only(values), *bounds, scale, verdict)
    reason = f"margin {margin:g} around {around:g} (ours)"
    off = abs(mean.low - around), abs(mean.high - around)
    flips = min(max(off), 0.0 if mean.low < around < mean.high else min(off), key=lambda at: abs(at - margin))
    return Judgement(mean.mean, mean.low, mean.high, verdict, reason, mean.runs, power, p=p, flips_at=flips)


def place(values: Values, printed: Printed) -> Judgement:
    """Judge a place in an order, a whole number: it is nearer to the printed one than to another."""
    runs, published = only(values).dropna(), only(printed)
    if len(runs) >= estimates.FEWEST and runs.nunique() == 1:
        verdict = REPRODUCED if runs.iloc[0] == published else CONTRADICTED
        return Judgement(runs.iloc[0], np.nan, np.nan, verdict, "in every run", len(runs))
    found = within(values, printed, around=published, margin=0.5)
    return replace(found, power=np.nan, reason=found.reason.removesuffix(" (ours)"), flips_at=np.nan)


def order(values: Values, printed: Printed, *, limit: float = RANKS) -> Judgement:
    """Judge an order: its rank correlation with the printed one (Spearman 1904) is above the limit."""
    frame = pd.DataFrame(values).dropna()
    printed_ranks = stats.rankdata([printed[name] for name in frame])
    correlation = frame.rank(axis=1).apply(lambda ranks: np.corrcoef(ranks, printed_ranks)[0, 1], axis=1)
    if len(correlation) >= estimates.FEWEST and np.ptp(correlation) < estimates.SAME:  # one order in every run
        verdict = REPRODUCED if correlation.iloc[0] > limit else CONTRADICTED
        return Judgement(correlation.iloc[0], np.nan, np.nan, verdict, "in every run", len(correlation))
    mean = interval(correlation)
    verdict = REPRODUCED if mean.low > limit else CONTRADICTED if mean.high < limit else UNDECIDED
    reason = f"rank correlation with the printed order; {said(limit)}"
    p = all_beyond({"": correlation}, limit, estimates.PLAIN, "greater", verdict)
    return Judgement(mean.mean, mean.low, mean.high, verdict, reason, mean.runs, p=p, flips_at=flip(mean, limit))


def equal(values: Values, printed: Printed, *, step: float) -> Judgement:
    """Judge a count: equal at the precision that is printed; step: a unit of its last digit."""
    ours, published = float(only(values).iloc[0]), only(printed)
    same = abs(ours - published) <= step / 2
    reason = "" if same else f"{100 * (ours / published - 1):+.1f} % from the published count"
    return Judgement(ours, np.nan, np.nan, REPRODUCED if same else CONTRADICTED, reason, 1, 1.0)


def fewer(values: Values, printed: Printed) -> Judgement:
    """Judge a ratio of counts: below 1."""
    ours = float(only(values).iloc[0])
    return Judgement(ours, np.nan, np.nan, REPRODUCED if ours < 1 else CONTRADICTED, "", 1, 1.0)


def timed(values: Values, printed: Printed) -> Judgement:
    """Return a ratio of measured times, the smallest of several; the paper's are of other devices."""
    means = [estimates.estimate(runs, estimates.LOG) for runs in values.values()]
    mean = min(means, key=lambda each: each.mean)
    reason = "the paper's devices are not at hand; ratios of times on others do not compare"
    return Judgement(mean.mean, mean.low, mean.high, OUTSIDE, reason, mean.runs)


def calibrated(values: Values, printed: Printed) -> Judgement:
    """Return the error, or ratio of errors, that a scene was tuned to, which is no evidence, whatever it is."""
    runs, published = only(values), only(printed)
    scale = scale_of_printed(runs, 0)
    mean, (low, high) = estimates.estimate(runs, scale), estimates.prediction(runs, scale)
    reason = f"{100 * (mean.mean / published - 1):+.0f} % from the published one"
    reason += f"; {LIKELY}" * (low <= published <= high)
    reason += "; a setting of the scene was chosen by it, on validation parts"
    return Judgement(mean.mean, mean.low, mean.high, CALIBRATED, reason, mean.runs, draw_low=low, draw_high=high)


def weak(p: np.ndarray) -> np.ndarray:
    """Return which of these p values (n,) Holm's test over all of them does not reject at 5 %; NaN is none of them."""
    p, result = np.asarray(p, float), np.zeros(len(p), bool)
    order = [at for at in np.argsort(p, kind="stable") if np.isfinite(p[at])]
    limits = (1 - estimates.CONFIDENCE) / np.arange(len(order), 0, -1)
    result[order] = np.cumsum(p[order] > limits) > 0
    return result


def _power(
    values: Values,
    printed: Printed,
    goal: Callable[[np.ndarray, np.ndarray], np.ndarray],
    scale: str = estimates.PLAIN,
) -> float:
    """Return the chance that intervals reach a goal if the paper is exactly right; NaN where it prints no number.

    goal: (low, high), each (draws, names), -> truth of each draw. Around each published value the values spread,
    together with one another, as ours do over seeds, on the scale of the interval, or over draws of recordings.
    """
    frame = pd.DataFrame(values).dropna()
    centre = np.array([printed[name] for name in frame])
    if len(frame) < estimates.FEWEST or not np.isfinite(centre).all():
        return np.nan
    if frame.index.name == DRAW:
        off = (frame - frame.mean())[frame.index != WHOLE].to_numpy()
        return float(goal(*(centre + off + np.quantile(off, side, axis=0) for side in (ALPHA, 1 - ALPHA))).mean())
    (there, back), n = estimates.SCALES[scale], len(frame)
    seen = there(frame.to_numpy())
    drawn = np.random.default_rng(0).standard_normal((DRAWS, n, n))
    samples = there(centre) + drawn @ (seen - seen.mean(axis=0)) / np.sqrt(n - 1)
    _, low, high = estimates.intervals(back(samples).swapaxes(0, 1), scale)
    return float(goal(low, high).mean())


Rule = Callable[..., Judgement]
RULES: dict[str, Rule] = {
    rule.__name__: rule for rule in (above, below, near, about, within, place, order, equal, fewer, timed, calibrated)
}
