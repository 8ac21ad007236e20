"""Build LoMP, the Local Message Passing Network (LoMP paper, section III), one window at a time.

Its equations and the network are in pipeline/learning/lomp_network.py.
"""

import numpy as np

from pipeline.base.blocks import Neighbours, Number, Width, Widths, WindowTraining
from pipeline.learning.lomp_network import LompRegressor, maker
from pipeline.learning.regressors import Spec


def build(
    spec: Spec, *, hidden: Width, readout: Widths, neighbours: Neighbours, alpha: Number, training: WindowTraining
) -> "WindowLomp":
    """Return the untrained network; its settings are those of `lomp_network.maker`.

    Hidden 128 and read-out widths 128, 64 give 2,741,712 parameters and 17.5e6 multiply-accumulates.
    Raises InputError as `maker`.
    Differs from paper: left open there and chosen here on validation windows: 4 neighbours, alpha 1, batches of
    32, zero state at the start of a window, loss on the last frame.
    """
    return WindowLomp(maker(spec, hidden, readout, neighbours, alpha), spec, training)


class WindowLomp(LompRegressor):
    """LoMP from a zero state at the start of every window."""

    def predict(self, x: np.ndarray) -> np.ndarray:
        """Return maps as TorchRegressor does; a single window goes through compiled code, which is faster."""
        return self.one_row(np.asarray(x[0], np.float32), None)[0] if len(x) == 1 else super().predict(x)
