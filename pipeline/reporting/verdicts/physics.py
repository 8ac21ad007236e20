"""Which effects of a simulated scene the results need: errors with and without, against what other seeds do.

The yardstick are seeds of the whole scene. Leaving an effect out compares the mean error of some seeds with that of
the same seeds; the same comparison between different seeds of the whole scene shows what chance does. Errors are
compared as ratios (logarithms; means are geometric), for an effect may be what makes seeds differ: without drift, all
errors are small, which no difference in mm would show beside the largest of them. An effect is needed if, without it,

* a model's error changes by more than its floor, the 95 % band of a difference between two means of as many seeds,
  t s sqrt(2 / m) with s the spread over all seeds (or, if larger, the median one of all models and conditions), and
  in the same direction in every seed; or
* the order of the models changes more (a smaller Kendall's tau) than between 95 % of such groups of seeds; or
* a claim that all seeds agree on turns over.
"""

from collections.abc import Callable, Mapping, Sequence
from itertools import combinations
from typing import NamedTuple

import numpy as np
import pandas as pd
from scipy.special import stdtrit
from scipy.stats import kendalltau

from pipeline.scoring.variants import NONE

CONFIDENCE = 0.95
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
    """A sentence about errors; testable where `models` and `conditions` were run."""

    name: str
    sentence: str
    models: tuple[str, ...]
    conditions: tuple[str, ...]
    holds: Callable[[Errors], bool]


CONVENTIONAL = ("linear", "poly", "tree", "rbf")
NETWORKS = ("cnn", "rnn", "lomp")


def least(errors: Errors, models: Sequence[str], condition: str) -> float:
    """The smallest error of several models."""
    return min(errors[model, condition] for model in models)


def learning_beats_conventional(errors: Errors) -> bool:
    """LoMP paper, section IV-C: a clear gap between conventional and learning-based approaches."""
    return least(errors, NETWORKS, "single") < least(errors, CONVENTIONAL, "single")


def lomp_best_on_double(errors: Errors) -> bool:
    """LoMP paper, section IV-D."""
    return errors["lomp", "double"] < least(errors, (*CONVENTIONAL, "cnn", "rnn"), "double")


def double_is_harder(errors: Errors) -> bool:
    """LoMP paper, Table I: every conventional model."""
    return all(errors[model, "double"] > errors[model, "single"] for model in CONVENTIONAL)


def networks_lose_their_lead(errors: Errors) -> bool:
    """LoMP paper, Table I: 26.21 (CNN) and 19.28 kPa (RNN) against 16.91 (linear), the reverse of single touch."""
    return max(errors[model, "double"] / errors[model, "single"] for model in ("cnn", "rnn")) > (
        errors["linear", "double"] / errors["linear", "single"]
    )


def direct_finds_the_depth(errors: Errors) -> bool:
    """Latent-space paper, Table I: 0.43 mm of 10 mm; half of the constant's error leaves room for short trainings."""
    return errors["lstm_direct", "task_1"] < errors["constant", "task_1"] / 2


def direct_finds_the_place(errors: Errors) -> bool:
    """Latent-space paper, section III-B: the place is summed from slips, better than a window of 2 s can tell."""
    return errors["lstm_direct", "task_2"] < min(errors["constant", "task_2"], errors["ridge", "task_2"])


def transfer_is_near(errors: Errors, condition: str, factor: float) -> bool:
    """Latent-space paper, Table I: transfer's error is 1.5 (task 1) and 1.0 times (task 2) that of direct training."""
    return errors["lstm_transfer_ridge", condition] < factor * errors["lstm_direct", condition]


def combined_is_best(errors: Errors) -> bool:
    """SP-ResNet paper, Table 1: every model."""
    return errors["sp_resnet_nogcam", "combined"] < min(errors["sp_resnet_nogcam", one] for one in IMAGES[:2])


def network_beats(errors: Errors, other: str) -> bool:
    """SP-ResNet paper, Table 1: all three datasets."""
    return all(errors["sp_resnet_nogcam", one] < errors[other, one] for one in IMAGES)


def pressure_beats_strain(errors: Errors) -> bool:
    """SP-ResNet paper, Table 1: every network."""
    return errors["sp_resnet_nogcam", "pressure"] < errors["sp_resnet_nogcam", "strain"]


TOUCH = (*CONVENTIONAL, *NETWORKS)
IMAGES = ("pressure", "strain", "combined")
CLAIMS = {
    "touch": (
        Claim(
            "learning beats conventional",
            "on single touch, the best network has a smaller error than the best conventional model",
            TOUCH,
            ("single",),
            learning_beats_conventional,
        ),
        Claim(
            "LoMP best on double",
            "on double touch, LoMP has the smallest error of all",
            TOUCH,
            ("double",),
            lomp_best_on_double,
        ),
        Claim(
            "double is harder",
            "every conventional model has a larger error on double than on single touch",
            CONVENTIONAL,
            ("single", "double"),
            double_is_harder,
        ),
        Claim(
            "plain networks lose most",
            "from single to double touch, CNN or RNN lose more (as a factor) than linear regression",
            ("linear", "cnn", "rnn"),
            ("single", "double"),
            networks_lose_their_lead,
        ),
    ),
    "strain": (
        Claim(
            "depth can be read",
            "task 1: direct training halves the constant's error",
            ("constant", "lstm_direct"),
            ("task_1",),
            direct_finds_the_depth,
        ),
        Claim(
            "place can be summed from slips",
            "task 2: direct training has a smaller error than a ridge regression on a window of 2 s and the constant",
            ("constant", "ridge", "lstm_direct"),
            ("task_2",),
            direct_finds_the_place,
        ),
        Claim(
            "transfer near direct, z",
            "task 1: the error of transfer is less than twice that of direct training",
            ("lstm_direct", "lstm_transfer_ridge"),
            ("task_1",),
            lambda errors: transfer_is_near(errors, "task_1", 2.0),
        ),
        Claim(
            "transfer near direct, xy",
            "task 2: the error of transfer is less than 1.25 times that of direct training",
            ("lstm_direct", "lstm_transfer_ridge"),
            ("task_2",),
            lambda errors: transfer_is_near(errors, "task_2", 1.25),
        ),
    ),
    "glove": (
        Claim(
            "combined is best",
            "the network has its smallest error on combined images",
            ("sp_resnet_nogcam",),
            IMAGES,
            combined_is_best,
        ),
        Claim(
            "network beats tree",
            "the network has a smaller error than the decision tree on all three datasets",
            ("sp_resnet_nogcam", "tree"),
            IMAGES,
            lambda errors: network_beats(errors, "tree"),
        ),
        Claim(
            "network beats naive Bayes",
            "the network has a smaller error than naive Bayes on all three datasets",
            ("sp_resnet_nogcam", "naive_bayes"),
            IMAGES,
            lambda errors: network_beats(errors, "naive_bayes"),
        ),
        Claim(
            "pressure tells more than joints",
            "the network has a smaller error on pressure than on strain images",
            ("sp_resnet_nogcam",),
            ("pressure", "strain"),
            pressure_beats_strain,
        ),
    ),
}


class Change(NamedTuple):
    """What leaving an effect out does to one model's error in one condition, geometric means over its seeds."""

    condition: str
    model: str
    before: float  # error with all effects
    after: float  # without this one; infinite if a run failed
    floor: float  # of the logarithm of their ratio, at least LEAST; NaN if a run with all effects failed
    steady: bool  # in the same direction in every seed

    @property
    def floors(self) -> float:
        """The change in units of the floor, positive where the error grows; NaN if a run failed."""
        return float(np.log(self.after / self.before)) / self.floor if np.isfinite(self.after) else np.nan

    @property
    def counts(self) -> bool:
        """Whether the change is more than chance: beyond the floor, and steady."""
        return abs(self.floors) > 1 and self.steady

    @property
    def relative(self) -> float:
        """The change as a share of the error with all effects."""
        return self.after / self.before - 1 if np.isfinite(self.after) else np.nan


class Judgement(NamedTuple):
    """What leaving out one effect does."""

    effect: str
    tau: dict[str, float]  # condition -> Kendall's tau between the models' mean errors with and without
    changes: list[Change]
    flipped: list[str]  # names of claims that turn over
    verdict: str

    def largest(self, condition: str | None = None) -> Change:
        """The largest change in floors, of one condition or of all: failed ones first, then those that count."""
        own = [one for one in self.changes if condition in (None, one.condition)]
        return max(own, key=lambda one: (np.isnan(one.floors), one.counts, abs(one.floors)))


class Assessment(NamedTuple):
    """One experiment's effects, and the yardstick they are judged by."""

    floor_tau: dict[str, float]  # condition -> tau that 95 % of pairs of groups of seeds reach, all effects on
    claims: dict[str, bool | None]  # name -> whether it holds with all effects on; None: seeds differ
    effects: list[Judgement]


def errors(scores: pd.DataFrame) -> pd.DataFrame:
    """`scores` (variants.COLUMNS) with a column `error`: the value, or 1 - accuracy; infinite for a failed run.

    At least LOWEST, so that it has a logarithm.
    """
    value = scores["value"].where(scores["metric"] != "accuracy", 1 - scores["value"])
    return scores.assign(error=value.where(np.isfinite(value), np.inf).clip(lower=LOWEST))


def assess(experiment: str, scores: pd.DataFrame) -> Assessment:
    """Judge every effect of one experiment from its physics.csv."""
    table = errors(scores)
    runs = {
        key: {(row.model, row.condition): row.error for row in own.itertuples()}
        for key, own in table.groupby(["effect", "seed"], sort=False)
    }
    whole = {seed: run for (effect, seed), run in runs.items() if effect == NONE}
    keys, conditions = list(next(iter(whole.values()))), list(dict.fromkeys(table["condition"]))
    size = min(table[table["effect"] != NONE].groupby("effect")["seed"].nunique())
    floors = _floors(list(whole.values()), size)
    floor_tau = {condition: _floor_tau(list(whole.values()), size, condition) for condition in conditions}
    testable = [
        claim
        for claim in CLAIMS[experiment]
        if all((model, condition) in floors for model in claim.models for condition in claim.conditions)
    ]
    claims = {}
    for claim in testable:
        said = {claim.holds(run) for run in whole.values()}
        claims[claim.name] = said.pop() if len(said) == 1 else None
    found = []
    for effect in dict.fromkeys(table["effect"]):
        if effect == NONE:
            continue
        own = {seed: run for (name, seed), run in runs.items() if name == effect}
        before = mean([whole[seed] for seed in own])
        after = mean(list(own.values()))
        changes = [
            Change(condition, model, before[key], after[key], floors[key], _steady(whole, own, key))
            for key in keys
            for model, condition in [key]
        ]
        taus = {condition: tau(before, after, condition) for condition in conditions}
        flipped = [
            claim.name
            for claim in testable
            if claims[claim.name] is not None and claim.holds(after) != claims[claim.name]
        ]
        found.append(Judgement(effect, taus, changes, flipped, _verdict(taus, floor_tau, changes, flipped)))
    return Assessment(floor_tau, claims, found)


def mean(runs: list[Errors]) -> dict[tuple[str, str], float]:
    """Geometric mean error of every model and condition over runs; infinite if one failed."""
    return {key: float(np.exp(np.mean(np.log([run[key] for run in runs])))) for key in runs[0]}


def tau(one: Errors, other: Errors, condition: str) -> float:
    """Kendall's tau-b between the errors of all models in one condition: 1 for the same order. One model: 1."""
    models = [model for model, name in one if name == condition]
    if len(models) < 2:
        return 1.0
    return float(kendalltau([one[m, condition] for m in models], [other[m, condition] for m in models]).statistic)


def _floors(runs: list[Errors], size: int) -> dict[tuple[str, str], float]:
    """The 95 % band of a difference between mean logarithms of `size` runs, by model and condition; NaN if one failed.

    From the spread over all runs of one seed each, or the median spread of all models and conditions where that is
    larger: among so many, some agree by luck when there are few seeds.
    """
    with np.errstate(invalid="ignore"):  # infinite - infinite, of failed runs
        spread = {key: float(np.std(np.log([run[key] for run in runs]), ddof=1)) for key in runs[0]}
    finite = [value for value in spread.values() if np.isfinite(value)]
    middle = float(np.median(finite)) if finite else np.nan
    band = stdtrit(len(runs) - 1, (1 + CONFIDENCE) / 2) * np.sqrt(2 / size)
    least_change = float(np.log1p(LEAST))
    return {
        key: max(float(band) * max(value, middle), least_change) if np.isfinite(value) else np.nan
        for key, value in spread.items()
    }


def _floor_tau(runs: list[Errors], size: int, condition: str) -> float:
    """The tau that 95 % of the pairs of groups of `size` seeds (half of all at most) with no common seed reach."""
    size = min(size, len(runs) // 2)
    found = [
        tau(mean(list(one)), mean(list(other)), condition)
        for one in combinations(runs, size)
        for other in combinations([run for run in runs if not any(run is own for own in one)], size)
    ]
    return float(np.quantile(found, 1 - CONFIDENCE, method="lower"))


def _steady(whole: Mapping[int, Errors], without: Mapping[int, Errors], key: tuple[str, str]) -> bool:
    """Whether an error changes in the same direction in every seed."""
    signs = {np.sign(run[key] - whole[seed][key]) for seed, run in without.items()}
    return len(signs) == 1 and 0 not in signs


def _verdict(taus: Mapping, floor_tau: Mapping, changes: list[Change], flipped: list[str]) -> str:
    if any(np.isnan(change.floors) for change in changes):
        return FAILED
    reordered = any(taus[condition] < floor_tau[condition] - 1e-9 for condition in taus)
    return NEEDED if reordered or flipped or any(change.counts for change in changes) else NOT_NEEDED


def report_rows(experiment: str, assessment: Assessment) -> list[dict]:
    """Rows of reports/physics.csv: one an effect and condition."""
    rows = []
    for one in assessment.effects:
        for condition, value in one.tau.items():
            most = one.largest(condition)
            rows.append(
                {
                    "experiment": experiment,
                    "effect": one.effect,
                    "condition": condition,
                    "tau": value,
                    "floor_tau": assessment.floor_tau[condition],
                    "model": most.model,
                    "change_floors": most.floors,
                    "change_relative": most.relative,
                    "claims_flipped": "; ".join(one.flipped),
                    "verdict": one.verdict,
                }
            )
    return rows
