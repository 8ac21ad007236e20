"""Networks of several input frames: how frames are joined, which of them are one input, and what they are scored on."""

import numpy as np
import pyarrow as pa
import pytest
import torch
from builders.project import ROOT

from pipeline.results import frame_sets
from pipeline.studies import input_frames, joined_frames
from tactile import models
from tactile.base import params
from tactile.datasets import images, schemas
from tactile.learning import image_classifier
from tactile.learning.spec import of_images
from tactile.scoring import classification

GROUP = np.repeat([4, 1, 7, 2], [5, 2, 9, 4])  # numbers of sessions
TRAINING = {"learning_rate": 3e-3, "batch_size": 16, "epochs": 2}
TRAINING |= {"flip": 0.0, "noise": 0.0, "affine": 0.0}
BLOCKS = {"sp_resnet": {"reduction": 16, "training": TRAINING}, "resnet3x3": {"training": TRAINING}}
SETTINGS = {"dataset": "combined", "split": "session", "numbers": [2]}


def single(model="sp_resnet", **training):
    block = BLOCKS[model] | {"training": TRAINING | training}
    return models.build(model, of_images(2), block, "made up")


@pytest.mark.parametrize("frames", [1, 2, 3, 8])
def test_fixed_sets_are_those_whose_answers_are_averaged(frames):
    shuffled = np.random.default_rng(0).permutation(GROUP)
    answers = np.random.default_rng(1).uniform(size=(len(GROUP), 3))
    first, means = classification.by_frames(answers, shuffled, frames)
    sets = frame_sets.fixed_sets(shuffled, frames)
    assert np.array_equal(sets[:, 0], first)
    assert np.allclose(answers[sets].mean(axis=1), means)


@pytest.mark.parametrize("frames", [1, 2, 4])
def test_drawn_sets_are_of_one_session_without_repetition_and_others_in_every_epoch(frames):
    rng = np.random.default_rng(0)
    whole = sum(images // frames for images in (5, 2, 9, 4))
    epochs = [frame_sets.drawn_sets(GROUP, frames, 1000, rng) for _ in range(30)]
    for sets in epochs:
        assert sets.shape == (whole, frames) and len(set(sets.ravel())) == sets.size
        assert (GROUP[sets] == GROUP[sets[:, :1]]).all()
    assert not np.array_equal(epochs[0], epochs[1])
    known = {frozenset(row) for sets in epochs for row in sets}
    assert (len(known) > whole) == (frames > 1)
    few = [frame_sets.drawn_sets(GROUP, frames, 2, rng) for _ in range(30)]
    assert {len(sets) for sets in few} == {2}
    assert (
        len({session for sets in few for session in GROUP[sets[:, 0]]}) > 2
    )  # the session drawn first is not always one


def test_no_session_is_as_long():
    assert frame_sets.drawn_sets(GROUP, 10, 5, np.random.default_rng(0)).shape == (0, 10)
    assert frame_sets.fixed_sets(GROUP, 10).shape == (0, 10)


@pytest.mark.parametrize("model", input_frames.MODELS)
def test_one_frame_is_the_network_of_the_tables_and_more_add_the_1x1_convolution(model):
    alone = single(model)
    shapes = [(name, value.shape) for name, value in alone.network.state_dict().items()]
    one = joined_frames.JoinedClassifier(alone, 1).network
    assert [(name, value.shape) for name, value in one.state_dict().items()] == shapes
    x = torch.rand(3, 4, images.SIDE**2)
    assert one(x[:, :1]).shape == (3, 2)
    four = joined_frames.JoinedClassifier(alone, 4)
    assert four.network(x).shape == (3, 2)
    assert four.training.epochs == 4 * alone.training.epochs
    assert four.parameters() - alone.parameters() == 4 * 128 * 128 + 128
    assert four.macs() > 3.9 * alone.macs()


@pytest.mark.parametrize("model", input_frames.MODELS)
def test_frames_are_joined_in_their_order_by_shared_convolutions(model):
    """With a 1x1 convolution that passes one frame on, the answer is that of the network to this frame."""
    _, network = single(model).make_network()
    network.eval()
    joined = joined_frames.JoinedFrames(network, 3).eval()
    x = torch.rand(5, 3, images.SIDE, images.SIDE)
    with torch.no_grad():
        joined.join.bias.zero_()
        for frame in range(3):
            joined.join.weight.zero_()
            joined.join.weight[:, 128 * frame : 128 * (frame + 1), 0, 0] = torch.eye(128)
            assert torch.allclose(joined(x), network(x[:, frame : frame + 1]), atol=1e-5)


def grasps(sessions=6, each=4, seed=0):
    """Images (n, 1, pixels) of two objects, one of which is bright; y, number of the session, part."""
    label = np.tile(np.repeat([0, 1], each), sessions)
    session = np.repeat(np.arange(2 * sessions), each)
    x = np.random.default_rng(seed).uniform(0, 60, (len(label), 1, images.SIDE**2)) + 150 * label[:, None, None]
    part = np.repeat(["train"] * (sessions - 2) + ["validation", "test"], 2 * each)
    return x.astype(np.float32), np.eye(2, dtype=np.float32)[label], session, part


def test_an_epoch_sees_as_many_images_as_that_of_one_frame_and_only_those_of_training_sessions(monkeypatch):
    x, y, session, part = grasps()
    x += np.arange(len(x), dtype=np.float32)[:, None, None] / 1e4  # so that an image is known by its mean
    means, seen = x.mean(axis=(1, 2)), []
    real = image_classifier.augmented

    def noted(batch, *others):
        seen.append([int(np.abs(means - 255 * float(image.mean())).argmin()) for image in batch])
        return real(batch, *others)

    monkeypatch.setattr(image_classifier, "augmented", noted)
    place = single(batch_size=4), 2, x, y, session, part
    rows = joined_frames.scores(*place, seed=0, device="cpu", progress=None)
    assert [row[0] for row in rows] == list(classification.METRICS) and {row[-1] for row in rows} == {4}  # sets of two
    train = int((part == "train").sum())
    assert [len(batch) for batch in seen] == [4] * (4 * train // 4), "twice two epochs, batches of 4 images"
    for k in range(4):
        epoch = sum(seen[k * train // 4 : (k + 1) * train // 4], [])
        assert len(set(epoch)) == len(epoch) == train
        pairs = np.array(epoch).reshape(-1, 2)
        assert (session[pairs[:, 0]] == session[pairs[:, 1]]).all()
    assert set(part[sum(seen, [])]) == {"train"}


@pytest.mark.slow
def test_a_network_of_several_frames_is_fitted_on_training_chosen_by_validation_and_scored_on_the_test():
    """Who learned the right names is wrong where the names are exchanged; in the validation, learns nothing."""

    def accuracy(wrong):
        x, y, session, part = grasps(sessions=6)
        y[part == wrong] = y[part == wrong][:, ::-1]
        place = single(epochs=4, batch_size=4), 2, x, y, session, part
        (name, _, value, _), _ = joined_frames.scores(*place, seed=0, device="cpu", progress=None)
        assert name == "accuracy"
        return value

    assert accuracy("nowhere") == 1
    assert accuracy("test") == 0
    assert accuracy("validation") < 1


def test_the_same_seed_gives_the_same_network():
    def fitted(seed):
        x, y, session, part = grasps()
        train, rows = part == "train", np.flatnonzero(part == "validation")
        network = joined_frames.JoinedClassifier(single(noise=0.02), 2)
        sets = rows[frame_sets.fixed_sets(session[rows], 2)]
        history = network.fit(
            (x[train], y[train], session[train]), (x[sets, 0], y[sets[:, 0]]), sets=8, seed=seed, device="cpu"
        )
        return history

    assert fitted(0) == fitted(0) and fitted(0) != fitted(1)


def write_dataset(workspace, sessions=6, each=4):
    x, y, session, part = grasps(sessions, each)
    names = [pa.array(values).dictionary_encode().cast(schemas.NAME) for values in (
        np.where(y[:, 1], "b", "a"), [f"session{k // 2:02d}" for k in session], part
    )]  # fmt: skip
    columns = {"condition": names[0], "recording": names[1], "label": pa.array(y.argmax(axis=1).astype(np.int16))}
    columns[schemas.split_column("session_combined", 0)] = names[2]
    pictures = x.reshape(-1, images.SIDE, images.SIDE).astype(np.uint8)
    table = images.with_pictures(pa.table(columns), {"combined": pictures})
    schemas.write(workspace.dataset("glove"), table.schema, [table])


@pytest.fixture
def values(monkeypatch):
    values = params.load(ROOT / "params.yaml")
    values["device"] = "cpu"
    values["glove"] |= {"models": BLOCKS, "input_frames": SETTINGS, "protocols": {"session_combined": {"seeds": [0]}}}
    monkeypatch.setattr(input_frames.params, "load", lambda _: values)
    monkeypatch.setattr("sys.argv", ["input_frames", "glove", "0"])
    monkeypatch.setenv("WORKERS", "1")
    return values


def written(workspace):
    lines = workspace.study_result("glove", "input_frames").read_text().splitlines()
    assert lines[0].split(",") == list(input_frames.COLUMNS)
    return [tuple(line.split(",")[:6]) for line in lines[1:]]


def test_the_study_trains_every_model_and_leaves_out_numbers_that_no_session_has(workspace, values, capsys):
    write_dataset(workspace)
    values["glove"]["input_frames"] = SETTINGS | {"numbers": [2, 5]}
    input_frames.main(workspace)
    numbers = {"trained": [2], "mean": [1, 2, 3, 4]}
    wanted = {
        ("combined", form, model, "0", str(frames), metric)
        for form, several in numbers.items()
        for frames in several
        for model in input_frames.MODELS
        for metric in classification.METRICS
    }
    assert set(written(workspace)) == wanted and len(written(workspace)) == len(wanted)
    assert "glove: sessions have too few images for sets of 5" in capsys.readouterr().err


def test_without_the_networks_the_table_is_empty(workspace, values):
    values["glove"]["models"] = {"constant": {}}
    input_frames.main(workspace)
    assert written(workspace) == []
