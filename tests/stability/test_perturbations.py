"""Perturbations: nothing at severity 0, nested at others, and each does to the readings what its name says."""

import numpy as np
import pytest

from pipeline.stability import loop, perturbations
from tactile.base import stress_tests
from tactile.base.errors import InputError
from tactile.datasets.seeding import generator
from tactile.settings import stress

ELEMENTS, FRAMES = 6, 8
SETTINGS = {
    "noise": {"span": 100.0},
    "gain_drift": {"rest": np.full(ELEMENTS, 5.0)},
    "offset_drift": {"span": 100.0},
    "dead": {"low": 0.0},
    "stuck": {},
    "dead_line": {"rows": 2, "cols": 3, "low": 0.0},
    "lost_frames": {},
    "jitter": {},
}


def readings() -> np.ndarray:
    return generator(1, "readings").uniform(5, 100, (4, FRAMES, ELEMENTS)).astype(np.float32)


def perturbed(name: str, severity: float, x: np.ndarray | None = None) -> np.ndarray:
    x = readings() if x is None else x
    return getattr(perturbations, name)(x, severity, generator(0, name), **SETTINGS[name])


def changed(name: str, severity: float) -> set[int]:
    different = (perturbed(name, severity) != readings()).any(axis=(0, 1))
    return set(np.flatnonzero(different).tolist())


@pytest.mark.parametrize("name", SETTINGS)
def test_severity_0_returns_equal_readings_in_a_new_array(name):
    x = readings()
    result = perturbed(name, 0, x)
    assert np.array_equal(result, x) and result is not x and result.dtype == x.dtype
    result[:] = -1
    assert (x > 0).all()


@pytest.mark.parametrize("name", SETTINGS)
def test_the_readings_given_stay_as_they_were_and_a_seed_repeats(name):
    x = readings()
    first = perturbed(name, 1, x)
    assert np.array_equal(x, readings()) and not np.array_equal(first, x)
    assert np.array_equal(first, perturbed(name, 1, x))


def test_noise_and_drift_have_the_spread_that_the_severity_names():
    x, rng = np.full((200, 5, 400), 50.0), generator(0, "spread")
    noise = perturbations.noise(x, 0.1, rng, span=100.0) - x
    assert noise.std() == pytest.approx(10, rel=0.02) and noise.std(axis=(0, 1)).mean() == pytest.approx(10, rel=0.02)
    offset = perturbations.offset_drift(x, 0.1, rng, span=100.0) - x
    assert offset[0, 0].std() == pytest.approx(10, rel=0.1) and np.ptp(offset, axis=(0, 1)).max() == 0
    gain = (perturbations.gain_drift(x, 0.1, rng, rest=np.full(400, 5.0)) - 5) / (x - 5)
    assert np.log(gain[0, 0]).std() == pytest.approx(0.1, rel=0.1) and np.ptp(gain, axis=(0, 1)).max() < 1e-12
    number = np.arange(1e5).reshape(1, -1, 1)
    assert np.mean(perturbations.lost_frames(number, 0.3, rng) != number) == pytest.approx(0.3, abs=0.01)


@pytest.mark.parametrize("name", ["noise", "offset_drift"])
def test_a_higher_severity_is_the_same_draw_scaled(name):
    x = readings()
    once, twice = perturbed(name, 0.1) - x, perturbed(name, 0.2) - x
    assert np.allclose(twice, 2 * once, atol=1e-3)


@pytest.mark.parametrize("name", ["dead", "stuck"])
def test_failed_elements_are_as_many_as_the_severity_and_nested(name):
    sets = [changed(name, severity) for severity in range(ELEMENTS + 1)]
    assert [len(one) for one in sets] == list(range(ELEMENTS + 1))
    assert all(fewer < more for fewer, more in zip(sets[:-1], sets[1:], strict=True))


def test_a_dead_line_is_a_whole_row_or_column():
    grid = np.arange(ELEMENTS).reshape(2, 3)
    lines = [set(line.tolist()) for line in (*grid, *grid.T)]
    one, two = changed("dead_line", 1), changed("dead_line", 2)
    assert one in lines and one < two
    assert changed("dead_line", 5) == set(range(ELEMENTS))


def test_a_stuck_element_keeps_a_value_it_has_read():
    result, x = perturbed("stuck", 1), readings()
    (element,) = changed("stuck", 1)
    assert len(np.unique(result[..., element])) == 1 and result[0, 0, element] in x[..., element]


def test_gain_drift_scales_the_response_and_keeps_rest():
    x = readings()
    x[0, 0] = 5.0
    result = perturbed("gain_drift", 0.5, x)
    gain = (result[1:] - 5) / (x[1:] - 5)
    assert np.allclose(result[0, 0], 5) and np.allclose(gain, gain[:1, :1], rtol=1e-3) and np.ptp(gain[0, 0]) > 0.1


def test_a_lost_frame_repeats_the_one_before():
    x = readings()
    assert np.array_equal(perturbed("lost_frames", 1), np.repeat(x[:, :1], FRAMES, axis=1))
    some = perturbed("lost_frames", 0.5)
    lost = (some != x).all(axis=2)
    assert 0.2 < lost[:, 1:].mean() < 0.8 and not lost[:, 0].any()
    for window, frame in np.argwhere(lost):
        assert np.array_equal(some[window, frame], some[window, frame - 1])


def test_jitter_stays_between_neighbours_in_time():
    ramp = np.broadcast_to(np.arange(FRAMES, dtype=np.float32)[:, None], (50, FRAMES, ELEMENTS)).copy()
    late = perturbed("jitter", 0.1, ramp) - ramp
    assert late.min() > -0.6 and late.max() < 0.6 and 0.05 < late[:, 1:-1].std() < 0.15
    assert perturbed("jitter", 5, ramp).min() >= 0 and perturbed("jitter", 5, ramp).max() <= FRAMES - 1


@pytest.mark.parametrize(("name", "severity"), [("dead", 1.5), ("dead", ELEMENTS + 1), ("stuck", -1), ("dead_line", 6)])
def test_elements_that_cannot_fail_are_refused(name, severity):
    with pytest.raises(InputError, match="give a whole number"):
        perturbed(name, severity)


def test_unknown_names_are_refused_and_recordings_have_no_scene():
    def planned(settings, asked):
        values = {"glove": settings, "stress": {"glove": {"perturbations": asked}}}
        return {test.name: own for test, own in stress_tests.planned(values, "glove", "images").items()}

    with pytest.raises(InputError, match="stress.glove.perturbations: unknown key 'deads'; did you mean 'dead'"):
        planned({"simulate": {}}, {"deads": [1]})
    with pytest.raises(InputError, match="unknown key 'grip'"):
        planned({}, {"grip": [1]})
    asked = {"grip": [1], "noise": [2, 1]}
    assert planned({"simulate": {}, "source": "simulated"}, asked) == {"grip": [1], "noise": [1, 2]}
    assert planned({"simulate": {}, "source": "data/own"}, asked) == {"noise": [1, 2]}


def test_settings_know_what_the_code_registers_and_code_that_cannot_be_read_is_named(tmp_path):
    registered = {
        (of, name, test.unit) for of, tests in stress_tests.REGISTERED.items() for name, test in tests.items()
    }
    assert registered == {(of, name, test.unit) for of, name, test in stress.TESTS} and len(registered) > 30
    file = tmp_path / "stability" / "own.py"
    file.parent.mkdir()
    for arguments in ("KIND, unit='mm'", "'windows', unit=MM", "'windows'"):
        file.write_text(f"@stress_test({arguments})\ndef hole():\n    pass\n")
        with pytest.raises(TypeError, match=r"pipeline/stability/own.py, hole: give @stress_test a unit"):
            list(stress.declared(file))


def test_rows_of_a_scene_stand_by_condition_those_of_severity_0_first():
    scored = [(severity, condition, []) for severity in (0, -2, 2) for condition in ("double", "anew")]
    wanted = [(0, "double"), (0, "anew"), (-2, "double"), (2, "double"), (-2, "anew"), (2, "anew")]
    assert [row[:2] for row in loop.by_condition(scored)] == wanted
