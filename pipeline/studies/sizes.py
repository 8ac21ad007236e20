"""Train and score the papers' own models at several sizes: what is the smallest that is enough?

touch: narrower LoMPs, and a CNN that sees only the last frames of each window and is trained for fewer epochs than the
one of the tables. glove: SP-ResNet with fewer channels. Those of strain are in the study of the latent space. LoMP and
SP-ResNet are trained as in the tables. The errors choose nothing but the ladders' own verdict: no other table depends
on them.
Usage: python -m pipeline.studies.sizes touch|glove SEED
"""

from collections.abc import Mapping

import numpy as np
from torch import nn
from tqdm import tqdm

from pipeline import models
from pipeline.base import arguments, files, params, workers
from pipeline.base.errors import InputError
from pipeline.base.paths import Workspace
from pipeline.datasets import images, schemas
from pipeline.datasets.windows import read_dataset
from pipeline.learning.image_classifier import ImageClassifier
from pipeline.learning.regressors import Spec
from pipeline.learning.residual_blocks import separable_network
from pipeline.learning.trained import Trained
from pipeline.scoring import classification, ladders, metrics
from pipeline.settings.training import AugmentedTraining
from pipeline.tasks import images as tasks_images
from pipeline.tasks import windows as tasks_windows

CONDITIONS = ("single", "double")  # of touch, as in Table I
STEM = 64  # channels of the first half of the published SP-ResNet


def touch_run(workspace: Workspace, values: Mapping, family: str, size: int, seed: int, report) -> list[tuple]:
    """Train and score one run of a touch ladder; a row a condition, in the order of ladders.COLUMNS."""
    import torch

    torch.set_num_threads(1)
    settings, protocol = values["touch"], ladders.protocol("touch", "single")
    spec, model = tasks_windows.spec(settings), ladders.FAMILIES[family].model
    block, frames = params.model_settings(values, "touch", model), spec.frames
    if family == "lomp":
        readout = [max(1, round(width * size / block["hidden"])) for width in block["readout"]]
        block = block | {"hidden": size, "readout": readout}
    else:
        spec = spec._replace(frames=size)
        block = block | {"training": block["training"] | values["rightsize"]["touch"][family]["training"]}
    data = read_dataset(workspace.dataset("touch"), frames)
    x, part, condition = data.x[:, -spec.frames :], data.part(protocol, seed), schemas.names(data.rows["condition"])
    regressor = models.build(model, spec, block, f"rightsize.touch.{family}")
    train, validation = ((x[part == name], data.y[part == name]) for name in ("train", "validation"))
    regressor.fit(train, validation, seed=seed, device=values["device"])
    run, rows = Trained(regressor, failed=regressor.summary.best_epoch == 0), []
    for name in CONDITIONS:
        chosen = (part == "test") & (condition == name)
        if chosen.any():
            scores = metrics.touch(data.y[chosen], run.predict(x[chosen]), settings)
            rows.append(_row("touch", name, family, size, run.model, scores, seed))
    report()
    return rows


def glove_run(workspace: Workspace, values: Mapping, condition: str, width: float, seed: int, report) -> list[tuple]:
    """Train and score an SP-ResNet of `width` times the published channels, with the settings of the tables'."""
    import torch

    torch.set_num_threads(1)
    block = params.model_settings(values, "glove", "sp_resnet")
    data = images.read(workspace.dataset("glove"), ladders.protocol("glove", condition), seed)
    train, validation, test = (tasks_images.part_of(data, name) for name in images.PARTS)
    settings = dict(params.check_model("sp_resnet", block, "glove.models.sp_resnet"))
    classifier = narrow_sp_resnet(tasks_images.spec(data), width=width, **settings)
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


def touch(workspace: Workspace, values: dict, seed: int) -> list[tuple]:
    """Return the rows of both touch ladders, the largest size first."""
    ladder, frames = values["rightsize"]["touch"], values["touch"]["window"]["frames"]
    if max(ladder["window"]["sizes"]) > frames:
        raise InputError(f"params.yaml, rightsize.touch.window.sizes: a window has {frames} frames; take no more")
    runs = [(family, size, seed) for family in ladder for size in sorted(ladder[family]["sizes"], reverse=True)]
    return _climbed(touch_run, workspace, values, runs, "rightsize touch")


def glove(workspace: Workspace, values: dict, seed: int) -> list[tuple]:
    """Return the rows of the SP-ResNet ladder."""
    widths = values["rightsize"]["glove"]["sp_resnet"]["sizes"]
    runs = [(condition, width, seed) for width in sorted(widths) for condition in images.MODALITIES]
    return _climbed(glove_run, workspace, values, runs, "rightsize glove")


def _climbed(function, workspace: Workspace, values: Mapping, runs: list[tuple], title: str) -> list[tuple]:
    with tqdm(total=len(runs), desc=title, unit="run") as bar:
        rows = dict(workers.run(function, {run: (workspace, values, *run) for run in runs}, bar))
    return [row for run in runs for row in rows[run]]


def main(workspace: Workspace) -> None:
    """Climb the ladders of the experiment named on the command line, with one seed."""
    experiment, seed = arguments.of_study(__doc__, tuple(LADDERS))
    rows = LADDERS[experiment](workspace, params.load(workspace.params), seed)
    conditions = list(dict.fromkeys(row[1] for row in rows))
    rows.sort(key=lambda row: (row[2], conditions.index(row[1]), row[3]))  # family, condition, size
    files.write_csv(workspace.study_result(experiment, "sizes"), ladders.COLUMNS, rows)


LADDERS = {"touch": touch, "glove": glove}

if __name__ == "__main__":
    arguments.run(main)
