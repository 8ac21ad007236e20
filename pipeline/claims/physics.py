"""Judge what each effect of a simulated scene does to the models' errors: two one-sided tests on paired seeds.

A seed draws specimen, motion, noise, split and start of training; every variant of a seed shares all of these, so the
ratio of a model's errors with and without an effect is taken seed by seed. An effect is `equivalent` to its absence if
the 90 % t interval of the mean logarithm of this ratio lies inside the logarithms of 1 - MARGIN and 1 + MARGIN for
every model and condition (two one-sided tests at 5 %; Schuirmann 1987) and the order of the models stays as it is. An
effect `changes errors` if one such interval lies outside the margin altogether. Anything else is `inconclusive`.

pipeline/claims/rules.py asks another question: whether a difference is above 0 in the seeds that were drawn.
"""

import itertools
from collections.abc import Iterable, Mapping
from typing import NamedTuple

import numpy as np
import pandas as pd
from scipy.special import stdtrit

from pipeline.claims.equivalence import lies_within
from pipeline.results import studies
from pipeline.results.studies import NONE, PHYSICS
from tactile.base.paths import Workspace
from tactile.experiments import facts

MARGIN = 0.05  # share of a model's error
SIDE = 0.95  # confidence of each of the two one-sided tests
LOWEST = 1e-3  # smaller errors are taken for this one: less than one image of a small test part, 1 um, 1 Pa
EQUIVALENT, CHANGES, UNKNOWN, FAILED = "equivalent", "changes errors", "inconclusive", "failed"


REPORTED = ["experiment", "effect", "condition", "model", "before", "relative", "low", "high", "equivalent", "swapped"]
REPORTED += ["verdict", "consequence"]  # columns of reports/physics.csv


class Change(NamedTuple):
    """The change of one model's error in one condition where an effect is left out; NaN if a run failed."""

    condition: str
    model: str
    before: float  # geometric mean over seeds of the error with all effects
    relative: float  # mean change without this one, as a share of `before`
    low: float  # 90 % interval of `relative`
    high: float

    @property
    def within(self) -> bool | None:
        """Tell whether the whole interval lies inside the margin, or (False) outside of it, on one side."""
        return lies_within(self.low, self.high, -MARGIN, MARGIN)


class Judgement(NamedTuple):
    """The verdict on one effect, and the changes where it is left out."""

    effect: str
    changes: list[Change]
    swapped: list[str]  # pairs of models that change places, with the condition
    verdict: str


def read(workspace: Workspace, experiment: str, effects: Iterable[str], models: Iterable[str]) -> pd.DataFrame:
    """Read physics.csv of an experiment; effects, models: of the settings. Without a row where none was computed.

    Raises InputError for a run of a computed seed that is missing or there twice.
    """
    scores = studies.read(workspace, experiment, "physics", PHYSICS)
    runs = itertools.product(effects, *(dict.fromkeys(scores[name]) for name in ("seed", "condition")), models)
    where = workspace.root / "evidence" / "studies" / experiment
    studies.check(scores, where, ["effect", "seed", "condition", "model"], runs, studies.MADE_BY)
    return scores


def errors(scores: pd.DataFrame) -> pd.DataFrame:
    """Return `scores` (variants.PHYSICS) with a column `error`: the value, or 1 - accuracy; infinite for a failed run.

    At least LOWEST, so that it has a logarithm.
    """
    value = scores["value"].where(scores["metric"] != "accuracy", 1 - scores["value"])
    return scores.assign(error=value.where(np.isfinite(value), np.inf).clip(lower=LOWEST))


def assess(scores: pd.DataFrame) -> list[Judgement]:
    """Judge every effect of one experiment from its physics.csv."""
    logs: dict[str, pd.DataFrame] = {}  # effect -> logarithms of errors, one row per seed, one column per model
    for effect, rows in errors(scores).groupby("effect", sort=False):
        by_seed = rows.pivot(index="seed", columns=["condition", "model"], values="error")
        by_seed = by_seed[list(dict.fromkeys(zip(rows["condition"], rows["model"], strict=True)))]  # as in the file
        logs[effect] = np.log(by_seed.replace(np.inf, np.nan))
    whole = logs.pop(NONE)
    return [_judged(effect, whole, without) for effect, without in logs.items()]


def _judged(effect: str, whole: pd.DataFrame, without: pd.DataFrame) -> Judgement:
    """Judge one effect; whole, without: logarithms of errors with all effects and without this one."""
    changes = [_change(key, whole[key].to_numpy(), without[key].to_numpy()) for key in whole]
    swapped = _swapped(whole.mean(skipna=False), without.mean(skipna=False))
    if any(np.isnan(change.relative) for change in changes):
        verdict = FAILED
    elif any(change.within is False for change in changes):
        verdict = CHANGES
    else:
        verdict = EQUIVALENT if not swapped and all(change.within for change in changes) else UNKNOWN
    return Judgement(effect, changes, swapped, verdict)


def _change(key: tuple[str, str], whole: np.ndarray, without: np.ndarray) -> Change:
    """Return the change of one model's error; key: condition and model; whole, without: one logarithm per seed."""
    ratio = without - whole
    few = len(ratio) < 2  # one seed has no interval
    half = np.nan if few else stdtrit(len(ratio) - 1, SIDE) * ratio.std(ddof=1) / np.sqrt(len(ratio))
    low, middle, high = np.expm1(ratio.mean() + np.array([-half, 0.0, half]))
    return Change(*key, float(np.exp(whole.mean())), float(middle), float(low), float(high))


def _swapped(whole: pd.Series, without: pd.Series) -> list[str]:
    """Return the pairs of models whose order in one condition is another without the effect."""
    pairs = []
    for condition in whole.index.unique("condition"):
        before, after = whole[condition], without[condition]
        for a, b in itertools.combinations(before.index, 2):
            if (before[a] - before[b]) * (after[a] - after[b]) < 0:
                pairs.append(f"{a} and {b} ({condition})")
    return pairs


def consequence(experiment: str, judged: Judgement, on: bool) -> str:
    """Return what follows for the default scene; on: whether the effect is on in params.yaml."""
    if not on:
        return "left out: equivalent" if judged.verdict == EQUIVALENT else "switch it on: not shown to be equivalent"
    if shows := facts(experiment).shown.get(judged.effect):
        return f"kept: recorded ({shows.replace('_', ' ')})"
    if purpose := facts(experiment).purpose.get(judged.effect):
        return f"kept: {purpose}"
    return {
        EQUIVALENT: "may be left out: equivalent",
        CHANGES: "kept: changes errors",
        UNKNOWN: "kept: inconclusive",
        FAILED: "kept: a run failed",
    }[judged.verdict]


def report_rows(experiment: str, judgements: list[Judgement], switches: Mapping[str, bool]) -> list[dict]:
    """Return the rows of reports/physics.csv, one per effect, condition and model; switches: effect -> whether on."""
    return [
        {"experiment": experiment, "effect": judged.effect}
        | change._asdict()
        | {
            "equivalent": bool(change.within),
            "swapped": "; ".join(judged.swapped),
            "verdict": judged.verdict,
            "consequence": consequence(experiment, judged, switches[judged.effect]),
        }
        for judged in judgements
        for change in judged.changes
    ]
