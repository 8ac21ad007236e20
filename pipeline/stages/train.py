"""Stage: train one model for every protocol and seed of an experiment. Writes models; scoring is `evaluate`.

The runs are independent: they go to as many processes as there are cores (WORKERS=n for another number), each
with one thread, which gives the same numbers whatever the number of processes.
Usage: python -m pipeline.stages.train touch|velostat_recorded MODEL
"""

import sys
import time
from collections.abc import Callable, Mapping
from pathlib import Path

from pipeline.base import params, paths, runs
from pipeline.base.errors import InputError, run_stage
from pipeline.datasets.windows import read_dataset


def train_run(
    values: Mapping, experiment: str, model: str, protocol: str, seed: int, target: Path, report: Callable[..., None]
) -> float:
    """Train one run of params.yaml (`values`) and write its files (see `runs.save`); return the seconds of fitting."""
    import torch

    from pipeline.learning.regressors import Spec

    torch.set_num_threads(1)
    settings = values[experiment]
    spec = Spec(*params.shapes(settings))
    block = params.model_settings(values, experiment, model)
    regressor = params.build_model(model, spec, block, f"{experiment}.models.{model}")
    data = read_dataset(paths.dataset(experiment), spec.frames)
    part = data.part(protocol, seed)
    train, validation = (data.windows(part == name, regressor.streams) for name in ("train", "validation"))
    for name, windows in (("train", train), ("validation", validation)):
        if not len(windows[0]):
            raise InputError(
                f"{experiment}, {protocol} split, seed {seed}: no window in the {name} part; record more presses"
            )
    del data
    started = time.perf_counter()
    history = regressor.fit(train, validation, seed=seed, device=values["device"], progress=report)
    seconds = time.perf_counter() - started
    runs.save(target, regressor, history, block)
    return seconds


def main() -> None:
    """Train the model named on the command line."""
    values = params.load()
    runs.train_all(train_run, values, *params.training_arguments(sys.argv, "train", values))


if __name__ == "__main__":
    run_stage(main)
