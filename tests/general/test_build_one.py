"""docs/build_one.md: its numbers are those of the settings, and its sketch prints what is read."""

import re

import numpy as np
from builders.project import ROOT

from pipeline.scenes import readout
from tactile.base import params
from tactile.experiments import touch
from tactile.logs import parse

TEXT = (ROOT / "docs" / "build_one.md").read_text(encoding="utf-8")
SKETCH = TEXT.partition("```cpp\n")[2].partition("```")[0]
SCENE = params.load(ROOT / "params.yaml")["touch"]


def test_its_numbers_are_those_of_the_scene():
    circuit, sensor = SCENE["simulate"]["circuit"], SCENE["sensor"]
    assert f"{circuit['reference_ohm']:g} ohm" in TEXT and f"{circuit['driver_ohm']:g} ohm in each output" in TEXT
    assert f"{sensor['element_mm']:g} mm wide, {sensor['pitch_mm']:g} mm apart" in TEXT
    assert f"the {circuit['supply_v']:g} V" in TEXT and f"{circuit['adc_levels'] - 1} x 330" in TEXT
    every, rate = circuit["read_us"] / 1000, SCENE["simulate"]["devices"]["array_hz"]
    assert f"50 readings of {every:.2f} ms take {50 * every:.1f} ms of the {1000 / rate:g}" in TEXT
    assert re.search(r"PERIOD_US = (\d+)", SKETCH)[1] == f"{1e6 / rate:.0f}"


def test_a_single_element_reads_what_the_formula_says():
    for ohm in (1e3, 1e4):
        conductance = np.full((1, 5, 5), 1e-12)
        conductance[0, 2, 2] = 1 / ohm
        volts = readout.column_voltage(conductance, reference_s=1 / 330, supply_v=5.0, crosstalk=True)
        assert np.isclose(volts[0, 2, 2] / 5 * 1023, 1023 * 330 / (330 + ohm), rtol=1e-6)


def test_what_the_sketch_prints_is_read_as_it_stands(tmp_path):
    """Its loop is followed: a line of microseconds, then a comma and a count for each column of each row."""
    rows, cols = (len(re.search(rf"{name}\[\] = {{(.*?)}}", SKETCH)[1].split(",")) for name in ("ROWS", "COLS"))
    printed = re.findall(r"Serial\.print(?:ln)?\((.*?)\);", SKETCH)
    assert printed == ["micros()", "','", "analogRead(col)", ""]
    rng = np.random.default_rng(0)
    log = "".join(
        f"{24_800_305 + 20_000 * k}" + "".join(f",{count}" for count in rng.integers(20, 900, rows * cols)) + "\r\n"
        for k in range(50)
    )
    (tmp_path / "array.log").write_bytes(log.encode())
    read, rejects = parse.read_log(tmp_path / "array.log", touch.array_format(SCENE), limit=0.0, key="x", layout=None)
    assert read.num_rows == 50 and rejects.num_rows == 0
    example = TEXT.partition("reads without any settings:\n\n```\n")[2].partition("\n")[0]
    assert len(example.split(",")) == 1 + rows * cols
