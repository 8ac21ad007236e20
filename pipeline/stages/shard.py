"""Compute one shard of the evidence: train the models of one seed at one budget, and keep what they score.

The shard of a study trains the models that it looks into, runs it with one seed, and keeps its tables; that of variants
trains the models that they start from, and keeps the scores of the variants.

The data of a set are made once per machine, in build/evidence/<set>, and made anew where their settings or code
changed; without a seed they alone are made. The shard's own folder, build/evidence/<shard>, goes when its results are
written; interrupted, the same call goes on where it stopped.
Usage: python -m pipeline.stages.shard SET [SEED half|full]
"""

import json
import math
import os
import shutil
import tempfile
from collections.abc import Collection, Mapping
from importlib.metadata import version
from pathlib import Path

import pandas as pd

from pipeline import scenes
from pipeline.results import claim_inputs, kept, shards
from pipeline.results.claim_inputs import FULL, HALF
from pipeline.results.shards import Shard
from tactile import experiments
from tactile.base import arguments, files, modules, params, paths, processes, provenance, runs
from tactile.base.availability import why_not_run
from tactile.base.errors import InputError
from tactile.base.params_file import copied, set_values
from tactile.base.paths import Workspace
from tactile.datasets import fits
from tactile.scoring import units
from tactile.scoring.estimates import read_csv
from tactile.settings.shards import ShardSet

CURVE_POINTS = 20
SHARES = {HALF: 0.5, FULL: 1.0}  # of the epochs of a recipe, by budget
UNMADE = ("budget", "models", "input_frames", "latency", "yardstick", "yardstick_task_2")  # no data are made from these
LINKED = ("dataset.parquet", "frames.parquet", "ingest.json", "logs")  # of a set's data, in the folder of a shard
DATA = ("datasets", "experiments", "logs", "tasks")
ROOMS = (*(f"tactile/{room}" for room in DATA), "pipeline/scenes")  # code that makes data
MEASURED = "train_s"  # metric: goes to times.csv, for results are the same in every run


def settings_of(workspace: Workspace, each: ShardSet, target: Workspace, further: Mapping) -> dict:
    """Write the settings of a set to a folder, with `further` dotted ones, and return them."""
    target.root.mkdir(parents=True, exist_ok=True)
    settings = copied(workspace.params, target.root)
    set_values(dict(each.set), settings, "evidence/shards.yaml")
    values = params.read(settings)[each.experiment]
    kept = {name: dict(values["protocols"][name]) for name in each.protocols}
    models = {name: values["models"][name] for name in each.models or values["models"]}
    name = each.experiment
    set_values({f"{name}.protocols": kept, f"{name}.models": models}, settings)
    set_values(dict(further), settings)
    values = params.read(settings)  # of a folder of its own: params.load is for what this stage itself was called with
    params.check(values, dict.fromkeys(each.set, "evidence/shards.yaml"))
    return values


def further_of(shard: Shard, each: ShardSet) -> dict:
    """Return the dotted settings in which a shard differs from its set: one seed, and a share of every training.

    A set that names the share itself keeps it.
    """
    name = f"{each.experiment}.budget"
    budget = {name: each.set.get(name, SHARES[shard.budget])}
    return budget | {f"{each.experiment}.protocols.{name}.seeds": [shard.seed] for name in each.protocols}


def make_data(workspace: Workspace, sets: Mapping[str, ShardSet], name: str) -> Workspace:
    """Return the folder in which the data of a set are, made anew where they are not of these settings and code.

    Sets that share data are made at once: with the protocols of all of them, of as many seeds as the most have.
    """
    sharing = [one for key, one in sets.items() if name in (key, one.like)]
    protocols = list(dict.fromkeys(protocol for one in sharing for protocol in one.protocols))
    each = sets[name].model_copy(update={"models": [], "protocols": protocols})
    data = Workspace(workspace.root / "build" / "evidence" / name)
    every = {
        f"{each.experiment}.protocols.{one}.seeds": list(range(max(other.seeds for other in sharing)))
        for one in each.protocols
    }
    with tempfile.TemporaryDirectory() as folder:  # another shard may be reading those of the data
        values = settings_of(workspace, each, Workspace(Path(folder)), every)
    block = {key: value for key, value in values[each.experiment].items() if key not in UNMADE}
    code = sorted(path for room in ROOMS for path in (paths.CODE.parent / room).rglob("*.py"))
    made_from, mark = runs.origin(block, code), data.root / "made_from.txt"
    lock = data.root.with_name(f"{name}.lock")
    with processes.holding(lock, lambda: print(f"{name}: another process makes its data")):
        if not (mark.is_file() and mark.read_text(encoding="utf-8") == made_from):
            settings_of(workspace, each, data, every)
            make(workspace, data, each.experiment, name)
            files.write_text(mark, made_from)
    return data


def make(workspace: Workspace, data: Workspace, experiment: str, name: str) -> None:
    """Make the data of a set in their folder, from its settings; InputError where recordings are absent."""
    link = data.sources
    link.parent.mkdir(parents=True, exist_ok=True)
    if not link.is_symlink():  # it may lead to a folder that is not there
        link.symlink_to(workspace.sources.resolve())
    windows = experiments.module(experiment).KIND == "windows"
    if experiment in scenes.NAMES:
        modules.run(data.root, "pipeline.stages.simulate", experiment)
    modules.run(data.root, "tactile.stages.ingest", experiment)
    if reason := why_not_run(data, experiment):
        raise InputError(f"{name}: {reason}")
    for stage in (*(["window"] if windows else []), "dataset"):
        modules.run(data.root, f"tactile.stages.{stage}", experiment)
    for log in data.logs(experiment).rglob("*.log"):  # what is left is small: the true drift of strands
        log.unlink()


def compute(workspace: Workspace, shard: Shard, sets: Mapping[str, ShardSet]) -> None:
    """Compute a shard and write its results."""
    each = sets[shard.set]
    data = make_data(workspace, sets, each.like or shard.set) if not each.own_data else None
    started = sum(os.times()[:4])
    own = Workspace(workspace.root / "build" / "evidence" / shard.name)
    values = settings_of(workspace, each, own, further_of(shard, each))
    folder = own.experiment_folder(each.experiment)
    folder.mkdir(parents=True, exist_ok=True)
    for name in LINKED if data else ():
        link = folder / name
        link.unlink(missing_ok=True)
        if (made := data.experiment_folder(each.experiment) / name).exists():
            link.symlink_to(made.resolve())
    if study := shards.study(each):
        if each.models:
            modules.run(own.root, "tactile.stages.train", each.experiment)
            settings_of(workspace, each.model_copy(update={"models": []}), own, further_of(shard, each))
        alone = {shard.set: each.model_dump(exclude={"like"}, exclude_defaults=True)}
        files.write_text(shards.folder(own) / "shards.yaml", json.dumps(alone))  # which the module variants reads
        modules.run(own.root, f"pipeline.studies.{study}", each.experiment, str(shard.seed))
        keep_study(workspace, own, shard, each, values, sum(os.times()[:4]) - started)
    else:
        for stage in ("tactile.stages.train", "tactile.stages.evaluate", "pipeline.stages.keep"):
            modules.run(own.root, stage, each.experiment)
        if stressed(shard, each):
            modules.run(own.root, "pipeline.stages.stress", each.experiment)
        write(workspace, own, shard, each, values, sum(os.times()[:4]) - started)
    files.remove_folder(own.root, inside=own.root.parent)


def keep_study(
    workspace: Workspace, own: Workspace, shard: Shard, each: ShardSet, values: Mapping, core_s: float
) -> None:
    """Keep the tables that a study wrote for one seed, or the rows of variants, and their line of the index last."""
    kept = []
    for table in sorted(own.study_result(each.experiment, "any").parent.glob("*.csv")):
        result = shards.result_file(workspace, shard.name)
        kept += [result if each.variants else shards.study_file(workspace, each.experiment, table.stem, shard.seed)]
        files.write_text(kept[-1], table.read_text(encoding="utf-8"))
    index(workspace, own, shard, each, values["device"], shards.digest(kept), core_s)
    print(f"{shard.name}: {', '.join(path.name for path in kept)}, {core_s / 60:.1f} core-minutes")


def write(workspace: Workspace, own: Workspace, shard: Shard, each: ShardSet, values: Mapping, core_s: float) -> None:
    """Write the files of a shard, and its line of the index last: what the index does not tell of is not there."""
    experiment, target, result = each.experiment, shards.folder(workspace), shards.result_file(workspace, shard.name)
    scores = read_csv(own.scores(experiment), ["model", "value"], f"python -m tactile.stages.evaluate {experiment}")
    tables = [scores]
    if experiments.facts(experiment).paper:
        tables.append(claim_inputs.rows(own, experiment, values[experiment]))
    if each.by_unit:
        tables.append(pd.DataFrame(units.rows(own, experiment, values[experiment], each.by_unit)))
    rows = pd.concat(tables).reindex(columns=claim_inputs.COLUMNS).astype({"variant": object})
    rows = rows[rows["metric"] != MEASURED]
    rows = in_variant(rows, each.variant)
    models = values[experiment]["models"]
    trained = {model for model in models if "training" in models[model] or params.transfers(model)}  # from a network
    rows["budget"] = [shard.budget if model in trained else "" for model in rows["model"]]
    rows["protocol"] = rows["protocol"].fillna(each.protocols[0])  # of the data of a set, not of all
    files.write_table(result, rows.astype({"seed": "Int64"}), missing="nan")
    if stressed(shard, each):
        table = stress_rows(own, experiment, rows, each.by_unit)
        files.write_table(shards.stress_file(workspace, shard.name), table, missing="nan")
    curves, times = trainings(own, experiment, values)
    files.write_table(target / "curves" / f"{shard.name}.csv", curves)
    keep(workspace, own, shard, each)
    shards.upsert(target / "times.csv", shards.TIMES, shard.name, [{"shard": shard.name, **row} for row in times])
    index(workspace, own, shard, each, values["device"], shards.digest([result]), core_s)
    print(f"{shard.name}: {len(rows)} numbers, {core_s / 60:.1f} core-minutes")


def in_variant(rows: pd.DataFrame, variant: str) -> pd.DataFrame:
    """Return the rows of a set as those of its variant, "" where it has none; a unit stands after it.

    What else has a variant of its own, such as a pair of objects, would stand beside the tables' own, and is dropped.
    """
    if not variant:
        return rows.assign(variant=rows["variant"].fillna(""))
    kept = rows[rows["metric"].str.endswith(units.SUFFIX) | rows["variant"].isna()]
    return kept.assign(variant=kept["variant"].radd(f"{variant}/").fillna(variant))


def keep(workspace: Workspace, own: Workspace, shard: Shard, each: ShardSet) -> None:
    """Keep what figures draw of a shard; of a variant they show nothing, and where there is no row there is no file."""
    path, target = own.kept(each.experiment), shards.kept_file(workspace, shard.name)
    target.unlink(missing_ok=True)
    if not each.variant and kept.read(path, each.experiment).num_rows:
        if path.stat().st_size > kept.LARGEST:
            raise InputError(f"{path}: {path.stat().st_size} bytes, and a shard keeps {kept.LARGEST} at most")
        with files.replacing(target) as draft:
            shutil.copyfile(path, draft)


def stressed(shard: Shard, each: ShardSet) -> bool:
    """Return whether the models of a shard are scored on perturbed readings and scenes."""
    return each.stress and shard.budget == FULL


def stress_rows(own: Workspace, experiment: str, rows: pd.DataFrame, by_unit: Collection[str]) -> pd.DataFrame:
    """Return the experiment's main score under stress, as shards.STRESS; rows: of the shard's results.

    Budget and variant are those of the model's scores. by_unit: protocols whose rows keep their blocks.
    """
    columns, made_by = ["model", "severity", "value", "blocks"], f"python -m pipeline.stages.stress {experiment}"
    found = read_csv(own.stress(experiment), columns, made_by)
    found = found[found["metric"] == experiments.facts(experiment).metric]
    of_model = rows.drop_duplicates("model").set_index("model")
    place = {name: found["model"].map(of_model[name]) for name in ("variant", "budget")}
    place["blocks"] = found["blocks"].astype(object).fillna("").where(found["protocol"].isin(by_unit), "")
    return found.assign(**place).reindex(columns=shards.STRESS)


def index(
    workspace: Workspace,
    own: Workspace,
    shard: Shard,
    each: ShardSet,
    device: str,
    digest: str,
    core_s: float,
) -> None:
    """Put the line of a shard into the index."""
    line = {
        "shard": shard.name, "experiment": each.experiment, "protocol": shards.named(each), "seed": shard.seed,
        "budget": shard.budget, "sha256": digest, "core_s": math.ceil(core_s),
        "machine": machine(each.experiment, device), "commit": provenance.git_state(workspace)[0],
        "data_sha256": files.sha256(own.dataset(each.experiment)) if not each.own_data else "",
        "kept_sha256": shards.kept_sha256(workspace, shard.name),
    }  # fmt: skip
    shards.upsert(shards.folder(workspace) / "index.csv", shards.INDEX, shard.name, [line])


def trainings(own: Workspace, experiment: str, values: Mapping) -> tuple[pd.DataFrame, list[dict]]:
    """Return the learning curves of all trainings, thinned, and the costs of each."""
    made_by, curves, times = params.training_command(experiment), [], []
    for model in values[experiment]["models"]:
        seconds = read_csv(own.training_times(experiment, model), ["protocol", "seed", "train_s"], made_by)
        for run in seconds.itertuples():
            place = {"model": model, "protocol": run.protocol, "seed": int(run.seed)}
            folder = own.run_folder(experiment, model, run.protocol, int(run.seed))
            epochs = fits.read(folder, made_by)["epochs"]
            times.append(place | {"epochs": epochs, "train_s": round(run.train_s, 3)})
            history = read_csv(folder / "history.csv", ["epoch", "train_loss", "validation_loss"], made_by)
            if len(history) > 1:
                step = math.ceil(len(history) / CURVE_POINTS)
                curves.append(history[::-1][::step][::-1][["epoch", "train_loss", "validation_loss"]].assign(**place))
    columns = ["model", "protocol", "seed", "epoch", "train_loss", "validation_loss"]
    return pd.concat([*curves, pd.DataFrame(columns=columns)])[columns], times


def machine(experiment: str, device: str) -> str:
    """Return what the last digits of an experiment's results depend on.

    It is the make of the processor, that of the card if networks were trained on one, and torch's version if it is not
    the one that constraints.txt has. device: the setting.
    """
    names, torch_version = [processes.processor()], version("torch").partition("+")[0]
    if device != "cpu" and experiments.module(experiment).KIND != "series":  # series are trained on the processor
        import torch

        names += [torch.cuda.get_device_name()] if torch.cuda.is_available() else []
    pins = paths.CODE.parent / "constraints.txt"
    if pins.is_file() and f"torch=={torch_version}" not in pins.read_text(encoding="utf-8").split():
        names.append(f"torch {torch_version}")
    return ", ".join(names)


def main(workspace: Workspace) -> None:
    """Compute the shard named on the command line, or make the data of its set."""
    sets = shards.read_sets(workspace)
    seeds = (*map(str, range(max(each.seeds for each in sets.values()))), None)
    given = arguments.parse(__doc__, set=tuple(sets), seed=seeds, budget=(*shards.BUDGETS, None))
    if given.seed is None:
        make_data(workspace, sets, sets[given.set].like or given.set)
        return
    if given.budget is None:
        raise InputError(f"{given.set} {given.seed}: which budget? `half` or `full`")
    params.check_known([given.budget], shards.budgets(sets[given.set]), f"evidence/shards.yaml, {given.set}")
    known = [str(seed) for seed in range(sets[given.set].seeds)]
    params.check_known([given.seed], known, f"evidence/shards.yaml, {given.set}")
    compute(workspace, Shard(given.set, int(given.seed), given.budget), sets)


if __name__ == "__main__":
    arguments.run(main)
