"""Train with faults: readings of a batch in which elements are dead, and gains and offsets have drifted.

A gain multiplies an element's response above rest by exp(gain N(0, 1)), an offset adds offset * span * N(0, 1), and an
element is dead, so reads `low`, with the probability `dead`: the definitions of pipeline/stability/perturbations.py, by
the levels of datasets/levels.py. Readings then stay in the sensor's range, and counts are rounded. Each example of a
batch has a draw of its own, the same in all of its frames. What validates stays as it was read, so that the epoch whose
weights are kept is chosen as without faults.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import torch

from tactile.base.errors import InputError
from tactile.datasets.levels import Levels
from tactile.datasets.seeding import generator
from tactile.settings.training import Faults


class Readings(NamedTuple):
    """The readings behind the training images, and how readings become images."""

    values: np.ndarray  # (n, cells), in the order of the images
    levels: Levels
    shown: Callable[[np.ndarray], np.ndarray]  # readings (k, cells) to images (k, pixels) in 0 .. 255


def asked(model) -> Faults | None:
    """Return the faults that a model's training has; None where it has none, or is no training of a network."""
    network = getattr(model, "inner", model)  # of a model of windows that is used on a series
    return getattr(getattr(network, "training", None), "faults", None)


def drawing(
    model, levels: Levels | None, seed: int, place: torch.device, mean: torch.Tensor, spread: torch.Tensor
) -> "FaultDraws | None":
    """Return what draws the faults of a model's training on the device `place`; None for one without faults.

    mean, spread: (elements,), by which the model's inputs are normalised. Raises InputError where the levels are not
    known.
    """
    faults = asked(model)
    if faults is None:
        return None
    if levels is None:
        raise InputError(
            "training.faults: this training has images or windows without the sensor's readings, which faults are "
            "faults of; take `faults` out of the model's block"
        )
    return FaultDraws(faults, levels, seed, place, mean, spread)


class FaultDraws:
    """Draws faults by a generator of their own, so that the draws of batches are those of a training without faults."""

    def __init__(
        self, faults: Faults, levels: Levels, seed: int, place: torch.device, mean: torch.Tensor, spread: torch.Tensor
    ):
        self.faults, self.elements = faults, len(mean)
        self.rng = torch.Generator().manual_seed(int(generator(seed, "training", "faults").integers(2**62)))
        self.mean, self.spread = mean.to(place), spread.to(place)
        self.levels = Levels(
            *(
                torch.from_numpy(np.broadcast_to(np.asarray(level), self.elements).copy()).to(place, kind)
                for level, kind in zip(levels, [torch.float32] * 5 + [torch.bool] * 2, strict=True)
            )
        )

    def drawn(self, n: int) -> torch.Tensor:
        """Return the draws of n examples (n, 3, elements), on the CPU: N(0, 1) of gain and offset, 0 .. 1 of death."""
        normal = torch.randn(n, 2, self.elements, generator=self.rng)
        return torch.cat([normal, torch.rand(n, 1, self.elements, generator=self.rng)], 1)

    def changed(self, x: torch.Tensor, drawn: torch.Tensor) -> torch.Tensor:
        """Return normalised inputs x (n, frames, elements) as they are with the faults drawn, (n, 3, elements)."""
        before, faults, levels = x * self.spread + self.mean, self.faults, self.levels
        gain, offset, chance = drawn[:, :, None].unbind(1)  # (n, 1, elements)
        after = levels.rest + (before - levels.rest) * torch.exp(faults.gain * gain)
        after = after + faults.offset * levels.span * offset
        after = torch.where(chance < faults.dead, levels.low, after)
        after = torch.where(levels.whole, after.round(), after).clamp(levels.lowest, levels.highest)
        return torch.where(levels.wired, (after - self.mean) / self.spread, x)
