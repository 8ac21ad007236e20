"""Read how long predictions and trainings took that the evidence keeps: in each case on one class of machine.

Seconds of a core and of a card, or of two makes of processor, are no two values of one time: they are never mixed.
"""

from collections.abc import Collection, Iterable
from typing import NamedTuple

import pandas as pd

from pipeline.results import shards
from tactile.base import files
from tactile.base.errors import InputError
from tactile.base.paths import Workspace
from tactile.scoring.estimates import read_csv

LATENCY = "latency"  # the study, and its table
COLUMNS: tuple[str, ...] = ("experiment", "model", "batch", "threads", "p50_ms", "p50_low_ms", "p50_high_ms", "p95_ms")
COLUMNS += ("params", "macs", "train_s", "size_bytes", "calls")  # of latency.csv
MACHINE = "machine"  # column: the class of machine, as evidence/index.csv names it


def predictions(workspace: Workspace, experiment: str) -> pd.DataFrame:
    """Return the evidence's times of predictions, COLUMNS and MACHINE; without a row where none were measured.

    Raises InputError for a file that the index does not tell of, and where two classes of machine measured.
    """
    index, tables = shards.folder(workspace) / "index.csv", []
    kept = shards.table(index, shards.INDEX)
    machines = dict(zip(kept["sha256"], kept[MACHINE], strict=True))
    for path in workspace.study(experiment, LATENCY):
        if (digest := files.sha256(path)) not in machines:
            remedy = f"run `{shards.MADE_BY} {LATENCY}_{experiment}`"
            raise InputError(f"{path}: not a file that {index} tells of; {remedy}")
        tables.append(read_csv(path, COLUMNS, shards.MADE_BY).assign(**{MACHINE: machines[digest]}))
    together = pd.concat(tables or [pd.DataFrame(columns=[*COLUMNS, MACHINE])], ignore_index=True)
    one_machine(together[MACHINE], f"{index.parent / 'studies' / experiment}, table {LATENCY}")
    return together


def one_machine(names: Iterable[str], where: str) -> str:
    """Return the machine that times are of, empty where there are none. Raises InputError where they are of several."""
    machines = [name for name in dict.fromkeys(names) if name]
    if len(machines) > 1:
        raise InputError(f"{where}: times of {len(machines)} machines, which do not compare: {'; '.join(machines)}")
    return "".join(machines)


class Trainings(NamedTuple):
    """Trainings that one class of machine made; runs: model, protocol, seed, budget, epochs, train_s."""

    machine: str
    runs: pd.DataFrame
    epochs: pd.Series  # (protocol, model, budget) -> epochs of a training, on whatever machine

    def seconds(self, protocol: str, model: str, budget: str) -> list[float]:
        """Return how long each training would have taken at a budget; empty where none was made on this machine.

        Seconds per epoch are of the trainings at all budgets: another load while one of them ran says nothing about
        how long the other takes. A model without epochs takes what it took.
        """
        runs = self.runs[(self.runs["protocol"] == protocol) & (self.runs["model"] == model)]
        if runs.empty or (protocol, model, budget) not in self.epochs.index:
            return []
        return (runs["train_s"] / runs["epochs"] * self.epochs[protocol, model, budget]).tolist()


def trainings(workspace: Workspace, experiment: str, protocols: Collection[str]) -> Trainings:
    """Return the evidence's trainings of an experiment's models, as in its tables, on some protocols.

    Which machine: see `shards.timed_on`.
    """
    runs = shards.trainings(workspace)
    runs = runs[(runs["experiment"] == experiment) & runs["protocol"].isin(protocols)]
    if len(runs):
        varied = {name for name, each in shards.read_sets(workspace).items() if each.variant}
        runs = runs[~runs["shard"].str.rsplit("-", n=2).str[0].isin(varied)]
    machine = shards.timed_on(runs)
    epochs = runs.groupby(["protocol", "model", "budget"])["epochs"].max()
    return Trainings(machine, runs[runs[MACHINE] == machine], epochs)
