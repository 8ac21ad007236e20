"""Predict with a saved model: readings in, maps, positions or probabilities out. numpy only at its edges.

from pipeline.inference.predictor import load

model = load("pretrained/touch/lomp_stream")
maps = model.predict(readings)   # (n, 25) ADC counts -> (n, 20, 20) kPa
for reading in device:           # (25,)
    map_kpa = model.step(reading)    # (20, 20)
"""

import copy
from collections import deque
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pyarrow as pa
import torch
from torch import nn
from torch.overrides import TorchFunctionMode

from pipeline import experiments, models, tasks
from pipeline.base import foreign, ranges
from pipeline.base.errors import InputError
from pipeline.datasets import images, schemas
from pipeline.inference import card as cards
from pipeline.inference import intervals
from pipeline.inference.onnx_network import NAME, OnnxNetwork
from pipeline.learning.lomp_network import LompRegressor
from pipeline.learning.regressors import Spec

SOME_WINDOWS = 4096  # predicted at once: 4 MB of LoMP's windows
CARRIED = ("state", "recent", "buffer")  # attributes in which models keep what their next `step` needs


class Predictor:
    """A saved model and its card. Readings are in the unit and order that `card.inputs` says, predictions in
    `card.outputs`. Predictions of a model of windows are NaN until it has seen a whole window, also those of a model
    that carries a state: started in mid-press, or at rest, it reports forces that are not there.
    """

    def __init__(self, model, card: cards.Card, onnx: OnnxNetwork | None = None):
        """onnx: the model's network in ONNX Runtime, which then takes its place; a whole series is faster in torch."""
        self.model, self.card, self.onnx = model, card, onnx
        self.output_shape = card.output_shape  # of one prediction
        self._network = onnx or model
        self.reset()

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
        x, frame_step = self._checked(readings), frame_step or self.card.inputs.frame_step
        if self.card.kind == "windows" and len(x):
            predicted = self._streamed(x, frame_step) if self.model.streams else self._windowed(x, frame_step)
        elif self.card.kind == "windows":
            predicted = np.empty((0, *self.output_shape))
        elif self.card.kind == "series":
            predicted = self.model.predict(self._chosen(x)) if len(x) else np.empty((0, *self.output_shape))
        else:
            predicted = self._of_images(x)
        return predicted.reshape(len(x), *self.output_shape).astype(np.float32, copy=False)

    def step(self, reading: np.ndarray, unmeasured: bool = False) -> np.ndarray:
        """Return the prediction for the next reading of one stream, output_shape float32; reading: (columns,).

        unmeasured: as of `outside`. Raises InputError for another number of columns.
        """
        x = self._checked(np.asarray(reading)[None])
        self._outside.append(unmeasured or ranges.outside(x, self.card.trained_on)[0])
        phase, self._count = self._count % self._frame_step, self._count + 1
        if self.card.kind == "images":
            predicted = self._of_images(x)
        elif self.card.kind == "series" or self.model.streams:
            self._put(self._carried.get(phase, {}))
            predicted = self._network.step(x if self.onnx else self._chosen(x))
            self._carried[phase] = {name: getattr(self._network, name, None) for name in CARRIED}
            if self._count <= self.card.reach(self._frame_step):
                predicted = np.full(self.output_shape, np.nan)
        else:
            self._last.append(x[0])
            if len(self._last) < self._last.maxlen:
                return np.full(self.output_shape, np.nan, np.float32)
            window = np.stack(list(self._last)[:: self._frame_step])
            predicted = self._network.predict(window[None])
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
            if hasattr(self._network, name):
                setattr(self._network, name, carried.get(name))

    def _checked(self, readings: np.ndarray) -> np.ndarray:
        """Return readings as (n, columns) float32."""
        columns, readings = self.card.inputs.columns, np.asarray(readings)
        x = readings.reshape(len(readings), -1) if readings.ndim > 1 and len(readings) else readings
        if len(readings) and (x.ndim != 2 or x.shape[1] != columns):
            raise InputError(
                f"readings of shape {readings.shape}: {self.card.experiment}/{self.card.model} takes (n, {columns}) "
                f"{self.card.inputs.unit}, {self.card.inputs.order}"
            )
        return x.reshape(-1, columns).astype(np.float32)

    def _chosen(self, x: np.ndarray) -> np.ndarray:
        """Return the columns that the model sees, in its order."""
        return x if self.card.inputs.chosen is None else x[:, self.card.inputs.chosen]

    def _windowed(self, x: np.ndarray, frame_step: int) -> np.ndarray:
        """Return predictions (n, outputs) of the windows that end at each reading, NaN before the first whole one."""
        predicted = np.full((len(x), int(np.prod(self.output_shape))), np.nan, np.float32)
        reach = self.card.reach(frame_step)
        rows = np.arange(reach, len(x))
        offsets = np.arange(-reach, 1, frame_step)
        for first in range(0, len(rows), SOME_WINDOWS):
            some = rows[first : first + SOME_WINDOWS]
            predicted[some] = self._network.predict(x[some[:, None] + offsets]).reshape(len(some), -1)
        return predicted

    def _streamed(self, x: np.ndarray, frame_step: int) -> np.ndarray:
        """Return predictions (n, outputs) of a model that carries its state, one stream per reading of a step.

        NaN until a stream has seen as many frames as a window has.
        """
        streams = min(frame_step, len(x))
        missing = -len(x) % streams
        padded = np.concatenate([x, np.repeat(x[-1:], missing, axis=0)]).reshape(-1, streams, x.shape[1])
        self.model.state = None
        predicted = np.empty((*padded.shape[:2], int(np.prod(self.output_shape))), np.float32)  # filled at once
        for each, frames in zip(predicted, padded, strict=True):
            each[:] = self.model.step(frames)
        predicted = predicted.reshape(-1, predicted.shape[2])[: len(x)]
        self.model.state = None
        predicted[: self.card.reach(frame_step)] = np.nan
        return predicted

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
        return self._network.predict(pictures.reshape(len(x), 1, -1).astype(np.float32))


def onnx_is_faster(model: object) -> bool:
    """Tell whether ONNX Runtime is faster for one reading: for all models but LoMP, whose own code is compiled."""
    return not isinstance(model, LompRegressor)


def size_of(model: object) -> int:
    """Return the bytes that the tensors of a model's network have."""
    networks = [value for value in vars(model).values() if isinstance(value, nn.Module)]
    return sum(each.numel() * each.element_size() for network in networks for each in network.state_dict().values())


class _Undrawn(TorchFunctionMode):
    """Leaves tensors as they are where they would be filled with normal numbers, for which torch imports its compiler.

    That takes a second, also on the device `meta`, where tensors hold nothing.
    """

    def __torch_function__(self, function, types, arguments=(), named=None):
        return arguments[0] if function is torch.Tensor.normal_ else function(*arguments, **(named or {}))


def network_bytes(model: str, spec: Spec, settings: Mapping) -> int:
    """Return the bytes that a model's network would have, without taking any; errors as `models.build`."""
    with torch.device("meta"), _Undrawn():
        return size_of(models.build(model, spec, settings, f"{cards.NAME}, settings"))


def load(folder: str | Path) -> Predictor:
    """Return the saved model in a folder that `tactile export` made, ready to predict on the CPU.

    Where model.onnx lies beside the weights, ONNX Runtime runs the network, but for LoMP, which is faster without.
    Raises InputError where the folder lacks its card or weights, or where these do not belong together.
    """
    folder = Path(folder)
    card = cards.read(folder)
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
    path = folder / NAME
    if not path.is_file() or not onnx_is_faster(model):
        return Predictor(model, card)
    onnx = OnnxNetwork(path)
    with foreign.reading(path, "a network with its card", cards.AGAIN):
        of_onnx = cards.Card.model_validate_json(onnx.card)
    columns, shapes = card.inputs.columns, card.shapes
    taken = {"windows": (shapes.frames, columns), "series": (columns,), "images": (1, shapes.rows * shapes.cols)}
    expected = ("n", *taken[card.kind]), ("n", *card.output_shape)
    if of_onnx != card.of_network() or (onnx.readings.shape, onnx.predictions.shape) != expected:
        raise InputError(f"{path}: is not of the model of {cards.NAME}; {cards.AGAIN}")
    return Predictor(model, card, onnx)
