"""Scores that a kept table says of itself, as the one table of results has them."""

from collections.abc import Iterator

import numpy as np
import pandas as pd
import pyarrow as pa

from pipeline.results import kept
from tactile import experiments
from tactile.datasets.images import modality

KEY = ["protocol", "condition", "model", "seed", "metric"]


def of(experiment: str, rows: pa.Table) -> pd.DataFrame:
    """Return KEY and value of the main metric of every run that a kept table has."""
    table = rows.to_pandas()
    scored = {"windows": windows, "series": series, "images": images}[experiments.module(experiment).KIND](table)
    return pd.DataFrame(scored, columns=[*KEY, "value"])


def windows(table: pd.DataFrame) -> Iterator[tuple]:
    """The root of the mean square over a condition's whole test part."""
    whole = table[(table["window"] == kept.WHOLE) & (table["model"] != kept.READING)]
    for row in whole.itertuples():
        yield row.protocol, row.condition, row.model, row.seed, "rmse", np.sqrt(row.mean_square)


def series(table: pd.DataFrame) -> Iterator[tuple]:
    """The mean of the errors in the parts of a test, by their samples."""
    whole = table[table["window"] == kept.WHOLE]
    for run, parts in whole.groupby(["protocol", "condition", "model", "seed"], observed=True):
        yield *run, "error", np.average(parts["error"], weights=parts["n"])


def images(table: pd.DataFrame) -> Iterator[tuple]:
    """The share of images that were given their own name."""
    counts = table[~table["model"].isin([kept.LABEL, kept.READING])]
    for (protocol, seed, model), rows in counts.groupby(["protocol", "seed", "model"], observed=True):
        right = rows["images"][rows["object"].astype(str) == rows["named"].astype(str)].sum()
        yield protocol, modality(protocol), model, seed, "accuracy", right / rows["images"].sum()
