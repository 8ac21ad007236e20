"""Read scores, fits, times and predictions for the reports. A missing file or row is an error, no gap.

But where this machine has no recordings, the recorded side of the twins is kept: its stage takes the rows from the
file that it replaces, an output that has `persist` in dvc.yaml, so that DVC leaves the file until then.
"""

import io
from collections.abc import Callable, Collection, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.compute as pc
from scipy import stats

from tactile.base import foreign, params, paths
from tactile.base.errors import InputError
from tactile.base.paths import Workspace
from tactile.datasets import fits, schemas

CONFIDENCE = 0.95
FEWEST = 3  # runs of an interval: that of two is 13 standard deviations wide to either side
ROUNDING = 1e-9  # of sums of shares
SAME = 1e-12  # relative: runs closer to one another have one value
PLAIN, SHARE, R2, LOG = "", "share", "r2", "log"  # scales of values
LEAST_MISSING = 1e-6  # to an R2 of 1, whose logarithm has no end
SHARES = ("accuracy", "macro_precision", "touches_found")  # metrics from 0 to 1
ERRORS = ("rmse", "error")  # how the names of metrics end that are above 0
# Scale -> the function that its values are near a normal distribution by, and its inverse.
SCALES: dict[str, tuple[Callable, Callable]] = {
    PLAIN: (np.asarray, np.asarray),
    SHARE: (
        lambda share: np.arcsin(np.sqrt(np.clip(share, 0, 1))),
        lambda angle: np.square(np.sin(np.clip(angle, 0, np.pi / 2))),
    ),
    LOG: (np.log, np.exp),  # of errors and their ratios, which are above 0
    R2: (lambda r2: np.log(np.maximum(1 - r2, LEAST_MISSING)), lambda missing: 1 - np.exp(missing)),
}
MISSING = ("", "nan")  # how the stages write a value that there is not


class Estimate(NamedTuple):
    """Mean over the runs that did not fail, with its 95 % interval, see `estimate`; NaN where there is none."""

    mean: float
    low: float
    high: float
    runs: int
    failed: int

    def percent(self) -> "Estimate":
        """Return the fraction in percent."""
        return self._replace(mean=100 * self.mean, low=100 * self.low, high=100 * self.high)


def estimate(values: Sequence[float], scale: str = PLAIN) -> Estimate:
    """Return mean and 95 % interval of one value per run; a run has failed where its value is not finite.

    scale: PLAIN, of the values; LOG (above 0), of their logarithms; R2 (up to 1), of the logarithms of what is missing
    to 1: the mean of these and its t interval, both turned back, so that of errors and ratios it is the geometric mean.
    SHARE (0 to 1): the mean of the values and the interval of `share_interval`.

    Fewer than FEWEST runs have no interval. Runs that all have one value tell nothing of their spread: they have none
    either, but for shares at a bound, as of as many trials as there are runs.
    """
    numbers = np.asarray(values, dtype=float)
    good = numbers[np.isfinite(numbers)]
    n, failed = len(good), len(numbers) - len(good)
    if n == 0:
        return Estimate(np.nan, np.nan, np.nan, 0, failed)
    scale = PLAIN if scale == LOG and good.min() <= 0 else scale
    mean, low, high = map(float, intervals(good, scale))
    one_value = np.ptp(good) <= SAME * np.abs(good).max()
    if n < FEWEST or one_value:
        at_bound = n >= FEWEST and scale == SHARE and mean in (0, 1)
        low, high = map(float, clopper_pearson(mean, n)) if at_bound else (np.nan, np.nan)
    return Estimate(mean, low, high, n, failed)


def intervals(values: np.ndarray, scale: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return mean, low and high, each (...), of runs (n, ...); `estimate` says where there is no interval."""
    if scale == SHARE:
        mean = values.mean(axis=0)
        return mean, *clopper_pearson(mean, effective_trials(values))
    there, back = SCALES[scale]
    seen = there(values)
    mean, half = seen.mean(axis=0), student(len(values)) * error_of_mean(seen)
    ends = back(mean - half), back(mean + half)
    return back(mean), np.minimum(*ends), np.maximum(*ends)


def prediction(values: Sequence[float], scale: str = PLAIN) -> tuple[float, float]:
    """Return the 95 % interval of one further run, such as the one specimen of a paper; NaN where `estimate` has none.

    The t interval of a new value on the scale, turned back (Hahn and Meeker 1991, Statistical intervals), of shares on
    that of their arcsines.
    """
    numbers = np.asarray(values, dtype=float)
    good = numbers[np.isfinite(numbers)]
    if len(good) < FEWEST or np.ptp(good) <= SAME * np.abs(good).max():
        return np.nan, np.nan
    there, back = SCALES[PLAIN if scale == LOG and good.min() <= 0 else scale]
    seen = there(good)
    half = student(len(good)) * seen.std(ddof=1) * np.sqrt(1 + 1 / len(good))
    low, high = sorted(float(back(seen.mean() + side * half)) for side in (-1, 1))
    return low, high


def student(runs: int) -> float:
    """Return how many standard errors a 95 % t interval reaches to either side; NaN for one run."""
    return float(stats.t.ppf((1 + CONFIDENCE) / 2, runs - 1))


def error_of_mean(values: np.ndarray) -> np.ndarray:
    """Return the standard error (...) of the mean of runs (n, ...); NaN for one run."""
    return values.std(axis=0, ddof=1) / np.sqrt(len(values)) if len(values) > 1 else np.full(values.shape[1:], np.nan)


def effective_trials(shares: np.ndarray) -> np.ndarray:
    """Return how many trials tell a share as well as the mean of runs (n, ...) does, (...); 0 where these are alike.

    As many as have the variance of that mean, fewer for the few runs that tell it (Korn and Graubard 1998, Confidence
    intervals for proportions with small expected number of positive counts). Trials in one run need not be independent.
    """
    mean, half = shares.mean(axis=0), student(len(shares)) * error_of_mean(shares)
    trials = np.zeros_like(mean)
    normal = stats.norm.ppf((1 + CONFIDENCE) / 2)
    return np.divide(normal**2 * mean * (1 - mean), np.square(half), out=trials, where=half > 0)


def clopper_pearson(share: np.ndarray | float, trials: np.ndarray | float) -> tuple[np.ndarray, np.ndarray]:
    """Return the exact 95 % interval of shares (...) of so many trials (Clopper and Pearson 1934), whole or not."""
    tail, hits = (1 - CONFIDENCE) / 2, np.multiply(share, trials)
    misses = np.maximum(trials - hits, 0)
    low = np.where(hits > 0, stats.beta.ppf(tail, hits, misses + 1), 0)
    return low, np.where(misses > ROUNDING, stats.beta.ppf(1 - tail, hits + 1, misses), 1)


def scale_of(metric: str) -> str:
    """Return the scale of a metric's values, for `estimate`."""
    return SHARE if metric in SHARES else LOG if metric.endswith(ERRORS) else R2 if "r2" in metric else PLAIN


def read_csv(path: Path, columns: Sequence[str], made_by: str) -> pd.DataFrame:
    """Read a CSV table that has at least `columns`. Raises InputError otherwise."""
    with foreign.reading(paths.require(path, made_by), "a CSV table", f"run `{made_by}` again"):
        content = path.read_bytes()
    table = parse_csv(content, path, f"run `{made_by}` again")
    for column in columns:
        if column not in table.columns:
            raise InputError(f"{path}: column '{column}' is missing; run `{made_by}` again")
    return table


def read_scores(path: Path, made_by: str) -> pd.DataFrame:
    """Read scores.csv. A run without an RMSE failed, whatever its other metrics say: a map of NaN has no peak."""
    run = ["experiment", "protocol", "condition", "model", "seed"]
    table = read_csv(path, [*run, "metric", "unit", "value", "n"], made_by)
    failed = table[(table["metric"] == "rmse") & table["value"].isna()][run]
    lost = pd.MultiIndex.from_frame(table[run]).isin(pd.MultiIndex.from_frame(failed))
    return table.assign(value=table["value"].where(~lost))


def parse_csv(content: bytes, where: Path | str, remedy: str) -> pd.DataFrame:
    """Return a CSV table as the stages write it. where, remedy: of the sentence, where it is none (InputError)."""
    with foreign.reading(where, "a CSV table", remedy):
        # A condition is named by its folder, and a folder may be called NA or 001: it is never missing, nor a number.
        missing = {name: MISSING for name in pd.read_csv(io.BytesIO(content), nrows=0) if name != "condition"}
        return pd.read_csv(io.BytesIO(content), dtype={"condition": str}, keep_default_na=False, na_values=missing)


def read_latency(workspace: Workspace, experiment: str, settings: dict) -> dict[tuple[str, int], dict]:
    """Read latency.csv as (model, batch) -> row, for every model and batch of params.yaml."""
    path, made_by = workspace.latency(experiment), f"python -m pipeline.stages.latency {experiment}"
    wanted = [
        "model",
        "batch",
        "threads",
        "p50_ms",
        "p50_low_ms",
        "p50_high_ms",
        "p95_ms",
        "params",
        "macs",
        "train_s",
        "size_bytes",
    ]
    rows = {(row["model"], row["batch"]): row for row in read_csv(path, wanted, made_by).to_dict("records")}
    for model in settings["models"]:
        for batch in settings["latency"]["batches"]:
            if (model, batch) not in rows:
                raise InputError(f"{path}: no row for model {model}, batch {batch}; run `{made_by}` again")
    return rows


def read_training_times(workspace: Workspace, experiment: str, model: str, protocol: str) -> list[float]:
    """Read the measured training seconds of one model, one value per seed."""
    made_by = params.training_command(experiment)
    times = read_csv(workspace.training_times(experiment, model), ["protocol", "seed", "train_s"], made_by)
    return times[times["protocol"] == protocol]["train_s"].tolist()


class Fit(NamedTuple):
    """How one run was trained: fit.json and history.csv (epoch, train_loss, validation_loss)."""

    best_epoch: int
    history: pd.DataFrame


def read_fit(workspace: Workspace, experiment: str, model: str, protocol: str, seed: int) -> Fit:
    """Read how one run was trained. Raises InputError for a missing or broken file."""
    folder = workspace.run_folder(experiment, model, protocol, seed)
    made_by = params.training_command(experiment)
    fit = fits.read(folder, made_by)
    history = read_csv(folder / "history.csv", ["epoch", "train_loss", "validation_loss"], made_by)
    return Fit(fit["best_epoch"], history)


def read_windows(
    workspace: Workspace, experiment: str, columns: Sequence[str] = (), where: pc.Expression | None = None
) -> pa.Table:
    """Read the dataset's table, or these columns and the rows `where` something holds of it."""
    made_by = f"python -m tactile.stages.dataset {experiment}"
    return schemas.read(paths.require(workspace.dataset(experiment), made_by), columns, where)


def read_predictions(
    workspace: Workspace, experiment: str, model: str, protocol: str, seed: int, windows: pa.Table
) -> np.ndarray:
    """Read the predictions of one run on all windows of the dataset, (windows, outputs); NaN outside its test part.

    Raises InputError where a test window has no prediction.
    """
    test = np.flatnonzero(schemas.names(windows[schemas.split_column(protocol, seed)]) == "test")
    predicted = read_tested(workspace, experiment, model, protocol, seed, test)
    result = np.full((windows.num_rows, predicted.shape[1]), np.nan, np.float32)
    result[test] = predicted
    return result


def read_tested(
    workspace: Workspace, experiment: str, model: str, protocol: str, seed: int, test: np.ndarray
) -> np.ndarray:
    """Read the predictions of one run on the rows `test` (n,) of the dataset, rising, (n, outputs).

    Raises InputError where other rows than these were predicted.
    """
    made_by = f"python -m tactile.stages.evaluate {experiment}"
    path = paths.require(workspace.predictions(experiment) / f"{model}.parquet", made_by)
    table = schemas.read(path)
    table = table.filter(
        (pc.field("protocol").cast("string") == protocol) & (pc.field("seed") == seed)
    ).combine_chunks()
    rows = table["window"].to_numpy()
    order = np.argsort(rows, kind="stable")
    if not np.array_equal(rows[order], test):
        raise InputError(
            f"{path}: {len(rows)} predictions of {protocol} seed {seed} do not match the "
            f"{len(test)} test windows; run `{made_by}` again"
        )
    return schemas.matrix(table["prediction"])[order]


def kept_rows(path: Path, experiments: Collection[str]) -> pd.DataFrame:
    """Return the rows of a committed table that are of these experiments, and say so; none where there is no file."""
    if not path.is_file():
        return pd.DataFrame(columns=["experiment"])
    with foreign.reading(path, "a CSV table", "get it again from git, or delete it"):
        table = pd.read_csv(path)
        table["experiment"]  # KeyError where it is another table
    rows = table[table["experiment"].isin(experiments)]
    if len(rows):
        names = ", ".join(rows["experiment"].unique())
        print(f"{path.name}: kept from the committed results: {names}; `tactile fetch` gets the recordings")
    return rows
