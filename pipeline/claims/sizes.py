"""Judge which size of a ladder is enough: the smallest that is certainly within MARGIN of the best.

The excess of a size is its error over that of the best size, less 1, paired by seed. A size is enough where the whole
95 % t interval of its excess is below MARGIN, too small where all of it is above, and inconclusive otherwise.
"""

import itertools
from collections.abc import Mapping, Sequence
from typing import NamedTuple, TypeVar

import numpy as np
import pandas as pd

from pipeline.claims.equivalence import lies_within
from pipeline.results import shards, studies
from pipeline.results.one_table import Results
from tactile.base.paths import Workspace
from tactile.scoring.estimates import Estimate, estimate, scale_of

LADDER = ["experiment", "condition", "family"]
JUDGED = [*LADDER, "size", "params", "metric", "unit", "value", "low", "high", "chosen", "runs", "failed", "macs"]
JUDGED += ["excess", "excess_low", "excess_high", "verdict"]
MARGIN = 0.05  # of the best error: less makes no difference in use
BEST, ENOUGH, TOO_SMALL, UNCLEAR, FAILED = "best", "enough", "too small", "inconclusive", "failed"
HIGHER = ("accuracy", "macro_precision", "r2")  # metrics of which more is better
NAMES = {"rmse": "RMSE", "error": "mean error", "macro_precision": "100 - macro precision"}


Values = TypeVar("Values", float, np.ndarray)


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


def read(workspace: Workspace, results: Results, experiment: str) -> pd.DataFrame:
    """Return the runs of an experiment's ladders, of the evidence (`results`). No row: none was computed.

    Raises InputError for a run of a computed seed that evidence/shards.yaml has and that is missing or there twice.
    """
    table = studies.ladders(results.table, experiment)
    sets = [each for each in shards.read_sets(workspace).values() if each.experiment == experiment]
    variants = [name for each in sets for name in each.variants]
    families = {name: one for name, one in studies.FAMILIES.items() if one.experiment == experiment}
    computed = [dict.fromkeys(table[name]) for name in ("condition", "seed")]
    runs = (
        (family, condition, size, seed)
        for family, one in families.items()
        for condition, seed, size in itertools.product(*computed, studies.sizes(variants, one.name))
    )
    where = shards.folder(workspace) / "results"
    studies.check(table, where, ["family", "condition", "size", "seed"], runs, studies.MADE_BY)
    return table


def error_of(values: Values, metric: str) -> Values:
    """Return a metric so that less is better: a fraction of which more is better becomes 1 - the fraction, in %."""
    return 100 * (1 - values) if metric in HIGHER else values


def unit_of(metric: str, unit: str) -> str:
    """Return the unit of `error_of`."""
    return "%" if metric in HIGHER else unit


def excesses(errors: Mapping[float, Sequence[float]]) -> dict[float, Estimate]:
    """Return size -> error over the best size's, less 1: mean over the runs, paired, with its interval.

    errors: size -> one error per run, all in the same order of runs, NaN for a failed run. A size with a failed run is
    left out; the best has the smallest mean, and an excess of 0 without an interval.
    """
    sound = {size: np.asarray(values, float) for size, values in errors.items() if np.isfinite(values).all()}
    if not sound:
        return {}
    best = min(sound, key=lambda size: sound[size].mean())
    return {size: estimate(values / sound[best] - 1) for size, values in sound.items()}


def verdict(excess: Estimate | None) -> str:
    """Return what the excess of a size says of it; None: a run of it failed."""
    if excess is None:
        return FAILED
    if excess.mean == 0:
        return BEST
    found = lies_within(excess.low, excess.high, -np.inf, MARGIN)
    return {True: ENOUGH, False: TOO_SMALL, None: UNCLEAR}[found]


def judge(runs: pd.DataFrame) -> pd.DataFrame:
    """Return JUDGED, one row per size: mean and 95 % interval, and `chosen`, 1 for the smallest that is enough.

    runs: studies.LADDER, one row per run. The column `runs` of the result counts those that did not fail. The best
    size is enough, too.
    """
    rows = []
    for (*ladder, metric), own in runs.sort_values("seed").groupby([*LADDER, "metric"], sort=False):
        sizes = dict(list(own.groupby("size")))
        excess = excesses({size: error_of(one["value"].to_numpy(), metric) for size, one in sizes.items()})
        verdicts = {size: verdict(excess.get(size)) for size in sizes}
        enough = min((size for size, word in verdicts.items() if word in (BEST, ENOUGH)), default=None)
        for size, one in sizes.items():
            first, mean = one.iloc[0], estimate(one["value"], scale_of(metric))
            over = excess[size][:3] if size in excess else (np.nan,) * 3
            rows.append((*ladder, size, first["params"], metric, first["unit"], *mean[:3], int(size == enough)))
            rows[-1] += (mean.runs, mean.failed, first["macs"], *over, verdicts[size])
    return pd.DataFrame(rows, columns=JUDGED)


class Reference(NamedTuple):
    """Errors to compare a ladder with, over its seeds: the constant model's and the fully trained model's; or NaN."""

    constant: float
    trained: float


def references(table: Results, runs: pd.DataFrame) -> dict[tuple[str, str], Reference]:
    """Return (family, condition) -> its references over the seeds of the ladder, which are the same specimens.

    table: the one table of results; runs: studies.LADDER. A ladder of fully trained models needs the constant model
    alone.
    """
    by_ladder = {}
    for (*ladder, metric), own in runs.groupby([*LADDER, "metric"], sort=False):
        experiment, condition, family = ladder
        tested_on = experiment, studies.protocol(experiment, condition), condition
        compared = ("constant", studies.FAMILIES[family].model if family in SHORTER else "")
        values = (table.runs(*tested_on, model, metric) for model in compared)
        means = (estimate(one[one.index.isin(own["seed"])], scale_of(metric)).mean for one in values)
        by_ladder[family, condition] = Reference(*(error_of(mean, metric) for mean in means))
    return by_ladder
