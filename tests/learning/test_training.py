"""The one training loop: what it keeps, what ends it, what it writes down."""

import math

import pytest
import torch
from torch import nn

from pipeline.learning.training import Epoch, Plateau, device_of, run_epochs


class Counter(nn.Module):
    """A network whose one weight is the number of the epoch it was last trained in."""

    def __init__(self):
        super().__init__()
        self.weight = nn.Parameter(torch.zeros(()))


def run(losses, **how):
    """Run epochs with these (training, validation) losses; returns history, summary and the weight that was kept."""
    network, given = Counter(), iter(losses)

    def run_epoch():
        with torch.no_grad():
            network.weight += 1
        return Epoch(*next(given), 0.1)

    history, summary = run_epochs(network, len(losses), run_epoch, **how)
    return history, summary, int(network.weight)


NAN = float("nan")


@pytest.mark.parametrize(
    ("losses", "how", "summary", "kept"),
    [
        ([(3, 3), (2, 1), (1, 2)], {}, ("max_epochs", 2), 2),
        ([(3, 3), (2, 1), (1, 2)], {"keep_last": True}, ("max_epochs", 3), 3),
        ([(3, 3), (2, 1), (1, 2), (1, 0)], {"stop": lambda epoch, loss: epoch == 3}, ("patience", 2), 2),
        ([(3, 3), (NAN, 1), (1, 0)], {}, ("diverged", 1), 1),
        ([(3, 3), (2, 2), (1, NAN)], {}, ("diverged", 2), 2),  # in its last epoch, too
        ([(3, math.inf)], {}, ("diverged", 0), 1),
        ([(3, 3), (NAN, 2)], {"keep_last": True}, ("diverged", 0), 2),
        ([(2, None), (1, None), (3, None)], {}, ("max_epochs", 2), 2),  # no validation part: the training loss decides
    ],
)
def test_which_epoch_is_kept_and_what_ended_the_training(losses, how, summary, kept):
    history, found, weight = run(losses, **how)
    assert (tuple(found), weight) == (summary, kept)
    assert [row["epoch"] for row in history] == list(range(1, len(history) + 1))
    assert set(history[0]) == {"epoch", "train_loss", "validation_loss", "learning_rate"}


def test_progress_hears_every_epoch():
    heard = []
    run([(3, 2), (1, None)], progress=lambda *numbers: heard.append(numbers))
    assert heard[0] == (1, 2, 3, 2) and heard[1][:3] == (2, 2, 1) and math.isnan(heard[1][3])


def test_a_plateau_lowers_the_rate_and_at_last_stops():
    optimiser = torch.optim.SGD([nn.Parameter(torch.zeros(()))], lr=1.0)
    plateau, rates, stopped = Plateau(optimiser, patience=4, plateau=2, drop=0.5), [], []
    for epoch, loss in enumerate([1.0, 0.5, 0.499, 0.498, 0.497, 0.4965], 1):  # less than a hundredth is no progress
        stopped.append(plateau(epoch, loss))
        rates.append(plateau.learning_rate)
    assert rates == [1.0, 1.0, 1.0, 0.5, 0.5, 0.5] and stopped == [False] * 5 + [True]


def test_devices():
    assert device_of("cpu").type == "cpu"
    assert device_of("auto").type == ("cuda" if torch.cuda.is_available() else "cpu")
