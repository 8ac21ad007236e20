"""Stage: train the models of an experiment, every protocol and seed. Writes models; scoring is `evaluate`.

Only what is made from something else than before is trained: other settings of the model, other data, other code that
it imports. To train a model again all the same, remove its folder in data/EXPERIMENT/models first.
The runs are independent: they go to as many processes as there are cores (WORKERS=n for another number), each
with one thread, which gives the same numbers whatever the number of processes. The networks that transfer learning
starts from (strain) come first, into the folder `model_zero`.
Usage: python -m tactile.stages.train EXPERIMENT
"""

import csv
import shutil
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from tactile import models, tasks
from tactile.base import arguments, imports, params, paths, runs
from tactile.base.paths import Workspace

# What a training reads of an experiment's block in params.yaml beside the model's own, by the kind of input.
READ = {
    "windows": ("budget", "label", "protocols", "sensor", "window"),
    "series": ("budget", "model_zero", "protocols", "sensor", "window"),
    "images": ("budget", "protocols"),
}
OF_READINGS = ("ingest", "sensor", "simulate", "source", "window")  # and further with faults: the levels of readings


def train_run(
    workspace: Workspace,
    values: Mapping,
    experiment: str,
    model: str,
    protocol: str,
    seed: int,
    target: Path,
    report: Callable[..., None],
) -> float:
    """Train one run of params.yaml (`values`) and write its files (see `Fitted.save`); return the seconds of fitting.

    `model`: a key of params.yaml, or MODEL_ZERO for the network that transfer starts from (section III-B of the
    latent-space paper). A run that is this very network is copied, not trained twice.
    """
    settings, zero = values[experiment], None
    base = tasks.of(experiment).base(experiment, settings, protocol)
    if base == protocol and model == settings["model_zero"]:
        shutil.copytree(workspace.run_folder(experiment, paths.MODEL_ZERO, base, seed), target)
        return _seconds_of_model_zero(workspace, experiment, protocol, seed)
    if model == paths.MODEL_ZERO:
        model = settings["model_zero"]
    elif base and params.transfers(model):
        zero = workspace.run_folder(experiment, paths.MODEL_ZERO, base, seed)
    return _train(workspace, values, experiment, model, protocol, seed, target, report, zero)


def _train(
    workspace: Workspace,
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
    block = params.run_settings(values, experiment, model, protocol)

    def build(spec: Any) -> Any:
        return models.build(model, spec, block, f"{experiment}.models.{model}")

    place = workspace.dataset(experiment), experiment, values[experiment], protocol, seed
    fitted = tasks.of(experiment).fit(*place, build, device=values["device"], progress=report, base=zero)
    fitted.save(target, block)
    return fitted.seconds


def _seconds_of_model_zero(workspace: Workspace, experiment: str, protocol: str, seed: int) -> float:
    path = workspace.training_times(experiment, paths.MODEL_ZERO)
    with open(paths.require(path, params.training_command(experiment)), newline="", encoding="ascii") as file:
        times = {(row["protocol"], row["seed"]): float(row["train_s"]) for row in csv.DictReader(file)}
    return times[protocol, str(seed)]


def code(experiment: str, model: str) -> list[str]:
    """Return the files of code that decide what a model's runs become, sorted: those of dvc.yaml's deps it imports."""
    kind = tasks.kind(experiment)
    names = {"experiments": experiment, "models": model, "tasks": kind}
    behind = {f"tactile/{room}": [f"tactile/{room}/{name}.py"] for room, name in names.items()}
    unused = {("tactile/experiments", "tactile/logs"), ("tactile/tasks", "tactile/scoring")}
    if kind != "series":  # of the experiment's file only KIND is read, unless images have faults, see `_origin`
        unused.add(("tactile/tasks", "tactile/experiments"))
    files = imports.closure("tactile/stages/train.py", behind, unused)
    return sorted(file for file in files if imports.room(file) not in imports.NO_NUMBER)


def read_settings(values: Mapping, experiment: str) -> list[str]:
    """Return the keys of an experiment's block that a training reads beside `models`."""
    return [key for key in READ[tasks.kind(experiment)] if key in values[experiment]]


def _origin(workspace: Workspace, values: Mapping, experiment: str, model: str) -> str:
    """Return the digest of all that the runs of a model, or of MODEL_ZERO, are made from."""
    settings = [values["device"], params.model_settings(values, experiment, model)]
    settings += [[key, values[experiment][key]] for key in read_settings(values, experiment)]
    inputs = [paths.require(workspace.dataset(experiment), f"python -m tactile.stages.dataset {experiment}")]
    if model == paths.MODEL_ZERO:
        model = values[experiment]["model_zero"]
    elif params.transfers(model):
        inputs += sorted(workspace.model_folder(experiment, paths.MODEL_ZERO).rglob("*.safetensors"))
    inputs += [paths.CODE.parent / file for file in code(experiment, model)]
    if "faults" in params.model_settings(values, experiment, model).get("training", {}):  # which act on readings
        settings += [[key, values[experiment].get(key)] for key in OF_READINGS]
        if tasks.kind(experiment) == "images":  # which are made anew
            inputs += [workspace.frames(experiment), paths.CODE / "experiments" / f"{experiment}.py"]
    return runs.origin(settings, inputs)


def train(workspace: Workspace, values: Mapping, experiment: str) -> None:
    """Train what is out of date of the models of an experiment in params.yaml (`values`); remove those not listed."""
    settings, listed = values[experiment], list(values[experiment]["models"])
    bases = {tasks.of(experiment).base(experiment, settings, protocol) for protocol in settings["protocols"]} - {None}
    asks = any(model == settings["model_zero"] or params.transfers(model) for model in listed) if bases else False
    zeros = [paths.MODEL_ZERO] if asks else []
    for names, protocols in ((zeros, bases), (listed, None)):
        runs.train_all(
            workspace,
            train_run,
            values,
            experiment,
            {name: _origin(workspace, values, experiment, name) for name in names},
            protocols,
        )
    runs.remove_others(workspace, experiment, [*zeros, *listed])


def main(workspace: Workspace) -> None:
    """Train the models of the experiment named on the command line."""
    values = params.load(workspace.params)
    train(workspace, values, arguments.parse(__doc__, experiment=values["experiments"]).experiment)


if __name__ == "__main__":
    arguments.run(main)
