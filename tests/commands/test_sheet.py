"""`tactile sheet` on logs as people bring them: what it prints, draws and refuses."""

import json

import numpy as np
import pytest
from builders import own_logs, pressed_sensors

from tactile.base import params
from tactile.base.errors import InputError
from tactile.commands import sheet
from tactile.sheet import quantities
from tactile.sheet.page import text
from tactile.sheet.quantities import QUANTITIES

ONE_ELEMENT = "touch.sensor: {rows: 1, cols: 1, pitch_mm: 12.0, element_mm: 11.5, order: []}\n"
ONE_ELEMENT += "touch.ingest.clock: shared\n"


def single_element(folder, presses=100, **truth):
    """Write the logs of one element and its load cell, stamped by one computer."""
    place = folder / "single" / "day1"
    place.mkdir(parents=True)
    peaks = np.linspace(17, 23, 7)
    at, force = pressed_sensors.force(presses, peaks, rest_s=1.0, hold_s=1.5, ramp_s=0.5, hz=25)
    counts = np.rint(pressed_sensors.reading(at, force, **truth))
    (place / "array.log").write_text("\n".join(own_logs.stamped(at, counts[:, None], "%d")) + "\n")
    (place / "load_cell.log").write_text("\n".join(own_logs.stamped(at, force[:, None], "%.3f")) + "\n")
    (folder / "settings.yaml").write_text(ONE_ELEMENT)
    return folder


def test_a_folder_of_logs_gives_numbers_reasons_and_a_picture(workspace, called, tmp_path):
    folder = single_element(workspace.root / "data" / "own" / "finger", loop=0.06, rest_per_h=0.4, noise=1.0)
    found = json.loads(called("sheet", folder, "--json"))["finger"]
    assert found["elements"] == 1 and found["stimulus"] == "N" and set(found["quantities"]) == set(QUANTITIES)
    lines = found["quantities"]
    assert lines["hysteresis"]["value"] == pytest.approx(6.0, rel=0.1)
    assert lines["drift of rest"]["value"] == pytest.approx(40, rel=0.1)
    assert lines["crosstalk"] == dict.fromkeys(("value", "low", "high", "smallest", "largest")) | {
        "unit": "%",
        "n": 0,
        "bound": "",
        "reason": "one element has no neighbour",
    }
    assert lines["response time"]["bound"] == "at most" and lines["response time"]["value"] > 300
    picture = tmp_path / "drawn" / "sheet.png"
    page = called("sheet", folder, "--figure", picture)
    assert picture.stat().st_size > 10_000 and "](sheet.png)" in page
    assert page.startswith("# Data sheet: finger\n") and "nan" not in page
    shown = next(line for line in page.splitlines() if line.startswith("| hysteresis"))
    assert text.significant(lines["hysteresis"]["value"]) in shown and shown.endswith(f" {lines['hysteresis']['n']} |")
    assert "- crosstalk: one element has no neighbour.\n" in page
    assert "| response time   | at most " in page
    for name in QUANTITIES:
        assert f"- {name}: " in page, name  # its definition


def test_arrays_strands_and_gloves_are_read_by_their_logs(workspace):
    own = workspace.root / "data" / "own"
    own_logs.touch(own / "array", 3, 4, 50, seconds=20)
    sensor = {"rows": 3, "cols": 4, "pitch_mm": 10.0, "element_mm": 9.0, "order": []}
    (own / "array" / "settings.yaml").write_text(f"touch.sensor: {sensor}\n")
    (array,) = sheet.sensors(workspace, params.load(workspace.params), str(own / "array"))
    assert array.shape == (3, 4) and [log.group for log in array.logs] == ["single", "single"]  # not `double`
    own_logs.strain(own / "finger", 4, 10, seconds=80)
    (own / "finger" / "settings.yaml").write_text("strain.sensor.channels: 4\n")
    (finger,) = sheet.sensors(workspace, params.load(workspace.params), str(own / "finger"))
    assert finger.elements == 4 and [log.group for log in finger.logs] == ["task_1"]  # z alone
    assert finger.logs[0].stimulus.min() >= 0
    own_logs.glove(own / "glove")
    pressure, bend = sheet.sensors(workspace, params.load(workspace.params), str(own / "glove"))
    assert (pressure.name, bend.name) == ("glove, pressure", "glove, strain") and pressure.stimulus == ""


def test_a_reason_that_many_quantities_have_is_said_once(workspace, called):
    folder = workspace.root / "data" / "own" / "glove"
    own_logs.few_channels(folder)
    areas = {"force": {"rows": 1, "cols": 5}, "motion": {"rows": 1, "cols": 5, "lowest": -180, "highest": 180}}
    (folder / "settings.yaml").write_text(f"glove.sensor.scale: range\nglove.sensor.areas: {areas}\n")
    page = called("sheet", folder, "--out", workspace.root / "out")
    assert not page and not (workspace.root / "out" / "sheet.png").exists()  # no press, nothing to draw
    page = (workspace.root / "out" / "README.md").read_text(encoding="utf-8")
    assert page.count("- sensitivity, non-linearity, hysteresis, ") == 2 == page.count(f": {quantities.NO_STIMULUS}.")
    assert set(json.loads((workspace.root / "out" / "sheet.json").read_text())) == {"glove, force", "glove, motion"}


def test_touches_of_several_tips_are_no_loading_cycles(workspace):
    folder = workspace.root / "data" / "own" / "array"
    own_logs.touch(folder, 2, 3, 50, seconds=20, recordings=0)
    sensor = {"rows": 2, "cols": 3, "pitch_mm": 10.0, "element_mm": 9.0, "order": []}
    (folder / "settings.yaml").write_text(f"touch.sensor: {sensor}\n")
    (array,) = sheet.sensors(workspace, params.load(workspace.params), str(folder))
    lines = quantities.sheet(array).lines
    assert all("no press in one place" in line.reason for name, line in lines.items() if name != "crosstalk")


def test_sheets_stand_side_by_side(workspace, called):
    own = workspace.root / "data" / "own"
    folders = [single_element(own / name, presses=10, loop=loop) for name, loop in (("one", 0.02), ("other", 0.1))]
    page = called("sheet", *folders)
    table = page.split("## one")[0].splitlines()
    assert any(line.startswith("| Quantity") and "one |" in line and "other |" in line for line in table)
    assert sum(line.startswith("| ") for line in table) == 2 + len(QUANTITIES)


def test_what_is_not_there_is_said(workspace):
    for source, words in (
        ("velostat_recorded", "no recordings; run `tactile fetch velostat_recorded`"),
        ("touch", "run `python -m pipeline.stages.simulate touch` first"),
        ("data/own/nothing", "there is no such folder"),
    ):
        with pytest.raises(InputError, match=words):
            list(sheet.sensors(workspace, params.load(workspace.params), source))


@pytest.mark.parametrize("value, shown", [(126.41, "126"), (0.007979, "0.00798"), (12345.6, "12300"), (-0.0, "0")])
def test_numbers_have_three_digits(value, shown):
    assert text.significant(value) == shown


@pytest.mark.slow
@pytest.mark.parametrize("name", ["velostat_recorded", "strain_recorded"])
def test_recorded_sensors_have_the_sheet_that_is_committed(recordings, workspace, name):
    """Numbers that the papers on such sensors make plausible; see reports/sheet."""
    place = workspace.sources / name
    place.parent.mkdir(parents=True)
    place.symlink_to(recordings(name))
    (sensor,) = sheet.sensors(workspace, params.load(workspace.params), name)
    lines = quantities.sheet(sensor).lines
    expected = {
        "velostat_recorded": {"hysteresis": (15, 35), "creep, 1 s": (8, 18), "signal to noise": (20, 40)},
        "strain_recorded": {"noise at rest": (1.8e-3, 2.2e-3), "drift of rest": (0, 15), "dead time": (100, 180)},
    }
    for quantity, (low, high) in expected[name].items():
        assert lines[quantity].told and low < lines[quantity].value < high, quantity
