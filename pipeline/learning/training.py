"""Train a network: the one loop that the epochs of all networks go through."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import torch
from torch import nn

SMALLEST_GAIN = 0.01  # of the validation loss: half a percent of the error; less in an epoch is noise, not progress

Progress = Callable[[int, int, float, float], None] | None  # (epoch, epochs, training loss, validation loss)


class FitSummary(NamedTuple):
    """How a fit ended: `stop_reason` is patience, max_epochs, closed_form or diverged.

    `best_epoch`, from 1, is the epoch whose weights were kept; 0 means that no epoch had a finite loss, and the last
    weights stand.
    """

    stop_reason: str
    best_epoch: int


class Epoch(NamedTuple):
    """An epoch's mean losses over the training and the validation part, and the learning rate of its first update.

    `validation_loss` is None where there is no validation part.
    """

    train_loss: float
    validation_loss: float | None
    learning_rate: float


def device_of(name: str) -> torch.device:
    """Return torch's device for the setting `device`: `auto` is a GPU if there is one."""
    if name == "auto":
        name = "cuda" if torch.cuda.is_available() else "cpu"
    return torch.device(name)


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
    run_epoch: Callable[[], Epoch],
    *,
    progress: Progress = None,
    stop: Callable[[int, float], bool] = lambda epoch, validation_loss: False,
    keep_last: bool = False,
) -> tuple[list[dict], FitSummary]:
    """Call `run_epoch` up to `epochs` times and leave the weights of the best epoch in `network`.

    `run_epoch` trains once over the training part and evaluates the validation part. The best epoch has the least
    validation loss; with `keep_last` it is the last one, for recipes that have nothing to select by. A loss that is not
    finite ends the training as `diverged`; `stop(epoch, validation_loss)` ends it as `patience`; `progress` is called
    after every epoch. Returns one row of history.csv per epoch and the summary.
    """
    history, best_loss, best_epoch, best_weights = [], float("inf"), 0, None
    stop_reason = "max_epochs"
    for epoch in range(1, epochs + 1):
        losses = run_epoch()
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
        if stop(epoch, known[-1]):
            stop_reason = "patience"
            break
    if best_weights is not None:
        network.load_state_dict(best_weights)
    return history, FitSummary(stop_reason, best_epoch)


class Plateau:
    """Lower the learning rate, and at last stop, where the validation loss no longer falls.

    The learning rate is multiplied by `drop` whenever `plateau` epochs in a row have not lowered the validation loss by
    SMALLEST_GAIN; training stops after `patience` such epochs.
    """

    def __init__(self, optimiser: torch.optim.Optimizer, *, patience: int, plateau: int, drop: float):
        self.optimiser, self.patience, self.plateau, self.drop = optimiser, patience, plateau, drop
        self.least_loss, self.least_epoch = float("inf"), 0

    @property
    def learning_rate(self) -> float:
        """The optimiser's present learning rate."""
        return self.optimiser.param_groups[0]["lr"]

    def __call__(self, epoch: int, validation_loss: float) -> bool:
        """Take an epoch's validation loss; True where training stops."""
        if validation_loss < self.least_loss * (1 - SMALLEST_GAIN):
            self.least_loss, self.least_epoch = validation_loss, epoch
        waited = epoch - self.least_epoch
        if waited >= self.patience:
            return True
        if waited and waited % self.plateau == 0:
            for group in self.optimiser.param_groups:
                group["lr"] *= self.drop
        return False
