"""Build the parts of convolutional networks for images that several models share.

All maps are (n, channels, rows, cols). Every convolution without a bias is followed by batch normalisation.
"""

import torch
from torch import nn

from tactile.base.errors import InputError


class BasicBlock(nn.Module):
    """Residual block of He et al. 2016, figure 2: relu(F(x) + x) with F = 3x3, BN, ReLU, 3x3, BN.

    (n, inputs, rows, cols) to (n, outputs, rows / stride, cols / stride). The first convolution has the stride.
    """

    def __init__(self, inputs: int, outputs: int, stride: int = 1):
        super().__init__()
        self.body = nn.Sequential(
            Convolution3x3(inputs, outputs, stride),
            nn.BatchNorm2d(outputs),
            nn.ReLU(inplace=True),
            Convolution3x3(outputs, outputs),
            nn.BatchNorm2d(outputs),
        )
        self.shortcut = _shortcut(inputs, outputs, stride)

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        return nn.functional.relu(self.body(x) + self.shortcut(x), inplace=True)


class SeparableBlock(nn.Module):
    """Residual block of SP-ResNet (paper, figure 11b): 1x1, 3x3 depthwise, GCAM, 1x1, and a shortcut.

    (n, inputs, rows, cols) to (n, outputs, rows / stride, cols / stride). The first 1x1 widens and the last 1x1 has the
    stride: only so do the printed counts without GCAM come out. Without `reduction` there is no GCAM. H-swish follows
    each of the first two convolutions, and the addition, as ReLU does in ResNet (the figure does not show the end).
    """

    def __init__(self, inputs: int, outputs: int, stride: int = 1, reduction: int | None = None):
        super().__init__()
        self.body = nn.Sequential(
            nn.Conv2d(inputs, outputs, 1, bias=False),
            nn.BatchNorm2d(outputs),
            nn.Hardswish(),
            nn.Conv2d(outputs, outputs, 3, padding=1, groups=outputs, bias=False),
            nn.BatchNorm2d(outputs),
            nn.Hardswish(),
            nn.Identity() if reduction is None else GlobalCoordinateAttention(outputs, reduction),
            nn.Conv2d(outputs, outputs, 1, stride, bias=False),
            nn.BatchNorm2d(outputs),
        )
        self.shortcut = _shortcut(inputs, outputs, stride)

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        return nn.functional.hardswish(self.body(x) + self.shortcut(x))


class GlobalCoordinateAttention(nn.Module):
    """GCAM (SP-ResNet paper, figure 11c), as coordinate attention of Hou et al. 2021, section 3.2.

    Every map is multiplied by one weight per row and one per column, each between 0 and 1. A bottleneck of
    channels / reduction channels computes the weights from the means of the rows and of the columns. The shape stays.
    Raises InputError for a reduction that leaves the bottleneck no channel.
    """

    def __init__(self, channels: int, reduction: int):
        super().__init__()
        if not 1 <= reduction <= channels:
            raise InputError(f"GCAM: reduction must be from 1 to the {channels} channels of a block, not {reduction!r}")
        narrow = channels // reduction
        self.squeeze = nn.Sequential(nn.Conv2d(channels, narrow, 1), nn.BatchNorm2d(narrow), nn.Hardswish())
        self.row_weights = nn.Sequential(nn.Conv2d(narrow, channels, 1), nn.Sigmoid())
        self.column_weights = nn.Sequential(nn.Conv2d(narrow, channels, 1), nn.Sigmoid())

    def attention(self, x: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """Return the weights of the rows (n, channels, rows, 1) and of the columns (n, channels, 1, cols) of maps x."""
        means = torch.cat([x.mean(3, keepdim=True), x.mean(2)[..., None]], 2)  # (n, c, rows + cols, 1)
        rows, columns = self.squeeze(means).split(x.shape[2:], 2)
        return self.row_weights(rows), self.column_weights(columns.transpose(2, 3))

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        rows, columns = self.attention(x)
        return x * rows * columns


class Convolution3x3(nn.Conv2d):
    """3x3 convolution with padding 1, without bias. On a map of one pixel only the kernel's centre meets data.

    There the centre alone gives the same result for a ninth of the work: on 32x32 images in 3 of ResNet-18's 17 such
    convolutions, which makes training 1.3 times and an image 1.6 times faster; on 5x5 elements in 6 of VGG's 13, 1.6
    times and 3 times. (MobileNet has one such convolution, depthwise: 1.03 times, not worth a class.)
    """

    def __init__(self, inputs: int, outputs: int, stride: int = 1):
        super().__init__(inputs, outputs, 3, stride, padding=1, bias=False)

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        if x.shape[2:] != (1, 1):
            return super().forward(x)
        return nn.functional.linear(x.flatten(1), self.weight[:, :, 1, 1])[:, :, None, None]


def separable_network(channels: int, classes: int, reduction: int | None = None, stem: int = 64) -> nn.Sequential:
    """Return SP-ResNet (paper, figure 11a), from images (n, channels, rows, cols) to scores (n, classes).

    `reduction`: as for GlobalCoordinateAttention; None for a network without GCAM. `stem`: channels of the first half;
    the second half has twice as many; 64 in the paper.
    """
    return nn.Sequential(
        nn.Conv2d(channels, stem, 3, padding=1, bias=False),
        nn.BatchNorm2d(stem),
        nn.Hardswish(),
        nn.MaxPool2d(3, stride=2, padding=1),  # 32x32 to 16x16
        SeparableBlock(stem, stem, reduction=reduction),
        SeparableBlock(stem, stem, reduction=reduction),
        SeparableBlock(stem, 2 * stem, stride=2, reduction=reduction),  # to 8x8
        SeparableBlock(2 * stem, 2 * stem, reduction=reduction),
        nn.AdaptiveAvgPool2d(1),
        nn.Flatten(),
        nn.Linear(2 * stem, classes),
    )


def _shortcut(inputs: int, outputs: int, stride: int) -> nn.Module:
    """Return the identity where a block keeps the shape, else a 1x1 convolution and batch normalisation."""
    if (inputs, stride) == (outputs, 1):
        return nn.Identity()
    return nn.Sequential(nn.Conv2d(inputs, outputs, 1, stride, bias=False), nn.BatchNorm2d(outputs))
