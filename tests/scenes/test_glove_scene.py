"""The glove scene: its physics, its determinism, and that every effect can be switched off."""

import numpy as np
import pytest
from builders.project import ROOT

from pipeline.scenes import glove
from tactile.base import params

QUIET = {"session": False, "wander": False, "element_spread": False, "noise": False, "line_faults": False}


@pytest.fixture(scope="module")
def settings():
    block = params.load(ROOT / "params.yaml")["glove"]
    simulate = block["simulate"] | {"specimens": 2, "sessions": 2, "frames_per_object": 20}
    return block | {"simulate": simulate}


def scene(settings, **effects):
    simulate = settings["simulate"]
    return simulate | {"circuit": simulate["circuit"] | settings["sensor"], "effects": simulate["effects"] | effects}


def still(settings, name, **effects):
    """Force on area (a), joint angles and contact of one undisturbed frame."""
    block = scene(settings, **(QUIET | effects))
    hold = glove.held(1, block, np.random.default_rng(0))
    thing = glove.OBJECTS[name]
    angles, contact = glove.posture(thing, hold)
    return glove.pressed(thing, hold, contact, block)[0], angles[0], contact[0]


def test_sixteen_objects_and_the_published_number_of_units(settings):
    assert len(glove.OBJECTS) == 16 and len(glove.plan(settings)[0]) == 64
    block = params.load(ROOT / "params.yaml")["glove"]
    pressure, strain = glove.conductances(
        glove.OBJECTS["can"], glove.held(1, scene(block), np.random.default_rng(0)), scene(block)
    )
    assert np.isfinite(pressure[0]).sum() == 243
    assert np.isfinite(strain[0]).sum() == 126
    assert (pressure.shape[1:], strain.shape[1:]) == (glove.PRESSURE, glove.STRAIN)


def test_a_finger_turns_once_around_an_object():
    for name, thing in glove.OBJECTS.items():
        if thing and not glove.GRIPS[thing.grip].closed_deg:
            around = 2 * (thing.width_mm + thing.depth_mm) + 8 * glove.FINGER_MM * np.pi
            assert glove.turning(np.array([around]), thing, np.ones(1)) == pytest.approx(360), name
            assert glove.turning(np.zeros(1), thing, np.ones(1)) == 0


def test_on_a_cylinder_a_joint_turns_by_its_phalanges_over_the_radius(settings):
    _, angles, _ = still(settings, "can")
    thing = glove.OBJECTS["can"]
    radius = thing.corner_mm + glove.FINGER_MM
    lengths = glove.PHALANGES_MM[2]
    expected = np.degrees((lengths[0] + lengths[1]) / 2 / radius)
    assert angles[2, 1] == pytest.approx(expected)
    assert angles[2, 1] < still(settings, "full_bottle_2")[1][2, 1]  # the thinner, the more bent


def test_heavier_means_firmer_and_bottles_differ_in_nothing_else(settings):
    empty, full = (still(settings, name) for name in ("empty_bottle", "full_bottle_1"))
    assert full[0].sum() > 1.4 * empty[0].sum()
    assert np.array_equal(full[1], empty[1])  # the same shape: the same joint angles


def test_the_fingers_carry_the_grip_force(settings):
    force, _, _ = still(settings, "can")
    thing, session = glove.OBJECTS["can"], settings["simulate"]["session"]
    grip = session["margin"] * thing.mass_g / 1000 * 9.81 / (2 * thing.friction) + session["least_grip_n"]
    assert force[3:, :9].sum() == pytest.approx(grip)
    assert force[3:, 9:].sum() == pytest.approx(glove.GRIPS["wrap"].palm * grip)
    assert (force[:3, 9:] == 0).all()  # nothing is wired there


def test_a_short_object_misses_the_outer_fingers(settings, monkeypatch):
    monkeypatch.setitem(glove.OBJECTS, "stub", glove.Thing(92, 92, 46, 48, 140, 30, 0.5))
    force, angles, contact = still(settings, "stub")
    assert (contact[[1, 4]] == 0).all() and (contact[[2, 3]] > 0).any()
    assert (angles[4] == 0.85 * glove.LIMITS_DEG).all()
    assert force[12:, :9].sum() == 0


def test_every_grip_has_its_objects_and_between_pads_the_palm_stays_free(settings):
    grips = {name: thing.grip for name, thing in glove.OBJECTS.items() if thing}
    assert set(grips.values()) == set(glove.GRIPS)
    for name, grip in grips.items():
        force, _, _ = still(settings, name)
        thumb, fingers, palm = force[:3, :9].sum(), force[3:, :9].sum(), force[3:, 9:].sum()
        assert (palm > 0) == (grip == "wrap"), name
        if glove.GRIPS[grip].closed_deg:
            assert thumb == pytest.approx(fingers), name  # the pads oppose each other


def test_pads_open_by_the_side_that_they_hold(settings, monkeypatch):
    """At small openings the tips move apart by the object's thickness: angle times lever, for both joints."""
    closed = np.array(glove.GRIPS["pinch"].closed_deg)
    for side in (10.0, 20.0):
        monkeypatch.setitem(glove.OBJECTS, "plate", glove.Thing(100, side, 1, 200, 100, 50, 0.5, grip="pinch"))
        back = np.radians(closed - still(settings, "plate")[1])
        levers = np.cumsum(glove.PHALANGES_MM[:, ::-1], axis=1)[:, ::-1]  # of each joint to the tip
        assert (back * levers).sum(axis=1) == pytest.approx(side / 2)


def test_fingers_that_take_no_part_stay_curled(settings):
    force, angles, _ = still(settings, "magic_cube")
    assert (angles[3:] == glove.CURLED).all() and force[9:, :9].sum() == 0
    assert force[3:9, :9].sum() > 0


def test_the_specimen_is_the_glove_and_the_seed_what_is_done_with_it(settings):
    block = scene(settings, noise=False, line_faults=False)
    recording = glove.Recording("toy", "session00")
    hold = glove.held(5, block, np.random.default_rng(0))
    first, other = (glove.conductances(glove.OBJECTS["toy"], hold, block | {"specimen": k}) for k in (1, 2))
    ratio = other[0] / first[0]
    assert np.nanstd(np.log(ratio)) > 0.1 and np.nanmax(np.ptp(ratio, axis=0)) < 1e-9  # gains, the same in all frames
    moved = glove.conductances(glove.OBJECTS["toy"], hold, block | {"specimen": 1, "seed": block["seed"] + 1})
    assert np.array_equal(moved[0], first[0], equal_nan=True)
    assert glove.logs_of(recording, block) != glove.logs_of(recording, block | {"seed": block["seed"] + 1})


def test_wandering_moves_variance_from_between_sessions_to_within(settings):
    """Of all that differs between sessions: what stayed through one would name it."""
    spreads = {}
    for share in (0.2, 0.8):
        block = scene(settings)
        block |= {"session": block["session"] | {"wander": share}}
        holds = [glove.held(50, block, np.random.default_rng(k)) for k in range(100)]
        for name in glove.Hold._fields:
            held = np.array([getattr(hold, name) for hold in holds])
            held = np.log(held) if name in ("margin", "share", "seat") else held
            spreads[share, name] = (held.mean(axis=1).std(), held.std(axis=1).mean(), held[:, -1].std())
    for name in glove.Hold._fields:
        few, much = spreads[0.2, name], spreads[0.8, name]
        assert few[0] > 1.1 * much[0] and few[1] < 0.7 * much[1], name
        assert few[2] == pytest.approx(much[2], rel=0.3), name  # of 100 sessions, one number of each
    for name, spread in (("seat", "seat_spread"), ("fit", "fit_deg")):
        assert spreads[0.8, name][2] == pytest.approx(settings["simulate"]["session"][spread], rel=0.05)


def test_the_hand_shifts_no_further_than_all_fingers_find_the_object(settings):
    def shift(name):
        holds = [glove.held(20, scene(settings), np.random.default_rng(k), glove.OBJECTS[name]) for k in range(30)]
        return np.abs([hold.across for hold in holds]).max()

    assert shift("cup_1") == 0 and shift("tennis_ball") == 0
    assert shift("mouse") <= 55 - glove.HAND_MM / 2 < shift("empty_bottle")
    assert glove.HAND_MM == np.ptp(glove.ACROSS_MM[1:]) + 2 * glove.FINGER_MM


def test_fingers_share_what_changes_their_phalanges(settings):
    share = np.log(glove.held(5, scene(settings), np.random.default_rng(0)).share)
    assert np.allclose(share - share[:, :1], (share - share[:, :1])[:, :, :1])  # a finger's own factor is left


def test_softness_spreads_pressure(settings):
    hard, soft = (still(settings, "toy", softness=on)[0][3:, 9:] for on in (False, True))
    assert (soft > 0).sum() > (hard > 0).sum()
    assert soft.sum() == pytest.approx(hard.sum())


def test_frames_of_a_session_are_more_alike_than_sessions(settings):
    block = scene(settings, line_faults=False)
    block = block | {"sessions": 4, "frames_per_object": 40}
    runs = []
    for k in range(4):
        lines, _ = glove.logs_of(glove.Recording("can", f"session{k:02d}"), block)["scanner.log"]
        runs.append(np.array([line.split(",") for line in lines], float)[:, 1:])
    within = np.mean([run.std(axis=0).mean() for run in runs])
    between = np.std([run.mean(axis=0) for run in runs], axis=0).mean()
    assert 0 < within < between
