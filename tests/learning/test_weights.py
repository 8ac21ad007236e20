"""A file of weights that is whole, and of no model of ours, is a sentence."""

import numpy as np
import pytest
import torch
from builders import live_models, random_models
from safetensors.torch import load_file, save_file

from tactile.base.errors import InputError
from tactile.inference import card as cards
from tactile.inference import consistent, predictor
from tactile.learning import weights

CHANGES = [
    lambda value: value[:0],
    lambda value: value[:1],
    lambda value: value.flatten(),
    lambda value: value[None],
    lambda value: value.to(torch.bfloat16)[..., :1],
    lambda value: torch.empty((0, 10**9)),
    lambda value: torch.empty((4, 0)),
    lambda value: value.repeat(2, *[1] * (value.ndim - 1)),
]


@pytest.mark.parametrize("change", CHANGES)
@pytest.mark.parametrize("kind", ["esn", "lstm_direct", "lstm_highpass", "lomp_stream"])
def test_tensors_of_other_shapes_are_a_sentence(kind, change, tmp_path):
    """Also where the card names the file as it is."""
    folder = live_models.series(tmp_path) if kind == "esn" else random_models.save(kind, tmp_path)
    path, card = folder / weights.NETWORK_FILE, consistent.read(folder)
    whole, refused = load_file(path), 0
    for name in whole:
        if whole[name].ndim == 0 or change(whole[name]).shape == whole[name].shape:
            continue
        changed = {key: value.contiguous() for key, value in (whole | {name: change(whole[name])}).items()}
        save_file({key: value.clone() for key, value in changed.items()}, path)
        digest = {weights.NETWORK_FILE: cards.files.sha256(path)}
        cards.write(folder, card.model_copy(update={"files": digest}))
        with pytest.raises(InputError, match=r"network\.safetensors|card\.json"):
            predictor.load(folder)
        refused += 1
    assert refused > 2
    save_file(whole, path)
    cards.write(folder, card)
    assert np.isfinite(predictor.load(folder).predict(np.ones((9, card.inputs.columns)))).any()


@pytest.mark.parametrize("data", [b"", b"\xff" * 9, b"\x02\0\0\0\0\0\0\0{}", b"\x02\0\0\0\0\0\0\0[]"])
def test_a_damaged_file_is_a_sentence(tmp_path, data):
    (tmp_path / weights.NETWORK_FILE).write_bytes(data)
    with pytest.raises(InputError, match=r"network\.safetensors: .*train the model again"):
        weights.load(torch.nn.Linear(1, 1), weights.read(tmp_path), tmp_path)
