"""Readings that are no measurement are told, and have no interval; predictions of all others are as they were."""

import re
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from builders import live_models
from builders.project import ROOT

from pipeline import scenes
from tactile.base import params, ranges
from tactile.inference import predictions, predictor, recordings
from tactile.live.session import Session
from tactile.live.source import Lines, line_format
from tactile.logs import unmeasured

N = 600
REACH = (live_models.FRAMES - 1) * live_models.STEP


@pytest.fixture(scope="module")
def model(tmp_path_factory) -> predictor.Predictor:
    known = [ranges.of(measured(), "v", 0, range(6), ranges.MEAN_MARGIN)]
    return live_models.calibrated("linear", tmp_path_factory.mktemp("model") / "linear", trained_on=known)


def measured(seed: int = 0) -> np.ndarray:
    """Return counts (N, 6) of an array whose elements are pressed one after the other, with noise."""
    rng = np.random.default_rng(seed)
    at = np.arange(N)
    shares = np.stack([np.clip(np.sin(2 * np.pi * (at - 15 * k) / 90), 0, None) for k in range(6)], axis=1)
    return np.rint(60 + 500 * shares + rng.normal(0, 3, (N, 6))).astype(int)


def read_back(model, counts: np.ndarray, folder: Path) -> recordings.Recording:
    log = folder / "single" / "run" / "array.log"
    log.parent.mkdir(parents=True)
    log.write_bytes(live_models.printed(counts))
    return recordings.read(log, "run", model.card)


def zeros(counts):
    rows = np.arange(40, N, 47)
    counts[rows] = 0
    return rows, rf"{len(rows)} of {N} frames are no measurement: all channels read 0 in them"


def full_scale(counts):
    rows = np.arange(33, N, 31)
    counts[rows] = 500
    return rows, rf"{len(rows)} of {N} frames are no measurement: all channels read 500 in them"


def still(counts):
    rows = np.arange(250, 450)
    counts[rows, 2] = counts[250, 2]
    return rows, rf"v2 stands at {counts[250, 2]} from 6 to 9.98 s, elsewhere for 0\.\d+ s at most: no measurement"


@pytest.mark.parametrize("spoiled", [zeros, full_scale, still])
def test_such_readings_have_no_interval_in_windows_with_them_and_all_predictions_stay(spoiled, model, tmp_path):
    counts = measured(1)
    rows, words = spoiled(counts)
    recording = read_back(model, counts, tmp_path)
    found = recordings.predict(model, recording)
    assert np.array_equal(found.values, model.predict(counts), equal_nan=True), "predictions are as they were"
    assert any(re.fullmatch(words, note) for note in found.notes), found.notes
    expected = np.zeros(N, bool)
    expected[rows] = True
    for back in range(live_models.STEP, REACH + 1, live_models.STEP):
        expected[rows[rows + back < N] + back] = True
    by_range = model.outside(counts)
    assert np.abs(found.outside.astype(int) - (expected | by_range)).sum() <= 6, "the edges of a still channel"
    with predictions.writing(tmp_path, tmp_path, model.card) as write:
        said = write(recording, found, {})
    table = pq.read_table(tmp_path / "predictions.parquet").to_pandas()
    assert said["notes"] == found.notes and said["share_outside_training"] == table["outside_training"].mean()
    assert ("outside_training" in said) == by_range.any(), "no sentence on ranges where it is none of theirs"
    assert (
        table["force_low_n"][found.outside].isna().all() and table["force_low_n"][~found.outside][REACH:].notna().all()
    )


def test_frames_printed_again_are_told_and_keep_their_intervals(model, tmp_path):
    counts = measured(1)[np.arange(N) // 4]
    found = recordings.predict(model, read_back(model, counts, tmp_path))
    assert "each frame is printed 4 times: of 50 frames a second, 12.5 are new" in found.notes
    assert not found.outside.any()


def test_what_is_measured_has_no_note(model, tmp_path):
    found = recordings.predict(model, read_back(model, measured(1), tmp_path))
    assert found.notes == [] and not found.outside.any()


@pytest.mark.parametrize(("spoiled", "start"), [(zeros, "frames are no measurement"), (still, "v2 stands at")])
def test_live_tells_it_once_it_is_known(spoiled, start, model):
    counts, said = measured(1), []
    rows, _ = spoiled(counts)
    session = Session(model, Lines(line_format(model.card), "array.log", "the model"), said.append)
    session._step_s = 1e-4
    came = [*session.take(live_models.printed(counts), 0.0), *session.finish()]
    outside = np.array([each.outside for each in came])
    assert len([words for words in said if start in words]) == 1, said
    assert not outside[: rows[0]].any() and outside[rows[-3:]].all() and not outside[-20:].all()
    assert np.isfinite([each.values for each in came[REACH:]]).all() and session.notes == said


def test_interpolated_readings_rest_on_those_around_them():
    t_s, none = np.arange(6.0), np.array([0, 0, 1, 0, 0, 0], bool)
    grid = np.array([0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 5.0])
    assert unmeasured.resampled(none, t_s, grid).tolist() == [False, False, True, True, True, False, False]


@pytest.mark.parametrize("experiment", ["strain", "glove"])
def test_so_of_strands_and_gloves(experiment, tmp_path):
    values = params.load(ROOT / "params.yaml")
    planned, logs_of = scenes.plan(experiment, values[experiment])
    scenes.write_logs(tmp_path, planned[:1], logs_of)
    (log,) = recordings.logs(tmp_path, experiment)
    name = {"strain": "lstm_direct", "glove": "sp_resnet"}[experiment]
    model = predictor.load(ROOT / "pretrained" / experiment / name)
    lines = [line for line in log.read_text().splitlines() if line[:1].isdigit()][:1000]
    log.write_text("\n".join(lines) + "\n")
    usual = recordings.read(log, "run", model.card)
    assert not len(usual.unmeasured) and not usual.notes
    every = 10 if experiment == "glove" else 40
    broken = [
        ",".join([row.partition(",")[0], *["0"] * row.count(",")]) if k % every == 5 else row
        for k, row in enumerate(lines)
    ]
    log.write_text("\n".join(broken) + "\n")
    found = recordings.read(log, "run", model.card)
    assert "no measurement: all channels read 0 in them" in found.notes[0]
    outside = recordings.predict(model, found).outside
    changed = (found.x != usual.x).any(axis=1) if found.x.shape == usual.x.shape else None
    assert changed is not None and changed.sum() >= 3 and outside[changed].all()
    assert not outside[~changed & ~recordings.predict(model, usual).outside].any()


def test_a_channel_without_a_value_is_left_out():
    x = measured(1).astype(float)
    x[:, 4] = np.nan
    x[zeros(x[:, :1].copy())[0]] = 0
    x[:, 4] = np.nan
    t_s = np.arange(N) / 50
    found = unmeasured.found(t_s, x)
    assert found.constant is not None and unmeasured.rows(found, N).sum() == 12
    assert unmeasured.found(t_s, np.full((N, 2), np.nan)) == (None, None, [])
