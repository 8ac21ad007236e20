"""Stage: train one model for every protocol and seed of an experiment. Writes models; scoring is `evaluate`.

The runs are independent: they go to as many processes as there are cores (WORKERS=n for another number), each
with one thread, which gives the same numbers whatever the number of processes.
`model_zero` in place of a model trains the networks that transfer learning starts from (strain); they come first.
Usage: python -m pipeline.stages.train EXPERIMENT MODEL|model_zero
"""

import csv
import shutil
from collections.abc import Callable, Mapping
from pathlib import Path

from pipeline import models, tasks
from pipeline.base import arguments, params, paths, runs
from pipeline.base.errors import InputError, run_stage


def train_run(
    values: Mapping, experiment: str, model: str, protocol: str, seed: int, target: Path, report: Callable[..., None]
) -> float:
    """Train one run of params.yaml (`values`) and write its files (see `Fitted.save`); return the seconds of fitting.

    A run that is the very network which transfer starts from is copied, not trained twice.
    """
    settings = values[experiment]
    base = tasks.of(experiment).base(experiment, settings, protocol)
    zero = paths.run_folder(experiment, paths.MODEL_ZERO, base, seed) if base else None
    if base == protocol and model == settings["model_zero"]:
        shutil.copytree(zero, target)
        return _seconds_of_model_zero(experiment, protocol, seed)
    return _train(values, experiment, model, protocol, seed, target, report, zero)


def model_zero_run(
    values: Mapping, experiment: str, model: str, protocol: str, seed: int, target: Path, report: Callable[..., None]
) -> float:
    """Train one network that transfer starts from (section III-B of the latent-space paper); as `train_run`."""
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

    torch.set_num_threads(1)
    block = params.model_settings(values, experiment, model)

    def build(spec):
        return models.build(model, spec, block, f"{experiment}.models.{model}")

    place = paths.dataset(experiment), experiment, values[experiment], protocol, seed
    fitted = tasks.of(experiment).fit(*place, build, device=values["device"], progress=report, base=zero)
    fitted.save(target, block)
    return fitted.seconds


def _seconds_of_model_zero(experiment: str, protocol: str, seed: int) -> float:
    path = paths.training_times(experiment, paths.MODEL_ZERO)
    made_by = params.training_command(experiment, paths.MODEL_ZERO)
    with open(paths.require(path, made_by), newline="", encoding="ascii") as file:
        times = {(row["protocol"], row["seed"]): float(row["train_s"]) for row in csv.DictReader(file)}
    return times[protocol, str(seed)]


def main() -> None:
    """Train the model named on the command line, or model-0 for all protocols that need one.

    The model may also be given as DVC's name of the stage, `train_touch@lomp`: DVC hands it over in the variable
    DVC_STAGE, and so nothing that params.yaml says is ever part of a shell command.
    """
    values = params.load()
    given = arguments.parse(__doc__, experiment=values["experiments"], model=None)
    experiment, model = given.experiment, given.model.rpartition("@")[2]
    if model != paths.MODEL_ZERO:
        runs.train_all(train_run, values, experiment, model)
        return
    settings = values[experiment]
    bases = {tasks.of(experiment).base(experiment, settings, protocol) for protocol in settings["protocols"]} - {None}
    if not bases:
        raise InputError(f"{experiment}: no model starts from another network; name a model of params.yaml")
    runs.train_all(model_zero_run, values, experiment, settings["model_zero"], into=model, protocols=bases)


if __name__ == "__main__":
    run_stage(main)
