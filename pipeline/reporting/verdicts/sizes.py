"""What size of a ladder is enough."""

import itertools
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
import pandas as pd

from pipeline.base.errors import InputError
from pipeline.reporting.labels import model_name
from pipeline.scoring import ladders
from pipeline.scoring.results import estimate, read_csv, shown

JUDGED = ("experiment", "condition", "family", "size", "params", "metric", "unit", "value", "low", "high", "chosen")
JUDGED += ("runs", "failed", "macs")  # runs: those that did not fail
HIGHER = ("accuracy", "macro_precision", "r2")  # metrics of which more is better
NAMES = {"rmse": "RMSE", "error": "mean", "macro_precision": "1 - macro precision"}


class Scale(NamedTuple):
    """What a family's sizes are, and the paper's own size."""

    size_name: str
    published: float


SCALES = {
    "lomp": Scale("hidden units", 128),
    "window": Scale("frames of a window", 8),
    "lstm": Scale("units", 50),
    "sp_resnet": Scale("share of the published channels", 1),
}


def label(family: str) -> str:
    """The name of a family's model."""
    return model_name(ladders.FAMILIES[family].model)


def wanted(experiment: str, values: Mapping) -> dict[str, tuple[list, list]]:
    """Family -> sizes and seeds that params.yaml asks for; values: all of it."""
    if experiment == "strain":
        study = values["strain"]["study"]
        return {"lstm": (study["capacity"]["units"], study["seeds"])}
    return {family: (block["sizes"], block["seeds"]) for family, block in values["rightsize"][experiment].items()}


def read(experiment: str, values: Mapping) -> pd.DataFrame:
    """The runs that the stage `rightsize` wrote. Raises InputError for a missing file, column or run."""
    made_by = f"python -m pipeline.studies.sizes {experiment}"
    table = read_csv(ladders.path(experiment), ladders.COLUMNS, made_by)
    conditions = dict.fromkeys(table["condition"]) or ("any",)  # of an empty table every run is missing
    known = set(zip(table["family"], table["condition"], table["size"], table["seed"], strict=True))
    for family, (sizes, seeds) in wanted(experiment, values).items():
        for run in itertools.product([family], conditions, sizes, seeds):
            if run not in known:
                raise InputError(
                    f"{shown(ladders.path(experiment))}: no row for family {run[0]}, condition {run[1]}, "
                    f"size {run[2]:g}, seed {run[3]}; run `{made_by}` again"
                )
    return table


def error_of(values, metric: str):
    """A metric as people read it here, so that less is better: 1 - a fraction of which more is better, in %."""
    return 100 * (1 - values) if metric in HIGHER else values


def unit_of(metric: str, unit: str) -> str:
    """The unit of `error_of`."""
    return "%" if metric in HIGHER else unit


def smallest(errors: Mapping[float, Sequence[float]]) -> float | None:
    """The smallest size whose mean error is at most the best mean plus the standard error of that mean.

    errors: size -> an error a run, NaN for a failed one. A size with a failed run is neither the best nor enough.
    One run has no standard error: then the best alone is enough. None where every size has a failed run.
    """
    kept = {size: np.asarray(values, float) for size, values in errors.items() if np.isfinite(values).all()}
    if not kept:
        return None
    mean = {size: values.mean() for size, values in kept.items()}
    best = min(mean, key=mean.get)
    runs = kept[best]
    limit = mean[best] + (runs.std(ddof=1) / np.sqrt(len(runs)) if len(runs) > 1 else 0.0)
    return min(size for size in mean if mean[size] <= limit)


def judge(runs: pd.DataFrame) -> pd.DataFrame:
    """One row a size: mean, 95 % t interval, and `chosen`, which is 1 for the smallest that is enough.

    runs: a row a run, of ladders.COLUMNS.
    """
    rows = []
    for (experiment, condition, family, metric), own in runs.groupby(
        ["experiment", "condition", "family", "metric"], sort=False
    ):
        sizes = {size: part for size, part in own.groupby("size")}
        sign = -1 if metric in HIGHER else 1
        small = smallest({size: sign * part["value"].to_numpy() for size, part in sizes.items()})
        for size, part in sizes.items():
            first, found = part.iloc[0], estimate(part["value"])
            counts = (found.runs, found.failed, first["macs"])
            row = (experiment, condition, family, size, first["params"], metric, first["unit"], *found[:3])
            rows.append((*row, int(size == small), *counts))
    return pd.DataFrame(rows, columns=JUDGED)
