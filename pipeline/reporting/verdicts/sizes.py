"""Judge which size of a ladder is enough: the smallest within one standard error of the best.

The rule is of its own, as in the choice of a model by cross-validation: it asks for no evidence that two sizes differ
(the 95 % intervals of verdicts/rules.py), and takes the smaller one until there is some.
"""

import itertools
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
import pandas as pd

from pipeline.reporting.words.labels import model_name
from pipeline.scoring import complete, ladders
from pipeline.scoring.results import Scores, estimate, read_csv

LADDER = ["experiment", "condition", "family"]
JUDGED = [*LADDER, "size", "params", "metric", "unit", "value", "low", "high", "chosen", "runs", "failed", "macs"]
HIGHER = ("accuracy", "macro_precision", "r2")  # metrics of which more is better
NAMES = {"rmse": "RMSE", "error": "mean", "macro_precision": "1 - macro precision"}


class Scale(NamedTuple):
    """The name of a family's sizes, and the paper's own size."""

    size_name: str
    published: float


SHORTER = ("window", "lstm")  # families whose ladders are trained for a shorter time than the model of the tables
SCALES = {
    "lomp": Scale("hidden units", 128),
    "window": Scale("frames of a window", 8),
    "lstm": Scale("units", 50),
    "sp_resnet": Scale("share of the published channels", 1),
}


def label(family: str) -> str:
    """Return the name of a family's model."""
    return model_name(ladders.FAMILIES[family].model)


def wanted(experiment: str, values: Mapping) -> dict[str, tuple[list, list]]:
    """Return family -> (sizes, seeds) that params.yaml (`values`) asks for."""
    if experiment == "strain":
        study = values["strain"]["study"]
        return {"lstm": (study["capacity"]["units"], study["seeds"])}
    return {family: (block["sizes"], block["seeds"]) for family, block in values["rightsize"][experiment].items()}


def read(experiment: str, values: Mapping) -> pd.DataFrame:
    """Read the runs of an experiment's ladders. Raises InputError for a missing file, column or run, or one twice."""
    made_by = f"python -m pipeline.studies.sizes {experiment}"
    path = ladders.path(experiment)
    table = read_csv(path, ladders.COLUMNS, made_by)
    conditions = dict.fromkeys(table["condition"]) or ("any",)  # of an empty table every run is missing
    runs = (
        (family, condition, size, seed)
        for family, (sizes, seeds) in wanted(experiment, values).items()
        for condition, size, seed in itertools.product(conditions, sizes, seeds)
    )
    complete.check(table, path, ["family", "condition", "size", "seed"], runs, made_by)
    return table


def error_of(values, metric: str):
    """Return a metric so that less is better: a fraction of which more is better becomes 1 - the fraction, in %."""
    return 100 * (1 - values) if metric in HIGHER else values


def unit_of(metric: str, unit: str) -> str:
    """Return the unit of `error_of`."""
    return "%" if metric in HIGHER else unit


def smallest(errors: Mapping[float, Sequence[float]]) -> float | None:
    """Return the smallest size whose mean error is at most the best mean plus the standard error of that mean.

    errors: size -> one error per run, NaN for a failed run. A size with a failed run is neither the best nor enough.
    One run has no standard error: then the best alone is enough. None where every size has a failed run.
    """
    sound = {size: np.asarray(values, float) for size, values in errors.items() if np.isfinite(values).all()}
    if not sound:
        return None
    means = {size: values.mean() for size, values in sound.items()}
    best = min(means, key=means.get)
    runs = sound[best]
    limit = means[best] + (runs.std(ddof=1) / np.sqrt(len(runs)) if len(runs) > 1 else 0.0)
    return min(size for size in means if means[size] <= limit)


def judge(runs: pd.DataFrame) -> pd.DataFrame:
    """Return JUDGED, one row per size: mean, 95 % t interval, and `chosen`, 1 for the smallest that is enough.

    runs: ladders.COLUMNS, one row per run. The column `runs` of the result counts those that did not fail.
    """
    rows = []
    for (*ladder, metric), own in runs.groupby([*LADDER, "metric"], sort=False):
        sizes = dict(list(own.groupby("size")))
        sign = -1 if metric in HIGHER else 1
        enough = smallest({size: sign * part["value"].to_numpy() for size, part in sizes.items()})
        for size, part in sizes.items():
            first, mean = part.iloc[0], estimate(part["value"])
            rows.append((*ladder, size, first["params"], metric, first["unit"], *mean[:3], int(size == enough)))
            rows[-1] += (mean.runs, mean.failed, first["macs"])
    return pd.DataFrame(rows, columns=JUDGED)


class Reference(NamedTuple):
    """Errors to compare a ladder with, NaN if unknown: the constant model's and the fully trained model's."""

    constant: float
    trained: float


def references(experiment: str, values: Mapping, judged: pd.DataFrame) -> dict[tuple[str, str], Reference]:
    """Return the references of each (family, condition); a ladder of fully trained models needs the constant alone."""
    models, by_ladder = values[experiment]["models"], {}
    scores = Scores(experiment, values[experiment])
    for (family, condition, metric), _ in judged.groupby(["family", "condition", "metric"], sort=False):
        run = ladders.protocol(experiment, condition), condition
        compared = ("constant", ladders.FAMILIES[family].model if family in SHORTER else "")
        means = [scores.estimate(*run, model, metric).mean if model in models else np.nan for model in compared]
        by_ladder[family, condition] = Reference(*(error_of(mean, metric) for mean in means))
    return by_ladder
