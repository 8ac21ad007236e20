"""Read the one table of results: scores, times, counts and studies, one row for each number of a seed.

There are two of them: that of the evidence, which people read, and that of what `dvc repro` computed here, the look.

A row says what was measured (experiment, protocol, condition, model, variant, metric), of which seed, with which budget
of training, and the value, NaN for a failed run. A row without a protocol, a seed or a budget is of all of them. What
`dvc repro` trains is of the budget `look`, the committed shards of the evidence are of `half` and `full`.
"""

from collections.abc import Callable, Collection, Mapping, Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from pipeline.results import shards, times
from pipeline.results.claim_inputs import COLUMNS, DERIVED_METRICS, FULL, HALF, KEY, LOOK
from pipeline.results.published import ANY
from pipeline.results.strain_results import LATENT
from tactile import experiments
from tactile.base.errors import InputError
from tactile.base.paths import Workspace
from tactile.scoring import units
from tactile.scoring.estimates import Estimate, estimate, read_csv, read_scores, scale_of

PRINTED_SHAPE = "printed_shape"  # variant: a count at the input that the paper's is of
MADE_BY = "dvc repro"
SIMULATED = "simulated"  # source of an experiment whose logs are not the user's own
TRAIN_S = "train_s"  # metric: seconds of a training
WHOLE = "whole"  # column: whether the value is an error of a whole run, as scores.csv has them


class Results:
    """The one table of results, looked up by what was measured."""

    def __init__(self, table: pd.DataFrame):
        """table: see `read`. Raises InputError where a number is there twice."""
        rows = table.astype(dict.fromkeys([*KEY, "budget"], object)).fillna(
            {**dict.fromkeys([*KEY, "budget"], ""), "seed": -1}
        )
        rows = rows.astype({"seed": int, "value": float})
        if len(repeated := rows[rows.duplicated([*KEY, "seed", "budget"])]):
            raise InputError(f"two results for {', '.join(map(str, repeated.iloc[0][[*KEY, 'seed']]))}")
        self.table = rows
        by_unit = rows["metric"].str.endswith(units.SUFFIX)
        named = rows[by_unit]["variant"].str
        variant, unit = named.replace("/?[^/]*$", "", regex=True), named.replace(".*/", "", regex=True)
        place = [variant if name == "variant" else name for name in (*KEY, "budget")]
        self._by_unit = dict(list(rows[by_unit].assign(variant=unit).groupby(place)))
        rows = rows[~by_unit]
        groups = rows.groupby([*KEY, "budget"]).indices
        seeds, numbers = rows["seed"].to_numpy(), rows["value"].to_numpy(float)
        self._at, self._items = groups, pd.to_numeric(rows["n"]).to_numpy(float)
        self._runs = {key: pd.Series(numbers[at], index=seeds[at]).sort_index() for key, at in groups.items()}
        scored = rows[
            rows["metric"] != TRAIN_S
        ]  # a solved model's seconds are of the budget of its shard, not its scores
        budgets = scored.groupby(["experiment", "protocol", "variant"])["budget"].unique()
        self._shown = {key: at for key, known in budgets.items() for at in (HALF, FULL) if at in known}

    def shown(self, experiment: str, protocol: str, variant: str = "") -> str:
        """Return the budget whose numbers people read: that of the evidence, or the look where it has no shard.

        A variant that the evidence has at no budget of its own is of the same one as the models in the tables.
        """
        places = [(experiment, protocol, name) for name in (variant, "")]
        return next((self._shown[place] for place in places if place in self._shown), LOOK)

    def found(
        self, experiment: str, protocol: str, condition: str, model: str, metric: str, variant: str, budget: str
    ) -> tuple[pd.Series, str]:
        """Return seed -> value, NaN for a failed run, and the budget that it hangs on; no value where there is no run.

        A row without a budget, of a model without epochs, is of every budget; one without a protocol of every protocol.
        """
        for name in (protocol, ""):
            for at in (budget, ""):
                if (key := (experiment, name, condition, model, variant, metric, at)) in self._runs:
                    return self._runs[key], at
        return pd.Series(dtype=float), ""

    def items(
        self, experiment: str, protocol: str, condition: str, model: str, metric: str, variant: str, budget: str
    ) -> tuple[int, int] | None:
        """Return the fewest and the most test items of a run; None where they are not told or there is one alone."""
        for name in (protocol, ""):
            if len(at := self._at.get((experiment, name, condition, model, variant, metric, budget), ())):
                n = self._items[at]
                return (int(n.min()), int(n.max())) if np.isfinite(n).all() and n.min() > 1 else None
        return None

    def draws(
        self,
        experiment: str,
        protocols: Sequence[str],
        condition: str,
        model: str,
        metric: str,
        variant: str,
        budget: str,
    ) -> pd.Series:
        """Return a metric over presses or grasps drawn anew (`units.drawn`); empty where it has no rows by unit.

        protocols: of several, which test on different persons, all are one result; empty where one has none. Raises
        InputError where two test on the same one.
        """
        parts = []
        for protocol in protocols:
            place = (experiment, protocol, condition, model, variant, metric + units.SUFFIX)
            found = [self._by_unit[*place, at] for at in (budget, "") if (*place, at) in self._by_unit]
            parts += found[:1]
        if not parts or len(parts) < len(protocols):
            return pd.Series(dtype=float)
        tested = pd.concat([part["variant"].drop_duplicates() for part in parts])
        if twice := list(tested[tested.duplicated()]):
            raise InputError(f"{experiment}: two of {', '.join(protocols)} test on {twice[0]}")
        return units.drawn(pd.concat(parts), metric)

    def runs(
        self,
        experiment: str,
        protocol: str,
        condition: str,
        model: str,
        metric: str,
        variant: str = "",
        budget: str = "",
    ) -> pd.Series:
        """Return the values of `found`, of the budget that is shown where none is given."""
        budget = budget or self.shown(experiment, protocol, variant)
        return self.found(experiment, protocol, condition, model, metric, variant, budget)[0]

    def estimate(self, *where: str, **further: str) -> Estimate:
        """Return mean and 95 % interval over the seeds; arguments: see `runs`. NaN, of no run, where it was not run."""
        metric = further.get("metric", where[4] if len(where) > 4 else "")
        return estimate(self.runs(*where, **further), scale_of(metric))

    def rows(self, **columns: str) -> pd.DataFrame:
        """Return the rows whose columns have these values."""
        chosen = np.logical_and.reduce([self.table[name] == value for name, value in columns.items()])
        return self.table[chosen]


def of_experiment(workspace: Workspace, experiment: str) -> dict[str, Path | list[Path]]:
    """Return the files of results that the stages of one experiment write, and of the glove the counts."""
    files: dict[str, Path | list[Path]] = {"scores": workspace.scores(experiment)}
    files |= {"latency": workspace.latency(experiment), "claim_inputs": workspace.claim_inputs(experiment)}
    further: dict[str, dict[str, Path | list[Path]]] = {"glove": {"counts": workspace.reports / "counts.csv"}}
    further |= {"strain": {"drift": workspace.study("strain", "drift")}}
    return files | further.get(experiment, {})


def of_own_logs(values: Mapping) -> list[str]:
    """Return the experiments whose logs are the user's own; values: all settings."""
    return [name for name in values["experiments"] if values[name].get("source", SIMULATED) != SIMULATED]


def of_look(workspace: Workspace, experiment: str) -> Results:
    """Return what the stages of one experiment computed here."""
    return Results(read(of_experiment(workspace, experiment)))


def results(workspace: Workspace, own: Collection[str], experiment: str = "") -> Results:
    """Return the evidence, of all experiments or of one, with what was timed for it and counted.

    own: see `of_own_logs`; the evidence has nothing of them.
    """
    kept = shards.read(workspace)
    timed = [_times(times.predictions(workspace, name)) for name in experiments.NAMES]
    derived = kept["metric"].isin(DERIVED_METRICS) | kept["metric"].str.endswith(units.SUFFIX)
    kept = kept.assign(**{WHOLE: ~derived & kept["variant"].fillna("").eq("")})
    further = read({"counts": workspace.reports / "counts.csv", "drift": workspace.study("strain", "drift")})
    table = pd.concat([further, *timed, kept], ignore_index=True)
    table = table[~table["experiment"].isin(own) & ((table["experiment"] == experiment) | (experiment == ""))]
    return Results(table.astype({WHOLE: object}).fillna({WHOLE: False}).astype({WHOLE: bool}))


def read(files: Mapping[str, Path | list[Path]]) -> pd.DataFrame:
    """Return the results in files, columns COLUMNS of claim_inputs and WHOLE; a file that is missing has no rows.

    files: see `of_experiment`. Raises InputError for a file without the columns that are read.
    """
    parts = [(name, path) for name, at in files.items() for path in ([at] if isinstance(at, Path) else at)]
    tables = [TABLES[name](path) for name, path in parts if path.exists()] or [pd.DataFrame(columns=COLUMNS)]
    together = pd.concat([table.reindex(columns=[*COLUMNS, WHOLE]).astype(object) for table in tables])
    return together.infer_objects().astype({WHOLE: object}).fillna({WHOLE: False}).astype({WHOLE: bool, "value": float})


def _scores(path: Path) -> pd.DataFrame:
    """Return scores.csv of the look."""
    return read_scores(path, MADE_BY).assign(budget=LOOK, **{WHOLE: True})


def _times(table: pd.DataFrame) -> pd.DataFrame:
    """Return the median times at the first batch size; table: latency.csv, or of `times.predictions`."""
    first = table[table["batch"] == table.groupby("experiment")["batch"].transform("min")]
    return first[["experiment", "model"]].assign(condition=ANY, metric="p50_ms", unit="ms", value=first["p50_ms"])


def _counts(path: Path) -> pd.DataFrame:
    """Return the operations and parameters of counts.csv, the first row of each model at each shape."""
    table = read_csv(path, ["experiment", "model", "macs", "params", "published_macs"], MADE_BY)
    table = table.assign(condition=ANY, variant=table["published_macs"].notna().map({True: PRINTED_SHAPE, False: ""}))
    first = table.drop_duplicates(["experiment", "model", "variant"])[["experiment", "condition", "model", "variant"]]
    return pd.concat([first.assign(metric=name, unit="1", value=table[name]) for name in ("macs", "params")])


def _drift(path: Path) -> pd.DataFrame:
    """Return what a linear read-out decodes from the raw voltages and from model-0; the target is the metric.

    An R2 below 0 becomes 0, which the mean has: a read-out that tells less than nothing tells nothing.
    """
    table = read_csv(path, ["protocol", "seed", "value", "input", "target"], MADE_BY)
    known = table["input"].str.startswith("raw").map({True: "raw", False: "states"})
    table = table.assign(experiment="strain", condition=table["protocol"], model=known)
    table = table.assign(metric=table["target"].str.replace(" ", "_"), value=table["value"].clip(lower=0))
    return table[(known == "raw") | (table["input"] == LATENT)]


TABLES: dict[str, Callable[[Path], pd.DataFrame]] = {
    "scores": _scores,
    "latency": lambda path: _times(read_csv(path, ["experiment", "model", "batch", "p50_ms"], MADE_BY)),
    "counts": _counts,
    "claim_inputs": lambda path: read_csv(path, COLUMNS, MADE_BY),
    "drift": _drift,
}
