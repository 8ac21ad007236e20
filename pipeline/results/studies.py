"""Read what `tactile evidence` computes of studies: tables in evidence/studies, and variants in the one table.

Variants whose names are one and a number, such as units_50, are a ladder: models of several sizes. Those of a family
differ in one thing: FAMILIES.
"""

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import pandas as pd

from tactile.base.errors import InputError
from tactile.base.paths import Workspace
from tactile.experiments import facts
from tactile.scoring.estimates import read_csv

MADE_BY = "tactile evidence"
NONE = "none"  # no effect of a scene is left out
PHYSICS = ("experiment", "effect", "condition", "model", "seed", "metric", "unit", "value")  # columns of physics.csv
LADDER = ("experiment", "condition", "family", "size", "params", "metric", "unit", "seed", "value", "macs")


class Family(NamedTuple):
    """One way to make a model larger: its variants are called `name`_<size>."""

    experiment: str
    model: str
    name: str
    protocol: str  # of the experiment's main table, under which a condition is trained and tested
    conditions: tuple[str, ...] = ()  # those judged, () for all


FAMILIES = {
    # hidden units; conditions of Table I
    "lomp": Family("touch", "lomp", "hidden", "press", ("single", "double")),
    # frames of a window that the model sees
    "window": Family("touch", "cnn", "window", "press", ("single", "double")),
    # units
    "lstm": Family("strain", "lstm_direct", "units", "{condition}"),
    # channels, as a share of the published ones
    "sp_resnet": Family("glove", "sp_resnet", "width", "session_{condition}"),
}


def read(workspace: Workspace, experiment: str, table: str, columns: Sequence[str]) -> pd.DataFrame:
    """Return a table of a study, of all seeds that were computed; without a row where none was.

    columns: what it has at least; InputError where a file lacks one.
    """
    parts = [read_csv(path, columns, MADE_BY) for path in workspace.study(experiment, table)]
    return pd.concat(parts, ignore_index=True) if parts else pd.DataFrame(columns=list(columns))


def effects(values: Mapping, experiment: str) -> list[str]:
    """Return the effect that each scene of the study of physics leaves out, `none` first; values: all settings."""
    return [NONE, *values[experiment]["simulate"]["effects"]]


def rungs(rows: pd.DataFrame, experiment: str, name: str) -> pd.DataFrame:
    """Return the rows of an experiment's variants that are called `name`_<size>, with the column `name` of the sizes.

    rows: of the one table; sizes are text.
    """
    own = rows[(rows["experiment"] == experiment) & rows["variant"].str.startswith(f"{name}_")]
    return own.assign(**{name: own["variant"].str.removeprefix(f"{name}_")})


def ladders(rows: pd.DataFrame, experiment: str) -> pd.DataFrame:
    """Return the runs of an experiment's ladders, columns LADDER; rows: of the one table."""
    parts = [pd.DataFrame(columns=LADDER)]
    paper = facts(experiment).paper
    for family, (of, model, name, _, conditions) in FAMILIES.items():
        if of != experiment or paper is None:
            continue
        own = rungs(rows[rows["model"] == model], of, name)
        scores = own[own["metric"] == paper.metric]
        scores = scores[scores["condition"].isin(conditions or scores["condition"])]
        if len(scores):
            for cost in ("params", "macs"):
                known = own[own["metric"] == cost].set_index(["protocol", "variant", "seed"])["value"]
                scores = scores.join(known.astype(int).rename(cost), on=known.index.names)
            parts.append(scores.assign(family=family, size=pd.to_numeric(scores[name]))[list(LADDER)])
    return pd.concat(parts[1:] or parts, ignore_index=True)


def sizes(variants: Iterable[str], name: str) -> list[float]:
    """Return the sizes of the variants that are called `name`_<size>."""
    return [float(variant.removeprefix(f"{name}_")) for variant in variants if variant.startswith(f"{name}_")]


def protocol(experiment: str, condition: str) -> str:
    """Return the protocol of an experiment's ladders under which a condition is trained and tested."""
    family = next(each for each in FAMILIES.values() if each.experiment == experiment)
    return family.protocol.format(condition=condition)


def check(table: pd.DataFrame, path: Path, key: list[str], wanted: Iterable[tuple], made_by: str) -> None:
    """Raise InputError that names the first repeated or missing row; key: the columns whose values `wanted` lists.

    A row that `wanted` lacks is no error: the settings may have shrunk since the command `made_by` wrote `path`.
    """
    present = set(table[key].itertuples(index=False, name=None))
    repeated = table[key][table.duplicated(key)].itertuples(index=False, name=None)
    missing = (run for run in wanted if run not in present)
    for problem, runs in (("two rows", repeated), ("no row", missing)):
        if (run := next(runs, None)) is not None:
            words = ", ".join(f"{name} {value}" for name, value in zip(key, run, strict=True))
            raise InputError(f"{path}: {problem} for {words}; run `{made_by}` again")
