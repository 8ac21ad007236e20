"""Judge the claims of the papers: the rules, the claim that names one, and the evidence that the rules read.

Nothing else in this project says whether a claim is reproduced. There is one rule for each kind of claim. An interval
is the 95 % t interval of one value per seed (or of what `over` names); where two models are compared, the values are
differences paired by seed, whose split they share. Intervals are not widened for the number of claims.

* direction (`positive`): "A is above B". Reproduced if the whole interval of A - B is above 0. Otherwise not
  reproduced: `contradicted` if all of it is below 0, `undecided` if it includes 0.
* several directions (`all_positive`): reproduced if every one of them is. The weakest is shown.
* number (`number`): reproduced if our mean is within TOLERANCE of the published value. Whether the interval includes
  that value is said and does not count: the less is known, the more would be reproduced.
* no difference (`within`), no increase (`at_most`): reproduced if the interval lies inside, or below, a margin.
* count (`count`): reproduced if equal to the published one, at the precision that is printed.
* measured time (`slower`): a ratio of medians without an interval. Reproduced if it is above 1 + TOLERANCE.

Not testable: a run of it failed or is missing, one run has no interval, the recordings are not there, or it needs
what this project does not have.
"""

from collections.abc import Callable, Hashable, Iterable, Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import pandas as pd

from pipeline.base.availability import why_not_run
from pipeline.base.errors import InputError
from pipeline.reporting.words import markdown
from pipeline.reporting.words.labels import model_name
from pipeline.scoring import results
from pipeline.scoring.glove_results import read_augmentation, read_counts, read_stag
from pipeline.scoring.published import METHODS
from pipeline.scoring.results import estimate
from pipeline.scoring.strain_results import read_study

REPRODUCED, NOT_REPRODUCED, NOT_TESTABLE = "reproduced", "not reproduced", "not testable"
TOLERANCE = 0.1  # of the published value
SHOWN = 3  # names in a reason
EXPERIMENTS = {"lomp": "touch", "latent": "strain", "sp_resnet": "glove"}  # what each paper's simulated data are
PAPERS = {"lomp": "LoMP (touch)", "latent": "Drift-free latent space (strain)", "sp_resnet": "SP-ResNet (glove)"}


class NotTestable(Exception):
    """Why a claim cannot be judged."""


class Judgement(NamedTuple):
    """Our value with its interval (NaN where there is none), and the verdict that follows."""

    ours: float
    low: float
    high: float
    verdict: str
    reason: str
    over: str  # what the interval is over; empty where there is none


class Evidence:
    """The results that the claims read: each file once, and only when it is asked for.

    values: params.yaml, as `params.load` gives it. given: content that takes the place of a file, under the name of
    the method and its arguments, as in {("scores", "touch"): scores}, where scores is anything with
    `runs(protocol, condition, model, metric)` -> one value per seed of `values`, NaN for a failed run.
    """

    def __init__(self, values: Mapping, given: Mapping[Hashable, object] | None = None):
        self.values = values
        self._known = dict(given or {})

    def once(self, key: Hashable, read: Callable[[], object]) -> object:
        """Return the content known under `key`; the first time, that is the answer of `read`."""
        if key not in self._known:
            self._known[key] = read()
        return self._known[key]

    def require(self, experiment: str, *models: str) -> None:
        """Raise NotTestable where the recordings are absent or a model is not among those of params.yaml."""
        if ("scores", experiment) not in self._known:
            reason = self.once(("absent", experiment), lambda: why_not_run(experiment))
            if reason is not None:
                raise NotTestable(reason)
        for model in models:
            if model not in self.values[experiment]["models"]:
                raise NotTestable(f"{model_name(model)} is not among the models of params.yaml")

    def scores(self, experiment: str):
        """Read scores.csv of an experiment (results.Scores)."""
        self.require(experiment)
        return self.once(("scores", experiment), lambda: results.Scores(experiment, self.values[experiment]))

    def runs(self, experiment: str, protocol: str, condition: str, model: str, metric: str) -> pd.Series:
        """Read seed -> value. Raises NotTestable where a run failed or is missing."""
        self.require(experiment, model)
        scores = self.scores(experiment)
        if protocol not in self.values[experiment]["protocols"]:
            raise NotTestable(f"{experiment} has no protocol {protocol} in params.yaml")
        try:
            values = scores.runs(protocol, condition, model, metric)
        except InputError as error:
            raise NotTestable(str(error)) from error
        seeds = self.values[experiment]["protocols"][protocol]["seeds"]
        return complete(pd.Series(values, index=seeds, dtype=float), f"{model_name(model)} ({protocol}, {condition})")

    def latency(self, experiment: str, model: str, column: str = "p50_ms") -> float:
        """Read a number of latency.csv at the first batch size: the median time in ms, or another column."""
        self.require(experiment, model)
        settings = self.values[experiment]
        rows = self.once(("latency", experiment), lambda: results.read_latency(experiment, settings))
        return float(rows[model, settings["latency"]["batches"][0]][column])

    def training_times(self, experiment: str, model: str, protocol: str) -> pd.Series:
        """Read the measured training seconds, one value per seed in the order of params.yaml."""
        self.require(experiment, model)
        key = ("training_times", experiment, model, protocol)
        times = self.once(key, lambda: results.read_training_times(experiment, model, protocol))
        return complete(pd.Series(times, dtype=float), f"{model_name(model)} ({protocol})")

    def fits(self, experiment: str, model: str, protocol: str) -> list[results.Fit]:
        """Read how the runs of a model were trained, one fit per seed."""
        self.require(experiment, model)
        seeds = self.values[experiment]["protocols"][protocol]["seeds"]
        return self.once(
            ("fits", experiment, model, protocol),
            lambda: [results.read_fit(experiment, model, protocol, seed) for seed in seeds],
        )

    def counts(self) -> pd.DataFrame:
        """Read counts.csv."""
        return self.once(("counts",), read_counts)

    def study(self, name: str) -> pd.DataFrame:
        """Read a table of the study of strain: samples, drift or capacity."""
        return self.once(("study", name), lambda: read_study(name))

    def augmentation(self, method: str, dataset: str) -> pd.Series:
        """Read the macro precision in % with one augmentation method, one value per seed."""
        settings = self.values["glove"]
        self.require("glove", settings["augmentation"]["model"])
        values = self.once(("augmentation",), lambda: read_augmentation(settings, "macro_precision"))
        return 100 * complete(pd.Series(values[method, dataset], dtype=float), f"{METHODS[method]}, {dataset}")

    def table(self, experiment: str):
        """Read the dataset's table."""
        self.require(experiment)
        return self.once(("table", experiment), lambda: results.read_windows(experiment))

    def stag(self) -> pd.DataFrame:
        """Read stag.csv; no row where the user has named no file."""
        return self.once(("stag",), read_stag)


Judge = Callable[[Evidence], Judgement]


@dataclass(frozen=True)
class Claim:
    """One sentence of a paper that can be true or false of our numbers."""

    paper: str  # key of PAPERS
    key: str  # short name, unique together with `data`
    section: str  # where the paper says it
    unit: str
    text: str  # the sentence, in our words
    judge: Judge
    published: float = np.nan
    data: str = "simulated"  # or recorded
    printed: bool = False  # repeats a number of a table, rather than being a sentence
    measured: bool = False  # rests on measured times: differs between runs and machines
    # The paragraph on what was tried to find the reason: printed only where the claim is not reproduced.
    why: Callable[[Evidence], str] | None = None

    def judged(self, evidence: Evidence) -> Judgement:
        """Return the verdict, which is `not testable` where something that it needs is missing."""
        try:
            return self.judge(evidence)
        except NotTestable as error:
            return Judgement(np.nan, np.nan, np.nan, NOT_TESTABLE, str(error), "")

    def explained(self, evidence: Evidence) -> str:
        """Return the paragraph on a claim that is not reproduced."""
        if self.why is None:
            return "No reason was looked for."
        try:
            return self.why(evidence)
        except NotTestable as error:
            return f"What was found cannot be repeated here: {error}."


def complete(values: pd.Series, who: str) -> pd.Series:
    """Return `values`, none of which failed. Raises NotTestable otherwise."""
    if failed := int((~np.isfinite(values)).sum()):
        raise NotTestable(f"failed runs: {who}, {failed} of {len(values)}")
    if not len(values):
        raise NotTestable(f"there are no runs: {who}")
    return values


def interval(values: pd.Series) -> results.Estimate:
    """Return mean and interval of differences paired by their index; pairs with one side missing are left out."""
    mean = estimate(values.dropna())
    if mean.runs < 2:
        raise NotTestable("one run has no interval" if mean.runs else "there are no values to compare")
    return mean


def each(models: Iterable[str], text: Callable[[str], str]) -> str:
    """Return `text(model)` behind the name of every model."""
    return ", ".join(f"{model_name(model)} {text(model)}" for model in models)


def summary(values: pd.Series, digits: int = 2) -> str:
    """Return mean and interval of one value per seed as text."""
    return markdown.interval(estimate(values), digits)


def untestable(reason: str) -> Judge:
    """Return the judge of a claim that no number of this project can decide."""

    def judge(evidence: Evidence) -> Judgement:
        raise NotTestable(reason)

    return judge


def side(low: float, high: float) -> str:
    """Return which side of 0 an interval lies on, for a claim that it is above."""
    return "" if low > 0 else "contradicted" if high < 0 else "undecided"


def positive(values: pd.Series, over: str = "seeds") -> Judgement:
    """Judge a direction: the mean is above 0."""
    mean = interval(values)
    word = side(mean.low, mean.high)
    reason = {"": "", "undecided": "undecided: the interval includes 0", "contradicted": "contradicted"}[word]
    return Judgement(*mean[:3], NOT_REPRODUCED if word else REPRODUCED, reason, f"{mean.runs} {over}")


def all_positive(values: Mapping[str, pd.Series], over: str = "seeds") -> Judgement:
    """Judge several directions, each by its name: every mean is above 0."""
    means = {name: interval(by_seed) for name, by_seed in values.items()}
    weakest = min(means, key=lambda name: means[name].low)
    sides = {name: side(mean.low, mean.high) for name, mean in means.items()}
    wrong = [name for name, word in sides.items() if word]
    reason = f"weakest: {weakest}"
    if wrong:
        reason = f"{len(means) - len(wrong)} of {len(means)} hold"
        for word in ("undecided", "contradicted"):
            names = [name for name, side_of in sides.items() if side_of == word]
            more = f" and {len(names) - SHOWN} more" if len(names) > SHOWN else ""
            if names:
                reason = f"{reason}; {word}: {', '.join(names[:SHOWN])}{more}"
    mean = means[weakest]
    return Judgement(*mean[:3], NOT_REPRODUCED if wrong else REPRODUCED, reason, f"{mean.runs} {over}")


def number(values: pd.Series, published: float, over: str = "seeds") -> Judgement:
    """Judge a number: the mean is within TOLERANCE of the published value."""
    mean = estimate(values.dropna())
    if not mean.runs:
        raise NotTestable("there are no values to compare")
    off = mean.mean / published - 1
    reason = f"{100 * off:+.0f} % from the published value"
    if mean.runs > 1:
        reason += ", which the interval " + ("includes" if mean.low <= published <= mean.high else "excludes")
    verdict = REPRODUCED if abs(off) <= TOLERANCE else NOT_REPRODUCED
    return Judgement(*mean[:3], verdict, reason, f"{mean.runs} {over}" if mean.runs > 1 else "")


def at_most(values: pd.Series, margin: float, over: str = "seeds") -> Judgement:
    """Judge that nothing increases: the whole interval is below the margin."""
    mean = interval(values)
    reason, verdict = f"margin {margin:g}", REPRODUCED
    if not mean.high < margin:
        verdict = NOT_REPRODUCED
        reason = f"{'contradicted' if mean.low > margin else 'undecided'}: the margin is {margin:g}"
    return Judgement(*mean[:3], verdict, reason, f"{mean.runs} {over}")


def within(values: pd.Series, margin: float, over: str = "seeds") -> Judgement:
    """Judge that nothing differs: the whole interval lies between -margin and margin."""
    mean = interval(values)
    reason, verdict = f"margin {margin:g}", REPRODUCED
    if not -margin < mean.low <= mean.high < margin:
        verdict = NOT_REPRODUCED
        apart = mean.low > margin or mean.high < -margin
        reason = f"{'contradicted' if apart else 'undecided'}: the margin is {margin:g}"
    return Judgement(*mean[:3], verdict, reason, f"{mean.runs} {over}")


def count(ours: float, published: float, equal: bool | None = None) -> Judgement:
    """Judge a count: equal to the published one; `equal`: whether it is, where the paper printed a rounded number."""
    same = ours == published if equal is None else equal
    reason = "" if same else f"{100 * (ours / published - 1):+.1f} % from the published count"
    return Judgement(float(ours), np.nan, np.nan, REPRODUCED if same else NOT_REPRODUCED, reason, "")


def slower(ratios: Mapping[str, float]) -> Judgement:
    """Judge measured times: every ratio, each by its name, is above 1 + TOLERANCE; the smallest is shown."""
    wrong = [name for name, ratio in ratios.items() if not ratio > 1 + TOLERANCE]
    close = all(abs(ratios[name] - 1) <= TOLERANCE for name in wrong)
    reason = "one measurement, no interval"
    if wrong:
        reason = f"{'undecided, too close' if close else 'contradicted'}: not {', '.join(wrong)}; {reason}"
    smallest = min(ratios.values())
    return Judgement(smallest, np.nan, np.nan, NOT_REPRODUCED if wrong else REPRODUCED, reason, "")


def near(values: Callable[[Evidence], pd.Series], published: float) -> Judge:
    """Return the judge of a number."""
    return lambda evidence: number(values(evidence), published)


def all_of(models: Iterable[str], values: Callable[[Evidence, str], pd.Series]) -> Judge:
    """Return the judge of one direction per model: `values(evidence, model)` is above 0."""
    return lambda evidence: all_positive({model_name(model): values(evidence, model) for model in models})


def printed_claim(
    paper: str,
    key: str,
    section: str,
    unit: str,
    text: str,
    values: Callable[[Evidence], pd.Series],
    published: float,
    **more,
) -> Claim:
    """Return the claim that repeats a number of a table; values: our number, by seed; more: further fields of Claim."""
    return Claim(paper, key, section, unit, text, near(values, published), published, printed=True, **more)
