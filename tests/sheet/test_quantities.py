"""Every line of a sheet, on sensors whose truth is known, and what logs cannot tell."""

import numpy as np
import pytest
from builders import pressed_sensors as made

from tactile.sheet import estimates, quantities
from tactile.sheet.cycles import Log, Sensor


def lines(*, presses=40, peaks=(made.FULL_N,), ramp_s=1.0, hold_s=2.0, rest_s=2.0, hz=made.HZ, one_clock=True, **truth):
    """Return the sheet of a single element of this truth, quantity -> estimate."""
    time, force = made.force(presses, peaks, ramp_s, hold_s, rest_s, hz)
    sensor = made.sensor(time, force, made.reading(time, force, **truth), one_clock=one_clock)
    return quantities.sheet(sensor).lines


def test_hysteresis_drift_and_linearity_are_recovered_within_a_tenth():
    truth = {"loop": 0.08, "bend": 0.05, "rest_per_h": 0.3, "gain_per_h": -0.2, "noise": 0.5}
    found = lines(presses=80, peaks=(20.0, 19.8), **truth)
    expected = {
        "span": made.SPAN,
        "sensitivity": made.SPAN / made.FULL_N,
        "non-linearity": 5.0,
        "hysteresis": 8.0,
        "drift of rest": 30.0,
        "drift of gain": -20.0,
        "noise at rest": 0.5,
        "noise, pressed": 0.5,
        "signal to noise": 20 * np.log10(made.SPAN / 0.5),
    }
    for name, value in expected.items():
        assert found[name].told and found[name].value == pytest.approx(value, rel=0.1), name
        assert found[name].low < found[name].value < found[name].high, name
        assert found[name].n == 80, name
    assert abs(found["creep, 1 s"].value) < 0.1


def test_the_sign_of_a_reading_that_falls_when_pressed_does_not_matter():
    time, force = made.force(40)
    reading = made.reading(time, force, loop=0.08, rest_per_h=0.3)
    rising, falling = (
        quantities.sheet(made.sensor(time, force, sign * reading + offset)).lines
        for sign, offset in ((1, 0), (-1, 900))
    )
    for name in ("span", "hysteresis", "non-linearity"):
        assert falling[name].value == pytest.approx(rising[name].value), name


@pytest.mark.parametrize("peaks", [(20.0,), (20.0, 17.0)])
def test_readings_that_are_clipped_bound_the_span(peaks):
    """Of equal presses and of unlike ones; a reading without noise, which no two presses change, is not clipped."""
    time, force = made.force(20, peaks)
    reading, noisy = made.reading(time, force), made.reading(time, force, noise=0.5)
    limit = reading.max() - 0.3 * np.ptp(reading)
    clipped, falls, whole = (
        quantities.sheet(made.sensor(time, force, part)).lines
        for part in (np.minimum(noisy, limit), 900 - np.minimum(noisy, limit), reading)
    )
    for name in ("span", "sensitivity", "signal to noise"):
        for found, at in ((clipped, limit), (falls, 900 - limit)):
            assert found[name].bound == "at least" and found[name].reason == f"the readings are clipped at {at:.4g}"
        assert "clipped" not in whole[name].reason
    for name in ("non-linearity", "hysteresis"):  # a share of a press whose top is not seen
        assert np.isnan(clipped[name].value) and "clipped at" in clipped[name].reason and whole[name].told
    assert "at a limit" in clipped["noise, pressed"].reason
    assert clipped["spread of rest"].bound == "at most" and "clipped" in clipped["spread of rest"].reason
    assert clipped["span"].value < 0.8 * whole["span"].value and whole["span"].told


def test_creep_is_that_after_the_stimulus_has_settled():
    found = lines(presses=10, ramp_s=0.05, hold_s=13.0, rest_s=20.0, creep=0.1, creep_s=2.0)
    begins = 1 + 0.1 * (1 - np.exp(-0.15 / 2))  # the middle of the ramp is 0.05 s before the hold settles, and so on
    for name, later_s in (("creep, 1 s", 1.0), ("creep, 10 s", 10.0)):
        change = 0.1 * (np.exp(-0.15 / 2) - np.exp(-(0.15 + later_s) / 2))
        assert found[name].value == pytest.approx(100 * change / begins, rel=0.1), name


def test_a_slow_reading_is_no_creep():
    found = lines(presses=20, ramp_s=0.02, hold_s=3.0, slow_s=0.1)
    assert found["response time"].value == pytest.approx(1e3 * np.log(9) * 0.1, rel=0.05)
    assert found["recovery time"].value == pytest.approx(1e3 * np.log(9) * 0.1, rel=0.05)
    assert abs(found["creep, 1 s"].value) < 1.0


def test_a_dead_time_needs_one_clock_and_quick_presses():
    late = {"late_s": 0.08, "noise": 0.2}
    assert lines(ramp_s=0.02, **late)["dead time"].value == pytest.approx(80, abs=3)
    assert "hides a delay" in lines(ramp_s=0.02, one_clock=False, **late)["dead time"].reason
    assert "a press takes 799 ms" in lines(ramp_s=1.0, **late)["dead time"].reason
    none = lines(ramp_s=0.02, noise=0.2)["dead time"]
    assert not none.told and none.value == pytest.approx(1e3 / made.HZ)  # at most an interval of the log


def test_repeatability_is_the_spread_over_equal_presses():
    time, force = made.force(60)
    number = np.minimum((time // 6).astype(int), 59)
    gains = 1 + 0.02 * np.random.default_rng(0).normal(size=60)
    reading = made.reading(time, force) + made.SPAN * (gains[number] - 1) * force / made.FULL_N
    found = quantities.sheet(made.sensor(time, force, reading)).lines["repeatability"]
    assert found.value == pytest.approx(100 * np.std(gains, ddof=1), rel=0.01) and found.n == 60
    assert found.low < 2.0 < found.high


def array(share=0.2, spread=0.0, presses=60):
    """Return an array of 2 x 3 elements, pressed in the middle of one after the other; neighbours answer a share."""
    time, force = made.force(presses)
    element = np.minimum((time // 6).astype(int), presses - 1) % 6
    gain = 1 + spread * np.linspace(-1, 1, 6)
    one = made.reading(time, force, rest=0.0, noise=0.2)
    row, col = np.divmod(np.arange(6), 3)
    beside = np.abs(row[:, None] - row) + np.abs(col[:, None] - col) == 1
    weight = gain[:, None] * (np.eye(6) + share * beside)
    place = 10.0 * np.column_stack([col[element] + 0.5, row[element] + 0.5])
    log = Log("single/run0", "single", time, 30 + one[:, None] * weight[element], force, place)
    return Sensor("made", "counts", "N", [log], True, (2, 3), 10.0)


def test_crosstalk_and_the_spread_between_elements():
    found = quantities.sheet(array(share=0.2, spread=0.3)).lines
    assert found["crosstalk"].value == pytest.approx(20, rel=0.05) and found["crosstalk"].n == 60
    spread = 100 * np.std(1 + 0.3 * np.linspace(-1, 1, 6), ddof=1)
    assert found["spread between elements"].value == pytest.approx(spread, rel=0.05)
    assert found["span"].smallest == pytest.approx(0.7 * made.SPAN, rel=0.02)
    assert found["span"].largest == pytest.approx(1.3 * made.SPAN, rel=0.02)


def test_presses_at_the_edge_of_an_element_tell_nothing_of_it():
    sensor = array()
    moved = sensor.logs[0]._replace(place=sensor.logs[0].place + 4.0)
    found = quantities.sheet(sensor._replace(logs=[moved])).lines
    assert not found["crosstalk"].told and np.isnan(found["span"].value)


def test_an_element_that_does_not_answer_is_named_and_left_out():
    time, force = made.force(20)
    readings = np.column_stack([made.reading(time, force, noise=0.5, seed=k) for k in range(3)])
    readings[:, 1] = 50 + np.random.default_rng(9).normal(0, 0.5, len(time))
    sheet = quantities.sheet(made.sensor(time, force, readings))
    assert sheet.given.dead == [1]
    assert sheet.lines["span"].smallest == pytest.approx(made.SPAN, rel=0.02)


def test_intervals_hold_the_truth_as_often_as_they_say():
    rng, inside = np.random.default_rng(0), []
    for _ in range(300):
        response, force = made.SPAN * rng.normal(1, 0.1, (40, 1)), np.full((40, 1), made.FULL_N)
        found = estimates.ratio_of_sums(response, force, "counts/N")
        inside.append(found.low < made.SPAN / made.FULL_N < found.high)
    assert 0.90 <= np.mean(inside) <= 0.98


UNTOLD = {
    "quick presses": ({"ramp_s": 0.02}, "hysteresis", "press more slowly, or log faster"),
    "short holds": ({"hold_s": 0.5}, "creep, 1 s", "no press is held"),
    "a short recording": ({"presses": 8}, "drift of rest", "no recording of 5 minutes"),
    "few presses": ({"presses": 2}, "hysteresis", "fewer than 3 presses"),
    "presses that all differ": ({"presses": 4, "peaks": (17, 18, 19, 20)}, "repeatability", "no two equal presses"),
    "no noise": ({"presses": 5}, "noise at rest", "readings are all alike"),
    "one element": ({"presses": 5}, "crosstalk", "one element has no neighbour"),
    "slow presses": ({"presses": 5}, "response time", "a press itself takes 799 ms"),
}  # fmt: skip


@pytest.mark.parametrize("name", UNTOLD)
def test_what_logs_cannot_tell_they_do_not_tell(name):
    given, quantity, reason = UNTOLD[name]
    line = lines(**given)[quantity]
    assert not line.told and reason in line.reason


def test_a_sensor_that_nothing_presses_has_an_empty_sheet():
    time = np.arange(0, 60, 0.01)
    for force in (np.zeros(len(time)), np.full(len(time), 5.0)):
        found = quantities.sheet(made.sensor(time, force, np.full(len(time), 50.0))).lines
        assert not any(line.told for line in found.values())
        assert "no press in one place goes from rest" in found["span"].reason


def test_grasps_without_a_log_of_force_tell_span_and_bounds():
    rng = np.random.default_rng(0)
    logs = []
    for k in range(30):
        time = np.arange(0, 3, 0.05)
        closing = np.clip(time / 1.0, 0, 1)[:, None]
        cells = np.array([400.0, 300, 200, 0]) * rng.normal(1, 0.1) * closing + rng.normal(0, 1.0, (len(time), 4))
        logs.append(Log(f"cup/grasp{k}", "cup", time, cells, np.empty(0), np.empty((0, 2))))
    found = quantities.sheet(Sensor("hand", "counts", "", logs)).lines
    assert found["span"].told and found["span"].value == pytest.approx(400, rel=0.05)
    assert found["repeatability"].value == pytest.approx(10, rel=0.4) and not found["repeatability"].told
    assert found["noise, pressed"].value == pytest.approx(1.0, rel=0.1) and not found["noise, pressed"].told
    assert found["signal to noise"].bound == "at least" and not found["signal to noise"].told
    for name in ("sensitivity", "hysteresis", "drift of rest", "dead time", "spread between elements"):
        assert found[name].reason == quantities.NO_STIMULUS, name


def test_a_glove_that_touches_nothing_tells_nothing():
    time = np.arange(0, 3, 0.1)
    logs = [Log(f"none/{k}", "none", time, np.full((30, 4), 7.0), np.empty(0), np.empty((0, 2))) for k in range(6)]
    found = quantities.sheet(Sensor("hand", "counts", "", logs)).lines
    assert found["span"].value == 0 and not any(line.told for name, line in found.items() if name != "span")


@pytest.mark.parametrize("units", [8, 12, 40])
def test_an_interval_of_few_units_holds_the_truth_in_95_of_100_cases(units):
    """A mean, as a ratio of sums; plain percentile intervals hold it in 0.88 cases of 8 units."""
    rng = np.random.default_rng(units)
    found = [estimates.ratio_of_sums(rng.normal(5, 1, (units, 1)), np.ones((units, 1)), "kPa") for _ in range(1500)]
    assert 0.92 <= np.mean([one.low <= 5 <= one.high for one in found]) <= 0.97
    fewer = estimates.ratio_of_sums(rng.normal(5, 1, (7, 1)), np.ones((7, 1)), "kPa")
    assert np.isfinite(fewer.value) and np.isnan([fewer.low, fewer.high]).all()
