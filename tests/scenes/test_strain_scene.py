"""Strain scene: contact with friction, strands, drift, and the logs that are written."""

import copy

import numpy as np
import pytest
from builders.project import ROOT

from pipeline.scenes import strain
from tactile.base import params

FINGER = {"stiffness_n_per_mm": 0.05, "normal_n_per_mm": 0.1, "static_friction": 1.2, "kinetic_friction": 0.7}
STRANDS = 6


@pytest.fixture
def scene():
    """The block strain.simulate, 60 s long."""
    settings = copy.deepcopy(params.load(ROOT / "params.yaml")["strain"]["simulate"])
    settings["samples"] = 300
    settings["faults"] |= {"gaps": 1, "gap_s": 4}
    return settings


def place(x, depth=5.0):
    x = np.asarray(x, float)
    return np.column_stack([x, np.zeros_like(x), np.full_like(x, -depth)])


def test_the_tip_sticks_until_static_friction_and_slips_to_kinetic():
    u = strain.deflection(place(np.arange(0, 40, 0.1)), FINGER, stick_slip=True)[:, 0]
    # N = 0.5 N: it holds to 1.2 * 0.5 / 0.05 = 12 mm and slips back to 7 mm.
    assert u.max() == pytest.approx(12.0, abs=0.11)
    slips = np.flatnonzero(np.diff(u) < -1)
    assert len(slips) == 6 and u[slips + 1] == pytest.approx(7.0)
    assert np.diff(u)[np.diff(u) > 0] == pytest.approx(0.1)
    smooth = strain.deflection(place(np.arange(0, 40, 0.1)), FINGER, stick_slip=False)[:, 0]
    assert smooth.max() == pytest.approx(7.0) and (np.diff(smooth) > -1e-9).all()
    assert not strain.deflection(place(np.arange(0, 40, 0.1), depth=0.0), FINGER, stick_slip=True).any()


def test_friction_differs_by_direction_and_by_place():
    grip = np.ones((41, 41))
    grip[20:] = 1.5  # from x = 0 on; cells of 2 mm
    surface = strain.Surface(grip, (0.0, 0.0))
    forth = strain.deflection(place(np.arange(-40, 40, 0.1)), FINGER, stick_slip=True, surface=surface)[:, 0]
    assert forth[:390].max() == pytest.approx(12.0, abs=0.11) and forth[600:].max() == pytest.approx(18.0, abs=0.11)
    skin = strain.Surface(np.ones((1, 1)), (0.25, 0.0))
    there = strain.deflection(place(np.arange(0, 40, 0.1)), FINGER, stick_slip=True, surface=skin)[:, 0]
    back = strain.deflection(place(-np.arange(0, 40, 0.1)), FINGER, stick_slip=True, surface=skin)[:, 0]
    assert there.max() == pytest.approx(15.0, abs=0.11) and back.min() == pytest.approx(-9.0, abs=0.11)


def test_a_surface_has_the_spread_and_the_correlation_length_asked_for():
    finger = {"friction_spread": 0.2, "friction_length_mm": 20.0, "friction_direction": 0.3}
    fields = [np.log(strain.surface_of(k, (140, 80), finger).grip) for k in range(12)]
    assert np.std(fields) == pytest.approx(0.2, rel=0.15)
    cells = round(20 / strain.CELL_MM)
    correlation = np.mean([(f[cells:] * f[:-cells]).mean() / f.var() for f in fields])
    assert correlation == pytest.approx(np.exp(-0.5), abs=0.15)  # of a normal density of wave numbers
    assert np.hypot(*strain.surface_of(0, (140, 80), finger).along) == pytest.approx(0.3)


def test_a_strand_answers_to_what_bends_it_beyond_its_slack(scene):
    """Dragged along x at a fixed depth, a finger bends by 5 mm less 1.5 mm of compression, and by 12 mm of drag."""
    scene["effects"]["friction_spread"] = False
    scene["finger"] |= FINGER | {"press_bending": 1.0, "compression": 0.3, "lean": 0.0}
    scene["strand"] |= {"gain_spread": 0.0, "angle_spread_deg": 0.0, "slack_mm": 1.2}
    turn = np.cos(np.radians(strain.angles_deg(STRANDS)))
    for way in (1, -1):
        path = place(way * np.arange(0, 12, 0.1))
        found = strain.strains(strain.Recording("task_2", "run000", 0, path), scene, STRANDS)[-1]
        wanted = scene["strand"]["sensitivity_per_mm"] * np.maximum((5 + way * 11.9) * turn - 1.5 - 1.2, 0)
        assert found == pytest.approx(wanted) and (found == 0).any() and (found > 0).any()


def test_paths_break_with_every_change_of_strain_and_form_again(scene):
    strand = scene["strand"] | {"break_spread": 0.0, "fast_time_s": 3.0, "slow_time_s": 60.0}
    step = np.concatenate([np.zeros((200, 1)), np.ones((20000, 1))])
    rng = np.random.default_rng(0)
    up = strain.relaxed(step, strand, rng)[200:, 0]
    assert up[0] == pytest.approx(1 + strand["fast_share"] + strand["slow_share"])
    assert (np.diff(up) < 0).all() and up[-1] == pytest.approx(1, abs=1e-3)
    down = strain.relaxed(1 - step, strand, rng)[200:, 0]
    assert down == pytest.approx(up - 1)  # resistance jumps up when the strain goes away, too
    minute = round(60 / strain.STEP_S)
    assert up[minute] - 1 == pytest.approx(strand["slow_share"] / np.e, rel=0.01)


def test_how_many_paths_break_varies_around_its_mean(scene):
    strand = scene["strand"] | {"break_spread": 1.0, "break_time_s": 0.5}
    steady = np.cumsum(np.full((20000, 40), 0.01), axis=0)
    off, on = (
        strain.relaxed(steady, strand | {"break_spread": spread}, np.random.default_rng(1)) - steady
        for spread in (0.0, 1.0)
    )
    assert on[5000:].mean() == pytest.approx(off[5000:].mean(), rel=0.02) and on[-1].std() > 20 * off[-1].std()


def test_unloading_lags_behind_loading():
    strand = {"loading_time_s": 0.1, "unloading_time_s": 0.8}
    step = np.concatenate([np.zeros((200, 1)), np.ones((2000, 1))])
    up = strain.asymmetric(step, strand)[200:, 0]
    down = 1 - strain.asymmetric(1 - step, strand)[200:, 0]
    assert np.argmax(up > 0.9) < np.argmax(down > 0.9)


def test_what_wanders_has_the_spread_and_the_correlation_time_asked_for():
    drawn = strain.wander(40000, 20, 5.0, np.random.default_rng(0))
    assert drawn.std() == pytest.approx(1, rel=0.05)
    lag = round(5 / strain.STEP_S)
    assert (drawn[lag:] * drawn[:-lag]).mean() == pytest.approx(np.exp(-1), abs=0.05)
    assert drawn[0].std() == pytest.approx(1, rel=0.4)  # from the first step on


def test_each_task_moves_in_its_own_directions(scene):
    motion = scene["motion"]
    spans = {r.condition: np.ptp(r.place_mm, axis=0) for r in strain.recordings(scene)}
    assert (spans["task_1"][:2] == 0).all() and 0 < spans["task_1"][2] <= motion["depth_mm"]
    assert spans["task_2"][2] == 0 and (spans["task_2"][:2] > 0).all()
    assert (spans["task_0"] > 0).all() and spans["task_0"][0] <= motion["width_mm"]


def test_every_recording_of_a_number_is_of_the_same_finger_and_moves_in_its_own_way(scene):
    planned = strain.recordings(scene | {"specimen": 7, "specimens": 3})
    assert len(planned) == 9 and {(r.name, r.specimen) for r in planned} == {
        ("run000", 7),
        ("run001", 8),
        ("run002", 9),
    }
    first, second = (r for r in planned if r.condition == "task_2" and r.specimen < 9)
    assert not np.allclose(first.place_mm, second.place_mm)
    other = strain.strains(first._replace(specimen=8), scene, STRANDS)
    assert not np.allclose(strain.strains(first, scene, STRANDS), other)
    moved = {**scene, "seed": scene["seed"] + 1}  # the seed moves the motion, and leaves the finger as it is
    assert np.array_equal(strain.strains(second._replace(specimen=8), moved, STRANDS), strain.strains(second, scene, 6))


@pytest.mark.parametrize("strands", [2, 3, 5, 6, 8])
def test_fewer_strands_are_the_first_ones_of_the_finger(scene, strands):
    recording = strain.recordings(scene)[0]
    whole, fewer = (strain.strains(recording, scene, n) for n in (8, strands))
    assert np.array_equal(fewer, whole[:, :strands])
    whole, fewer = (strain.responses(strain.strains(recording, scene, n), recording, scene) for n in (8, strands))
    assert np.array_equal(fewer, whole[:, :strands])
    whole, fewer = (strain.drifts(2000, n, scene, np.random.default_rng(1)) for n in (8, strands))
    assert np.array_equal(fewer, whole[:, :strands])
    assert np.linalg.matrix_rank(fewer) == strands  # each has a drift of its own
    assert len(set(strain.angles_deg(strands) % 360)) == strands
    lines, _ = strain.logs_of(recording, scene, strands)["truth.csv"]
    assert lines[0].count("drift") == strands
    turn = np.sort(strain.angles_deg(6) % 360)
    assert np.diff(turn) == pytest.approx(60)


def test_logs_have_the_samples_asked_for_and_repeat(scene):
    recording = strain.recordings(scene)[1]
    first, again = (strain.logs_of(recording, scene, STRANDS) for _ in range(2))
    assert first == again
    lines, faults = first["daq.log"]
    kinds = [fault.kind for fault in faults]
    assert len(lines) == 300 - kinds.count("missing") + kinds.count("duplicated")
    truth, _ = first["truth.csv"]
    assert truth[0].startswith("t_s,drift0") and len(truth) == 301


def test_drift_is_what_the_logs_have_where_nothing_else_differs_from_the_strain(scene):
    scene["effects"] |= {"relaxation": False, "asymmetry": False}
    recording = strain.recordings(scene)[-1]
    truth, _ = strain.logs_of(recording, scene, STRANDS)["truth.csv"]
    known = np.loadtxt(truth, delimiter=",", skiprows=1)
    clock_s, drift = strain.drift_at_samples(recording.condition, recording.name, scene, STRANDS)
    assert clock_s == pytest.approx(known[:, 0], abs=1e-4) and drift == pytest.approx(known[:, 1:], abs=1e-6)
    assert np.ptp(drift) > 1e-4


def test_what_a_strand_adds_is_all_that_is_not_strain(scene):
    recording = strain.recordings(scene)[0]
    scene["effects"] |= {"drift": False, "relaxation": False, "asymmetry": False}
    truth, _ = strain.logs_of(recording, scene, STRANDS)["truth.csv"]
    assert not np.loadtxt(truth, delimiter=",", skiprows=1)[:, 1:].any()
    for effect in ("drift", "relaxation"):
        scene["effects"][effect] = True
        truth, _ = strain.logs_of(recording, scene, STRANDS)["truth.csv"]
        assert np.abs(np.loadtxt(truth, delimiter=",", skiprows=1)[:, 1:]).max() > 1e-3
        scene["effects"][effect] = False
