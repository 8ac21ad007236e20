"""What the papers' scale would cost now: core-hours of every network's trainings, from updates that are timed here.

Counted are the trainings of the tables' networks, all protocols and seeds, with scales/paper.yaml over params.yaml;
not the ablations, the augmentation, the ladders of sizes, the stress tests, nor models without epochs.
"""

import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

import numpy as np
import torch
from torch.optim.optimizer import register_optimizer_step_post_hook
from tqdm import tqdm

from benchmarks.measure import shortened, warm_up
from pipeline import models
from pipeline.base import files, params, workers
from pipeline.learning import image_classifier
from pipeline.scenes.glove import OBJECTS
from pipeline.tasks import windows

EXPERIMENTS = ("touch", "glove")
TOUCH_WINDOWS_PER_PRESS = 33.1  # one every 5 frames of a press and the rest beside it: 66,152 of 2000 presses
TOUCHED = 0.753  # of the training windows of the laptop scale, which lie every 40 frames of the same recordings
CHAIN = 4  # windows of a press that follow one another without overlap, as at paper scale


class Cost(NamedTuple):
    """What one network's trainings take at paper scale; an epoch has `rows` windows or images, of rest those it draws.

    epochs: of all runs together.
    """

    experiment: str
    network: str
    rows: int
    runs: int
    epochs: int
    ms_per_row: float
    core_hours: float


def training_rows(values: Mapping, experiment: str, network: str) -> int:
    """Return the number of training windows or images of an epoch; values: as of params.yaml."""
    settings = values[experiment]
    if experiment == "touch":
        single = settings["simulate"]["single"]
        presses = single["points_per_side"] ** 2 * single["depths"] * single["repetitions"]
        rest_share = settings["models"][network]["training"].get("rest_share", 1.0)
        seen = TOUCHED + rest_share * (1 - TOUCHED)
        return round(settings["split"]["train"] * TOUCH_WINDOWS_PER_PRESS * presses * seen)
    frames = len(OBJECTS) * settings["simulate"]["frames_per_object"]
    return round(settings["split"]["train"] * frames / settings["window"]["stride"])


def networks(values: Mapping, experiment: str) -> list[str]:
    """Return the models of an experiment that train in epochs."""
    return [name for name, block in values[experiment]["models"].items() if "training" in block]


@contextmanager
def steps_timed() -> Iterator[list[float]]:
    """Give the block a list, to which every optimiser's step adds the processor time of this process, in s."""
    times: list[float] = []
    hook = register_optimizer_step_post_hook(lambda *_: times.append(time.process_time()))
    try:
        yield times
    finally:
        hook.remove()


def seconds_per_row(
    values: Mapping, experiment: str, network: str, updates: int, report: Callable | None = None
) -> float:
    """Return the processor time in s that an epoch takes per training window or image, its validation included.

    It is that of the second of two epochs of `updates` updates on noise, of which the time does not depend, from the
    first epoch's last step to its own. `report` is for pipeline.base.workers and not called.
    """
    torch.set_num_threads(1)
    warm_up()
    block = shortened(values[experiment]["models"][network], 2)
    rows = updates * block["training"]["batch_size"]
    spec = windows.spec(values["touch"]) if experiment == "touch" else image_classifier.spec_of(len(OBJECTS))
    model = models.build(network, spec, block, f"{experiment}.models.{network}")
    split = values[experiment]["split"]
    parts = [noise(spec, n, model.streams) for n in (rows, round(rows * split["validation"] / split["train"]))]
    with steps_timed() as steps:
        model.fit(*parts, seed=0, device="cpu")
    an_epoch = len(steps) // 2
    return (steps[-1] - steps[an_epoch - 1]) / rows


def noise(spec, rows: int, streams: bool) -> tuple[np.ndarray, ...]:
    """Return windows or images and labels, of streams with `previous`, in chains of CHAIN."""
    rng, rows = np.random.default_rng(0), -(-rows // CHAIN) * CHAIN
    x = rng.uniform(0, 255, (rows, spec.frames, spec.elements)).astype(np.float32)
    if spec.map_rows == 1:
        y = np.eye(spec.outputs, dtype=np.float32)[rng.integers(0, spec.outputs, rows)]
    else:
        y = rng.uniform(0, 100, (rows, spec.outputs)).astype(np.float32)
    numbers = np.arange(rows)
    return (x, y, np.where(numbers % CHAIN, numbers - 1, -1)) if streams else (x, y)


def costs(values: Mapping, experiment: str, updates: int) -> list[Cost]:
    """Return the cost of each network of an experiment, timed in one-thread processes on all cores."""
    given = {name: (values, experiment, name, updates) for name in networks(values, experiment)}
    with tqdm(total=len(given), desc=f"scale cost {experiment}", unit="network") as bar:
        seconds = dict(workers.run(seconds_per_row, given, bar))
    return [cost(values, experiment, name, seconds[name]) for name in given]


def cost(values: Mapping, experiment: str, network: str, seconds: float) -> Cost:
    """Return the cost of a network whose training takes so many seconds per row and epoch."""
    rows, runs = training_rows(values, experiment, network), params.runs(values, experiment)
    epochs = sum(params.epochs(params.run_settings(values, experiment, network, protocol)) for protocol, _ in runs)
    return Cost(experiment, network, rows, len(runs), epochs, seconds * 1e3, seconds * rows * epochs / 3600)


def write(path: Path, table: Iterable[Cost]) -> None:
    """Write the costs as CSV."""
    files.write_csv(path, Cost._fields, table)
