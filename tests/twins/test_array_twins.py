"""The statistics of arrays under one contact and two, of made-up ones whose answers are known."""

import numpy as np
import pandas as pd
import pytest
from builders import array_contacts, contact_frames
from builders.project import ROOT

from pipeline.twins import array_recorded as twins
from tactile.base import params
from tactile.sheet.cycles import Press

PLACES = (-0.1, 0.1)  # of the scene below, in pitches from the middle of an element
RECORDED = (41, 72), 4.8
EFFECTS = {"noise": 0.01, "beside": 0.2, "line": -0.02, "crossing": -0.04, "two": -0.05, "row": -0.1, "col": -0.3}
NAMES = {"noise": "noise", "beside": "beside", "line": "along_line", "crossing": "crossing"}
NAMES |= {"two": "two_over_one", "row": "in_row", "col": "in_column"}
NEAR = {"noise": 0.001, "beside": 0.01, "along_line": 0.002, "crossing": 0.005, "two_over_one": 0.01}
NEAR |= {"in_row": 0.02, "in_column": 0.02}
VALUES = params.load(ROOT / "params.yaml")


def persons(rng, number=3, n=500, change=lambda frames: frames, gains=None, sensor=RECORDED, **effects):
    """The sessions of persons under fingers; gains: person -> log gains (rows, cols)."""
    for person in range(number):
        for _ in range(2):
            place = array_contacts.places(n, *sensor, rng)
            size = np.exp(rng.normal(0, 0.3, (n, 2)))
            rise = array_contacts.respond(
                place, size, *sensor, rng, gains=0.0 if gains is None else gains(person), **effects
            )
            yield change(
                twins.Frames(f"P{person}", rise, place, np.where(np.isfinite(place[..., 0]), size, np.nan), 4.8)
            )


def table(frames, by_place=False):
    found = twins.statistics(frames, by_place)
    assert not found.duplicated(["recording", "statistic"]).any()
    return found.pivot(index="recording", columns="statistic", values="value")


def assert_found(found: pd.DataFrame, effects):
    for effect, name in NAMES.items():
        assert found[name].dropna().to_numpy() == pytest.approx(effects.get(effect, 0.0), abs=NEAR[name]), name


def test_every_effect_is_measured_for_every_person():
    found = table(persons(np.random.default_rng(1), **EFFECTS))
    assert list(found.index) == ["P0", "P1", "P2"] and set(found) == set(twins.STATISTICS)
    assert_found(found, EFFECTS)


@pytest.mark.parametrize("effect", NAMES)
def test_each_effect_is_no_other(effect):
    """Alone it is found, and every other statistic is that of an array without it."""
    found = table(persons(np.random.default_rng(2), number=1, n=300, **{"noise": 0.002, effect: EFFECTS[effect]}))
    assert_found(found, {"noise": 0.002, effect: EFFECTS[effect]})


def test_statistics_are_free_of_units():
    other = lambda frames: frames._replace(rise=1e-3 * frames.rise, size=50 * frames.size)  # noqa: E731
    one, two = (table(persons(np.random.default_rng(3), 1, 300, change, **EFFECTS)) for change in (lambda f: f, other))
    assert two.to_numpy() == pytest.approx(one.to_numpy())


def test_an_array_that_is_turned_by_90_degrees_has_its_rows_for_columns():
    turn = lambda f: f._replace(rise=f.rise.transpose(0, 2, 1), place_mm=f.place_mm[:, :, ::-1])  # noqa: E731
    one, two = (table(persons(np.random.default_rng(4), 1, 300, change, **EFFECTS)) for change in (lambda f: f, turn))
    assert one["in_row"].item() == pytest.approx(two["in_column"].item())
    assert one["in_column"].item() == pytest.approx(two["in_row"].item()) != pytest.approx(one["in_row"].item())
    same = ["along_line", "beside", "crossing", "noise", "two_over_one"]
    assert one[same].to_numpy() == pytest.approx(two[same].to_numpy())


def test_contacts_that_are_smaller_together_are_compared_with_single_ones_of_their_size():
    def smaller(frames):
        double = np.isfinite(frames.size[:, 1:])
        share = np.where(double, 0.7, 1.0)
        at = np.nan_to_num(frames.place_mm / 4.8).astype(int)
        rise = frames.rise.copy()
        for one in (0, 1):
            rows = np.flatnonzero(np.isfinite(frames.size[:, one]))
            rise[rows, at[rows, one, 0], at[rows, one, 1]] *= share[rows, 0] ** array_contacts.EXPONENT
        return frames._replace(rise=rise, size=frames.size * share)

    found = table(persons(np.random.default_rng(5), 1, change=smaller, two=-0.05))
    assert found["two_over_one"].item() == pytest.approx(-0.05, abs=0.01)


@pytest.mark.parametrize("spread", [0.0, 0.05, 0.2])
def test_the_spread_of_gains_is_what_persons_share(spread):
    """Neither what one person alone has, nor noise of a reading, is a spread between elements."""
    rng = np.random.default_rng(6)
    shared = rng.normal(0, 1, (20, 30))
    own = [np.random.default_rng(k).normal(0, 0.1, shared.shape) for k in range(3)]
    gains = lambda person: spread * shared + own[person]  # noqa: E731
    found = table(persons(rng, n=600, gains=gains, sensor=((20, 30), 4.8), noise=0.02))["gain_spread"]
    assert found.to_numpy() == pytest.approx(spread, abs=0.012 if spread else 0.03)


def test_contacts_of_which_few_are_there_give_no_number():
    frames = next(persons(np.random.default_rng(7), 1, 300, **EFFECTS))
    few = np.r_[np.flatnonzero(np.isfinite(frames.size[:, 1]))[:4], np.flatnonzero(np.isnan(frames.size[:, 1]))]
    found = table([frames._replace(rise=frames.rise[few], place_mm=frames.place_mm[few], size=frames.size[few])])
    assert {"noise", "along_line"} <= set(found) and not {"crossing", "two_over_one", "in_row", "in_column"} & set(
        found
    )


def scene(workspace, seed, **made):
    """The statistics of presses of the made-up scene."""
    array_contacts.scene(workspace.frames("touch"), np.random.default_rng(seed), **made)
    return twins.simulated(workspace, VALUES).pivot(index="recording", columns="statistic", values="value")


def test_the_scene_is_measured_from_its_presses(workspace):
    """Above its own rest, of the first array alone, and each place against the presses at that place."""
    found = scene(workspace, 8, specimens=2, **EFFECTS)
    assert_found(
        found.drop(index=[name for name in found.index if name.startswith("place")]),
        EFFECTS | {"noise": 0.01 / np.sqrt(16.5)},
    )
    assert set(found.index) == {*(f"set {k}" for k in range(4)), *(f"place {y} {x}" for y in PLACES for x in PLACES)}


def test_the_spread_of_the_scenes_gains_is_that_of_its_elements(workspace):
    gains = np.random.default_rng(9).normal(0, 0.2, array_contacts.SCENE[0])
    found = scene(workspace, 8, gains=gains)
    assert found["gain_spread"].dropna().to_numpy() == pytest.approx(gains.std(), rel=0.1)
    assert found["two_over_one"].dropna().to_numpy() == pytest.approx(0, abs=0.01)


@pytest.mark.parametrize("late", [0, 10])
def test_a_press_is_read_while_all_tips_press(late):
    force = np.zeros((60, 2))
    force[10:40, 0], force[10 + late : 50, 1] = 20, 5
    assert twins.held(force, Press(10, 50, 10, 49)) == (10 + late + 40) // 2
    force[:, 1] = np.nan
    assert twins.held(force, Press(10, 40, 10, 39)) == 25
    force[:, 1] = 0.0
    force[42:50, 1] = 5.0
    assert twins.held(force, Press(10, 50, 10, 49)) is None


def test_recorded_frames_are_read_as_they_lie(workspace):
    folder = workspace.sources / "array_recorded" / "P03" / "2" / "npz"
    pixel = 4.8 / 8
    contact_frames.save(folder / "0.npz", contact_frames.mask_of([(84, 204)]))  # the middle of element 10, 25
    contact_frames.save(folder / "1.npz", contact_frames.mask_of([(84, 204), (204, 324)]), in_contact=255)
    contact_frames.save(folder / "2.npz", contact_frames.mask_of([(50, 50), (84, 204), (204, 324)]))
    contact_frames.save(folder / "3.npz", contact_frames.mask_of([(88, 208)], radius=3.0))  # covers no element
    (frames,) = twins.recorded_frames(workspace)
    assert frames.unit == "P03" and frames.rise.shape == (3, 41, 72) and frames.pitch_mm == 4.8
    expected = np.full((3, 2, 2), np.nan)
    expected[0, 0] = expected[1, 0] = 84 * pixel, 204 * pixel
    expected[1, 1], expected[2, 0] = (204 * pixel, 324 * pixel), (88 * pixel, 208 * pixel)
    np.testing.assert_allclose(frames.place_mm, expected)
    assert frames.size[0, 0] == pytest.approx(contact_frames.mask_of([(84, 204)]).sum() * pixel**2)
    np.testing.assert_array_equal(np.isfinite(frames.size), [[True, False], [True, True], [False, False]])
    found = twins.contacts(frames)
    assert found[found["frame"] == 0][["row", "col", "reading"]].to_numpy().tolist() == [[10, 25, 380]]
