"""Try values of the one setting that a scene's difficulty is set by, and compare its yardstick with the published one.

The yardstick of an experiment (setting `<experiment>.yardstick`) is the error of one model over that of another,
which does not depend on the scale of errors; strain has a second one, `yardstick_task_2`. For every value of the knob
the scene is simulated with the amounts of params/ (`--set`: of a set of evidence/shards.yaml), both models are trained,
and the ratio is taken on the validation part; test parts are not read. Nothing is changed: write the value you choose
into params/<experiment>.yaml.
"""

import argparse
from collections.abc import Mapping
from functools import reduce
from operator import getitem

from tqdm import tqdm

from pipeline.results import shards
from pipeline.stability import changed_scene
from tactile import experiments
from tactile.base import arguments, params, workers
from tactile.base.errors import InputError
from tactile.base.paths import Workspace
from tactile.scoring import classification

YARDSTICK = "yardstick"  # the setting that every simulated experiment has
FACTORS = (0.5, 0.7, 1.0, 1.4, 2.0)  # times the present value, where no values are given


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add experiment, values and seeds to the parser of this command."""
    parser.add_argument("experiment", choices=["touch", "strain", "glove"])
    parser.add_argument("values", nargs="*", type=float, help="values of the knob (0.5 to 2 times the present one)")
    parser.add_argument("--yardstick", default=YARDSTICK, metavar="KEY", help=f"the setting of it ({YARDSTICK})")
    parser.add_argument("--seeds", nargs="+", type=int, default=[0], help="of scene, split and training (0)")
    parser.add_argument("--set", help="with the amounts of data of this set of evidence/shards.yaml")


def with_amounts_of(workspace: Workspace, values: Mapping, name: str, experiment: str) -> None:
    """Change settings, in place, to those of a set of the evidence. Raises InputError for one of another experiment."""
    sets = shards.read_sets(workspace)
    known = [key for key, each in sets.items() if each.experiment == experiment]
    params.check_known([name], known, "evidence/shards.yaml")
    for dotted, value in sets[name].set.items():
        *keys, last = dotted.split(".")
        reduce(getitem, keys, values)[last] = value


def changes_of(knob: str, value: float) -> dict:
    """Return the settings of an experiment that set its knob, a dotted key, to `value`."""
    changes = value
    for key in reversed(knob.split(".")):
        changes = {key: changes}
    return changes


def held_out(settings: Mapping) -> dict:
    """Return settings of recordings that end with the validation part, which is their test part.

    Models of series are trained on the validation part, too, so it has to be kept from them.
    """
    split, scene = settings["split"], settings["simulate"]
    shorter = {"samples": round(scene["samples"] * split["train"])}
    return {**settings, "split": split | {"train": 1 - split["validation"]}, "simulate": scene | shorter}


def ratio(values: Mapping, experiment: str, yardstick: str, value: float, seed: int, report) -> tuple[float, float]:
    """Return the errors of a yardstick's two models on the validation part, with its knob at `value`."""
    import torch

    torch.set_num_threads(1)
    chosen, block = values[experiment][yardstick], f"{experiment}.models"
    names = [chosen["model"], chosen["over"]]
    settings = changed_scene.settings_of(values, experiment, changes_of(chosen["knob"], value), chosen["knob"])
    settings, part = changed_scene.drawn(settings, seed), "validation"
    if experiments.module(experiment).KIND == "series":
        settings, part = held_out(settings), "test"
    asked = changed_scene.Asked([chosen["protocol"]], settings["models"], block, names, part)
    errors = {}
    for condition, model, scores in changed_scene.scores_anew(experiment, settings, asked, seed, values["device"]):
        if condition == chosen["condition"]:
            score = next(number for metric, _, number, _ in scores if metric == chosen["metric"])
            errors[model] = 1 - score if chosen["metric"] in classification.METRICS else score
    report()
    return errors[names[0]], errors[names[1]]


def main(workspace: Workspace, given: argparse.Namespace) -> None:
    """Print one line per value of the knob and seed, and the value whose mean ratio is nearest to the published one."""
    values = params.load(workspace.params)
    if given.set:
        with_amounts_of(workspace, values, given.set, given.experiment)
    settings = values[given.experiment]
    key, file = given.yardstick, params.file_of(given.experiment)
    known = [name for name in settings if name.startswith(YARDSTICK)]
    if key not in known:
        raise InputError(f"--yardstick {key}: {given.experiment} in {file} has {' and '.join(known)}")
    chosen = settings[key]
    if settings["source"] != "simulated":
        raise InputError(f"{file}, {given.experiment}.source: only a simulated scene can be calibrated")
    present = settings
    for part in chosen["knob"].split("."):
        if not isinstance(present, Mapping) or part not in present:
            raise InputError(f"{file}, {given.experiment}.{key}.knob: there is no key '{chosen['knob']}'")
        present = present[part]
    tried = given.values or [factor * present for factor in FACTORS]
    runs = {(value, seed): (values, given.experiment, key, value, seed) for value in tried for seed in given.seeds}
    with tqdm(total=len(runs), desc=f"calibrate {given.experiment}", unit="scene") as bar:
        errors = dict(workers.run(ratio, runs, bar))
    means = {}
    print(f"{chosen['knob']}  seed  {chosen['model']}  {chosen['over']}  ratio (published {chosen['published']:.3f})")
    for value in tried:
        for seed in given.seeds:
            ours, others = errors[value, seed]
            print(f"{value:<8g}  {seed}  {ours:.4g}  {others:.4g}  {ours / others:.3f}")
        means[value] = sum(a / b for a, b in (errors[value, seed] for seed in given.seeds)) / len(given.seeds)
    nearest = min(means, key=lambda value: abs(means[value] - chosen["published"]))
    print(f"nearest: {chosen['knob']} = {nearest:g}, ratio {means[nearest]:.3f}; {file} has {present:g}")


if __name__ == "__main__":
    arguments.run_tool(__doc__, main, add_arguments)
