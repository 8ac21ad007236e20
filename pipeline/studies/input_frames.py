"""Train the networks of figure 15 on several input frames, as STAG does: see `joined_frames`.

Trains `glove.models`' SP-ResNet and ResNet_3x3 on `input_frames.numbers` of frames of a session, and on one, whose
predictions of several are averaged beside; on the datasets that are not `input_frames.dataset` on one alone. They are
scored on sets of frames of the test sessions. A number that no session has is left out. Writes the scores of one seed.
Usage: python -m pipeline.studies.input_frames glove SEED
"""

import sys
from collections.abc import Mapping

from tqdm import tqdm

from pipeline.results import frame_sets
from tactile import models
from tactile.base import arguments, files, params, workers
from tactile.base.paths import Workspace
from tactile.datasets import images, schemas
from tactile.scoring import classification, metrics
from tactile.tasks import images as tasks_images

COLUMNS = ("condition", "form", "model", "seed", "frames", "metric", "unit", "value", "n")
MODELS = ("sp_resnet", "resnet3x3")
DATASETS = ("combined", "pressure")  # of figure 15


def train_run(
    workspace: Workspace, values: Mapping, experiment: str, dataset: str, model: str, frames: int, seed: int, report
) -> list[tuple]:
    """Train and score one network; rows of input_frames.csv, none where no session has as many frames."""
    import torch

    from pipeline.studies import joined_frames

    torch.set_num_threads(1)
    protocol = f"{values[experiment]['input_frames']['split']}_{dataset}"
    data = images.read(workspace.dataset(experiment), protocol, seed)
    wanted = ["condition", "recording", "label", schemas.split_column(protocol, seed)]
    table = schemas.read(workspace.dataset(experiment), columns=wanted)
    most, compared = frame_sets.compared_images(table, protocol, [seed])
    if frames > most:
        return []
    session, used = frame_sets.sessions(table), compared[seed]
    block = params.model_settings(values, experiment, model)
    single = models.build(model, tasks_images.spec(data), block, f"{experiment}.models.{model}")
    fitting = {"seed": seed, "device": values["device"], "progress": report}
    if frames > 1:
        part = data.part.astype(object)
        part[part == "test"] = "too short"
        part[used] = "test"
        scores = joined_frames.scores(single, frames, data.x, data.y, session, part, **fitting)
        return [(dataset, "trained", model, seed, frames, *row) for row in scores]
    single.fit(*(tasks_images.part_of(data, part) for part in ("train", "validation")), **fitting)
    predicted, rows = single.predict(data.x[used]), []
    for number in range(1, most + 1):
        first, means = classification.by_frames(predicted, session[used], number)
        scores = classification.scores(data.y[used][first], means)
        scores = metrics.unless_failed(scores, single.summary.best_epoch == 0)
        rows += [(dataset, "mean", model, seed, number, *row) for row in scores]
    return rows


def main(workspace: Workspace) -> None:
    """Train and score every network and number of frames of the experiment and seed named on the command line."""
    values = params.load(workspace.params)
    experiment, seed = arguments.of_study(__doc__, ["glove"])
    settings, blocks = values[experiment]["input_frames"], values[experiment]["models"]
    datasets = [name for name in DATASETS if f"{settings['split']}_{name}" in values[experiment]["protocols"]]
    numbers = {name: {1, *(settings["numbers"] if name == settings["dataset"] else ())} for name in datasets}
    trained = [model for model in MODELS if model in blocks]
    runs = [
        (experiment, dataset, model, frames, seed)
        for dataset in datasets
        for model in trained
        for frames in sorted(numbers[dataset])
    ]
    epochs = {run: run[3] * params.epochs(blocks[run[2]]) for run in runs}
    with tqdm(total=sum(epochs.values()), desc=f"frames {experiment}", unit="epoch") as bar:
        rows = (
            dict(workers.run(train_run, {run: (workspace, values, *run) for run in runs}, bar, steps=epochs))
            if runs
            else {}
        )
    absent = sorted({frames for (*_, frames, _), scores in rows.items() if not scores})
    if absent:
        print(f"{experiment}: sessions have too few images for sets of {', '.join(map(str, absent))}", file=sys.stderr)
    target = workspace.study_result(experiment, "input_frames")
    files.write_csv(target, COLUMNS, (row for run in runs for row in rows[run]))


if __name__ == "__main__":
    arguments.run(main)
