"""Faster forms of three computations, measured but not used: what they gain and what they change.

They run on the weights of the models that the pipeline trains and change no file of it.
"""

import numpy as np
import torch

from pipeline.message_passing import Lomp


class SmallLomp:
    """LoMP for one window at a time in numpy, float32: a product of a vector and a matrix an element and layer.

    With one row, numpy's `matmul` calls BLAS's gemv for each element, which streams the weights 1.6 times as fast as
    torch's `bmm`; bfloat16 weights gain nothing in torch (they are widened first). Gates and candidate are one product.
    """

    def __init__(self, network: Lomp):
        def array(tensor: torch.Tensor) -> np.ndarray:
            return tensor.detach().numpy().copy()

        self.network = network
        self.state = array(torch.cat([network.gate_state, network.candidate_state], 2))
        self.update, self.message, self.message_bias = map(
            array, (network.update, network.message, network.message_bias)
        )
        self.readout = [array(weight) for weight in network.readout]
        self.readout_bias = [array(bias)[:, 0] for bias in network.readout_bias]
        self.inputs = array(torch.cat([network.gate_input, network.candidate_input], 2))[:, 0]  # (elements, 3 hidden)
        gate_bias = network.gate_input_bias + network.gate_state_bias
        self.bias = array(torch.cat([gate_bias, network.candidate_input_bias], 2))[:, 0]
        self.v_bias, self.update_bias = array(network.candidate_state_bias)[:, 0], array(network.update_bias)[:, 0]
        self.sums = array(network.neighbours) * np.float32(network.alpha)

    def __call__(self, x: np.ndarray) -> np.ndarray:
        """One window (frames, elements) to its map (outputs,), both normalised, float32."""
        network, hidden = self.network, self.network.hidden
        h = np.zeros_like(self.v_bias)
        for frame in x:
            drive = frame[:, None] * self.inputs + self.bias
            product = np.matmul(h[:, None], self.state)[:, 0]
            rz = 1 / (1 + np.exp(-(drive[:, : 2 * hidden] + product[:, : 2 * hidden])))
            c = np.tanh(drive[:, 2 * hidden :] + rz[:, :hidden] * (product[:, 2 * hidden :] + self.v_bias))
            h1 = c + rz[:, hidden:] * (h - c)
            sent = np.maximum(h1 @ self.message + self.message_bias, 0)
            q = h1 + self.sums @ sent
            h = np.maximum(np.matmul(q[:, None], self.update)[:, 0] + self.update_bias, 0)
        p = np.concatenate([h, h1], 1)
        for layer, (weight, bias) in enumerate(zip(self.readout, self.readout_bias, strict=True)):
            p = np.matmul(p[:, None], weight)[:, 0] + bias
            if layer < len(self.readout) - 1:
                p = np.maximum(p, 0)
        blocks = p.reshape(network.spec.rows, network.spec.cols, *network.block)
        return blocks.transpose(0, 2, 1, 3).reshape(network.spec.outputs)


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
