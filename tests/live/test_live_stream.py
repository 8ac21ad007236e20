"""What a page is told, without a browser: every event of the stream says what the model says of its line."""

import base64

import numpy as np
import pytest
from builders.live_models import FRAMES, STEP, map_over, press, printed
from test_live_server import Client

from tactile.inference import predictor
from tactile.live import server
from tactile.live.session import Session
from tactile.live.source import Lines, line_format


@pytest.fixture
def stream(package, monkeypatch):
    """`stream(kind, readings)`: the model's event, and a picture of each prediction, in turn."""
    monkeypatch.setattr(server, "PICTURE_S", 0.0)
    monkeypatch.setattr(server, "AHEAD", 1000)
    monkeypatch.setattr(Session, "_time_of_a_step", lambda self: 1e-4)  # every line is predicted
    pages = []

    def told(kind: str, readings: np.ndarray) -> tuple[dict, list[dict]]:
        model = predictor.load(package(kind))
        session = Session(model, Lines(line_format(model.card), "the log", "the model"), lambda _: None)
        page = server.Page(session, 0)
        pages.append(page)
        one = Client(int(page.address.split(":")[2].strip("/"))).send("GET", "/pictures")
        assert one.answer()[0] == 200
        name, of_model = one.event()
        assert name == "model"
        pictures = []
        for prediction in [*session.take(printed(readings), 0.0), *session.finish()]:
            page.add(prediction)
            name, picture = one.event()
            assert name == "picture" and picture["number"] == prediction.number == len(pictures) + 1
            pictures.append(picture)
        one.socket.close()
        assert len(pictures) == len(readings)
        return of_model, pictures

    yield told
    for page in pages:
        page.close()


def test_the_stream_of_an_array_has_the_map_and_the_force_of_each_line(stream):
    """The map of `linear` is known by hand: of the newest frame, as high over an element as its count says."""
    readings = press(40)
    of_model, pictures = stream("linear", readings)
    assert (of_model["unit"], of_model["map"], of_model["reading"]["grid"]) == ("kPa", [8, 12], [2, 3])
    window = (FRAMES - 1) * STEP
    for k, (picture, reading) in enumerate(zip(pictures, readings, strict=True)):
        assert picture["reading"] == reading.tolist() and picture["known"] == (k >= window)
        if k < window:
            assert "map" not in picture and "force_n" not in picture
            continue
        wanted = map_over(reading)
        drawn = np.frombuffer(base64.b64decode(picture["map"]), np.uint8).reshape(8, 12)
        assert picture["peak"] == pytest.approx(wanted.max(), abs=0.2)
        assert np.abs(drawn / 255 * picture["peak"] - wanted).max() < 0.01 * wanted.max()
        assert picture["t_s"] == pytest.approx(1 + 0.02 * k, abs=1e-3)
    assert pictures[-1]["force_n"] > 4 * pictures[window]["force_n"] > 0
    (touch,) = pictures[-1]["touches"]
    assert touch["kpa"] == pytest.approx(map_over(readings[-1]).max(), rel=0.02)


@pytest.mark.parametrize("kind", ["series", "images"])
def test_the_stream_of_another_sensor_has_its_outputs_by_name(kind, stream, package):
    rng = np.random.default_rng(0)
    readings = 2 + 0.1 * rng.normal(size=(12, 5)) if kind == "series" else rng.integers(1, 90, (12, 405))
    of_model, pictures = stream(kind, readings.round(4))
    wanted = predictor.load(package(kind)).predict(readings.round(4))
    names = ["x_mm", "y_mm"] if kind == "series" else ["bottle", "can", "cup"]
    assert of_model["names"] == names
    known = [k for k, picture in enumerate(pictures) if picture["known"]]
    assert known[-8:] == list(range(4, 12))
    for k in known:
        assert pictures[k]["reading"] == pytest.approx(readings[k].round(4).tolist(), abs=1e-3)
        assert [pictures[k][name] for name in names] == pytest.approx(wanted[k].tolist(), abs=2e-2)
        assert pictures[k]["values"] == pytest.approx(wanted[k].tolist(), abs=2e-2)
    if kind == "series":
        assert np.ptp([pictures[k]["x_mm"] for k in known]) > 0.1
