"""Run a network that was written as ONNX, in ONNX Runtime on one thread of the CPU.

One prediction takes a third to an eighth of torch's time (reports/benchmarks/inference.csv).
"""

import json
from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

import numpy as np
import onnxruntime

from pipeline.inference.card import ONNX as NAME

CARD, TENSORS = "card", "tensors"  # keys of the file's metadata: card.json, and what its inputs and outputs are
READINGS = "readings"  # name of the first input
ZERO, REPEATED = "zero", "the first reading, repeated"  # what a state is before the first reading


class Tensor(NamedTuple):
    """An input or output of the file. In its shape, `n` is any number of windows, images or streams."""

    name: str
    shape: tuple[int | str, ...]
    what: str  # unit and order
    start: str | None = None  # of a state: ZERO or REPEATED


def session(path: Path) -> onnxruntime.InferenceSession:
    """Return what runs an ONNX file on one thread of the CPU."""
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    options.log_severity_level = 3  # errors
    return onnxruntime.InferenceSession(path, options, providers=["CPUExecutionProvider"])


def first_states(states: Iterable[Tensor], readings: np.ndarray) -> dict[str, np.ndarray]:
    """Return the states of n streams before their first readings (n, columns), by name."""
    first = {}
    for tensor in states:
        zero = np.zeros([len(readings) if size == "n" else size for size in tensor.shape], np.float32)
        first[tensor.name] = zero + readings[:, None] if tensor.start == REPEATED else zero
    return first


class OnnxNetwork:
    """A network in a file that `onnx_export.write` made. Readings are float32, as the file's card says."""

    def __init__(self, path: Path):
        self._session = session(path)
        held = self._session.get_modelmeta().custom_metadata_map
        self.card = held[CARD]  # JSON
        tensors = [Tensor(name, **described) for name, described in json.loads(held[TENSORS]).items()]
        self._states = [tensor for tensor in tensors if tensor.start is not None]
        self.streams = bool(self._states)
        self.state: dict[str, np.ndarray] | None = None  # before the next reading; None: of a new stream
        self._count = 0  # streams of `state`

    def predict(self, x: np.ndarray) -> np.ndarray:
        """Return predictions (n, ...) of a network without a state for windows or images x (n, ...)."""
        return self._session.run(None, {READINGS: x})[0]

    def step(self, x: np.ndarray) -> np.ndarray:
        """Return predictions (n, ...) for the next readings x (n, ...) of n streams, the state carried along.

        Another number of streams than in the call before starts all of them anew.
        """
        if self.state is None or len(x) != self._count:
            self.state, self._count = first_states(self._states, x), len(x)
        predicted, *following = self._session.run(None, {READINGS: x, **self.state})
        self.state = dict(zip(self.state, following, strict=True))
        return predicted
