"""Train a network: the one loop that the epochs of all networks go through."""

import os
from collections.abc import Callable
from contextlib import AbstractContextManager
from typing import NamedTuple

import numpy as np
import torch
from torch import nn

BETAS = (0.9, 0.95)  # of Adam: averages over the last 20 squared gradients, as there are few updates
RISE = 0.1  # share of the updates over which the learning rate rises
BFLOAT16_INSTRUCTIONS = ("avx512_bf16", "amx_bf16", "sve_bf16")  # of processors, as torch names them

Progress = Callable[[int, int, float, float], None] | None  # (epoch, epochs, training loss, validation loss)


class FitSummary(NamedTuple):
    """How a fit ended: `stop_reason` is completed (all epochs were run), closed_form or diverged.

    `best_epoch`, from 1, is the epoch whose weights were kept; 0 means that no epoch had a finite loss, and the last
    weights stand.
    """

    stop_reason: str
    best_epoch: int


class Epoch(NamedTuple):
    """An epoch's mean losses over the training and the validation part, and the learning rate of its last update.

    `validation_loss` is None where there is no validation part.
    """

    train_loss: float
    validation_loss: float | None
    learning_rate: float


def device_of(name: str, *, series: bool = False) -> torch.device:
    """Return torch's device for the setting `device`: `auto` is a GPU if there is one, but the CPU for series.

    A network of a series takes thousands of samples one after the other, each too small for a card.
    """
    if name == "auto":
        name = "cuda" if torch.cuda.is_available() and not series else "cpu"
    if name == "cuda":  # convolutions are as precise there as on the CPU, and repeat
        torch.backends.cudnn.allow_tf32, torch.backends.cudnn.deterministic = False, True
        os.environ.setdefault("CUBLAS_WORKSPACE_CONFIG", ":4096:8")  # its products, too, repeat
    return torch.device(name)


def precision_on(place: torch.device, asked: str) -> str:
    """Return the precision of products on `place`: the one asked for, or float32 where it cannot be had.

    bfloat16 is had where there are instructions for it: elsewhere it would be slower than float32, and as coarse.
    """
    if place.type == "cuda":
        has_bfloat16 = torch.cuda.is_bf16_supported(including_emulation=False)
    else:
        has_bfloat16 = any(torch.cpu.get_capabilities().get(name) for name in BFLOAT16_INSTRUCTIONS)
        # ONEDNN_MAX_CPU_ISA may hold oneDNN, which computes the products, to older instructions.
        has_bfloat16 = has_bfloat16 and torch.ops.mkldnn._is_mkldnn_bf16_supported()
    return asked if has_bfloat16 else "float32"


def products_in(precision: str, place: torch.device) -> AbstractContextManager:
    """Return the context of a network's forward pass in training: weights stay float32, products are in `precision`."""
    return torch.autocast(place.type, torch.bfloat16, enabled=precision == "bfloat16")


def history_row(epoch: int, losses: Epoch) -> dict:
    """Return one row of history.csv; no validation loss is NaN there."""
    validation_loss = float("nan") if losses.validation_loss is None else losses.validation_loss
    return {
        "epoch": epoch,
        "train_loss": losses.train_loss,
        "validation_loss": validation_loss,
        "learning_rate": losses.learning_rate,
    }


def solved(train_loss: float, validation_loss: float | None) -> tuple[list[dict], FitSummary]:
    """Return history and summary of a fit in one step: one row, whose learning rate is 0."""
    return [history_row(1, Epoch(train_loss, validation_loss, 0.0))], FitSummary("closed_form", 1)


def new_network(make_network: Callable[[], nn.Module], seed: int) -> nn.Module:
    """Return a network whose first weights `seed` alone sets; torch's global generator is left as it was."""
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        return make_network()


def run_epochs(
    network: nn.Module,
    epochs: int,
    run_epoch: Callable[[int], Epoch],
    *,
    progress: Progress = None,
    keep_last: bool = False,
) -> tuple[list[dict], FitSummary]:
    """Call `run_epoch(epoch)` for the epochs from 0 and leave the weights of the best epoch in `network`.

    `run_epoch` trains once over the training part and evaluates the validation part. The best epoch has the least
    validation loss; with `keep_last` it is the last one, for recipes that have nothing to select by. A loss that is not
    finite ends the training as `diverged`; `progress` is called after every epoch. Returns one row of history.csv per
    epoch and the summary.
    """
    history, best_loss, best_epoch, best_weights = [], float("inf"), 0, None
    stop_reason = "completed"
    for epoch in range(1, epochs + 1):
        losses = run_epoch(epoch - 1)
        history.append(history_row(epoch, losses))
        if progress:
            progress(epoch, epochs, history[-1]["train_loss"], history[-1]["validation_loss"])
        known = [loss for loss in losses[:2] if loss is not None]
        if not np.isfinite(known).all():
            stop_reason = "diverged"
            best_epoch = 0 if keep_last else best_epoch
            break
        if keep_last:
            best_epoch = epoch
        elif known[-1] < best_loss:
            best_loss, best_epoch = known[-1], epoch
            best_weights = {name: value.clone() for name, value in network.state_dict().items()}
    if best_weights is not None:
        network.load_state_dict(best_weights)
    return history, FitSummary(stop_reason, best_epoch)


class Schedule:
    """Set the learning rate of an optimiser by the share of the training that is done: up, then down to zero.

    It rises over the first RISE of the training and falls linearly from there on. A training that is to the end of its
    schedule has ended: there is nothing to wait for, and no update is spent on finding out.
    """

    def __init__(self, optimiser: torch.optim.Optimizer, highest: float):
        self.optimiser, self.highest = optimiser, highest

    @property
    def learning_rate(self) -> float:
        """The optimiser's present learning rate."""
        return float(self.optimiser.param_groups[0]["lr"])

    def at(self, done: float) -> None:
        """Set the rate for the share `done` of the training, from 0 to 1."""
        for group in self.optimiser.param_groups:
            if isinstance(group["lr"], torch.Tensor):  # on a card, see `updates.adam`
                group["lr"].fill_(self.highest * rate_at(done))
            else:
                group["lr"] = self.highest * rate_at(done)


def rate_at(done: float) -> float:
    """Return the learning rate over its highest value at the share `done` of the training, from 0 to 1."""
    return min(done / RISE, (1 - done) / (1 - RISE))
