"""Build LoMP with one read-out for all elements, which on an array of equal elements see more of what it is fitted to.

Its equations and the network are in tactile/learning/lomp_network.py. GRU and P stay each element's own: eq. 3 adds
messages up, so that an element tells neighbours apart by what their GRUs make of a reading. On frames of the recorded
array (fold 0, 15 epochs) the validation RMSE is 3.90 % of contact with read-outs of their own, 3.85 with one, 4.20 with
one P, too, 5.15 with one GRU but own read-outs, 5.22 with one of each, and 5.25 for a polynomial of the own reading.
"""

from typing import Literal

from pydantic import Field

from tactile.learning.lomp_network import maker
from tactile.learning.spec import Spec
from tactile.models.lomp import WindowLomp
from tactile.settings.shared import Block, Listed, Number, Width
from tactile.settings.training import WindowTraining


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

    Differs from paper: not in the paper, whose elements each have a read-out of their own.
    """
    make = maker(spec, hidden=hidden, readout=readout, neighbours=neighbours, alpha=alpha, one_readout=True)
    return WindowLomp(make, spec, training)
