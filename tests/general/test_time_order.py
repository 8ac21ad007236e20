"""Which frames every model sees: one output follows the last frame of a window alone, the other the first alone.

A model that read its frames in another order when it predicts, or took its answer from another frame, solves one of
the two and not the other.
"""

import numpy as np
import pytest
from builders.project import ROOT

from tactile import experiments, models
from tactile.base import params
from tactile.datasets import series
from tactile.learning.series_regressors import adapted
from tactile.learning.spec import Spec, of_series
from tactile.own import settings as own_settings

VALUES = params.load(ROOT / "params.yaml")
SOLVED, NOT_SOLVED = 0.85, 0.95  # error over that of the mean: at most, and at least
BOTH, LAST, NEITHER = (True, True), (True, False), (False, False)  # of the last and of the first frame
LEARNING = dict(learning_rate=1e-2, batch_size=16, epochs=20)
WINDOWED = {"training": LEARNING | {"rest_share": 1.0}}
LOMP = dict(hidden=16, readout=[8], neighbours=4, alpha=0.1)
RECIPE = {"learning_rate": 2e-2, "epochs": 40, "drop_epoch": 30, "drop": 0.2, "clip": 1.0, "streams": 8, "batch": 8}
STRETCHES = {"learning_rate": 2e-2, "epochs": 12, "batch": 8, "length": 40, "warm_up": 5, "clip": 1.0}
# kind of input -> model -> (what it is meant to see, settings)
MODELS = {
    "windows": {
        "constant": (NEITHER, {}),
        "linear": (LAST, {}),
        "poly": (LAST, dict(degree=2, ridge=1.0)),
        "tree": (BOTH, dict(each="element", min_samples_leaf=5, max_features=1.0)),
        "linear_array": (BOTH, {}),
        "poly_array": (LAST, dict(degree=2, ridge=1.0)),  # products of the last frame
        "tree_array": (BOTH, dict(min_samples_leaf=5, max_features=1.0)),
        "rbf": (BOTH, dict(centres=20, width=2.0, ridge=1e-3)),
        "rnn": (BOTH, dict(layers=2, hidden=16) | WINDOWED),
        "cnn": (BOTH, dict(channels=[4, 8], hidden=[16]) | WINDOWED),
        "convlstm": (BOTH, dict(filters=8) | WINDOWED),
        "vgg": (BOTH, dict(channels=[32] * 5, training=WINDOWED["training"] | {"epochs": 30, "batch_size": 32})),
        "lomp": (BOTH, LOMP | WINDOWED),
        "lomp_shared": (BOTH, LOMP | WINDOWED),
        "lomp_stream": (BOTH, LOMP | {"training": LEARNING}),
        "window_trees": (BOTH, dict(trees=200, min_samples_leaf=5)),
        "window_ridge": (BOTH, dict(parts=4, shares=False)),
    },
    "series": {
        "constant": (NEITHER, {}),
        "ridge": (BOTH, {"ridge": 1e-3}),
        "esn": (BOTH, dict(units=50, spectral_radius=0.9, leak=1.0, input_scale=0.3, ridge=1e-6)),
        "lstm_direct": (BOTH, {"units": 24, "training": RECIPE}),
        "lstm_transfer": (BOTH, {"training": RECIPE | {"learning_rate": 0.1}}),
        "lstm_transfer_ridge": (BOTH, {"ridge": 1e-6}),
        "lstm_highpass": (BOTH, {"filters": 6, "taps": 4, "units": 16, "training": STRETCHES}),
        "window_trees": (BOTH, dict(trees=200, min_samples_leaf=5)),
        "window_ridge": (BOTH, dict(parts=4, shares=False)),
        "press_difference": (LAST, {"press": 2, "trees": 10, "min_samples_leaf": 5}),  # what is before is rest to it
    },
}
FRAMES, DELAY = 4, 2


@pytest.mark.parametrize("kind", MODELS)
def test_every_registered_model_is_here(kind):
    of_kind = [name for name in VALUES["experiments"] if experiments.module(name).KIND == kind]
    assert set(MODELS[kind]) == {
        model for name in of_kind for model in [*VALUES[name]["models"], *own_settings.YARDSTICKS["windows"]]
    }


def solved(predicted: np.ndarray, truth: np.ndarray) -> np.ndarray:
    """Error of the outputs (n, 2, ...) of the last and of the first frame, over that of the mean."""
    squares = np.square(predicted - truth), np.square(truth - truth.mean(0))
    own, mean = (np.moveaxis(each, 1, 0).reshape(2, -1).mean(1) for each in squares)
    return np.sqrt(own / mean)


def check(sees: tuple, errors: np.ndarray) -> None:
    for seen, error in zip(sees, errors, strict=True):
        assert error < SOLVED if seen else error > NOT_SOLVED, errors


def windows(n: int, seed: int) -> tuple:
    """Windows of noise; the upper row of an element's four cells is its last value, the lower its first."""
    x = np.random.default_rng(seed).uniform(0, 1000, (n, FRAMES, 4)).astype(np.float32)
    last, first = (x[:, frame].reshape(n, 2, 2).repeat(2, axis=2) for frame in (-1, 0))
    y = np.stack([last, first], axis=2)
    assert abs(np.corrcoef(last.ravel(), first.ravel())[0, 1]) < 0.15, "neither frame tells of the other"
    return x, y.reshape(n, 16), np.full(n, -1)


@pytest.mark.parametrize("key", MODELS["windows"])
def test_a_model_of_windows_sees_the_first_and_the_last_frame(key):
    sees, settings = MODELS["windows"][key]
    model = models.build(key, Spec(FRAMES, 2, 2, 4, 4), settings, "test")
    columns = 3 if getattr(model, "streams", False) else 2
    model.fit(windows(320, 0)[:columns], windows(80, 1)[:columns], seed=0)
    x, y, previous = windows(80, 1)
    predicted = model.predict(x, previous) if columns == 3 else model.predict(x)
    check(sees, solved(*(maps.reshape(80, 2, 2, 4).swapaxes(1, 2) for maps in (predicted, y))))


def record(outputs: int, samples: int = 1200, seed: int = 0) -> series.Record:
    """Two voltages of noise; the outputs follow the first now, the first DELAY samples ago, and the second then."""
    x = np.random.default_rng(seed).normal(2, 0.1, (samples, 2)).astype(np.float32)
    before = np.roll(x, DELAY, axis=0)
    y = 50 * np.column_stack([x[:, 0], before])[:, :outputs]
    assert abs(np.corrcoef(y[:, :2].T)[0, 1]) < 0.15, "neither sample tells of the other"
    every = np.ones(samples, bool)
    return series.Record(x, y, every, np.arange(samples) < 0.9 * samples, np.arange(samples) // 8)


def series_model(key: str, outputs: int = 2):
    spec = of_series(series.Task(tuple(range(outputs)), {"a": [0, 1]}, False, "a"), DELAY + 3)
    return adapted(models.build(key, spec, MODELS["series"][key][1], "test"), spec)


@pytest.fixture(scope="module")
def model_zero(tmp_path_factory):
    folder, model = tmp_path_factory.mktemp("zero"), series_model("lstm_direct", 3)
    model.fit([record(3)], seed=0, device="cpu", base=None)
    model.save(folder)
    return folder


@pytest.mark.parametrize("key", MODELS["series"])
def test_a_model_of_series_sees_this_sample_and_one_before(key, model_zero):
    model, fresh = series_model(key), record(2, 300, seed=9)
    model.fit([record(2)], seed=0, device="cpu", base=model_zero)
    began = 10  # samples after which the past is a whole window
    check(MODELS["series"][key][0], solved(model.predict(fresh.x)[began:], fresh.y[began:]))
