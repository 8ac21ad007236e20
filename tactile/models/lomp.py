"""Build LoMP, the Local Message Passing Network (LoMP paper, section III), one window at a time.

Its equations and the network are in tactile/learning/lomp_network.py.
"""

from typing import Literal

import numpy as np
from pydantic import Field

from tactile.learning.lomp_network import LompRegressor, maker
from tactile.learning.spec import Spec
from tactile.settings.shared import Block, Listed, Number, Width
from tactile.settings.training import WindowTraining


class Settings(Block):
    """Settings of a model `lomp` in params.yaml."""

    hidden: Width = Field(description="Numbers in h, h1, s and m of every element")
    readout: Listed[Width] = Field(description="Width of each hidden layer of the read-out f")
    neighbours: Literal[4, 8] = Field(
        description="Elements that send messages: sharing an edge (4), or also a corner (8)"
    )
    alpha: Number = Field(description="Weight of the messages (equation 4)")
    start: Literal["identity", "drawn"] = Field(default="identity", description="First P: near the identity, or drawn")
    training: WindowTraining = Field(description="How it is trained")


def build(
    spec: Spec,
    *,
    hidden: int,
    readout: list[int],
    neighbours: int,
    alpha: float,
    start: str,
    training: WindowTraining,
) -> "WindowLomp":
    """Return the untrained network; its settings are those of `lomp_network.Lomp`.

    Hidden 128 and read-out widths 128, 64 give 2,741,712 parameters and 17.5e6 multiply-accumulates.
    Raises InputError as `maker`.
    Differs from paper: left open there and chosen here on validation windows: 4 neighbours, alpha 1, batches of
    32, zero state at the start of a window, loss on the last frame. An alpha of 1 is no discount, as the paper calls
    it; lower ones had higher errors.
    Differs from paper: P starts near the identity, which the paper does not say. `start: drawn` starts it as all other
    weights; the variants have its error.
    """
    drawn = start == "drawn"
    make = maker(spec, hidden=hidden, readout=readout, neighbours=neighbours, alpha=alpha, drawn=drawn)
    return WindowLomp(make, spec, training)


class WindowLomp(LompRegressor):
    """LoMP from a zero state at the start of every window."""

    def predict(self, x: np.ndarray) -> np.ndarray:
        """Return maps as TorchRegressor does; a single window goes through compiled code, which is faster."""
        return (
            self.one_row(np.asarray(x[0], np.float32), None)[0]
            if len(x) == 1 and self.place.type == "cpu"
            else super().predict(x)
        )
