"""Judge at which severity of a perturbation each trained model fails, and rank the models.

A model fails at the first severity at which its error, the mean over the seeds, is above what a user could work with
(`stress.<experiment>.usable` of params.yaml), or above that of the model `constant` under the same perturbation. So a
model is never compared with itself: one that is bad on clean data has no advantage. Severities are walked from the
smallest change, whatever its sign, to the largest.

Models are ranked by their relative error: the error over that of `constant`, mean over the perturbed severities, then
over perturbations. 1 is no better than a constant map, place or name.
"""

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd

from pipeline.base.errors import InputError
from pipeline.experiments import facts
from pipeline.scoring import results, studies
from pipeline.scoring.results import Estimate

FLOOR = "constant"
HOLDS, WORSE, UNUSABLE, FAILED = "holds", "worse than constant", "not usable", "failed in training"
TESTED_ON = ["protocol", "condition", "perturbation"]
KEY = [*TESTED_ON, "severity", "model", "seed"]
LAST = ["last_severity", "last_error"]  # of the walk
FAILURES = [
    "experiment",
    *TESTED_ON,
    "model",
    "fails_at",
    "step",
    "clean",
    "error",
    "verdict",
    *LAST,
    "relative",
    "worse",
]


class Verdict(NamedTuple):
    """Where one model fails: severity and its number in the walk, NaN if nowhere; clean, error: before, and there."""

    severity: float
    step: float
    clean: float
    error: float
    reason: str


def runs(stress: pd.DataFrame, experiment: str) -> pd.DataFrame:
    """Return an experiment's rows of reports/stress.csv as protocol, condition, ..., seed, error; one row per run."""
    metric = facts(experiment).metric
    own = stress[(stress["experiment"] == experiment) & (stress["metric"] == metric)]
    error = 1 - own["value"] if metric == "accuracy" else own["value"]
    return own[KEY].assign(error=error).reset_index(drop=True)


def check(table: pd.DataFrame, path: Path, experiment: str, models: Iterable[str], seeds: Mapping[str, Sequence[int]]):
    """Raise InputError for a missing or repeated run: every model and seed has one at each severity.

    table: see `runs`, of the file `path`; seeds: protocol -> those of params.yaml.
    """
    made_by = f"python -m pipeline.stages.stress {experiment}"
    levels = table[[*TESTED_ON, "severity"]].drop_duplicates()
    if absent := [protocol for protocol in seeds if protocol not in set(levels["protocol"])]:
        raise InputError(f"{path}: no row for protocol {absent[0]} of {experiment}; run `{made_by}` again")
    wanted = (
        (*level, model, seed)
        for level in levels.itertuples(index=False, name=None)
        for model in models
        for seed in seeds.get(level[0], ())
    )
    studies.check(table, path, KEY, wanted, made_by)


def level(errors: Sequence[float]) -> Estimate:
    """Return the mean of the seeds' errors at one severity, with the lowest and highest in place of an interval.

    A run failed where its error is not finite.
    """
    good = np.asarray(errors, dtype=float)
    good = good[np.isfinite(good)]
    ends = (float(good.min()), float(good.max())) if len(good) else (np.nan, np.nan)
    return results.estimate(errors)._replace(low=ends[0], high=ends[1])


def walked(severities: Sequence[float]) -> list[float]:
    """Order severities as a model is led to its failure: from 0 outwards, or as listed where there is no 0."""
    listed = list(dict.fromkeys(severities))
    return sorted(listed, key=lambda value: (abs(value), value)) if 0 in listed else listed


def curves(table: pd.DataFrame) -> dict[tuple, dict[str, dict[float, Estimate]]]:
    """Return (protocol, condition, perturbation) -> model -> severity -> `level`, severities as walked."""
    found = {}
    for tested_on, runs in table.groupby(TESTED_ON, sort=False):
        order = walked(runs["severity"])
        levels = {key: level(errors) for key, errors in runs.groupby(["model", "severity"])["error"]}
        models = runs["model"].unique()
        found[tested_on] = {model: {severity: levels[model, severity] for severity in order} for model in models}
    return found


def verdict(errors: Mapping[float, Estimate], floor: Mapping[float, Estimate] | None, usable: float) -> Verdict:
    """Judge where a model with `errors` by severity fails; floor: those of `constant`, if it is among the models."""
    clean = next(iter(errors.values())).mean
    if not all(np.isfinite(seeds.mean) and not seeds.failed for seeds in errors.values()):
        return Verdict(np.nan, np.nan, clean, np.nan, FAILED)
    for step, (severity, seeds) in enumerate(errors.items()):
        if floor and seeds.mean > floor[severity].mean:
            return Verdict(severity, step, clean, seeds.mean, WORSE)
        if seeds.mean > usable:
            return Verdict(severity, step, clean, seeds.mean, UNUSABLE)
    return Verdict(np.nan, np.nan, clean, seeds.mean, HOLDS)


def relative(errors: Mapping[float, Estimate], floor: Mapping[float, Estimate] | None) -> float:
    """Return the error over that of `constant`, mean over the perturbed severities; NaN where one is not known."""
    if not floor:
        return np.nan
    perturbed = [severity for severity in errors if severity != 0]
    return float(np.mean([errors[severity].mean / floor[severity].mean for severity in perturbed]))


def failures(table: pd.DataFrame, experiment: str, usable: Mapping[str, float]) -> pd.DataFrame:
    """Judge every condition, perturbation and model but `constant`: one row of FAILURES each.

    usable: protocol -> the largest error that is.
    """
    rows = []
    for tested_on, models in curves(table).items():
        floor = models.get(FLOOR)
        for model, errors in models.items():
            if model != FLOOR:
                last, judged = list(errors)[-1], verdict(errors, floor, usable[tested_on[0]])
                worse = bool(floor) and any(errors[at].mean > floor[at].mean for at in errors)  # at any severity
                ends = last, errors[last].mean, relative(errors, floor), worse
                rows.append((experiment, *tested_on, model, *judged, *ends))
    return pd.DataFrame(rows, columns=FAILURES)


def ranking(judged: pd.DataFrame) -> pd.Series:
    """Return model -> relative error, mean over perturbations, the lowest first; judged: FAILURES of one condition."""
    sound = judged.groupby("model")["relative"].filter(lambda values: values.notna().all()).index
    return judged.loc[sound].groupby("model", sort=False)["relative"].mean().sort_values(kind="stable")
