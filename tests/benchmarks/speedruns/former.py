"""Train networks by the recipe that was used before: the baseline of the speed-runs.

The learning rate falls where the validation loss no longer does, training stops by patience, and the weights of the
best epoch are kept. Everything is float32; maps are divided by their standard deviation; weights start as torch draws
them, the last layer's too; VGG has no batch normalisation. Settings are in former.yaml. All runs on the CPU.
"""

import copy
from collections.abc import Callable, Iterator, Mapping
from itertools import pairwise
from math import isfinite, sqrt
from pathlib import Path
from typing import NamedTuple

import numpy as np
import torch
from scipy.special import softmax
from torch import nn

from pipeline import models
from pipeline.base import params
from pipeline.datasets.images import HIGHEST, SIDE
from pipeline.learning.image_classifier import ImageClassifier, augmented
from pipeline.learning.lomp_network import Lomp
from pipeline.learning.regressors import Spec, input_scale
from pipeline.models.lomp_stream import StreamingLomp, streams

SETTINGS = Path(__file__).with_name("former.yaml")
SMALLEST_GAIN = 0.01  # of the validation loss: half a percent of the error; less in an epoch is noise, not progress
LARGEST_BATCH = 128  # windows per prediction step
CONVOLUTIONS = (2, 2, 3, 3, 3)  # of VGG, per stage


class Recipe(NamedTuple):
    """A network's block `training` in former.yaml; the last three are the augmentation of images."""

    learning_rate: float
    batch_size: int
    max_epochs: int
    patience: int
    plateau: int
    drop: float
    flip: float = 0.0
    noise: float = 0.0
    affine: float = 0.0


def settings() -> dict:
    """Return former.yaml: experiment -> network -> its block."""
    return params.parsed(SETTINGS)


def build(model: str, spec: Spec, block: Mapping, present: Mapping) -> "FormerRegressor":
    """Return the untrained network; block: its block in former.yaml, present: its block in params.yaml."""
    sizes = {name: value for name, value in block.items() if name != "training"}
    built = models.build(model, spec, {**present, **sizes}, f"former recipe, {model}")
    kind = FormerRegressor
    if isinstance(built, ImageClassifier):
        kind = FormerClassifier
    elif built.streams:
        kind = FormerStreams

    def network(seed: int) -> nn.Module:
        made = vgg(spec, block["channels"], seed) if model == "vgg" else drawn_anew(built.network, model, seed)
        images = model == "vgg" or kind is FormerClassifier
        return made.to(memory_format=torch.channels_last) if images else made

    return kind(network, spec, Recipe(**block["training"]))


def drawn_anew(network: nn.Module, model: str, seed: int) -> nn.Module:
    """Return a copy of a network with first weights as torch draws those of its layers (ResNet-18: as torchvision)."""
    network = copy.deepcopy(network).to(memory_format=torch.contiguous_format)  # the order in which weights are drawn
    with torch.random.fork_rng(devices=[]), torch.no_grad():
        torch.manual_seed(seed)
        for layer in network.modules():
            if isinstance(layer, Lomp):
                draw_lomp(layer)
            elif hasattr(layer, "reset_parameters"):
                layer.reset_parameters()
        if model == "resnet18":
            for layer in network.modules():
                if isinstance(layer, nn.Conv2d):
                    nn.init.kaiming_normal_(layer.weight, mode="fan_out", nonlinearity="relu")
    return network


def draw_lomp(network: Lomp) -> None:
    """Draw the weights of LoMP, per element as torch does those of nn.GRU and nn.Linear."""
    inputs = [weight.shape[1] for weight in network.readout]
    for name, weight in network.named_parameters():
        group, _, layer = name.partition(".")
        bound = 1 / sqrt(inputs[int(layer)] if group.startswith("readout") else network.hidden)
        weight.uniform_(-bound, bound)


def vgg(spec: Spec, channels: list[int], seed: int) -> nn.Sequential:
    """Return VGG-16 without batch normalisation: 13 convolutions from (n, frames, elements), one linear layer."""
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        layers = [nn.Unflatten(2, (spec.rows, spec.cols))]
        rows, cols = spec.rows, spec.cols
        for convolutions, (narrower, wider) in zip(CONVOLUTIONS, pairwise([spec.frames, *channels]), strict=True):
            for inputs in [narrower, *[wider] * (convolutions - 1)]:
                layers += [CentredConvolution(inputs, wider, 3, padding=1), nn.ReLU()]
            layers.append(nn.MaxPool2d(2, ceil_mode=True))
            rows, cols = (rows + 1) // 2, (cols + 1) // 2
        network = nn.Sequential(*layers, nn.Flatten(), nn.Linear(channels[-1] * rows * cols, spec.outputs))
        for layer in network:
            if isinstance(layer, nn.Conv2d):  # without batch norm, 13 layers train only from this scale
                nn.init.kaiming_normal_(layer.weight, nonlinearity="relu")
                nn.init.zeros_(layer.bias)
    return network


class CentredConvolution(nn.Conv2d):
    """3x3 convolution with padding 1, of which only the kernel's centre is used on an image of one pixel."""

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        if x.shape[2:] != (1, 1):
            return super().forward(x)
        return nn.functional.linear(x.flatten(1), self.weight[:, :, 1, 1], self.bias)[:, :, None, None]


class Plateau:
    """Lower the learning rate, and at last stop, where the validation loss no longer falls.

    The learning rate is multiplied by `drop` whenever `plateau` epochs in a row have not lowered the validation loss by
    SMALLEST_GAIN; training stops after `patience` such epochs.
    """

    def __init__(self, optimiser: torch.optim.Optimizer, recipe: Recipe):
        self.optimiser, self.recipe = optimiser, recipe
        self.least_loss, self.least_epoch = float("inf"), 0

    def __call__(self, epoch: int, validation_loss: float) -> bool:
        """Take an epoch's validation loss; True where training stops."""
        if validation_loss < self.least_loss * (1 - SMALLEST_GAIN):
            self.least_loss, self.least_epoch = validation_loss, epoch
        waited = epoch - self.least_epoch
        if waited >= self.recipe.patience:
            return True
        if waited and waited % self.recipe.plateau == 0:
            for group in self.optimiser.param_groups:
                group["lr"] *= self.recipe.drop
        return False


class FormerRegressor:
    """A network from windows x (n, frames, elements) in ADC counts to maps y (n, outputs) in kPa.

    `make_network(seed)` returns it with its first weights.
    """

    streams = False

    def __init__(self, make_network: Callable[[int], nn.Module], spec: Spec, recipe: Recipe):
        self.make_network, self.spec, self.recipe = make_network, spec, recipe

    def fit(self, train: tuple, validation: tuple, *, seed: int, device: str = "cpu", progress=None) -> list[dict]:
        """Train and keep the weights of the epoch with the least validation loss.

        train, validation: as for the pipeline's models. Returns one row per epoch (epoch, validation_loss). Trains on
        the CPU whatever `device` says.
        """
        recipe, order = self.recipe, torch.Generator().manual_seed(seed)
        self.scale(train)
        network = self.network = self.make_network(seed)
        parts = self.tensors(train), self.tensors(validation)
        optimiser = torch.optim.Adam(network.parameters(), lr=recipe.learning_rate, fused=True)
        plateau = Plateau(optimiser, recipe)
        history, least, best_weights = [], float("inf"), None
        for epoch in range(1, recipe.max_epochs + 1):
            network.train()
            for loss in self.losses(parts[0], order):
                optimiser.zero_grad()
                loss.backward()
                optimiser.step()
            network.eval()
            with torch.no_grad():
                validation_loss = self.loss(parts[1])
            history.append({"epoch": epoch, "validation_loss": validation_loss})
            if progress:
                progress(epoch, recipe.max_epochs, validation_loss)
            if not isfinite(validation_loss):
                break
            if validation_loss < least:
                least = validation_loss
                best_weights = {name: value.clone() for name, value in network.state_dict().items()}
            if plateau(epoch, validation_loss):
                break
        if best_weights is not None:
            network.load_state_dict(best_weights)
        return history

    def scale(self, train: tuple) -> None:
        """Take the scales of inputs and maps from the training part."""
        mean, spread = input_scale(train[0])
        self.mean, self.spread = torch.from_numpy(mean), torch.from_numpy(spread)
        self.output_scale = float(np.std(train[1], dtype=np.float64)) or 1.0

    def inputs(self, x: np.ndarray) -> torch.Tensor:
        """Return scaled inputs."""
        return torch.from_numpy(np.array(x, dtype=np.float32)).sub_(self.mean).div_(self.spread)

    def tensors(self, part: tuple) -> tuple:
        """Return a part with inputs and labels scaled."""
        x, y, *rest = part
        return self.inputs(x), torch.from_numpy(np.array(y, dtype=np.float32)).div_(self.output_scale), *rest

    def losses(self, train: tuple, order: torch.Generator) -> Iterator[torch.Tensor]:
        """Yield the loss of each batch of an epoch, to be minimised before the next is asked for."""
        x, y = train
        for batch in torch.randperm(len(x), generator=order).split(self.recipe.batch_size):
            yield nn.functional.mse_loss(self.network(x[batch]), y[batch])

    def loss(self, part: tuple) -> float:
        """Return the mean loss over a scaled part in the unit of the label squared."""
        x, y, *rest = part
        return float(nn.functional.mse_loss(self.outputs(x, *rest), y)) * self.output_scale**2

    def outputs(self, x: torch.Tensor) -> torch.Tensor:
        """Return the scaled maps of scaled windows."""
        return torch.cat([self.network(part) for part in x.split(LARGEST_BATCH)])

    def predict(self, x: np.ndarray, *rest) -> np.ndarray:
        """Return maps (n, outputs) in kPa for windows x (n, frames, elements) in ADC counts."""
        with torch.no_grad():
            return (self.outputs(self.inputs(x), *rest) * self.output_scale).numpy()


class FormerStreams(FormerRegressor):
    """A network that hands its state on from window to window; parts are (x, y, previous) as in models/lomp_stream."""

    streams = True
    precision = "float32"
    maps = StreamingLomp._maps  # which windows of a batch go through the network together is no part of a recipe

    def losses(self, train: tuple, order: torch.Generator) -> Iterator[torch.Tensor]:
        """Yield the loss of each update: the windows that the streams of a batch have at one time."""
        x, y, previous = train
        chains = streams(previous)
        for batch in torch.randperm(len(chains), generator=order).split(self.recipe.batch_size):
            for windows, maps in self.maps(x, [chains[k] for k in batch.tolist()]):
                yield nn.functional.mse_loss(maps, y[windows])

    def outputs(self, x: torch.Tensor, previous: np.ndarray) -> torch.Tensor:
        """Return the scaled maps of scaled windows, states carried along `previous`."""
        maps, chains = x.new_empty(len(x), self.spec.outputs), streams(previous)
        for start in range(0, len(chains), LARGEST_BATCH):
            for windows, some in self.maps(x, chains[start : start + LARGEST_BATCH]):
                maps[windows] = some
        return maps


class FormerClassifier(FormerRegressor):
    """A network from images x (n, 1, SIDE * SIDE) in 0 .. 255 to scores of classes; labels y one-hot (n, classes)."""

    def scale(self, train: tuple) -> None:
        """Scale images to 0 .. 1."""
        self.mean, self.spread, self.output_scale = torch.zeros(()), torch.tensor(HIGHEST), 1.0

    def losses(self, train: tuple, order: torch.Generator) -> Iterator[torch.Tensor]:
        """Yield the loss of each batch of altered images; one image that is left over waits for the next epoch."""
        x, y = train
        used = len(x) - (len(x) % self.recipe.batch_size == 1)
        for batch in torch.randperm(len(x), generator=order)[:used].split(self.recipe.batch_size):
            images = augmented(x[batch].view(-1, 1, SIDE, SIDE), self.recipe, order)
            yield nn.functional.cross_entropy(self.network(images.flatten(2)), y[batch])

    def loss(self, part: tuple) -> float:
        """Return the mean cross-entropy in nats."""
        x, y = part
        return float(nn.functional.cross_entropy(self.outputs(x), y))

    def predict(self, x: np.ndarray) -> np.ndarray:
        """Return probabilities (n, classes) for images."""
        return softmax(super().predict(x), axis=1)
