"""One prediction per line, frames as far apart as in training, and what goes to other programs."""

import csv
import io
import json
import socket

import numpy as np
import pytest
from builders.live_models import FRAMES, INTERVAL_S, STEP, map_over, press, printed
from builders.packets import arrived, stamps_us

from tactile.base.errors import InputError
from tactile.inference import predictor
from tactile.live import outputs
from tactile.live.session import Session
from tactile.live.source import Lines, line_format

SAME = 1e-3  # of the largest prediction: one reading is predicted with weights of 16 bits, many with float32
WINDOW = (FRAMES - 1) * STEP  # readings before the first one that ends a window


def session_of(folder) -> Session:
    model = predictor.load(folder)
    said = []
    session = Session(model, Lines(line_format(model.card), "array.log", "the model"), said.append)
    assert said == session.notes
    session._step_s = 1e-4  # measured, it is longer where other programs take the processor
    return session


def taken(session: Session, data: bytes) -> list:
    predictions = list(session.take(data, 0.0))
    return predictions + list(session.finish())


def test_a_device_of_four_times_the_rate_has_frames_as_far_apart(package):
    session = session_of(package("stream"))
    readings = press(480)
    values = np.stack([each.values for each in taken(session, printed(readings, rate_hz=4 / INTERVAL_S))])
    expected = predictor.load(package("stream")).predict(readings[3::4])
    assert session.notes == []
    assert np.abs(values[3::4][WINDOW:] - expected[WINDOW:]).max() < SAME * np.nanmax(np.abs(expected))


@pytest.mark.parametrize(("lost", "begins_anew"), [(4 * STEP - 1, False), (4 * STEP, True)])
def test_lost_lines_are_filled_up_to_those_from_one_frame_to_the_next(lost, begins_anew, package):
    kept = np.delete(np.arange(480), slice(300, 300 + lost))
    data = printed(press(480)[kept], times_us=np.rint(1e6 * kept * INTERVAL_S / 4).astype(int))
    values = np.stack([each.values for each in taken(session_of(package("linear")), data)])
    missing = np.isnan(values[300:]).any(axis=(1, 2))
    assert len(values) == 480 - lost and missing.any() == begins_anew
    assert missing.sum() == (4 * WINDOW if begins_anew else 0)


def test_a_slow_device_is_said_to_be(package):
    session = session_of(package("linear"))
    taken(session, printed(press(30), rate_hz=10))
    assert session.notes[0] == "The device prints 10 lines a second, fewer than the 50 of the model's training."
    assert session.notes[1].startswith("Frames are 0.1 s apart, in training 0.04 s: expect larger errors")


@pytest.mark.parametrize("hz", [100, 500])
def test_lines_in_packets_are_predicted_as_lines_one_by_one(hz, package, monkeypatch):
    monkeypatch.setattr(Session, "_time_of_a_step", lambda self: 1e-4)
    readings = press(3 * hz)
    printed_s = 1 + np.arange(3 * hz) / hz
    stamped = stamps_us(arrived(printed_s, 0.016, np.random.default_rng(0)))
    session = session_of(package("linear"))
    came = np.stack([each.values for each in taken(session, printed(readings, times_us=stamped))])
    single = np.stack([each.values for each in taken(session_of(package("linear")), printed(readings, rate_hz=hz))])
    assert len(came) == 3 * hz and session.notes == []
    np.testing.assert_array_equal(came, single)


def test_windows_span_no_gap_between_packets(package, monkeypatch):
    monkeypatch.setattr(Session, "_time_of_a_step", lambda self: 1e-4)
    printed_s = 1 + np.arange(1500) / 500
    printed_s[1000:] += 0.5
    data = printed(press(1500), times_us=stamps_us(arrived(printed_s, 0.016, np.random.default_rng(0))))
    values = np.stack([each.values for each in taken(session_of(package("linear")), data)])
    missing = np.flatnonzero(np.isnan(values).any(axis=(1, 2)))
    assert missing.tolist() == [*range(10 * WINDOW), *range(1000, 1000 + 10 * WINDOW)]


def test_lines_a_second_of_packets(package):
    session = session_of(package("linear"))
    for k in range(200):  # 16 lines every 16 ms
        list(session.take(printed(press(16), 1000, begin_us=1_000_000 + 16_000 * k), 0.016 * k))
    assert session.lines_per_s() == pytest.approx(1000, rel=1e-3)


def test_touches_and_force_of_a_press(package):
    predictions = taken(session_of(package("linear")), printed(press(120)))
    (touch,) = predictions[-1].touches
    peak = map_over(press(120)[-1]).max()
    assert touch.kpa == pytest.approx(peak, rel=0.02)
    assert 12 < touch.x_mm < 24 and 12 < touch.y_mm < 24, "over the element in the middle of the upper row"
    assert predictions[-1].force_n > 4 * predictions[WINDOW].force_n


def test_a_line_of_csv_and_a_datagram_per_prediction(package):
    session, text = session_of(package("linear")), io.StringIO()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as listening:
        listening.bind(("127.0.0.1", 0))
        listening.settimeout(5)
        places = [
            outputs.Table(text, session.card),
            outputs.Datagrams(f"127.0.0.1:{listening.getsockname()[1]}", session.card),
        ]
        predictions = taken(session, printed(press(60)))
        for prediction in predictions[-3:]:
            for place in places:
                place.add(prediction)
        said = json.loads(listening.recv(10_000))
    rows = list(csv.DictReader(io.StringIO(text.getvalue())))
    assert len(rows) == 3 and rows[0]["touches"] == "1"
    assert (
        float(rows[0]["p1_kpa"]) == said["touches"][0]["kpa"] == pytest.approx(predictions[-3].touches[0].kpa, abs=0.01)
    )
    assert said["force_n"] == pytest.approx(predictions[-3].force_n, abs=1e-3)


@pytest.mark.parametrize("kind", ["series", "images"])
def test_other_sensors_have_their_names_in_the_header(kind, package):
    card = predictor.load(package(kind)).card
    text = io.StringIO()
    outputs.Table(text, card)
    expected = {"series": "t_s,latency_ms,x_mm,y_mm\n", "images": "t_s,latency_ms,object,bottle,can,cup\n"}
    assert text.getvalue() == expected[kind]


@pytest.mark.parametrize("address", ["9000", "somewhere:x", "192.168.1.7:9000", "127.0.0.1:0"])
def test_datagrams_stay_on_this_machine(address, package):
    with pytest.raises(InputError, match="--udp"):
        outputs.Datagrams(address, predictor.load(package("linear")).card)
