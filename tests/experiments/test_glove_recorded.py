"""The reader of the recorded grasps: compressed XML in; frames, tactile images and splits by grasp out."""

import re
import time
from collections import Counter

import numpy as np
import pyarrow as pa
import pytest
from builders.grasps import NAME, START_MS, angle, frame, grasp, pressed, save, words, xml

from pipeline.studies import joint_angles
from tactile.base.errors import InputError
from tactile.datasets import images as tactile
from tactile.datasets import schemas
from tactile.experiments import glove_recorded
from tactile.experiments.glove_recorded import CELLS, JOINTS, MATRICES, read_recording
from tactile.logs import parse

SETTINGS = {
    "ingest": {"max_reject_fraction": 0.25},
    "window": {"frames": 3, "stride": 2},
    "split": {"train": 0.6, "validation": 0.2},
}


def test_a_grasp_becomes_frames_with_interpolated_angles(tmp_path):
    path = save(tmp_path, xml(grasp()))
    frames, rejects, report = read_recording(path, SETTINGS)
    assert frames.schema.equals(tactile.frames({"pressure": 486, "strain": 7}, pa.float32())) and frames.num_rows == 10
    assert rejects.schema.equals(parse.REJECTS)
    assert rejects["reason"].to_pylist() == ["constant frame"] * 3 and rejects["line"].to_pylist() == [1, 2, 3]
    assert rejects["text"][0].as_py() == f"{START_MS} C3F30000"  # -486
    assert frames["condition"].unique().to_pylist() == ["mug"]
    assert frames["recording"].unique().to_pylist() == ["mug_000083-000147"]
    at = 32 * np.arange(3, 13)
    assert frames["t_s"].to_numpy() == pytest.approx((START_MS + at) / 1000, abs=1e-6)
    pressure = schemas.matrix(frames["pressure"])
    assert (pressure == [np.ceil(pressed() * (k + 1) / 10) for k in range(10)]).all()
    expected = 10 * np.arange(7) + (at[:, None] + 10) / 1000
    assert schemas.matrix(frames["strain"]) == pytest.approx(expected, abs=1e-5)
    assert frames["gap_before"].to_pylist() == [True] + [False] * 9
    assert report[NAME] == {
        "lines": 13,
        "accepted": 10,
        "rejects": {"constant frame": 3},
        "rate_hz": pytest.approx(31.25, rel=1e-3),
        "gaps": 0,
        "segments": 1,
    }
    assert report[f"{NAME}: joint angles"]["accepted"] == 101


def test_bad_frames_are_rejects_with_their_number(tmp_path):
    good, too_high = words(pressed()), pressed()
    too_high[7] = 4096
    bad = {
        0: (frame(0, good, at="soon"), "no time"),
        2: (frame(2, good[:-1]), "unreadable words"),
        4: (frame(4, good + "C0000000"), "number of cells"),
        6: (frame(6, words(too_high)), "out of range"),
        8: (frame(8, good, at=START_MS), "out of order"),
        10: (frame(10, words(np.full(CELLS, 12.0))), "constant frame"),
        30: (frame(31, good), "no joint angles at this time"),  # they end at 990 ms
    }
    content = [bad[k][0] if k in bad else frame(k, good) for k in range(31)]
    frames, rejects, report = read_recording(save(tmp_path, xml(content)), SETTINGS)
    found = [(row["line"], row["reason"]) for row in rejects.to_pylist()]
    assert found == [(k + 1, reason) for k, (_, reason) in bad.items()]
    assert rejects["text"][0].as_py().startswith("soon C") and len(rejects["text"][0].as_py()) <= 200
    assert frames.num_rows == 24 and report[NAME]["lines"] == 31
    after_gap = frames["t_s"].to_numpy()[frames["gap_before"].to_numpy()]
    assert after_gap == pytest.approx(START_MS / 1000 + 0.032 * np.array([1, 3, 5, 7, 9, 11]), abs=1e-6)
    assert report[NAME]["gaps"] == 5


@pytest.mark.parametrize(
    ("data", "reason"),
    [
        ("", "number of cells"),
        ("C3F3", "unreadable words"),  # half a word
        ("hello wo", "unreadable words"),
        ("C3F30000 7FC00000", "not a number"),
        ("C3F30000 FF800000", "not a number"),  # -inf: a run without an end
        ("C3F2C000 3F000000", "unreadable words"),  # a run of 485.5 cells
        ("CF000000", "number of cells"),  # a run of 2**31 cells
        ("C3F28000", "number of cells"),
        ("C3F28000 47000000", "out of range"),
        ("C3F30000", "constant frame"),
        ("C3F28000 3F800000", ""),
        ("C3F2800 03F80\n0000", ""),
    ],
)
def test_words_of_a_frame(data, reason):
    cells, found = glove_recorded._cells(data)
    assert found == reason and len(cells) <= CELLS
    if not reason:
        assert (cells == [0] * 485 + [1]).all()


def test_bad_angles_are_rejects_of_their_own(tmp_path):
    angles = [angle(k) for k in range(101)]
    angles[3] = angle(3, "1, 2, 3")
    angles[5] = angle(5, "1, 2, 3, 4, 5, 6, seven")
    angles[6] = angle(6, "1, 2, 3, 4, 5, 6, nan")
    angles[7] = angle(7, "1, 2, 3, 4, 5, 6, 400")
    angles[9] = angle(9, at=START_MS - 5)
    frames, rejects, report = read_recording(save(tmp_path, xml(grasp(), angles)), SETTINGS)
    rows = [row for row in rejects.to_pylist() if row["file"] == f"{NAME}: joint angles"]
    assert [(row["line"], row["reason"]) for row in rows] == [
        (4, "column count"),
        (6, "not a number"),
        (7, "not a number"),
        (8, "out of range"),
        (10, "out of order"),
    ]
    assert rows[0]["text"] == f"{START_MS + 20} 1, 2, 3"
    assert report[f"{NAME}: joint angles"] | {"rate_hz": 100.0} == {
        "lines": 101,
        "accepted": 96,
        "rejects": {"column count": 1, "not a number": 2, "out of order": 1, "out of range": 1},
        "rate_hz": 100.0,
        "gaps": 3,
        "segments": 1,
    }
    assert schemas.matrix(frames["strain"])[0, 1] == pytest.approx(10 + 0.106)


def test_constant_frames_are_not_held_against_a_recording(tmp_path):
    strict = SETTINGS | {"ingest": {"max_reject_fraction": 0.0}}
    frames, rejects, _ = read_recording(save(tmp_path, xml(grasp(before=20, contact=5))), strict)
    assert (frames.num_rows, rejects.num_rows) == (5, 20)
    content = [*grasp(before=20, contact=8), frame(28, words(pressed())[:-1]), frame(29, "")]
    settings = SETTINGS | {"ingest": {"max_reject_fraction": 0.19}}  # 2 of the 10 frames that are not constant
    with pytest.raises(InputError, match=r"20.0% of the 10 lines .*'(number of cells|unreadable words)'.*max_reject"):
        read_recording(save(tmp_path, xml(content)), settings)


SENSOR = xml(grasp())
BAD = {
    "no frames": (xml([]), "has no frames"),
    "no angles": (xml(grasp(), []), "has no joint angles"),
    "no good angle": (xml(grasp(), [angle(k, "1") for k in range(9)]), "joint angles: 100.0% of the 9 lines"),
    "constant": (xml(grasp(contact=0)), "no frame is left, 3 of 3 are constant"),
    "five matrices": (xml(grasp(), matrices=MATRICES[:5]), "its matrices are 14 x 6, 13 x 6, 14 x 6, 13 x 6, 14 x 6,"),
    "other cells": (xml(grasp(), matrices=((12, 6),) * 6), "its matrices are 12 x 6, .* not 14 x 6, 13 x 6"),
    "other scale": (xml(grasp(), full_scale=1023), "with a full scale of 4095"),
    "no sensor": ("<root><data/></root>", "its matrices are none, not"),
    "half": (SENSOR[: len(SENSOR) // 2], "not whole XML"),
    "empty": ("", "not whole XML"),
    "text": ("t_s,u0\n1.0,2.0\n" * 9, "not whole XML"),
    "other encoding": (SENSOR.encode("utf-16"), "not whole XML"),
    "control characters": (SENSOR.replace("C3F30000", "\x01"), "not whole XML"),
    "document type": (xml(grasp(), head='<!DOCTYPE root [<!ENTITY a "aa">]>'), "document type is not read"),
}


@pytest.mark.parametrize("fault", BAD)
def test_a_recording_of_another_kind_is_one_sentence(fault, tmp_path):
    content, sentence = BAD[fault]
    with pytest.raises(InputError, match=sentence) as error:
        read_recording(save(tmp_path, content), SETTINGS)
    assert NAME in str(error.value)


@pytest.mark.parametrize("share", [0.0, 0.001, 0.1, 0.5, 0.9, 0.999])
def test_a_cut_or_damaged_file_is_one_sentence(share, tmp_path):
    path = save(tmp_path, xml(grasp()))
    whole = path.read_bytes()
    at = int(share * len(whole))
    for content in (whole[:at], whole[:at] + b"\x55\xaa" + whole[at + 2 :]):
        path.write_bytes(content)
        with pytest.raises(InputError, match=r"not a whole bzip2 file"):
            read_recording(path, SETTINGS)


@pytest.mark.slow
def test_a_short_file_that_grows_is_refused_before_it_fills_the_memory(tmp_path):
    path = save(tmp_path, bytes(200 << 20))
    assert path.stat().st_size < 1000
    started = time.process_time()
    with pytest.raises(InputError, match="more than the 16777216 bytes that a grasp can have"):
        read_recording(path, SETTINGS)
    assert time.process_time() - started < 10


def test_no_document_type_in_any_encoding_gets_through(tmp_path):
    bomb = '<!DOCTYPE a [<!ENTITY b "bb"><!ENTITY c "&b;&b;">]><a>&c;</a>'
    for encoding in ("utf-8", "utf-16", "utf-16-le", "utf-32", "utf-8-sig", "utf-7", "cp037"):
        head = f'<?xml version="1.0" encoding="{encoding}"?>'
        with pytest.raises(InputError, match="document type is not read|not whole XML"):
            read_recording(save(tmp_path, (head + bomb).encode(encoding)), SETTINGS)


def test_recordings_are_in_the_order_of_time(tmp_path):
    with pytest.raises(InputError, match="no recordings; run `tactile fetch glove_recorded`"):
        glove_recorded.recordings(tmp_path)
    for condition, stem in (
        ("mug", "a_9-11"),
        ("ball", "b_000012-000020"),
        ("mug", "a_000100-000120"),
        ("mug", "c_5-8"),
    ):
        save(tmp_path, "", f"{stem}.dsa", condition)
    (tmp_path / "mug" / "notes.txt").write_text("not a recording")
    found = [f"{path.parent.name}/{path.stem}" for path in glove_recorded.recordings(tmp_path)]
    assert found == ["ball/b_000012-000020", "mug/c_5-8", "mug/a_9-11", "mug/a_000100-000120"]
    save(tmp_path, "", "grasp.dsa")
    with pytest.raises(InputError, match=r"grasp\.dsa: the name must end in the grasp's first and last frame"):
        glove_recorded.recordings(tmp_path)


def several(objects=("ball", "mug"), grasps=10, contact=10):
    """A frames table: row k of a grasp has 10 * grasp + k in its first cell."""
    n = len(objects) * grasps * contact
    number, k = np.divmod(np.arange(n), contact)
    number %= grasps
    pressure = np.zeros((n, CELLS))
    pressure[:, 0] = 10 * number + k
    pressure[:, -1] = 4095
    columns = {
        "condition": np.repeat(objects, grasps * contact),
        "recording": [f"x_{100 * g}-{100 * g + contact}" for g in number],
        "segment": np.zeros(n, np.int16),
        "t_s": np.arange(n) * 0.032,
        "gap_before": k == 0,
        "pressure": schemas.lists(pressure, pa.float32()),
        "strain": schemas.lists(np.tile(np.linspace(-95, 90, JOINTS), (n, 1)), pa.float32()),
    }
    return pa.table(columns).cast(glove_recorded.SCHEMA)


def test_chosen_frames_end_at_the_last_one():
    rows = glove_recorded.chosen(several(), SETTINGS)
    assert rows.tolist() == [10 * k + place for k in range(20) for place in (5, 7, 9)]
    long = SETTINGS | {"window": {"frames": 50, "stride": 4}}
    assert glove_recorded.chosen(several(), long).tolist() == [10 * k + place for k in range(20) for place in (1, 5, 9)]
    one = SETTINGS | {"window": {"frames": 1, "stride": 9}}
    assert glove_recorded.chosen(several(), one).tolist() == list(range(9, 200, 10))


def test_images_have_every_cell_and_joint_in_its_place():
    frames = several(grasps=1, contact=1)
    cells = np.arange(CELLS) % 4096.0
    frames = frames.set_column(5, "pressure", schemas.lists(np.tile(cells, (2, 1)), pa.float32()))
    found = glove_recorded.images(frames, SETTINGS)
    assert list(found) == list(tactile.MODALITIES)
    assert all(image.shape == (2, 32, 32) and image.dtype == np.uint8 for image in found.values())
    levels = np.round(255 * cells / 4095)
    image, start = found["pressure"][0], 0
    # Fingertips on top: the distal matrices are number 1, 3 and 5.
    for k, (row, col) in enumerate([(13, 0), (0, 0), (13, 6), (0, 6), (13, 12), (0, 12)]):
        rows = 13 if k % 2 else 14
        assert (image[row : row + rows, col : col + 6].ravel() == levels[start : start + 6 * rows]).all()
        start += 6 * rows
    assert (image > 0).sum() == (levels > 0).sum()
    strain = found["strain"][0]
    joints = [strain[row : row + 3, col : col + 3] for row, col in glove_recorded.JOINT_PLACES]
    assert all((block == block[0, 0]).all() for block in joints)
    low, high = glove_recorded.LOWEST_DEG, glove_recorded.HIGHEST_DEG
    expected = np.round(255 * np.clip((np.linspace(-95, 90, 7) - low) / (high - low), 0, 1))
    assert [block[0, 0] for block in joints] == expected.tolist()
    assert (strain > 0).sum() == 9 * (expected > 0).sum() and not strain[:17].any() and not strain[:, :23].any()
    assert (found["combined"] == found["pressure"] + found["strain"]).all()
    assert not (found["pressure"].astype(bool) & found["strain"].astype(bool)).any()


def parts_of(frames, protocol, seed=0):
    part = glove_recorded.split(frames, SETTINGS, protocol, seed)
    names = np.char.add(schemas.names(frames["condition"]), schemas.names(frames["recording"]))
    return part, {name: set(names[part == name]) for name in tactile.PARTS}


def test_no_grasp_is_on_two_sides():
    frames = several()
    part, grasps = parts_of(frames, "grasp_pressure")
    assert {name: len(found) for name, found in grasps.items()} == {"train": 12, "validation": 4, "test": 4}
    assert sum(len(found) for found in grasps.values()) == len(set.union(*grasps.values())) == 20
    assert Counter(name[:4] for name in grasps["test"]) == {"ball": 2, "mugx": 2}
    assert (part == glove_recorded.split(frames, SETTINGS, "grasp_combined", 0)).all()
    assert (part != glove_recorded.split(frames, SETTINGS, "grasp_combined", 1)).any()
    # Another object changes nothing for those that were there.
    more = several(("ball", "mug", "pen"))
    assert (glove_recorded.split(more, SETTINGS, "grasp_pressure", 0)[:200] == part).all()


@pytest.mark.parametrize("protocol", ["grasp_pressure", "block_strain", "random_frames_combined"])
def test_as_many_seeds_as_folds_test_on_everything_once(protocol):
    for grasps in (10, 13, 23):  # objects of 23 have folds of 4 and of 5
        frames = several(grasps=grasps)
        parts = np.array([glove_recorded.split(frames, SETTINGS, protocol, seed) for seed in range(10)])
        for turn in (parts[:5], parts[5:]):
            assert ((turn == "test").sum(axis=0) == 1).all()
        shares = [np.mean(parts == name, axis=1) for name in tactile.PARTS]
        assert all(np.abs(share - wanted).max() < 0.08 for share, wanted in zip(shares, (0.6, 0.2, 0.2), strict=True))
        same = (parts[0] == parts[5]).all()
        assert same == protocol.startswith("block"), "the order is drawn anew after the last fold, but that of time"


@pytest.mark.parametrize(
    ("train", "validation", "number"), [(0.7, 0.1, 5), (0.5, 0.25, 4), (0.01, 0.98, 100), (0.2, 0.1, 2)]
)
def test_folds_have_the_share_of_the_test(train, validation, number):
    settings = SETTINGS | {"split": {"train": train, "validation": validation}}
    assert glove_recorded.folds(settings) == number
    for seed in range(number):
        part = glove_recorded.split(several(), settings, "grasp_pressure", seed)
        assert set(part) == set(tactile.PARTS), "no part is empty"


def test_blocks_are_grasps_in_a_row_validated_on_those_before():
    frames = several()
    shuffled = frames.take(np.concatenate([np.arange(100, 200), np.arange(50, 100), np.arange(50)]))
    for table, seed, validated in ((frames, 4, 3), (shuffled, 9, 3), (shuffled, 0, 4), (frames, 2, 1)):
        part, _ = parts_of(table, "block_strain", seed)
        first = np.array([int(re.search(r"_(\d+)-", name)[1]) for name in schemas.names(table["recording"])])
        fifth = first // 200
        assert (part == np.where(fifth == seed % 5, "test", np.where(fifth == validated, "validation", "train"))).all()


def test_random_frames_put_one_grasp_on_all_sides():
    part, grasps = parts_of(several(), "random_frames_pressure")
    assert Counter(part) == {"train": 120, "validation": 40, "test": 40}
    assert len(grasps["train"] & grasps["test"]) > 15


def test_impossible_splits_are_one_sentence():
    with pytest.raises(InputError, match="no split 'tuesday'; there are grasp, block, random_frames"):
        glove_recorded.split(several(), SETTINGS, "tuesday_strain", 0)
    for protocol in ("grasp_pressure", "block_pressure"):
        with pytest.raises(InputError, match="object 'ball': 2 grasps; at least 3 are needed to train"):
            glove_recorded.split(several(grasps=2), SETTINGS, protocol, 0)
    with pytest.raises(InputError, match="object 'ball': 2 frames; at least 3 are needed to train"):
        glove_recorded.split(several(grasps=1, contact=2), SETTINGS, "random_frames_strain", 0)
    three, _ = parts_of(several(grasps=3), "grasp_pressure")
    assert Counter(three) == {"train": 20, "validation": 20, "test": 20}


@pytest.mark.parametrize(("angles_tell", "cells_tell"), [(True, False), (False, True), (False, False)])
def test_the_probe_is_scored_on_grasps_that_it_has_not_seen(workspace, angles_tell, cells_tell, monkeypatch):
    """Inputs that say which object a grasp is of, or nothing: then training knows them by heart, a test cannot."""
    frames, rng = several(("ball", "mug", "pen"), grasps=20, contact=3), np.random.default_rng(0)
    objects = schemas.names(frames["condition"])
    grasps = np.char.add(objects, schemas.names(frames["recording"]))

    def drawn(tells, low, high, width):
        _, place = np.unique(objects if tells else grasps, return_inverse=True)
        return rng.uniform(low, high, (place.max() + 1, width))[place]

    columns = {"strain": drawn(angles_tell, -90, 90, JOINTS), "pressure": drawn(cells_tell, 0, 4095, CELLS)}
    for name, values in columns.items():
        at = frames.schema.get_field_index(name)
        frames = frames.set_column(at, name, schemas.lists(values, pa.float32()))
    frames = frames.cast(glove_recorded.SCHEMA)
    monkeypatch.setattr(joint_angles, "TREES", 20)
    schemas.write(workspace.frames("glove_recorded"), frames.schema, [frames])
    seen = joint_angles.inputs(columns["strain"], columns["pressure"])
    found = [row for name in seen for row in joint_angles.named(workspace, SETTINGS, name, 1, lambda: None)]
    assert [row[:3] for row in found] == [(name, split, 1) for name in seen for split in joint_angles.SPLITS]
    for name, *_, accuracy, _ in found:
        told = {joint_angles.CELLS_ALONE: cells_tell, joint_angles.BOTH: angles_tell or cells_tell}
        assert (accuracy == 1) if told.get(name, angles_tell) else (accuracy < 0.7), name
    frames_of_a_grasp = len(glove_recorded.chosen(frames, SETTINGS)) / 60
    assert {row[-1] for row in found} == {3 * 4 * frames_of_a_grasp}  # 4 of the 20 grasps of every object


def test_without_recordings_everything_is_empty():
    frames = glove_recorded.SCHEMA.empty_table()
    rows = glove_recorded.chosen(frames, SETTINGS)
    assert not len(rows)
    pictures = glove_recorded.images(frames.take(pa.array(rows)), SETTINGS)
    assert tactile.dataset_rows(frames, pictures).num_rows == 0
    assert not len(glove_recorded.split(frames, SETTINGS, "grasp_pressure", 0))


def test_recorded_grasps(recordings):
    """Every 20th of the real recordings."""
    grasps = glove_recorded.recordings(recordings("glove_recorded"))
    assert len(grasps) == 856
    settings = SETTINGS | {"ingest": {"max_reject_fraction": 0.1}}
    found = [read_recording(path, settings) for path in grasps[::20]]
    frames = pa.concat_tables([one[0] for one in found]).unify_dictionaries()
    assert {reason for one in found for reason in one[1]["reason"].to_pylist()} == {
        "constant frame",
        "no joint angles at this time",
    }
    assert all(25 < report[path.name]["rate_hz"] < 36 for path, (_, _, report) in zip(grasps[::20], found, strict=True))
    rows = glove_recorded.chosen(frames, SETTINGS)
    assert len(rows) == 3 * len(found)
    pressure, strain = (schemas.matrix(frames.take(pa.array(rows))[name]) for name in ("pressure", "strain"))
    assert pressure.max() <= 4095 and (pressure == np.round(pressure)).all()
    # Two fingertips hold the object: matrices 1 and 5. Joints 0 and 3 stay where they are, fingers 1 and 3 mirror.
    assert (pressure[:, 84:162].max(1) > 0).all() and (pressure[:, 408:].max(1) > 0).mean() > 0.9
    assert strain[:, [0, 3]] == pytest.approx(np.tile([90, -90], (len(rows), 1)), abs=0.2)
    assert strain[:, 1] == pytest.approx(-strain[:, 2], abs=8)
