"""The fit of the Velostat model finds what made recordings, and the committed one predicts others."""

import itertools
import json
import re

import numpy as np
import pytest
from builders.forces import press
from builders.project import ROOT

from pipeline.scenes import material
from pipeline.scenes.material import FITTED, log_resistance
from tactile.base import params
from tools import fit_material

DT = 0.01
SETTINGS = params.load(ROOT / "params.yaml")[fit_material.SOURCE]


def test_no_parameter_lies_on_a_bound():
    values = json.loads(FITTED.read_text())["parameters"]
    assert fit_material.bounded(values) == []
    assert fit_material.bounded(values | {"creep_weight": 0.0, "exponent": 3.0}) == ["exponent", "creep_weight"]


def made(name, force, values, log_gain):
    """A recording that the model itself made, with a gain for each press."""
    force = np.asarray(force)
    middles = [(end + start) // 2 for (_, end), (start, _) in itertools.pairwise(fit_material.presses(force))]
    press = np.searchsorted(middles, np.arange(len(force)), side="right")
    reading = log_resistance(material.Material(**values), force, DT, gain=np.exp(log_gain)[press])
    return fit_material.Recording(name, force, reading, press)


TRUTH = {name: start for name, (start, *_) in fit_material.VARIABLES.items()}


def test_fit_finds_known_parameters_and_places():
    log_gain = np.array([0.4, -0.3, -0.1])
    recording = made("made", np.concatenate([press(peak, rest_s=3.0) for peak in (15.0, 20.0, 10.0)]), TRUTH, log_gain)
    free = ["rest", "exponent", "release_gain"]
    start = {**TRUTH, "rest": 6.0, "exponent": 0.9, "release_gain": 0.02}
    fit = fit_material.fit([recording], start, free, exponents=False)
    assert all(fit.values[name] == pytest.approx(TRUTH[name], abs=5e-3) for name in free)
    assert np.allclose(fit.log_gain, log_gain, atol=5e-3)
    assert fit_material.scores(fit, [recording])[0] > 0.9999 > fit_material.scores(fit, [recording], False)[0]


def test_slow_creep_is_fitted_to_the_course_of_long_holds():
    truth = TRUTH | {"slow_weight": 0.06, "slow_time_s": 7.0}
    force = np.concatenate([press(20.0, hold_s=20.0), press(10.0, hold_s=1.2)])
    recording = made("made", force, truth, np.zeros(2))
    long = fit_material.holds([recording])
    assert len(long) == 1
    start = fit_material.Fit(TRUTH | {"slow_weight": 0.0}, np.zeros(2), np.ones(2))
    fit = fit_material.with_slow_creep(start, long)
    assert fit.values["slow_weight"] == pytest.approx(0.06, abs=1e-3)
    assert fit.values["slow_time_s"] == pytest.approx(7.0, rel=0.02)


def test_neighbours_on_the_raster_are_correlated():
    rows = np.repeat([1.0, 1.0, -1.0, -1.0], 4)  # 12 pairs within rows and 8 of 12 across agree
    assert fit_material.neighbour_correlation(rows) == pytest.approx((12 + 8 - 4) / 24)


def test_recordings_are_read_on_one_clock(tmp_path):
    for device, rate, shift in (("futek_data", 250, 0.0), ("velostat_data", 143, 0.05)):
        seconds = np.arange(0, 3, 1 / rate)
        values = seconds if device == "futek_data" else np.exp(seconds)
        folder = tmp_path / device / "made"
        folder.mkdir(parents=True)
        pairs = zip(values.tolist(), (1e9 + seconds + shift).tolist(), strict=True)
        lines = [f"{value!r} {unix_s!r}\n" for value, unix_s in pairs]
        (folder / "exp_made_sensor1_exp1.txt").write_text("".join(lines))
    r = fit_material.load_recording(tmp_path, SETTINGS, "made", 1, 0.05)
    assert len(r.force) > 290 and np.allclose(r.force, r.log_reading, atol=1e-4)


def test_committed_set_predicts_the_held_back_repetition(recordings):
    folder, result = recordings(fit_material.SOURCE), json.loads(FITTED.read_text())
    fitted, places = result["fit"], result["places"]
    assert fitted["fitted_on"] == ["pike1_force_5", "pike1_force_10", "pike1_force_20", "pike1_force_40"]
    best = fit_material.Fit(result["parameters"], np.array(places["log_gain"]), np.array(places["exponent"]))
    for name in fitted["fitted_on"]:
        r = fit_material.load_recording(folder, SETTINGS, name, 2, fitted["clock_lag_s"])
        (with_places,), (force_alone,) = (fit_material.scores(best, [r], each) for each in (True, False))
        assert with_places >= 0.99 and 0.9 < force_alone < 0.98, name
        assert with_places == pytest.approx(fitted["recordings"][name]["places"][1], abs=1e-6)


def test_presses_of_a_recording_are_found(recordings):
    lag = json.loads(FITTED.read_text())["fit"]["clock_lag_s"]
    r = fit_material.load_recording(recordings(fit_material.SOURCE), SETTINGS, "pike1_force_20", 2, lag)
    spans = fit_material.presses(r.force)
    assert len(spans) == 16
    assert max(end - start for start, end in spans) * DT == pytest.approx(27, abs=1)


def test_the_fit_of_the_film_is_rounded_from_its_file():
    result = json.loads(FITTED.read_text(encoding="utf-8"))
    text = fit_material.table(result)
    table = [[cell.strip() for cell in line.strip("|").split(" | ")] for line in text.splitlines() if line[:2] == "| "]
    rows = {cells[0]: cells[1:] for cells in table}
    name = result["fit"]["fitted_on"][0]
    fitted = result["fit"]["recordings"][name]
    assert rows[f"{name}*"] == [f"{value:.4f}" for value in (*fitted["force"], *fitted["places"])]
    assert rows["exponent"] == [f"{result['parameters']['exponent']:.4g}"]
    assert set(result["ablation"]) <= set(rows) and not re.search(r"\bnan\b|None|\{\{|\{%", text)
