"""Count what a network costs: its trainable parameters and multiply-accumulates."""

import torch
from torch import nn


def parameters(network: nn.Module) -> int:
    """Return the number of trainable parameters (frozen weights and buffers do not count)."""
    return sum(weight.numel() for weight in network.parameters() if weight.requires_grad)


def multiply_accumulates(network: nn.Module, *inputs: torch.Tensor) -> int:
    """Return the multiply-accumulates of one forward pass of `network` on `inputs`, without biases and activations.

    Counts linear layers, convolutions, and LSTM and GRU sequences, each time they are called. Zeros that padding
    adds count as multiplied. A module that multiplies by weights of its own says its cost through a method
    `macs(*inputs)`; its children are then not counted again.
    """
    counted = []
    hooks = []

    def attach(module: nn.Module) -> None:
        if hasattr(module, "macs"):
            hooks.append(module.register_forward_hook(lambda m, x, _: counted.append(m.macs(*x))))
            return
        for kind, count in _COUNTS.items():
            if isinstance(module, kind):
                hooks.append(module.register_forward_hook(lambda m, x, y, c=count: counted.append(c(m, x, y))))
        for child in module.children():
            attach(child)

    attach(network)
    try:
        with torch.no_grad():
            network(*inputs)
    finally:
        for hook in hooks:
            hook.remove()
    return int(sum(counted))


def _linear(layer: nn.Linear, _, output: torch.Tensor) -> int:
    return output.numel() * layer.in_features


def _convolution(layer: nn.modules.conv._ConvNd, _, output: torch.Tensor) -> int:
    kernel = layer.weight[0].numel()  # input channels of one group x kernel size
    return output.numel() * kernel


def _recurrent(layer: nn.RNNBase, inputs: tuple, output: tuple) -> int:
    steps = output[0].numel() // output[0].shape[-1]  # batch x time
    matrices = (weight for name, weight in layer.named_parameters() if name.startswith("weight"))
    return steps * sum(weight.numel() for weight in matrices)


_COUNTS = {nn.Linear: _linear, nn.modules.conv._ConvNd: _convolution, nn.RNNBase: _recurrent}
