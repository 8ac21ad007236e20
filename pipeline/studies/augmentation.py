"""Stage: what each augmentation method is worth (SP-ResNet paper, Table 2): one model, trained without and with them.

Trains `augmentation.model` on each of the three datasets with no method and with A, B or C alone; all of them
together is the model itself, which `train_images` has trained. Writes the scores on the test part.
Usage: python -m pipeline.studies.augmentation glove
"""

import sys
from collections.abc import Mapping

from tqdm import tqdm

from pipeline.base import files, params, paths, workers
from pipeline.base.errors import InputError, run_stage
from pipeline.datasets import images
from pipeline.scoring import classification, metrics

METHODS = {"none": (), "A": ("flip",), "B": ("noise",), "C": ("affine",)}  # what stays on; the others are set to 0
SETTINGS = ("flip", "noise", "affine")
COLUMNS = ("method", "protocol", "condition", "seed", "metric", "unit", "value", "n")


def train_run(values: Mapping, experiment: str, method: str, protocol: str, seed: int, report) -> list[tuple]:
    """Train and score one run with the methods that `method` leaves on; rows of scores.csv."""
    import torch

    from pipeline.learning.image_classifier import spec_of

    torch.set_num_threads(1)
    model = values[experiment]["augmentation"]["model"]
    block = params.model_settings(values, experiment, model)
    off = {name: 0.0 for name in SETTINGS if name not in METHODS[method]}
    block = block | {"training": block["training"] | off}
    data = images.read(paths.dataset(experiment), protocol, seed)
    classifier = params.build_model(model, spec_of(len(data.objects)), block, f"{experiment}.models.{model}")
    train, validation, test = ((data.x[data.part == name], data.y[data.part == name]) for name in images.PARTS)
    classifier.fit(train, validation, seed=seed, device=values["device"], progress=report)
    found = classification.scores(test[1], classifier.predict(test[0]))
    found = metrics.unless_failed(found, classifier.summary.best_epoch == 0)
    return [(method, protocol, images.modality(protocol), seed, *row) for row in found]


def main() -> None:
    """Train and score every method, dataset and seed of the experiment named on the command line."""
    values = params.load()
    if len(sys.argv) != 2 or sys.argv[1] != "glove":
        raise InputError("usage: python -m pipeline.studies.augmentation glove")
    experiment = sys.argv[1]
    settings = values[experiment]["augmentation"]
    block = params.model_settings(values, experiment, settings["model"])
    if "training" not in block:
        raise InputError(f"params.yaml, glove.augmentation.model: '{settings['model']}' is no network; name one")
    runs = [
        (experiment, method, f"{settings['split']}_{modality}", seed)
        for method in METHODS
        for modality in images.MODALITIES
        for seed in settings["seeds"]
    ]
    epochs = block["training"]["max_epochs"]
    with tqdm(total=epochs * len(runs), desc=f"augment {experiment}", unit="epoch") as bar:
        found = dict(workers.run(train_run, {run: (values, *run) for run in runs}, bar, steps=epochs))
    files.write_csv(paths.augmentation(experiment), COLUMNS, (row for run in runs for row in found[run]))


if __name__ == "__main__":
    run_stage(main)
