"""Stage: train one model of an experiment on images, for every protocol and seed. Scoring is `evaluate`.

As `train`, but a protocol names the images that a model sees: pressure, strain or both.
Usage: python -m pipeline.stages.train_images glove|glove_recorded MODEL
"""

import sys
import time
from collections.abc import Callable, Mapping
from pathlib import Path

from pipeline.base import params, paths, runs
from pipeline.base.errors import run_stage
from pipeline.datasets import images


def train_run(
    values: Mapping, experiment: str, model: str, protocol: str, seed: int, target: Path, report: Callable[..., None]
) -> float:
    """Train one run of params.yaml (`values`) and write its files (see `runs.save`); return the seconds of fitting."""
    import torch

    from pipeline.learning.image_classifier import spec_of

    torch.set_num_threads(1)
    block = params.model_settings(values, experiment, model)
    data = images.read(paths.dataset(experiment), protocol, seed)
    spec = spec_of(len(data.objects))
    classifier = params.build_model(model, spec, block, f"{experiment}.models.{model}")
    train, validation = ((data.x[data.part == name], data.y[data.part == name]) for name in ("train", "validation"))
    del data
    started = time.perf_counter()
    history = classifier.fit(train, validation, seed=seed, device=values["device"], progress=report)
    seconds = time.perf_counter() - started
    runs.save(target, classifier, history, block)
    return seconds


def main() -> None:
    """Train the model named on the command line."""
    values = params.load()
    runs.train_all(train_run, values, *params.training_arguments(sys.argv, "train_images", values))


if __name__ == "__main__":
    run_stage(main)
