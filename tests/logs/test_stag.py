"""The reader of the STAG data set: one MATLAB file in, tactile images with objects and parts out."""

import functools
import os
from pathlib import Path

import numpy as np
import pytest
import scipy.io
from builders.project import ROOT
from builders.stag_metadata import FRAMES, OBJECTS, cells, metadata, save

from pipeline.base import params
from pipeline.base.errors import InputError
from pipeline.logs import own_data, stag
from pipeline.studies import stag as stag_study


@pytest.fixture(autouse=True)
def anywhere(monkeypatch):
    """Files of these tests need not lie in data/own."""
    monkeypatch.setattr(own_data, "unnoticed", lambda *given: None)


def test_frames_with_a_valid_label_and_their_names(workspace, tmp_path):
    content = metadata()
    found = stag.read(workspace, save(tmp_path, content), balanced=False)
    kept = np.arange(FRAMES) != 1
    assert found.images.shape == (11, 1, 1024) and found.images.dtype == np.float32
    assert found.images[0, 0, :4] == pytest.approx([0, 0, 127.5, 255])
    expected = 255 * np.clip((content["pressure"][kept].astype(float) - 500) / 150, 0, 1)
    assert found.images == pytest.approx(expected.reshape(11, 1, 1024), abs=1e-4)
    assert found.objects == OBJECTS and (found.label == np.array([0, 0, 1, 1, 1, 2, 2, 2, 0, 0, 0])).all()
    assert found.recording.tolist() == ["2018_0"] * 2 + ["2018_1"] * 3 + ["2018_2"] * 3 + ["2018_3"] * 3
    assert found.part.tolist() == ["train"] * 8 + ["test"] * 3


def test_balanced_frames_only(workspace, tmp_path):
    found = stag.read(workspace, save(tmp_path, metadata()))
    assert len(found.images) == len(found.label) == len(found.recording) == len(found.part) == 7
    assert np.bincount(found.label).tolist() == [3, 2, 2]


def test_names_as_a_character_matrix_and_ids_of_frames_without_a_label(workspace, tmp_path):
    content = metadata(objects=np.array(["mug", "empty hand", "full can"]))
    content["objectId"] = content["objectId"].astype(float)
    content["objectId"][1] = -1  # the frame without a valid label
    assert stag.read(workspace, save(tmp_path, content)).objects == OBJECTS


@pytest.mark.parametrize("name", stag.VARIABLES)
def test_a_missing_variable_is_named(workspace, name, tmp_path):
    content = metadata()
    del content[name]
    with pytest.raises(InputError, match=rf"metadata\.mat: has no variable '{name}'; it must hold pressure, objectId"):
        stag.read(workspace, save(tmp_path, content))


BAD = {
    "one image": ({"pressure": np.ones((32, 32))}, r"'pressure' is \(32, 32\), not frames of 32 x 32"),
    "turned": ({"pressure": np.ones((32, 32, 12))}, r"'pressure' is \(32, 32, 12\), not frames"),
    "no numbers": ({"pressure": np.full((12, 32, 32), np.nan)}, "'pressure' holds values that are no numbers"),
    "text": ({"pressure": cells(["none"])}, "'pressure' is"),
    "too few": ({"objectId": np.zeros((7, 1))}, "'objectId' must be 12 whole numbers, one per frame"),
    "fractions": ({"recordingId": np.full((12, 1), 0.5)}, "'recordingId' must be 12 whole numbers"),
    "NaN": ({"splitId": np.full((12, 1), np.nan)}, "'splitId' must be 12 whole numbers"),
    "too large": ({"splitId": np.full((12, 1), 1e300)}, "'splitId' must be 12 whole numbers"),
    "names": ({"hasValidLabel": cells(["yes"] * 12)}, "'hasValidLabel' must be 12 whole numbers"),
    "from 1": ({"objectId": np.full((12, 1), 3)}, "'objectId' is 3 to 3, but 'objects' has 3 names, numbered from 0"),
    "negative": ({"objectId": np.full((12, 1), -1.0)}, "'objectId' is -1 to -1, but 'objects' has 3 names"),
    "numbers": ({"objects": np.ones((1, 3))}, "'objects' must be a cell array of names"),
    "no name": ({"objects": cells([])}, "'objects' must be a cell array of names"),
    "parts": ({"splits": cells(["train", "monday"])}, "'splits' are train, monday; train and test are known"),
    "no label": ({"hasValidLabel": np.zeros((12, 1))}, "none of its 12 frames has a valid label"),
}


@pytest.mark.parametrize("fault", BAD)
def test_variables_that_do_not_fit_are_one_sentence(workspace, fault, tmp_path):
    change, sentence = BAD[fault]
    with pytest.raises(InputError, match=sentence):
        stag.read(workspace, save(tmp_path, metadata(**change)))


@pytest.mark.parametrize("compress", [True, False])
@pytest.mark.parametrize("share", [0.0, 0.001, 0.1, 0.5, 0.9])
def test_a_cut_file_is_one_sentence(workspace, share, compress, tmp_path):
    path = save(tmp_path, metadata(), compress)
    path.write_bytes(path.read_bytes()[: int(share * path.stat().st_size)])
    with pytest.raises(InputError, match=r"metadata\.mat: (not a whole MATLAB file|has no variable)"):
        stag.read(workspace, path)


def test_pressure_far_outside_is_clipped(workspace, tmp_path):
    pressure = np.full((FRAMES, 32, 32), 1e308)
    assert (stag.read(workspace, save(tmp_path, metadata(pressure=pressure))).images == stag.HIGHEST).all()


def crash(*_, **__):
    os.abort()


@pytest.mark.slow
def test_a_file_that_crashes_the_reader_is_one_sentence(workspace, tmp_path, monkeypatch):
    path = save(tmp_path, metadata())
    with monkeypatch.context() as patch:
        patch.setattr(scipy.io, "loadmat", crash)
        with pytest.raises(InputError, match=r"metadata\.mat: not a whole MATLAB file \(it crashes the reader\)"):
            stag.read(workspace, path)
    assert len(stag.read(workspace, path).label)


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/self/statm").is_file(), reason="memory is limited on Linux only")
@pytest.mark.parametrize("name", ["pressure", "objects"])
def test_a_small_file_that_unpacks_to_a_large_one_is_one_sentence(workspace, name, tmp_path, monkeypatch):
    """40 kB that hold 41 MB, in an array or in a cell."""
    zeros = np.zeros((20_000, 32, 32), np.uint16)
    content = {"pressure": zeros} if name == "pressure" else {"objects": cells([zeros])}
    path = save(tmp_path, metadata(**content))
    assert path.stat().st_size < 70_000
    monkeypatch.setattr(stag, "LARGEST_FILE", 8 << 20)
    with pytest.raises(InputError, match=r"metadata\.mat: takes more than 16 MiB of memory to read, "):
        stag.read(workspace, path)
    assert len(stag.read(workspace, save(tmp_path, metadata())).label)  # the next file is read


@pytest.mark.parametrize("start", [b"MATLAB 7.3 MAT-file, Platform: GLNXA64", b"\x89HDF\r\n\x1a\n"])
def test_version_7_3_says_what_to_do(workspace, start, tmp_path):
    (tmp_path / "metadata.mat").write_bytes(start + bytes(4096))
    with pytest.raises(InputError, match=r"version 7\.3 \(HDF5\) is not read; load it and save it again with '-v7'"):
        stag.read(workspace, tmp_path / "metadata.mat")


def test_no_file_another_file_and_a_file_too_large(workspace, tmp_path, monkeypatch):
    with pytest.raises(InputError, match="not found; download the classification data of STAG"):
        stag.read(workspace, tmp_path / "metadata.mat")
    (tmp_path / "metadata.mat").write_bytes(b"frame,object\n1,mug\n" * 50)
    with pytest.raises(InputError, match="not a whole MATLAB file|has no variable"):
        stag.read(workspace, tmp_path / "metadata.mat")
    monkeypatch.setattr(stag, "LARGEST_FILE", 100)
    with pytest.raises(InputError, match="bytes are more than the data can have"):
        stag.read(workspace, save(tmp_path, metadata()))


def test_a_file_that_dvc_does_not_watch_is_refused(workspace, tmp_path, monkeypatch):
    monkeypatch.undo()
    path = save(tmp_path, metadata())
    with pytest.raises(InputError, match=rf"^params/glove\.yaml, glove\.stag\.file: {path} is not in data/own"):
        stag.read(workspace, path)


def grasps(frames=9, recordings=4):
    """Two objects, told apart by the half of the glove that is pressed, each in as many recordings."""
    n = 2 * recordings * frames
    recording = np.arange(n) // frames
    label = recording % 2
    pressure = np.full((n, 32, 32), 500, np.uint16)
    for k in range(n):
        pressure[k, 16 * label[k] : 16 * label[k] + 16] = 640
    return metadata(
        pressure=pressure,
        objectId=label[:, None],
        objects=cells(["mug", "can"]),
        recordingId=recording[:, None],
        recordings=cells([f"2018_{k}" for k in range(2 * recordings)]),
        splitId=(recording >= 2 * recordings - 2).astype(np.uint8)[:, None],
        hasValidLabel=np.ones((n, 1)),
        isBalanced=np.ones((n, 1)),
        frame=np.arange(n)[:, None],
        ts=np.arange(n)[:, None] * 0.14,
        batchId=np.zeros((n, 1), np.uint8),
    )


def test_validation_takes_whole_training_recordings(workspace, tmp_path):
    data = stag.read(workspace, save(tmp_path, grasps()))
    part = stag_study.parts(data, 0.3, 0)
    assert (part[data.part == "test"] == "test").all()
    assert len(set(data.recording[part == "validation"])) == 2
    assert not set(data.recording[part == "validation"]) & set(data.recording[part == "train"])


@pytest.mark.slow
def test_figure_fifteen_from_a_file(workspace, tmp_path):
    values, place = params.load(ROOT / "params.yaml"), str(save(tmp_path, grasps()))
    values["glove"]["models"]["sp_resnet"]["training"]["epochs"] = 1
    run = functools.partial(stag_study.train_run, workspace, values, "glove", "sp_resnet", 0, file=place, report=print)
    rows = run(input_frames=1)
    assert [row[:5] for row in rows] == [
        ("mean", "sp_resnet", 0, frames, metric) for frames in range(1, 9) for metric in ("accuracy", "macro_precision")
    ]
    assert [row[-1] for row in rows[::2]] == [18, 8, 6, 4, 2, 2, 2, 2]  # nine frames of each of two grasps
    assert all(0 <= row[6] <= 1 for row in rows)
    assert [row[:5] for row in run(input_frames=4)] == [
        ("trained", "sp_resnet", 0, 4, m) for m in ("accuracy", "macro_precision")
    ]
