"""Judge the claims of the papers: the rules, the claim that names one, and the evidence that the rules read.

Nothing else in this project says whether a claim is reproduced. There are four verdicts, and one rule for each kind of
claim. An interval is the 95 % t interval of one value per seed (or of what `over` names); where two models are
compared, the values are differences paired by seed, whose data they share. Intervals are not widened for the number of
claims.

A rule asks where the interval lies: all of it where the claim says it is, `reproduced`; all of it elsewhere,
`contradicted`; on both sides of the limit, `undecided`. So the less is known, the fewer claims are either of the first.

* direction (`positive`): "A is above B". The limit of A - B is 0, or what the claim names.
* several directions (`all_positive`): reproduced if every one of them is, contradicted if one is. The weakest is shown.
* order (`ordered`): the share of pairs that come in the printed order. The limit is AGREEMENT.
* number (`number`): our value lies within BAND of the printed one, on the scale of errors: of 95 % right, the band is
  a share of the 5 % wrong.
* no difference (`within`), no increase (`at_most`): the limits are those of a margin.
* count (`count`): equal to the published one, at the precision that is printed, or not.
* measured time (`slower`): a ratio of medians without an interval. Reproduced if it is above 1 + TOLERANCE, undecided
  within TOLERANCE of 1.

`not testable`: a run of it failed or is missing, one run has no interval, a network that it is about was not trained to
the end (a longer training lowers its validation error by 1 % or more, reports/longer), the recordings are not there,
or it needs what this project does not have. The numbers that a scene was tuned to are `calibrated`, whatever they are.

At the papers' scale a claim on networks that were not trained to the end has a verdict all the same, where a longer
training would not change it: where the rule says the same of test errors that are lower by what the longer training
takes from the validation error, once and twice, for all of these networks at once and for each of them alone. Twice is
what ever longer trainings take together, where each takes half of what the one before took.

A printed number is judged on the split that the paper used, as far as its text says; beside it stands the verdict on
the stricter one, where nothing is on two sides.

A paper printed single numbers. So besides its sign, a difference is `compatible` where our interval includes the
printed difference.
"""

from collections.abc import Callable, Hashable, Iterable, Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import pandas as pd

from pipeline.base import params
from pipeline.base.availability import why_not_run
from pipeline.base.errors import InputError
from pipeline.reporting.verdicts import longer
from pipeline.reporting.words import markdown
from pipeline.reporting.words.labels import model_name
from pipeline.scoring import classification, results
from pipeline.scoring.glove_results import read_augmentation, read_counts, read_stag
from pipeline.scoring.published import METHODS
from pipeline.scoring.results import estimate
from pipeline.scoring.strain_results import read_study

REPRODUCED, CONTRADICTED, UNDECIDED, NOT_TESTABLE = "reproduced", "contradicted", "undecided", "not testable"
VERDICTS = (REPRODUCED, CONTRADICTED, UNDECIDED, NOT_TESTABLE)
CALIBRATED = "calibrated"
SENTENCE, NUMBER = "sentence", "number"  # kinds of claims; these two are counted
COUNT, CONSTRUCTION, CALIBRATION = "count", "by construction", "calibration"
TOLERANCE = 0.1  # of a ratio of 1: less is no difference
BAND = 0.15  # of a printed error: what our error may differ by
AGREEMENT = 0.8  # share of pairs in the printed order
SHOWN = 3  # names in a reason
EXPERIMENTS = {"lomp": "touch", "latent": "strain", "sp_resnet": "glove"}  # what each paper's simulated data are
RECORDED_EXPERIMENTS = {"lomp": "velostat_recorded", "latent": "strain_recorded", "sp_resnet": "glove_recorded"}
PAPERS = {"lomp": "LoMP (touch)", "latent": "Drift-free latent space (strain)", "sp_resnet": "SP-ResNet (glove)"}


Network = tuple[str, str, str]  # experiment, protocol, model


class NotTestable(Exception):
    """Why a claim cannot be judged; ours: our number all the same, NaN where there is none."""

    def __init__(self, reason: str, ours: float = np.nan):
        super().__init__(reason)
        self.ours = ours


class Judgement(NamedTuple):
    """Our value with its interval (NaN where there is none), and the verdict that follows."""

    ours: float
    low: float
    high: float
    verdict: str
    reason: str
    over: str  # what the interval is over; empty where there is none
    compatible: bool | None = None  # whether the interval includes the published difference; None: there is none
    strict: str = ""  # the verdict on the stricter split, of a printed number that has one
    strict_ours: float = np.nan  # our number on that split


class Evidence:
    """The results that the claims read: each file once, and only when it is asked for.

    values: params.yaml, as `params.load` gives it. given: content that takes the place of a file, under the name of
    the method and its arguments, as in {("scores", "touch"): scores}, where scores is anything with
    `runs(protocol, condition, model, metric)` -> one value per seed of `values`, NaN for a failed run. partial: not
    every stage was run, so that a missing file makes a claim not testable and is no error.
    """

    def __init__(self, values: Mapping, given: Mapping[Hashable, object] | None = None, partial: bool = False):
        self.values, self.partial = values, partial
        self._known = dict(given or {})
        self.networks: set[Network] = set()  # whose scores a judge read
        self.read: set[Hashable] = set()  # kinds of content that a judge read
        self.factors: dict[Network, float] = {}  # of the test errors to expect of a longer training, over those read

    def once(self, key: Hashable, read: Callable[[], object]) -> object:
        """Return the content known under `key`; the first time, that is what `read` returns."""
        self.read.add(key[0])
        if key not in self._known:
            try:
                self._known[key] = read()
            except InputError as error:
                if self.partial:
                    raise NotTestable(str(error)) from error
                raise
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
        self.networks.add((experiment, protocol, model))
        scores = self.scores(experiment)
        if protocol not in self.values[experiment]["protocols"]:
            raise NotTestable(f"{experiment} has no protocol {protocol} in params.yaml")
        try:
            values = scores.runs(protocol, condition, model, metric)
        except InputError as error:
            raise NotTestable(str(error)) from error
        seeds = self.values[experiment]["protocols"][protocol]["seeds"]
        who = f"{model_name(model)} ({protocol}, {condition})"
        known = complete(pd.Series(values, index=seeds, dtype=float), who)
        return longer.with_errors(known, metric, self.factors.get((experiment, protocol, model), 1.0))

    def change(self, experiment: str, protocol: str, model: str) -> float:
        """Return the share by which a longer training changes a network's validation error; NaN where it is not known.

        Trainings of another protocol of the same experiment stand for one that was not trained longer itself; those of
        other numbers of epochs than params.yaml has say nothing.
        """
        if "training" not in params.model_settings(self.values, experiment, model):
            return np.nan
        table = self.once(("longer", experiment), lambda: longer.changes(longer.read(experiment)))
        epochs = params.epochs(params.run_settings(self.values, experiment, model, protocol))
        rows = table[(table["model"] == model) & (table["epochs"] == epochs)]
        here = rows[rows["protocol"] == protocol]
        return float((here if len(here) else rows)["change"].mean())

    def unended(self) -> dict[Network, float]:
        """Return the change of each network whose scores were read and whose error a longer training lowers."""
        changes = {network: self.change(*network) for network in sorted(self.networks)}
        return {network: change for network, change in changes.items() if change <= -longer.ENDED}

    def at_papers_scale(self, networks: Iterable[Network]) -> bool:
        """Tell whether params.yaml has the papers' scale for the experiments of these networks."""
        experiments = {experiment for experiment, _, _ in networks}
        return all(params.scale_of(name, self.values[name]) != "laptop" for name in experiments)

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
SCORES = {"scores", "absent", "longer"}  # content that is errors of whole runs, which a longer training would lower


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
    kind: str = SENTENCE
    strict: Judge | None = None  # on the stricter split, where the paper's own has neighbours on both sides
    measured: bool = False  # rests on measured times: differs between runs and machines
    # The paragraph on what was tried to find the reason: printed only where the claim is not reproduced.
    why: Callable[[Evidence], str] | None = None

    @property
    def id(self) -> str:
        """Return the claim's name in all files, the same from run to run."""
        return f"{self.paper}/{self.key}" + ("/recorded" if self.data == "recorded" else "")

    def judged(self, evidence: Evidence) -> Judgement:
        """Return the verdict, which is `not testable` where something that it needs is missing."""
        judged = testable(self.judge, evidence)
        if self.strict:
            strict = testable(self.strict, evidence)
            judged = judged._replace(strict=strict.verdict, strict_ours=strict.ours)
        if judged.verdict == NOT_TESTABLE:
            return judged
        if self.kind == CALIBRATION:
            return judged._replace(verdict=CALIBRATED)
        if self.kind == SENTENCE and np.isfinite([self.published, judged.low, judged.high]).all():
            return judged._replace(compatible=bool(judged.low <= self.published <= judged.high))
        return judged

    def explained(self, evidence: Evidence) -> str:
        """Return the paragraph on a claim that is not reproduced."""
        if self.why is None:
            return "No reason was looked for."
        try:
            return self.why(evidence)
        except NotTestable as error:
            return f"What was found cannot be repeated here: {error}."


def testable(judge: Judge, evidence: Evidence) -> Judgement:
    """Return what a judge says; `not testable` where it misses something, or a network was not trained to the end."""
    evidence.networks.clear()
    evidence.read.clear()
    try:
        judged = judge(evidence)
    except NotTestable as error:
        return Judgement(error.ours, np.nan, np.nan, NOT_TESTABLE, str(error), "")
    if judged.verdict in (REPRODUCED, CONTRADICTED, UNDECIDED) and (unended := evidence.unended()):
        said = list(
            dict.fromkeys(f"{model_name(m)} ({100 * c:.0f} % with more epochs)" for (_, _, m), c in unended.items())
        )
        falling = ", ".join(said[:SHOWN]) + (f" and {len(said) - SHOWN} more" if len(said) > SHOWN else "")
        if stays(judge, judged.verdict, evidence, unended):
            reason = f"stays where test errors fall as validation errors still do, or by twice as much: {falling}"
            return judged._replace(reason=f"{judged.reason}; {reason}" if judged.reason else reason)
        reason = f"validation errors still fall: {falling}; so far {judged.verdict}"
        return judged._replace(verdict=NOT_TESTABLE, reason=f"{reason}: {judged.reason}" if judged.reason else reason)
    return judged


def stays(judge: Judge, verdict: str, evidence: Evidence, unended: Mapping[Network, float]) -> bool:
    """Tell whether a verdict of the papers' scale is the same after longer trainings of these networks.

    Of all at once and of each alone. False where the judge reads other content than SCORES: predictions of a longer
    training are not known. unended: network -> change of its validation error.
    """
    if not evidence.read <= SCORES or not evidence.at_papers_scale(unended):
        return False
    try:
        for networks in (unended, *([network] for network in unended)):
            for gains in (1, 2):
                evidence.factors = {network: (1 + unended[network]) ** gains for network in networks}
                if judge(evidence).verdict != verdict:
                    return False
    except NotTestable:
        return False
    finally:
        evidence.factors = {}
    return True


def complete(values: pd.Series, who: str) -> pd.Series:
    """Return `values`, none of which failed. Raises NotTestable otherwise."""
    if failed := int((~np.isfinite(values)).sum()):
        raise NotTestable(f"failed runs: {who}, {failed} of {len(values)}")
    if not len(values):
        raise NotTestable(f"there are no runs: {who}")
    return values


def interval(values: pd.Series, scale: str = results.PLAIN, trials: int = 0) -> results.Estimate:
    """Return mean and interval of values or of differences paired by their index; pairs with one side are left out.

    scale, trials: as of results.estimate.
    """
    mean = estimate(values.dropna(), scale, trials)
    if mean.runs < 2:
        raise NotTestable("one run has no interval" if mean.runs else "there are no values to compare")
    if np.isnan(mean.low):
        raise NotTestable(f"all {mean.runs} runs have one value, {mean.mean:.4g}, which tells nothing of their spread")
    return mean


def each(models: Iterable[str], text: Callable[[str], str]) -> str:
    """Return `text(model)` behind the name of every model."""
    return ", ".join(f"{model_name(model)} {text(model)}" for model in models)


def summary(values: pd.Series, digits: int = 2, scale: str = results.PLAIN) -> str:
    """Return mean and interval of one value per seed as text; scale: as of results.estimate."""
    return markdown.interval(estimate(values, scale), digits)


def untestable(reason: str) -> Judge:
    """Return the judge of a claim that no number of this project can decide."""

    def judge(evidence: Evidence) -> Judgement:
        raise NotTestable(reason)

    return judge


def verdict_of(low: float, high: float, limit: float) -> str:
    """Return the verdict of an interval on the claim that a value is above a limit."""
    return REPRODUCED if low > limit else CONTRADICTED if high < limit else UNDECIDED


def positive(
    values: pd.Series, over: str = "seeds", above: float = 0.0, scale: str = results.PLAIN, trials: int = 0
) -> Judgement:
    """Judge a direction: the mean is above `above`; scale, trials: as of results.estimate."""
    mean = interval(values, scale, trials)
    verdict = verdict_of(mean.low, mean.high, above)
    reasons = {UNDECIDED: f"the interval includes {above:g}", CONTRADICTED: f"the interval is below {above:g}"}
    reason = reasons.get(verdict, f"needs more than {above:g}" if above else "")
    return Judgement(*mean[:3], verdict, reason, f"{mean.runs} {over}")


def all_positive(values: Mapping[str, pd.Series], over: str = "seeds") -> Judgement:
    """Judge several directions, each by its name: every mean is above 0."""
    means = {name: interval(by_seed) for name, by_seed in values.items()}
    weakest = min(means, key=lambda name: means[name].low)
    verdicts = {name: verdict_of(mean.low, mean.high, 0.0) for name, mean in means.items()}
    verdict = next(each for each in (CONTRADICTED, UNDECIDED, REPRODUCED) if each in verdicts.values())
    reason = f"weakest: {weakest}"
    if verdict != REPRODUCED:
        reason = f"{list(verdicts.values()).count(REPRODUCED)} of {len(means)} hold"
        for word in (UNDECIDED, CONTRADICTED):
            names = [name for name, verdict_of_one in verdicts.items() if verdict_of_one == word]
            more = f" and {len(names) - SHOWN} more" if len(names) > SHOWN else ""
            if names:
                reason = f"{reason}; {word}: {', '.join(names[:SHOWN])}{more}"
    mean = means[weakest]
    return Judgement(*mean[:3], verdict, reason, f"{mean.runs} {over}")


def ordered(pairs: Mapping[str, pd.Series]) -> Judgement:
    """Judge an order: the share of pairs, each a difference by seed that is above 0 in the printed order."""
    gaps = pd.DataFrame(pairs).dropna()
    by_mean, certain = int((gaps.mean() > 0).sum()), sum(interval(gap).low > 0 for gap in pairs.values())
    judged = positive((gaps > 0).mean(axis=1), above=AGREEMENT, scale=results.SHARE, trials=len(pairs))
    reason = f"{by_mean} of {len(pairs)} pairs are in the paper's order by their means, {certain} for certain"
    return judged._replace(reason=f"{reason}; {judged.reason}")


def number(values: pd.Series, published: float, over: str = "seeds", best: float = 0.0) -> Judgement:
    """Judge a number: it lies within BAND of the published one; best: the value of no error, such as 100 %."""
    try:
        mean = interval(values)
    except NotTestable as error:
        raise NotTestable(str(error), float(values.mean())) from None
    band = BAND * abs(published - best)
    verdict = UNDECIDED
    if published - band <= mean.low and mean.high <= published + band:
        verdict = REPRODUCED
    elif mean.high < published - band or mean.low > published + band:
        verdict = CONTRADICTED
    off = (mean.mean - best) / (published - best) - 1
    reason = f"{'error ' if best else ''}{100 * off:+.0f} % from the published one; the band is {100 * BAND:.0f} %"
    return Judgement(*mean[:3], verdict, reason, f"{mean.runs} {over}")


def measured_number(value: float, published: float) -> Judgement:
    """Judge a measured number without an interval: it is within BAND of the published one, or not."""
    off = value / published - 1
    verdict = REPRODUCED if abs(off) <= BAND else CONTRADICTED
    reason = f"{100 * off:+.0f} % from the published one; the band is {100 * BAND:.0f} %; one measurement, no interval"
    return Judgement(value, np.nan, np.nan, verdict, reason, "")


def at_most(values: pd.Series, margin: float, over: str = "seeds", scale: str = results.PLAIN) -> Judgement:
    """Judge that nothing increases: the whole interval is below the margin; scale: as of results.estimate."""
    mean = interval(values, scale)
    return Judgement(*mean[:3], verdict_of(-mean.high, -mean.low, -margin), f"margin {margin:g}", f"{mean.runs} {over}")


def all_at_most(values: Mapping[str, pd.Series], limit: float) -> Judgement:
    """Judge that several values, each by its name, are all below a limit; the largest is shown."""
    judged = all_positive({name: limit - by_seed for name, by_seed in values.items()})
    ours, low, high = (limit - value for value in (judged.ours, judged.high, judged.low))
    return judged._replace(ours=ours, low=low, high=high, reason=f"limit {limit:g}; {judged.reason}")


def within(values: pd.Series, margin: float, over: str = "seeds", around: float = 0.0) -> Judgement:
    """Judge that nothing differs: the whole interval is nearer than the margin to `around`."""
    mean = interval(values)
    low, high, verdict = mean.low - around, mean.high - around, UNDECIDED
    if -margin < low <= high < margin:
        verdict = REPRODUCED
    elif low > margin or high < -margin:
        verdict = CONTRADICTED
    return Judgement(*mean[:3], verdict, f"margin {margin:g} around {around:g}", f"{mean.runs} {over}")


def count(ours: float, published: float, equal: bool | None = None) -> Judgement:
    """Judge a count: equal to the published one; `equal`: whether it is, where the paper printed a rounded number."""
    same = ours == published if equal is None else equal
    reason = "" if same else f"{100 * (ours / published - 1):+.1f} % from the published count"
    return Judgement(float(ours), np.nan, np.nan, REPRODUCED if same else CONTRADICTED, reason, "")


def slower(ratios: Mapping[str, float]) -> Judgement:
    """Judge measured times: every ratio, each by its name, is above 1 + TOLERANCE; the smallest is shown."""
    wrong = [name for name, ratio in ratios.items() if not ratio > 1 + TOLERANCE]
    verdict, reason = REPRODUCED, "one measurement, no interval"
    if wrong:
        verdict = UNDECIDED if all(abs(ratios[name] - 1) <= TOLERANCE for name in wrong) else CONTRADICTED
        reason = f"{'too close' if verdict == UNDECIDED else 'not'}: {', '.join(wrong)}; {reason}"
    return Judgement(min(ratios.values()), np.nan, np.nan, verdict, reason, "")


def near(values: Callable[[Evidence], pd.Series], published: float, best: float = 0.0) -> Judge:
    """Return the judge of a number; best: the value of no error."""
    return lambda evidence: number(values(evidence), published, best=best)


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
    best: float = 0.0,
    strict: Callable[[Evidence], pd.Series] | None = None,
    **more,
) -> Claim:
    """Return the claim that repeats a number of a table.

    values: our number, by seed, on the split that the paper used; strict: on the stricter one; more: further fields of
    Claim.
    """
    judge = near(values, published, best)
    stricter = near(strict, published, best) if strict else None
    return Claim(paper, key, section, unit, text, judge, published, kind=NUMBER, strict=stricter, **more)


def calibration_claim(paper: str, section: str, text: str, published: float) -> Claim:
    """Return the claim on the one ratio of errors that the paper's scene was tuned to."""
    experiment = EXPERIMENTS[paper]

    def judge(e: Evidence) -> Judgement:
        chosen = e.values[experiment]["yardstick"]
        place = chosen["protocol"], chosen["condition"]
        errors = [e.runs(experiment, *place, chosen[role], chosen["metric"]) for role in ("model", "over")]
        model, over = (1 - error for error in errors) if chosen["metric"] in classification.METRICS else errors
        mean = estimate(model / over)
        reason = f"{experiment}.{chosen['knob']} was set by it, on validation parts"
        return Judgement(*mean[:3], CALIBRATED, reason, f"{mean.runs} seeds" if mean.runs > 1 else "")

    return Claim(paper, f"calibration-{experiment}", section, "1", text, judge, published, kind=CALIBRATION)
