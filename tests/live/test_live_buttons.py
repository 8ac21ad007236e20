"""The buttons of the page in a real browser, by hand and by keyboard."""

import re
import time
from pathlib import Path

import numpy as np
import pytest
from builders.devices import until
from builders.live_models import map_over, press, printed, target
from builders.project import ROOT
from PIL import Image

from tactile.commands.live import Recorder
from tactile.inference import consistent, predictor
from tactile.live import server, target_stream, truth
from tactile.live.session import Session
from tactile.live.source import Lines, line_format
from tactile.targets import kept

pytestmark = pytest.mark.slow
PRESSED = "document.getElementById('{}').getAttribute('aria-pressed') === 'true'"
# All that is written into canvases from now on.
WRITTEN = """(() => {
  const fill = CanvasRenderingContext2D.prototype.fillText;
  window.written = [];
  CanvasRenderingContext2D.prototype.fillText = function (words, ...place) {
    window.written.push(words);
    fill.call(this, words, ...place);
  };
})()"""
RINGS = """(() => {
  const arc = CanvasRenderingContext2D.prototype.arc;
  window.rings = [];
  CanvasRenderingContext2D.prototype.arc = function (x, y, ...more) {
    window.rings.push([x, y]);
    arc.call(this, x, y, ...more);
  };
})()"""
# Of each picture that the page draws: the numbers beside the crosses, and the table.
WATCH = """(() => {
  const draw = paint;
  window.seen = [];
  paint = (...given) => {
    window.written.length = 0;
    draw(...given);
    const labels = window.written.filter((words) => /^\\d+: \\d+ kPa$/.test(words));
    const rows = [...document.querySelectorAll('#values tbody tr')].map((row) => row.cells);
    window.seen.push([labels, rows.map((cells) => `${cells[0].textContent}: ${cells[3].textContent} kPa`)]);
  };
})()"""


class Shown:
    """A page in a browser, and the session behind it, which is given lines."""

    def __init__(self, package, tab, kind: str = "linear", recorder=None, known=None, model=None):
        model = predictor.load(package(kind) if isinstance(kind, str) else kind) if model is None else model
        self.lines = Lines(line_format(model.card), "a port", "the model")
        self.session = Session(model, self.lines, lambda _: None)
        self.session._step_s = 1e-4
        self.tab, self.count = tab, 0
        self.page = server.Page(self.session, 0, recorder and recorder(self.lines), known)
        tab.width(1400)
        tab.open(self.page.address)

    def play(self, data: bytes, wait_s: float = 0.0) -> None:
        """Predict lines, and let the page draw what they come to."""
        for line in data.splitlines(keepends=True):
            for prediction in self.session.take(line, time.monotonic()):
                self.page.add(prediction)
                time.sleep(wait_s)
        until(lambda: self.tab.run(f"drawn?.number === {self.page.newest.number}"), 30)

    def rest(self, n: int, level: int, begin_s: float) -> None:
        """Play n readings at rest at a level in counts."""
        readings = np.full((n, 6), level)
        readings[:, 0] += np.arange(n) % 2
        self.play(printed(readings, begin_us=round(1e6 * begin_s)), wait_s=0.02)

    def click(self, name: str) -> None:
        self.tab.run(f"document.getElementById('{name}').click()")

    def words(self, name: str) -> str:
        return self.tab.run(f"document.getElementById('{name}').textContent")


@pytest.fixture
def shown(package, tab):
    """`shown(...)`: see Shown; closed with the test, and the console has nothing to say."""
    pages = []

    def one(*given, **more) -> Shown:
        pages.append(Shown(package, tab, *given, **more))
        return pages[-1]

    yield one
    for each in pages:
        each.page.close()
    assert tab.problems == []


def test_map_and_table_are_of_one_message(shown, tab):
    view = shown()
    view.play(printed(press(60)))
    tab.run(WRITTEN)
    tab.run(WATCH)
    readings = press(100)
    readings[:, 4] = 200 + 7 * np.arange(100)  # each prediction has another number
    view.play(printed(readings, begin_us=3_000_000), wait_s=0.02)
    seen = tab.run("window.seen")
    assert len({labels[0] for labels, _ in seen if labels}) > 10
    assert all(labels == rows for labels, rows in seen)


def test_colours_span_what_was_seen_and_the_scale_says_so(shown, tab):
    view = shown()
    tab.run(WRITTEN)
    readings = press(60)
    view.play(printed(readings))
    said, highest = tab.run("window.written"), map_over(readings[-1]).max()
    assert "kPa" in said and "20 counts" in said and "500 counts" in said
    after = said[len(said) - said[::-1].index("kPa") - 4 :]
    least, _, most = map(float, after[:3])
    assert least == 0 and highest <= most <= 1.5 * highest


def test_zero_shows_changes_and_leaves_the_predictions_alone(shown, tab):
    view = shown()
    view.rest(80, 100, 1.0)
    before = tab.run("shown.force_n")
    assert view.words("zeroed") == ""
    view.click("zero")
    assert tab.run(PRESSED.format("zero"))
    assert "Predictions" in view.words("zeroed") and "Recordings hold the lines as they come" in view.words("zeroed")
    label = "document.getElementById('reading').getAttribute('aria-label')"
    least, most = map(float, re.search(r"from (\S+) to (\S+) counts", tab.run(label)).groups())
    assert tab.run(label).startswith("Change of the reading") and -0.6 <= least <= 0 <= most <= 0.6
    view.rest(20, 130, 4.0)
    least, most = map(float, re.search(r"from (\S+) to (\S+) counts", tab.run(label)).groups())
    assert 29 <= least <= most <= 31
    assert tab.run("shown.reading[1]") == 130 and tab.run("shown.force_n") > before, "as the readings come"
    view.click("zero")
    assert view.words("zeroed") == "" and not tab.run(PRESSED.format("zero"))
    assert tab.run(label).startswith("Reading: 6 values from 130 ")


def test_what_is_frozen_stays_and_is_saved_as_a_picture(shown, tab, tmp_path):
    view = shown()
    view.play(printed(press(60)))
    assert tab.run("document.getElementById('save').disabled")
    view.click("freeze")
    assert view.words("frozen").startswith("Frozen at ") and tab.run(PRESSED.format("freeze"))
    pixels = "document.getElementById('prediction').toDataURL()"
    still, table = tab.run(pixels), view.words("values")
    view.play(printed(press(60, element=0), begin_us=3_000_000), wait_s=0.02)
    assert tab.run(pixels) == still and view.words("values") == table
    assert int(view.words("lines")) > 60, "the session goes on"
    tab.call("Browser.setDownloadBehavior", behavior="allow", downloadPath=str(tmp_path))
    tab.run(WRITTEN)
    view.click("save")
    until(lambda: list(tmp_path.glob("*.png")), 20)
    (file,) = tmp_path.glob("*.png")
    said = tab.run("window.written")
    assert re.fullmatch(r"touch_linear_\d{4}_\d\d_\d\d_\d\d_\d\d_\d\d\.png", file.name)
    assert said[0] == "touch/linear" and re.fullmatch(
        r"\d{4}-.* \d\d:\d\d:\d\d; [\d.]+ s on the sensor's clock", said[1]
    )
    picture = Image.open(file)
    assert picture.width > 900 and picture.height > 400
    assert len(np.unique(np.array(picture.convert("RGB")).reshape(-1, 3), axis=0)) > 60, "map, scale and words"
    view.click("freeze")
    assert view.words("frozen") == ""
    until(lambda: tab.run(pixels) != still and tab.run("shown.number") == 120, 10)


def test_record_by_keyboard_writes_what_the_port_prints(shown, tab, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    data = printed(press(200)).splitlines(keepends=True)
    recorders = []

    def recorder(lines):
        recorders.append(Recorder(lines, None, "array.log"))
        return recorders[0]

    view = shown(recorder=recorder)
    passed = recorders[0].recorded(iter(data))

    def on(n: int) -> None:
        view.play(b"".join(next(passed) for _ in range(n)))

    on(60)
    assert view.words("recording") == "none"
    tab.run("document.getElementById('record').focus()")
    tab.press("Enter")
    until(lambda: tab.run(PRESSED.format("record")), 10)
    on(80)
    until(lambda: view.words("recording").startswith("80 lines in live/"), 10)
    assert view.words("recorded").startswith("Recording each line as it comes to live/")
    tab.press("Enter")
    until(lambda: view.words("recording").endswith("array.log, ended"), 10)
    on(60)
    (file,) = Path("live").rglob("array.log")
    assert file.read_bytes() == b"".join(data[60:140]) and view.words("recorded") == ""


def test_what_cannot_be_recorded_is_said(shown, tab, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("live").write_text("a file")
    view = shown(recorder=lambda lines: Recorder(lines, None, "array.log"))
    view.play(printed(press(60)))
    view.click("record")
    until(lambda: view.words("recorded").startswith("Not recorded: live/"), 10)
    assert not tab.run(PRESSED.format("record"))


def test_a_replay_shows_its_truth_and_records_nothing(shown, tab):
    log = ROOT / "data" / "sample" / "double" / "two_touches" / "array.log"
    folder = ROOT / "pretrained" / "touch" / "lomp_stream"
    known = truth.beside(log, consistent.read(folder))
    view = shown(folder, known=known.of)
    tab.run(RINGS)
    raw = log.read_bytes().splitlines(keepends=True)
    taken = Lines(line_format(consistent.read(folder)), "array.log", "the model")
    first = next(
        k for k, line in enumerate(raw) if any(len(known.of(one).get("tips", ())) == 2 for one in taken.take(line))
    )
    view.play(b"".join(raw[: first + 10]))
    assert len(tab.run("shown.tips")) == 2
    assert len({tuple(ring) for ring in tab.run("window.rings")[-4:]}) == 2, (
        "each is drawn twice, in black and in white"
    )
    assert re.search(r"force \S+ N.*, on the load cells \S+ N", view.words("total"))
    assert "a ring is a tip that pressed" in view.words("prediction-scale")
    assert view.words("recording") == "a replayed log is a file already"
    assert tab.run("document.getElementById('record').disabled")


@pytest.mark.parametrize("kind", ["linear", "series", "images"])
@pytest.mark.parametrize("width", [390, 1400])
def test_each_sensor_fits_on_narrow_and_wide_screens(kind, width, shown, tab):
    """With all that can be said at once, and each button reached by the keyboard and named."""
    view = shown(kind)
    tab.width(width)
    rng = np.random.default_rng(0)
    readings = {
        "linear": press(60),
        "series": (2 + 0.1 * rng.normal(size=(60, 5))).round(4),
        "images": rng.integers(1, 90, (60, 405)),
    }[kind]
    view.play(printed(readings, rate_hz={"linear": 50, "series": 5, "images": 10}[kind]))
    reached = []
    for _ in range(3):
        tab.press("Tab")
        reached.append(tab.run("document.activeElement.textContent"))
        if reached[-1] in ("Freeze", "Zero"):
            tab.press("Enter")
    assert reached == ["Freeze", "Save picture", "Zero"]
    assert view.words("frozen") and view.words("zeroed")
    assert tab.run("document.documentElement.scrollWidth") <= width
    high = tab.run("[...document.querySelectorAll('button')].map((button) => button.getBoundingClientRect().height)")
    assert min(high) >= 24, "px, to be met by a finger"


@pytest.mark.parametrize("classes", [(), ("ball", "cup", "plate")])
def test_a_target_of_ones_own_is_shown_by_its_name(classes, shown, tab, tmp_path):
    folder = target(tmp_path / "model", classes, "extra trees above the start")
    view = shown(model=target_stream.Stream(kept.load(folder)))
    readings = np.random.default_rng(0).integers(0, 1000, (200, 6))
    view.play(printed(readings[:80], rate_hz=50))
    assert view.words("total") == "No prediction yet: the model first sees for 2 s what the sensor reads untouched."
    view.play(printed(readings, rate_hz=50, begin_us=2_600_000))
    assert view.words("name") == f"pad: {'object' if classes else 'angle'}"
    if classes:
        assert view.words("prediction-title") == "object"
        best = view.tab.run("shown.predicted")
        assert best in classes and view.words("total").startswith(f"Most likely: {best}; the 90 % set: {best}")
    else:
        assert view.words("prediction-title") == "angle in deg"
        value, low, high = (view.tab.run(f"shown.{name}") for name in ("angle_deg", "angle_low_deg", "angle_high_deg"))
        assert high - low == pytest.approx(0.2, abs=2e-3)
        row = view.tab.run("[...document.querySelectorAll('#values tbody td')].map((cell) => cell.textContent)")
        assert row == ["angle (line)", f"{value:.2f} ({low:.2f} to {high:.2f})"]
