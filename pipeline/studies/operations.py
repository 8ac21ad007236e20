"""What one forward pass of a network costs, in the convention of the SP-ResNet paper's Table 1.

That is how the package thop counts: convolutions and linear layers as multiply-accumulates without the bias; batch
normalisation 4 an element; an adaptive average pool a sum over its window and a division for each output; an
average pool of fixed size 1 for each output; all else nothing. `counting` counts only the first of these.
"""

import torch
from torch import nn

from tactile.learning.residual_blocks import GlobalCoordinateAttention


def operations(network: nn.Module, shape: tuple[int, int, int]) -> int:
    """Multiply-accumulates, as above, for one image of `shape` (channels, rows, cols)."""
    counted, hooks = [], []
    for module in network.modules():
        for kind, count in _COUNTS.items():
            if isinstance(module, kind):
                hook = module.register_forward_hook(lambda m, x, y, count=count: counted.append(count(m, x[0], y)))
                hooks.append(hook)
    training = network.training
    try:
        with torch.no_grad():
            network.eval()(torch.zeros(1, *shape))  # eval: one image must not change the running means
    finally:
        network.train(training)
        for hook in hooks:
            hook.remove()
    return sum(counted)


def _convolution(layer: nn.Conv2d, _, output: torch.Tensor) -> int:
    return output.numel() * layer.weight[0].numel()  # input channels of one group x kernel size


def _linear(layer: nn.Linear, _, output: torch.Tensor) -> int:
    return output.numel() * layer.in_features


def _normalisation(_, x: torch.Tensor, __) -> int:
    return 4 * x.numel()


def _adaptive_pool(_, x: torch.Tensor, output: torch.Tensor) -> int:
    return x.numel() + output.numel()  # outputs x (window + 1)


def _attention_pools(_, x: torch.Tensor, __) -> int:
    """Count the means of rows and of columns as two adaptive pools; the layers inside count themselves."""
    n, channels, rows, columns = x.shape
    return 2 * x.numel() + n * channels * (rows + columns)


def _fixed_pool(_, __, output: torch.Tensor) -> int:
    return output.numel()


_COUNTS = {
    nn.Conv2d: _convolution,
    nn.Linear: _linear,
    nn.BatchNorm2d: _normalisation,
    nn.AdaptiveAvgPool2d: _adaptive_pool,
    nn.AvgPool2d: _fixed_pool,
    GlobalCoordinateAttention: _attention_pools,
}
