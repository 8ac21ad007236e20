"""Find how the channels of a model's training went together, for its card."""

from collections.abc import Mapping

import numpy as np

from tactile import experiments
from tactile.base import correlation
from tactile.base.correlation import Correlation
from tactile.base.paths import Workspace
from tactile.datasets import schemas, series
from tactile.inference.card import Card


def trained(workspace: Workspace, settings: Mapping, card: Card) -> Correlation | None:
    """Return how the channels went together in the training part of the run that a card describes.

    settings: the block of its experiment. None where they tell nothing, where the dataset is not here, and of models of
    windows and images, whose channels go together as they are touched.
    """
    if card.kind != "series" or not workspace.dataset(card.experiment).exists():
        return None
    task = experiments.module(card.experiment).task(card.protocol, settings)
    parts = []
    for piece in series.read(workspace.dataset(card.experiment), task, card.protocol, card.seed):
        begins = schemas.gaps(piece.time_s, np.zeros(len(piece.time_s), int))
        parts += correlation.stretches(piece.record.x, begins, ~piece.record.training)
    found = correlation.of(parts, range(parts[0].shape[1])) if parts else None
    return found and found.model_copy(update={"columns": list(card.inputs.chosen)})
