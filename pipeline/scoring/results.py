"""Read scores, fits, times and predictions for the reports. A missing file or row is an error, no gap."""

import io
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.compute as pc
from scipy import stats
from scipy.special import expit, logit

from pipeline.base import params, paths
from pipeline.base.errors import InputError
from pipeline.base.paths import Workspace
from pipeline.datasets import fits, schemas

CONFIDENCE = 0.95
SAME = 1e-12  # relative: runs closer to one another have one value
PLAIN, SHARE, R2, LOG = "", "share", "r2", "log"  # scales of values
EDGE = 1e-3  # a share nearer to a bound counts as this far from it: one test item in a thousand
SHARES = ("accuracy", "macro_precision", "touches_found")  # metrics from 0 to 1
ERRORS = ("rmse", "error", "location_error", "force_rmse", "press_error")  # metrics above 0
# Scale -> the function that its values are near a normal distribution by, and its inverse.
SCALES: dict[str, tuple[Callable, Callable]] = {
    PLAIN: (np.asarray, np.asarray),
    SHARE: (lambda share: logit(np.clip(share, EDGE, 1 - EDGE)), expit),
    LOG: (np.log, np.exp),  # of errors and their ratios, which are above 0
    R2: (lambda r2: np.log(np.maximum(1 - r2, EDGE)), lambda missing: 1 - np.exp(missing)),
}
MISSING = ("", "nan")  # how the stages write a value that there is not


class Estimate(NamedTuple):
    """Mean over the runs that did not fail, with its t interval; NaN where too few runs are left."""

    mean: float
    low: float
    high: float
    runs: int
    failed: int

    def percent(self) -> "Estimate":
        """Return the fraction in percent."""
        return self._replace(mean=100 * self.mean, low=100 * self.low, high=100 * self.high)


def estimate(values: Sequence[float], scale: str = "", trials: int = 0) -> Estimate:
    """Return mean and 95 % interval of one value per run; a run has failed where its value is not finite.

    scale: PLAIN, for a t interval of the values; LOG (above 0), SHARE (0 to 1) or R2 (up to 1), for one of their
    logarithms, of their logits, or of the logarithms of what is missing to 1, turned back, so that it stays inside the
    bounds. Runs that all have one value
    tell nothing of their spread: they have no interval, but for shares of `trials`, and for shares at a bound, as of as
    many trials as there are runs (`binomial`).
    """
    values = np.asarray(values, dtype=float)
    good = values[np.isfinite(values)]
    n, failed = len(good), len(values) - len(good)
    if n == 0:
        return Estimate(np.nan, np.nan, np.nan, 0, failed)
    mean = float(good.mean())
    if n == 1 or np.ptp(good) <= SAME * np.abs(good).max():
        known = n > 1 and scale == SHARE and (trials or mean in (0.0, 1.0))
        return Estimate(mean, *(binomial(mean, trials or n) if known else (np.nan, np.nan)), n, failed)
    there, back = SCALES[PLAIN if scale == LOG and good.min() <= 0 else scale]
    seen = there(good)
    half = float(stats.t.ppf((1 + CONFIDENCE) / 2, n - 1) * seen.std(ddof=1) / np.sqrt(n))
    low, high = sorted(float(back(seen.mean() + side * half)) for side in (-1, 1))
    return Estimate(mean, min(low, mean), max(high, mean), n, failed)


def binomial(share: float, trials: int) -> tuple[float, float]:
    """Return the exact 95 % interval of a share of so many trials (Clopper and Pearson 1934)."""
    low, high = stats.binomtest(round(share * trials), trials).proportion_ci(CONFIDENCE, "exact")
    return float(low), float(high)


def scale_of(metric: str) -> str:
    """Return the scale of a metric's values, for `estimate`."""
    return SHARE if metric in SHARES else LOG if metric in ERRORS else R2 if "r2" in metric else PLAIN


def read_csv(path: Path, columns: Sequence[str], made_by: str) -> pd.DataFrame:
    """Read a CSV table that has at least `columns`. Raises InputError otherwise."""
    try:
        table = parse_csv(paths.require(path, made_by).read_bytes())
    except (pd.errors.EmptyDataError, pd.errors.ParserError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: not a CSV table ({error}); run `{made_by}` again") from error
    for column in columns:
        if column not in table.columns:
            raise InputError(f"{path}: column '{column}' is missing; run `{made_by}` again")
    return table


def parse_csv(content: bytes) -> pd.DataFrame:
    """Return a CSV table as the stages write it."""
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


def read_windows(workspace: Workspace, experiment: str) -> pa.Table:
    """Read the dataset's table."""
    return schemas.read(paths.require(workspace.dataset(experiment), f"python -m pipeline.stages.dataset {experiment}"))


def read_predictions(
    workspace: Workspace, experiment: str, model: str, protocol: str, seed: int, windows: pa.Table
) -> np.ndarray:
    """Read the predictions of one run on all windows of the dataset, (windows, outputs); NaN outside its test part.

    Raises InputError where a test window has no prediction.
    """
    made_by = f"python -m pipeline.stages.evaluate {experiment}"
    path = paths.require(workspace.predictions(experiment) / f"{model}.parquet", made_by)
    table = schemas.read(path)
    table = table.filter(
        (pc.field("protocol").cast("string") == protocol) & (pc.field("seed") == seed)
    ).combine_chunks()
    test = np.flatnonzero(schemas.names(windows[schemas.split_column(protocol, seed)]) == "test")
    rows = table["window"].to_numpy()
    if not np.array_equal(np.sort(rows), test):
        raise InputError(
            f"{path}: {len(rows)} predictions of {protocol} seed {seed} do not match the "
            f"{len(test)} test windows; run `{made_by}` again"
        )
    result = np.full((windows.num_rows, table.schema.field("prediction").type.list_size), np.nan, np.float32)
    result[rows] = schemas.matrix(table["prediction"])
    return result
