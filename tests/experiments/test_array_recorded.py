"""Frames of the capacitive array: what is read, what is left out and why, crops, labels, and persons in parts."""

import json
from collections import Counter

import numpy as np
import pyarrow as pa
import pytest
from builders import contact_frames
from builders.contact_frames import PRESSED, mask_of, save
from builders.project import ROOT

from tactile import tasks
from tactile.base import params
from tactile.base.errors import InputError
from tactile.datasets import schemas
from tactile.datasets.windowing import windows_of
from tactile.experiments import array_recorded
from tactile.experiments.array_recorded import COLS, PITCH_MM, PIXELS, ROWS, TOO_MANY, TOO_WIDE
from tactile.logs import sources
from tactile.stages import ingest

SETTINGS = params.load(ROOT / "params.yaml")["array_recorded"]
OWN_PITCH = SETTINGS | {"sensor": {"rows": 20, "cols": 20, "pitch_mm": 4.8}}
FINER = OWN_PITCH | {"label": {"map_rows": 40, "map_cols": 40}}


def changed(**blocks) -> dict:
    return SETTINGS | {name: SETTINGS[name] | block for name, block in blocks.items()}


@pytest.fixture
def one(tmp_path):
    """`one(*places, settings=...)`: what is read of a session with one frame for each list of places."""

    def read(*frames, settings=SETTINGS, **saved):
        for number, places in enumerate(frames):
            save(tmp_path / "P01" / "1" / "npz" / f"{number:04d}.npz", mask_of(places), **saved)
        return array_recorded.read_recording(tmp_path / "P01" / "1", settings)

    return read


@pytest.mark.parametrize("settings", [SETTINGS, OWN_PITCH, FINER])
@pytest.mark.parametrize("in_contact", [0, 255])
def test_a_crop_holds_all_of_every_contact(one, settings, in_contact):
    """Whatever the mask's values mean, and however fine elements and cells are."""
    places = [(100.0, 150.0), (160.0, 200.0)]
    touched = mask_of(places)
    frames, rejects, report = one(places, settings=settings, in_contact=in_contact)
    assert frames.num_rows == 1 and not rejects.num_rows and report["npz"]["accepted"] == 1
    row = frames.to_pylist()[0]
    assert (row["condition"], row["recording"], row["person"], row["contacts"]) == ("P01", "P01/1", "P01", 2)
    assert sum(row["contact_px"]) == touched.sum()
    area = row["area_mm2"]
    assert np.isnan(area[2]) and sum(area[:2]) == pytest.approx(touched.sum() * (PITCH_MM / PIXELS) ** 2)
    share = array_recorded.labels(frames, settings)[0].reshape(settings["label"]["map_rows"], -1)
    assert share.max() == 100 and share.min() == 0
    mm = 20 * PITCH_MM / len(share)
    cell_row, cell_col = ((np.arange(len(share)) + 0.5) * mm for _ in range(2))
    centre = [(share.sum(axis=1) @ cell_row) / share.sum(), (share.sum(axis=0) @ cell_col) / share.sum()]
    assert centre == pytest.approx([np.mean(row["y_mm"][:2]), np.mean(row["x_mm"][:2])], abs=0.1)
    readings = np.array(row["v"]).reshape(settings["sensor"]["rows"], -1)
    assert readings.mean() == pytest.approx(PRESSED * share.mean() / 100 - 20, rel=0.01)
    coarse = readings.reshape(10, len(readings) // 10, 10, -1).mean(axis=(1, 3)) + 20
    cells = share.reshape(10, len(share) // 10, 10, -1).mean(axis=(1, 3)) * PRESSED / 100
    np.testing.assert_allclose(coarse, cells, atol=0.6)


def test_every_frame_is_used_or_has_a_reason(one):
    far, near = [(100.0, 30.0), (100.0, 400.0)], [(50.0, 50.0 + 30 * k) for k in range(4)]
    frames, rejects, report = one([(100.0, 100.0)], far, near, [], [(8.0, 8.0)])
    found = dict(zip(rejects["file"].to_pylist(), rejects["reason"].to_pylist(), strict=True))
    assert found == {"0001.npz": TOO_WIDE, "0002.npz": TOO_MANY, "0003.npz": "no contact"}
    assert frames["t_s"].to_pylist() == [0, 4] and report["npz"]["lines"] == 5 and report["npz"]["rate_hz"] is None
    assert report["npz"]["rejects"] == dict(Counter(found.values()))


def test_a_crop_just_holds_the_widest_contacts(one):
    """20 elements are 160 pixels: a rectangle of these on their border fits, one pixel on, or across a border, not."""
    for first, last, fits in ((16, 176, True), (15, 176, False), (16, 177, False), (12, 172, False)):
        contacts = array_recorded.Contacts(*np.zeros((3, 1)), (first, 40), (last, 60))
        corner = array_recorded.crop_corner(contacts, array_recorded.sizes(SETTINGS), "P01/1/0000")
        assert (corner is not None) == fits
        assert not fits or corner[0] == first // PIXELS


def test_the_place_of_a_crop_is_drawn_by_the_frame_alone():
    """It is the same in every process, and all places that hold the contact occur."""
    of = array_recorded.sizes(SETTINGS)
    contacts = array_recorded.Contacts(*np.zeros((3, 1)), (160, 280), (176, 296))
    drawn = [array_recorded.crop_corner(contacts, of, f"P01/1/{k:04d}") for k in range(4000)]
    assert drawn == [array_recorded.crop_corner(contacts, of, f"P01/1/{k:04d}") for k in range(4000)]
    assert drawn[:3] == [(10, 30), (10, 29), (6, 24)]
    assert {row for row, _ in drawn} == set(range(2, 21)) and {col for _, col in drawn} == set(range(17, 36))
    edge = array_recorded.Contacts(*np.zeros((3, 1)), (0, 0), (8, 8))
    assert array_recorded.crop_corner(edge, of, "any") == (0, 0)


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (
            {"cap": np.zeros((41, 71)), "ftir": np.zeros((328, 576))},
            r"readings \(41, 71\) and mask \(328, 576\) are not",
        ),
        ({"cap": np.zeros((41, 72)), "ftir": np.full((328, 576), 7)}, "its mask has other values than 0 and 255"),
        ({"cap": np.zeros((41, 72))}, "0000.npz: not a frame of the array .*ftir.*; fetch it again"),
        ({"cap": np.full((41, 72), np.nan), "ftir": np.zeros((328, 576))}, "are not 41 x 72 numbers"),
        (b"PK\x03\x04 cut", "0000.npz: not a frame of the array"),
    ],
)
def test_what_is_no_frame_is_named(tmp_path, content, said):
    path = tmp_path / "P01" / "1" / "npz" / "0000.npz"
    path.parent.mkdir(parents=True)
    if isinstance(content, bytes):
        path.write_bytes(content)
    else:
        np.savez(path, **content)
    with pytest.raises(InputError, match=said):
        array_recorded.read_recording(tmp_path / "P01" / "1", SETTINGS)


def test_a_mask_that_is_turned_round_is_seen(one, tmp_path):
    """Where readings under the fewer pixels are lower, these are not the contact, or readings fall when touched."""
    cap = -PRESSED * mask_of([(100, 100)]).reshape(ROWS, PIXELS, COLS, PIXELS).mean(axis=(1, 3))
    with pytest.raises(InputError, match=r"0000\.npz: readings under its \d+ pixels of contact are not higher"):
        one([(100.0, 100.0)], cap=cap)


def test_a_session_of_which_nothing_is_left_is_named(one):
    with pytest.raises(InputError, match=r"P01/1: none of its 1 frames is used \(\{'no contact': 1\}\)"):
        one([])
    with pytest.raises(InputError, match="no recordings; run `tactile fetch array_recorded`"):
        array_recorded.recordings(ROOT / "docs")


@pytest.mark.parametrize(
    ("blocks", "said"),
    [
        ({"sensor": {"pitch_mm": 7.0}}, r"sensor\.pitch_mm: 7 mm is no multiple of the array's 4.8 mm; set 4.8"),
        ({"sensor": {"rows": 21}}, r"sensor\.rows: 21 of 9.6 mm are 42 rows of the array, which has 41; set 20"),
        ({"sensor": {"cols": 37}}, r"sensor\.cols: 37 of 9.6 mm are 74 cols of the array, which has 72; set 36"),
        ({"label": {"map_cols": 30}}, r"label\.map_cols: 30 cells do not divide the 160 pixels"),
        ({"label": {"map_rows": 10, "map_cols": 10}}, "cells of 16 x 16 pixels are larger than the 255"),
    ],
)
def test_sizes_that_do_not_fit_are_named(blocks, said):
    with pytest.raises(InputError, match=said):
        array_recorded.sizes(changed(**blocks))


@pytest.fixture
def windows(tmp_path):
    """The windows of made-up sessions of ten persons."""
    contact_frames.sessions(tmp_path, persons=10, frames=3)
    read = [array_recorded.read_recording(path, SETTINGS)[0] for path in array_recorded.recordings(tmp_path)]
    return windows_of(pa.concat_tables(read).unify_dictionaries().combine_chunks(), SETTINGS["window"])


def test_no_person_is_of_two_parts_and_every_person_is_tested_once(windows):
    person, contacts = schemas.names(windows["person"]), windows["contacts"].to_numpy()
    tested = []
    for protocol, most in [(f"{way}_{k}", most) for way, most in (("fold", 1), ("two_too", 2)) for k in range(5)]:
        part = array_recorded.split(windows, SETTINGS, protocol, 0)
        of = {name: set(person[part == name]) for name in ("train", "validation", "test")}
        assert [len(of[name]) for name in of] == [7, 1, 2] and len(set.union(*of.values())) == 10
        assert (part == array_recorded.split(windows, SETTINGS, protocol, 1)).all()
        for name in ("train", "validation"):
            assert set(contacts[part == name]) == set(range(1, most + 1)), protocol
        assert set(contacts[part == "test"]) == {1, 2, 3}
        assert (part[np.isin(person, [*of["test"]])] == "test").all()
        tested += sorted(of["test"]) if most == 1 else []
    assert tested == sorted(set(person))


@pytest.mark.parametrize("protocol", ["fold_5", "fold", "two_0", "fold_0_0", "press", "two_too_5"])
def test_a_protocol_that_there_is_not_is_named(windows, protocol):
    with pytest.raises(InputError, match=f"there is no '{protocol}'; of 10 persons there are fold_0 to fold_4"):
        array_recorded.split(windows, SETTINGS, protocol, 0)


def test_parts_need_a_person_each(windows):
    few = windows.filter(pa.array(np.isin(schemas.names(windows["person"]), ["P01", "P02", "P03"])))
    with pytest.raises(InputError, match="2 persons test and 1 validate, which leaves none of the 3"):
        array_recorded.split(few, SETTINGS, "fold_0", 0)
    assert not len(array_recorded.split(windows.slice(0, 0), SETTINGS, "fold_0", 0))


def test_each_frame_is_a_window_and_conditions_are_contacts(windows):
    split, columns = tasks.of("array_recorded").rows(windows, array_recorded, SETTINGS)
    assert set(schemas.names(split["condition"])) == set(schemas.names(windows["person"]))
    assert schemas.names(columns["condition"]).tolist() == ["one", "two", "three"] * 20
    assert len(set(columns["press"].to_pylist())) == windows.num_rows == 60
    more = windows.set_column(
        windows.schema.get_field_index("contacts"), "contacts", pa.array([3, 4, 5] * 20, pa.int8())
    )
    assert array_recorded.conditions(more).to_pylist()[:3] == ["three", "four_or_more", "four_or_more"]


def test_ingest_keeps_count_and_absent_recordings_do_not_run(workspace, tmp_path, monkeypatch):
    ingest.ingest(workspace, "array_recorded", SETTINGS)
    report = json.loads(workspace.ingest_report("array_recorded").read_text())
    assert report == {"run": False, "reason": "recordings not downloaded; run `tactile fetch array_recorded`"}
    contact_frames.sessions(tmp_path / "made", persons=3, frames=4)
    save(tmp_path / "made" / "P01" / "1" / "npz" / "0004.npz", mask_of([(100.0, 30.0), (100.0, 400.0)]))
    monkeypatch.setattr(sources, "is_complete", lambda workspace, name: True)
    monkeypatch.setattr(sources, "folder", lambda workspace, name: tmp_path / "made")
    ingest.ingest(workspace, "array_recorded", SETTINGS)
    report = json.loads(workspace.ingest_report("array_recorded").read_text())
    assert len(report["recordings"]) == 6 and report["recordings"]["P01/P01/1"]["files"]["npz"]["lines"] == 5
    rejects = schemas.read(workspace.rejects("array_recorded")).to_pylist()
    assert [(row["recording"], row["file"], row["reason"]) for row in rejects] == [("P01/1", "0004.npz", TOO_WIDE)]
    assert schemas.read(workspace.frames("array_recorded")).num_rows == 24


@pytest.mark.slow
def test_the_real_frames_have_contact_where_readings_are_high(recordings):
    """One session whole, and every session's name."""
    folder = recordings("array_recorded")
    found = array_recorded.recordings(folder)
    assert len(found) == 30 and [path.parent.name for path in found[::3]] == [f"P{k:02d}" for k in range(1, 11)]
    frames, rejects, _ = array_recorded.read_recording(folder / "P01" / "2", SETTINGS)
    assert frames.num_rows + rejects.num_rows == 130
    share, v = array_recorded.labels(frames, SETTINGS), schemas.matrix(frames["v"])
    coarse = share.reshape(-1, 10, 2, 10, 2).mean(axis=(2, 4)).reshape(len(v), -1)
    assert np.corrcoef(coarse.ravel(), v.ravel())[0, 1] > 0.8
