"""One prediction of the predictor against ONNX Runtime's, batch 1, one thread."""

import pytest

from benchmarks import inference_speed
from benchmarks.inference_speed import ONNX, PREDICTOR, TORCH, Speed
from benchmarks.made import ROOT
from tactile.base import params

# Ratios to the peer in the same run: a time that one make of processor keeps, another does not.
LEAST_RATIO = {"lomp": {TORCH: 2.0, ONNX: 1.5}, "lomp_stream": {TORCH: 2.0, ONNX: 1.2}}
WORK = {
    "lomp": "a window of 8 frames of 5x5 elements to a map of 20x20",
    "lomp_stream": "a frame of 5x5 elements to a map of 20x20",
    "cnn": "a window of 8 frames of 5x5 elements to a map of 20x20",
    "lstm_direct": "a sample of 6 strands to two places",
    "sp_resnet": "an image of 32x32 pixels to 16 objects",
}


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
@pytest.mark.parametrize("peer", [TORCH, ONNX])
def test_inference(record, sizes, table, experiment, network, peer):
    ms = {name: speed.p50_ms for name, speed in table[network].items()}
    record(
        f"inference_{network}_{'torch' if peer == TORCH else 'onnx'}",
        what=f"{experiment}/{network}, one prediction, median: {WORK[network]}",
        peer_is=peer,
        unit="ms",
        ours=ms[PREDICTOR],
        peer=ms[peer],
        least_ratio=LEAST_RATIO.get(network, {}).get(peer),
        rounds=sizes.rounds,
    )
