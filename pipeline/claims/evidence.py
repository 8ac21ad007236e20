"""Give the claims their results: the one table of scores, times, counts and studies, one number per seed of each.

A row says what was measured (experiment, protocol, condition, model, variant, metric), of which seed, and the value,
NaN for a failed run. A row without a protocol or without a seed is of all of them.
"""

from collections.abc import Callable, Mapping
from functools import cache, partial
from pathlib import Path

import numpy as np
import pandas as pd

from pipeline.base import params
from pipeline.base.errors import InputError
from pipeline.base.paths import Workspace
from pipeline.claims import longer
from pipeline.claims.entries import Claim
from pipeline.claims.expressions import Result
from pipeline.claims.rules import NotTestable
from pipeline.scoring.claim_inputs import COLUMNS, KEY
from pipeline.scoring.published import ANY
from pipeline.scoring.results import read_csv
from pipeline.scoring.strain_results import LATENT

COSTS = ("p50_ms", "train_s", "params", "macs")  # metrics that say nothing of how well a network was trained
PRINTED_SHAPE = "printed_shape"  # variant: a count at the input that the paper's is of
STUDIES = ("samples", "strands", "bases", "drift")  # of strain
MADE_BY = "dvc repro"
WHOLE = "whole"  # column: whether the value is an error of a whole run, as scores.csv has them


class Evidence:
    """The results that the claims read, and how much longer trainings would change them."""

    def __init__(
        self,
        workspace: Workspace,
        table: pd.DataFrame,
        values: Mapping,
        trainings: Mapping[str, pd.DataFrame] | None = None,
    ):
        """table: see `read`; values: params.yaml; trainings: experiment -> longer trainings, rows as of `longer`."""
        rows = table.astype(dict.fromkeys(KEY, object)).fillna(dict.fromkeys(KEY, "")).fillna({"seed": -1})
        if len(repeated := rows[rows.duplicated([*KEY, "seed"])]):
            raise InputError(f"two results for {', '.join(map(str, repeated.iloc[0][[*KEY, 'seed']]))}")
        seeds, numbers, groups = rows["seed"].to_numpy(), rows["value"].to_numpy(float), rows.groupby(KEY).indices
        self._runs = {key: pd.Series(numbers[places], index=seeds[places]) for key, places in groups.items()}
        self._whole = set(rows[rows[WHOLE]][KEY].itertuples(index=False, name=None))
        self._protocols = set(zip(rows["experiment"], rows["protocol"], strict=True))
        self._experiments = set(rows["experiment"])
        self._values = values
        self._changes = {name: longer.changes(runs) for name, runs in (trainings or {}).items()}
        self.scale = cache(lambda name: params.scale_of(workspace.scales, name, values[name]) if name in values else "")
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
        model = claim.names.get(result.model, result.model) + (f", {result.variant}" if result.variant else "")
        who = f"{model} ({name}, {result.condition})"
        if claim.experiment not in self._experiments:
            raise NotTestable(claim.absent or f"{claim.experiment} was not run")
        keys = [(claim.experiment, there, *result) for there in (name, "")]
        key = next((key for key in keys if key in self._runs), None)
        if key is None:
            raise NotTestable(claim.absent or f"there is no {result.metric} of {who} in {claim.experiment}")
        values = self._runs[key]
        if failed := int((~np.isfinite(values)).sum()):
            raise NotTestable(f"failed runs: {who}, {failed} of {len(values)}")
        if result.variant or result.metric in COSTS or not key[1]:
            return values
        network = (claim.experiment, name, result.model)
        self.networks.add(network)
        self.whole &= key in self._whole
        return longer.with_errors(values, result.metric, self.factors.get(network, 1.0))


def of_reports(folder: Path) -> dict[str, Path]:
    """Return the files of results in a folder of reports, which are of all experiments."""
    names = ("scores", "latency", "counts", "claim_inputs")
    studies = {name: folder / "strain" / "accuracy" / f"{name}.csv" for name in STUDIES}
    return {name: folder / f"{name}.csv" for name in names} | studies


def of_experiment(workspace: Workspace, experiment: str) -> dict[str, Path]:
    """Return the files of results that the stages of one experiment write, and of the glove the counts."""
    files = {"scores": workspace.scores(experiment), "latency": workspace.latency(experiment)}
    files |= {"claim_inputs": workspace.claim_inputs(experiment)}
    study = workspace.experiment_folder("strain") / "study"
    further = {"glove": {"counts": workspace.reports / "counts.csv"}}
    further |= {"strain": {name: study / f"{name}.csv" for name in STUDIES}}
    return files | further.get(experiment, {})


def read(files: Mapping[str, Path]) -> pd.DataFrame:
    """Return the one table of results, columns COLUMNS of claim_inputs and WHOLE; a file that is missing has no rows.

    files: see `of_reports`. Raises InputError for a file without the columns that are read.
    """
    present = {name: path for name, path in files.items() if path.exists()}
    tables = [TABLES[name](path) for name, path in present.items()] or [pd.DataFrame(columns=COLUMNS)]
    together = pd.concat([table.reindex(columns=[*COLUMNS, WHOLE]).astype(object) for table in tables])
    return together.infer_objects().fillna({WHOLE: False}).astype({WHOLE: bool, "value": float})


def _scores(path: Path) -> pd.DataFrame:
    """Return scores.csv. A run without an RMSE failed, whatever its other metrics say: a map of NaN has no peak."""
    run = ["experiment", "protocol", "condition", "model", "seed"]
    table = read_csv(path, [*run, "metric", "unit", "value", "n"], MADE_BY)
    failed = table[(table["metric"] == "rmse") & table["value"].isna()][run]
    lost = pd.MultiIndex.from_frame(table[run]).isin(pd.MultiIndex.from_frame(failed))
    return table.assign(value=table["value"].where(~lost), **{WHOLE: True})


def _times(path: Path) -> pd.DataFrame:
    """Return the median times of latency.csv at the first batch size."""
    table = read_csv(path, ["experiment", "model", "batch", "p50_ms"], MADE_BY)
    first = table[table["batch"] == table.groupby("experiment")["batch"].transform("min")]
    return first[["experiment", "model"]].assign(condition=ANY, metric="p50_ms", unit="ms", value=first["p50_ms"])


def _counts(path: Path) -> pd.DataFrame:
    """Return the operations and parameters of counts.csv, the first row of each model at each shape."""
    table = read_csv(path, ["experiment", "model", "macs", "params", "published_macs"], MADE_BY)
    table = table.assign(condition=ANY, variant=table["published_macs"].notna().map({True: PRINTED_SHAPE, False: ""}))
    first = table.drop_duplicates(["experiment", "model", "variant"])[["experiment", "condition", "model", "variant"]]
    return pd.concat([first.assign(metric=name, unit="1", value=table[name]) for name in ("macs", "params")])


def _study(column: str, path: Path) -> pd.DataFrame:
    """Return a study of strain in which trainings differ by a column: its values are the variants."""
    table = read_csv(path, ["protocol", "model", "seed", "metric", "value", column], MADE_BY)
    names = {
        "experiment": "strain",
        "condition": table["protocol"],
        "variant": f"{column}_" + table[column].astype(str),
    }
    return table.assign(**names)


def _drift(path: Path) -> pd.DataFrame:
    """Return what a linear read-out decodes from the raw voltages and from model-0; the target is the metric."""
    table = read_csv(path, ["protocol", "seed", "value", "input", "target"], MADE_BY)
    known = table["input"].str.startswith("raw").map({True: "raw", False: "states"})
    table = table.assign(experiment="strain", condition=table["protocol"], model=known)
    table = table.assign(metric=table["target"].str.replace(" ", "_"))
    return table[(known == "raw") | (table["input"] == LATENT)]


TABLES: dict[str, Callable[[Path], pd.DataFrame]] = {
    "scores": _scores,
    "latency": _times,
    "counts": _counts,
    "claim_inputs": lambda path: read_csv(path, COLUMNS, MADE_BY),
    "samples": partial(_study, "samples"),
    "strands": partial(_study, "strands"),
    "bases": partial(_study, "base"),
    "drift": _drift,
}


def trainings(folder: Path) -> dict[str, pd.DataFrame]:
    """Return experiment -> longer trainings of a folder of reports: longer.csv, or longer/<experiment>.csv."""
    if (together := folder / "longer.csv").exists():
        rows = read_csv(together, ["experiment", *longer.COLUMNS], "tactile paper-scale")
        return {experiment: part for experiment, part in rows.groupby("experiment")}
    return {path.stem: longer.read(path) for path in sorted((folder / "longer").glob("*.csv"))}
