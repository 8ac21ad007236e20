"""The reader of the recorded strain sensors: MATLAB workspaces in, frames in the order of time out."""

from types import SimpleNamespace

import numpy as np
import pytest
from builders.strain_workspaces import CYCLES, save, workspace

from tactile.base.errors import InputError
from tactile.datasets import schemas, series
from tactile.experiments import strain_recorded
from tactile.experiments.strain_recorded import CYCLE, read_recording
from tactile.inference import recordings
from tactile.logs import parse

SETTINGS = {"ingest": {"every": 3, "max_reject_fraction": 0.05}, "split": {"train": 0.7, "validation": 0.1}}


def test_every_third_sample_with_its_place_and_press(tmp_path):
    content = workspace(extra=25)
    frames, rejects, report = read_recording(save(tmp_path, content), SETTINGS)
    assert frames.schema.equals(series.frames(7)) and frames.num_rows == len(range(0, CYCLES * CYCLE, 3))
    assert rejects.schema.equals(parse.REJECTS)
    assert set(rejects["reason"].to_pylist()) == {"incomplete cycle"} and rejects.num_rows == 25
    assert rejects["line"][0].as_py() == CYCLES * CYCLE + 1
    sample = np.arange(0, CYCLES * CYCLE, 3)
    assert frames["t_s"].to_numpy() == pytest.approx(0.2 + 0.07 * sample)
    v = schemas.matrix(frames["v"])
    assert v[:, :6] == pytest.approx(content["voltage"][sample], abs=1e-6) and np.isnan(v[:, 6]).all()
    press, y = frames["press"].to_numpy(), schemas.matrix(frames["y_mm"])
    cycle, phase = np.divmod(sample, CYCLE)
    assert (press == np.where(phase >= 20, cycle, -1)).all()
    assert (y[:, 2] == np.where(phase >= 20, -5, 0)).all()
    places = content["pos"].T.astype(np.float32)
    assert (y[phase >= 10, :2] == places[cycle[phase >= 10]]).all()
    before = (phase < 10) & (cycle > 0)
    assert (y[before, :2] == places[cycle[before] - 1]).all() and (y[:3, :2] == 0).all()
    assert frames["gap_before"].to_pylist() == [True] + [False] * (frames.num_rows - 1)
    assert report["para5_long.mat"]["lines"] == CYCLES * CYCLE + 25 and report["para5_long.mat"]["channels"] == {}


def test_second_day_has_seven_channels_and_no_last_time(tmp_path):
    content = workspace(channels=7)
    content["tim"] = content["tim"][:, :-1]
    frames, rejects, _ = read_recording(save(tmp_path, content, "para5_long_n.mat"), SETTINGS)
    assert frames["condition"].unique().to_pylist() == ["day_2"]
    assert not np.isnan(schemas.matrix(frames["v"])).any()
    assert [tuple(row.values())[:3] for row in rejects.to_pylist()] == [("para5_long_n.mat", CYCLES * CYCLE, "no time")]


def test_bad_samples_are_rejects_with_their_number(tmp_path):
    content = workspace()
    content["voltage"][30, 2] = np.nan
    content["voltage"][90, 1] = -40.0
    content["tim"][0, 150] = 1.0
    frames, rejects, report = read_recording(save(tmp_path, content), SETTINGS)
    found = [(row["line"], row["reason"]) for row in rejects.to_pylist()]
    assert found == [(31, "not a number"), (91, "out of range"), (151, "out of order")]
    assert "nan" in rejects["text"][0].as_py()
    assert frames.num_rows == len(range(0, CYCLES * CYCLE, 3)) - 3
    # Samples 30, 90 and 150 would have been frames: there is a gap before the next.
    gap = frames["t_s"].to_numpy()[frames["gap_before"].to_numpy()]
    assert gap == pytest.approx(0.2 + 0.07 * np.array([0, 33, 93, 153])) and report["para5_long.mat"]["gaps"] == 3


def test_dead_and_saturated_channels_are_named(tmp_path):
    content = workspace(channels=7)
    content["voltage"][:, 1] = 1.9
    content["voltage"][600:, 6] = 3.15
    _, _, report = read_recording(save(tmp_path, content, "para5_long_n.mat"), SETTINGS)
    assert report["para5_long_n.mat"]["channels"] == {
        "c1": {"fault": "dead", "share": 1.0},
        "c6": {"fault": "saturated", "share": 0.25},
    }


def without(name):
    content = workspace()
    del content[name]
    return content


BAD = {
    "other variables": (without("pos"), r"para5_long.mat: has no variable 'pos'; it must hold voltage, tim"),
    "text": (workspace(voltage="none"), "'voltage' is not a matrix of real numbers"),
    "too many channels": (workspace(channels=9), "'voltage' has 9 columns"),
    "times of another recording": (workspace(tim=np.ones((1, 7))), "7 times for 800 samples"),
    "places of another recording": (workspace(pos=np.ones((2, 5))), "'pos' has 5 places for 20 cycles"),
    "places as rows": (workspace(pos=np.ones((20, 2))), "'pos' must have 2 rows"),
    "depths": (workspace(deformation=np.ones(3)), "'deformation' must be one number"),
    "no cycle": (workspace(cycles=0, extra=30), "30 samples are less than one cycle"),
    "all NaN": (workspace(voltage=np.full((800, 6), np.nan)), r"100.0% of .*'not a number'.*max_reject_fraction"),
    "all dead": (workspace(voltage=np.full((800, 6), 3.15)), "all 6 channels are dead or saturated"),
}


@pytest.mark.parametrize("fault", BAD)
def test_a_workspace_of_another_kind_is_one_sentence(fault, tmp_path):
    content, sentence = BAD[fault]
    with pytest.raises(InputError, match=sentence):
        read_recording(save(tmp_path, content), SETTINGS)


def test_a_file_too_large_or_with_another_name_is_refused(tmp_path, monkeypatch):
    with pytest.raises(InputError, match="not one of the recordings; they are called para5_long.mat"):
        read_recording(save(tmp_path, workspace(), "monday.mat"), SETTINGS)
    monkeypatch.setattr(strain_recorded, "LARGEST_FILE", 1000)
    with pytest.raises(InputError, match="bytes are more than the data can have"):
        read_recording(save(tmp_path, workspace()), SETTINGS)


def test_recordings_are_both_days_or_a_sentence(tmp_path):
    save(tmp_path, workspace(), "new_test/para5_long.mat")
    with pytest.raises(InputError, match=r"para5_long_n\.mat: recording not found; run `tactile fetch"):
        strain_recorded.recordings(tmp_path)
    save(tmp_path, workspace(channels=7), "para5_long_n.mat")
    assert [path.name for path in strain_recorded.recordings(tmp_path)] == ["para5_long.mat", "para5_long_n.mat"]


def both_days(tmp_path):
    import pyarrow as pa

    days = [save(tmp_path, workspace(), "para5_long.mat"), save(tmp_path, workspace(channels=7), "para5_long_n.mat")]
    return pa.concat_tables([read_recording(path, SETTINGS)[0] for path in days])


def test_splits_are_whole_cycles_in_the_order_of_time(tmp_path):
    frames = both_days(tmp_path)
    condition, press = schemas.names(frames["condition"]), frames["press"].to_numpy()
    presses = {}
    tested = {"within_day_xy": "day_1", "within_day_five_xy": "day_1", "failing_channel_z": "day_2"}
    for protocol, day in tested.items():
        part = strain_recorded.split(frames, SETTINGS, protocol, 0)
        assert (part[condition != day] == "unused").all()
        own = part[condition == day]
        order = [name for k, name in enumerate(own) if k == 0 or own[k - 1] != name]
        assert order == ["train", "validation", "test"]
        presses = {name: set(press[(part == name) & (press >= 0)]) for name in order}
        assert [sorted(one) for one in presses.values()] == [[*range(13)], [13], [*range(14, 20)]]
        # The rows before a press are in its part.
        first_test = np.flatnonzero(own == "test")[0]
        assert press[condition == day][first_test] == -1 and press[condition == day][first_test - 1] == 13
    part = strain_recorded.split(frames, SETTINGS, "across_days_xyz", 3)
    assert (part[condition == "day_2"] == "test").all()
    assert set(press[part == "validation"]) == {-1, 18, 19} and set(press[part == "train"]) == {-1, *range(18)}


def test_swapped_days_train_on_the_second_and_test_on_the_first(tmp_path):
    frames = both_days(tmp_path)
    condition = schemas.names(frames["condition"])
    part = strain_recorded.split(frames, SETTINGS, "days_swapped_xy", 0)
    assert (part[condition == "day_1"] == "test").all() and set(part[condition == "day_2"]) == {"train", "validation"}
    for day, columns in (("day_1", [0, 1, 2, 3, 4]), ("day_2", [1, 2, 3, 4, 5])):
        assert strain_recorded.channels("days_swapped_xy", day) == columns
    assert strain_recorded.task("days_swapped_xy", {}).base == "days_swapped_xyz"


def test_new_places_trains_on_no_place_of_the_second_day(tmp_path):
    frames = both_days(tmp_path)
    short = np.ones(frames.num_rows, dtype=bool)
    short[-8 * CYCLE // 3 :] = False  # day_2 has 12 cycles instead of 20
    frames = frames.filter(short)
    part, press = strain_recorded.split(frames, SETTINGS, "new_places_xy", 0), frames["press"].to_numpy()
    trained = np.isin(part, ["train", "validation"])
    tested = set(press[part == "test"]) - {-1}
    assert tested == set(range(12)) and set(press[trained]) - {-1} == set(range(12, 20))
    y = schemas.matrix(frames["y_mm"])[:, :2]
    pressed = press >= 0
    assert not set(map(tuple, y[trained & pressed])) & set(map(tuple, y[(part == "test") & pressed]))


def test_channels_pair_the_same_strands():
    assert strain_recorded.channels("across_days_xy", "day_1") == [0, 1, 2, 3, 4]
    assert strain_recorded.channels("within_day_five_xy", "day_1") == [0, 1, 2, 3, 4]
    assert strain_recorded.channels("new_places_xy", "day_2") == [1, 2, 3, 4, 5]
    assert strain_recorded.channels("failing_channel_z", "day_2") == [*range(7)]
    with pytest.raises(InputError, match="protocol within_day_xy: has no day_2, only day_1"):
        strain_recorded.channels("within_day_xy", "day_2")


def test_a_trained_model_is_given_the_same_strands_of_both_days(tmp_path):
    """Read as they stand, those of the second day would be one strand off."""
    inputs = SimpleNamespace(chosen=strain_recorded.channels("across_days_xy", "day_1"))
    card = SimpleNamespace(
        experiment="strain_recorded",
        protocol="across_days_xy",
        reading=SETTINGS,
        inputs=inputs,
        kind="series",
        correlation=None,
    )
    for channels, day in ((6, "para5_long.mat"), (7, "para5_long_n.mat")):
        content = workspace(channels=channels)
        (path,) = recordings.logs(save(tmp_path / str(channels), content, day), "strain_recorded")
        seen = recordings.read(path, "it", card).x[:, inputs.chosen]
        assert seen == pytest.approx(content["voltage"][: CYCLES * CYCLE : 3, channels - 6 : channels - 1], abs=1e-6)
    card.protocol = "within_day_xy"
    with pytest.raises(InputError, match="within_day_xy: has no day_2"):
        recordings.read(path, "it", card)


def test_a_protocol_is_a_split_and_a_task():
    task = strain_recorded.task("across_days_xy", {})
    assert (task.outputs, task.pressed_only, task.base) == ((0, 1), True, "across_days_xyz")
    assert strain_recorded.task("within_day_z", {})[::2] == ((2,), False)
    for wrong in ("within_day", "tuesday_xy", "within_day_yz", ""):
        with pytest.raises(InputError, match=f"no protocol '{wrong}'; a protocol is one of within_day, "):
            strain_recorded.task(wrong, {})
