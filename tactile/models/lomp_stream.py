"""Build LoMP as a stream: one frame in, one pressure map out, the state carried along.

Its equations and the network are in tactile/learning/lomp_network.py. The state is zero where a press begins and is
carried through the press's windows in order of time. Training does the same: a batch is `batch_size` presses side by
side, with an update after each window and no gradient through the state that the window starts from.

Messages can make states grow from frame to frame without end where more is pressed than in any training press: of 400
sums of two validation presses, four times as slow, 1 to 3, in each of three trained networks. So a trained network's
state is cut to LARGEST_STATE after every frame. Cut after every window alone it grows within one: of 200 validation
presses that last sixteen times as long, one trained network has an RMSE of 7.25 kPa without a cut, 6.77 with one after
a window (the worst press 28) and 6.55 with one after a frame (15.5, as at their own length); at their own length the
error is the same, 6.57. Cut in training, too, the validation error is 1 to 4 % larger in each of three seeds.

The cut matters where training windows rarely follow one another, as windows at random do not. Of five networks trained
on a quarter of params/touch.yaml's random windows, each of another seed, one has 32.9 kPa on double touches without a
cut, where the mean map has 17.4, 11.3 with one after a window and 11.0 with one after a frame; of five trained on all
presses or random windows, one has 70.4, 11.2 and 10.9, where the mean map has 16.8. With one after a frame all ten have
0.53 to 0.65 times the error of the mean map, so that a share of failures above 26 % would have shown (95 %).
"""

from collections.abc import Callable, Iterator
from typing import Literal

import numpy as np
import torch
from pydantic import Field
from torch import nn

from tactile.learning import cost
from tactile.learning.lomp_network import LompRegressor, maker
from tactile.learning.lomp_shape import LARGEST_STATE
from tactile.learning.regressors import LARGEST_BATCH, batches
from tactile.learning.spec import Spec
from tactile.learning.training import products_in
from tactile.settings.shared import Block, Listed, Number, Width
from tactile.settings.training import ScheduledTraining

QUIET = 0.3  # share of U's first weights that is left


class Settings(Block):
    """Settings of a model `lomp_stream` in params.yaml."""

    hidden: Width = Field(description="Numbers in h, h1, s and m of every element")
    readout: Listed[Width] = Field(description="Width of each hidden layer of the read-out f")
    neighbours: Literal[4, 8] = Field(
        description="Elements that send messages: sharing an edge (4), or also a corner (8)"
    )
    alpha: Number = Field(description="Weight of the messages (equation 4)")
    training: ScheduledTraining = Field(description="How it is trained")


def build(
    spec: Spec, *, hidden: int, readout: list[int], neighbours: int, alpha: float, training: ScheduledTraining
) -> "StreamingLomp":
    """Return the untrained network; settings as `lomp`'s. A frame costs its share of a window and one read-out.

    Raises InputError as `maker`.

    Differs from paper: not in the paper, whose LoMP starts every window from a zero state.
    """
    make = maker(spec, hidden=hidden, readout=readout, neighbours=neighbours, alpha=alpha)

    def with_quiet_messages() -> nn.Module:
        network = make()
        with torch.no_grad():  # as torch draws them, four messages make a state grow from frame to frame, past float32
            network.message.mul_(QUIET)
            network.message_bias.zero_()
        return network

    return StreamingLomp(with_quiet_messages, spec, training)


class StreamingLomp(LompRegressor):
    """LoMP on windows (x, y, previous).

    previous (n,): index of the window that ends just before each window starts and hands its state on, or -1.
    """

    streams = True
    largest_gradient = 1e-3  # about twice the usual norm

    def __init__(self, *arguments):
        super().__init__(*arguments)
        self.state = None  # (elements, streams, hidden), of `step`

    def train_epoch(
        self, train: tuple[torch.Tensor, ...], order: torch.Generator, update: Callable[..., tuple[torch.Tensor, ...]]
    ) -> float:
        """Train once over the part as TorchRegressor does, with one update per window of the presses of a batch."""
        x, _, previous = train
        chains = streams(previous)
        total, seen = torch.zeros((), device=x.device), 0
        for _, batch in batches(torch.randperm(len(chains), generator=order), self.training.batch_size):
            state, drawn = None, self._drawn_faults(len(batch))  # of whole presses, the longest first
            for windows in turns([chains[k] for k in batch.tolist()]):
                before = None if state is None else state[:, : len(windows)]
                faults = None if drawn is None else drawn[: len(windows)]
                loss, state = update((seen + len(windows) / 2) / len(x), windows.to(x.device), before, faults)
                total += loss * len(windows)
                seen += len(windows)
        return float(total) / len(x)

    def update(
        self,
        train: tuple[torch.Tensor, ...],
        descend: Callable[..., torch.Tensor],
        windows: torch.Tensor,
        state: torch.Tensor | None,
        drawn: torch.Tensor | None = None,
    ) -> tuple[torch.Tensor, ...]:
        """Make one update on windows (n,) that begin with a state (elements, n, hidden); return (loss, next state).

        drawn: faults of the windows, as for TorchRegressor.
        """
        x, y, _ = train
        with products_in(self.precision, x.device):
            maps, state = self.network.go_on(self._with_faults(x[windows], drawn), state)
        return descend([nn.functional.mse_loss(maps.float(), y[windows])]), state

    def loss(self, part: tuple[torch.Tensor, ...]) -> float:
        """Return the mean loss over a normalised part (x, y, previous)."""
        x, y, previous = part
        return float(nn.functional.mse_loss(self._all_maps(x, previous), y))

    def predict(self, x: np.ndarray, previous: np.ndarray | None = None) -> np.ndarray:
        """Return maps (n, outputs) in kPa at the end of windows x (n, frames, elements) in ADC counts.

        previous (n,): as in the class; without it every window starts from a zero state.
        """
        x = self.scaled.normalised(torch.from_numpy(np.array(x, dtype=np.float32)).to(self.place))
        alone = np.full(len(x), -1)
        with torch.no_grad():
            maps = self._all_maps(x, alone if previous is None else previous) * self.scaled.output_scale
            return maps.cpu().numpy()

    def step(self, frame: np.ndarray) -> np.ndarray:
        """Return maps (n, outputs) in kPa for the next frame (n, elements) in ADC counts of n streams.

        Another number of streams than in the call before starts all of them from a zero state.
        """
        if self.state is not None and self.state.shape[1] != len(frame):
            self.state = None
        if len(frame) == 1:
            maps, state = self.one_row(np.asarray(frame, np.float32), self.state)
            self.state = np.minimum(state, LARGEST_STATE)
            return maps
        x = self.scaled.normalised(torch.from_numpy(np.array(frame, dtype=np.float32)))
        with torch.no_grad():
            maps, state = self.network.go_on(x[:, None], self.state)
            self.state = state.clamp(max=LARGEST_STATE)
            return (maps * self.scaled.output_scale).numpy()

    def macs(self) -> int:
        """Return the multiply-accumulates for one frame."""
        return cost.multiply_accumulates(self.network, torch.zeros(1, 1, self.spec.elements))

    def _all_maps(self, x: torch.Tensor, previous: np.ndarray) -> torch.Tensor:
        all_maps, chains = x.new_empty(len(x), self.spec.outputs), streams(previous)
        for start in range(0, len(chains), LARGEST_BATCH):
            for windows, maps in self._maps(x, chains[start : start + LARGEST_BATCH]):
                all_maps[windows] = maps
        return all_maps

    def _maps(self, x: torch.Tensor, chains: list[list[int]]) -> Iterator[tuple[torch.Tensor, torch.Tensor]]:
        """Yield (windows, their maps), as predicted, for the windows of every turn."""
        state = None
        for windows in turns(chains):
            before = None if state is None else state[:, : len(windows)]
            maps, state = self.network.go_on(x[windows.to(x.device)], before, LARGEST_STATE)
            yield windows, maps
            state = state.clamp(max=LARGEST_STATE)


def turns(chains: list[list[int]]) -> Iterator[torch.Tensor]:
    """Yield the first window (n,) of every stream, the longest first, then the second of those that have one ..."""
    longest_first = sorted(chains, key=len, reverse=True)
    for turn in range(len(longest_first[0])):
        yield torch.tensor([chain[turn] for chain in longest_first if len(chain) > turn])


def streams(previous: np.ndarray) -> list[list[int]]:
    """Group windows into streams, each in order of time; previous (n,): as in `StreamingLomp`."""
    chains: dict[int, list[int]] = {}  # by their last window so far
    for window, before in enumerate(previous.tolist()):
        chain = chains.pop(before, [])
        chain.append(window)
        chains[window] = chain
    return list(chains.values())
