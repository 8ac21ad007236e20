"""Run a network that was written as ONNX, in ONNX Runtime on one thread of the CPU.

One prediction takes a third to an eighth of torch's time (reports/benchmarks/inference.csv).
"""

import contextlib
import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np
import onnxruntime

from tactile.base import foreign
from tactile.inference import card as cards

NAME = cards.ONNX
CARD, TENSORS = "card", "tensors"  # keys of the file's metadata: card.json, and what its inputs and outputs are
READINGS = "readings"  # name of the first input
ZERO, REPEATED = "zero", "the first reading, repeated"  # what a state is before the first reading
NUMBERS = "tensor(float)"  # type of every input and output
LARGEST = 1 << 24  # numbers of an input or output of one stream; a state of 8,192 units and 100 readings has a tenth
WHAT = "a network that `tactile export MODEL FOLDER --onnx` wrote"


class Tensor(NamedTuple):
    """An input or output of the file. In its shape, `n` is any number of windows, images or streams."""

    name: str
    shape: tuple[int | str, ...]
    what: str  # unit and order
    start: str | None = None  # of a state: ZERO or REPEATED


def session(path: Path) -> onnxruntime.InferenceSession:
    """Return what runs an ONNX file on one thread of the CPU.

    Weights that the file says lie in another one, which no card would name, are looked for in a folder that cannot be.
    """
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    options.log_severity_level = 4  # none: what goes wrong is raised, too
    options.add_session_config_entry("session.model_external_initializers_file_folder_path", str(path.absolute()))
    with contextlib.redirect_stdout(None):  # where it says what it raises
        return onnxruntime.InferenceSession(path, options, providers=["CPUExecutionProvider"])


def first_states(states: Iterable[Tensor], readings: np.ndarray) -> dict[str, np.ndarray]:
    """Return the states of n streams before their first readings (n, columns), by name."""
    first = {}
    for tensor in states:
        zero = np.zeros([len(readings) if size == "n" else size for size in tensor.shape], np.float32)
        first[tensor.name] = zero + readings[:, None] if tensor.start == REPEATED else zero
    return first


class OnnxNetwork:
    """A network in a file that `onnx_export.write` made. Readings are float32, as the file's card says.

    What ONNX Runtime makes of a damaged or crafted file, when it is opened and at every prediction, is an InputError.
    """

    def __init__(self, path: Path):
        self._path = path
        with foreign.reading(path, WHAT, cards.AGAIN):
            self._session = session(path)
            held = self._session.get_modelmeta().custom_metadata_map
            self.card = held[CARD]  # JSON
            tensors = [Tensor(name, **described) for name, described in json.loads(held[TENSORS]).items()]
            tensors = [tensor._replace(shape=tuple(tensor.shape)) for tensor in tensors]
            count = len(self._session.get_inputs())
            self.readings, self._states, self._results = tensors[0], tensors[1:count], tensors[count:]
            self._check()
        self.streams = bool(self._states)
        self.reset()
        first = np.zeros([1 if size == "n" else size for size in self.readings.shape], np.float32)
        self.step(first) if self.streams else self.predict(first)
        self.reset()

    def reset(self) -> None:
        """Begin a new stream."""
        self.state: dict[str, np.ndarray] | None = None  # before the next reading; None: of a new stream
        self._count = 0  # streams of `state`

    @property
    def predictions(self) -> Tensor:
        """What a prediction is."""
        return self._results[0]

    def _check(self) -> None:
        """Raise ValueError where the file's inputs and outputs are not those that its metadata describe."""
        given = [*self._session.get_inputs(), *self._session.get_outputs()]
        described = [self.readings, *self._states, *self._results]
        if [(each.name, tuple(each.shape), each.type) for each in given] != [
            (tensor.name, tensor.shape, NUMBERS) for tensor in described
        ]:
            raise ValueError("its inputs and outputs are not those that it describes")
        sizes = [[size for size in tensor.shape if size != "n"] for tensor in described]
        if (
            any(not isinstance(size, int) or size < 1 for of in sizes for size in of)
            or max(map(np.prod, sizes)) > LARGEST
        ):
            raise ValueError("its inputs and outputs have sizes that no sensor has")
        next_ones = [(tensor.shape, f"next_{tensor.name}") for tensor in self._states]
        if self.readings.name != READINGS or [(each.shape, each.name) for each in self._results[1:]] != next_ones:
            raise ValueError("it does not give the state that it takes")

    def _run(self, given: Mapping[str, np.ndarray]) -> list[np.ndarray]:
        """Return all results for the inputs by name."""
        with foreign.reading(self._path, WHAT, cards.AGAIN):
            found = self._session.run(None, given)
            n = len(given[READINGS])
            for tensor, result in zip(self._results, found, strict=True):
                if result.shape != tuple(n if size == "n" else size for size in tensor.shape):
                    raise ValueError(f"gives {tensor.name} of the shape {result.shape}")
        return found

    def predict(self, x: np.ndarray) -> np.ndarray:
        """Return predictions (n, ...) of a network without a state for windows or images x (n, ...)."""
        return self._run({READINGS: x})[0]

    def step(self, x: np.ndarray) -> np.ndarray:
        """Return predictions (n, ...) for the next readings x (n, ...) of n streams, the state carried along.

        Another number of streams than in the call before starts all of them anew.
        """
        if self.state is None or len(x) != self._count:
            self.state, self._count = first_states(self._states, x), len(x)
        predicted, *following = self._run({READINGS: x, **self.state})
        self.state = dict(zip(self.state, following, strict=True))
        return predicted
