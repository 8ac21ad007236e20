"""Statistics of the taxel on courses whose answers are known, and the scene's twin on a made-up force."""

import numpy as np
import pytest
from builders.project import ROOT

from pipeline.scenes import touch_contact
from pipeline.twins import touch as twins
from tactile.base import params

STEP = 0.02
REST, LOAD = 6.0, 3.0


def made(places=None, creep=0.0, overshoot=0.0, leak_s=1.0, noise=0.0, hold_s=1.2, delay_s=0.0, seed=0):
    """16 presses to 20 N: 0.5 s up, a hold, 0.1 s down, 4 s of rest; log reading REST - LOAD x relative force."""
    places = np.zeros(twins.PRESSES) if places is None else places
    ramp, fall = np.linspace(0, 1, 25, endpoint=False), np.linspace(1, 0, 6)
    hold, rest = np.ones(round(hold_s / STEP)), np.zeros(200)
    share, add = [rest], [np.zeros(200)]
    for place in places:
        held = creep * np.exp(-np.arange(len(hold)) * STEP / 0.3)
        share += [ramp, hold, fall, rest]
        add += [place * ramp, place + held, place * fall, overshoot * np.exp(-np.arange(200) * STEP / leak_s)]
    share, add = np.concatenate(share), np.concatenate(add)
    z = REST - LOAD * share + add
    z = np.concatenate([np.full(round(delay_s / STEP), REST), z])[: len(share)]
    z = z + np.random.default_rng(seed).normal(0, noise, len(z))
    return twins.Course(np.arange(len(share)) * STEP, 20 * share, z)


def test_every_press_is_found():
    found = twins.presses(made())
    assert len(found) == 16
    assert all((press.left - press.reached) * STEP == pytest.approx(1.2, abs=0.15) for press in found)


def test_a_course_without_memory_has_none():
    plain = twins.of_one(made())
    assert plain["response"] == pytest.approx(LOAD)
    for name in ("creep_press", "overshoot", "rest_spread", "place_spread", "noise"):
        assert plain[name] == pytest.approx(0, abs=1e-9), name
    assert abs(plain["loading_loop"]) < 1e-9 and "creep_long" not in plain


def test_creep_overshoot_and_noise_are_what_was_made():
    creeping = twins.of_one(made(creep=0.2, hold_s=4.0))
    assert creeping["creep_press"] == pytest.approx(0.2 * np.exp(-1), rel=0.3)
    assert creeping["creep_long"] == pytest.approx(0.2 * np.exp(-0.8 / 0.3), rel=0.1)
    over = twins.of_one(made(overshoot=0.3, leak_s=1.0))
    assert over["overshoot"] == pytest.approx(0.3 * np.exp(-0.2), rel=0.1)
    assert over["recovery"] == pytest.approx(np.exp(-1.8), abs=0.05)
    assert twins.of_one(made(noise=0.02))["noise"] == pytest.approx(0.02, rel=0.1)


def test_a_delayed_reading_has_a_loop():
    assert twins.of_one(made(delay_s=0.04))["loading_loop"] > 0.1


def test_places_spread_and_repeat():
    places = np.linspace(-1, 1, 16)
    assert twins.of_one(made(places))["place_spread"] == pytest.approx(places.std())
    assert twins.of_pair(made(places), made(places))["repeatability"] == pytest.approx(0, abs=1e-9)
    moved = places + 0.1 * (-1.0) ** np.arange(16)
    assert twins.of_pair(made(places), made(moved))["repeatability"] == pytest.approx(0.1)


def test_the_past_helps_only_where_there_is_memory():
    plain = twins.of_pair(made(), made())
    assert plain["r2_present"] > 0.999 and abs(plain["gain_from_past"]) < 1e-3
    late = [made(delay_s=0.3, noise=0.01, seed=seed) for seed in (1, 2)]
    found = twins.of_pair(*late)
    assert found["r2_past"] == pytest.approx(found["r2_present"] + found["gain_from_past"])
    lasting = [made(creep=1.5, noise=0.01, seed=seed) for seed in (1, 2)]
    assert twins.of_pair(*lasting)["gain_from_past"] > 0.01


def test_statistics_are_named_and_come_per_recording():
    table = twins.statistics({"made": [made(overshoot=0.3, hold_s=4.0), made(overshoot=0.3, hold_s=4.0)]})
    assert list(table.columns) == twins.COLUMNS
    assert set(table.statistic) == set(twins.STATISTICS)
    assert set(table.recording) == {"made", "made/exp1", "made/exp2"}


def test_two_repetitions_of_the_twin_differ_by_the_repeat_spread():
    block, course, found = params.load(ROOT / "params.yaml")["touch"], made(), {}
    for on in (False, True):
        block["simulate"]["effects"] |= {"noise": False, "repeats": on}
        pairs = [[twins.twin(course, 12, f"made{k}/exp{n}", block) for n in (1, 2)] for k in range(20 if on else 2)]
        found[on] = np.sqrt(np.mean([twins.of_pair(*pair)["repeatability"] ** 2 for pair in pairs]))
    assert found[False] < 1e-9
    assert found[True] == pytest.approx(np.sqrt(2) * block["simulate"]["material"]["repeat_spread"], rel=0.2)


def test_the_twin_presses_the_places_of_its_element():
    block = params.load(ROOT / "params.yaml")["touch"]
    block["simulate"]["effects"] |= {"noise": False}
    course = made()
    twin = twins.twin(course, 12, "made", block)
    assert np.array_equal(twin.force_n, course.force_n)
    found = twins.of_one(twin)
    assert found["response"] > 1 and found["overshoot"] > 0.02
    length = block["simulate"]["material"]["correlation_mm"]
    log_gain = np.log(touch_contact.film_at(twins.places_of(12, block["simulate"], block["sensor"]), length)[0])
    held = [twin.log_reading[press.left - 5 : press.left + 1].mean() for press in twins.presses(twin)]
    assert np.corrcoef(held, log_gain)[0, 1] < -0.9  # more gain, less resistance
    block["simulate"]["effects"]["places"] = False
    assert twins.of_one(twins.twin(course, 12, "made", block))["place_spread"] < 0.2 * found["place_spread"]
