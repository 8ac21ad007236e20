"""Judge which effects of a simulated scene the results need: errors without each, compared with those of other seeds.

The yardstick is how much results vary between seeds with all effects on. Leaving an effect out compares the mean error
of some seeds with that of the same seeds; the same comparison between different seeds of the whole scene shows what
chance does. Errors are compared as ratios (logarithms; means are geometric), for an effect may be the reason why seeds
differ: without drift, all errors are small, which no difference in mm would show beside the largest of them. An effect
is needed if, without it,

* a model's error changes by more than its floor, the 95 % band of a difference between two means of as many seeds,
  t s sqrt(2 / m) with s the spread over all seeds (or, if larger, the median one of all models and conditions), and
  in the same direction in every seed; or
* the order of the models changes more (a smaller Kendall's tau) than between 95 % of such groups of seeds; or
* a claim that all seeds agree on turns over.

verdicts/rules.py asks another question: whether a difference is above 0 in the seeds that were drawn.
"""

from collections.abc import Callable, Iterable, Mapping
from itertools import combinations
from typing import NamedTuple

import numpy as np
import pandas as pd
from scipy.special import stdtrit
from scipy.stats import kendalltau

from pipeline.base import paths
from pipeline.scoring import complete, results
from pipeline.scoring.results import CONFIDENCE
from pipeline.scoring.variants import COLUMNS, NONE, variants

LEAST = 0.01  # share of its error below which no change of a model counts, however little the seeds differ
LOWEST = 1e-3  # smaller errors are taken for this one: less than one image of a small test part, 1 um, 1 Pa
NEEDED, NOT_NEEDED, FAILED = "needed", "not needed", "failed"

# Effects that no model has to see: what they are for.
PURPOSE = {
    ("touch", "line_faults"): "torn, doubled, missing and swapped lines and resets are what ingest is there for",
    ("touch", "hand_error"): "it is the part of the double-touch error that no model can mend",
    ("strain", "line_faults"): "torn, doubled, missing and swapped lines and gaps are what ingest is there for",
    ("strain", "jitter"): "uneven sampling is what the resampling of ingest is there for",
    ("glove", "line_faults"): "torn, doubled, missing and swapped lines are what ingest is there for",
}

Errors = Mapping[tuple[str, str], float]  # (model, condition) -> error, infinite if failed


class Claim(NamedTuple):
    """A sentence about errors. `holds` raises KeyError where a model or condition that it compares was not run."""

    name: str
    sentence: str
    holds: Callable[[Errors], bool]


CONVENTIONAL, NETWORKS = ("linear", "poly", "tree", "rbf"), ("cnn", "rnn", "lomp")  # of touch
IMAGES = ("pressure", "strain", "combined")  # of the glove
NETWORK = "sp_resnet_nogcam"  # of the glove


def least(errors: Errors, models: Iterable[str], condition: str) -> float:
    """Return the smallest error of several models."""
    return min(errors[model, condition] for model in models)


def loss(errors: Errors, model: str) -> float:
    """Return the factor by which a model's error grows from single to double touch."""
    return errors[model, "double"] / errors[model, "single"]


CLAIMS = {
    "touch": (
        Claim(  # LoMP paper, section IV-C: a clear gap between conventional and learning-based approaches
            "learning beats conventional",
            "on single touch, the best network has a smaller error than the best conventional model",
            lambda errors: least(errors, NETWORKS, "single") < least(errors, CONVENTIONAL, "single"),
        ),
        Claim(  # LoMP paper, section IV-D
            "LoMP best on double",
            "on double touch, LoMP has the smallest error of all",
            lambda errors: errors["lomp", "double"] < least(errors, (*CONVENTIONAL, "cnn", "rnn"), "double"),
        ),
        Claim(  # LoMP paper, Table I
            "double is harder",
            "every conventional model has a larger error on double than on single touch",
            lambda errors: all([errors[model, "double"] > errors[model, "single"] for model in CONVENTIONAL]),
        ),
        Claim(  # LoMP paper, Table I: 26.21 (CNN) and 19.28 kPa (RNN) against 16.91 (linear), the reverse of single
            "plain networks lose most",
            "from single to double touch, CNN or RNN lose more (as a factor) than linear regression",
            lambda errors: max(loss(errors, "cnn"), loss(errors, "rnn")) > loss(errors, "linear"),
        ),
    ),
    "strain": (
        Claim(  # latent-space paper, Table I: 0.43 mm of 10 mm; half of the constant's leaves room for short trainings
            "depth can be read",
            "task 1: direct training halves the constant's error",
            lambda errors: errors["lstm_direct", "task_1"] < errors["constant", "task_1"] / 2,
        ),
        Claim(  # latent-space paper, section III-B: the place is summed from slips, which a window of 2 s cannot tell
            "place can be summed from slips",
            "task 2: direct training has a smaller error than a ridge regression on a window of 2 s and the constant",
            lambda errors: errors["lstm_direct", "task_2"] < least(errors, ("constant", "ridge"), "task_2"),
        ),
        Claim(  # latent-space paper, Table I: transfer's error is 1.5 times that of direct training
            "transfer near direct, z",
            "task 1: the error of transfer is less than twice that of direct training",
            lambda errors: errors["lstm_transfer_ridge", "task_1"] < 2.0 * errors["lstm_direct", "task_1"],
        ),
        Claim(  # latent-space paper, Table I: 1.0 times
            "transfer near direct, xy",
            "task 2: the error of transfer is less than 1.25 times that of direct training",
            lambda errors: errors["lstm_transfer_ridge", "task_2"] < 1.25 * errors["lstm_direct", "task_2"],
        ),
    ),
    "glove": (  # SP-ResNet paper, Table 1: every model; all three datasets; every network
        Claim(
            "combined is best",
            "the network has its smallest error on combined images",
            lambda errors: errors[NETWORK, "combined"] < min(errors[NETWORK, images] for images in IMAGES[:2]),
        ),
        Claim(
            "network beats tree",
            "the network has a smaller error than the decision tree on all three datasets",
            lambda errors: all([errors[NETWORK, images] < errors["tree", images] for images in IMAGES]),
        ),
        Claim(
            "network beats naive Bayes",
            "the network has a smaller error than naive Bayes on all three datasets",
            lambda errors: all([errors[NETWORK, images] < errors["naive_bayes", images] for images in IMAGES]),
        ),
        Claim(
            "pressure tells more than joints",
            "the network has a smaller error on pressure than on strain images",
            lambda errors: errors[NETWORK, "pressure"] < errors[NETWORK, "strain"],
        ),
    ),
}


class Change(NamedTuple):
    """The change of one model's error in one condition where an effect is left out; geometric means over its seeds."""

    condition: str
    model: str
    before: float  # error with all effects
    after: float  # without this one; infinite if a run failed
    floor: float  # of the logarithm of their ratio, at least LEAST; NaN if a run with all effects failed
    steady: bool  # in the same direction in every seed

    @property
    def floors(self) -> float:
        """Return the change in units of the floor, positive where the error grows; NaN if a run failed."""
        return float(np.log(self.after / self.before)) / self.floor if np.isfinite(self.after) else np.nan

    @property
    def counts(self) -> bool:
        """Tell whether the change is more than chance: beyond the floor, and steady."""
        return abs(self.floors) > 1 and self.steady

    @property
    def relative(self) -> float:
        """Return the change as a share of the error with all effects."""
        return self.after / self.before - 1 if np.isfinite(self.after) else np.nan


class Judgement(NamedTuple):
    """The verdict on one effect, and the changes where it is left out."""

    effect: str
    tau: dict[str, float]  # condition -> Kendall's tau between the models' mean errors with and without
    changes: list[Change]
    flipped: list[str]  # names of claims that turn over
    verdict: str

    def largest(self, condition: str | None = None) -> Change:
        """Return the largest change in floors, of one condition or of all: failed ones first, then those that count."""
        changes = [change for change in self.changes if condition in (None, change.condition)]
        return max(changes, key=lambda change: (np.isnan(change.floors), change.counts, abs(change.floors)))


class Assessment(NamedTuple):
    """One experiment's effects, and the yardstick they are judged by."""

    floor_tau: dict[str, float]  # condition -> tau that 95 % of pairs of groups of seeds reach, all effects on
    claims: dict[str, bool | None]  # name -> whether it holds with all effects on; None: seeds differ
    effects: list[Judgement]


def read(experiment: str, values: Mapping) -> pd.DataFrame:
    """Read physics.csv of an experiment. Raises InputError for a run of params.yaml that is missing or there twice."""
    path, made_by = paths.physics(experiment), f"python -m pipeline.studies.physics {experiment}"
    scores = results.read_csv(path, COLUMNS, made_by)
    runs = (
        (*variant, condition, model)
        for variant in variants(values, experiment)
        for condition in dict.fromkeys(scores["condition"]) or ["any"]
        for model in values["physics"][experiment]["models"]
    )
    complete.check(scores, path, ["effect", "seed", "condition", "model"], runs, made_by)
    return scores


def errors(scores: pd.DataFrame) -> pd.DataFrame:
    """Return `scores` (variants.COLUMNS) with a column `error`: the value, or 1 - accuracy; infinite for a failed run.

    At least LOWEST, so that it has a logarithm.
    """
    value = scores["value"].where(scores["metric"] != "accuracy", 1 - scores["value"])
    return scores.assign(error=value.where(np.isfinite(value), np.inf).clip(lower=LOWEST))


def assess(experiment: str, scores: pd.DataFrame) -> Assessment:
    """Judge every effect of one experiment from its physics.csv."""
    table = errors(scores)
    runs: dict[str, dict[int, Errors]] = {}  # effect -> seed -> errors
    for (effect, seed), rows in table.groupby(["effect", "seed"], sort=False):
        by_model = dict(zip(zip(rows["model"], rows["condition"], strict=True), rows["error"], strict=True))
        runs.setdefault(effect, {})[seed] = by_model
    whole = runs.pop(NONE)
    every, conditions = list(whole.values()), list(dict.fromkeys(table["condition"]))
    size = min(map(len, runs.values()))
    floors = _floors(every, size)
    floor_tau = {condition: _floor_tau(every, size, condition) for condition in conditions}
    testable = [claim for claim in CLAIMS[experiment] if _is_testable(claim, every[0])]
    claims = {}
    for claim in testable:
        answers = {claim.holds(run) for run in every}
        claims[claim.name] = answers.pop() if len(answers) == 1 else None
    judged = []
    for effect, without in runs.items():
        before, after = mean([whole[seed] for seed in without]), mean(list(without.values()))
        changes = [
            Change(condition, model, before[key], after[key], floors[key], _steady(whole, without, key))
            for key in every[0]
            for model, condition in [key]
        ]
        taus = {condition: tau(before, after, condition) for condition in conditions}
        flipped = [claim.name for claim in testable if claims[claim.name] not in (None, claim.holds(after))]
        judged.append(Judgement(effect, taus, changes, flipped, _verdict(taus, floor_tau, changes, flipped)))
    return Assessment(floor_tau, claims, judged)


def _is_testable(claim: Claim, errors: Errors) -> bool:
    try:
        claim.holds(errors)
    except KeyError:
        return False
    return True


def mean(runs: list[Errors]) -> dict[tuple[str, str], float]:
    """Return the geometric mean error of every model and condition over runs; infinite if one failed."""
    return {key: float(np.exp(np.mean(np.log([run[key] for run in runs])))) for key in runs[0]}


def tau(one: Errors, other: Errors, condition: str) -> float:
    """Return Kendall's tau-b between the errors of all models in one condition: 1 for the same order, or one model."""
    models = [model for model, name in one if name == condition]
    if len(models) < 2:
        return 1.0
    return float(kendalltau([one[m, condition] for m in models], [other[m, condition] for m in models]).statistic)


def _floors(runs: list[Errors], size: int) -> dict[tuple[str, str], float]:
    """Return per model and condition the 95 % band of a difference between mean logarithms of `size` runs.

    It is NaN if a run failed. It rests on the spread over all runs of one seed each, or on the median spread of all
    models and conditions where that is larger: among so many, some agree by luck when there are few seeds.
    """
    with np.errstate(invalid="ignore"):  # infinite - infinite, of failed runs
        spread = {key: float(np.std(np.log([run[key] for run in runs]), ddof=1)) for key in runs[0]}
    finite = [value for value in spread.values() if np.isfinite(value)]
    middle = float(np.median(finite)) if finite else np.nan
    band = float(stdtrit(len(runs) - 1, (1 + CONFIDENCE) / 2) * np.sqrt(2 / size))
    least_change = float(np.log1p(LEAST))
    return {
        key: max(band * max(value, middle), least_change) if np.isfinite(value) else np.nan
        for key, value in spread.items()
    }


def _floor_tau(runs: list[Errors], size: int, condition: str) -> float:
    """Return the tau that 95 % of the pairs of disjoint groups of `size` seeds (half of all at most) reach."""
    size, places = min(size, len(runs) // 2), range(len(runs))
    taus = [
        tau(mean([runs[k] for k in first]), mean([runs[k] for k in second]), condition)
        for first in combinations(places, size)
        for second in combinations([k for k in places if k not in first], size)
    ]
    return float(np.quantile(taus, 1 - CONFIDENCE, method="lower"))


def _steady(whole: Mapping[int, Errors], without: Mapping[int, Errors], key: tuple[str, str]) -> bool:
    """Tell whether an error changes in the same direction in every seed."""
    signs = {np.sign(run[key] - whole[seed][key]) for seed, run in without.items()}
    return len(signs) == 1 and 0 not in signs


def _verdict(taus: Mapping, floor_tau: Mapping, changes: list[Change], flipped: list[str]) -> str:
    if any(np.isnan(change.floors) for change in changes):
        return FAILED
    reordered = any(taus[condition] < floor_tau[condition] - 1e-9 for condition in taus)
    return NEEDED if reordered or flipped or any(change.counts for change in changes) else NOT_NEEDED


def report_rows(experiment: str, assessment: Assessment) -> list[dict]:
    """Return the rows of reports/physics.csv: one per effect and condition."""
    return [
        {
            "experiment": experiment,
            "effect": judged.effect,
            "condition": condition,
            "tau": value,
            "floor_tau": assessment.floor_tau[condition],
            "model": largest.model,
            "change_floors": largest.floors,
            "change_relative": largest.relative,
            "claims_flipped": "; ".join(judged.flipped),
            "verdict": judged.verdict,
        }
        for judged in assessment.effects
        for condition, value in judged.tau.items()
        for largest in [judged.largest(condition)]
    ]
