"""Measure what each change of the recipe gains: train by the present recipe with that change alone taken back.

Errors and core-seconds are those of speed-runs (runs.py). The networks are those that the change was made for, or the
CNN, whose three seeds cost as much as one of another network.
"""

import csv
import statistics
from collections.abc import Callable, Collection, Iterable, Mapping
from contextlib import AbstractContextManager, nullcontext
from functools import partial
from math import inf, sqrt
from pathlib import Path
from typing import NamedTuple
from unittest.mock import patch

import numpy as np
import torch
from benchmarks.speedruns import former, runs
from torch import nn
from tqdm import tqdm

from pipeline import models
from pipeline.base import files, workers
from pipeline.learning import regressors, training
from pipeline.learning.lomp_network import Lomp
from pipeline.learning.regressors import TorchRegressor
from pipeline.models import cnn, lomp_stream, vgg


class Change(NamedTuple):
    """What was changed, for which network it is measured with which seeds, and how it is taken back.

    `before()` is a context in which networks are built and trained as before the change; `settings` are put over the
    block `training`; `every_third`: only every third image of a session trains.
    """

    what: str
    network: str
    seeds: tuple[int, ...]
    before: Callable[[], AbstractContextManager] = nullcontext
    settings: Mapping = {}
    every_third: bool = False


class Gain(NamedTuple):
    """A row of the table: means over `runs` trainings by the present recipe, with and without a change."""

    network: str
    change: str
    runs: int
    unit: str
    error: float
    error_without: float
    core_seconds: float
    core_seconds_without: float


def labels_over_their_deviation() -> AbstractContextManager:
    """Divide labels by their standard deviation, not by the largest one."""
    fit, scale = TorchRegressor.fit, TorchRegressor._set_normalisation

    def fit_before(self, train: tuple, *others, **fitting) -> list[dict]:
        deviation = torch.tensor(np.std(train[1], dtype=np.float64), dtype=torch.float32)

        def scale_before(self, mean: torch.Tensor, spread: torch.Tensor, _: torch.Tensor) -> None:
            scale(self, mean, spread, deviation)

        with patch.object(TorchRegressor, "_set_normalisation", scale_before):
            return fit(self, train, *others, **fitting)

    return patch.object(TorchRegressor, "fit", fit_before)


def update_drawn_at_random() -> AbstractContextManager:
    """Draw P of LoMP as torch draws the weights of a linear layer."""
    begin = Lomp.__init__

    def begin_before(self, *arguments) -> None:
        begin(self, *arguments)
        bound = 1 / sqrt(self.hidden)
        with torch.no_grad():
            self.update.uniform_(-bound, bound)
            self.update_bias.uniform_(-bound, bound)

    return patch.object(Lomp, "__init__", begin_before)


def without_batch_normalisation() -> AbstractContextManager:
    """Build VGG-16 without batch normalisation."""
    return patch.object(vgg, "_network", partial(former.vgg, seed=0))


constant_rate = partial(patch.object, training, "rate_at", lambda done: 1.0)
usual_betas = partial(patch.object, regressors, "BETAS", (0.9, 0.999))

SCHEDULE = "the learning rate rises and falls to zero, not constant"
BETAS = "Adam averages squared gradients over 20 updates, not 1000"
PRODUCTS = "products in bfloat16, where the processor has them, not in float32"
ALL_SEEDS, ONE = runs.SEEDS, runs.SEEDS[:1]
IN_BFLOAT16 = {"cnn": ALL_SEEDS} | dict.fromkeys(("vgg", "convlstm", "lomp", "resnet18", "resnet3x3"), ONE)
CHANGES = (
    *(Change(PRODUCTS, network, seeds, settings={"precision": "float32"}) for network, seeds in IN_BFLOAT16.items()),
    Change(SCHEDULE, "cnn", ALL_SEEDS, constant_rate),
    Change(BETAS, "cnn", ALL_SEEDS, usual_betas),
    Change("labels over the largest one, not over their deviation", "cnn", ALL_SEEDS, labels_over_their_deviation),
    Change("an epoch has a quarter of the rest, not all", "cnn", ALL_SEEDS, settings={"rest_share": 1.0}),
    Change("the last layer starts at zero", "cnn", ALL_SEEDS, partial(patch.object, cnn, "zero_linear", nn.Linear)),
    Change("batch normalisation", "vgg", ONE, without_batch_normalisation),
    Change(SCHEDULE, "convlstm", ONE, constant_rate),
    Change(SCHEDULE, "lomp", ONE, constant_rate),
    Change(BETAS, "lomp", ONE, usual_betas),
    Change("P starts near the identity", "lomp", ONE, update_drawn_at_random),
    Change("messages start at 0.3 of their size", "lomp_stream", ONE, partial(patch.object, lomp_stream, "QUIET", 1.0)),
    Change(
        "the gradient is cut to a norm of 0.001",
        "lomp_stream",
        ONE,
        partial(patch.object, lomp_stream.StreamingLomp, "largest_gradient", inf),
    ),
    Change(SCHEDULE, "sp_resnet", ONE, constant_rate),
    Change("all images, not every third in three times the epochs", "sp_resnet", ONE, every_third=True),
)


def train(
    path: Path, values: Mapping, experiment: str, number: int, protocol: str, seed: int, report: Callable | None = None
) -> runs.Run:
    """Train the network of a change, by its number in CHANGES, without that change.

    path: the experiment's dataset; values: params.yaml. `report` is for pipeline.base.workers and not called: it is the
    number that goes to another process, as a change cannot be pickled.
    """
    change = CHANGES[number]
    block, name = values[experiment]["models"][change.network], f"{experiment}.models.{change.network}"
    schedule, rows = block["training"] | dict(change.settings), None
    if change.every_third:
        rows = runs.every_third(path, protocol, seed)
        schedule["epochs"] *= runs.TRAIN_EVERY
    block = block | {"training": schedule}
    with change.before():
        measured = runs.clock(
            path, values, experiment, lambda spec: models.build(change.network, spec, block, name), protocol, seed, rows
        )
    return runs.Run(change.network, change.what, protocol, seed, *measured, runs.UNITS[experiment])


def train_all(
    path: Path, values: Mapping, experiment: str, network: str, seeds: Collection[int] = runs.SEEDS
) -> list[runs.Run]:
    """Train a network without each of its changes in turn, with those of its seeds that are among `seeds`.

    A Run's `recipe` is what was changed.
    """
    numbers = [number for number, change in enumerate(CHANGES) if change.network == network]
    given = {
        (number, protocol, seed): (path, values, experiment, number, protocol, seed)
        for number in numbers
        for protocol in runs.PROTOCOLS[experiment]
        for seed in CHANGES[number].seeds
        if seed in seeds
    }
    with tqdm(total=len(given), desc=f"changes of {network}", unit="training") as bar:
        made = dict(workers.run(train, given, bar))
    return [made[key] for key in given]


def gains(without: Iterable[runs.Run], present: Iterable[runs.Run]) -> list[Gain]:
    """Return a row per change of one network; present: runs by the whole recipe, among them those of the same seeds."""
    whole = {(run.protocol, run.seed): run for run in present if run.recipe == runs.PRESENT}
    by_change: dict[str, list[runs.Run]] = {}
    for run in without:
        by_change.setdefault(run.recipe, []).append(run)
    table = []
    for change, trained in by_change.items():
        pairs = [(whole[run.protocol, run.seed], run) for run in trained]
        means = [
            statistics.fmean(getattr(pair[k], figure) for pair in pairs)
            for figure in ("validation_error", "core_seconds")
            for k in (0, 1)
        ]
        table.append(Gain(trained[0].network, change, len(pairs), trained[0].unit, *means))
    return table


def write(path: Path, rows: Iterable[Gain]) -> None:
    """Write rows into the table of earlier ones, in the place of the same networks', in the order of CHANGES."""
    rows, kept = list(rows), []
    if path.exists():
        with open(path, newline="", encoding="utf-8") as file:
            made = {row.network for row in rows}
            kept = [Gain(*line.values()) for line in csv.DictReader(file) if line["network"] not in made]
    order = list(runs.LEAST)
    files.write_csv(path, Gain._fields, sorted(rows + kept, key=lambda row: order.index(row.network)))
