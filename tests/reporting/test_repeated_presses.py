"""The drift of the recorded taxel is that of presses which were made with it."""

import copy

import matplotlib.image
import numpy as np
import pytest

from pipeline.base import params
from pipeline.datasets import schemas
from pipeline.experiments.velostat_recorded import SCHEMA
from pipeline.reporting import glove, repeated_presses
from pipeline.reporting.repeated_presses import PLACES

HZ, PERIOD_S, PRESS_S = 100, 4.0, 1.5
EXPONENT = 0.8


def recording(name, start_s, aimed_n, gain, rng, presses=PLACES, cut_s=0.0):
    """Frames of presses at places of different gains; `cut_s`: how much of the start is missing."""
    time_s = np.arange(cut_s, presses * PERIOD_S, 1 / HZ)
    place = (time_s // PERIOD_S).astype(int)
    inside = time_s % PERIOD_S
    force = np.where((inside > 1) & (inside < 1 + PRESS_S), (aimed_n * rng.uniform(0.9, 1.1, presses))[place], 0.0)
    places = np.exp(np.random.default_rng(0).normal(0, 0.5, presses))[place]
    reading = np.where(force > 0, 100 / (gain * places * np.maximum(force, 1e-3) ** EXPONENT), 900.0)
    n, unknown = len(time_s), np.full((len(time_s), 1), np.nan)
    return schemas.frame_rows(
        SCHEMA,
        name.split("/")[0],
        name,
        segment=np.zeros(n, int),
        t_s=start_s + time_s,
        v=reading[:, None],
        force_n=force[:, None],
        x_mm=unknown,
        y_mm=unknown,
    )


def written(path, parts):
    schemas.write(path, SCHEMA, parts)
    return repeated_presses.read(path)


@pytest.fixture
def repeated(tmp_path):
    """5 N twice, 8 % apart, and 10 N three times, 4 % and once more 4 % apart; the recordings' names have no order."""
    rng = np.random.default_rng(1)
    parts = [
        recording("pike1/exp2", 0, 10, 1.0, rng),
        recording("pike1_force_10/exp1", 600, 10, 1.04, rng),
        recording("pike1/exp1", 1200, 10, 1.08, rng),
        recording("pike1_force_5/exp1", 300, 5, 1.0, rng),
        recording("pike1_force_5/exp2", 900, 5, 1.08, rng),
        recording("pike1_force_40/exp1", 2000, 40, 1.0, rng),  # alone
        recording("pike1_force_20/exp1", 2200, 20, 1.0, rng, presses=6),
        recording("pike1_force_20/exp2", 2400, 20, 2.0, rng, presses=6),
        recording("pike5_force_60/exp1", 2600, 60, 1.0, rng),
        recording("pike5_force_60/exp2", 2800, 60, 2.0, rng),
    ]
    return written(tmp_path / "frames.parquet", parts)


def test_places_are_compared_with_themselves_at_the_same_force(repeated):
    assert [each.conductance.shape for each in repeated] == [(2, PLACES), (3, PLACES)]
    assert [each.minutes for each in repeated] == pytest.approx([600 / 60 + 1.07, 1200 / 60 + 1.07], abs=0.01)
    change, exponent = repeated_presses.changes(repeated)
    assert exponent == pytest.approx(EXPONENT, abs=1e-4)
    for each, courses in zip(change, ([1, 1.08], [1, 1.04, 1.08]), strict=True):
        np.testing.assert_allclose(np.exp(each), np.tile(courses, (PLACES, 1)).T, rtol=1e-4)
    raw = np.log(repeated[0].conductance)
    assert np.std(raw[1] - raw[0]) > 0.02, "without the same force, places would differ"


def test_the_sentence_says_drift_numbers_and_limits(repeated):
    text = repeated_presses.findings(repeated)
    assert "changed by 6.00 [-19.41, 31.41] %" in text  # 8 and 4 % for 16 presses: a t interval of two
    assert "5 N 8.00 % (32 presses in 11 min), 10 N 8.00 % (48 presses in 21 min)" in text
    assert "another sensor" in text and "at most 48 presses" in text and "600 cycles" in text


def test_a_press_that_began_before_the_recording_is_left_out(tmp_path):
    rng = np.random.default_rng(2)
    parts = [
        recording(f"pike1_force_30/exp{k}", 300 * k, 30, 1.0, rng, presses=PLACES + k % 2, cut_s=1.5 * (k % 2))
        for k in (1, 2)
    ]
    (pair,) = written(tmp_path / "frames.parquet", parts)
    assert pair.conductance.shape == (2, PLACES)


def test_without_recordings_the_figure_has_the_scene_alone(tmp_path, repeated):
    none = written(tmp_path / "none.parquet", [])
    assert none == [] and "not downloaded" in repeated_presses.findings(none)
    settings, heights = copy.deepcopy(params.load()["glove"]), []
    for name, taxel in (("scene", none), ("both", repeated)):
        (tmp_path / name).mkdir()
        glove.draw_laws(tmp_path / name, settings, taxel)
        heights.append(len(matplotlib.image.imread(tmp_path / name / "figure8.png")))
    assert heights[1] > 1.5 * heights[0]
