"""Run a saved LoMP in compiled code, without torch: windows, or the next readings of streams, in, maps in kPa out."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from tactile.base import tensors
from tactile.inference.card import Card
from tactile.learning import lomp_shape
from tactile.learning.lomp_prediction import Prediction
from tactile.learning.spec import Spec

STREAMS, ONE_READOUT = "lomp_stream", "lomp_shared"
MODELS = ("lomp", ONE_READOUT, STREAMS)


class CompiledLomp:
    """LoMP, for windows of readings or, of `lomp_stream`, for streams that carry their state along.

    Weights are rounded to 16 bits, see lomp_prediction: predictions differ from torch's by less than 0.05 % of full
    scale.
    """

    def __init__(self, folder: Path, card: Card):
        """Read the package of a card; InputError where weights are not of its settings, or as `lomp_shape.check`."""
        spec, settings = Spec(**card.shapes.model_dump()), card.settings
        lomp_shape.check(spec, settings["neighbours"])
        found = tensors.arrays(folder)
        expected = _shapes(spec, settings, card.model == ONE_READOUT)
        if {name: (each.shape, each.dtype) for name, each in found.items()} != expected:
            raise tensors.other_settings(folder)
        self.streams = card.model == STREAMS
        self.state: np.ndarray | None = None  # (elements, streams, hidden), of `step`
        self._mean, self._spread, self._scale = (found[name] for name in ("input_mean", "input_spread", "output_scale"))
        weights = {name.removeprefix("network."): each for name, each in found.items()}
        adjacent = lomp_shape.neighbour_matrix(spec.rows, spec.cols, settings["neighbours"])
        self._prediction = Prediction(spec, weights, adjacent, settings["alpha"])

    def predict(self, x: np.ndarray, previous: np.ndarray | None = None) -> np.ndarray:
        """Return maps (n, outputs) in kPa at the end of windows x (n, frames, elements) in ADC counts.

        previous (n,): of streams, index of the window that ends just before each window starts, or -1; without it every
        window starts from a zero state.
        """
        maps, states = [], {}  # by the window that they come after
        for window, before in enumerate(np.full(len(x), -1) if previous is None else previous):
            image, state = self._run(x[window], states.pop(int(before), None))
            maps.append(image)
            if self.streams:
                states[window] = state
        return np.stack(maps) if maps else np.empty((0, self._prediction.spec.outputs), np.float32)

    def step(self, frames: np.ndarray) -> np.ndarray:
        """Return maps (n, outputs) in kPa for the next frame (n, elements) in ADC counts of n streams.

        Another number of streams than in the call before starts all of them from a zero state.
        """
        before = self.state if self.state is not None and self.state.shape[1] == len(frames) else None
        stepped = [self._run(frame[None], None if before is None else before[:, k]) for k, frame in enumerate(frames)]
        self.state = np.stack([state for _, state in stepped], axis=1)
        return np.stack([image for image, _ in stepped])

    def _run(self, frames: np.ndarray, state: np.ndarray | None) -> tuple[np.ndarray, np.ndarray]:
        """Return the map (outputs,) and the next state (elements, hidden) after frames (n, elements)."""
        image, state = self._prediction.run((frames - self._mean) / self._spread, state)
        return image * self._scale, np.minimum(state, lomp_shape.LARGEST_STATE)


def _shapes(spec: Spec, settings: Mapping, one_readout: bool) -> dict[str, tuple[tuple[int, ...], np.dtype]]:
    """Return shape and type of every tensor of the file of weights."""
    network = lomp_shape.shapes(spec, settings["hidden"], settings["readout"], one_readout)
    scaling = {"input_mean": (spec.elements,), "input_spread": (spec.elements,), "output_scale": ()}
    named = {f"network.{name}": shape for name, shape in network.items()} | scaling
    return {name: (shape, np.dtype(np.float32)) for name, shape in named.items()}
