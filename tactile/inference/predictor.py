"""Predict with a saved model: readings in, maps, positions or probabilities out. numpy only at its edges.

from tactile.inference.predictor import load

model = load("pretrained/touch/lomp_stream")
maps = model.predict(readings)   # (n, 25) ADC counts -> (n, 20, 20) kPa
for reading in device:           # (25,)
    map_kpa = model.step(reading)    # (20, 20)
"""

import copy
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from functools import cached_property
from pathlib import Path

import numpy as np
import pyarrow as pa

from tactile import experiments
from tactile.base import foreign, ranges
from tactile.base.errors import InputError
from tactile.datasets import images, schemas
from tactile.inference import card as cards
from tactile.inference import compiled_lomp, consistent, intervals
from tactile.inference.onnx_network import NAME, OnnxNetwork

SOME_WINDOWS = 4096  # predicted at once: 4 MB of LoMP's windows
CARRIED = ("state", "recent", "buffer")  # attributes in which models keep what their next `step` needs


class Predictor:
    """A saved model and its card. Readings are in the unit and order that `card.inputs` says, predictions in
    `card.outputs`. Predictions of a model of windows are NaN until it has seen a whole window, also those of a model
    that carries a state: started in mid-press, or at rest, it reports forces that are not there.
    """

    def __init__(self, network, card: cards.Card, made: Callable[[], object] | None = None):
        """network: what predicts; made: makes the model in torch or scikit-learn, where that is another."""
        self.network, self.card, self._made = network, card, made
        self.output_shape = card.output_shape  # of one prediction
        self.reset()

    @cached_property
    def model(self):
        """The model as it was trained."""
        return self._made() if self._made else self.network

    @property
    def interval_sentences(self) -> list[str]:
        """What the intervals of its predictions are, and where they held too little or much."""
        return intervals.sentences(self.card)

    def order(self, reading: Mapping[str, Mapping]) -> list[int]:
        """Return the numbers of the printed values in the order in which `step` takes them; [] where it is the same.

        reading: blocks of settings by which lines are read.
        """
        return reading.get("sensor", {}).get("order", [])

    @property
    def as_trained(self) -> bool:
        """Whether the model as it was trained predicts, in torch or scikit-learn."""
        return self._made is None

    @property
    def onnx(self) -> OnnxNetwork | None:
        """The model's network in ONNX Runtime, if that predicts."""
        return self.network if isinstance(self.network, OnnxNetwork) else None

    def reset(self, frame_step: int | None = None) -> None:
        """Forget what `step` has seen, and let `frame_step` readings lie between two frames (None: as the card says).

        For readings that come more often than one every `card.inputs.interval_s`; of a series, a frame is a sample.
        """
        self._frame_step = frame_step or self.card.inputs.frame_step
        self._count = 0
        self._carried = {}  # a stream for each reading of a step that was seen
        self._last = deque(maxlen=self.card.reach(self._frame_step) + 1)
        self._outside = deque(maxlen=self._last.maxlen)  # of the readings that `step` was given
        self._put({})

    def read_as(self, reading: Mapping[str, Mapping]) -> "Predictor":
        """Return this model with `reading` in its card, for logs that are read by other settings than its training's.

        Predictions are the same; both share one stream of `step`.
        """
        other = copy.copy(self)
        other.card = self.card.model_copy(update={"reading": reading})
        return other

    def predict(self, readings: np.ndarray, frame_step: int | None = None) -> np.ndarray:
        """Return one prediction per reading, (n, *output_shape) float32.

        readings: (n, columns), or (n, rows, cols) of a touch sensor, none missing, one every `card.inputs.interval_s`
        or, if `frame_step` is given, so many of them from one frame of a window to the next. A prediction uses its own
        reading and earlier ones. Raises InputError for another number of columns.
        """
        predicted, after = np.empty((len(readings), *self.output_shape), np.float32), 0
        for part in self.in_parts(readings, frame_step):
            predicted[after : after + len(part)] = part
            after += len(part)
        return predicted

    def in_parts(self, readings: np.ndarray, frame_step: int | None = None) -> Iterator[np.ndarray]:
        """Yield what `predict` returns, some readings at a time, (k, *output_shape) float32; takes the same."""
        x, frame_step = self._checked(readings), frame_step or self.card.inputs.frame_step
        if not len(x):
            return
        if self.card.kind == "windows":
            parts = self._streamed(x, frame_step) if self.network.streams else self._windowed(x, frame_step)
        else:
            parts = iter([self._of_series(x) if self.card.kind == "series" else self._of_images(x)])
        for part in parts:
            yield part.reshape(len(part), *self.output_shape).astype(np.float32, copy=False)

    @property
    def streams(self) -> bool:
        """Whether it is a model of windows that carries a state along."""
        return self.card.kind == "windows" and self.network.streams

    def of_windows(self, x: np.ndarray, previous: np.ndarray | None = None) -> np.ndarray:
        """Return predictions (n, outputs) of a model of windows for windows x (n, frames, columns).

        previous (n,): of a model that `streams`, index of the window that ends just before each window starts, or -1.
        """
        given = (x,) if previous is None else (x, previous)
        return self.network.predict(*given).reshape(len(x), int(np.prod(self.output_shape)))

    def step(self, reading: np.ndarray, unmeasured: bool = False, t_s: float | None = None) -> np.ndarray:
        """Return the prediction for the next reading of one stream, output_shape float32; reading: (columns,).

        unmeasured: as of `outside`; t_s: its time, which only the model of a target of one's own needs
        (live/target_stream.py). Raises InputError for another number of columns.
        """
        x = self._checked(np.asarray(reading)[None])
        self._outside.append(unmeasured or ranges.outside(x, self.card.trained_on)[0])
        phase, self._count = self._count % self._frame_step, self._count + 1
        if self.card.kind == "images":
            predicted = self._of_images(x)
        elif self.card.kind == "series" or self.network.streams:
            self._put(self._carried.get(phase, {}))
            predicted = self.network.step(x if self.onnx else self._chosen(x))
            self._carried[phase] = {name: getattr(self.network, name, None) for name in CARRIED}
            if self._count <= self.card.reach(self._frame_step):
                predicted = np.full(self.output_shape, np.nan)
        else:
            self._last.append(x[0])
            if len(self._last) < self._last.maxlen:
                return np.full(self.output_shape, np.nan, np.float32)
            window = np.stack(list(self._last)[:: self._frame_step])
            predicted = self.network.predict(window[None])
        return np.asarray(predicted, np.float32).reshape(self.output_shape)

    def outside(
        self, readings: np.ndarray, frame_step: int | None = None, unmeasured: np.ndarray | None = None
    ) -> np.ndarray:
        """Return which readings lie outside what the model was trained on, (n,) bool; none where its card cannot tell.

        Of a model of windows, a reading is outside where any frame of the window that it ends is; of a series, where it
        is itself, although what the model carries along has seen earlier ones. Takes what `predict` takes; unmeasured:
        (n,) bool, readings that are no measurement, which are outside whatever they are.
        """
        x, frame_step = self._checked(readings), frame_step or self.card.inputs.frame_step
        frame = ranges.outside(x, self.card.trained_on)
        if unmeasured is not None:
            frame |= unmeasured
        found = frame.copy()
        for back in range(frame_step, min(self.card.reach(frame_step), len(x)) + 1, frame_step):
            found[back:] |= frame[: len(x) - back]
        return found

    @property
    def stepped_outside(self) -> bool:
        """Whether the reading that `step` saw last is outside, as of `outside`."""
        return any(list(self._outside)[:: -self._frame_step])

    def intervals(
        self, predicted: np.ndarray, readings: np.ndarray, frame_step: int | None = None
    ) -> dict[str, np.ndarray | list[list[str] | None]]:
        """Return the intervals of predictions (n, *output_shape), see intervals.columns; {} without a calibration.

        readings, frame_step: what `predict` was given, since readings outside the training have no interval.
        """
        return intervals.columns(predicted, self.outside(readings, frame_step), self.card)

    def _put(self, carried: Mapping) -> None:
        """Give the model what a stream has carried along so far; nothing for a new one."""
        for name in CARRIED:
            if hasattr(self.network, name):
                setattr(self.network, name, carried.get(name))

    def _checked(self, readings: np.ndarray) -> np.ndarray:
        """Return readings as (n, columns) float32."""
        columns, readings = self.card.inputs.columns, np.asarray(readings)
        x = readings.reshape(len(readings), -1) if readings.ndim > 1 and len(readings) else readings
        if len(readings) and (x.ndim != 2 or x.shape[1] != columns):
            raise InputError(
                f"readings of shape {readings.shape}: {self.card.title} takes (n, {columns}) "
                f"{self.card.inputs.unit}, {self.card.inputs.order}"
            )
        return x.reshape(-1, columns).astype(np.float32, copy=False)

    def _chosen(self, x: np.ndarray) -> np.ndarray:
        """Return the columns that the model sees, in its order."""
        return x if self.card.inputs.chosen is None else x[:, self.card.inputs.chosen]

    def _of_series(self, x: np.ndarray) -> np.ndarray:
        """Return predictions (n, outputs) of one series from its first reading on."""
        if not self.onnx:
            return self.network.predict(self._chosen(x))
        self._put({})
        predicted = np.concatenate([self.network.step(reading[None]) for reading in x])
        self._put({})
        return predicted

    def _windowed(self, x: np.ndarray, frame_step: int) -> Iterator[np.ndarray]:
        """Yield predictions of the windows that end at each reading, NaN before the first whole one."""
        reach = self.card.reach(frame_step)
        yield np.full((min(reach, len(x)), *self.output_shape), np.nan, np.float32)
        offsets = np.arange(-reach, 1, frame_step)
        for first in range(reach, len(x), SOME_WINDOWS):
            some = np.arange(first, min(first + SOME_WINDOWS, len(x)))
            yield self.network.predict(x[some[:, None] + offsets])

    def _streamed(self, x: np.ndarray, frame_step: int) -> Iterator[np.ndarray]:
        """Yield predictions of a model that carries its state, one stream per reading of a step.

        NaN until a stream has seen as many frames as a window has.
        """
        streams, reach = min(frame_step, len(x)), self.card.reach(frame_step)
        missing = -len(x) % streams
        padded = np.concatenate([x, np.repeat(x[-1:], missing, axis=0)]).reshape(-1, streams, x.shape[1])
        carried, some = {}, max(1, SOME_WINDOWS // streams)
        for first in range(0, len(padded), some):
            frames = padded[first : first + some]
            predicted = np.empty((*frames.shape[:2], int(np.prod(self.output_shape))), np.float32)  # filled at once
            self._put(carried)
            for each, frame in zip(predicted, frames, strict=True):
                each[:] = self.network.step(frame).reshape(streams, -1)
            carried = {name: getattr(self.network, name, None) for name in CARRIED}
            self._put({})
            before = first * streams
            predicted = predicted.reshape(-1, predicted.shape[2])[: len(x) - before]
            predicted[: max(0, reach - before)] = np.nan
            yield predicted

    def _of_images(self, x: np.ndarray) -> np.ndarray:
        """Return probabilities (n, classes) for readings (n, cells)."""
        if not len(x):
            return np.empty((0, *self.output_shape), np.float32)
        module = experiments.module(self.card.experiment)
        schema = module.frames_schema(self.card.reading)
        names = images.reading_columns(schema)
        edges = np.cumsum([schema.field(name).type.list_size for name in names])[:-1]
        parts = zip(names, np.split(x, edges, axis=1), strict=True)
        frames = pa.table({name: schemas.lists(part, pa.float32()) for name, part in parts})
        pictures = module.images(frames, self.card.reading)[images.modality(self.card.protocol)]
        return self.network.predict(pictures.reshape(len(x), 1, -1).astype(np.float32))


def load(folder: str | Path) -> Predictor:
    """Return the saved model in a folder that `tactile export` made, ready to predict on the CPU.

    LoMP runs in compiled code, a network with model.onnx beside its weights in ONNX Runtime, and others in torch.
    Raises InputError where the folder lacks its card or weights, or where these do not belong together.
    """
    folder = Path(folder)
    card = consistent.read(folder)

    def made():
        from tactile.inference import torch_model  # here, because the import of torch takes a second

        return torch_model.load(folder, card)

    if card.model in compiled_lomp.MODELS:
        with foreign.reading(folder / cards.NAME, "a card whose settings fit its shapes", cards.AGAIN):
            return Predictor(compiled_lomp.CompiledLomp(folder, card), card, made)
    path = folder / NAME
    if not path.is_file():
        return Predictor(made(), card)
    onnx = OnnxNetwork(path)
    with foreign.reading(path, "a network with its card", cards.AGAIN):
        of_onnx = cards.Card.model_validate_json(onnx.card)
    columns, shapes = card.inputs.columns, card.shapes
    taken = {"windows": (shapes.frames, columns), "series": (columns,), "images": (1, shapes.rows * shapes.cols)}
    expected = ("n", *taken[card.kind]), ("n", *card.output_shape)
    if of_onnx != card.of_network() or (onnx.readings.shape, onnx.predictions.shape) != expected:
        raise InputError(f"{path}: is not of the model of {cards.NAME}; {cards.AGAIN}")
    return Predictor(onnx, card, made)
