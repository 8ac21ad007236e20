"""The truth of a replayed log: each of its readings finds the tips that pressed then."""

import numpy as np
import pytest
from builders.project import ROOT

from tactile.inference import consistent, recordings
from tactile.live import truth
from tactile.live.source import Lines, line_format

LOG = ROOT / "data" / "sample" / "double" / "two_touches" / "array.log"
CARD = consistent.read(ROOT / "pretrained" / "touch" / "lomp_stream")


@pytest.fixture(scope="module")
def known() -> truth.Truth:
    return truth.beside(LOG, CARD)


@pytest.fixture(scope="module")
def readings() -> list:
    return Lines(line_format(CARD), "array.log", "touch/lomp_stream").take(LOG.read_bytes())


def test_each_replayed_reading_finds_its_tips(known, readings):
    of_readings = [known.of(reading) for reading in readings]
    counts = np.bincount([len(each["tips"]) for each in of_readings if each], minlength=3)
    assert counts[0] > 100 and counts[2] > 300 and counts[3:].sum() == 0
    force = np.array([each.get("load_cells_n", np.nan) for each in of_readings])
    places = np.array([tip for each in of_readings for tip in each.get("tips", ())])
    assert (places > 0).all() and (places < 60).all()
    pressed = np.array([reading.values.sum() for reading in readings])
    both = np.isfinite(force)
    assert np.corrcoef(force[both], pressed[both])[0, 1] > 0.95, "the force is that of the same moment"


def test_a_reading_of_another_log_has_no_truth(known, readings):
    other = readings[400]._replace(values=readings[400].values + 1)
    assert known.of(readings[400]) and known.of(other) == {}
    assert known.of(readings[400]._replace(t_s=1e6)) == {}


def test_a_log_alone_has_no_truth(tmp_path):
    (tmp_path / "array.log").write_bytes(LOG.read_bytes())
    assert truth.beside(tmp_path / "array.log", CARD) is None


def test_the_truth_of_a_moment_is_that_of_predict(known, readings):
    recording = recordings.read(LOG, "two_touches", CARD)
    tips = recordings.tips(recording, CARD)
    for k in np.flatnonzero(tips.known)[::50]:
        (reading,) = (one for one in readings if round(1e6 * one.t_s) == round(1e6 * recording.t_s[k]))
        force = tips.force_n[k]
        assert known.of(reading)["load_cells_n"] == pytest.approx(np.nansum(force), abs=1e-3)
        assert len(known.of(reading)["tips"]) == np.isfinite(force).sum()
