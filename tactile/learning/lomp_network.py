"""Compute LoMP, the Local Message Passing Network (LoMP paper, section III): a small network per sensor element.

For each frame t of a window and each element i, from a zero state h:

    h1[i] = GRU_i(x[i], h[i])                                     eq. 2
    s[i]  = relu(U h1[i] + b),  m[i] = sum of s over neighbours   eq. 3
    h[i]  = relu(P_i (h1[i] + alpha m[i]) + bias)                 eq. 4, 6
    p[i]  = f_i([h[i], h1[i]])   after the last frame                eq. 5

p[i] is the block of the pressure map over element i. Element 0 is bottom left, elements count along the
bottom row first, and row 0 of the map is the bottom one too.

The weights of all elements are stacked, so that a layer of all elements is one batched product, and the
recurrence has a hand-written backward pass that reuses its memory: on one CPU thread 1.5 s for 1000 training
windows, against 2.0 s for the same products under autograd and 1.1 s for the products alone (2.6 GHz EPYC).
"""

from collections.abc import Callable
from math import isfinite, sqrt
from typing import TYPE_CHECKING

import numpy as np
import torch
from torch import nn
from torch.autograd.function import once_differentiable

from tactile.learning import lomp_shape
from tactile.learning.regressors import TorchRegressor
from tactile.learning.spec import Spec

if TYPE_CHECKING:
    from tactile.learning.lomp_prediction import Prediction

aten = torch.ops.aten

SMALL = 0.1  # of the first weights of P beside the identity


def maker(spec: Spec, *, neighbours: int, **settings) -> Callable[[], "Lomp"]:
    """Return a function that makes a `Lomp` of these settings. Errors as `lomp_shape.check`."""
    lomp_shape.check(spec, neighbours)
    return lambda: Lomp(spec, neighbours=neighbours, **settings)


class Lomp(nn.Module):
    """The network from windows (n, frames, elements) to maps (n, map_rows * map_cols), both normalised.

    GRU_i is torch's: r, z = sigmoid(gate_input x + gate_state h + both biases), candidate
    c = tanh(candidate_input x + bias + r (candidate_state h + bias)), h1 = (1 - z) c + z h. Weights are
    (elements, inputs, outputs), or (1, inputs, outputs) of one f for all, r before z, initialised per element as torch
    does for nn.GRU and nn.Linear; but P starts near the identity, and the last layer of f at zero. With half the hidden
    units, the validation error after 8 epochs is 6.37 kPa so, and 7.26 with a P drawn as torch does.

    `hidden`: numbers in h, h1, s and m; `readout`: widths of f's hidden layers; `neighbours`: 4 (sharing an edge) or 8
    (sharing a corner, too); `alpha`: weight of the messages (eq. 4); `one_readout`: whether all elements have one f;
    `drawn`: whether the first P is drawn as all other weights are, not near the identity.
    """

    def __init__(
        self,
        spec: Spec,
        hidden: int,
        readout: list[int],
        neighbours: int,
        alpha: float,
        one_readout: bool = False,
        drawn: bool = False,
    ):
        super().__init__()
        self.spec, self.hidden, self.alpha = spec, hidden, alpha
        cells = spec.elements
        self.gate_input = _uniform(hidden, cells, 1, 2 * hidden)
        self.gate_input_bias = _uniform(hidden, cells, 1, 2 * hidden)
        self.gate_state = _uniform(hidden, cells, hidden, 2 * hidden)
        self.gate_state_bias = _uniform(hidden, cells, 1, 2 * hidden)
        self.candidate_input = _uniform(hidden, cells, 1, hidden)
        self.candidate_input_bias = _uniform(hidden, cells, 1, hidden)
        self.candidate_state = _uniform(hidden, cells, hidden, hidden)
        self.candidate_state_bias = _uniform(hidden, cells, 1, hidden)
        self.message = _uniform(hidden, hidden, hidden)  # U, shared by all elements
        self.message_bias = _uniform(hidden, hidden)
        self.update = _uniform(hidden, cells, hidden, hidden)  # P
        self.update_bias = _uniform(hidden, cells, 1, hidden)
        self.block = (spec.map_rows // spec.rows, spec.map_cols // spec.cols)
        widths = [2 * hidden, *readout, self.block[0] * self.block[1]]
        pairs = list(zip(widths[:-1], widths[1:], strict=True))
        of = 1 if one_readout else cells
        self.readout = nn.ParameterList(_uniform(inputs, of, inputs, outputs) for inputs, outputs in pairs)
        self.readout_bias = nn.ParameterList(_uniform(inputs, of, 1, outputs) for inputs, outputs in pairs)
        with torch.no_grad():  # P near the identity lets states through from frame to frame before it is trained
            if not drawn:
                self.update.mul_(SMALL).diagonal(dim1=1, dim2=2).add_(1)
        for start_at_zero in (self.update_bias, self.readout[-1], self.readout_bias[-1]):
            nn.init.zeros_(start_at_zero)
        adjacent = torch.from_numpy(lomp_shape.neighbour_matrix(spec.rows, spec.cols, neighbours))
        self.register_buffer("neighbours", adjacent, persistent=False)
        self.buffers: _Buffers | None = None

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        return self.go_on(x, None)[0]

    def go_on(
        self, x: torch.Tensor, state: torch.Tensor | None, largest: float = float("inf")
    ) -> tuple[torch.Tensor, torch.Tensor]:
        """Return maps (n, outputs) and the state (elements, n, hidden) after the last frame of x (n, frames, elements).

        state: the state before the first frame, None for zero; no gradient goes into `state`. largest: what the state
        is cut to before each next frame, for predictions alone, as the gradient does not know of it.
        """
        place = x.device.type
        precision = torch.get_autocast_dtype(place) if torch.is_autocast_enabled(place) else x.dtype
        elements_first = x.to(precision).permute(1, 2, 0).unsqueeze(3).contiguous()  # (frames, cells, n, 1)
        weights = (
            self.gate_input,
            self.gate_input_bias + self.gate_state_bias,
            self.gate_state,
            self.candidate_input,
            self.candidate_input_bias,
            self.candidate_state,
            self.candidate_state_bias,
            self.message,
            self.message_bias,
            self.update,
            self.update_bias,
            self.neighbours,
        )
        both = _Recurrence.apply(
            elements_first,
            state,
            *(weight.to(precision) for weight in weights),
            self.alpha,
            self._buffers_for(elements_first),
            largest,
        )  # (cells, n, 2 hidden)
        p, last = both, len(self.readout) - 1
        for layer, (weight, bias) in enumerate(self.readouts()):
            p = torch.baddbmm(bias, p, weight)
            if layer < last:
                p = p.relu_()
        blocks = p.view(self.spec.rows, self.spec.cols, len(x), *self.block)
        maps = blocks.permute(2, 0, 3, 1, 4).reshape(len(x), self.spec.outputs)
        return maps, both[..., : self.hidden].detach()

    def readouts(self) -> list[tuple[torch.Tensor, torch.Tensor]]:
        """Return weights (elements, inputs, outputs) and biases (elements, 1, outputs) of each layer of f."""
        layers = zip(self.readout, self.readout_bias, strict=True)
        return [tuple(part.expand(self.spec.elements, -1, -1) for part in layer) for layer in layers]

    def macs(self, x: torch.Tensor) -> int:
        """Return the multiply-accumulates for windows x, biases and neighbour sums not counted."""
        per_frame = [self.gate_input, self.gate_state, self.candidate_input, self.candidate_state, self.update]
        recurrent = sum(weight.numel() for weight in per_frame) + self.spec.elements * self.message.numel()
        return len(x) * (x.shape[1] * recurrent + sum(weight.numel() for weight, _ in self.readouts()))

    def _buffers_for(self, x: torch.Tensor) -> "_Buffers":
        key = (*x.shape, x.dtype, x.device)
        if x.is_cuda:  # a graph keeps the memory of its own; fresh memory costs a card nothing
            return _Buffers(x, self.hidden, key, None)
        if self.buffers is None or self.buffers.key != key:
            self.buffers = _Buffers(x, self.hidden, key, self.buffers)
        return self.buffers


def _uniform(fan_in: int, *shape: int) -> nn.Parameter:
    """Return weights drawn as torch draws those of a layer with `fan_in` inputs."""
    return nn.Parameter(torch.empty(*shape).uniform_(-1 / sqrt(fan_in), 1 / sqrt(fan_in)))


class _Buffers:
    """The values that the forward pass leaves for the backward pass, and the temporaries of both passes.

    Kept from batch to batch (0.9 MB per window), and cut out of the memory of the batch before where that memory is
    large enough: fresh memory of this size costs page faults, which take a fifth of the training time.
    `passes` counts forward passes, each of which overwrites the values of the pass before.
    """

    def __init__(self, x: torch.Tensor, hidden: int, key: tuple, before: "_Buffers | None"):
        frames, cells, n, _ = x.shape
        layers = 8 * frames + 7
        size = layers * cells * n * hidden
        self.key = key
        self.passes = before.passes if before else 0
        fits = before and before.memory.numel() >= size and before.key[-2:] == key[-2:]
        self.memory = before.memory if fits else x.new_empty(size)
        parts = self.memory[:size].view(layers, cells, n, hidden).split([frames + 1, *5 * [frames], 2 * frames, 2, 4])
        # (frames, cells, n, hidden) each; h[t] is the state before frame t
        self.h, self.c, self.v, self.h1, self.s, self.q = parts[:6]
        self.rz = parts[6].view(frames, cells, n, 2 * hidden)
        self.d_rz = parts[7].view(cells, n, 2 * hidden)
        self.d_c, self.d_h, self.d_h1, self.temporary = parts[8]


class _Recurrence(torch.autograd.Function):
    """Eqs. 2, 3, 4, 6: x (frames, cells, n, 1) to [h, h1] of the last frame (cells, n, 2 hidden).

    state: h before the first frame (cells, n, hidden), None for zero.

    Names as in the equations above, and q = h1 + alpha m, v = candidate_state h + bias. Weights are the arguments of
    Lomp.go_on in its order: gi, gs of the gates and ci, cs of the candidate (for input and state), u of eq. 3, p of
    eq. 4; gb, cb, vb, ub, pb are the biases. Weight gradients are added up in place over the frames. x and state get
    no gradient. Products with a state of zero are left out.
    """

    @staticmethod
    def forward(ctx, x, state, gi, gb, gs, ci, cb, cs, vb, u, ub, p, pb, neighbours, alpha, keep, largest):
        frames, cells, _, _ = x.shape
        hidden = len(u)
        if state is None:
            keep.h[0].zero_()
        else:
            keep.h[0].copy_(state)
        for t in range(frames):
            h, rz, c, v, h1, s, q = (a[t] for a in (keep.h, keep.rz, keep.c, keep.v, keep.h1, keep.s, keep.q))
            if t and isfinite(largest):
                h.clamp_(max=largest)
            torch.addcmul(gb, x[t], gi, out=rz)
            torch.addcmul(cb, x[t], ci, out=c)
            if t or state is not None:
                rz.baddbmm_(h, gs)
                torch.baddbmm(vb, h, cs, out=v)
            else:
                v.copy_(vb)
            rz.sigmoid_()
            c.addcmul_(rz[..., :hidden], v).tanh_()
            torch.lerp(c, h, rz[..., hidden:], out=h1)
            torch.addmm(ub, h1.view(-1, hidden), u, out=s.view(-1, hidden)).relu_()
            torch.addmm(h1.view(cells, -1), neighbours, s.view(cells, -1), alpha=alpha, out=q.view(cells, -1))
            torch.baddbmm(pb, q, p, out=keep.h[t + 1]).relu_()
        keep.passes += 1
        ctx.keep, ctx.this_pass, ctx.alpha, ctx.from_zero = keep, keep.passes, alpha, state is None
        ctx.save_for_backward(x, gs, cs, u, p, neighbours)
        return torch.cat([keep.h[frames], h1], 2)

    @staticmethod
    @once_differentiable
    def backward(ctx, d_last):
        x, gs, cs, u, p, neighbours = ctx.saved_tensors
        keep, alpha = ctx.keep, ctx.alpha
        if keep.passes != ctx.this_pass:
            raise RuntimeError("lomp: another forward pass has overwritten what this backward pass needs")
        frames, cells, n, _ = x.shape
        hidden = len(u)
        x_and_one = torch.cat([x, torch.ones_like(x)], 3).transpose(2, 3)  # (frames, cells, 2, n)
        d_gate = x.new_zeros(cells, 2, 2 * hidden)  # input weight and bias together
        d_candidate = x.new_zeros(cells, 2, hidden)
        d_gs, d_cs, d_u, d_p = (torch.zeros_like(weight) for weight in (gs, cs, u, p))
        d_vb, d_pb = x.new_zeros(2, cells, 1, hidden)
        d_ub = x.new_zeros(hidden)
        d_rz, d_c, d_h1, temporary = keep.d_rz, keep.d_c, keep.d_h1, keep.temporary
        d_h = d_last[..., :hidden]
        for t in reversed(range(frames)):
            h, rz, c, v, h1, s, q = (a[t] for a in (keep.h, keep.rz, keep.c, keep.v, keep.h1, keep.s, keep.q))
            # eq. 4: d_h1 starts as the gradient of q
            d = aten.threshold_backward.grad_input(d_h, keep.h[t + 1], 0, grad_input=temporary)
            d_p.baddbmm_(q.transpose(1, 2), d)
            d_pb += d.sum(1, keepdim=True)
            torch.bmm(d, p.transpose(1, 2), out=d_h1)
            # eq. 3
            torch.mm(neighbours.t(), d_h1.view(cells, -1), out=d.view(cells, -1)).mul_(alpha)
            d = aten.threshold_backward.grad_input(d, s, 0, grad_input=d).view(-1, hidden)
            d_u.addmm_(h1.view(-1, hidden).t(), d)
            d_ub += d.sum(0)
            d_h1.view(-1, hidden).addmm_(d, u.t())
            if t == frames - 1:
                d_h1 += d_last[..., hidden:]
            # eq. 2
            torch.sub(h, c, out=temporary)
            torch.mul(d_h1, temporary, out=d_rz[..., hidden:])
            d_h = torch.mul(d_h1, rz[..., hidden:], out=keep.d_h)
            aten.tanh_backward.grad_input(d_h1.sub_(d_h), c, grad_input=d_c)
            torch.mul(d_c, v, out=d_rz[..., :hidden])
            aten.sigmoid_backward.grad_input(d_rz, rz, grad_input=d_rz)
            d_gate.baddbmm_(x_and_one[t], d_rz)
            d_candidate.baddbmm_(x_and_one[t], d_c)
            d_v = d_c.mul_(rz[..., :hidden])
            d_vb += d_v.sum(1, keepdim=True)
            if t or not ctx.from_zero:
                d_gs.baddbmm_(h.transpose(1, 2), d_rz)
                d_cs.baddbmm_(h.transpose(1, 2), d_v)
                d_h.baddbmm_(d_rz, gs.transpose(1, 2)).baddbmm_(d_v, cs.transpose(1, 2))
        d_gi, d_gb = d_gate.split(1, 1)
        d_ci, d_cb = d_candidate.split(1, 1)
        return None, None, d_gi, d_gb, d_gs, d_ci, d_cb, d_cs, d_vb, d_u, d_ub, d_p, d_pb, None, None, None, None


class LompRegressor(TorchRegressor):
    """LoMP as a regressor: a batch goes through in parts that fit the cache, a single row through compiled code."""

    chunk = 128  # windows; an update of 256 takes 0.41 s, in one piece 0.62 s, in pieces of 32 0.52 s
    prediction: "Prediction | None" = None  # of one row, with the weights of now

    def fit(self, *arguments, **settings) -> list[dict]:
        """Train as TorchRegressor does."""
        self.prediction = None
        return super().fit(*arguments, **settings)

    def load(self, folder) -> None:
        """Read the model as TorchRegressor does."""
        super().load(folder)
        self.prediction = None

    def one_row(self, frames: np.ndarray, state: np.ndarray | None) -> tuple[np.ndarray, np.ndarray]:
        """Return the map (1, outputs) in kPa after `frames` and the state (elements, 1, hidden).

        frames: (n, elements) in ADC counts; state: the state before the first frame, None for zero.
        """
        if self.prediction is None:
            from tactile.learning.lomp_prediction import Prediction  # with it numba, which no training needs

            weights = {name: tensor.numpy() for name, tensor in self.network.state_dict().items()}
            self.prediction = Prediction(self.spec, weights, self.network.neighbours.numpy(), self.network.alpha)
        mean, spread = self.scaled.input_mean.numpy(), self.scaled.input_spread.numpy()
        state = None if state is None else np.asarray(state)[:, 0]
        image, state = self.prediction.run((frames - mean) / spread, state)
        return image[None] * self.scaled.output_scale.numpy(), state[:, None]
