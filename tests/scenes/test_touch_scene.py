"""The touch scene: contact, circuit, logs and faults."""

import numpy as np
import pytest
from builders.project import ROOT

from pipeline import scenes
from pipeline.scenes import material, readout, touch, touch_contact, touch_motion
from pipeline.scenes.faults import inject
from tactile.base import params
from tactile.experiments import touch as experiment


@pytest.fixture
def settings():
    block = params.load(ROOT / "params.yaml")["touch"]
    block["simulate"]["single"] = {"points_per_side": 2, "depths": 2, "repetitions": 1, "presses_per_recording": 8}
    block["simulate"]["double"] = {"recordings": 1, "presses_per_recording": 3}
    return block


def recordings(settings):
    scene, radius = settings["simulate"], settings["label"]["tip_radius_mm"]
    return touch_motion.single_recordings(scene, settings["sensor"], radius)


def loads(settings, *touches):
    rng = np.random.default_rng(0)
    return touch_contact.element_loads(touches, settings["simulate"], settings["sensor"], rng)


def steady(settings, force, x, y):
    return touch_contact.steady(np.array(force), x, y, settings["label"]["tip_radius_mm"])


def test_column_voltage_solves_kirchhoff():
    conductance = np.random.default_rng(0).uniform(1e-5, 3e-3, (4, 5, 5))
    reference = 1 / 330
    volts = readout.column_voltage(conductance, reference_s=reference, supply_v=5.0, crosstalk=True)
    for row in range(5):
        into = (5.0 - volts[:, row]) * conductance[:, row]
        out = volts[:, row] * (reference + conductance.sum(axis=1) - conductance[:, row])
        np.testing.assert_allclose(into, out, rtol=1e-12)


def test_without_crosstalk_every_element_is_a_divider_of_its_own():
    conductance = np.random.default_rng(0).uniform(1e-5, 3e-3, (4, 5, 5))
    options = {"reference_s": 1 / 330, "supply_v": 5.0, "crosstalk": False}
    volts = readout.column_voltage(conductance, driver_ohm=25.0, **options)
    np.testing.assert_allclose(volts, 5.0 * 330 / (330 + 1 / conductance + 25), rtol=1e-12)


@pytest.mark.parametrize("driver_ohm", [1e-6, 25.0, 200.0])
def test_rows_that_sag_solve_kirchhoff_at_every_node(driver_ohm):
    """All ten nodes of the circuit, one equation each, in place of the eliminated system."""
    conductance = np.random.default_rng(0).uniform(1e-5, 2e-2, (3, 5, 4))
    reference, drivers = 1 / 330, 1 / driver_ohm
    volts = readout.column_voltage(
        conductance, reference_s=reference, supply_v=5.0, crosstalk=True, driver_ohm=driver_ohm
    )
    for step, g in enumerate(conductance):
        for driven in range(5):
            matrix, right = np.zeros((9, 9)), np.zeros(9)
            for row in range(5):
                matrix[row, row] += drivers
                right[row] = drivers * 5.0 * (row == driven)
                for column in range(4):
                    matrix[row, row] += g[row, column]
                    matrix[row, 5 + column] -= g[row, column]
                    matrix[5 + column, 5 + column] += g[row, column]
                    matrix[5 + column, row] -= g[row, column]
            for column in range(4):
                matrix[5 + column, 5 + column] += reference
            np.testing.assert_allclose(volts[step, driven], np.linalg.solve(matrix, right)[5:], rtol=1e-6)


def test_a_second_touch_in_a_row_lowers_the_first_only_where_rows_sag():
    conductance = np.full((1, 5, 5), 1e-4)
    conductance[0, 2, 1] = 8e-3
    both = conductance.copy()
    both[0, 2, 4] = 8e-3
    options = {"reference_s": 1 / 330, "supply_v": 5.0, "crosstalk": True}
    sagging, ideal = (
        readout.column_voltage(both, driver_ohm=ohm, **options)
        - readout.column_voltage(conductance, driver_ohm=ohm, **options)
        for ohm in (25.0, 0.0)
    )
    assert sagging[0, 2, 1] < -0.05 and ideal[0, 2, 1] == 0


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
    read = readout.counts(np.array([-0.1, 0.0, 2.5, 5.0]), supply_v=5.0, levels=1024)
    assert read.tolist() == [0, 0, 512, 1023] and read.dtype == np.int16


def test_load_is_conserved_but_for_the_gaps(settings):
    settings["simulate"]["contact"]["silicone_spread_mm"] = 0.0
    settings["simulate"]["effects"]["contact_growth"] = False
    middle = steady(settings, [1.0, 10.0], 30.0, 30.0)  # centre of element 12
    share = loads(settings, middle).force_n
    assert share.shape == (2, 25)
    np.testing.assert_allclose(share[1] / share[0], np.where(share[0] > 0, 10.0, np.nan), rtol=1e-9, equal_nan=True)
    assert share[0].argmax() == 12 and 0.9 < share[0].sum() <= 1.0
    shared = loads(settings, steady(settings, [1.0, 10.0], 36.0, 30.0)).force_n  # on the gap to element 13
    np.testing.assert_allclose(shared[0, 12], shared[0, 13])
    settings["simulate"]["effects"]["load_sharing"] = False
    alone = loads(settings, middle).force_n
    assert alone[0, 12] == 1.0 and alone[0].sum() == 1.0


def test_contact_widens_with_the_cube_root_of_force(settings):
    scene, radius = settings["simulate"], settings["label"]["tip_radius_mm"]
    scene["contact"] |= {"silicone_spread_mm": 0.0}
    full = scene["contact"]["full_kpa"] * 1e3 * touch_contact.tip_area_m2(radius)
    spread = touch_contact.spread_mm(steady(settings, [full / 8, full, 8 * full], 30.0, 30.0), scene)
    np.testing.assert_allclose(spread, [radius / 4, radius / 2, radius])
    share = loads(settings, steady(settings, [1.0, 20.0], 35.0, 30.0)).force_n / np.array([[1.0], [20.0]])
    assert share[1, 13] > 1.1 * share[0, 13]  # a hard press reaches further into the neighbour


def test_places_have_the_recorded_spread_and_correlation(settings):
    scene, sensor, length = settings["simulate"], settings["sensor"], 2.5
    step = round(3.5 / touch_contact.GRID_MM)
    layers = np.concatenate([touch_contact.places(scene | {"specimen": k}, sensor, length) for k in range(60)])
    assert layers.std() == pytest.approx(1, abs=0.03)
    correlation = (layers[:, step:] * layers[:, :-step]).mean() / layers.var()
    assert correlation == pytest.approx(np.exp(-(3.5**2) / (2 * length**2)), abs=0.04)
    film = material.load_places()
    rows, columns = (np.rint(np.arange(4) * mm / touch_contact.GRID_MM).astype(int) for mm in film.step_mm)
    raster = layers[:, 20 + rows[:, None], 20 + columns] * touch_contact.field_spread(length)[0]
    assert np.sqrt(raster.var(axis=(1, 2)).mean()) == pytest.approx(film.gain_std, rel=0.08)
    first, second = layers[::2], layers[1::2]
    assert abs((first * second).mean()) < 0.03  # gain and exponent are independent


def test_presses_at_one_place_differ_by_the_repeat_spread(settings):
    """Within a press nothing changes, and elements differ by themselves."""
    settings["simulate"]["material"]["repeat_spread"] = 0.03
    settings["simulate"]["effects"]["places"] = False
    force = np.tile([0.0, 0.0, 5.0, 9.0, 5.0], 400)
    gain = np.log(loads(settings, steady(settings, force, 30.0, 30.0)).gain).reshape(400, 5, 25)
    assert np.ptp(gain[:, 2:], axis=1).max() < 1e-9
    again = gain[:, 3]
    assert again.std() == pytest.approx(0.03, rel=0.03) and abs(again.mean()) < 0.002
    assert abs(np.corrcoef(again[:, 12], again[:, 13])[0, 1]) < 0.2
    settings["simulate"]["effects"]["repeats"] = False
    assert (loads(settings, steady(settings, force, 30.0, 30.0)).gain == 1).all()


def test_an_element_has_the_gain_of_where_it_is_loaded(settings):
    scene, sensor = settings["simulate"], settings["sensor"]
    scene["material"] |= {"correlation_mm": 2.5, "repeat_spread": 0.0}
    field = touch_contact.places(scene, sensor, 2.5)[0]
    x, y = 29.0, 31.5
    at = [round((z + touch_contact.EDGE_MM) / touch_contact.GRID_MM) for z in (y, x)]
    scene["contact"]["silicone_spread_mm"] = 0.0  # a sharp contact: its centre on the element is its place
    sharp = touch_contact.steady(np.array([20.0]), x, y, 0.5)
    gain = loads(settings, sharp).gain[0, 12]
    assert gain == pytest.approx(np.exp(touch_contact.field_spread(2.5)[0] * field[tuple(at)]), rel=1e-3)
    twice = loads(settings, sharp, sharp._replace(force_n=np.array([1e-6]), x_mm=np.array([26.0])))
    assert twice.gain[0, 12] == pytest.approx(gain, rel=1e-3)  # the weight of a touch is its load
    other = touch_contact.places(scene | {"specimen": scene["specimen"] + 1}, sensor, 2.5)[0]
    assert np.corrcoef(field.ravel(), other.ravel())[0, 1] < 0.3


def test_the_array_is_matched_to_its_reference_resistor(settings):
    """material.resistance_scale_ohm has its source in pipeline/scenes/touch.py: the divider's widest span."""
    scene = settings["simulate"]
    scene["effects"]["places"] = False
    pressures = np.array([scene["pressure"][key] for key in ("lowest_kpa", "highest_kpa")])
    force = pressures * 1e3 * touch_contact.tip_area_m2(settings["label"]["tip_radius_mm"])
    load = loads(settings, steady(settings, force, 30.0, 30.0)).force_n[:, 12]
    film = material.load_material()
    ohm = scene["material"]["resistance_scale_ohm"] * np.exp(film.rest - material.static_conductance(film, load))
    assert np.sqrt(ohm.prod()) == pytest.approx(scene["circuit"]["reference_ohm"], rel=0.01)


def test_single_presses_cover_the_grid_and_the_pressures(settings):
    (recording,) = recordings(settings)
    single = recording.touches[0]
    pressed = single.force_n > 0
    assert len(set(zip(single.x_mm[pressed], single.y_mm[pressed], strict=True))) == 4
    area = touch_contact.tip_area_m2(settings["label"]["tip_radius_mm"])
    assert 300e3 < single.force_n.max() / area < 440e3
    assert single.force_n.min() == 0


def test_the_cnc_moves_at_a_finite_speed_and_only_while_it_is_up(settings):
    (recording,) = recordings(settings)
    single, speed = recording.touches[0], settings["simulate"]["press"]["cnc_mm_s"]
    moved = np.hypot(np.diff(single.x_mm), np.diff(single.y_mm))
    assert 0 < moved.max() <= speed * touch_motion.STEP_S * 1.001
    assert (single.force_n[1:][moved > 0] == 0).all() and (single.force_n[:-1][moved > 0] == 0).all()
    far = touch_motion.rest_steps(0.1, np.array([60.0, 0.0]), np.zeros(2), settings["simulate"]["press"])
    assert far * touch_motion.STEP_S == pytest.approx(60.0 / speed + 2 * touch_motion.LIFT_S)


def test_double_touches_are_on_elements_apart(settings):
    scene, radius = settings["simulate"], settings["label"]["tip_radius_mm"]
    (recording,) = touch_motion.double_recordings(scene, settings["sensor"], radius)
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
    assert not np.allclose(hand.x_mm, hand.logged_x_mm) and hand.radius_mm < machine.radius_mm
    scene["effects"]["hand_error"] = False
    (recording,) = touch_motion.double_recordings(scene, settings["sensor"], radius)
    steady_hand = recording.touches[1]
    assert np.array_equal(steady_hand.x_mm, steady_hand.logged_x_mm) and steady_hand.radius_mm == radius
    assert np.array_equal(recording.touches[0].force_n, machine.force_n)  # the same motions


def test_a_hand_trembles():
    course = touch_motion.tremor(200_000, np.random.default_rng(0))
    assert course.std() == pytest.approx(1, abs=0.05) and abs(course.mean()) < 0.05
    power = np.abs(np.fft.rfft(course)) ** 2
    hz = np.fft.rfftfreq(len(course), touch_motion.STEP_S)
    low, high = touch_motion.TREMOR_HZ
    assert power[(hz > 0.9 * low) & (hz < 1.1 * high)].sum() > 0.99 * power.sum()


def test_elements_are_read_one_after_the_other():
    grid = np.repeat(np.arange(200)[:, None] * touch_motion.STEP_S, 3, axis=1)
    at = np.array([0.5, 1.0])[:, None] + np.array([0.0, 1e-3, 2e-3])
    np.testing.assert_allclose(touch.sampled(grid, at), at)


def test_specimen_and_motions_have_seeds_of_their_own(settings):
    scene = settings["simulate"]
    plain = recordings(settings)[0]
    scene["specimen"] += 1
    again = recordings(settings)[0]
    assert np.array_equal(plain.touches[0].force_n, again.touches[0].force_n)
    gain = loads(settings, *plain.touches).gain
    scene["specimen"] -= 1
    scene["seed"] += 1
    assert not np.array_equal(loads(settings, *plain.touches).gain, gain)
    moved = recordings(settings)[0]
    assert not np.array_equal(moved.touches[0].force_n[:500], plain.touches[0].force_n[:500])


def test_logs_repeat_and_a_reset_starts_the_clock_again(settings):
    recording = recordings(settings)[0]
    arguments = (recording, settings["simulate"], settings["sensor"])
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


@pytest.mark.parametrize("rows_and_cols", [5, 10, 2])
def test_demonstrations_in_random_places_keep_apart_and_on_the_array(settings, rows_and_cols):
    """Two touches are never nearer than two elements, as double touches are; places differ from time to time."""
    settings["sensor"] |= {"rows": rows_and_cols, "cols": rows_and_cols}
    scene, side = settings["simulate"], rows_and_cols * settings["sensor"]["pitch_mm"]
    scene["demonstrations"] = {"repetitions": 6, "places": "random"}
    made = {one.condition: one.touches for one in touch_motion.demonstration_recordings(scene, settings["sensor"], 5.0)}
    assert {name: len(touches) for name, touches in made.items()} == {"three": 3, "slide": 2, "tape": 5}
    for name, touches in made.items():
        places = np.array([[touch.x_mm, touch.y_mm] for touch in touches])  # (touch, x or y, step)
        pressed = touches[0].force_n > 0
        assert places.min() >= 0 and places.max() <= side
        assert len(np.unique(places[0, 0, pressed].round(6))) > 5, "not always in the same place"
        if name != "tape":
            away = min(
                np.abs(places[i] - places[j]).max(axis=0)[pressed].min() for i in range(len(touches)) for j in range(i)
            )
            assert away > 0.99 * min(2 / rows_and_cols, 0.4) * side


def test_demonstrations_in_the_papers_places_are_all_alike(settings):
    scene = settings["simulate"] | {"demonstrations": {"repetitions": 3, "places": "paper"}}
    three, *_ = touch_motion.demonstration_recordings(scene, settings["sensor"], 5.0)
    assert [set(touch.x_mm) for touch in three.touches] == [{18.0}, {42.0}, {30.0}]


def test_the_clocks_of_many_demonstrations_are_found(settings, tmp_path):
    """At one pace they would fit one event later as well, and the recording would be refused."""
    settings["simulate"]["demonstrations"] = {"repetitions": 50, "places": "random"}
    planned, logs_of = touch.plan(settings)
    (three,) = (each for each in planned if each.condition == "three")
    scenes.write_recording(tmp_path, three, logs_of)
    frames, *_ = experiment.read_recording(scenes.folder_of(tmp_path, three), settings)
    assert frames.num_rows > 8000
