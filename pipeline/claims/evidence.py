"""Give the claims their results: one number per seed of each, from the one table of results."""

from collections.abc import Mapping

import numpy as np
import pandas as pd

from pipeline.claims.entries import Claim
from pipeline.claims.expressions import Result
from pipeline.claims.rules import Open
from pipeline.scoring.one_table import Results


class Evidence:
    """The results that the claims read, at one budget of training."""

    def __init__(self, results: Results, budget: str):
        self.results, self.budget = results, budget
        self.experiments = set(results.table["experiment"])
        self.trained = False  # whether a result that was read hangs on the budget
        self.trainings = 0  # of a model, behind draws of recordings

    def runs(self, claim: Claim, result: Result) -> pd.Series:
        """Return seed -> value of a result of a claim. Raises Open where a run failed or is missing."""
        result = result._replace(metric=result.metric or claim.metric)
        name = protocol_of(claim, result.condition)
        model = claim.names.get(result.model, result.model) + (f", {result.variant}" if result.variant else "")
        if claim.experiment not in self.experiments:
            raise Open(f"waits for results of {claim.experiment}")
        where = (claim.experiment, name, result.condition, result.model, result.metric, result.variant)
        values, budget = self.results.found(*where, self.budget)
        if values.empty:
            raise Open(f"waits for {result.metric} of {model} ({name}, {result.condition})")
        if failed := int((~np.isfinite(values)).sum()):
            raise Open(f"{failed} of {len(values)} runs failed: {model} ({name}, {result.condition})")
        self.trained |= bool(budget)
        draws = self.results.draws(where[0], [name], *where[2:], self.budget)  # of recordings
        if draws.empty:
            return values
        self.trainings = max(self.trainings, len(values))
        return draws


def protocol_of(claim: Claim, condition: str) -> str:
    """Return the protocol of a claim for one condition; see `entries.Source`."""
    protocol = claim.protocol
    return (protocol[condition] if isinstance(protocol, Mapping) else protocol).format(condition=condition)
