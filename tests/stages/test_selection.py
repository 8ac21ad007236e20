"""No stage lets the test part choose the epoch of a network, nor anything but the validation part."""

import functools

import numpy as np
import pyarrow as pa
import pytest
from builders.noted_series import noting
from builders.project import ROOT
from opened.noted import Noted, ignore_bookkeeping
from torch import nn

from pipeline.stability import changed_scene
from pipeline.studies import physics as physics_study
from pipeline.studies import variants
from tactile import models
from tactile.base import params, paths
from tactile.base.paths import Workspace
from tactile.datasets import images, schemas
from tactile.learning.image_classifier import ImageClassifier
from tactile.learning.regressors import TorchRegressor, zero_linear
from tactile.learning.trained import Fitted
from tactile.scoring import metrics
from tactile.settings.shards import Variant
from tactile.settings.training import AugmentedTraining, WindowTraining
from tactile.stages import train as train_stage

EPOCHS, FRAMES, ELEMENTS, OUTPUTS = 5, 2, 3, 4
PART = np.repeat(["train", "validation", "test"], [80, 20, 20])
TRAINING = {"learning_rate": 1e-3, "batch_size": 16, "epochs": EPOCHS}
CNN = {"channels": [4], "hidden": [16], "training": TRAINING | {"rest_share": 1.0}}
SP_RESNET = {"reduction": 16, "training": TRAINING | {"flip": 0.0, "noise": 0.0, "affine": 0.0}}


def linear(spec, *, training, **others) -> TorchRegressor:
    """In place of every network: one layer, whose loss falls in every epoch where the labels are right."""
    given = dict(training)
    make, block = (ImageClassifier, AugmentedTraining) if "flip" in given else (TorchRegressor, WindowTraining)
    return make(
        lambda: nn.Sequential(nn.Flatten(), zero_linear(spec.frames * spec.elements, spec.outputs)),
        spec,
        block(**given),
    )


def nothing(*numbers) -> None:
    """In place of a progress bar."""


def names(values) -> pa.Array:
    return pa.array(values).dictionary_encode().cast(schemas.NAME)


def windows_dataset(path, wrong: str) -> None:
    """Labels are a linear function of the last frame; in the part `wrong` they are the other way round."""
    rng = np.random.default_rng(0)
    x = rng.uniform(0, 1000, (len(PART), FRAMES * ELEMENTS)).astype(np.float32)
    y = 0.1 * (x[:, -ELEMENTS:] - 500) @ rng.uniform(-1, 1, (ELEMENTS, OUTPUTS))
    y[PART == wrong] *= -1
    table = pa.table(
        {
            "condition": names(["single"] * len(PART)),
            "previous": pa.array(np.full(len(PART), -1, np.int32)),
            schemas.split_column("press", 0): names(PART),
            "x": schemas.lists(x, pa.float32()),
            "y": schemas.lists(y.astype(np.float32), pa.float32()),
        }
    )
    schemas.write(path, table.schema, [table])


def halves(label) -> np.ndarray:
    """Images (n, pixels) of two objects, each of which lights its own half, on a background of noise."""
    x = np.random.default_rng(0).integers(0, 60, (len(label), images.SIDE**2)).astype(np.uint8)
    for one in (0, 1):
        x[np.ix_(label == one, np.arange(images.SIDE**2 // 2) + one * images.SIDE**2 // 2)] += 190
    return x


def images_dataset(path, wrong: str) -> None:
    """Images of two objects, which have each other's names in the part `wrong`."""
    label = np.arange(len(PART)) % 2
    table = pa.table(
        {
            "condition": names(np.where(label, "b", "a")),
            "label": pa.array(np.where(PART == wrong, 1 - label, label).astype(np.int16)),
            schemas.split_column("session_pressure", 0): names(PART),
        }
    )
    table = images.with_pictures(table, {"pressure": halves(label).reshape(-1, images.SIDE, images.SIDE)})
    schemas.write(path, table.schema, [table])


@pytest.fixture
def values(monkeypatch):
    """params.yaml with one network for each kind of input, its data in a folder of its own."""
    values = params.load(ROOT / "params.yaml")
    values["device"] = "cpu"
    touch, glove = values["touch"], values["glove"]
    touch["budget"] = glove["budget"] = 1.0
    touch["window"] |= {"frames": FRAMES}
    touch["sensor"] |= {"rows": 1, "cols": ELEMENTS}
    touch["label"] |= {"map_rows": 2, "map_cols": OUTPUTS // 2}
    touch["models"], glove["models"] = {"cnn": CNN}, {"sp_resnet": SP_RESNET}
    values["physics"]["touch"] |= {"protocols": ["press"], "models": {"cnn": CNN}}
    values["physics"]["glove"] |= {"protocols": ["session_pressure"], "models": {"sp_resnet": SP_RESNET}}
    monkeypatch.setattr(metrics, "touch", lambda *arguments: [("rmse", "kPa", 1.0, 1)])
    monkeypatch.setattr(models, "build", lambda key, spec, block, where: linear(spec, **block))
    monkeypatch.setattr(variants, "varied", lambda *given: values)
    monkeypatch.setattr(variants.Setting, "rows", lambda *given: iter(()))
    return values


@pytest.fixture
def best_epochs(monkeypatch):
    """Best epoch of every network that is fitted from now on."""
    noted = []
    for kind in (TorchRegressor, ImageClassifier):

        def fit(self, *arguments, fit=kind.fit, **settings):
            history = fit(self, *arguments, **settings)
            assert len(history) == EPOCHS
            noted.append(self.summary.best_epoch)
            return history

        monkeypatch.setattr(kind, "fit", fit)
    return noted


def of_train(workspace, values, wrong, folder):
    windows_dataset(workspace.dataset("touch"), wrong)
    train_stage.train_run(workspace, values, "touch", "cnn", "press", 0, folder / "run", nothing)


def of_train_images(workspace, values, wrong, folder):
    images_dataset(workspace.dataset("glove"), wrong)
    train_stage.train_run(workspace, values, "glove", "sp_resnet", "session_pressure", 0, folder / "run", nothing)


def of_variant_touch(workspace, values, wrong, folder):
    windows_dataset(workspace.dataset("touch"), wrong)
    variants.run(workspace, values, "touch", "one", Variant(models=["cnn"], protocols=["press"]), 0, nothing)


def of_variant_glove(workspace, values, wrong, folder):
    images_dataset(workspace.dataset("glove"), wrong)
    one = Variant(models=["sp_resnet"], protocols=["session_pressure"])
    variants.run(workspace, values, "glove", "one", one, 0, nothing)


def ablation(workspace, values, experiment) -> list:
    """Return the scores of the study of physics on the dataset in the workspace."""
    asked = physics_study.asked_of(values, experiment)
    return list(changed_scene.scores(workspace, experiment, values[experiment], asked, 0, "cpu"))


def of_physics_touch(workspace, values, wrong, folder):
    windows_dataset(workspace.dataset("touch"), wrong)
    ablation(workspace, values, "touch")


def of_physics_glove(workspace, values, wrong, folder):
    images_dataset(workspace.dataset("glove"), wrong)
    ablation(workspace, values, "glove")


STAGES = (of_train, of_train_images, of_variant_touch, of_variant_glove)
STAGES += (of_physics_touch, of_physics_glove)


@pytest.mark.parametrize("stage", STAGES)
@pytest.mark.parametrize(("wrong", "best"), [("validation", 1), ("test", EPOCHS)])
def test_the_best_epoch_is_that_of_the_validation_part(workspace, stage, wrong, best, values, best_epochs, tmp_path):
    """What is learned does harm where the labels are wrong: in the validation part from the first epoch on."""
    stage(workspace, values, wrong, tmp_path)
    assert best_epochs == [best]


def test_an_ablation_of_images_is_scored_on_the_test_part(workspace, values):
    """Who learned the right names is wrong where the names are exchanged."""
    accuracy = {}
    for wrong in ("test", "nowhere"):
        images_dataset(workspace.dataset("glove"), wrong)
        ((_, _, scores),) = ablation(workspace, values, "glove")
        accuracy[wrong] = next(value for metric, unit, value, n in scores if metric == "accuracy")
    assert accuracy == {"test": 0, "nowhere": 1}


def test_an_ablation_of_windows_is_scored_on_the_test_part(workspace, values, monkeypatch):
    windows_dataset(workspace.dataset("touch"), "nowhere")
    scored = []
    monkeypatch.setattr(metrics, "touch", lambda truth, *others: scored.append(truth) or [("rmse", "kPa", 1.0, 1)])
    ablation(workspace, values, "touch")
    labels = schemas.matrix(schemas.read(workspace.dataset("touch"))["y"])
    assert {len(truth) for truth in scored} == {20}, "of the two conditions, only single touches are there"
    for truth in scored:
        np.testing.assert_array_equal(truth, labels[PART == "test"])


def of_train_series(workspace, values, folder):
    train_stage.train_run(workspace, values, "strain", "ridge", "task_1", 0, folder / "run", nothing)


def of_model_zero(workspace, values, folder):
    train_stage.train_run(workspace, values, "strain", paths.MODEL_ZERO, "task_0", 0, folder / "run", nothing)


def of_physics_strain(workspace, values, folder):
    values["physics"]["strain"] |= {"protocols": ["task_1"]}
    ablation(workspace, values, "strain")


@pytest.fixture
def series_model(monkeypatch):
    """In place of every model of series."""
    monkeypatch.setattr(metrics, "series", lambda *arguments: [("error", "mm", 1.0, 20)])
    monkeypatch.setattr(Fitted, "save", lambda *arguments: None)
    return noting(monkeypatch)


@pytest.mark.parametrize("stage", [of_train_series, of_model_zero, of_physics_strain])
def test_a_model_of_series_is_fitted_on_what_comes_before_the_test_part(workspace, stage, tmp_path, series_model):
    stage(workspace, params.load(ROOT / "params.yaml"), tmp_path)
    assert series_model.records
    for seen in series_model.records:
        assert np.array_equal(seen.x, series_model.piece.record.x[:80])
        assert seen.training.tolist() == [True] * 70 + [False] * 10


def read_by_training(experiment, values, train, folder) -> set[str]:
    """Return the keys of an experiment's block that a training reads; all of them must be part of its origin."""
    read = set()
    train(Noted(values, read), folder)
    keys = {name.split(".")[1] for name in read if name.startswith(f"{experiment}.")}
    assert keys <= {"models", *train_stage.read_settings(values, experiment)}
    return keys


def test_a_training_reads_no_setting_that_its_origin_lacks(workspace, values, tmp_path, monkeypatch):
    ignore_bookkeeping(monkeypatch.setattr)
    windows = read_by_training(
        "touch", values, lambda noted, folder: of_train(workspace, noted, "nowhere", folder), tmp_path
    )
    assert windows >= {"models", "window", "sensor", "label"}
    read_by_training(
        "glove", values, lambda noted, folder: of_train_images(workspace, noted, "nowhere", folder), tmp_path / "2"
    )


def test_a_training_of_series_reads_no_setting_that_its_origin_lacks(workspace, series_model, tmp_path):
    keys = read_by_training(
        "strain", params.load(ROOT / "params.yaml"), functools.partial(of_train_series, workspace), tmp_path
    )
    assert keys >= {"models", "window", "sensor"}


@pytest.mark.parametrize(("experiment", "model"), [("touch", "cnn"), ("strain", "lstm_direct"), ("glove", "sp_resnet")])
def test_a_training_with_faults_is_made_from_the_settings_of_readings_too(experiment, model, monkeypatch):
    """A highest count, say, that no reading comes near changes no window, and what is a share of the range."""
    monkeypatch.setattr(paths, "require", lambda path, made_by: path)
    monkeypatch.setattr(train_stage.runs, "origin", lambda settings, inputs: (settings, [path.name for path in inputs]))

    def origin(faults: bool, ingest: float):
        values = params.load(ROOT / "params.yaml")
        values[experiment]["ingest"]["max_reject_fraction"] = ingest
        if faults:
            training = values[experiment]["models"][model]["training"]
            training["faults"] = {"dead": 0.1, "gain": 0.2, "offset": 0.02}
        return train_stage._origin(Workspace(ROOT), values, experiment, model)

    assert origin(False, 0.1) == origin(False, 0.2) and origin(True, 0.1) != origin(True, 0.2)
    assert ("frames.parquet" in origin(True, 0.1)[1]) == (experiment == "glove")
    assert "frames.parquet" not in origin(False, 0.1)[1]
