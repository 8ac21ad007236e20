"""The touch scene: contact, circuit, logs and faults."""

import numpy as np
import pytest

from pipeline.base import params
from pipeline.scenes import readout, touch
from pipeline.scenes.faults import inject


@pytest.fixture
def settings():
    block = params.load()["touch"]
    block["simulate"]["single"] = {"points_per_side": 2, "depths": 2, "repetitions": 1, "presses_per_recording": 8}
    block["simulate"]["double"] = {"recordings": 1, "presses_per_recording": 3}
    return block


def recordings(settings):
    return touch.single_recordings(settings["simulate"], settings["sensor"], settings["label"]["tip_radius_mm"])


def loads(settings, recording):
    return touch.element_loads(recording, settings["simulate"], settings["sensor"], settings["label"]["tip_radius_mm"])


def test_column_voltage_solves_kirchhoff():
    conductance = np.random.default_rng(0).uniform(1e-5, 3e-3, (4, 5, 5))
    reference = 1 / 330
    volts = readout.column_voltage(conductance, reference_s=reference, supply_v=5.0, crosstalk=True)
    for row in range(5):
        into = (5.0 - volts[:, row]) * conductance[:, row]
        out = volts[:, row] * (reference + conductance.sum(axis=1) - conductance[:, row])
        np.testing.assert_allclose(into, out, rtol=1e-12)


def test_crosstalk_stays_within_a_column_and_can_be_switched_off():
    conductance = np.full((1, 5, 5), 1e-4)
    pressed = conductance.copy()
    pressed[0, 4, 2] = 2e-3
    options = {"reference_s": 1 / 330, "supply_v": 5.0}
    change = readout.column_voltage(pressed, crosstalk=True, **options) - readout.column_voltage(
        conductance, crosstalk=True, **options
    )
    assert (change[0, :4, 2] < 0).all()
    assert (change[0][:, [0, 1, 3, 4]] == 0).all()
    without = readout.column_voltage(pressed, crosstalk=False, **options)
    assert (without[0, :4, 2] == without[0, 0, 0]).all()


def test_counts_are_clipped_whole_numbers():
    found = readout.counts(np.array([-0.1, 0.0, 2.5, 5.0]), supply_v=5.0, levels=1024)
    assert found.tolist() == [0, 0, 512, 1023] and found.dtype == np.int16


def test_load_is_conserved_but_for_the_gaps(settings):
    settings["simulate"]["contact"]["silicone_spread_mm"] = 0.0
    force = np.array([1.0, 10.0])
    middle = touch.Recording("single", "r", [touch.steady(force, 30.0, 30.0)])  # centre of element 12
    share = loads(settings, middle)
    assert share.shape == (2, 25)
    np.testing.assert_allclose(share[1] / share[0], np.where(share[0] > 0, 10.0, np.nan), rtol=1e-9, equal_nan=True)
    assert share[0].argmax() == 12 and 0.9 < share[0].sum() <= 1.0
    between = touch.Recording("single", "r", [touch.steady(force, 36.0, 30.0)])  # on the gap to element 13
    shared = loads(settings, between)
    np.testing.assert_allclose(shared[0, 12], shared[0, 13])
    settings["simulate"]["effects"]["load_sharing"] = False
    alone = loads(settings, middle)
    assert alone[0, 12] == 1.0 and alone[0].sum() == 1.0


def test_single_presses_cover_the_grid_and_the_pressures(settings):
    (recording,) = recordings(settings)
    single = recording.touches[0]
    assert len(set(zip(single.x_mm, single.y_mm, strict=True))) == 4
    area = touch.tip_area_m2(settings["label"]["tip_radius_mm"])
    assert 300e3 < single.force_n.max() / area < 440e3
    assert single.force_n.min() == 0


def test_double_touches_are_on_elements_apart(settings):
    (recording,) = touch.double_recordings(settings["simulate"], settings["sensor"], settings["label"]["tip_radius_mm"])
    machine, hand = recording.touches
    both = (machine.force_n > 0) & (hand.force_n > 0)
    assert both.any()
    pitch = settings["sensor"]["pitch_mm"]
    apart = np.maximum(
        np.abs(machine.logged_x_mm // pitch - hand.logged_x_mm // pitch),
        np.abs(machine.logged_y_mm // pitch - hand.logged_y_mm // pitch),
    )
    assert (apart[both] >= 2).all()
    assert (hand.logged_force_n <= hand.force_n).all() and (hand.logged_force_n < hand.force_n)[both].any()
    assert not np.allclose(hand.x_mm, hand.logged_x_mm)


@pytest.mark.parametrize("effect", ["creep", "release", "element_spread", "crosstalk", "noise", "line_faults"])
def test_every_switch_changes_the_log(settings, effect):
    recording = recordings(settings)[0]
    radius = settings["label"]["tip_radius_mm"]
    settings["simulate"]["faults"] |= {"torn": 0.02, "missing": 0.02}
    settings["simulate"]["effects"] = dict.fromkeys(settings["simulate"]["effects"], True)
    on = touch.logs_of(recording, settings["simulate"], settings["sensor"], radius, reset=False)["array.log"][0]
    settings["simulate"]["effects"][effect] = False
    off = touch.logs_of(recording, settings["simulate"], settings["sensor"], radius, reset=False)["array.log"][0]
    assert on != off


def test_logs_repeat_and_a_reset_starts_the_clock_again(settings):
    recording = recordings(settings)[0]
    arguments = (recording, settings["simulate"], settings["sensor"], settings["label"]["tip_radius_mm"])
    first, second = (touch.logs_of(*arguments, reset=True) for _ in range(2))
    assert first == second
    lines, faults = first["array.log"]
    restart = next(fault.line for fault in faults if fault.kind == "reset")
    before, after = (int(lines[k].split(",")[0]) for k in (restart - 3, restart - 1))
    assert after == 350_000 < before
    assert lines[restart - 2].startswith("tactile array")


def test_faults_are_where_they_are_said_to_be():
    lines = [f"{k * 10},{k}" for k in range(2000)]
    rates = {"torn": 0.02, "duplicated": 0.02, "missing": 0.02, "out_of_range": 0.02, "out_of_order": 0.02}
    written, faults = inject(lines, rates, np.random.default_rng(3))
    kinds = {fault.kind for fault in faults}
    assert kinds == set(rates)
    for fault in faults:
        if fault.kind == "torn":
            assert "," not in written[fault.line - 1]
        elif fault.kind == "duplicated":
            assert written[fault.line - 1] == written[fault.line - 2]
        elif fault.kind == "out_of_range":
            assert written[fault.line - 1].endswith(",99999")
        elif fault.kind == "out_of_order":
            before, line = (int(written[k].split(",")[0]) for k in (fault.line - 2, fault.line - 1))
            assert line < before
    missing = sum(fault.kind == "missing" for fault in faults)
    duplicated = sum(fault.kind == "duplicated" for fault in faults)
    assert len(written) == len(lines) - missing + duplicated
