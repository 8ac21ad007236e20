"""What one prediction takes of torch, of the predictor and of ONNX Runtime, side by side, on one thread.

The networks are those of params.yaml as they are drawn, with readings drawn, too. Times do not depend on the weights,
but for LoMP's compiled prediction, which skips the zeros of its state.
"""

import statistics
import time
from collections.abc import Callable, Iterable, Mapping
from functools import cache
from pathlib import Path
from typing import NamedTuple

import numpy as np
import torch

from benchmarks import made
from tactile import models
from tactile.base import files
from tactile.inference import card as cards
from tactile.inference import onnx_export
from tactile.inference.onnx_network import NAME, READINGS, first_states, session
from tactile.inference.predictor import Predictor
from tactile.learning.series_regressors import Scaling
from tactile.learning.spec import Spec, of_images
from tactile.tasks import windows

NETWORKS = (
    *(("touch", "lomp"), ("touch", "lomp_stream"), ("touch", "cnn")),
    *(("strain", "lstm_direct"), ("glove", "sp_resnet")),
)
STRAIN = Spec(10, 1, 6, 1, 2)
OBJECTS = 16
WARM_UP, IN_A_ROW = 20, 20  # calls
TORCH, PREDICTOR, ONNX = "torch", "predictor", "ONNX Runtime"


class Speed(NamedTuple):
    """Half of the predictions of one network, batch 1, took at most `p50_ms`; `mb`: of its file."""

    experiment: str
    network: str
    runs_on: str
    p50_ms: float
    mb: float | str  # empty where it is none of its own
    peak_share: float  # floating-point operations per second, two a product, over those of large products in float32


def drawn(values: Mapping, experiment: str, network: str) -> Predictor:
    """Return a network of params.yaml (`values`), not trained, with a card."""
    kind = {"touch": "windows", "strain": "series", "glove": "images"}[experiment]
    spec = {"touch": lambda: windows.spec(values["touch"]), "strain": lambda: STRAIN}.get(
        experiment, lambda: of_images(OBJECTS)
    )()
    block = values[experiment]["models"][network]
    model = models.build(network, spec, block, "benchmark")
    if kind == "series":
        model.scaling = Scaling.of_training([made.series(1000)])
    elif kind == "windows":
        model.scaled.input_mean.fill_(250.0)
        model.scaled.input_spread.fill_(150.0)
    unit, output_unit = {"windows": ("counts", "kPa"), "series": ("V", "mm"), "images": ("levels", "probability")}[kind]
    return Predictor(
        model,
        cards.Card(
            experiment=experiment,
            kind=kind,
            model=network,
            protocol="none",
            seed=0,
            commit="none",
            settings=dict(block),
            reading={},
            shapes=cards.Shapes(**spec._asdict()),
            inputs=cards.Inputs(columns=spec.elements, unit=unit, order="none", interval_s=0.02, frame_step=1),
            outputs=cards.Outputs(unit=output_unit),
            precision=None,
            best_epoch=0,
            scores=[],
            files={},
        ),
    )


def speeds(values: Mapping, experiment: str, network: str, folder: Path, rounds: int) -> list[Speed]:
    """Return the times of one network; its files are written into `folder`, which exists."""
    model = drawn(values, experiment, network)
    graph, inner = onnx_export.graph_of(model), model.model
    onnx_export.export(model, folder)
    exact = folder / NAME
    x = onnx_export.random_readings(model, graph)[0][-1:]
    quickest = onnx_export.faster(model, folder).onnx or inner
    calls = {
        TORCH: by_torch(graph, x),
        PREDICTOR: (lambda: quickest.step(x)) if graph.states else (lambda: quickest.predict(x)),
        ONNX: by_onnx(exact, graph, x),
    }
    sizes = {ONNX: exact.stat().st_size / 1e6}
    times, work = p50_ms(calls, rounds), 2 * inner.macs() / peak_flops()
    return [
        Speed(experiment, network, name, times[name], sizes.get(name, ""), 1e3 * work / times[name]) for name in calls
    ]


@cache
def peak_flops() -> float:
    """Return the floating-point operations per second of a core in the product of two float32 matrices, the best of 20.

    A share of it can pass 1 where zeros are skipped, or where products are of fewer bits.
    """
    side = 1024
    a, b = torch.rand(side, side), torch.rand(side, side)
    seconds = []
    for _ in range(20):
        began = time.perf_counter()
        torch.mm(a, b)
        seconds.append(time.perf_counter() - began)
    return 2 * side**3 / min(seconds)


def by_torch(graph: onnx_export.Graph, x: np.ndarray) -> Callable[[], object]:
    """Return what runs the graph in torch for readings x (1, ...), the state carried along."""
    module, readings = graph.module.eval(), torch.from_numpy(x)
    states = [torch.from_numpy(state) for state in first_states(graph.states, x).values()]

    def call() -> None:
        with torch.no_grad():
            predicted = module(readings, *states)
        if states:
            states[:] = predicted[1:]

    return call


def by_onnx(path: Path, graph: onnx_export.Graph, x: np.ndarray) -> Callable[[], object]:
    """Return what runs a file for readings x (1, ...), the state carried along."""
    runs, states = session(path), first_states(graph.states, x)

    def call() -> None:
        _, *following = runs.run(None, {READINGS: x, **states})
        states.update(zip(states, following, strict=True))

    return call


def p50_ms(calls: Mapping[str, Callable[[], object]], rounds: int) -> dict[str, float]:
    """Return the median milliseconds of a call of each: in every round, each is called IN_A_ROW times."""
    taken: dict[str, list[float]] = {name: [] for name in calls}
    for call in calls.values():
        for _ in range(WARM_UP):
            call()
    for _ in range(rounds):
        for name, call in calls.items():
            for _ in range(IN_A_ROW):
                began = time.perf_counter()
                call()
                taken[name].append(1e3 * (time.perf_counter() - began))
    return {name: statistics.median(times) for name, times in taken.items()}


def write(path: Path, table: Iterable[Speed]) -> None:
    """Write the times as CSV."""
    files.write_csv(path, Speed._fields, table)
