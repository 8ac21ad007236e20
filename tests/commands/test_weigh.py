"""`tactile weigh` finds the scale and the offset of a load cell on which known weights lay."""

import argparse
import re

import numpy as np
import pytest
from builders.project import ROOT

from tactile.base import arguments
from tactile.base.errors import InputError
from tactile.base.paths import Workspace
from tactile.commands import weigh
from tactile.own import weights

G = 9.80665  # m/s2
RATE_HZ = 10.0
COUNTS_PER_N, REST = -4321.5, 8388.0  # of a cell that is built in upside down
WORDS = ["0", "200g", "500g", "1kg", "0"]
MASSES = [0.0, 0.2, 0.5, 1.0, 0.0]  # kg


def lay(rng: np.random.Generator, noise: float = 15.0) -> tuple[np.ndarray, np.ndarray]:
    """Return times and counts of a cell on which MASSES lie for 8 to 12 s, put down by hand within 2 s, one knocked."""
    spans = rng.uniform(8, 12, len(MASSES))
    turns = np.cumsum(np.c_[spans, np.full(len(spans), 2.0)].ravel())[:-1]
    time = np.arange(0, turns[-1], 1 / RATE_HZ)
    force = G * np.interp(time, np.r_[0, turns], np.repeat(MASSES, 2))
    force += 3 * np.exp(-(((time - spans[0] - 2 - spans[1] / 2) / 0.1) ** 2))
    return time, REST + COUNTS_PER_N * force + rng.normal(0, noise, len(time))


def run(capsys, path, words) -> tuple[str, dict]:
    """Return what is printed, and the result."""
    parser, result = argparse.ArgumentParser(), {}
    weigh.add_arguments(parser)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(arguments, "answer", lambda given, found: result.update(found))
        weigh.main(Workspace(ROOT), parser.parse_args([str(path), *words]))
    return capsys.readouterr().out, result


def logged(path, line="{0:.0f},{1:.0f}", rng=None):
    time, counts = lay(rng or np.random.default_rng(0))
    path.write_text("".join(f"{line.format(1e6 * t, c)}\n" for t, c in zip(time, counts, strict=True)))
    return path


@pytest.mark.parametrize("line", ["{0:.0f},{1:.0f}", "val: {1:.0f}", "{0:.0f}\t{1:.0f}"])
def test_scale_and_offset_are_those_of_the_cell(tmp_path, capsys, line):
    said, found = run(capsys, logged(tmp_path / "weights.log", line), WORDS)
    assert found["scale"] == pytest.approx(1 / COUNTS_PER_N, rel=1e-3)
    assert found["offset"] == pytest.approx(-REST / COUNTS_PER_N, abs=5e-3)
    assert max(map(abs, found["off_n"])) < 0.01 and found["forces_n"] == [G * mass for mass in MASSES]
    block = re.search(r"load_cell.log: \{.*\}", said)[0]
    assert f"scale: {found['scale']:.7g}" in block and f"offset: {found['offset']:.7g}" in block
    assert ("held (lines)" in said) == ("{0" not in line)


def test_the_intervals_hold_scale_and_offset_in_95_percent():
    rng, held = np.random.default_rng(1), []
    for _ in range(400):
        counts = REST + COUNTS_PER_N * G * np.array(MASSES) + rng.normal(0, 40, len(MASSES))
        line = weights.line(counts, [G * mass for mass in MASSES])
        scale, offset = abs(line.scale - 1 / COUNTS_PER_N), abs(line.offset + REST / COUNTS_PER_N)
        held.append((scale < line.scale_half, offset < line.offset_half))
    assert np.mean(held, axis=0) == pytest.approx([0.95, 0.95], abs=0.03)


def test_a_number_of_weights_that_does_not_fit_names_the_stretches(tmp_path, capsys):
    with pytest.raises(
        InputError, match=r"5 steady stretches, but 4 weights \(0 to [\d.]+ s at 838\d; .*name the weight"
    ):
        run(capsys, logged(tmp_path / "weights.log"), WORDS[:-1])


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["0", "200"], "'200': is no weight with its unit"),
        (["0", "heavy"], "'heavy': is no weight with its unit"),
        (["0", "2mm"], "'2mm' is a weight for weight, but 'mm' is a unit of length"),
        (["1kg"], "one weight tells no scale"),
        (["0"] * 5, "weights are all alike"),
    ],
)
def test_what_is_no_weight_is_one_sentence(tmp_path, capsys, words, said):
    with pytest.raises(InputError, match=re.escape(said)):
        run(capsys, logged(tmp_path / "weights.log"), words)


def test_weights_are_forces_by_standard_gravity():
    assert weights.force_n("1kg") == pytest.approx(G) and weights.force_n("0") == 0
    assert weights.force_n("250 g") == pytest.approx(0.25 * G) and weights.force_n("9.8N") == 9.8


def test_two_weights_have_a_line_and_no_interval():
    line = weights.line([100.0, 300.0], [0.0, 2.0])
    assert (line.scale, line.offset) == (0.01, -1.0) and np.isnan([line.scale_half, line.offset_half]).all()


def test_a_log_without_a_steady_stretch_has_none():
    rng = np.random.default_rng(0)
    assert not weights.held(np.arange(15) / 10, rng.normal(size=15))
    time = np.arange(300) / 10
    assert len(weights.held(time, rng.normal(0, 1, 300))) == 1  # noise alone is one weight
