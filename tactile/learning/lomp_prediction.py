"""Predict with a trained LoMP for one window, or for the next frame of one stream, in compiled code on one thread.

A row times a matrix takes each weight once, so that the time is that of reading weights: they are int16, with a scale
per element and output, and the weights of an input that is zero, as half of the state is after relu, are not read.
Products are summed in float32. Of the touch model, a window takes a third less time than with float32 weights.

numba compiles the functions in the first prediction and keeps what it compiled beside this file or in the user's
cache. Import this module where a row is predicted, not before: the import of numba takes a second.
"""

from collections.abc import Callable, Mapping
from typing import NamedTuple

import numba
import numpy as np

from tactile.learning.spec import Spec

LARGEST = 32767  # of int16
ZERO, ONE, TWO = np.float32([0, 1, 2])  # a plain 0, 1 or 2 makes an expression float64
NO_RELU = np.float32(-np.inf)
# exp(x) = 2^n exp(r), n = x / ln 2 rounded, |r| <= ln(2) / 2
STEEPEST = np.float32(87)  # beyond it exp leaves float32; 1 / (1 + exp) has come to 0 or 1 long before
PER_LN_2 = np.float32(1 / np.log(2))
LN_2_COARSE = np.float32(355 / 512)  # 9 bits: times n it is exact
LN_2_REST = np.float32(np.log(2) - 355 / 512)
ROUNDING = np.float32(3 * 2**22 + 127)  # the lowest bits of n + ROUNDING are n and the exponent's bias of float32
MANTISSA_BITS = np.int32(23)
OVER_2, OVER_6, OVER_24, OVER_120, OVER_720 = (1 / np.float32([2, 6, 24, 120, 720])).astype(np.float32)


class Layer(NamedTuple):
    """Matrices (elements, inputs, outputs) in int16 with their scale and bias, both (elements, outputs).

    One element stands for all of them where they share a matrix.
    """

    weights: np.ndarray
    scale: np.ndarray
    bias: np.ndarray


def packed(exact: np.ndarray, bias: np.ndarray) -> Layer:
    """Return weights (elements, inputs, outputs) with their bias (elements, 1, outputs) as a Layer.

    An output with a weight that is not finite comes out as NaN or infinite.
    """
    scale = np.abs(exact).max(axis=1, keepdims=True) / np.float32(LARGEST)
    with np.errstate(invalid="ignore"):
        rounded = np.round(exact / np.where(scale == 0, ONE, scale)).astype(np.int16)
    return Layer(rounded, scale[:, 0].copy(), bias[:, 0].copy())


def compiled(function: Callable) -> Callable:
    """Return `function` compiled by numba at its first call, from then on kept in a cache where there is a folder.

    Only fused multiply-adds differ from plain float32: NaN and infinity stay what they are.
    """
    options = dict(fastmath={"contract"}, error_model="numpy")
    try:
        return numba.njit(cache=True, **options)(function)
    except RuntimeError:  # numba found no folder that it may write to
        return numba.njit(**options)(function)


@compiled
def exponential(x):
    x = -STEEPEST if x < -STEEPEST else x
    x = STEEPEST if x > STEEPEST else x
    shifted = np.float32(x * PER_LN_2 + ROUNDING)
    n = shifted - ROUNDING
    r = x - n * LN_2_COARSE - n * LN_2_REST
    series = ONE + r * (ONE + r * (OVER_2 + r * (OVER_6 + r * (OVER_24 + r * (OVER_120 + r * OVER_720)))))
    return series * np.int32(np.float32(shifted).view(np.int32) << MANTISSA_BITS).view(np.float32)


@compiled
def multiply(values, weights, scale, bias, least, nonzero, out):
    """Fill out (outputs,) with values (inputs,) times a matrix of a Layer, plus bias; what is below `least` becomes it.

    nonzero: integers (at least inputs,), overwritten.
    """
    count = 0
    for k in range(len(values)):
        nonzero[count] = k
        count += values[k] != ZERO
    out[:] = ZERO
    whole = count - count % 4
    for first in range(0, whole, 4):
        k0, k1, k2, k3 = nonzero[first], nonzero[first + 1], nonzero[first + 2], nonzero[first + 3]
        a, b, c, d = values[k0], values[k1], values[k2], values[k3]
        of_a, of_b, of_c, of_d = weights[k0], weights[k1], weights[k2], weights[k3]
        for j in range(len(out)):
            out[j] = (
                out[j]
                + a * np.float32(of_a[j])
                + b * np.float32(of_b[j])
                + c * np.float32(of_c[j])
                + d * np.float32(of_d[j])
            )
    for left in range(whole, count):
        a, of_a = values[nonzero[left]], weights[nonzero[left]]
        for j in range(len(out)):
            out[j] += a * np.float32(of_a[j])
    for j in range(len(out)):
        value = out[j] * scale[j] + bias[j]
        out[j] = least if value < least else value


@compiled
def update_gru(x, h, inputs, candidate_bias, products, h1):
    """Fill h1 (hidden,) by eq. 2 for input x and state h.

    inputs: weights of x for r, z and c (3 hidden,); products: the state's, with biases (3 hidden,), overwritten.
    """
    hidden = len(h)
    for j in range(2 * hidden):
        products[j] = ONE / (ONE + exponential(-(x * inputs[j] + products[j])))
    r, z, v = products[:hidden], products[hidden : 2 * hidden], products[2 * hidden :]
    candidate_inputs = inputs[2 * hidden :]
    for j in range(hidden):
        before = x * candidate_inputs[j] + candidate_bias[j] + r[j] * v[j]
        c = ONE - TWO / (ONE + exponential(TWO * before))  # tanh
        h1[j] = c + z[j] * (h[j] - c)


@compiled
def run(x, h, inputs, candidate_bias, state, message, update, readout, starts, neighbours, alpha):
    """Return the read-outs (elements, block) after frames x (n, elements); h (elements, hidden) is updated in place.

    The neighbours of element i are neighbours[starts[i] : starts[i + 1]].
    """
    frames, cells = x.shape
    hidden = h.shape[1]
    most_inputs = 0
    for layer in readout:
        most_inputs = max(most_inputs, layer.weights.shape[1])
    nonzero = np.empty(most_inputs, np.int64)
    products, q = np.empty(3 * hidden, np.float32), np.empty(hidden, np.float32)
    h1, s = np.empty_like(h), np.empty_like(h)
    for t in range(frames):
        for i in range(cells):
            multiply(h[i], state.weights[i], state.scale[i], state.bias[i], NO_RELU, nonzero, products)
            update_gru(x[t, i], h[i], inputs[i], candidate_bias[i], products, h1[i])
            multiply(h1[i], message.weights[0], message.scale[0], message.bias[0], ZERO, nonzero, s[i])
        for i in range(cells):
            q[:] = ZERO
            for place in range(starts[i], starts[i + 1]):
                neighbour = s[neighbours[place]]
                for j in range(hidden):
                    q[j] += neighbour[j]
            for j in range(hidden):
                q[j] = h1[i, j] + alpha * q[j]
            multiply(q, update.weights[i], update.scale[i], update.bias[i], ZERO, nonzero, h[i])
    p = np.concatenate((h, h1), axis=1)
    for number, layer in enumerate(readout):
        least = ZERO if number < len(readout) - 1 else NO_RELU
        outputs = np.empty(layer.bias.shape, np.float32)
        for i in range(cells):
            multiply(p[i], layer.weights[i], layer.scale[i], layer.bias[i], least, nonzero, outputs[i])
        p = outputs
    return p


class Prediction:
    """A trained network with packed weights, for one row at a time."""

    def __init__(self, spec: Spec, weights: Mapping[str, np.ndarray], adjacent: np.ndarray, alpha: float):
        """weights: by their names in `lomp_shape.shapes`; adjacent: as of `lomp_shape.neighbour_matrix`."""
        cells = len(adjacent)
        self.spec = spec
        self.block = (spec.map_rows // spec.rows, spec.map_cols // spec.cols)
        layers = range(sum(name.startswith("readout.") for name in weights))
        of_all = [[weights[f"{name}.{k}"] for name in ("readout", "readout_bias")] for k in layers]
        gate_bias = weights["gate_input_bias"] + weights["gate_state_bias"]
        self.arguments = (
            np.concatenate([weights["gate_input"], weights["candidate_input"]], axis=2)[:, 0].copy(),
            weights["candidate_input_bias"][:, 0].copy(),
            packed(
                np.concatenate([weights["gate_state"], weights["candidate_state"]], axis=2),
                np.concatenate([gate_bias, weights["candidate_state_bias"]], axis=2),
            ),
            packed(weights["message"][None], weights["message_bias"][None, None]),
            packed(weights["update"], weights["update_bias"]),
            tuple(packed(*(np.broadcast_to(part, (cells, *part.shape[1:])) for part in layer)) for layer in of_all),
            np.concatenate([[0], np.cumsum((adjacent > 0).sum(1))]),
            np.flatnonzero(adjacent > 0) % cells,
            np.float32(alpha),
        )

    def run(self, x: np.ndarray, h: np.ndarray | None) -> tuple[np.ndarray, np.ndarray]:
        """Return map (outputs,) and state (elements, hidden) after frames x (n, elements), both normalised.

        h: the state before the first frame, None for zero.
        """
        shape = self.arguments[1].shape
        h = np.zeros(shape, np.float32) if h is None else np.array(h, np.float32, order="C")
        blocks = run(np.array(x, np.float32, order="C"), h, *self.arguments)
        blocks = blocks.reshape(self.spec.rows, self.spec.cols, *self.block)
        return blocks.transpose(0, 2, 1, 3).reshape(self.spec.outputs), h
