"""One prediction of the predictor against ONNX Runtime's, batch 1, one thread."""

import pytest

from benchmarks import inference_speed
from benchmarks.inference_speed import ONNX, PREDICTOR, TORCH, Speed
from benchmarks.made import ROOT
from pipeline.base import params


@pytest.fixture(scope="module")
def table(sizes, results, tmp_path_factory) -> dict[str, dict[str, Speed]]:
    """The times by network and by what runs it, which are also written to benchmarks/inference.csv."""
    values = params.load(ROOT / "params.yaml")
    speeds = {
        network: inference_speed.speeds(values, experiment, network, tmp_path_factory.mktemp(network), sizes.rounds)
        for experiment, network in inference_speed.NETWORKS
    }
    inference_speed.write(results / "benchmarks" / "inference.csv", sum(speeds.values(), []))
    return {network: {speed.runs_on: speed for speed in of_network} for network, of_network in speeds.items()}


@pytest.mark.parametrize(("experiment", "network"), inference_speed.NETWORKS)
def test_inference(record, sizes, table, experiment, network):
    ms = {name: speed.p50_ms for name, speed in table[network].items()}
    record(
        f"inference_{network}",
        what=f"{experiment}/{network}, one prediction, median; torch {ms[TORCH]:.3g} ms",
        peer_is=ONNX,
        unit="ms",
        ours=ms[PREDICTOR],
        peer=ms[ONNX],
        rounds=sizes.rounds,
    )
