"""Train and score the papers' own models at several sizes: what is the smallest that is enough?

touch: narrower LoMPs, and a CNN that sees only the last frames of each window and is trained for fewer epochs than the
one of the tables. glove: SP-ResNet with fewer channels. strain: the LSTMs of the stage study_strain. LoMP and SP-ResNet
are trained as in the tables; the size that the tables have is the model of the tables itself, and a LoMP that the stage
ablate_touch has trained with the same settings is not trained again. The errors choose nothing but the ladders' own
verdict: no other table depends on them.
Usage: python -m pipeline.studies.sizes touch|strain|glove
"""

from collections.abc import Mapping

import numpy as np
import pandas as pd
from torch import nn
from tqdm import tqdm

from pipeline import models, tasks
from pipeline.base import arguments, files, params, paths, workers
from pipeline.base.errors import InputError
from pipeline.base.paths import Workspace
from pipeline.datasets import images, schemas
from pipeline.datasets.windows import read_dataset
from pipeline.learning.image_classifier import ImageClassifier
from pipeline.learning.regressors import Spec
from pipeline.learning.residual_blocks import separable_network
from pipeline.learning.trained import Trained
from pipeline.scoring import ablation, classification, ladders, metrics
from pipeline.settings.training import AugmentedTraining
from pipeline.tasks import images as tasks_images
from pipeline.tasks import series as tasks_series
from pipeline.tasks import windows as tasks_windows

CONDITIONS = ("single", "double")  # of touch, as in Table I
STEM = 64  # channels of the first half of the published SP-ResNet


def touch_run(workspace: Workspace, values: Mapping, family: str, size: int, seed: int, report) -> list[tuple]:
    """Train or load, and score one run of a touch ladder; a row a condition, in the order of ladders.COLUMNS."""
    import torch

    torch.set_num_threads(1)
    settings, protocol = values["touch"], ladders.protocol("touch", "single")
    spec, model = tasks_windows.spec(settings), ladders.FAMILIES[family].model
    block, frames = params.model_settings(values, "touch", model), spec.frames
    of_tables = family == "lomp" and size == block["hidden"]
    if family == "lomp":
        readout = [max(1, round(width * size / block["hidden"])) for width in block["readout"]]
        block = block | {"hidden": size, "readout": readout}
    else:
        spec = spec._replace(frames=size)
        block = block | {"training": block["training"] | values["rightsize"]["touch"][family]["training"]}
    name = _same_in_ablation(settings, model, block, spec.frames, seed)
    if name:
        report()
        return _rows_of_ablation(
            workspace, name, family, size, seed, models.build(model, spec, block, "rightsize.touch")
        )
    data = read_dataset(workspace.dataset("touch"), frames)
    x = data.x[:, -spec.frames :]
    part = data.part(protocol, seed)
    if of_tables:
        run = tasks.load(workspace, values, "touch", model, protocol, seed, spec)
    else:
        regressor = models.build(model, spec, block, f"rightsize.touch.{family}")
        train, validation = ((x[part == name], data.y[part == name]) for name in ("train", "validation"))
        regressor.fit(train, validation, seed=seed, device=values["device"])
        run = Trained(regressor, failed=regressor.summary.best_epoch == 0)
    predicted, rows = np.full(data.y.shape, np.nan, np.float32), np.flatnonzero(part == "test")
    predicted[rows] = run.predict(x[rows])
    condition, rows_of_run = schemas.names(data.rows["condition"]), []
    for name in CONDITIONS:
        chosen = rows[condition[rows] == name]
        if not len(chosen):
            continue
        scores = metrics.touch(data.y[chosen], predicted[chosen], settings)
        rows_of_run.append(_row("touch", name, family, size, run.model, scores, seed))
    report()
    return rows_of_run


def _same_in_ablation(settings: Mapping, model: str, block: Mapping, frames: int, seed: int) -> str | None:
    """Return the name of the row of touch.ablation that trains a model with exactly these settings, if there is one."""
    for name, row in settings["ablation"].items():
        same = (row["of"], row["frames"], ablation.block_of(settings, name)) == (model, frames, block)
        if same and seed in row["seeds"]:
            return name
    return None


def _rows_of_ablation(workspace: Workspace, name: str, family: str, size: int, seed: int, model) -> list[tuple]:
    """Return the rows of a run that the stage ablate_touch trained and scored; model: the same, untrained."""
    table, protocol = ablation.read(workspace, "touch"), ladders.protocol("touch", "single")
    table = table[(table["row"] == name) & (table["protocol"] == protocol) & (table["seed"] == seed)]
    return [
        _row("touch", condition, family, size, model, list(scores.itertuples(index=False, name=None)), seed)
        for condition, rows in table.groupby("condition", sort=False)
        for scores in [rows[["metric", "unit", "value", "n"]]]
    ]


def glove_run(workspace: Workspace, values: Mapping, condition: str, width: float, seed: int, report) -> list[tuple]:
    """Train and score one SP-ResNet narrower than the published one, with its settings; load the published one."""
    import torch

    torch.set_num_threads(1)
    block = params.model_settings(values, "glove", "sp_resnet")
    protocol = ladders.protocol("glove", condition)
    data = images.read(workspace.dataset("glove"), protocol, seed)
    spec = tasks_images.spec(data)
    train, validation, test = (tasks_images.part_of(data, name) for name in images.PARTS)
    if width == 1:
        run = tasks.load(workspace, values, "glove", "sp_resnet", protocol, seed, spec)
    else:
        classifier = narrow_sp_resnet(
            spec, width=width, **dict(params.check_model("sp_resnet", block, "glove.models.sp_resnet"))
        )
        classifier.fit(train, validation, seed=seed, device=values["device"])
        run = Trained(classifier, failed=classifier.summary.best_epoch == 0)
    scores = metrics.unless_failed(classification.scores(test[1], run.predict(test[0])), run.failed)
    report()
    return [_row("glove", condition, "sp_resnet", width, run.model, scores, seed)]


def narrow_sp_resnet(spec: Spec, *, width: float, reduction: int, training: AugmentedTraining) -> ImageClassifier:
    """Return SP-ResNet with `width` times the published channels: at 1 the model `sp_resnet`, 99,224 parameters."""
    return ImageClassifier(lambda: narrow_network(1, spec.outputs, width, reduction), spec, training)


def narrow_network(channels: int, classes: int, width: float, reduction: int) -> nn.Sequential:
    """Return `separable_network` with `width` times its channels, from (n, channels, rows, cols) to (n, classes).

    `reduction` is that of the attention, as far as it leaves the narrowest bottleneck a channel.
    Raises InputError for a width that leaves no channel or no whole number of them.
    """
    stem = width * STEM
    if stem < 1 or stem != int(stem):
        raise InputError(f"sp_resnet: a width of {width:g} leaves {stem:g} of {STEM} channels; take a multiple of 1/64")
    return separable_network(channels, classes, min(reduction, int(stem)), int(stem))


def _row(experiment: str, condition: str, family: str, size, model, scores: list, seed: int) -> tuple:
    metric, unit, value, _ = next(row for row in scores if row[0] == ladders.METRIC[experiment])
    value = value if np.isfinite(value) else float("nan")
    return (experiment, condition, family, size, model.parameters(), metric, unit, seed, value, model.macs())


def touch(workspace: Workspace, values: dict) -> list[tuple]:
    """Return the rows of both touch ladders, the largest size first."""
    ladder, settings, protocol = values["rightsize"]["touch"], values["touch"], ladders.protocol("touch", "single")
    for family, block in ladder.items():
        _check_seeds(f"rightsize.touch.{family}.seeds", block["seeds"], settings["protocols"][protocol]["seeds"])
    frames = settings["window"]["frames"]
    if max(ladder["window"]["sizes"]) > frames:
        raise InputError(f"params.yaml, rightsize.touch.window.sizes: a window has {frames} frames; take no more")
    runs = [
        (family, size, seed)
        for family in ladder
        for size in sorted(ladder[family]["sizes"], reverse=True)
        for seed in ladder[family]["seeds"]
    ]
    return _climbed(touch_run, workspace, values, runs, "rightsize touch")


def glove(workspace: Workspace, values: dict) -> list[tuple]:
    """Return the rows of the SP-ResNet ladder."""
    block, settings = values["rightsize"]["glove"]["sp_resnet"], values["glove"]
    widths, seeds = block["sizes"], block["seeds"]
    for condition in images.MODALITIES:
        known = settings["protocols"][ladders.protocol("glove", condition)]["seeds"]
        _check_seeds("rightsize.glove.sp_resnet.seeds", seeds, known)
    runs = [(c, width, seed) for width in sorted(widths) for c in images.MODALITIES for seed in seeds]
    return _climbed(glove_run, workspace, values, runs, "rightsize glove")


def strain(workspace: Workspace, values: dict) -> list[tuple]:
    """Return the runs of capacity.csv of the study of the latent space, as rows of a ladder."""
    path = workspace.experiment_folder("strain") / "study" / "capacity.csv"
    table = pd.read_csv(paths.require(path, "python -m pipeline.studies.latent strain"))
    model = ladders.FAMILIES["lstm"].model
    block = params.model_settings(values, "strain", model)
    rows = []
    for row in table[table["metric"] == ladders.METRIC["strain"]].itertuples():
        spec = tasks_series.spec("strain", values["strain"], row.protocol)
        network = models.build(model, spec, block | {"units": int(row.units)}, f"strain.models.{model}")
        size = (int(row.units), int(row.params), row.metric, row.unit, row.seed, row.value, network.macs())
        rows.append(("strain", row.protocol, "lstm", *size))
    return rows


def _check_seeds(name: str, seeds: list[int], known: list[int]) -> None:
    if absent := [seed for seed in seeds if seed not in known]:
        raise InputError(f"{params.file_of(name)}, {name}: there is no split of seed {absent[0]}; known: {known}")


def _climbed(function, workspace: Workspace, values: Mapping, runs: list[tuple], title: str) -> list[tuple]:
    with tqdm(total=len(runs), desc=title, unit="run") as bar:
        rows = dict(workers.run(function, {run: (workspace, values, *run) for run in runs}, bar))
    return [row for run in runs for row in rows[run]]


def main(workspace: Workspace) -> None:
    """Climb the ladders of the experiment named on the command line."""
    experiment = arguments.parse(__doc__, experiment=ladders.METRIC).experiment
    rows = {"touch": touch, "strain": strain, "glove": glove}[experiment](workspace, params.load(workspace.params))
    conditions = list(dict.fromkeys(row[1] for row in rows))
    rows.sort(key=lambda row: (row[2], conditions.index(row[1]), row[3], row[7]))  # family, condition, size, seed
    files.write_csv(ladders.path(workspace, experiment), ladders.COLUMNS, rows)


if __name__ == "__main__":
    arguments.run(main)
