"""One log, four ways: ingest, predict, live and ONNX read the same and say the same.

The array's elements are wired in an order of their own, lines are lost, and a device may be of another rate or faster
than the model.
"""

import numpy as np
import pytest
from builders import live_models, touch_logs

from tactile.datasets import schemas
from tactile.experiments import touch
from tactile.inference import card as cards
from tactile.inference import consistent, onnx_export, onnx_network, predictor, recordings
from tactile.live.session import Session
from tactile.live.source import Lines, line_format

ORDER = [3, 0, 4, 1, 5, 2]  # printed column of each element
LOST = (304, 505, 506)  # lines that are not in the log: one is filled, two are a gap
SAME = 1e-3  # of the largest prediction: one reading is predicted with weights of 16 bits, many with float32
WINDOW = (live_models.FRAMES - 1) * live_models.STEP  # readings before the first one that ends a window
GAPS = [0, 303, 503]  # readings before which one is missing
SETTINGS = live_models.TOUCH | {"ingest": touch_logs.SETTINGS["ingest"] | {"max_reject_fraction": 0.1}}
SETTINGS |= {"sensor": live_models.TOUCH["sensor"] | {"order": ORDER}}


@pytest.fixture(scope="module", params=["linear", "stream"])
def package(request, tmp_path_factory):
    """A model and its ONNX in one folder; its card names the order of the elements."""
    folder = live_models.KINDS[request.param](tmp_path_factory.mktemp("packages") / request.param)
    card = consistent.read(folder)
    cards.write(folder, card.model_copy(update={"reading": SETTINGS}))
    onnx_export.export(predictor.load(folder), folder)
    return folder


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    """A recording whose log lacks the lines LOST, and whose elements answer apart, so that their order matters."""
    logs = touch_logs.logs_of()
    readings = np.array([line.split(",")[1:] for line in logs["array.log"][1:]], int)
    assert len({tuple(column) for column in readings.T}) == 6 and (readings.max(0) > readings.min(0) + 10).all()
    assert all((readings[k - 1] != readings[k - 2]).any() for k in LOST), "lost in mid-press"
    logs["array.log"] = [line for k, line in enumerate(logs["array.log"]) if k not in LOST]
    return touch_logs.save(tmp_path_factory.mktemp("logs") / "single" / "run", logs)


def live(folder, log, step_s: float = 1e-4) -> tuple[list, list[str]]:
    """Predictions of the lines of a log as they come, and notes; step_s: the time that a prediction takes."""
    model = predictor.load(folder)
    source = Lines(line_format(model.card), "array.log", "the model", model.card.reading["sensor"]["order"])
    session = Session(model, source, lambda sentence: None)
    session._step_s = step_s
    data = log.read_bytes()
    parts = [data[k : k + 1000] for k in range(0, len(data), 1000)]
    return [each for part in parts for each in session.take(part, 0.0)] + list(session.finish()), session.notes


def by_onnx(folder, read: recordings.Recording) -> np.ndarray:
    """What the ONNX file says, reading by reading, of a log whose lost lines are filled or a gap, here by hand."""
    model = predictor.load(folder)
    model = predictor.Predictor(onnx_network.OnnxNetwork(folder / onnx_network.NAME), model.card)
    place = np.round((read.t_s - read.t_s[0]) / np.median(np.diff(read.t_s))).astype(int)
    begins = np.flatnonzero(np.diff(place) > 2) + 1
    said = []
    for part in np.split(np.arange(len(place)), begins):
        every = np.arange(place[part[0]], place[part[-1]] + 1)
        whole = np.column_stack([np.interp(every, place[part], column[part]) for column in read.x.T])
        model.reset()
        said.append(np.stack([model.step(reading) for reading in whole])[place[part] - place[part[0]]])
    return np.concatenate(said)


def test_ingest_predict_live_and_onnx_agree(package, recording):
    model, log = predictor.load(package), recording / "array.log"
    read = recordings.read(log, "run", model.card)
    frames, _, _ = touch.read_recording(recording, SETTINGS)
    printed = np.array([line.split(",")[1:] for line in log.read_text().splitlines()[1:]], int)
    np.testing.assert_array_equal(read.x, printed[:, ORDER])
    np.testing.assert_array_equal(schemas.matrix(frames["v"]), read.x)
    assert np.flatnonzero(frames["gap_before"].to_numpy()).tolist() == GAPS

    predicted, _, notes = recordings.predict(model, read)
    came, of_live = live(package, log)
    values = np.stack([each.values for each in came])
    assert notes == of_live == [] and len(values) == len(predicted) == len(printed)
    missing = np.flatnonzero(np.isnan(predicted).any(axis=(1, 2)))
    assert missing.tolist() == [*range(WINDOW), *range(GAPS[-1], GAPS[-1] + WINDOW)], "windows span no gap"
    for others in (values, by_onnx(package, read)):
        np.testing.assert_array_equal(np.isnan(others), np.isnan(predicted))
        assert np.nanmax(np.abs(others - predicted)) < SAME * np.nanmax(np.abs(predicted))


def test_a_device_that_is_too_fast_is_predicted_as_one_that_is_not(package, tmp_path):
    """Its lines come at twice the rate of training, and a prediction takes longer than a line: every second is one."""
    readings = live_models.press(400)
    log = tmp_path / "single" / "run" / "array.log"
    log.parent.mkdir(parents=True)
    log.write_bytes(live_models.printed(readings, rate_hz=2 / live_models.INTERVAL_S))
    came, (note,) = live(package, log, step_s=0.012)
    assert note.endswith("one of 2 lines is predicted.") and [each.number for each in came] == list(range(1, 201))
    values, every_second = np.stack([each.values for each in came]), readings[::2, ORDER]
    at_once = predictor.load(package).predict(every_second)
    assert np.nanmax(np.abs(values - at_once)) < SAME * np.nanmax(np.abs(at_once))
    assert np.isnan(values).any(axis=(1, 2)).sum() == WINDOW
