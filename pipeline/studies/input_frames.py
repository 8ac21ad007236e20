"""Train the networks of figure 15 on several input frames, as STAG does: see `joined_frames`.

Trains `glove.models`' SP-ResNet and ResNet_3x3 on `input_frames.numbers` of frames of a session and scores them on sets
of frames of the test sessions: those whose predictions of the one-frame network are averaged beside. A number that no
session has is left out.
Usage: python -m pipeline.studies.input_frames glove
"""

import sys
from collections.abc import Mapping

from tqdm import tqdm

from pipeline import models
from pipeline.base import arguments, files, params, workers
from pipeline.base.errors import InputError
from pipeline.base.paths import Workspace
from pipeline.datasets import images, schemas
from pipeline.scoring import frame_sets
from pipeline.tasks import images as tasks_images

COLUMNS = ("form", "model", "seed", "frames", "metric", "unit", "value", "n")
MODELS = ("sp_resnet", "resnet3x3")


def train_run(
    workspace: Workspace, values: Mapping, experiment: str, model: str, frames: int, seed: int, report
) -> list[tuple]:
    """Train and score one network; rows of input_frames.csv, none where no session has as many frames."""
    import torch

    from pipeline.studies import joined_frames

    torch.set_num_threads(1)
    settings = values[experiment]["input_frames"]
    protocol = f"{settings['split']}_{settings['dataset']}"
    data = images.read(workspace.dataset(experiment), protocol, seed)
    seeds = values[experiment]["protocols"][protocol]["seeds"]
    wanted = ["condition", "recording", "label", *(schemas.split_column(protocol, known) for known in seeds)]
    table = schemas.read(workspace.dataset(experiment), columns=wanted)
    most, compared = frame_sets.compared_images(table, protocol, seeds)
    if frames > most:
        return []
    part = data.part.astype(object)
    part[part == "test"] = "too short"
    part[compared[seed]] = "test"
    block = params.model_settings(values, experiment, model)
    single = models.build(model, tasks_images.spec(data), block, f"{experiment}.models.{model}")
    place = single, frames, data.x, data.y, frame_sets.sessions(table), part
    scores = joined_frames.scores(*place, seed=seed, device=values["device"], progress=report)
    return [("trained", model, seed, frames, *row) for row in scores]


def main(workspace: Workspace) -> None:
    """Train and score every network, number of frames and seed of the experiment named on the command line."""
    values = params.load(workspace.params)
    experiment = arguments.parse(__doc__, experiment=["glove"]).experiment
    settings, blocks = values[experiment]["input_frames"], values[experiment]["models"]
    protocol, protocols = f"{settings['split']}_{settings['dataset']}", values[experiment]["protocols"]
    if not set(settings["seeds"]) <= set(protocols.get(protocol, {"seeds": []})["seeds"]):
        raise InputError(
            f"params/{experiment}.yaml, {experiment}.input_frames: the protocol '{protocol}' has not all of the seeds "
            f"{', '.join(map(str, settings['seeds']))}"
        )
    trained = [model for model in MODELS if model in blocks]
    runs = [(experiment, m, frames, s) for m in trained for frames in settings["numbers"] for s in settings["seeds"]]
    epochs = {run: run[2] * params.epochs(blocks[run[1]]) for run in runs}
    with tqdm(total=sum(epochs.values()), desc=f"frames {experiment}", unit="epoch") as bar:
        rows = (
            dict(workers.run(train_run, {run: (workspace, values, *run) for run in runs}, bar, steps=epochs))
            if runs
            else {}
        )
    absent = sorted({frames for (_, _, frames, _), scores in rows.items() if not scores})
    if absent:
        print(f"{experiment}: sessions have too few images for sets of {', '.join(map(str, absent))}", file=sys.stderr)
    files.write_csv(workspace.input_frames(experiment), COLUMNS, (row for run in runs for row in rows[run]))


if __name__ == "__main__":
    arguments.run(main)
