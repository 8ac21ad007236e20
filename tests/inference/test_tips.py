"""The ground truth that pictures of maps show stands at the readings that it is of."""

import shutil

import numpy as np
import pytest
from builders.project import ROOT
from PIL import Image

from tactile import experiments
from tactile.datasets import schemas
from tactile.inference import pictures, recordings
from tactile.inference.card import Card
from tactile.inference.predictor import load

SAMPLE = ROOT / "data" / "sample" / "double" / "two_touches"


@pytest.fixture(scope="module")
def card() -> Card:
    return load(ROOT / "pretrained" / "touch" / "lomp_stream").card


def sample(card, folder=SAMPLE) -> recordings.Recording:
    return recordings.read(folder / "array.log", "two_touches", card)


def test_tips_stand_beside_the_readings_that_they_make(card):
    """The clocks of array and load cell differ by three seconds; elements under a tip read most."""
    recording = sample(card)
    tips = recordings.tips(recording, card)
    frames, _, _ = experiments.module("touch").read_recording(SAMPLE, card.reading)
    assert tips.known.sum() == frames.num_rows < len(recording.x) == len(tips.force_n)
    force = np.nansum(tips.force_n, axis=1)[tips.known]
    wanted = schemas.matrix(frames["force_n"])
    assert force == pytest.approx(np.where(wanted > card.reading["window"]["contact_threshold_n"], wanted, 0).sum(1))
    loads = (recording.x - recording.x[:20].mean(axis=0)).sum(axis=1)[tips.known]
    assert np.corrcoef(force, loads)[0, 1] > 0.9 > 0.5 > np.corrcoef(force[150:], loads[:-150])[0, 1]
    hardest = int(np.nansum(tips.force_n, axis=1).argmax())
    for x_mm, y_mm in pictures.places(tips, hardest):
        element = int(y_mm // 12) * 5 + int(x_mm // 12)
        assert recording.x[hardest, element] > np.median(recording.x[hardest]) + 20


def test_where_nobody_knows_there_are_none(card, tmp_path):
    shutil.copy(SAMPLE / "array.log", tmp_path)
    recording = sample(card, tmp_path)
    assert recordings.tips(recording, card) is None and pictures.places(None, 0) == []


def test_the_picture_of_readme_is_what_the_demo_draws(card, tmp_path):
    """The same frames, but for shades that another processor rounds otherwise."""
    recording, model = sample(card), load(ROOT / "pretrained" / "touch" / "lomp_stream")
    maps = recordings.predict(model, recording).values
    pictures.animate(tmp_path / "demo.gif", recording, maps, card, recordings.tips(recording, card))
    made, kept = (Image.open(path) for path in (tmp_path / "demo.gif", ROOT / "docs" / "demo.gif"))
    assert made.n_frames == kept.n_frames
    for frame in range(0, made.n_frames, 10):
        made.seek(frame)
        kept.seek(frame)
        apart = np.abs(np.subtract(*(np.asarray(each.convert("RGB"), int) for each in (made, kept))))
        assert apart.mean() < 0.5
