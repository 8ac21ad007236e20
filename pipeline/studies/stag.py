"""Train and score the models of figure 15 on the STAG data set, where `glove.stag.file` names its metadata.mat.

Trains the figure's models on the training part, keeping some of its recordings for validation: on one frame, whose
predictions of several are averaged, and on each of `glove.input_frames.numbers` of frames (see `joined_frames`). Scores
them on the test part. Without the file (`none`) the table has no rows.
Usage: python -m pipeline.studies.stag glove
"""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from tqdm import tqdm

from pipeline import models
from pipeline.base import arguments, files, params, workers
from pipeline.base.errors import InputError
from pipeline.base.paths import Workspace
from pipeline.datasets import seeding
from pipeline.logs import stag
from pipeline.scoring import classification, metrics

COLUMNS = ("form", "model", "seed", "frames", "metric", "unit", "value", "n")
MODELS = ("sp_resnet", "resnet3x3")


def train_run(
    workspace: Workspace, values: Mapping, experiment: str, model: str, seed: int, input_frames: int, file: str, report
) -> list[tuple]:
    """Train one model and score it; rows of stag.csv.

    With one input frame its predictions of 1 to MOST_FRAMES frames of a recording are averaged.
    """
    import torch

    from pipeline.learning.image_classifier import spec_of
    from pipeline.studies import joined_frames

    torch.set_num_threads(1)
    data = stag.read(workspace, workspace.root / file)
    y = np.eye(len(data.objects), dtype=np.float32)[data.label]
    part = parts(data, values[experiment]["stag"]["validation"], seed)
    block = params.model_settings(values, experiment, model)
    classifier = models.build(model, spec_of(len(data.objects)), block, f"{experiment}.models.{model}")
    names = np.char.add(np.char.add(data.recording, "/"), data.label.astype(str))
    _, group = np.unique(names, return_inverse=True)
    if input_frames > 1:
        place = classifier, input_frames, data.images, y, group, part
        scores = joined_frames.scores(*place, seed=seed, device=values["device"], progress=report)
        return [("trained", model, seed, input_frames, *row) for row in scores]
    train, validation = ((data.images[part == name], y[part == name]) for name in ("train", "validation"))
    classifier.fit(train, validation, seed=seed, device=values["device"], progress=report)
    test = part == "test"
    predicted = classifier.predict(data.images[test])
    rows, failed = [], classifier.summary.best_epoch == 0
    for frames in range(1, classification.MOST_FRAMES + 1):
        first, means = classification.by_frames(predicted, group[test], frames)
        if len(first):
            scores = metrics.unless_failed(classification.scores(y[test][first], means), failed)
            rows += [("mean", model, seed, frames, *row) for row in scores]
    return rows


def parts(data: stag.Stag, validation: float, seed: int) -> np.ndarray:
    """Return (n,) 'train', 'validation', 'test': the share `validation` of the training recordings validates."""
    part = data.part.astype(object)
    recordings = np.unique(data.recording[part == "train"])
    if len(recordings) < 2:
        raise InputError(f"glove.stag.file: {len(recordings)} training recordings; two or more are needed")
    kept = seeding.generator(seed, "stag").permutation(recordings)[: max(1, round(validation * len(recordings)))]
    part[(part == "train") & np.isin(data.recording, kept)] = "validation"
    return part


def main(workspace: Workspace) -> None:
    """Train and score on the user's file, or write an empty table."""
    arguments.parse(__doc__, experiment=["glove"])
    values = params.load(workspace.params)
    settings = values["glove"]["stag"]
    rows: dict = {}
    if settings["file"] != "none":
        if not Path(workspace.root / settings["file"]).is_file():
            raise InputError(f"params/glove.yaml, glove.stag.file: no such file {settings['file']}; name one or `none`")
        numbers = sorted({1, *values["glove"]["input_frames"]["numbers"]})
        runs = {
            (model, seed, frames): (values, "glove", model, seed, frames, settings["file"])
            for model in MODELS
            for seed in settings["seeds"]
            for frames in numbers
        }
        epochs = {run: run[2] * params.epochs(values["glove"]["models"][run[0]]) for run in runs}
        with tqdm(total=sum(epochs.values()), desc="train STAG", unit="epoch") as bar:
            rows = dict(workers.run(train_run, runs, bar, steps=epochs))
    files.write_csv(workspace.stag("glove"), COLUMNS, (row for key in sorted(rows) for row in rows[key]))


if __name__ == "__main__":
    arguments.run(main)
