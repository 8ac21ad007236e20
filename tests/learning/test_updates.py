"""Updates on a card: a graph does what its kernels do one by one."""

import numpy as np
import pytest
import torch

from tactile import models
from tactile.learning import updates
from tactile.learning.spec import Spec, of_images
from tactile.learning.training import device_of

TRAINING = {"learning_rate": 1e-3, "batch_size": 8, "epochs": 6}
IMAGES = TRAINING | {"flip": 0.3, "noise": 0.02, "affine": 0.3}
LOMP = {"hidden": 8, "readout": [8], "neighbours": 4, "alpha": 1.0}
MODELS = {
    "cnn": {"channels": [4], "hidden": [8], "training": TRAINING | {"rest_share": 1.0}},
    "rnn": {"layers": 2, "hidden": 8, "training": TRAINING | {"rest_share": 1.0}},
    "convlstm": {"filters": 4, "training": TRAINING | {"rest_share": 1.0}},
    "lomp": LOMP | {"training": TRAINING | {"rest_share": 1.0}},
    "lomp_stream": LOMP | {"training": TRAINING},
    "resnet3x3": {"training": IMAGES},
    "sp_resnet": {"reduction": 16, "training": IMAGES},
}
CARD = pytest.mark.skipif(not torch.cuda.is_available(), reason="this machine has no card")


def losses(name: str, device: str) -> list[float]:
    """Training losses of six epochs of six updates, the last of a smaller batch."""
    rng = np.random.default_rng(0)
    if "reduction" in MODELS[name] or name.startswith("resnet"):
        x = rng.integers(0, 255, (44, 1, 1024)).astype(np.float32)
        data, spec = (x, np.eye(4, dtype=np.float32)[np.arange(44) % 4]), of_images(4)
    else:
        x = rng.uniform(0, 20, (44, 4, 4)).astype(np.float32)
        data, spec = (x, np.repeat(x[:, -1], 4, axis=1)), Spec(4, 2, 2, 4, 4)
    if name == "lomp_stream":
        data = (*data, np.where(np.arange(44) % 5, np.arange(44) - 1, -1))
    model = models.build(name, spec, MODELS[name], name)
    return [row["train_loss"] for row in model.fit(data, data, seed=1, device=device)]


@CARD
@pytest.mark.parametrize("name", MODELS)
def test_a_card_trains_as_the_cpu_does_and_a_graph_as_its_kernels(name, monkeypatch):
    graphs = losses(name, "cuda")
    monkeypatch.setattr(updates, "EAGER", 10**9)
    np.testing.assert_allclose(graphs, losses(name, "cuda"), rtol=1e-3)
    np.testing.assert_allclose(graphs, losses(name, "cpu"), rtol=0.02)


def test_series_stay_on_the_cpu_unless_a_card_is_named(monkeypatch):
    monkeypatch.setattr(torch.cuda, "is_available", lambda: True)
    assert device_of("auto").type == "cuda" and device_of("auto", series=True).type == "cpu"
    assert device_of("cuda", series=True).type == "cuda"
