"""Make speed-runs: how many core-seconds and updates a network needs to be as good as by the former recipe.

The target of a network is its validation error by the former recipe (former.py), trained to its end, mean over seeds
and protocols: of touch the RMSE in kPa, of the glove the cross-entropy in nats. The former recipe's cost is that of its
whole training: up to the epoch that it kept, and its patience. The recipe of params.yaml has a set number of epochs and
is only good at its end: its cost is that of all of them, or of a training with the fewer epochs of ENOUGH, for networks
that reach the target sooner. It reaches the target where its mean error is at most 1 + TOLERANCE times the target.
Core-seconds are the processor time of `fit` in a process of one thread, validation
included, reading the dataset not.
"""

import csv
import math
import statistics
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

import numpy as np
import torch
from benchmarks.measure import shortened, warm_up
from benchmarks.speedruns import former
from torch.optim.optimizer import register_optimizer_step_post_hook
from tqdm import tqdm

from pipeline import models, tasks
from pipeline.base import files, params, paths, workers
from pipeline.datasets import schemas
from pipeline.experiments import glove

FORMER, PRESENT, SHORTENED = "former", "present", "shortened"  # recipes; the last: the present one, epochs of ENOUGH
PROTOCOLS = {"touch": ("press",), "glove": ("session_pressure", "session_combined")}
UNITS = {"touch": "kPa", "glove": "nats"}
SEEDS = (0, 1, 2)
TOLERANCE = 0.01  # of the error; seeds of touch's networks differ by 2 to 17 % of theirs (standard deviation)
TRAIN_EVERY = 3  # the former recipe trained on every third image of a session
SMALLEST_PROBABILITY = float(np.finfo(np.float32).tiny)
LEAST = {  # networks of the tables, and how many times fewer core-seconds each must need; None: no target
    "cnn": None,
    "vgg": 2.0,
    "convlstm": 2.0,
    "rnn": None,
    "lomp": 3.0,
    "lomp_stream": 3.0,
    "resnet18": 2.0,
    "mobilenet": None,
    "resnet3x3": None,
    "sp_resnet_nogcam": None,
    "sp_resnet": 2.0,
}
LEAST_MEAN = 2.5
# Epochs after which networks are as good as by the former recipe; those of params.yaml lead further down.
ENOUGH = {"cnn": 13, "vgg": 4, "convlstm": 17, "rnn": 9, "resnet3x3": 6, "sp_resnet_nogcam": 5}


class Run(NamedTuple):
    """One training. `epochs` and `updates` (steps of the optimiser) are those that were run."""

    network: str
    recipe: str
    protocol: str
    seed: int
    epochs: int
    updates: int
    core_seconds: float
    validation_error: float
    unit: str


class Outcome(NamedTuple):
    """What the runs of a network say, each figure a mean over its seeds and protocols.

    `error`, `core_seconds` and `updates` are of the shortened recipe where there is one, else of the present one.
    """

    target: float
    error: float
    reached: bool
    former_core_seconds: float
    core_seconds: float
    former_updates: float
    updates: float
    present_error: float
    unit: str
    runs: int  # of one recipe

    @property
    def ratio(self) -> float:
        """How many times fewer core-seconds the present recipe needs; 0 where it does not reach the target."""
        return self.trained_ratio if self.reached else 0.0

    @property
    def trained_ratio(self) -> float:
        """Ratio of the core-seconds of both trainings, the target reached or not."""
        return self.former_core_seconds / self.core_seconds


@contextmanager
def steps_timed() -> Iterator[list[float]]:
    """Give the block a list, to which every optimiser's step adds the processor time of this process, in s."""
    times: list[float] = []
    hook = register_optimizer_step_post_hook(lambda *_: times.append(time.process_time()))
    try:
        yield times
    finally:
        hook.remove()


class Clocked:
    """A model whose `fit` is clocked and whose error on the validation part is measured after it.

    rows: the training rows that it sees, None for all.
    """

    def __init__(self, model, rows: np.ndarray | None = None):
        self.model, self.rows, self.streams = model, rows, model.streams

    def fit(self, train: tuple, validation: tuple, **fitting) -> list[dict]:
        """Fit the model as it does itself; then `core_seconds`, `updates` and `error` (see `error_of`) are known."""
        if self.rows is not None:
            train = tuple(part[self.rows] for part in train)
        with steps_timed() as steps:
            began = time.process_time()
            history = self.model.fit(train, validation, **fitting)
            self.core_seconds, self.updates = time.process_time() - began, len(steps)
        self.error = error_of(self.model, validation)
        return history


def error_of(model, part: tuple) -> float:
    """Return the RMSE of predicted maps, or the mean cross-entropy in nats of probabilities of classes.

    part: (x, y) or (x, y, previous); y one-hot for classes, x then (n, 1, pixels).
    """
    x, y, *rest = part
    predicted = model.predict(x, *rest).astype(np.float64)
    if one_hot(y):
        return float(-np.mean(np.log(np.maximum(predicted[y > 0], SMALLEST_PROBABILITY))))
    return float(np.sqrt(np.mean((predicted - y) ** 2)))


def one_hot(y: np.ndarray) -> bool:
    """Whether labels (n, outputs) are of classes."""
    return bool(np.all((y == 0) | (y == 1)) and np.all(y.sum(1) == 1))


def every_third(path: Path, protocol: str, seed: int) -> np.ndarray:
    """Return which training images of a run the former recipe saw, as numbers within the training part.

    They are every third place of each session. path: the glove's dataset.
    """
    column = schemas.split_column(protocol, seed)
    table = schemas.read(path, columns=["condition", "recording", column])
    places = glove.places(table)[schemas.names(table[column]) == "train"]
    return np.flatnonzero(places % TRAIN_EVERY == 0)


def train(
    path: Path,
    values: Mapping,
    experiment: str,
    network: str,
    block: Mapping,
    recipe: str,
    protocol: str,
    seed: int,
    report: Callable | None = None,
) -> Run:
    """Train a network by a recipe in whatever process this is.

    path: the experiment's dataset; values: params.yaml; block: the network's block in former.yaml. `report` is for
    pipeline.base.workers and not called.
    """
    present = values[experiment]["models"][network]
    if recipe == SHORTENED:
        present = shortened(present, min(ENOUGH[network], present["training"]["epochs"]))

    def build(spec):
        if recipe == FORMER:
            return former.build(network, spec, block, present)
        return models.build(network, spec, present, f"{experiment}.models.{network}")

    rows = every_third(path, protocol, seed) if recipe == FORMER and experiment == "glove" else None
    measured = clock(path, values, experiment, build, protocol, seed, rows)
    return Run(network, recipe, protocol, seed, *measured, UNITS[experiment])


def clock(
    path: Path,
    values: Mapping,
    experiment: str,
    build: Callable,
    protocol: str,
    seed: int,
    rows: np.ndarray | None = None,
) -> tuple[int, int, float, float]:
    """Train what `build(spec)` returns; return epochs, updates, core-seconds and the validation error, as in Run.

    rows: as of Clocked. Raises RuntimeError where no optimiser of torch made a step.
    """
    torch.set_num_threads(1)
    warm_up()
    clocked: list[Clocked] = []

    def build_clocked(spec) -> Clocked:
        clocked.append(Clocked(build(spec), rows))
        return clocked[-1]

    place = path, experiment, values[experiment], protocol, seed
    fitted = tasks.of(experiment).fit(*place, build_clocked, device="cpu", progress=None, base=None)
    (timed,) = clocked
    if not timed.updates:
        raise RuntimeError(f"{experiment}, {protocol}: no optimiser of torch made a step; count its updates anew")
    return len(fitted.history), timed.updates, timed.core_seconds, timed.error


def train_all(
    path: Path, values: Mapping, experiment: str, network: str, seeds: Iterable[int], blocks: Mapping | None = None
) -> list[Run]:
    """Train a network by all recipes in turn, for every seed and protocol, one-thread processes on all cores.

    path: the experiment's dataset; blocks: as former.yaml, which stands for None.
    """
    block = (blocks or former.settings())[experiment][network]
    given = {
        (protocol, seed, recipe): (path, values, experiment, network, block, recipe, protocol, seed)
        for protocol in PROTOCOLS[experiment]
        for seed in seeds
        for recipe in (FORMER, PRESENT, *([SHORTENED] if network in ENOUGH else []))
    }
    with tqdm(total=len(given), desc=f"speed-runs {network}", unit="training") as bar:
        made = dict(workers.run(train, given, bar))
    return [made[key] for key in given]


def outcome(runs: Iterable[Run]) -> Outcome:
    """Return what the runs of one network say."""
    runs = list(runs)
    quickest = SHORTENED if any(run.recipe == SHORTENED for run in runs) else PRESENT

    def mean(recipe: str, figure: str) -> float:
        return statistics.fmean(getattr(run, figure) for run in runs if run.recipe == recipe)

    target, error, whole = (mean(recipe, "validation_error") for recipe in (FORMER, quickest, PRESENT))
    reached = error <= (1 + TOLERANCE) * target
    costs = (mean(recipe, figure) for figure in ("core_seconds", "updates") for recipe in (FORMER, quickest))
    return Outcome(target, error, reached, *costs, whole, runs[0].unit, sum(run.recipe == quickest for run in runs))


def figures(network: str, runs: Iterable[Run]) -> dict:
    """Return the row of benchmarks.csv of one network: core-seconds to the target, infinite where it is not reached."""
    means = outcome(runs)
    said = f"{means.error:.4g} in {means.updates:.0f} updates"
    if not means.reached:
        said += f" and {means.core_seconds:.4g} core-s: not reached"
    if network in ENOUGH:
        said += f", {means.present_error:.4g} with the epochs of params.yaml"
    target = f"validation error of {means.target:.4g} {means.unit} that the former recipe ends with"
    return {
        "what": f"{network}, training to the {target}: {said}; mean of {means.runs} runs",
        "peer_is": f"the former recipe, {means.former_updates:.0f} updates",
        "unit": "core-s",
        "ours": means.core_seconds if means.reached else math.inf,
        "peer": means.former_core_seconds,
        "least_ratio": LEAST[network],
        "rounds": means.runs,
    }


def mean_figures(runs: Iterable[Run]) -> dict:
    """Return the row of benchmarks.csv of all networks: the geometric mean of the ratios, 0 where a target is missed.

    ours is 1 over that mean, so that the row's ratio is the mean.
    """
    by_network: dict[str, list[Run]] = {}
    for run in runs:
        by_network.setdefault(run.network, []).append(run)
    outcomes = [outcome(own) for own in by_network.values()]
    reached = sum(each.reached for each in outcomes)
    trained = statistics.geometric_mean([each.trained_ratio for each in outcomes])
    share = 1 / trained if reached == len(outcomes) else math.inf
    missed = "" if reached == len(outcomes) else f" (without regard to that, {trained:.3g} times fewer core-seconds)"
    return {
        "what": f"core-seconds of a training, geometric mean; {reached} of {len(outcomes)} reach their target{missed}",
        "peer_is": "the former recipe",
        "unit": "of the former",
        "ours": share,
        "peer": 1.0,
        "least_ratio": LEAST_MEAN,
        "rounds": outcomes[0].runs,
    }


def write(path: Path, runs: Iterable[Run]) -> None:
    """Write the runs, in the order of LEAST, into a table of earlier ones, in the place of the same networks'."""
    runs = list(runs)
    made = {run.network for run in runs}
    runs += [run for run in read(path) if run.network not in made]
    order = list(LEAST)
    files.write_csv(path, Run._fields, sorted(runs, key=lambda run: order.index(run.network)))


def read(path: Path) -> list[Run]:
    """Return the runs of a table that `write` wrote; none where there is no table."""
    if not path.exists():
        return []
    kinds = Run.__annotations__
    with open(path, newline="", encoding="utf-8") as file:
        return [Run(**{name: kinds[name](value) for name, value in row.items()}) for row in csv.DictReader(file)]


def brief(values: dict) -> tuple[dict, dict]:
    """Return params.yaml and former.yaml with trainings of two epochs, to try the code."""
    values, blocks = dict(values), former.settings()
    for experiment, networks in blocks.items():
        present = values[experiment]["models"]
        values[experiment] = values[experiment] | {
            "models": present | {name: shortened(present[name], 2) for name in networks}
        }
        blocks[experiment] = {name: shortened(block, 2) for name, block in networks.items()}
    return values, blocks


def missing(experiment: str, network: str, path: Path, values: Mapping) -> str:
    """Say what is missing for the speed-runs of a network; empty where nothing is."""
    if not path.exists():
        return f"{paths.shown(path)} is not there: run `dvc repro dataset@{experiment}` first"
    if network not in values[experiment]["models"]:
        return f"params.yaml, {experiment}.models: no {network}"
    wanted = [(protocol, seed) for protocol in PROTOCOLS[experiment] for seed in SEEDS]
    absent = set(wanted) - set(params.runs(values, experiment))
    return f"params.yaml, {experiment}.protocols: no run {sorted(absent)[0]}" if absent else ""
