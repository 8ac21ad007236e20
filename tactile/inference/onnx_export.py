"""Write a saved network as ONNX, for programs and devices without torch, and check the file against the network.

The file takes readings as they come from the sensor and gives predictions in the card's unit: scaling is part of it.
A model that carries a state takes it as further inputs and gives the next one as further outputs.
"""

import json
import logging
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

import numpy as np
import torch
from torch import nn

from tactile.base.errors import InputError
from tactile.datasets.images import HIGHEST
from tactile.inference import card as cards
from tactile.inference import compiled_lomp
from tactile.inference.card import Card
from tactile.inference.onnx_network import CARD, NAME, READINGS, REPEATED, TENSORS, ZERO, OnnxNetwork, Tensor
from tactile.inference.onnx_regressions import Regression, is_regression
from tactile.inference.predictor import Predictor
from tactile.learning.image_classifier import ImageClassifier
from tactile.learning.lomp_network import Lomp, LompRegressor
from tactile.learning.lstm import LstmRegressor
from tactile.learning.regressors import Scaled, TorchRegressor
from tactile.learning.series_regressors import StateReadout
from tactile.models.lomp_stream import LARGEST_STATE, StreamingLomp
from tactile.models.lstm_highpass import HighpassLstm

OUTPUTS = {
    "kPa": "map_kpa",
    "% contact": "map_contact_percent",
    "N": "force_n",
    "mm": "position_mm",
    "probability": "probabilities",
}
MOST_DIFFERENCE = 1e-4  # of full scale, from torch
ROWS, STEPS = 16, 32  # of a check: windows, images or streams, and readings of a stream
LARGEST_FOLDED = 1 << 30  # bytes of weights that are computed once, in the export
REACH = 2.0  # spreads from the mean to either end of the range that readings are drawn from


class Graph(NamedTuple):
    """What is written: a module that maps (readings, *states) to (predictions, *next states), and its tensors."""

    module: nn.Module
    readings: Tensor
    states: list[Tensor]
    outputs: Tensor

    @property
    def inputs(self) -> list[Tensor]:
        """All inputs in their order."""
        return [self.readings, *self.states]

    @property
    def results(self) -> list[Tensor]:
        """All outputs in their order; the next state of `h` is `next_h`."""
        return [self.outputs, *(state._replace(name=f"next_{state.name}", start=None) for state in self.states)]


def export(model: Predictor, folder: Path) -> float:
    """Write a saved network as NAME into a folder that exists, and return how far it is from torch, of full scale.

    A card in that folder, which has to be the model's, then names the file.

    Raises InputError for a model that ONNX cannot hold, and where predictions differ from its own by more than
    MOST_DIFFERENCE.
    """
    graph, path = graph_of(model), folder / NAME
    write(graph, model.card, path)
    readings = random_readings(model, graph)
    differs = difference(model, run(path, readings), by_model(model, readings))
    if not differs <= MOST_DIFFERENCE:  # NaN, too
        raise InputError(
            f"{_name(model)}: as ONNX it differs from itself by {differs:.1g} of full scale, more than "
            f"{MOST_DIFFERENCE:g}; export it without --onnx"
        )
    if (folder / cards.NAME).is_file():
        cards.write(folder, model.card)
    return differs


def faster(model: Predictor, folder: Path) -> Predictor:
    """Return a saved model in ONNX Runtime, where that is faster: all that can be written as ONNX but LoMP.

    The file is written into `folder`, which exists, and is not needed afterwards. Raises InputError as `export`.
    """
    if model.onnx is not None or model.card.model in compiled_lomp.MODELS:
        return model
    try:
        graph_of(model)
    except InputError:
        return model
    export(model, folder)
    return Predictor(OnnxNetwork(folder / NAME), model.card, lambda: model.model)


def _name(model: Predictor) -> str:
    return f"{model.card.experiment}/{model.card.model}"


def graph_of(model: Predictor) -> Graph:
    """Return what is to be written of a saved model; InputError for a model that ONNX cannot hold."""
    inner, card = model.model, model.card
    columns, unit, order = card.inputs.columns, card.inputs.unit, card.inputs.order
    names = f", {', '.join(card.outputs.names)}" if card.outputs.names else ""
    outputs = Tensor(OUTPUTS[card.outputs.unit], ("n", *model.output_shape), f"{card.outputs.unit}{names}")
    one = Tensor(READINGS, ("n", columns), f"{unit}: the next reading of n streams, {order}")
    apart_s = card.inputs.frame_step * card.inputs.interval_s
    windows = Tensor(
        READINGS,
        ("n", card.shapes.frames, columns),
        f"{unit}: windows of readings that are {apart_s:g} s apart, the oldest first; {order}",
    )
    if isinstance(inner, StreamingLomp):
        state = Tensor("state", (inner.spec.elements, "n", inner.network.hidden), "state of the elements", ZERO)
        return Graph(_Stream(_plain(inner), model.output_shape), one, [state], outputs)
    maps = nn.Unflatten(1, model.output_shape)
    if isinstance(inner, LompRegressor):
        return Graph(nn.Sequential(_plain(inner), maps), windows, [], outputs)
    if isinstance(inner, ImageClassifier):
        images = Tensor(READINGS, ("n", 1, inner.spec.elements), f"0 to {HIGHEST:g}: images, row by row")
        return Graph(nn.Sequential(inner.scaled, nn.Softmax(1)), images, [], outputs)
    if is_regression(inner):
        return Graph(Regression(inner, model.output_shape), windows, [], outputs)
    if isinstance(inner, TorchRegressor):
        return Graph(nn.Sequential(inner.scaled, maps), windows, [], outputs)
    if isinstance(inner, LstmRegressor):
        return Graph(_Lstm(inner, card), one, _lstm_states(inner.network.lstm), outputs)
    if isinstance(inner, HighpassLstm):
        recent = Tensor(
            "recent", ("n", inner.taps - 1, columns), f"{unit}: the readings before, oldest first", REPEATED
        )
        return Graph(_Highpass(inner, card), one, [recent, *_lstm_states(inner.network.lstm)], outputs)
    if isinstance(inner, StateReadout):
        state = Tensor("state", ("n", len(inner.system["reservoir"])), "state of the reservoir", ZERO)
        return Graph(_Reservoir(inner, card), one, [state], outputs)
    raise InputError(
        f"{_name(model)}: cannot be written as ONNX, only networks and regressions can; export it without --onnx"
    )


def _plain(model: LompRegressor) -> Scaled:
    """Return LoMP, its scalings included, in operations that ONNX has."""
    of = model.scaled
    return Scaled(_Lomp(model.network), of.input_mean, of.input_spread, of.output_scale)


def _lstm_states(lstm: nn.LSTM) -> list[Tensor]:
    return [Tensor(name, (1, "n", lstm.hidden_size), f"state {name} of the LSTM", ZERO) for name in "hc"]


class _Lomp(nn.Module):
    """LoMP between its scalings, named as in tactile/learning/lomp_network.py, whose reuse of memory ONNX has not."""

    def __init__(self, network: Lomp):
        super().__init__()
        self.cells, self.hidden, self.alpha = network.spec.elements, network.hidden, network.alpha
        self.grid, self.block = (network.spec.rows, network.spec.cols), network.block
        gate_bias = network.gate_input_bias + network.gate_state_bias
        arrays = {
            "inputs": torch.cat([network.gate_input, network.candidate_input], 2),
            "input_bias": network.candidate_input_bias,
            "state": torch.cat([network.gate_state, network.candidate_state], 2),
            "state_bias": torch.cat([gate_bias, network.candidate_state_bias], 2),
            **{name: getattr(network, name) for name in ("message", "message_bias", "update", "update_bias")},
            "neighbours": network.neighbours,
        }
        for name, array in arrays.items():
            self.register_buffer(name, array.detach())
        self.readout, self.readout_bias = (
            nn.ParameterList(part.detach().contiguous() for part in parts)
            for parts in zip(*network.readouts(), strict=True)
        )

    def after(self, x: torch.Tensor, h: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """Return h1 and h (elements, n, hidden) after a normalised frame x (n, elements)."""
        of_x, of_h = x.t().unsqueeze(2) * self.inputs, torch.baddbmm(self.state_bias, h, self.state)
        gates = 2 * self.hidden
        r, z = torch.sigmoid(of_x[..., :gates] + of_h[..., :gates]).chunk(2, 2)
        c = torch.tanh(of_x[..., gates:] + self.input_bias + r * of_h[..., gates:])
        h1 = c + z * (h - c)
        s = torch.relu(h1 @ self.message + self.message_bias)
        q = h1 + self.alpha * (self.neighbours @ s.flatten(1)).view_as(s)
        return h1, torch.relu(torch.baddbmm(self.update_bias, q, self.update))

    def read_out(self, h1: torch.Tensor, h: torch.Tensor) -> torch.Tensor:
        """Return normalised maps (n, outputs) for the states after the last frame."""
        p = torch.cat([h, h1], 2)
        for layer, (weight, bias) in enumerate(zip(self.readout, self.readout_bias, strict=True)):
            p = torch.baddbmm(bias, torch.relu(p) if layer else p, weight)
        return p.view(*self.grid, -1, *self.block).permute(2, 0, 3, 1, 4).flatten(1)

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        h = x.new_zeros(self.cells, len(x), self.hidden)
        for frame in x.unbind(1):
            h1, h = self.after(frame, h)
        return self.read_out(h1, h)


class _Stream(nn.Module):
    """LoMP on the next frame (n, elements) and the state (elements, n, hidden)."""

    def __init__(self, scaled: Scaled, shape: tuple[int, ...]):
        super().__init__()
        self.scaled, self.shape = scaled, shape

    def forward(self, readings: torch.Tensor, state: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        network = self.scaled.network
        h1, h = network.after(self.scaled.normalised(readings), state)
        maps = network.read_out(h1, h) * self.scaled.output_scale
        return maps.view(-1, *self.shape), h.clamp(max=LARGEST_STATE)


class _Series(nn.Module):
    """The next reading (n, columns) and states of a model of series, to outputs in mm and the next states."""

    def __init__(self, model: LstmRegressor | HighpassLstm | StateReadout, card: Card):
        super().__init__()
        chosen = range(card.inputs.columns) if card.inputs.chosen is None else card.inputs.chosen
        self.register_buffer("chosen", torch.tensor(list(chosen)))
        self.scaling = model.scaling

    def normalised(self, readings: torch.Tensor) -> torch.Tensor:
        return self.scaling.normalised(readings.index_select(-1, self.chosen))


class _Lstm(_Series):
    """The LSTM; its state is h and c (1, n, units)."""

    def __init__(self, model: LstmRegressor, card: Card):
        super().__init__(model, card)
        self.network = model.network

    def forward(self, readings: torch.Tensor, h: torch.Tensor, c: torch.Tensor) -> tuple[torch.Tensor, ...]:
        latent, state = self.network.latent(self.normalised(readings)[:, None], (h, c))
        return self.scaling.in_mm(self.network.readout(latent[:, 0])), *state


class _Highpass(_Series):
    """The LSTM behind filters; its state is the readings before this one, h and c."""

    def __init__(self, model: HighpassLstm, card: Card):
        super().__init__(model, card)
        self.network = model.network

    def forward(
        self, readings: torch.Tensor, recent: torch.Tensor, h: torch.Tensor, c: torch.Tensor
    ) -> tuple[torch.Tensor, ...]:
        x = torch.cat([recent, readings[:, None]], 1)
        outputs, state = self.network(self.normalised(x), (h, c))
        return self.scaling.in_mm(outputs[:, 0]), x[:, 1:], *state


class _Reservoir(_Series):
    """An echo state network; its state is (n, units), and the read-out is float64."""

    def __init__(self, model: StateReadout, card: Card):
        super().__init__(model, card)
        self.leak = card.settings["leak"]
        for name, array in model.system.items():
            self.register_buffer(name, torch.from_numpy(array))
        self.register_buffer("readout", torch.from_numpy(model.weights))

    def forward(self, readings: torch.Tensor, state: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        drive = torch.tanh(self.normalised(readings)) @ self.input + self.bias
        state = (1 - self.leak) * state + self.leak * torch.tanh(state @ self.reservoir.t() + drive)
        outputs = state.double() @ self.readout[:-1] + self.readout[-1]
        return self.scaling.in_mm(outputs.float()), state


def write(graph: Graph, card: Card, path: Path) -> None:
    """Write a graph as ONNX to `path`, with the card and a description of all tensors in its metadata."""
    import onnx
    from onnxscript import optimizer

    rows = torch.export.Dim("n")
    shapes = [{axis: rows for axis, size in enumerate(tensor.shape) if size == "n"} for tensor in graph.inputs]
    example = tuple(torch.zeros([3 if size == "n" else size for size in tensor.shape]) for tensor in graph.inputs)
    with _quiet(), torch.no_grad():
        # Strict: only so does the number of rows stay free where a network calls len(x).
        program = torch.export.export(graph.module.eval(), example, dynamic_shapes=tuple(shapes), strict=True)
        exported = torch.onnx.export(
            program,
            (),
            input_names=[tensor.name for tensor in graph.inputs],
            output_names=[tensor.name for tensor in graph.results],
            dynamo=True,
            verbose=False,
        )
        # The exporter leaves weights that it cuts or reorders to be cut in every run; VGG then has 60 MB, not 14.
        made = optimizer.optimize(
            exported.model_proto, input_size_limit=LARGEST_FOLDED, output_size_limit=LARGEST_FOLDED
        )
    described = {
        tensor.name: {key: value for key, value in tensor._asdict().items() if key != "name" and value is not None}
        for tensor in (*graph.inputs, *graph.results)
    }
    del made.graph.value_info[:]  # shapes between the layers, which ONNX Runtime infers
    values = [*made.graph.input, *made.graph.output]
    for part in (*made.graph.node, *values):
        del part.metadata_props[:]  # where in whose files each was called: a third of a small file
    for dimension in (dimension for value in values for dimension in value.type.tensor_type.shape.dim):
        if dimension.dim_param:
            dimension.dim_param = "n"  # the exporter has another name for the number of rows
    onnx.helper.set_model_props(made, {TENSORS: json.dumps(described), CARD: card.of_network().model_dump_json()})
    path.write_bytes(made.SerializeToString())


@contextmanager
def _quiet() -> Iterator[None]:
    """Keep what the exporter says about packages and functions that are not used here from the user."""
    before = logging.root.manager.disable
    logging.disable(logging.WARNING)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    finally:
        logging.disable(before)


def run(path: Path, readings: np.ndarray) -> np.ndarray:
    """Return predictions (steps, n, ...) of a file for readings (steps, n, ...), the state carried along."""
    network = OnnxNetwork(path)
    return np.stack([network.step(step) for step in readings])


def by_model(model: Predictor, readings: np.ndarray) -> np.ndarray:
    """Return predictions (steps, n, outputs) of the model itself for readings as of `run`; more than one row."""
    inner, card = model.model, model.card
    model.reset()
    if card.kind == "series":
        chosen = slice(None) if card.inputs.chosen is None else card.inputs.chosen
        predicted = np.stack([inner.step(step[:, chosen]) for step in readings])
    elif inner.streams:
        predicted = np.stack([inner.step(step) for step in readings])
    else:
        predicted = np.stack([inner.predict(step) for step in readings])
    model.reset()
    return predicted


def random_readings(model: Predictor, graph: Graph) -> np.ndarray:
    """Return readings (steps, ROWS, ...) from the range that the training's normalisation stands for."""
    rng, inner, card = np.random.default_rng(0), model.model, model.card
    steps = STEPS if graph.states else 1
    shares = rng.uniform(-REACH, REACH, (steps, ROWS, *graph.readings.shape[1:])).astype(np.float32)
    if isinstance(inner, ImageClassifier):
        brightness = np.linspace(0, HIGHEST, ROWS, dtype=np.float32)[:, None, None]  # of all: one object, without doubt
        return (shares + REACH) / (2 * REACH) * brightness
    if isinstance(graph.module, Regression):
        mean, spread = graph.module.scaling(graph.readings.shape[1:])
        return (mean + spread * shares).astype(np.float32)
    if card.kind == "windows":
        return inner.scaled.input_mean.numpy() + inner.scaled.input_spread.numpy() * shares
    mean, spread = (in_columns(values.numpy(), card) for values in (inner.scaling.x_mean, inner.scaling.x_spread))
    return mean + spread * shares


def in_columns(values: np.ndarray, card: Card) -> np.ndarray:
    """Return values (..., channels) of a model of series in the columns of a reading (..., columns); others are 0."""
    wide = np.zeros((*values.shape[:-1], card.inputs.columns), np.float32)
    wide[..., slice(None) if card.inputs.chosen is None else card.inputs.chosen] = values
    return wide


def full_scale(model: Predictor) -> np.ndarray:
    """Return full scale in the card's unit: the largest label of training, 1 of probabilities, the range of places."""
    if model.card.kind == "images":
        return np.float32(1)
    if model.card.kind == "windows":
        return model.model.scaled.output_scale.numpy()
    return 2 * REACH * model.model.scaling.y_spread.numpy()


def difference(model: Predictor, predicted: np.ndarray, others: np.ndarray) -> float:
    """Return the largest difference of predictions (steps, n, ...), share of full scale; NaN where one is NaN.

    Of a regression, which does not know its labels' range, full scale is the largest of the other predictions.
    """
    scale = np.abs(others).max() if is_regression(model.model) else full_scale(model)
    return float((np.abs(predicted.reshape(others.shape) - others) / scale).max())
