"""The sentence for a log that cannot be read: what its usual line is, what is wrong with it, what to write instead."""

import re

import pytest

from tactile.experiments import strain, touch
from tactile.logs import diagnosis, parse

CELL = [f"{7_000_000 + 12_500 * k},{10 + 0.25 * (k % 7):.3f}" for k in range(40)]
DAQ = [f"{0.2 * k:.4f}," + ",".join(f"{2 + 0.01 * (k + c):.4f}" for c in range(3)) for k in range(40)]
FORMATS = {"load_cell.log": touch.LOAD_CELL, "daq.log": strain.formats({"sensor": {"channels": 3}})["daq.log"]}


def each(change):
    """An edit of the fields of every line."""
    return lambda lines: [",".join(change(line.split(","))) for line in lines]


WRONG = {  # file, edit of its lines, what is said
    "commas only": (
        "load_cell.log",
        lambda lines: [line.replace(".", ",") for line in lines],
        "have a comma; .* a point",
    ),
    "time last": ("load_cell.log", each(lambda v: v[::-1]), "column 2 seems to be the time; the order is t_us,fz_n"),
    "date": (
        "daq.log",
        each(lambda v: [f"2026-03-01 10:00:{float(v[0]):07.4f}", *v[1:]]),
        "time is no number; write seconds",
    ),
    "decimals of microseconds": (
        "load_cell.log",
        each(lambda v: [v[0] + ".0", v[1]]),
        r"t_us has decimals; write whole microseconds, \d+$",
    ),
    "a scale's words": (
        "load_cell.log",
        each(lambda v: [v[0], f"ST,GS,{v[1]} N"]),
        "words or units beside the numbers; a line is t_us,fz_n and nothing else",
    ),
    "hexadecimal": (
        "load_cell.log",
        each(lambda v: [f"{int(v[0]):x}", "1a"]),
        "hexadecimal numbers; write them in decimal",
    ),
    "seconds": ("load_cell.log", each(lambda v: [f"{int(v[0]) / 1e6:.6f}", v[1]]), "t_us is no whole .*seconds times"),
    "microseconds": (
        "daq.log",
        each(lambda v: [f"{float(v[0]) * 1e6:.0f}", *v[1:]]),
        "rises by 200000 s per line; write seconds",
    ),
    "millivolts": (
        "daq.log",
        each(lambda v: [v[0], *(f"{1e3 * float(u):.1f}" for u in v[1:])]),
        "u0 is 2.* write volts",
    ),
    "milligrams": (
        "load_cell.log",
        each(lambda v: [v[0], f"{1e5 * float(v[1]):.0f}"]),
        "outside -1000 to 1000 N; write newtons",
    ),
}


@pytest.mark.parametrize("header", [True, False])
@pytest.mark.parametrize("case", WRONG)
def test_the_mistake_is_named_with_a_line_of_the_log(case, header, tmp_path):
    name, edit, words = WRONG[case]
    lines = edit(CELL if name == "load_cell.log" else DAQ)
    (tmp_path / name).write_text("\n".join([FORMATS[name].header] * header + ["ready", lines[0][:5], *lines]) + "\n")
    said = diagnosis.unreadable(tmp_path / name, FORMATS[name])
    number, quoted = re.match(rf"{tmp_path / name}: line (\d+) is '(.*?)': ", said.replace("\\t", "\t")).groups()
    assert (tmp_path / name).read_text().splitlines()[int(number) - 1] == quoted
    assert re.search(words, said), said


def test_a_log_without_numbers_or_of_another_width_is_left_to_others(tmp_path):
    for text in ("", "ready\nready\n", "\n".join(f"{line},1.0" for line in DAQ)):
        (tmp_path / "daq.log").write_text(text)
        assert diagnosis.unreadable(tmp_path / "daq.log", FORMATS["daq.log"]) is None


def test_the_line_that_is_out_of_range_is_quoted(tmp_path):
    lines = CELL[:20] + each(lambda v: [v[0], "1530.5"])(CELL[20:])
    (tmp_path / "load_cell.log").write_text("\n".join(lines) + "\n")
    _, rejects = parse.read_log(tmp_path / "load_cell.log", touch.LOAD_CELL)
    said = diagnosis.out_of_range(tmp_path / "load_cell.log", rejects.to_pylist(), touch.LOAD_CELL)
    assert said.endswith(
        "line 21 is '7250000,1530.5': fz_n is 1530.5, outside -1000 to 1000 N; write newtons (grams times 0.00981, "
        "millinewtons divided by 1000)"
    )
