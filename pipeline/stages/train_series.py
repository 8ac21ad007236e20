"""Stage: train one model of an experiment on series, for every protocol and seed. Scoring is `evaluate`.

As `train`, but a model sees whole recordings, and transfer starts from model-0, which has to be trained first.
Usage: python -m pipeline.stages.train_series strain|strain_recorded MODEL|model_zero
"""

import csv
import shutil
import sys
import time
from collections.abc import Callable, Mapping
from pathlib import Path

from pipeline.base import params, paths, runs
from pipeline.base.errors import InputError, run_stage
from pipeline.datasets import series


def train_run(
    values: Mapping, experiment: str, model: str, protocol: str, seed: int, target: Path, report: Callable[..., None]
) -> float:
    """Train one run of params.yaml (`values`) and write its files (see `runs.save`); return the seconds of fitting."""
    settings = values[experiment]
    base = params.experiment_module(experiment).task(protocol, settings).base
    zero = paths.run_folder(experiment, paths.MODEL_ZERO, base, seed)
    if model == settings["model_zero"] and base == protocol:
        shutil.copytree(zero, target)
        return _seconds_of_model_zero(experiment, protocol, seed)
    return _train(values, experiment, model, protocol, seed, target, report, zero)


def model_zero_run(
    values: Mapping, experiment: str, model: str, protocol: str, seed: int, target: Path, report: Callable[..., None]
) -> float:
    """As `train_run`, for the network that transfer starts from (section III-B)."""
    return _train(values, experiment, model, protocol, seed, target, report, None)


def _train(
    values: Mapping,
    experiment: str,
    model: str,
    protocol: str,
    seed: int,
    target: Path,
    report: Callable,
    zero: Path | None,
) -> float:
    import torch

    from pipeline.learning import series_regressors

    torch.set_num_threads(1)
    settings = values[experiment]
    task = params.experiment_module(experiment).task(protocol, settings)
    block = params.model_settings(values, experiment, model)
    spec = series_regressors.spec_of(task, settings["window"]["frames"])
    regressor = series_regressors.adapted(params.build_model(model, spec, block, f"{experiment}.models.{model}"), spec)
    records = series.seen_in_training(series.read(paths.dataset(experiment), task, protocol, seed))
    if not any(record.training.any() for record in records):
        raise InputError(f"{experiment}, {protocol}: no sample in the training part; record longer")
    started = time.perf_counter()
    history = regressor.fit(records, seed=seed, device=values["device"], progress=report, base=zero)
    seconds = time.perf_counter() - started
    runs.save(target, regressor, history, block)
    return seconds


def _seconds_of_model_zero(experiment: str, protocol: str, seed: int) -> float:
    path = paths.training_times(experiment, paths.MODEL_ZERO)
    made_by = params.training_command(experiment, paths.MODEL_ZERO)
    with open(paths.require(path, made_by), newline="", encoding="ascii") as file:
        times = {(row["protocol"], row["seed"]): float(row["train_s"]) for row in csv.DictReader(file)}
    return times[protocol, str(seed)]


def main() -> None:
    """Train the model named on the command line, or model-0 for all protocols that need one."""
    values = params.load()
    experiment, model = params.training_arguments(sys.argv, "train_series", values, f"MODEL|{paths.MODEL_ZERO}")
    if model != paths.MODEL_ZERO:
        runs.train_all(train_run, values, experiment, model)
        return
    settings, module = values[experiment], params.experiment_module(experiment)
    bases = {module.task(protocol, settings).base for protocol in settings["protocols"]}
    runs.train_all(model_zero_run, values, experiment, settings["model_zero"], into=model, protocols=bases)


if __name__ == "__main__":
    run_stage(main)
