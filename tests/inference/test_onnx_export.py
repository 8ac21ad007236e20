"""Networks as ONNX say what torch says, also one reading after the other, and what cannot be exported is refused."""

import argparse
import copy
import json
from pathlib import Path
from typing import NamedTuple

import numpy as np
import onnx
import pytest
import torch
from builders.random_models import CASES, CHOSEN, COLUMNS, MAPS, REFUSED, REGRESSIONS, save
from sklearn.linear_model import Ridge
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler

from tactile.base.errors import InputError
from tactile.commands import export as command
from tactile.inference import card as cards
from tactile.inference import onnx_export, onnx_network, onnx_regressions, predictor
from tactile.learning.estimators import SklearnRegressor
from tactile.learning.regressors import Scaled


class Exported(NamedTuple):
    """A saved model, its ONNX file and how far that is from it."""

    model: predictor.Predictor
    path: Path
    difference: float


@pytest.fixture(scope="module")
def exported(tmp_path_factory):
    """`exported(key)` is a model as ONNX, made once."""
    known: dict[str, Exported] = {}

    def make(key: str) -> Exported:
        if key not in known:
            model = predictor.load(save(key, tmp_path_factory.mktemp(key)))
            folder = tmp_path_factory.mktemp(f"{key}_onnx")
            known[key] = Exported(model, folder / onnx_network.NAME, onnx_export.export(model, folder))
        return known[key]

    return make


def described(path: Path) -> dict:
    """Return the description of a file's tensors from its metadata."""
    held = {entry.key: entry.value for entry in onnx.load(path).metadata_props}
    return json.loads(held[onnx_network.TENSORS])


@pytest.mark.slow
@pytest.mark.parametrize("key", [key for key, case in CASES.items() if case.experiment == "touch"][:5])
def test_windows_give_the_maps_of_the_predictor(key, exported):
    model, path, difference = exported(key)
    readings = np.random.default_rng(3).uniform(40, 200, (11, MAPS.elements)).astype(np.float32)
    maps = model.predict(readings)[4:]  # the first window of three readings, two apart, ends at the fifth
    assert np.abs(maps).max() > 1
    windows = np.stack([readings[last - 4 : last + 1 : 2] for last in range(4, 11)])
    runs = onnx_network.session(path)
    near = 5e-4 * np.abs(maps).max() if key == "lomp" else 1e-3  # whose predictor has weights of 16 bits
    np.testing.assert_allclose(runs.run(None, {"readings": windows})[0], maps, rtol=1e-4, atol=near)
    alone = np.concatenate([runs.run(None, {"readings": window[None]})[0] for window in windows])
    np.testing.assert_allclose(alone, maps, rtol=1e-4, atol=near)


@pytest.mark.slow
@pytest.mark.parametrize("key", [key for key, case in CASES.items() if case.experiment == "glove"])
def test_images_give_the_probabilities_of_the_network(key, exported):
    model, path, difference = exported(key)
    assert difference < 1e-5
    images = np.random.default_rng(3).uniform(0, 255, (5, 1, 1024)).astype(np.float32)
    images *= np.linspace(0, 1, 5, dtype=np.float32)[:, None, None]
    probabilities = model.model.predict(images)
    assert probabilities.shape == (5, 4) and np.ptp(probabilities, axis=0).max() > 1e-3
    runs = onnx_network.session(path)
    np.testing.assert_allclose(runs.run(None, {"readings": images})[0], probabilities, atol=1e-5)
    np.testing.assert_allclose(runs.run(None, {"readings": images[2:3]})[0], probabilities[2:3], atol=1e-5)


@pytest.mark.slow
@pytest.mark.parametrize("key", ["lstm_direct", "lstm_transfer", "lstm_transfer_ridge", "lstm_highpass", "esn"])
def test_a_series_reading_by_reading_is_the_series_at_once(key, exported):
    model, path, difference = exported(key)
    assert difference < 1e-5
    readings = np.random.default_rng(3).uniform(1.5, 2.5, (9, COLUMNS)).astype(np.float32)
    places = model.predict(readings)
    assert np.ptp(places, axis=0).min() > 1e-2
    runs, tensors, predicted = onnx_network.session(path), described(path), []
    states = {}
    for name, tensor in tensors.items():
        if "start" in tensor:
            zero = np.zeros([1 if size == "n" else size for size in tensor["shape"]], np.float32)
            states[name] = zero + readings[:1] if tensor["start"] == onnx_network.REPEATED else zero
    for reading in readings:
        position, *following = runs.run(None, {"readings": reading[None], **states})
        predicted.append(position[0])
        states = dict(zip(states, following, strict=True))
    np.testing.assert_allclose(predicted, places, rtol=1e-4, atol=1e-3)


@pytest.mark.slow
def test_a_stream_of_frames_carries_its_state(exported):
    model, path, difference = exported("lomp_stream")
    assert difference < 1e-5
    readings = np.random.default_rng(3).uniform(40, 200, (7, 2, MAPS.elements)).astype(np.float32)
    model.reset()
    maps = [model.model.step(frames).reshape(2, 4, 6) for frames in readings]
    runs, state = onnx_network.session(path), np.zeros((MAPS.elements, 2, 8), np.float32)
    for frames, expected in zip(readings, maps, strict=True):
        predicted, state = runs.run(None, {"readings": frames, "state": state})
        np.testing.assert_allclose(predicted, expected, rtol=1e-4, atol=1e-3)
    again, _ = runs.run(None, {"readings": readings[-1], "state": np.zeros_like(state)})
    assert np.abs(again - maps[-1]).max() > 0.1  # without the state it is another map


@pytest.mark.slow
def test_a_stream_cuts_its_state(exported):
    _, path, _ = exported("lomp_stream")
    high = np.full((MAPS.elements, 1, 8), 1000, np.float32)
    _, state = onnx_network.session(path).run(
        None, {"readings": np.zeros((1, MAPS.elements), np.float32), "state": high}
    )
    assert state.max() == 10


@pytest.mark.slow
def test_the_file_says_what_goes_in_and_out(exported):
    _, path, _ = exported("lstm_highpass")
    tensors = described(path)
    assert list(tensors) == [*("readings", "recent", "h", "c"), *("position_mm", "next_recent", "next_h", "next_c")]
    assert tensors["readings"]["shape"] == ["n", COLUMNS] and tensors["readings"]["what"].startswith("V: ")
    assert tensors["recent"]["start"] == onnx_network.REPEATED and tensors["h"]["start"] == onnx_network.ZERO
    assert tensors["position_mm"] == {"shape": ["n", 2], "what": "mm, x_mm, y_mm"}
    runs = onnx_network.session(path)
    assert [(given.name, given.shape) for given in runs.get_inputs()] == [
        (name, tensors[name]["shape"]) for name in ("readings", "recent", "h", "c")
    ]
    held = {entry.key: entry.value for entry in onnx.load(path).metadata_props}
    assert cards.Card.model_validate_json(held["card"]).model == "lstm_highpass"
    assert str(Path(torch.__file__).parent).encode() not in path.read_bytes()


@pytest.mark.slow
def test_a_file_that_differs_from_torch_is_refused(exported, tmp_path, monkeypatch):
    model, *_ = exported("cnn")
    write = onnx_export.write

    def spoiled(graph, card, path):
        module = copy.deepcopy(graph.module)  # the model's own stays as it is
        (scaled,) = [part for part in module.modules() if isinstance(part, Scaled)]
        scaled.output_scale *= 1.01
        write(graph._replace(module=module), card, path)

    monkeypatch.setattr(onnx_export, "write", spoiled)
    with pytest.raises(InputError, match=r"touch/cnn: as ONNX it differs from itself by 0.\d+ of full scale"):
        onnx_export.export(model, tmp_path)


@pytest.mark.parametrize("key", REFUSED)
def test_what_onnx_cannot_hold_is_refused(key, tmp_path):
    model = predictor.load(save(key, tmp_path))
    with pytest.raises(InputError, match=f"{key}: cannot be written as ONNX, only networks and regressions can"):
        onnx_export.export(model, tmp_path)
    assert onnx_export.faster(model, tmp_path) is model


def test_a_regression_that_does_not_scale_its_inputs_is_no_regression_for_onnx():
    """Nothing says from which range its readings are drawn; it stays in scikit-learn."""
    x = np.random.default_rng(0).normal(size=(12, MAPS.frames, MAPS.elements)).astype(np.float32)
    part = x, np.resize(x, (12, MAPS.outputs))
    for make, held in ((Ridge, False), (lambda: make_pipeline(StandardScaler(), Ridge()), True)):
        model = SklearnRegressor(lambda seed, make=make: make(), MAPS, count=lambda fitted: 0, macs=None)
        model.fit(part, part, seed=0)
        assert onnx_regressions.is_regression(model) == held


def test_readings_are_from_the_range_of_the_training(tmp_path):
    model = predictor.load(save("lstm_direct", tmp_path))
    readings = onnx_export.random_readings(model, onnx_export.graph_of(model))
    assert readings.shape == (onnx_export.STEPS, onnx_export.ROWS, COLUMNS) and not readings[..., [1, 3]].any()
    far = model.model.scaling.inputs(readings[..., CHOSEN]).abs()
    assert 1.9 < far.max() <= 2.001


@pytest.mark.slow
def test_lomp_stays_in_the_faster_code_of_this_project(tmp_path):
    model = predictor.load(save("lomp_stream", tmp_path))
    assert onnx_export.faster(model, tmp_path) is model
    onnx_export.export(model, tmp_path)
    assert predictor.load(tmp_path).onnx is None


@pytest.mark.slow
def test_onnx_of_another_model_is_refused(tmp_path):
    (tmp_path / "other").mkdir()
    onnx_export.export(predictor.load(save("rnn", tmp_path / "other")), tmp_path)
    with pytest.raises(InputError, match="model.onnx: is not of the model of card.json; make the folder again"):
        predictor.load(save("cnn", tmp_path))


@pytest.mark.slow
@pytest.mark.parametrize("key", REGRESSIONS)
def test_regressions_of_scikit_learn_predict_the_same(key, tmp_path):
    model = predictor.load(save(key, tmp_path))
    onnx = onnx_export.faster(model, tmp_path).onnx
    windows = np.random.default_rng(7).normal(size=(9, MAPS.frames, MAPS.elements)).astype(np.float32)
    maps = model.model.predict(windows)
    assert np.ptp(maps, axis=0).min() > 1e-2
    np.testing.assert_allclose(onnx.predict(windows).reshape(9, -1), maps, rtol=1e-5, atol=1e-5)


def exporting(workspace, model: Path, folder: Path, **chosen) -> None:
    """Run the command."""
    command.main(workspace, argparse.Namespace(**{"model": str(model), "folder": folder, "onnx": False} | chosen))


def test_the_command_makes_a_package_that_predicts_the_same(workspace, tmp_path, capsys):
    source, target = tmp_path / "source", tmp_path / "made" / "package"
    source.mkdir()
    save("linear", source)
    (source / "notes.txt").write_text("not part of the package")
    exporting(workspace, source, target)
    assert sorted(path.name for path in target.iterdir()) == ["card.json", "estimator.skops"]
    readings = np.random.default_rng(0).uniform(40, 200, (6, MAPS.elements))
    np.testing.assert_array_equal(*(predictor.load(folder).predict(readings) for folder in (source, target)))
    assert capsys.readouterr().out.splitlines() == ["touch/linear: folder", f"written to {target}"]
    with pytest.raises(InputError, match="exists already and is never overwritten"):
        exporting(workspace, source, target)


def test_a_refused_export_leaves_nothing(workspace, tmp_path):
    source = tmp_path / "source"
    source.mkdir()
    save("tree", source)
    with pytest.raises(InputError, match="cannot be written as ONNX"):
        exporting(workspace, source, tmp_path / "package", onnx=True)
    assert not (tmp_path / "package").exists() and not list(tmp_path.glob("*.unfinished"))
