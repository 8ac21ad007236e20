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
from pipeline.base.paths import Workspace
from pipeline.claims import longer
from pipeline.claims.entries import Claim
from pipeline.claims.expressions import Result
from pipeline.claims.rules import NotTestable
from pipeline.scoring.claim_inputs import KEY
from pipeline.scoring.one_table import WHOLE
from pipeline.scoring.results import read_csv

COSTS = ("p50_ms", "train_s", "params", "macs")  # metrics that say nothing of how well a network was trained


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


def trainings(folder: Path) -> dict[str, pd.DataFrame]:
    """Return experiment -> longer trainings of a folder of reports: longer.csv, or longer/<experiment>.csv."""
    if (together := folder / "longer.csv").exists():
        rows = read_csv(together, ["experiment", *longer.COLUMNS], "tactile paper-scale")
        return {experiment: part for experiment, part in rows.groupby("experiment")}
    return {path.stem: longer.read(path) for path in sorted((folder / "longer").glob("*.csv"))}
