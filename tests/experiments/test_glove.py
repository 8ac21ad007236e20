"""From the glove's log to tactile images: equations 1 to 6, splits, and what becomes of bad input."""

import numpy as np
import pyarrow as pa
import pytest
from builders.project import ROOT

from tactile.base import params
from tactile.base.errors import InputError
from tactile.datasets import images, schemas, specimens
from tactile.experiments import glove

CELLS = glove.PRESSURE_CELLS + glove.STRAIN_CELLS
SCHEMA = glove.frames_schema(params.load(ROOT / "params.yaml")["glove"])


@pytest.fixture(scope="module")
def settings():
    changes = {"window": {"stride": 1}, "split": {"train": 0.5, "validation": 0.2}}
    return params.load(ROOT / "params.yaml")["glove"] | changes


def write(folder, lines):
    folder.mkdir(parents=True)
    (folder / glove.LOG).write_text("\n".join(lines) + "\n")
    return folder


def line(t_us, cells):
    return ",".join(map(str, [t_us, *cells]))


def table(objects, sessions, frames):
    """A frames table with random counts."""
    rng = np.random.default_rng(0)
    names = [(f"object{i}", f"session{j}") for i in range(objects) for j in range(sessions) for _ in range(frames)]
    n = len(names)
    columns = {
        "condition": [name for name, _ in names],
        "recording": [name for _, name in names],
        "segment": np.zeros(n, np.int16),
        "t_s": np.arange(n, dtype=float),
        "gap_before": np.zeros(n, bool),
        "pressure": schemas.lists(rng.integers(0, 1024, (n, glove.PRESSURE_CELLS)), pa.int16()),
        "strain": schemas.lists(rng.integers(0, 1024, (n, glove.STRAIN_CELLS)), pa.int16()),
    }
    return pa.table(columns).cast(SCHEMA)


def test_equations_one_to_four():
    counts = np.array([0, 512, 1023])
    resistance = 1000 * (1024 - counts[1:]) / counts[1:]  # equation 3
    assert glove.conductance(counts, 1000.0)[1:] == pytest.approx(1 / resistance)
    assert glove.conductance(counts, 1000.0)[0] == 0


def test_equation_five_averages_nine_cells_of_a_joint():
    strain = np.zeros((1, 15, 9))
    strain[0, 3:6, 6:9] = np.arange(9).reshape(3, 3)
    means = glove.joint_means(strain, 3)
    assert means.shape == (1, 5, 3) and means[0, 1, 2] == 4 and means.sum() == 4


def test_equation_six_uses_the_whole_range_and_shows_nothing_of_a_sensor_at_rest():
    matrix = np.array([[[2.0, 4.0], [3.0, 2.0]]])
    assert images.normalised(matrix).tolist() == [[[0, 255], [128, 0]]]
    assert images.normalised(np.stack([matrix[0], np.ones((2, 2))]))[1].tolist() == [[0, 0], [0, 0]]


def test_images_lie_in_the_two_areas_of_the_scan(settings):
    found = glove.images(table(2, 1, 3), settings)
    for modality, image in found.items():
        assert image.shape == (6, 32, 32) and image.dtype == np.uint8, modality
        assert image.max(axis=(1, 2)).min() == 255
    outside = np.ones((32, 32), bool)
    outside[:15, :18] = outside[17:, 23:] = False
    assert (found["combined"][:, outside] == 0).all()
    assert (found["pressure"][:, 17:] == 0).all() and (found["strain"][:, :15] == 0).all()
    blocks = found["strain"][:, 17:, 23:].reshape(6, 5, 3, 3, 3)
    assert (np.ptp(blocks, axis=(2, 4)) == 0).all()  # a joint's nine pixels are one number


def test_a_session_is_on_one_side_and_all_parts_have_every_object(settings):
    frames = table(3, 6, 5)
    units = np.char.add(schemas.names(frames["condition"]), schemas.names(frames["recording"]))
    for seed in (0, 1):
        part = glove.split(frames, settings, "session_combined", seed)
        assert all(len(set(part[units == one])) == 1 for one in np.unique(units))
        for name in images.PARTS:
            assert set(schemas.names(frames["condition"])[part == name]) == {"object0", "object1", "object2"}
        assert (part == glove.split(frames, settings, "session_pressure", seed)).all()
    other = glove.split(frames, settings, "session_combined", 1)
    assert (other != glove.split(frames, settings, "session_combined", 0)).any()
    mixed = glove.split(frames, settings, "random_frames_combined", 0)
    assert any(len(set(mixed[units == one])) > 1 for one in np.unique(units))


def test_further_sessions_are_tested_on_and_change_no_training(settings):
    whole = table(3, 9, 5)
    names = schemas.names(whole["recording"])
    named = {
        one: f"specimen0-{'session' if place < 6 else 'test'}{place:02d}" for place, one in enumerate(np.unique(names))
    }
    names = np.array([named[one] for one in names])
    whole = whole.set_column(whole.schema.get_field_index("recording"), "recording", pa.array(names))
    further = specimens.only_tested(names)
    assert further.sum() == 3 * 3 * 5
    for protocol, place in (("session_combined", "test"), ("random_frames_combined", "unused")):
        part = glove.split(whole, settings, protocol, 0)
        assert set(part[further]) == {place}
        assert (part[~further] == glove.split(whole.filter(pa.array(~further)), settings, protocol, 0)).all()


@pytest.mark.parametrize("sessions", [1, 2])
def test_too_few_sessions_of_an_object_are_one_sentence(settings, sessions):
    with pytest.raises(InputError, match=f"object 'object0': {sessions} sessions; at least 3"):
        glove.split(table(2, sessions, 9), settings, "session_combined", 0)


def test_an_unknown_split_or_dataset_is_named(settings):
    with pytest.raises(InputError, match="no split 'grasp'"):
        glove.split(table(2, 3, 1), settings, "grasp_combined", 0)
    with pytest.raises(InputError, match="must end in one of _pressure, _strain, _combined"):
        glove.split(table(2, 3, 1), settings, "session_both", 0)


def test_shares_are_never_empty():
    for n in range(3, 40):
        parts = images.shares(np.arange(n), {"train": 0.98, "validation": 0.01})
        assert all(len(part) for part in parts) and sum(map(len, parts)) == n
        parts = images.shares(np.arange(n), {"train": 0.01, "validation": 0.98})
        assert all(len(part) for part in parts)


def test_only_every_stride_th_frame_of_a_session_becomes_an_image(settings):
    chosen = glove.chosen(table(2, 2, 5), settings | {"window": {"stride": 2}})
    assert chosen.tolist() == [0, 2, 4, 5, 7, 9, 10, 12, 14, 15, 17, 19]


def test_bad_lines_go_to_the_rejects_with_their_reason(settings, tmp_path):
    rng = np.random.default_rng(0)
    good = [rng.integers(0, 1024, CELLS) for _ in range(40)]
    lines = [line(k * 1000, cells) for k, cells in enumerate(good)]
    lines[3] = line(3000, good[3][:-1])  # a cell is missing
    lines[7] = line(7000, [*good[7], 5])  # one too many
    lines[11] = line(11000, [2000, *good[11][1:]])
    lines[15] = line(15000, np.zeros(CELLS, int))  # at rest, a frame as any other
    folder = write(tmp_path / "can" / "one", lines)
    loose = settings | {"ingest": {"max_reject_fraction": 0.5}}
    frames, rejects, report = glove.read_recording(folder, loose)
    found = dict(zip(rejects["line"].to_pylist(), rejects["reason"].to_pylist(), strict=True))
    assert found == {4: "column count", 8: "column count", 12: "out of range"}
    assert frames.num_rows == 37 and report[glove.LOG]["lines"] == 40
    assert frames.schema.equals(SCHEMA)
    assert set(schemas.names(frames["condition"])) == {"can"}
    with pytest.raises(InputError, match=r"scanner\.log: .* of the 40 lines cannot be used.*raise glove\.ingest"):
        glove.read_recording(folder, settings | {"ingest": {"max_reject_fraction": 0.05}})


def test_a_log_without_a_usable_frame_is_one_sentence(settings, tmp_path):
    folder = write(tmp_path / "can" / "one", [line(k, np.full(CELLS, 2000)) for k in range(5)])
    with pytest.raises(InputError, match="no line can be read"):
        glove.read_recording(folder, settings | {"ingest": {"max_reject_fraction": 1.0}})
    (folder / glove.LOG).write_bytes(b"\x00\xff" * 500)
    with pytest.raises(InputError, match=r"scanner\.log"):
        glove.read_recording(folder, settings)


def test_folders_without_objects_or_sessions_are_named(tmp_path):
    with pytest.raises(InputError, match="0 objects found"):
        glove.recordings(tmp_path)
    (tmp_path / "can" / "one").mkdir(parents=True)
    (tmp_path / "cup").mkdir()
    with pytest.raises(InputError, match="cup: no session of this object"):
        glove.recordings(tmp_path)


MAT = {"sensor": {"reference_ohm": 1000.0, "areas": {"pressure": {"rows": 16, "cols": 16, "highest": 4095}}}}
FEW = {
    "sensor": {
        "scale": "range",
        "areas": {"force": {"rows": 1, "cols": 5}, "motion": {"rows": 1, "cols": 5, "lowest": -180, "highest": 180}},
    }
}


def test_areas_of_other_sensors_give_columns_images_and_datasets():
    mat, few = glove.scanner_format(MAT), glove.scanner_format(FEW)
    assert len(mat.columns) == 257 and mat.names[-1] == "p255" and mat.columns[-1].high == 4095
    assert few.names == ["t_us", *(f"f{k}" for k in range(5)), *(f"m{k}" for k in range(5))]
    assert not few.columns[1].integer and few.columns[-1].low == -180
    assert images.modalities(MAT) == ("pressure",) and images.shape(MAT) == (16, 16)
    assert images.modalities(FEW) == ("force", "motion", "combined") and images.shape(FEW) == (1, 10)
    assert images.shape({"sensor": {}}) == (32, 32)


def test_readings_of_few_channels_keep_their_size():
    frames = pa.table(
        {
            "force": schemas.lists(np.array([[0, 0, 0, 0, 0], [1023, 0, 0, 0, 1023]]), pa.float32()),
            "motion": schemas.lists(np.array([[-180, 0, 180, 0, 0], [0, 0, 0, 0, 90]]), pa.float32()),
        }
    )
    found = glove.images(frames, FEW)
    assert found["force"][:, 0, :5].tolist() == [[0] * 5, [255, 0, 0, 0, 255]]  # a hand at rest shows nothing
    assert found["motion"][:, 0, 5:].tolist() == [[0, 128, 255, 128, 128], [128, 128, 128, 128, 191]]
    assert (found["combined"] == found["force"] + found["motion"]).all()


@pytest.mark.parametrize(
    ("areas", "message"),
    [
        ({"combined": {}}, "small letters alone, and not 'combined'"),
        ({"left_hand": {}}, "small letters alone"),
        ({"palm": {}, "pads": {}}, "begins like another area"),
        ({"palm": {"lowest": 9, "highest": 9}}, r"highest \(9\) must be above lowest \(9\)"),
        ({"palm": {"joint": 3}}, "2 x 2 cells are no whole number of joints of 3"),
        ({"palm": {}, "tips": {"left": 1}}, "overlaps 'palm' in the image"),
    ],
)
def test_areas_that_cannot_be_are_named(areas, message):
    areas = {name: {"rows": 2, "cols": 2} | block for name, block in areas.items()}
    with pytest.raises(InputError, match=rf"^glove\.sensor\.areas\.\w+: .*{message}"):
        images.areas({"sensor": {"areas": areas}})


def test_counts_begin_at_zero_and_protocols_name_an_area():
    below = {"palm": {"rows": 1, "cols": 1, "lowest": -5}}
    with pytest.raises(InputError, match=r"counts begin at 0; set glove\.sensor\.scale: range"):
        glove.scanner_format({"sensor": {"areas": below}})
    with pytest.raises(InputError, match="'session_strain' must end in one of _pressure"):
        glove.split(table(2, 3, 2), MAT | {"split": {"train": 0.5, "validation": 0.2}}, "session_strain", 0)
