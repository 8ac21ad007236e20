"""Stress tests of models of images: what acts on which cells, and that nothing at severity 0 differs from evaluate."""

import csv
from types import SimpleNamespace

import numpy as np
import pyarrow as pa
import pytest
from builders.project import ROOT, miniature_settings, run_stage

from pipeline.scenes import glove_stress
from pipeline.stability import images as stress_images
from pipeline.stability import loop
from pipeline.stages import simulate
from tactile import models
from tactile.base import params
from tactile.base.errors import InputError
from tactile.base.paths import Workspace
from tactile.base.stress_tests import REGISTERED
from tactile.datasets import images, schemas
from tactile.experiments import glove, glove_recorded
from tactile.stages import dataset, evaluate, ingest, train
from tactile.tasks import images as tasks_images

MODELS = {"constant": {}, "naive_bayes": {"smoothing": 1e-3}}


@pytest.fixture(scope="module")
def workspace(tmp_path_factory) -> Workspace:
    return Workspace(tmp_path_factory.mktemp("images"))


@pytest.fixture(scope="module")
def project(workspace):
    """Logs, frames and dataset of the glove at miniature scale, naive Bayes and constant trained and scored."""
    values = miniature_settings(workspace)
    values["glove"]["models"] = MODELS
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(params, "load", lambda _: values)
        patch.setenv("WORKERS", "1")
        for stage in (simulate, ingest, dataset, train, evaluate):
            run_stage(patch, workspace, stage, "glove")
        yield values


def perturbed(frames, area, name, severity, seed):
    return stress_images.perturbed(frames, area, REGISTERED["images"][name], severity, seed)


def read(workspace, values) -> stress_images.Frames:
    part = images.read(workspace.dataset("glove"), "session_combined", 0).part
    return stress_images.read(workspace, "glove", values["glove"], part)


@pytest.mark.slow
def test_severity_0_is_exactly_what_evaluate_found(workspace, project):
    reports = []
    found = loop.rows(workspace, project, "glove", "naive_bayes", lambda: reports.append(1))
    with open(workspace.scores("glove")) as file:
        known = {tuple(row[k] for k in (1, 2, 4, 5)): row[7] for row in csv.reader(file) if row[3] == "naive_bayes"}
    block = params.load(ROOT / "params.yaml")["stress"]["glove"]
    asked = {(name, severity) for name, own in block["perturbations"].items() for severity in (0, *own)}
    assert len(reports) == 4 and {row[3:5] for row in found} == asked
    for protocol, condition, seed, _, severity, metric, _, value, _, blocks in found:
        assert blocks == "", "grasps that are simulated are drawn anew by other seeds"
        if severity == 0:
            assert value == float(known[protocol, condition, str(seed), metric])
    level = {
        row[3:5]: row[7] for row in found if row[:3] == ("session_combined", "combined", 0) and row[5] == "accuracy"
    }
    assert len({value for (_, severity), value in level.items() if severity}) > 1
    constant = loop.rows(workspace, project, "glove", "constant", lambda: None)
    assert len({row[7] for row in constant if row[2] == 0 and row[5] == "accuracy"}) == 1


@pytest.mark.slow
def test_severity_0_of_every_perturbation_gives_the_images_of_the_dataset(workspace, project):
    frames, settings = read(workspace, project), project["glove"]
    data = images.read(workspace.dataset("glove"), "session_combined", 0)
    expected = data.x[data.part == "test"].reshape(-1, images.SIDE, images.SIDE)
    tests = [*REGISTERED["images"].values(), *REGISTERED["glove"].values()]
    assert len(tests) == 12
    for test in tests:
        same, other = (
            stress_images.stressed("glove", settings, frames, test, severity, 7)["combined"] for severity in (0, 2)
        )
        assert np.array_equal(same, expected) and not np.array_equal(other, expected), test.name


@pytest.mark.slow
def test_cells_that_are_not_wired_stay_null_and_counts_stay_counts(workspace, project):
    frames = read(workspace, project)
    wired = frames.areas["pressure"].wired
    assert (~wired).sum() == 27  # 3 rows of the palm's 9 columns
    for name in ("noise", "offset_drift", "gain_drift", "dead", "stuck"):
        found = perturbed(frames, "pressure", name, 3, 0)
        assert found.dtype == np.int16 and found.min() >= 0 and found.max() <= 1023 and not found[:, ~wired].any(), name
    most = perturbed(frames, "strain", "dead", 1000, 0)
    assert not most.any()
    few = perturbed(frames, "pressure", "dead", 4, 0)
    before = frames.areas["pressure"].readings[frames.rows]
    assert (few != before).any(axis=0).sum() == 4


@pytest.mark.slow
def test_lost_frames_come_from_the_same_recording(workspace, project):
    frames = read(workspace, project)
    found = perturbed(frames, "pressure", "lost_frames", 1.0, 0)
    whole, starts = frames.areas["pressure"].readings, [first for first, _ in stress_images.recordings(frames.table)]
    first = np.array([max(start for start in starts if start <= row) for row in frames.rows])
    assert np.array_equal(found, whole[first])  # every frame but the first is lost
    number = np.arange(len(whole))  # in place of readings, of which two frames can have the same
    areas = {
        name: area._replace(readings=np.where(area.wired, number[:, None], 0), highest=len(whole))
        for name, area in frames.areas.items()
    }
    numbered = frames._replace(areas=areas)
    shown = {area: perturbed(numbered, area, "lost_frames", 0.5, 0).max(axis=1) for area in areas}
    assert 0 < (shown["pressure"] == frames.rows).mean() < 1
    assert np.array_equal(shown["pressure"], shown["strain"])  # one scan


def readings_of(workspace, values, data, part="train"):
    """The readings of a run, as a training with faults knows them; part: that counts as the training part."""
    data = data._replace(part=np.where(data.part == part, "train", "other"), x=data.x)
    path = workspace.dataset("glove")
    return tasks_images.readings(path, "glove", values["glove"], "session_combined", data)


@pytest.mark.slow
def test_a_training_with_faults_has_the_levels_and_the_images_of_the_stress_tests(workspace, project):
    frames, data = read(workspace, project), images.read(workspace.dataset("glove"), "session_combined", 0)
    levels = readings_of(workspace, project, data).levels
    areas = [frames.areas[name] for name in stress_images.AREAS]
    for name in ("rest", "wired"):
        np.testing.assert_array_equal(getattr(levels, name), np.concatenate([getattr(area, name) for area in areas]))
    for name in ("span", "lowest", "highest"):
        each = [np.full(area.readings.shape[1], getattr(area, name)) for area in areas]
        np.testing.assert_array_equal(getattr(levels, name), np.concatenate(each))
    assert levels.whole.all() and not levels.low.any()
    known = readings_of(workspace, project, data, "test")
    for name, severity in (("dead", 40), ("gain_drift", 0.5), ("offset_drift", 0.05)):
        changed = np.concatenate([perturbed(frames, area, name, severity, 3) for area in stress_images.AREAS], axis=1)
        expected = stress_images.stressed("glove", project["glove"], frames, REGISTERED["images"][name], severity, 3)[
            "combined"
        ]
        found = known.shown(changed.astype(np.float32))
        assert np.array_equal(found, expected.reshape(found.shape)) and not np.array_equal(
            found, known.shown(known.values)
        )


@pytest.mark.slow
def test_images_of_other_frames_are_no_readings_to_train_on(workspace, project):
    data = images.read(workspace.dataset("glove"), "session_combined", 0)
    other = data._replace(x=data.x[::-1])
    with pytest.raises(InputError, match="frames.parquet: its frames are not those of the images"):
        readings_of(workspace, project, other)
    with pytest.raises(InputError, match="run `python -m tactile.stages.dataset glove` again"):
        readings_of(workspace, project, data._replace(part=data.part[1:], x=data.x[1:]))


@pytest.mark.slow
def test_a_network_of_images_is_trained_with_faults_of_readings(workspace, project):
    recipe = {"learning_rate": 1e-3, "batch_size": 16, "epochs": 1, "flip": 0.0, "noise": 0.0, "affine": 0.0}
    faults = {"dead": 0.2, "gain": 0.2, "offset": 0.02}
    losses = []
    for further in ({}, {"faults": faults}):
        block = {"training": recipe | further}
        place = workspace.dataset("glove"), "glove", project["glove"], "session_combined", 0
        fitted = tasks_images.fit(*place, lambda spec: models.build("sp_resnet_nogcam", spec, block, "x"), device="cpu")  # noqa: B023
        losses.append(fitted.history[0]["train_loss"])
    assert np.isfinite(losses).all() and losses[0] != losses[1]


def test_the_recorded_hand_has_six_matrices_and_joints_without_lines():
    assert tasks_images.device(glove_recorded, "pressure") == (0, 4095, glove_recorded.MATRICES)
    assert tasks_images.device(glove_recorded, "strain") == (-180.0, 180.0, ())
    assert tasks_images.device(glove, "strain") == (0, 1023, ((15, 9),))
    pressure, joints = np.full((3, glove_recorded.CELLS), 100.0), np.full((3, glove_recorded.JOINTS), 10.0)
    areas = {
        name: stress_images.Area(own, np.full(own.shape[1], True), 10.0, np.zeros(own.shape[1]), *device)
        for (name, own), device in zip(
            {"pressure": pressure, "strain": joints}.items(),
            [tasks_images.device(glove_recorded, name) for name in stress_images.AREAS],
            strict=True,
        )
    }
    columns = {name: schemas.lists(area.readings, pa.float32()) for name, area in areas.items()}
    frames = stress_images.Frames(pa.table(columns), np.arange(3), areas)
    found = perturbed(frames, "pressure", "dead_line", 2, 0)
    start = 0
    for rows, cols in glove_recorded.MATRICES:
        matrix = found[0, start : start + rows * cols].reshape(rows, cols)
        assert (matrix == 0).all(axis=0).sum() + (matrix == 0).all(axis=1).sum() == 2
        start += rows * cols
    assert np.array_equal(perturbed(frames, "strain", "dead_line", 2, 0), joints)


def test_unchanged_images_are_not_predicted_again_and_failed_runs_have_no_numbers():
    asked = []

    def predict(x):
        asked.append(len(x))
        return np.repeat([[1.0, 0.0]], len(x), axis=0)

    run = stress_images.Run.__new__(stress_images.Run)
    run.module = glove
    run.model, run.failed, run.modality = SimpleNamespace(predict=predict), False, "pressure"
    run.x, run.y = np.zeros((4, 1, images.SIDE**2), np.float32), np.eye(2)[[0, 1, 1, 1]]
    run.predicted = np.repeat([[0.0, 1.0]], 4, axis=0)
    pictures = np.zeros((4, images.SIDE, images.SIDE), np.uint8)

    def accuracy():
        ((modality, scores),) = run.scores({"pressure": pictures, "strain": None})
        assert modality == "pressure"
        return scores[0]

    assert accuracy() == ("accuracy", "1", 0.75, 4, "") and not asked
    pictures[0] = 1
    assert accuracy() == ("accuracy", "1", 1.0, 4, "") and asked == [1]
    run.failed = True
    assert np.isnan(accuracy()[2])


@pytest.mark.slow
def test_a_changed_scene_changes_what_it_says(project):
    def counts(change, severity):
        whole = glove_stress.session(project["glove"], "magic_cube", "session00", change, severity).astype(float)
        return whole[:, : glove.PRESSURE_CELLS], whole[:, glove.PRESSURE_CELLS :]

    pressure, strain = counts("grip", 0)
    firm, same = counts("grip", 2)
    assert firm.mean() > 1.1 * pressure.mean() and np.array_equal(same, strain)
    for change in ("specimen", "shift"):
        other = counts(change, 20)
        assert not np.array_equal(other[0], pressure) and not np.array_equal(other[1], strain)
    turned, same = counts("turn", 30)
    assert not np.array_equal(turned, pressure) and np.array_equal(same, strain)
    with pytest.raises(InputError, match="no change 'colour'"):
        counts("colour", 1)
