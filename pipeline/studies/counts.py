"""Count multiply-accumulates and parameters of the glove's networks, at the published shapes and at ours.

Usage: python -m pipeline.studies.counts
"""

from decimal import Decimal
from pathlib import Path

import torch
from torch import nn

from pipeline.results import published
from pipeline.studies.operations import operations
from tactile.base import arguments, files, params
from tactile.base.paths import Workspace
from tactile.learning import cost
from tactile.models import mobilenet, resnet3x3, resnet18, sp_resnet, sp_resnet_nogcam

COLUMNS = ("experiment", "model", "input_shape", "classes", "macs", "params")
COLUMNS += ("published_macs", "published_params", "verdict", "note")
PHOTO, IMAGE = (3, 224, 224), (1, 32, 32)  # channels, rows, cols
OBJECTS = 16
REDUCTIONS = (16, 8, 4, 2, 1)  # of SP-ResNet's attention; the paper gives none
TRUNK = (
    "trunk alone; multiply-accumulates equal; the printed 6.58 is 674,240 in units of 1024 x 100: the paper's unit "
    "of 1e5 slipped"
)


def count(reduction: int, target: Path) -> None:
    """Write counts.csv to `target`; reduction: that of SP-ResNet's attention, as it is trained.

    Counts are whole numbers in the convention of `operations`. The verdict is `reproduced` where both counts,
    rounded as the paper prints them, equal its numbers, and empty where the paper has none for the shape.
    """
    paper = published.counts()
    trained = f"reduction {reduction}, as trained"
    with torch.device("meta"):  # shapes without numbers: nothing is computed
        as_published = [
            ("resnet18", resnet18.network(3, 1000), PHOTO, 1000, ""),
            ("mobilenet", mobilenet.network(3, 1000, PHOTO[1:]), PHOTO, 1000, ""),
            ("resnet3x3", resnet3x3.trunk(1), IMAGE, "", TRUNK),
            ("sp_resnet_nogcam", sp_resnet_nogcam.network(1, 1000), IMAGE, 1000, ""),
            ("sp_resnet", sp_resnet.network(1, 1000, reduction), IMAGE, 1000, trained),
        ]
        as_published += [
            ("sp_resnet", sp_resnet.network(1, 1000, other), IMAGE, 1000, f"reduction {other}")
            for other in REDUCTIONS
            if other != reduction
        ]
        like_with_like = [
            ("resnet18", resnet18.network(1, OBJECTS), IMAGE, OBJECTS, ""),
            ("mobilenet", mobilenet.network(1, OBJECTS, IMAGE[1:]), IMAGE, OBJECTS, ""),
            ("resnet3x3", resnet3x3.network(1, OBJECTS), IMAGE, OBJECTS, ""),
            ("sp_resnet_nogcam", sp_resnet_nogcam.network(1, OBJECTS), IMAGE, OBJECTS, ""),
            ("sp_resnet", sp_resnet.network(1, OBJECTS, reduction), IMAGE, OBJECTS, trained),
        ]
        rows = [_row(*each, [paper[each[0], key] for key in ("macs", "params")]) for each in as_published]
        rows += [_row(*each, None) for each in like_with_like]
    files.write_csv(target, COLUMNS, rows)


def _row(
    model: str,
    network: nn.Module,
    shape: tuple[int, int, int],
    classes: int | str,
    note: str,
    paper: list[tuple[Decimal, int]] | None,
) -> tuple:
    counts = operations(network, shape), cost.parameters(network)
    row = ("glove", model, "x".join(str(size) for size in shape), classes, *counts)
    if paper is None:
        return (*row, "", "", "", note)
    equal = all(
        (Decimal(ours) / unit).quantize(printed) == printed for ours, (printed, unit) in zip(counts, paper, strict=True)
    )
    return (*row, *(int(printed * unit) for printed, unit in paper), "reproduced" if equal else "contradicted", note)


def main(workspace: Workspace) -> None:
    """Count with the reduction of params.yaml."""
    arguments.parse(__doc__)
    count(params.load(workspace.params)["glove"]["models"]["sp_resnet"]["reduction"], workspace.reports / "counts.csv")


if __name__ == "__main__":
    arguments.run(main)
