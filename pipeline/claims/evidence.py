"""Give the claims their results: one number per seed of each, from the one table of results."""

from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd

from pipeline.claims.entries import Claim
from pipeline.claims.expressions import Result
from pipeline.claims.rules import Open
from pipeline.results.one_table import Results
from tactile import experiments

MANY = 20  # test items of a run: of fewer, a claim says how many


class Evidence:
    """The results that the claims read, at one budget of training; control: model -> the one read in its place."""

    def __init__(self, results: Results, budget: str, control: Mapping[str, str]):
        self.results, self.budget, self.control = results, budget, control
        self.experiments = set(results.table["experiment"])
        self.trained = False  # whether a result that was read hangs on the budget
        self.trainings = 0  # of a model, behind draws of recordings
        self.items: dict[tuple[int, int], str] = {}  # fewest and most test items of a run of a result -> their kind

    def runs(self, claim: Claim, result: Result) -> pd.Series:
        """Return seed -> value of a result of a claim, or draws. Raises Open where a run failed or is missing."""
        protocols = protocols_of(claim, result)
        variant = "" if result.variant in claim.splits else result.variant
        result = result._replace(metric=result.metric or claim.metric, variant=variant)
        if not variant:
            result = result._replace(model=self.control.get(result.model, result.model))
        model = claim.names.get(result.model, result.model) + (f", {result.variant}" if result.variant else "")
        if claim.experiment not in self.experiments:
            raise Open(f"waits for results of {claim.experiment}")
        runs = []
        for name in protocols:
            where = (claim.experiment, name, result.condition, result.model, result.metric, result.variant)
            values, budget = self.results.found(*where, self.budget)
            if values.empty:
                raise Open(f"waits for {result.metric} of {model} ({name}, {result.condition})")
            if failed := int((~np.isfinite(values)).sum()):
                raise Open(f"{failed} of {len(values)} runs failed: {model} ({name}, {result.condition})")
            self.trained |= bool(budget)
            runs.append(values)
            if items := self.results.items(*where, budget):
                self.items[items] = experiments.module(claim.experiment).KIND
        draws = self.results.draws(where[0], protocols, *where[2:], self.budget)  # of recordings
        if len(draws):
            self.trainings = max(self.trainings, sum(map(len, runs)))
            return draws
        if len(runs) > 1:
            raise Open(f"waits for {result.metric} of {model} by unit, which makes {len(runs)} splits one result")
        return runs[0]

    def few(self) -> str:
        """Return how many test items each run has of the result that has the fewest, empty where these are many."""
        least, most = min(self.items, default=(MANY, MANY))
        if most >= MANY:
            return ""
        return f"of {least if least == most else f'{least} to {most}'} {self.items[least, most]} a run"


def protocols_of(claim: Claim, result: Result) -> Sequence[str]:
    """Return the protocols that a result of a claim is of, several where these are one result; see `entries.Source`."""
    protocol = claim.splits.get(result.variant, claim.protocol)
    protocol = protocol[result.condition] if isinstance(protocol, Mapping) else protocol
    names = [protocol] if isinstance(protocol, str) else protocol
    return [name.format(condition=result.condition) for name in names]
