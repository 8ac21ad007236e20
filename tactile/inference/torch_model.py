"""Make the model of a package in torch, with its weights."""

from collections.abc import Mapping
from pathlib import Path

import torch
from torch import nn
from torch.overrides import TorchFunctionMode

from tactile import models, tasks
from tactile.base import foreign
from tactile.inference import card as cards
from tactile.learning.spec import Spec


class _Undrawn(TorchFunctionMode):
    """Leaves tensors as they are where they would be filled with normal numbers, for which torch imports its compiler.

    That takes a second, also on the device `meta`, where tensors hold nothing.
    """

    def __torch_function__(self, function, types, arguments=(), named=None):
        return arguments[0] if function is torch.Tensor.normal_ else function(*arguments, **(named or {}))


def network_bytes(model: str, spec: Spec, settings: Mapping) -> int:
    """Return the bytes that a model's network would have, without taking any; errors as `models.build`."""
    with torch.device("meta"), _Undrawn():
        made = vars(models.build(model, spec, settings, f"{cards.NAME}, settings")).values()
    tensors = [each for value in made if isinstance(value, nn.Module) for each in value.state_dict().values()]
    return sum(each.numel() * each.element_size() for each in tensors)


def load(folder: Path, card: cards.Card):
    """Return the model of the package in a folder, whose card is given.

    Raises InputError where settings, shapes and weights do not belong together.
    """
    spec = Spec(**card.shapes.model_dump())
    with foreign.reading(folder / cards.NAME, "a card whose settings fit its shapes", cards.AGAIN):
        size = network_bytes(card.model, spec, card.settings)  # may be more than the weights have, and than there is
        if size > cards.weights_file(folder).stat().st_size:
            raise ValueError(f"its network has {size} bytes, the file of weights less")
        built = models.build(card.model, spec, card.settings, f"{cards.NAME}, settings")
        model = tasks.of(card.experiment).adapted(built, spec)
        if not hasattr(model, "step" if card.kind == "series" else "streams"):
            raise ValueError(f"{card.model} is no model of {card.kind}")
    model.load(folder)
    return model
