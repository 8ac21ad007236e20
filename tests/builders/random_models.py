"""Save every model of random weights and scaling with its card, as training would, without any training."""

from pathlib import Path
from typing import NamedTuple

import numpy as np
import torch

from builders import live_models
from tactile import models, tasks
from tactile.datasets.series import Record
from tactile.inference import card as cards
from tactile.learning.regressors import Scaled
from tactile.learning.series_regressors import Scaling, StateReadout
from tactile.learning.spec import Spec, of_images

MAPS = Spec(3, 2, 3, 4, 6)
SERIES = Spec(4, 1, 3, 1, 2)  # three of the sensor's five channels
IMAGES = of_images(4)
COLUMNS, CHOSEN = 5, [4, 0, 2]
WINDOW_TRAINING = dict(learning_rate=1e-3, batch_size=8, epochs=1, rest_share=1.0)
STREAM_TRAINING = dict(learning_rate=1e-3, batch_size=8, epochs=1)
SEQUENCE_TRAINING = dict(learning_rate=1e-3, epochs=1, drop_epoch=1, drop=0.5, clip=1.0, streams=1, batch=1)
STRETCH_TRAINING = dict(learning_rate=1e-3, epochs=1, batch=2, length=8, warm_up=2, clip=1.0)
IMAGE_TRAINING = dict(learning_rate=1e-3, batch_size=8, epochs=1, flip=0.0, noise=0.0, affine=0.0)
LOMP = dict(hidden=8, readout=[6], neighbours=4, alpha=1.0)


class Case(NamedTuple):
    """A network and the task that it is tried on."""

    experiment: str
    spec: Spec
    settings: dict


CASES = {
    "cnn": Case("touch", MAPS, dict(channels=[4], hidden=[8], training=WINDOW_TRAINING)),
    "vgg": Case("touch", MAPS, dict(channels=[16, 16, 32, 32, 32], training=WINDOW_TRAINING)),
    "convlstm": Case("touch", MAPS, dict(filters=3, training=WINDOW_TRAINING)),
    "rnn": Case("touch", MAPS, dict(layers=2, hidden=8, readout=[7], training=WINDOW_TRAINING)),
    "lomp": Case("touch", MAPS, dict(LOMP, training=WINDOW_TRAINING)),
    "lomp_shared": Case("touch", MAPS, dict(LOMP, training=WINDOW_TRAINING)),
    "lomp_stream": Case("touch", MAPS, dict(LOMP, training=STREAM_TRAINING)),
    "lstm_direct": Case("strain", SERIES, dict(units=6, training=SEQUENCE_TRAINING)),
    "lstm_transfer": Case("strain", SERIES, dict(training=SEQUENCE_TRAINING)),
    "lstm_transfer_ridge": Case("strain", SERIES, dict(ridge=1e-6)),
    "lstm_highpass": Case("strain", SERIES, dict(filters=4, taps=3, units=6, training=STRETCH_TRAINING)),
    "esn": Case("strain", SERIES, dict(units=20, spectral_radius=0.9, leak=0.3, input_scale=0.5, ridge=1e-6)),
    "resnet18": Case("glove", IMAGES, dict(training=IMAGE_TRAINING)),
    "mobilenet": Case("glove", IMAGES, dict(training=IMAGE_TRAINING)),
    "resnet3x3": Case("glove", IMAGES, dict(training=IMAGE_TRAINING)),
    "sp_resnet_nogcam": Case("glove", IMAGES, dict(training=IMAGE_TRAINING)),
    "sp_resnet": Case("glove", IMAGES, dict(reduction=16, training=IMAGE_TRAINING)),
    "linear": Case("touch", MAPS, {}),
    "poly": Case("touch", MAPS, dict(degree=3, ridge=1.0)),
    "linear_array": Case("touch", MAPS, {}),
    "poly_array": Case("touch", MAPS, dict(degree=3, ridge=1.0)),
    "rbf": Case("touch", MAPS, dict(centres=5, width=2.0, ridge=1e-3)),
    "tree": Case("touch", MAPS, dict(each="element", min_samples_leaf=1, max_features=1.0)),
    "ridge": Case("strain", SERIES, dict(ridge=1.0)),
}
REGRESSIONS = ("linear", "poly", "linear_array", "poly_array", "rbf")
REFUSED = ("tree", "ridge")
NO_NETWORKS = (*REGRESSIONS, *REFUSED)
READING = {
    "windows": live_models.TOUCH | {"label": live_models.TOUCH["label"] | {"map_rows": 4, "map_cols": 6}},
    "series": live_models.SERIES | {"window": {"frames": 4}},
    "images": live_models.IMAGES,
}
KINDS = {"touch": ("windows", "counts", "kPa"), "strain": ("series", "V", "mm"), "glove": ("images", "levels", None)}


def series_record() -> Record:
    """Return a record of noise around 2 V."""
    rng, training = np.random.default_rng(0), np.arange(60) < 40
    x = 2 + 0.1 * rng.normal(size=(60, SERIES.elements))
    y = 20 + 5 * rng.normal(size=(60, SERIES.outputs))
    return Record(x.astype(np.float32), y.astype(np.float32), np.ones(60, bool), training, np.zeros(60, np.int32))


def randomise(network: torch.nn.Module, spec: Spec) -> None:
    """Draw last layers, which start at zero, and let batch normalisation see readings."""
    draw = torch.Generator().manual_seed(1)
    with torch.no_grad():
        for weights in network.parameters():
            if not weights.any():
                weights.copy_(0.3 * torch.randn(weights.shape, generator=draw))
        assert all(weights.any() for weights in network.parameters())
        normalising = [layer for layer in network.modules() if isinstance(layer, torch.nn.BatchNorm2d)]
        for layer in normalising:
            layer.momentum = 1.0
        if normalising:
            inputs = (torch.rand if spec is IMAGES else torch.randn)(32, spec.frames, spec.elements, generator=draw)
            network.train()(inputs)
            network.eval()


def save(key: str, folder: Path) -> Path:
    """Save a model of random weights and scaling into `folder`, with a card, and return it."""
    case = CASES[key]
    kind, unit, output_unit = KINDS[case.experiment]
    with torch.random.fork_rng():  # the same weights in whatever order tests run
        torch.manual_seed(0)
        model = tasks.of(case.experiment).adapted(models.build(key, case.spec, case.settings, "test"), case.spec)
    if key in NO_NETWORKS or isinstance(model, StateReadout):
        x, y = np.random.default_rng(0).normal(size=(2, 12, case.spec.frames, case.spec.elements)).astype(np.float32)
        part = x, np.resize(y, (12, case.spec.outputs))
        model.fit([series_record()], seed=0) if kind == "series" else model.fit(part, part, seed=0)
    else:
        randomise(model.network, case.spec)
    if kind == "series" and key not in NO_NETWORKS:
        model.scaling = Scaling.of_training([series_record()])
    elif kind == "windows" and key not in NO_NETWORKS:
        elements = torch.arange(case.spec.elements)
        model.scaled = Scaled(model.network, 100.0 + elements, 30.0 + elements, torch.tensor(250.0))
    names = {"windows": None, "series": ["x_mm", "y_mm"], "images": ["bottle", "can", "cup", "pen"]}[kind]
    columns = {"windows": MAPS.elements, "series": COLUMNS, "images": 405}[kind]
    chosen, step = CHOSEN if kind == "series" else None, 2 if kind == "windows" else 1
    return live_models.saved(
        folder,
        model,
        key,
        case.spec,
        experiment=case.experiment,
        kind=kind,
        settings=case.settings,
        protocol={"windows": "press", "series": "task_2", "images": "session_combined"}[kind],
        reading=READING[kind],
        inputs=dict(columns=columns, unit=unit, order="as in the log", chosen=chosen, frame_step=step),
        outputs=cards.Outputs(
            unit=output_unit or "probability", names=names, touch_kpa=20.0 if kind == "windows" else None
        ),
    )
