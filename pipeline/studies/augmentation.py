"""Measure what each augmentation method is worth (SP-ResNet paper, Table 2): one model without and with each.

Trains `augmentation.model` on each of the three datasets with no method, with A, B or C alone, and with all of them,
which is the model of the tables. Writes the scores of one seed on the test part.
Usage: python -m pipeline.studies.augmentation glove SEED
"""

from collections.abc import Mapping

from tqdm import tqdm

from pipeline import models
from pipeline.base import arguments, files, params, workers
from pipeline.base.errors import InputError
from pipeline.base.paths import Workspace
from pipeline.datasets import images
from pipeline.scoring import classification, metrics
from pipeline.tasks import images as tasks_images

SETTINGS = ("flip", "noise", "affine")
METHODS = {
    "none": (),
    "A": ("flip",),
    "B": ("noise",),
    "C": ("affine",),
    "all": SETTINGS,
}  # on; the others are set to 0
COLUMNS = ("method", "protocol", "condition", "seed", "metric", "unit", "value", "n")


def train_run(
    workspace: Workspace, values: Mapping, experiment: str, method: str, protocol: str, seed: int, report
) -> list[tuple]:
    """Train and score one run with the methods that `method` leaves on; rows of scores.csv."""
    import torch

    torch.set_num_threads(1)
    model = values[experiment]["augmentation"]["model"]
    block = params.model_settings(values, experiment, model)
    off = {name: 0.0 for name in SETTINGS if name not in METHODS[method]}
    block = block | {"training": block["training"] | off}

    def build(spec):
        return models.build(model, spec, block, f"{experiment}.models.{model}")

    place = workspace.dataset(experiment), experiment, values[experiment], protocol, seed
    classifier = tasks_images.fit(*place, build, device=values["device"], progress=report).model
    x, y = tasks_images.part_of(images.read(workspace.dataset(experiment), protocol, seed), "test")
    scores = metrics.unless_failed(classification.scores(y, classifier.predict(x)), classifier.summary.best_epoch == 0)
    return [(method, protocol, images.modality(protocol), seed, *row) for row in scores]


def main(workspace: Workspace) -> None:
    """Train and score every method and dataset of the experiment and seed named on the command line."""
    values = params.load(workspace.params)
    experiment, seed = arguments.of_study(__doc__, ["glove"])
    settings = values[experiment]["augmentation"]
    block = params.model_settings(values, experiment, settings["model"])
    if "training" not in block:
        raise InputError(f"params/glove.yaml, glove.augmentation.model: '{settings['model']}' is no network; name one")
    runs = [
        (experiment, method, f"{settings['split']}_{modality}", seed)
        for method in METHODS
        for modality in images.MODALITIES
    ]
    epochs = block["training"]["epochs"]
    with tqdm(total=epochs * len(runs), desc=f"augment {experiment}", unit="epoch") as bar:
        rows = dict(workers.run(train_run, {run: (workspace, values, *run) for run in runs}, bar, steps=epochs))
    files.write_csv(
        workspace.study_result(experiment, "augmentation"), COLUMNS, (row for run in runs for row in rows[run])
    )


if __name__ == "__main__":
    arguments.run(main)
