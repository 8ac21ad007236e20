"""Make the updates of a training: called as they are on a CPU, replayed as CUDA graphs on a card.

An update of LoMP is some 600 kernels of a few microseconds each. Launched one by one they keep a card waiting for
Python; a graph launches them all in one call.
"""

import contextlib
import warnings
from collections import Counter
from collections.abc import Callable

import torch

EAGER = 3  # calls of a shape before its graph is captured: libraries choose and set up their kernels in the first ones

warnings.filterwarnings("ignore", "This instance was constructed with capturable=True")  # of EAGER, and last batches

Given = torch.Tensor | None
Key = tuple[tuple[torch.Size, torch.dtype] | None, ...]


class Update:
    """Call `function(*tensors)`, which makes one update; on a card as a CUDA graph, one for each shape of its tensors.

    function: takes tensors, or None, on the device, and returns a tuple of tensors. It must neither read a value nor
    copy from the CPU's memory: a graph repeats what the card did, not what Python did. A result is overwritten by the
    next call. On a card everything that the function uses belongs to the stream of `stream_on`.
    """

    def __init__(self, function: Callable[..., tuple[torch.Tensor, ...]], place: torch.device):
        self.function, self.place = function, place
        self.calls: Counter[Key] = Counter()
        self.graphs: dict[Key, tuple[torch.cuda.CUDAGraph, list[Given], tuple[torch.Tensor, ...]]] = {}

    def __call__(self, *given: Given) -> tuple[torch.Tensor, ...]:
        if self.place.type != "cuda":
            return self.function(*given)
        tensors = [None if one is None else one.to(self.place) for one in given]
        key = tuple(None if one is None else (one.shape, one.dtype) for one in tensors)
        if key not in self.graphs:
            self.calls[key] += 1
            if self.calls[key] <= EAGER:
                return self.function(*tensors)
            self.graphs[key] = self._captured(tensors)
        graph, inputs, results = self.graphs[key]
        for kept, new in zip(inputs, tensors, strict=True):
            if kept is not None:
                kept.copy_(new)
        graph.replay()
        return results

    def _captured(self, tensors: list[Given]) -> tuple[torch.cuda.CUDAGraph, list[Given], tuple[torch.Tensor, ...]]:
        """Return the graph of one call, which it does not make, with the tensors that it reads and writes."""
        inputs = [None if one is None else one.clone() for one in tensors]
        graph = torch.cuda.CUDAGraph()
        with torch.cuda.graph(graph, stream=torch.cuda.current_stream(self.place)):
            results = self.function(*inputs)
        return graph, inputs, results


def stream_on(place: torch.device) -> contextlib.AbstractContextManager:
    """Return the context of a training: on a card a stream of its own, as the default one cannot be captured."""
    return torch.cuda.stream(torch.cuda.Stream(place)) if place.type == "cuda" else contextlib.nullcontext()


def adam(weights, learning_rate: float, place: torch.device, **settings) -> torch.optim.Adam:
    """Return Adam for an Update; on a card its learning rate is a tensor, which a graph reads anew in every replay."""
    if place.type == "cuda":
        settings["capturable"] = True
        return torch.optim.Adam(weights, lr=torch.tensor(learning_rate, device=place), fused=True, **settings)
    return torch.optim.Adam(weights, lr=learning_rate, fused=True, **settings)
