"""Candidates for what the other benchmarks find too slow: their gain and their error."""

import numpy as np
import pyarrow.parquet
import pytest
import torch
from benchmarks import candidates, made, measure, peers

from pipeline import params, paths, tables
from pipeline.fitting import Spec
from pipeline.models import esn


@pytest.fixture(scope="module")
def trained():
    """LoMP of the first run, its test windows and their labels; needs what `dvc repro` has made."""
    model = measure.lomp(5, max_epochs=1)
    model.load(paths.require(paths.run_folder("touch", "lomp", "press", 0), "dvc repro"))
    column = tables.split_column("press", 0)
    file = paths.require(paths.dataset("touch"), "dvc repro")
    table = pyarrow.parquet.read_table(file, columns=["condition", column, "x", "y"])
    single = (tables.names(table["condition"]) == "single") & (tables.names(table[column]) == "test")
    x, y = (tables.matrix(table[name])[single] for name in ("x", "y"))
    return model, x.astype(np.float32).reshape(len(x), 8, 25), y


def test_candidate_lomp_numpy(race, record, sizes, trained):
    model, x, y = trained
    small = candidates.SmallLomp(model.network)
    mean, spread, scale = (part.numpy() for part in (model.input_mean, model.input_spread, model.output_scale))

    def predict(windows: np.ndarray) -> np.ndarray:
        return np.stack([small(one) for one in (windows - mean) / spread]) * scale

    loop = measure.lomp(5, max_epochs=1)
    loop.network = peers.LoopedLomp(model.network)
    chosen = slice(None) if sizes.name == "full" else slice(0, None, 20)
    exact, ours = model.predict(x[chosen]), predict(x[chosen])
    errors = [float(np.sqrt(np.mean((maps - y[chosen]) ** 2))) for maps in (exact, ours)]
    off = float(np.abs(ours - exact).max() / exact.max())
    one = x[:1]
    seconds, peer, now = race(
        lambda: predict(one), lambda: loop.predict(one), lambda: model.predict(one), rounds=sizes.rounds, calls=20
    )
    record(
        "candidate_lomp_numpy",
        what=f"LoMP, batch 1, in numpy (torch: {now * 1e3:.2f} ms); test RMSE {errors[0]:.4f} to {errors[1]:.4f} kPa",
        peer_is="a loop over 25 modules",
        unit="ms",
        ours=seconds * 1e3,
        peer=peer * 1e3,
        least_ratio=12,
        rounds=sizes.rounds,
    )
    what = "largest change of a map, share of full scale"
    record("candidate_lomp_numpy_error", what=what, unit="%", ours=100 * off, most=0.5, rounds=1)


def test_candidate_lomp_chunks(race, record, sizes):
    networks = [measure.lomp(5, max_epochs=1).network for _ in range(2)]
    torch.manual_seed(0)
    x, y = torch.randn(sizes.windows, 8, 25), torch.randn(sizes.windows, 400)
    seconds, peer = race(
        candidates.chunked_step(networks[0], x, y, 32), peers.train_step(peers.LoopedLomp(networks[1]), x, y), rounds=7
    )
    record(
        "candidate_lomp_chunks",
        what=f"LoMP, one update, {sizes.windows} windows, gradients summed over chunks of 32",
        peer_is="a loop over 25 modules",
        unit="ms",
        ours=seconds * 1e3,
        peer=peer * 1e3,
        least_ratio=1.5,
        rounds=7,
    )


def test_candidate_esn_pieces(race, record, sizes):
    block = params.load()["strain"]["models"]["esn"]
    system = esn.build(Spec(10, 1, 6, 1, 2), **block).make(6, 0)
    x, leak = made.series(sizes.samples).x, block["leak"]
    exact = peers.reservoir_states(system, leak, x)

    def ours() -> np.ndarray:
        return candidates.reservoir_states(system, leak, x, pieces=16, warm=1000)

    off = float(np.abs(ours() - exact).max())
    seconds, peer = race(ours, lambda: peers.reservoir_states(system, leak, x), rounds=5)
    record(
        "candidate_esn_pieces",
        what=f"states of {len(x)} samples in 16 pieces side by side; they differ by {off:.1e} at most",
        peer_is="a loop in numpy",
        unit="s",
        ours=seconds,
        peer=peer,
        least_ratio=3,
        rounds=5,
    )
