"""The one training loop: what it keeps, what ends it, what it writes down."""

import math

import pytest
import torch
from torch import nn

from tactile.learning.training import BFLOAT16_INSTRUCTIONS, Epoch, Schedule, precision_on, run_epochs


class Counter(nn.Module):
    """A network whose one weight is the number of the epoch it was last trained in."""

    def __init__(self):
        super().__init__()
        self.weight = nn.Parameter(torch.zeros(()))


def run(losses, **how):
    """Run epochs with these (training, validation) losses; returns history, summary and the weight that was kept."""
    network, given = Counter(), iter(losses)

    def run_epoch(epoch):
        assert epoch == int(network.weight), "epochs are counted from 0"
        with torch.no_grad():
            network.weight += 1
        return Epoch(*next(given), 0.1)

    history, summary = run_epochs(network, len(losses), run_epoch, **how)
    return history, summary, int(network.weight)


NAN = float("nan")


@pytest.mark.parametrize(
    ("losses", "how", "summary", "kept"),
    [
        ([(3, 3), (2, 1), (1, 2)], {}, ("completed", 2), 2),
        ([(3, 3), (2, 1), (1, 2)], {"keep_last": True}, ("completed", 3), 3),
        ([(3, 3), (NAN, 1), (1, 0)], {}, ("diverged", 1), 1),
        ([(3, 3), (2, 2), (1, NAN)], {}, ("diverged", 2), 2),  # in its last epoch, too
        ([(3, math.inf)], {}, ("diverged", 0), 1),
        ([(3, 3), (NAN, 2)], {"keep_last": True}, ("diverged", 0), 2),
        ([(2, None), (1, None), (3, None)], {}, ("completed", 2), 2),  # no validation part: the training loss decides
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


def test_a_schedule_sets_the_rate_of_all_weights():
    weights = [nn.Parameter(torch.zeros(())) for _ in range(2)]
    optimiser = torch.optim.SGD([{"params": [weight], "lr": 9.0} for weight in weights])
    schedule = Schedule(optimiser, 0.4)
    for done, rate in ((0.05, 0.2), (0.1, 0.4), (0.775, 0.1), (1.0, 0.0)):
        schedule.at(done)
        assert [group["lr"] for group in optimiser.param_groups] == pytest.approx([rate, rate])
        assert schedule.learning_rate == pytest.approx(rate)


@pytest.mark.parametrize("instructions", BFLOAT16_INSTRUCTIONS)
def test_bfloat16_is_had_where_the_processor_has_instructions_for_it(instructions, monkeypatch):
    cpu = torch.device("cpu")
    monkeypatch.setattr(torch.cpu, "get_capabilities", lambda: {"avx2": True, instructions: True})
    monkeypatch.setattr(torch.ops.mkldnn, "_is_mkldnn_bf16_supported", lambda: True)
    assert (precision_on(cpu, "bfloat16"), precision_on(cpu, "float32")) == ("bfloat16", "float32")
    monkeypatch.setattr(torch.ops.mkldnn, "_is_mkldnn_bf16_supported", lambda: False)
    assert precision_on(cpu, "bfloat16") == "float32"
    monkeypatch.setattr(torch.ops.mkldnn, "_is_mkldnn_bf16_supported", lambda: True)
    monkeypatch.setattr(torch.cpu, "get_capabilities", lambda: {"avx2": True, instructions: False})
    assert precision_on(cpu, "bfloat16") == "float32"
