"""The card of a model of strands knows how they went together in training, and predict says where they do otherwise."""

import json

import numpy as np
import pyarrow as pa
import pytest
from builders import live_models

from tactile.base.paths import Workspace
from tactile.datasets import schemas
from tactile.inference import card as cards
from tactile.inference import channels, consistent, predictor, recordings

N = 12_000
SETTINGS = live_models.SERIES | {"ingest": live_models.SERIES["ingest"] | {"max_gap_s": 1.0}}


def bent(n: int, seed: int) -> np.ndarray:
    """Return voltages (n, 5) of strands that follow two ways of bending."""
    rng, mix = np.random.default_rng(seed), np.random.default_rng(5).normal(size=(2, 5))
    bending = 0.02 * np.cumsum(rng.normal(size=(n, 2)), axis=0)
    bending -= np.linspace(0, 1, n)[:, None] * bending[-1]
    return 2 + 0.1 * bending @ mix + rng.normal(0, 0.0005, (n, 5))


@pytest.fixture(scope="module")
def model(tmp_path_factory) -> predictor.Predictor:
    folder = tmp_path_factory.mktemp("model")
    workspace, part = Workspace(folder), np.repeat(["train", "test"], [N - 2000, 2000])
    x = bent(N, 0)
    x[part == "test"] = x[part == "test"][:, ::-1]  # what it is not trained on
    names = pa.array(["task_2"] * N).dictionary_encode()
    columns = {"condition": names, "recording": names, "t_s": np.arange(N) / 5, "press": np.zeros(N, np.int32)}
    columns |= {"v": schemas.lists(x, pa.float32()), "y": schemas.lists(x[:, :3], pa.float32())}
    split = {schemas.split_column("task_2", 0): pa.array(part).dictionary_encode()}
    table = pa.table(columns | split)
    card = consistent.read(live_models.series(folder / "series"))
    inputs = card.inputs.model_copy(update={"chosen": list(range(5))})
    card = card.model_copy(update={"protocol": "task_2", "inputs": inputs, "reading": SETTINGS})
    assert channels.trained(workspace, SETTINGS, card) is None, "no dataset"
    workspace.dataset("strain").parent.mkdir(parents=True)
    schemas.write(workspace.dataset("strain"), table.schema, [table])
    found = channels.trained(workspace, SETTINGS, card)
    assert found is not None and found.columns == list(range(5))
    expected = np.corrcoef((x[found.lag : N - 2000] - x[: N - 2000 - found.lag]).T)
    np.testing.assert_allclose(found.correlation, expected, atol=1e-3)
    card = card.model_copy(update={"correlation": found, "inputs": inputs.model_copy(update={"chosen": [4, 0, 2]})})
    cards.write(folder / "series", card)
    return predictor.load(folder / "series")


def read_back(model, x: np.ndarray, folder) -> recordings.Recording:
    log = folder / "task_2" / "run" / "daq.log"
    log.parent.mkdir(parents=True, exist_ok=True)
    rows = zip(np.arange(len(x)) / 5, x, strict=True)
    log.write_text("".join(f"{t:.1f},{','.join(f'{v:.5f}' for v in row)}\n" for t, row in rows))
    return recordings.read(log, "run", model.card)


def test_exchanged_strands_are_told(model, tmp_path):
    x = bent(4000, 7)
    usual = recordings.predict(model, read_back(model, x, tmp_path))
    assert usual.notes == []
    for order in ([1, 0, 2, 3, 4], [0, 1, 4, 3, 2], [0, 3, 2, 1, 4]):
        found = recordings.predict(model, read_back(model, x[:, order], tmp_path))
        (words,) = found.notes
        one, other = [f"u{k}" for k, place in enumerate(order) if k != place]
        assert words.startswith("the channels do not change together as in training (correlations of u")
        assert words.endswith(f"at most): with {one} and {other} exchanged they would")
    x[1000, :] = 2.5  # one frame
    x[2000:2005, :] = 0.0
    assert [words for words in read_back(model, x, tmp_path).notes if "change together" in words] == []


def test_a_card_of_before_says_nothing(model, tmp_path):
    content = json.loads(model.card.model_dump_json())
    del content["correlation"]
    old = model.card.model_validate_json(json.dumps(content))
    model = predictor.Predictor(model.model, old)
    found = read_back(model, bent(4000, 7)[:, [1, 0, 2, 3, 4]], tmp_path)
    assert found.notes == []
    windows = consistent.read(live_models.linear(tmp_path / "windows"))
    assert channels.trained(Workspace(tmp_path), {}, windows) is None
