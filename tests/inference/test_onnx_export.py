"""Networks as ONNX say what torch says, also one reading after the other, and what cannot be exported is refused."""

import argparse
import json
from pathlib import Path
from typing import NamedTuple

import numpy as np
import onnx
import pytest
import torch

from pipeline import models, tasks
from pipeline.base.errors import InputError
from pipeline.commands import export as command
from pipeline.datasets.series import Record
from pipeline.inference import card as cards
from pipeline.inference import onnx_export, onnx_network, predictor
from pipeline.learning import image_classifier
from pipeline.learning.regressors import Spec
from pipeline.learning.series_regressors import Scaling, StateReadout

MAPS = Spec(3, 2, 3, 4, 6)
SERIES = Spec(4, 1, 3, 1, 2)  # three of the sensor's five channels
IMAGES = image_classifier.spec_of(4)
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
    "rnn": Case("touch", MAPS, dict(layers=2, hidden=8, training=WINDOW_TRAINING)),
    "lomp": Case("touch", MAPS, dict(LOMP, training=WINDOW_TRAINING)),
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
    model = tasks.of(case.experiment).adapted(models.build(key, case.spec, case.settings, "test"), case.spec)
    if key in NO_NETWORKS or isinstance(model, StateReadout):
        x, y = np.random.default_rng(0).normal(size=(2, 12, case.spec.frames, case.spec.elements)).astype(np.float32)
        part = x, np.resize(y, (12, case.spec.outputs))
        model.fit([series_record()], seed=0) if kind == "series" else model.fit(part, part, seed=0)
    else:
        randomise(model.network, case.spec)
    if kind == "series" and key not in NO_NETWORKS:
        model.scaling = Scaling([series_record()])
    elif kind == "windows" and key not in NO_NETWORKS:
        elements = torch.arange(case.spec.elements)
        model._set_normalisation(100.0 + elements, 30.0 + elements, torch.tensor(250.0))
    model.save(folder)
    names = {"windows": None, "series": ["x_mm", "y_mm"], "images": ["bottle", "can", "cup", "pen"]}[kind]
    cards.write(
        folder,
        cards.Card(
            experiment=case.experiment,
            kind=kind,
            model=key,
            protocol="press",
            seed=0,
            commit="0" * 40,
            settings=case.settings,
            reading={"sensor": {"rows": 2}, "window": {"frame_step": 2}},
            shapes=cards.Shapes(**case.spec._asdict()),
            inputs=cards.Inputs(
                columns={"windows": MAPS.elements, "series": COLUMNS, "images": 1051}[kind],
                unit=unit,
                order="as in the log",
                interval_s=0.02,
                frame_step=2,
                chosen=CHOSEN if kind == "series" else None,
            ),
            outputs=cards.Outputs(unit=output_unit or "probability", names=names),
            precision=None,
            best_epoch=1,
            scores=[],
            sha256=cards.digest(cards.weights_file(folder)),
        ),
    )
    return folder


class Exported(NamedTuple):
    """A saved model and its ONNX file."""

    model: predictor.Predictor
    written: onnx_export.Written


@pytest.fixture(scope="module")
def exported(tmp_path_factory):
    """`exported(key)` is a model as ONNX, made once."""
    known: dict[str, Exported] = {}

    def make(key: str) -> Exported:
        if key not in known:
            model = predictor.load(save(key, tmp_path_factory.mktemp(key)))
            known[key] = Exported(model, onnx_export.export(model, tmp_path_factory.mktemp(f"{key}_onnx")))
        return known[key]

    return make


@pytest.fixture(autouse=True)
def one_thread():
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(before)


def described(path: Path) -> dict:
    """Return the description of a file's tensors from its metadata."""
    held = {entry.key: entry.value for entry in onnx.load(path).metadata_props}
    return json.loads(held[onnx_network.TENSORS])


@pytest.mark.slow
@pytest.mark.parametrize("key", [key for key, case in CASES.items() if case.experiment == "touch"][:5])
def test_windows_give_the_maps_of_the_predictor(key, exported):
    model, (path, difference) = exported(key)
    readings = np.random.default_rng(3).uniform(40, 200, (11, MAPS.elements)).astype(np.float32)
    maps = model.predict(readings)[4:]  # the first window of three readings, two apart, ends at the fifth
    assert np.abs(maps).max() > 1
    windows = np.stack([readings[last - 4 : last + 1 : 2] for last in range(4, 11)])
    runs = onnx_network.session(path)
    np.testing.assert_allclose(runs.run(None, {"readings": windows})[0], maps, rtol=1e-4, atol=1e-3)
    alone = np.concatenate([runs.run(None, {"readings": window[None]})[0] for window in windows])
    np.testing.assert_allclose(alone, maps, rtol=1e-4, atol=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize("key", [key for key, case in CASES.items() if case.experiment == "glove"])
def test_images_give_the_probabilities_of_the_network(key, exported):
    model, (path, difference) = exported(key)
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
    model, (path, difference) = exported(key)
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
    model, (path, difference) = exported("lomp_stream")
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
    _, (path, _) = exported("lomp_stream")
    high = np.full((MAPS.elements, 1, 8), 1000, np.float32)
    _, state = onnx_network.session(path).run(
        None, {"readings": np.zeros((1, MAPS.elements), np.float32), "state": high}
    )
    assert state.max() == 10


@pytest.mark.slow
def test_the_file_says_what_goes_in_and_out(exported):
    _, (path, _) = exported("lstm_highpass")
    tensors = described(path)
    assert list(tensors) == [
        *("readings", "recent", "h", "c"),
        *("position_mm", "next_recent", "next_h", "next_c"),
    ]
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
    model, _ = exported("cnn")
    write = onnx_export.write

    def spoiled(graph, card, path):
        graph.module.output_scale = graph.module.output_scale * 1.01
        write(graph, card, path)

    monkeypatch.setattr(onnx_export, "write", spoiled)
    with pytest.raises(InputError, match=r"touch/cnn: as ONNX it differs from itself by 0.\d+ of full scale"):
        onnx_export.export(model, tmp_path)


@pytest.mark.parametrize("key", REFUSED)
def test_what_onnx_cannot_hold_is_refused(key, tmp_path):
    model = predictor.load(save(key, tmp_path))
    with pytest.raises(InputError, match=f"{key}: cannot be written as ONNX, only networks and regressions can"):
        onnx_export.export(model, tmp_path)


def test_readings_are_from_the_range_of_the_training(tmp_path):
    model = predictor.load(save("lstm_direct", tmp_path))
    readings = onnx_export.random_readings(model, onnx_export.graph_of(model))
    assert readings.shape == (onnx_export.STEPS, onnx_export.ROWS, COLUMNS) and not readings[..., [1, 3]].any()
    scaling = model.model.scaling.tensors
    far = np.abs(readings[..., CHOSEN] - scaling["x_mean"].numpy()) / scaling["x_spread"].numpy()
    assert 1.9 < far.max() <= 2.001


@pytest.mark.slow
@pytest.mark.parametrize("key", ["cnn", "lstm_transfer", "lstm_highpass", "esn"])
def test_a_package_with_onnx_predicts_in_onnx_runtime(key, tmp_path):
    torch_alone = predictor.load(save(key, tmp_path))
    onnx_export.export(torch_alone, tmp_path)
    model = predictor.load(tmp_path)
    assert torch_alone.onnx is None and model.onnx is not None
    columns = model.card.inputs.columns
    readings = np.random.default_rng(5).uniform(1.5, 2.5, (11, columns)) * (80 if key == "cnn" else 1)
    by_torch, by_reading = torch_alone.predict(readings), np.stack([model.step(reading) for reading in readings])
    if key != "cnn":  # a frame every second reading: two streams
        by_torch = np.stack([torch_alone.step(reading) for reading in readings])
    model.reset()
    again = np.stack([model.step(reading) for reading in readings])
    np.testing.assert_allclose(by_reading, by_torch, rtol=1e-4, atol=1e-3)
    np.testing.assert_array_equal(by_reading, again)
    np.testing.assert_allclose(model.predict(readings), torch_alone.predict(readings), rtol=1e-4, atol=1e-3)
    assert onnx_export.faster(model, tmp_path) is model


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


@pytest.mark.parametrize("key", REFUSED)
def test_what_onnx_cannot_hold_stays_as_it_is(key, tmp_path):
    model = predictor.load(save(key, tmp_path))
    assert onnx_export.faster(model, tmp_path) is model


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


@pytest.mark.slow
def test_the_command_writes_the_network(workspace, tmp_path, capsys):
    source = tmp_path / "source"
    source.mkdir()
    save("lstm_direct", source)
    exporting(workspace, source, tmp_path / "package", onnx=True)
    names = sorted(path.name for path in (tmp_path / "package").iterdir())
    assert names == ["card.json", "model.onnx", "network.safetensors"]
    assert "model.onnx: 0.0" in capsys.readouterr().out
