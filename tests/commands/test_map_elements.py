"""`tactile map` finds the printed column of each element from presses in turn."""

import argparse
import re

import numpy as np
import pytest
from builders.project import ROOT

from tactile.base import arguments
from tactile.base.errors import InputError
from tactile.base.paths import Workspace
from tactile.commands import map_elements

ROWS, COLS, RATE_HZ = 3, 4, 50.0
WIRED = [7, 0, 11, 4, 2, 9, 1, 10, 3, 8, 5, 6]  # column of each element, row by row from the bottom


def log(path, pressed, falls=False, missing=(), line="{t:.0f},{values}"):
    """Write a log in which elements are pressed in turn, each for 0.6 s; a finger loads neighbours, too."""
    rng = np.random.default_rng(0)
    gain = np.exp(rng.normal(0, 0.4, ROWS * COLS))  # elements of one film differ
    time = np.arange(0, 1 + 1.4 * len(pressed), 1 / RATE_HZ)
    reading = 40 + rng.normal(0, 1.5, (len(time), ROWS * COLS)) + 3 * np.sin(time / 7)[:, None]
    for number, element in enumerate(pressed):
        begun = 1 + 1.4 * number
        course = np.clip(np.minimum(time - begun, begun + 0.6 - time) / 0.1, 0, 1)
        row, col = divmod(element, COLS)
        for other in range(ROWS * COLS):
            near = abs(other // COLS - row) + abs(other % COLS - col)
            if WIRED[other] not in missing:
                reading[:, WIRED[other]] += 300 * gain[other] * 0.25**near * course
    reading = 1023 - reading if falls else reading
    values = [",".join(f"{value:.0f}" for value in row) for row in np.clip(reading, 0, 1023)]
    path.write_text("".join(line.format(t=1e6 * t, values=v) + "\n" for t, v in zip(time, values, strict=True)))
    return path


def run(capsys, path, rows=ROWS, cols=COLS) -> tuple[str, dict]:
    """Return what is printed, and the result."""
    parser, result = argparse.ArgumentParser(), {}
    map_elements.add_arguments(parser)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(arguments, "answer", lambda given, found: result.update(found))
        map_elements.main(Workspace(ROOT), parser.parse_args([str(path), str(rows), str(cols)]))
    return capsys.readouterr().out, result


@pytest.mark.parametrize("falls", [False, True])
@pytest.mark.parametrize("line", ["{t:.0f},{values}", "{t:.0f};{values}", "{values}"])
def test_the_order_is_that_of_the_wires(tmp_path, capsys, falls, line):
    said, found = run(capsys, log(tmp_path / "pressed.log", range(12), falls, line=line))
    assert found["order"] == WIRED and f"touch.sensor.order: {WIRED}" in said
    shown = [list(map(int, re.findall(r"\d+", row))) for row in said.splitlines()[2:5]]
    assert shown == [WIRED[8:], WIRED[4:8], WIRED[:4]]  # the top row first
    assert "second column" not in said


def test_an_array_that_prints_as_it_is_pressed_needs_no_order(tmp_path, capsys):
    turn = [WIRED.index(column) for column in range(12)]
    said, found = run(capsys, log(tmp_path / "pressed.log", turn))
    assert found["order"] == list(range(12)) and "touch.sensor.order: []" in said and "nothing needs" in said


def test_a_finger_that_wavers_is_one_press(tmp_path, capsys):
    _, found = run(capsys, log(tmp_path / "pressed.log", [0, 1, 1, *range(2, 12)]))
    assert found["order"] == WIRED


@pytest.mark.parametrize(
    ("pressed", "missing", "said"),
    [
        (range(12), [4], r"no press has its strongest reading in column 4 \(from 0\)"),
        (range(11), [], r"11 presses of 12 elements: no press .* in column 6 \(from 0\); press every element once"),
        ([*range(12), 3], [], r"13 presses of 12 elements; some were pressed again: column 4 at [\d.]+ s and [\d.]+ s"),
        ([], [], "0 presses of 12 elements: no press has its strongest reading in columns 0, 1, 2"),
    ],
)
def test_presses_that_do_not_tell_every_element_are_named(tmp_path, capsys, pressed, missing, said):
    with pytest.raises(InputError, match=said):
        run(capsys, log(tmp_path / "pressed.log", pressed, missing=missing))


def test_a_log_of_another_array_is_one_sentence(tmp_path, capsys):
    with pytest.raises(InputError):
        run(capsys, log(tmp_path / "pressed.log", range(12)), 5, 5)
    with pytest.raises(InputError, match="two elements or more"):
        run(capsys, log(tmp_path / "pressed.log", range(12)), 1, 1)
