"""Give the claims their results: the one table of scores, times, counts and studies, one number per seed of each.

A row says what was measured (experiment, protocol, condition, model, variant, metric), of which seed, and the value,
NaN for a failed run. A row without a protocol or without a seed is of all of them.
"""

from collections.abc import Mapping
from functools import cache
from pathlib import Path

import numpy as np
import pandas as pd

from pipeline.base import params
from pipeline.base.errors import InputError
from pipeline.claims import longer
from pipeline.claims.entries import Claim
from pipeline.claims.expressions import Result
from pipeline.claims.rules import NotTestable
from pipeline.scoring.claim_inputs import COLUMNS, KEY
from pipeline.scoring.published import ANY
from pipeline.scoring.results import read_csv

COSTS = ("p50_ms", "train_s", "params", "macs")  # metrics that say nothing of how well a network was trained
PRINTED_SHAPE = "printed_shape"  # variant: a count at the input that the paper's is of
WHOLE = "whole"  # column: whether the value is an error of a whole run, as scores.csv has them


class Evidence:
    """The results that the claims read, and how much longer trainings would change them."""

    def __init__(self, table: pd.DataFrame, values: Mapping, trainings: Mapping[str, pd.DataFrame] | None = None):
        """table: see `read`; values: params.yaml; trainings: experiment -> longer trainings, rows as of `longer`."""
        rows = table.fillna(dict.fromkeys(KEY, "")).fillna({"seed": -1})
        if len(repeated := rows[rows.duplicated([*KEY, "seed"])]):
            raise InputError(f"two results for {', '.join(map(str, repeated.iloc[0][[*KEY, 'seed']]))}")
        seeds, numbers, groups = rows["seed"].to_numpy(), rows["value"].to_numpy(float), rows.groupby(KEY).indices
        self._runs = {key: pd.Series(numbers[places], index=seeds[places]) for key, places in groups.items()}
        self._whole = set(rows[rows[WHOLE]][KEY].itertuples(index=False, name=None))
        self._protocols = set(zip(rows["experiment"], rows["protocol"], strict=True))
        self._values = values
        self._changes = {name: longer.changes(runs) for name, runs in (trainings or {}).items()}
        self.scale = cache(lambda experiment: params.scale_of(experiment, values[experiment]))
        self.start()

    def start(self) -> None:
        """Forget what was read."""
        self.networks: set[longer.Network] = set()  # whose results were read
        self.whole = True  # whether these are errors of whole runs, which a longer training would lower alike
        self.factors: dict[longer.Network, float] = {}  # errors to expect of a longer training, over those read

    def unended(self) -> dict[longer.Network, float]:
        """Return the change of each network that was read whose validation error a longer training lowers."""
        return longer.unended(sorted(self.networks), self._changes, self._values)

    def protocol(self, protocol: object, experiment: str, condition: str) -> str:
        """Return the protocol of a claim for one condition; see `entries.Source`."""
        if isinstance(protocol, Mapping):
            protocol = protocol[condition]
        listed = [one.format(condition=condition) for one in ([protocol] if isinstance(protocol, str) else protocol)]
        return next((name for name in listed if (experiment, name) in self._protocols), listed[0])

    def runs(self, claim: Claim, result: Result, protocol: object) -> pd.Series:
        """Return seed -> value of a result. Raises NotTestable where a run failed or is missing."""
        result = result._replace(metric=result.metric or claim.metric)
        name = self.protocol(protocol, claim.experiment, result.condition)
        who = f"{result.model}{f'[{result.variant}]' if result.variant else ''} ({name}, {result.condition})"
        keys = [(claim.experiment, there, *result) for there in (name, "")]
        key = next((key for key in keys if key in self._runs), None)
        if key is None:
            raise NotTestable(claim.absent or f"{claim.experiment} has no {result.metric} of {who}")
        values = self._runs[key]
        if failed := int((~np.isfinite(values)).sum()):
            raise NotTestable(f"failed runs: {who}, {failed} of {len(values)}")
        if result.variant or result.metric in COSTS or not key[1]:
            return values
        network = (claim.experiment, name, result.model)
        self.networks.add(network)
        self.whole &= key in self._whole
        return longer.with_errors(values, result.metric, self.factors.get(network, 1.0))


def read(folder: Path) -> pd.DataFrame:
    """Return the one table of results of a folder of reports: COLUMNS of claim_inputs and WHOLE.

    Its files are scores.csv, latency.csv, counts.csv, claim_inputs.csv and strain/accuracy; one that is missing has no
    results. Raises InputError for a file without the columns that are read.
    """
    tables = [
        _scores(folder),
        _times(folder),
        _counts(folder),
        *_studies(folder),
        _rows(folder, "claim_inputs", COLUMNS),
    ]
    there = [table.reindex(columns=[*COLUMNS, WHOLE]) for table in tables if len(table)]
    empty = pd.DataFrame(columns=[*COLUMNS, WHOLE])
    return (pd.concat(there) if there else empty).fillna({WHOLE: False}).astype({WHOLE: bool})


def _rows(folder: Path, name: str, columns: list[str]) -> pd.DataFrame:
    path = folder / f"{name}.csv"
    return read_csv(path, columns, "dvc repro") if path.exists() else pd.DataFrame(columns=columns)


def _scores(folder: Path) -> pd.DataFrame:
    """Return scores.csv. A run without an RMSE failed, whatever its other metrics say: a map of NaN has no peak."""
    run = ["experiment", "protocol", "condition", "model", "seed"]
    table = _rows(folder, "scores", [*run, "metric", "unit", "value", "n"])
    failed = table[(table["metric"] == "rmse") & table["value"].isna()][run]
    lost = pd.MultiIndex.from_frame(table[run]).isin(pd.MultiIndex.from_frame(failed))
    return table.assign(value=table["value"].where(~lost), **{WHOLE: True})


def _times(folder: Path) -> pd.DataFrame:
    """Return the median times of latency.csv at the first batch size."""
    table = _rows(folder, "latency", ["experiment", "model", "batch", "p50_ms"])
    first = table[table["batch"] == table.groupby("experiment")["batch"].transform("min")]
    return first[["experiment", "model"]].assign(condition=ANY, metric="p50_ms", unit="ms", value=first["p50_ms"])


def _counts(folder: Path) -> pd.DataFrame:
    """Return the operations and parameters of counts.csv, the first row of each model at each shape."""
    table = _rows(folder, "counts", ["experiment", "model", "macs", "params", "published_macs"])
    table = table.assign(condition=ANY, variant=table["published_macs"].notna().map({True: PRINTED_SHAPE, False: ""}))
    first = table.drop_duplicates(["experiment", "model", "variant"])[["experiment", "condition", "model", "variant"]]
    return pd.concat(
        [first.assign(metric=name, unit="1", value=table.loc[first.index, name]) for name in ("macs", "params")]
    )


def _studies(folder: Path) -> list[pd.DataFrame]:
    """Return the studies of strain: what differs from the tables is a variant, what is decoded a metric."""
    folder, key = folder / "strain" / "accuracy", ["protocol", "seed", "value"]
    tables = []
    for name, column in (("samples", "samples"), ("strands", "strands"), ("bases", "base")):
        table = _rows(folder, name, [*key, "model", column])
        tables.append(table.assign(variant=f"{column}_" + table[column].astype(str)))
    drift = _rows(folder, "drift", [*key, "input", "target"])
    of_raw = drift["input"].str.startswith("raw")
    drift = drift[of_raw | (drift["input"] == "latent of model-0")]
    inputs = of_raw.loc[drift.index].map({True: "raw", False: "states"})
    tables.append(drift.assign(model=inputs, metric=drift["target"].str.replace(" ", "_")))
    return [table.assign(experiment="strain", condition=table["protocol"]) for table in tables]


def trainings(folder: Path) -> dict[str, pd.DataFrame]:
    """Return experiment -> longer trainings of a folder of reports: longer.csv, or longer/<experiment>.csv."""
    if (together := folder / "longer.csv").exists():
        rows = read_csv(together, ["experiment", *longer.COLUMNS], "tactile paper-scale")
        return {experiment: part for experiment, part in rows.groupby("experiment")}
    return {path.stem: longer.read(path) for path in sorted((folder / "longer").glob("*.csv"))}
