"""Faster forms of three computations, measured but not used: what they gain and what they change.

They run on the weights of the models that the pipeline trains and change no file of it.
"""

import numpy as np
import torch

from pipeline.models.lomp import Lomp


class SmallLomp:
    """LoMP for one window at a time, its weights in `kind` (bfloat16: half the bytes that a frame streams).

    The gates and the candidate are one product an element; biases and states stay float32.
    """

    def __init__(self, network: Lomp, kind: torch.dtype = torch.bfloat16):
        self.network, self.kind, hidden = network, kind, network.hidden
        with torch.no_grad():
            state = torch.cat([network.gate_state, network.candidate_state], 2)
            self.state, self.update, self.message = (
                weight.to(kind).contiguous() for weight in (state, network.update, network.message)
            )
            self.readout = [weight.to(kind).contiguous() for weight in network.readout]
            self.inputs = torch.cat([network.gate_input, network.candidate_input], 2)[:, 0]  # (elements, 3 hidden)
            bias = torch.cat([network.gate_input_bias + network.gate_state_bias, network.candidate_input_bias], 2)
            self.bias, self.v_bias = bias[:, 0], network.candidate_state_bias[:, 0]
            self.update_bias = network.update_bias[:, 0]
            self.readout_bias = [bias[:, 0] for bias in network.readout_bias]
            self.sums = network.neighbours * network.alpha
        self.drive = torch.empty(network.spec.frames, network.spec.elements, 3 * hidden)

    def __call__(self, x: torch.Tensor) -> torch.Tensor:
        """One window (1, frames, elements) to its map (1, outputs), both normalised."""
        network, hidden, kind = self.network, self.network.hidden, self.kind
        with torch.no_grad():
            torch.addcmul(self.bias, x[0][:, :, None], self.inputs, out=self.drive)
            h = None
            for drive in self.drive.unbind(0):
                if h is None:
                    product, v = drive, self.v_bias
                    rz = torch.sigmoid(drive[:, : 2 * hidden])
                else:
                    product = torch.bmm(h.to(kind)[:, None], self.state)[:, 0]
                    rz = torch.sigmoid(drive[:, : 2 * hidden] + product[:, : 2 * hidden])
                    v = self.v_bias + product[:, 2 * hidden :]
                c = torch.addcmul(drive[:, 2 * hidden :], rz[:, :hidden], v).tanh_()
                h1 = c - rz[:, hidden:] * c if h is None else torch.lerp(c, h, rz[:, hidden:])
                sent = torch.relu(torch.mm(h1.to(kind), self.message) + network.message_bias)
                q = torch.addmm(h1, self.sums, sent)
                h = torch.relu(torch.bmm(q.to(kind)[:, None], self.update)[:, 0] + self.update_bias)
            p = torch.cat([h, h1], 1)
            for layer, (weight, bias) in enumerate(zip(self.readout, self.readout_bias, strict=True)):
                p = torch.bmm(p.to(kind)[:, None], weight)[:, 0] + bias
                if layer < len(self.readout) - 1:
                    p = p.relu_()
            blocks = p.view(network.spec.rows, network.spec.cols, *network.block)
            return blocks.permute(0, 2, 1, 3).reshape(1, network.spec.outputs)


def chunked_step(network: torch.nn.Module, x: torch.Tensor, y: torch.Tensor, chunk: int):
    """A function that makes one update of `network` on a batch, its gradients summed over chunks that fit the cache."""
    optimiser = torch.optim.Adam(network.parameters(), fused=True)

    def step() -> None:
        optimiser.zero_grad()
        for some, target in zip(x.split(chunk), y.split(chunk), strict=True):
            ((network(some) - target).square().sum() / y.numel()).backward()
        optimiser.step()

    return step


def reservoir_states(system: dict[str, np.ndarray], leak: float, x: np.ndarray, pieces: int, warm: int) -> np.ndarray:
    """States (T, units) of an echo state network for normalised inputs (T, channels), in pieces side by side.

    Every piece starts `warm` samples early from rest. An echo state network forgets where it started, so that after
    enough samples the states are those of the whole series up to rounding; the first piece is exact.
    """
    w = np.ascontiguousarray(system["reservoir"].T)
    drive = np.tanh(x) @ system["input"] + system["bias"]
    length = -(-len(x) // pieces)
    padded = np.zeros((warm + pieces * length, drive.shape[1]), np.float32)  # at rest before the first sample
    padded[warm : warm + len(x)] = drive
    rows = np.arange(warm + length)[:, None] + np.arange(pieces) * length
    states = padded[rows]  # (warm + length, pieces, units): the drive, replaced by the states
    s = np.zeros(states.shape[1:], np.float32)
    for step in states:
        s = (1 - leak) * s + leak * np.tanh(s @ w + step)
        step[:] = s
    return states[warm:].transpose(1, 0, 2).reshape(pieces * length, -1)[: len(x)]
