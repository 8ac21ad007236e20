"""Strain scene: contact with friction, strands, drift, and the logs that are written."""

import copy

import numpy as np
import pytest

from pipeline.base import params
from pipeline.scenes import strain


@pytest.fixture
def scene():
    """The block strain.simulate, 60 s long."""
    settings = copy.deepcopy(params.load()["strain"]["simulate"])
    settings["samples"] = 300
    settings["faults"] |= {"gaps": 1, "gap_s": 4}
    return settings


def place(x, depth=5.0):
    x = np.asarray(x, float)
    return np.column_stack([x, np.zeros_like(x), np.full_like(x, -depth)])


def test_the_tip_sticks_until_static_friction_and_slips_to_kinetic(scene):
    finger = {"stiffness_n_per_mm": 0.05, "normal_n_per_mm": 0.1, "static_friction": 1.2, "kinetic_friction": 0.7}
    u = strain.deflection(place(np.arange(0, 40, 0.1)), finger, stick_slip=True)[:, 0]
    # N = 0.5 N: it holds to 1.2 * 0.5 / 0.05 = 12 mm and slips back to 7 mm.
    assert u.max() == pytest.approx(12.0, abs=0.11)
    slips = np.flatnonzero(np.diff(u) < -1)
    assert len(slips) == 6 and u[slips + 1] == pytest.approx(7.0)
    assert np.diff(u)[np.diff(u) > 0] == pytest.approx(0.1)
    smooth = strain.deflection(place(np.arange(0, 40, 0.1)), finger, stick_slip=False)[:, 0]
    assert smooth.max() == pytest.approx(7.0) and (np.diff(smooth) > -1e-9).all()
    assert not strain.deflection(place(np.arange(0, 40, 0.1), depth=0.0), finger, stick_slip=True).any()


def test_relaxation_and_asymmetry(scene):
    strand = scene["strand"]
    step = np.concatenate([np.zeros((200, 1)), np.ones((20000, 1))])
    response = strain.relaxed(step, strand)[200:, 0]
    assert response[0] > 0.95 and (np.diff(response) < 1e-12).all()
    assert response[-1] == pytest.approx(1 - strand["fast_share"] - strand["slow_share"], abs=1e-3)
    up = strain.asymmetric(step, strand)[200:, 0]
    down = 1 - strain.asymmetric(1 - step, strand)[200:, 0]
    assert np.argmax(up > 0.9) < np.argmax(down > 0.9)  # unloading lags


def test_each_task_moves_in_its_own_directions(scene):
    motion = scene["motion"]
    spans = {r.condition: np.ptp(r.place_mm, axis=0) for r in strain.recordings(scene)}
    assert (spans["task_1"][:2] == 0).all() and 0 < spans["task_1"][2] <= motion["depth_mm"]
    assert spans["task_2"][2] == 0 and (spans["task_2"][:2] > 0).all()
    assert (spans["task_0"] > 0).all() and spans["task_0"][0] <= motion["width_mm"]


def test_logs_have_the_samples_asked_for_and_repeat(scene):
    recording = strain.recordings(scene)[1]
    first, again = (strain.logs_of(recording, scene) for _ in range(2))
    assert first == again
    lines, faults = first["daq.log"]
    kinds = [fault.kind for fault in faults]
    assert len(lines) == 300 - kinds.count("missing") + kinds.count("duplicated")
    truth, _ = first["truth.csv"]
    assert truth[0].startswith("t_s,drift0") and len(truth) == 301


@pytest.mark.parametrize("effect", ["relaxation", "asymmetry", "drift", "noise", "stick_slip", "jitter", "line_faults"])
def test_every_effect_can_be_switched_off_and_changes_the_log(scene, effect):
    recording = strain.recordings(scene)[2]
    scene["effects"] = dict.fromkeys(scene["effects"], True)
    off = copy.deepcopy(scene)
    off["effects"][effect] = False
    assert strain.logs_of(recording, off)["daq.log"] != strain.logs_of(recording, scene)["daq.log"]
    if effect == "drift":
        truth, _ = strain.logs_of(recording, off)["truth.csv"]
        assert not np.loadtxt(truth, delimiter=",", skiprows=1)[:, 1:].any()
