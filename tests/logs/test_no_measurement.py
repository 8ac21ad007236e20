"""What is no measurement is found, with its share and place; what chance or a sensor at rest can do is not."""

import numpy as np
import pytest
from builders.project import ROOT, miniature_settings
from builders.touched_sensors import touched

from pipeline import scenes
from tactile import experiments
from tactile.base import params
from tactile.datasets import schemas
from tactile.logs import no_measurement
from tactile.targets import read as targets_read

VALUES = params.load(ROOT / "params.yaml")
NOTHING = no_measurement.Found(None, None, [])
RNG = np.random.default_rng(0)
SLOW = {"noise": 0, "rest": 0, "hz": 10, "hold_s": 1.0, "pause_s": 2.0}
SENSORS = {  # whose readings are all measured
    "counts": {},
    "one element": {"channels": 1},
    "one element, noisy": {"channels": 1, "noise": 5},
    "two elements": {"channels": 2},
    "no noise": {"noise": 0},
    "little noise": {"noise": 0.2},
    "one element without noise": {"channels": 1, "noise": 0},
    "two elements without noise": {"channels": 2, "noise": 0},
    "single touches, long rests": {"frames": 6000, "pause_s": 20},
    "the same with little noise": {"frames": 6000, "pause_s": 20, "noise": 0.3},
    "the same without": {"frames": 6000, "pause_s": 20, "noise": 0},
    "a mat that rests at 0": {"channels": 256, "noise": 0.6, "rest": 0},
    "the same without noise": {"channels": 256, "noise": 0, "rest": 0},
    "the same, slow": SLOW | {"channels": 256},
    "four elements, slow": SLOW | {"channels": 4},
    "a limit": {"highest": 400, "hold_s": 8.0, "hz": 10},
    "two elements at a limit": {"channels": 2, "highest": 100, "hold_s": 4.0},
}


@pytest.mark.parametrize("seed", [0, 1])
@pytest.mark.parametrize("sensor", SENSORS)
def test_readings_are_measured(sensor, seed):
    time_s, x = touched(**SENSORS[sensor], seed=seed)
    assert no_measurement.found(time_s, x) == NOTHING


@pytest.mark.parametrize("decimals", [2, 4])
def test_volts_are_measured(decimals):
    time_s, counts = touched(channels=6, noise=3)
    assert no_measurement.found(time_s, np.round(counts / 200, decimals)) == NOTHING


def numbered(rows):
    """A mask of 2000 frames."""
    return np.isin(np.arange(2000), rows)


@pytest.mark.parametrize(
    ("which", "value"),
    [
        (numbered(range(2, 2000, 3)), 0),
        (numbered(range(1, 2000, 2)), 0),
        (RNG.random(2000) < 0.02, 0),
        (RNG.random(2000) < 0.1, 1023),
        (numbered(range(0, 2000, 40)), 17),
        (numbered(range(700, 900)), 0),
        (numbered(range(700, 900)), 65535),
    ],
)
@pytest.mark.parametrize("channels", [16, 256])
def test_frames_of_one_number(which, value, channels):
    time_s, x = touched(channels=channels)
    x[which] = value
    found = no_measurement.found(time_s, x)
    assert found._replace(constant=None) == NOTHING
    assert found.constant.rows.tolist() == np.flatnonzero(which).tolist()
    assert found.constant[1:] == (value, pytest.approx(which.mean()), False)


@pytest.mark.parametrize("noise", [0, 0.6])
def test_zeros_within_touches_of_a_mat_that_rests_at_zero(noise):
    """Those at rest cannot be told, so that the share is a lower bound."""
    time_s, x = touched(channels=256, rest=0, noise=noise)
    touches = (x > 100).any(axis=1)
    x[2::3] = 0
    found = no_measurement.constant_frames(x)
    assert found.at_least and np.isin(found.rows, np.arange(2, 2000, 3)).all()
    assert 0.5 < len(found.rows) / touches[2::3].sum() <= 1.2


def test_two_constants_are_named_by_the_more_frequent():
    time_s, x = touched()
    x[::40], x[7::50] = 17, 0
    assert len(no_measurement.constant_frames(x).rows) == 90 and no_measurement.constant_frames(x).value == 17


@pytest.mark.parametrize("times", [2, 3, 4, 5, 10])
@pytest.mark.parametrize("channels", [1, 2, 16, 256])
def test_frames_that_are_printed_several_times(channels, times):
    _, once = touched(channels=channels, frames=2000 // times, hz=50 / times)
    x = np.repeat(once, times, axis=0)
    found = no_measurement.found(np.arange(len(x)) / 50, x)
    assert found._replace(repeated=None) == NOTHING
    assert (found.repeated.times, found.repeated.regular) == (times, True)
    chance = (once[1:] == once[:-1]).all(axis=1).sum()
    assert len(found.repeated.rows) == len(once) * (times - 1) + chance


def test_volts_that_are_printed_several_times():
    _, counts = touched(channels=6, frames=500, noise=3)
    x = np.repeat(np.round(counts / 200, 4), 3, axis=0)
    assert no_measurement.repeated_frames(x).times == 3


@pytest.mark.parametrize("share", [0.02, 0.1, 0.4])
def test_lost_frames_that_are_the_one_before(share):
    _, x = touched()
    lost = np.random.default_rng(1).random(len(x)) < share
    for k in np.flatnonzero(lost[1:]) + 1:
        x[k] = x[k - 1]
    found = no_measurement.repeated_frames(x)
    assert (
        found.share == pytest.approx(lost.mean(), rel=0.1)
        and not found.regular
        and np.isin(found.rows, np.where(lost)).all()
    )


def test_a_device_that_prints_faster_than_it_reads():
    _, once = touched(hz=30.0)
    x = once[(np.arange(3300) * 0.6).astype(int)]
    found = no_measurement.repeated_frames(x)
    assert found.share == pytest.approx(0.4, abs=0.01) and not found.regular


@pytest.mark.parametrize("channels", [1, 2, 6, 16])
@pytest.mark.parametrize("value", [None, 0, 1023])
def test_a_channel_that_is_stuck_for_the_last_third(channels, value):
    time_s, x = touched(channels=channels)
    x[1333:, 0] = x[1333, 0] if value is None else value
    (stuck,) = no_measurement.found(time_s, x).stuck
    assert (stuck.channel, stuck.stop) == (0, 2000) and 1325 < stuck.first <= 1333
    assert stuck.value == x[1333, 0] and stuck.lasts_s == pytest.approx(667 / 50, abs=0.2)
    assert stuck.elsewhere_s < 0.5


def test_several_channels_that_are_stuck():
    time_s, x = touched()
    x[1000:, 3], x[400:900, 7] = x[1000, 3], 300
    found = no_measurement.stuck_channels(time_s, x)
    assert [(one.channel, one.value) for one in found] == [(3, x[1000, 3]), (7, 300)]
    assert (found[1].first, found[1].stop) == (400, 900)
    x[1500:] = x[1500]
    assert {one.channel for one in no_measurement.stuck_channels(time_s, x)} >= set(range(16)) - {3, 7}


@pytest.mark.parametrize("noise", [0, 0.2])
def test_a_channel_without_noise_is_stuck_beyond_its_rest_alone(noise):
    time_s, x = touched(noise=noise)
    stuck, rests = x.copy(), x.copy()
    stuck[1000:, 3], rests[1000:, 3] = 180, 12
    assert [one.channel for one in no_measurement.stuck_channels(time_s, stuck)] == [3]
    assert no_measurement.stuck_channels(time_s, rests) == []


def test_zeros_hide_no_other_finding():
    time_s, x = touched()
    x[1000:, 3] = x[1000, 3]
    x[::40] = 0
    found = no_measurement.found(time_s, x)
    assert len(found.constant.rows) == 50 and found.repeated is None
    ((channel, first, stop, *_),) = found.stuck
    assert channel == 3 and 990 < first <= 1001 and stop == 2000


def test_sentences_have_numbers_lines_and_names():
    time_s, x = touched(channels=4)
    lines, names = np.arange(len(x)) + 2, ["v0", "v1", "v2", "v3"]
    x[::40] = 0
    one = no_measurement.Recording(no_measurement.found(time_s, x), lines, 50.0)
    (said,) = no_measurement.said({"single/a": one, "single/b": one}, names)
    assert said.startswith(
        "2.5 % of the frames (100) read 0 in all 4 elements, far from the frames beside them (single/a from line 2 on, "
        "and 1 more recording)"
    )
    x = np.repeat(touched(channels=4, frames=500)[1], 4, axis=0)
    x[1000:, 2] = x[1000, 2]
    one = no_measurement.Recording(no_measurement.found(time_s, x), lines, 50.0)
    repeated, stuck = no_measurement.said({"single/a": one}, names)
    assert (
        "each frame is printed 4 times (single/a from line 3 on): 12.5 frames a second are measured, not 50" in repeated
    )
    assert stuck.startswith(f"v2 reads {x[1000, 2]:g} for 20 s without a change (single/a from line ")


@pytest.mark.parametrize("experiment", ["strain", "glove", "touch"])
def test_simulated_readings_are_measured(experiment, workspace):
    settings = miniature_settings(workspace)[experiment]
    recordings, logs_of = scenes.plan(experiment, settings)
    for recording in list(recordings)[:4]:
        scenes.write_recording(workspace.root, recording, logs_of)
        path = scenes.folder_of(workspace.root, recording) / experiments.log_name(experiment)
        readings = targets_read.sensor_log(path, experiment, settings)
        assert no_measurement.found(readings.time_s, readings.reading.astype(float)) == NOTHING


def test_the_sample_is_measured():
    readings = targets_read.sensor_log(ROOT / "data/sample/double/two_touches/array.log", "touch", VALUES["touch"])
    assert no_measurement.found(readings.time_s, readings.reading) == NOTHING


@pytest.mark.parametrize(
    ("source", "every", "column"),
    [("velostat_recorded", 3, "v"), ("strain_recorded", 1, "v"), ("glove_recorded", 25, "pressure")],
)
def test_recorded_readings_are_measured(source, every, column, recordings):
    module = experiments.module(source)
    for path in module.recordings(recordings(source))[::every]:
        frames, _, _ = module.read_recording(path, VALUES[source])
        x = schemas.matrix(frames[column]).astype(float)
        assert no_measurement.found(frames["t_s"].to_numpy(), x) == NOTHING, path.name
