"""Build LoMP whose elements are alike: one set of weights for all of them, one frame or window at a time.

Its equations and the network are in pipeline/learning/lomp_network.py, where only the messages' weights are shared.
"""

from typing import Literal

from pydantic import Field

from pipeline.learning.lomp_network import alike, maker
from pipeline.learning.regressors import Spec
from pipeline.models.lomp import WindowLomp
from pipeline.settings.shared import Block, Listed, Number, Width
from pipeline.settings.training import WindowTraining


class Settings(Block):
    """Settings of a model `lomp_shared` in params.yaml."""

    hidden: Width = Field(description="Numbers in h, h1, s and m of every element")
    readout: Listed[Width] = Field(description="Width of each hidden layer of the read-out f")
    neighbours: Literal[4, 8] = Field(
        description="Elements that send messages: sharing an edge (4), or also a corner (8)"
    )
    alpha: Number = Field(description="Weight of the messages (equation 4)")
    training: WindowTraining = Field(description="How it is trained")


def build(
    spec: Spec, *, hidden: int, readout: list[int], neighbours: int, alpha: float, training: WindowTraining
) -> WindowLomp:
    """Return the untrained network; settings and errors as `lomp`'s.

    Differs from paper: not in the paper, whose elements each have a GRU, an update and a read-out of their own.
    """
    make = maker(spec, hidden, readout, neighbours, alpha)
    return WindowLomp(lambda: alike(make()), spec, training)
