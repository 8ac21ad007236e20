"""Damaged input, thousands of times: no reader may crash, hang or lose a line without saying so.

Each test starts from valid input, damages it (hypothesis picks how and shrinks what fails), and holds the reader to
its promise: an InputError of one sentence, or every line accounted for. FUZZ=10000 tries that many inputs a reader.
"""

import bz2
import contextlib
import copy
import functools
import gc
import json
import math
import os
import re
import time
from collections import Counter
from pathlib import Path

import numpy as np
import pyarrow as pa
import pydantic
import pytest
import scipy.io
import scipy.sparse
import yaml
from builders import grasps, strain_workspaces, touch_logs
from builders.project import ROOT
from hypothesis import HealthCheck, example, given
from hypothesis import settings as examples
from hypothesis import strategies as st

from pipeline.scenes import strain as strain_scene
from tactile import models
from tactile.base import availability, params
from tactile.base.errors import InputError
from tactile.base.paths import Workspace
from tactile.datasets import fits, schemas, series
from tactile.datasets.windows import read_dataset
from tactile.experiments import glove, glove_recorded, strain, strain_recorded, touch, velostat_recorded
from tactile.learning.spec import Spec
from tactile.logs import parse
from tactile.scoring import estimates
from tactile.settings.shared import Block
from tactile.settings.touch import Touch

pytestmark = pytest.mark.slow


LONGEST_S = 1.0  # of processor time that one input may take
FUZZ = os.environ.get("FUZZ")


def fuzz(count: int, tests: int = 1):
    """Try `count` inputs, or as many as FUZZ says, divided among the `tests` of one reader."""
    quiet = [HealthCheck.function_scoped_fixture, HealthCheck.too_slow, HealthCheck.data_too_large]
    return examples(
        max_examples=-(-int(FUZZ) // tests) if FUZZ else count,
        deadline=None,
        suppress_health_check=quiet,
        derandomize=not FUZZ,
    )


@contextlib.contextmanager
def in_time():
    """Fails where the block takes more than LONGEST_S of processor time (not of wall time: machines are busy)."""
    gc.disable()  # the garbage of thousands of inputs before is not this one's: 1.4 s have been seen
    started = time.process_time()
    try:
        yield
    finally:
        gc.enable()
        assert time.process_time() - started < LONGEST_S


def one_sentence(error: InputError) -> str:
    text = str(error)
    assert text.strip() and "\n" not in text and "\r" not in text and len(text) < 2000, text
    return text


# Damage. A file is a list of lines with their ends; every damage takes it, a place and a random number.

ODD = b"nan -inf 1e400 1e-400 -0 0x10 +5 1_000 1e5 \xef\xbc\x95 5. .5 --1 1.2.3 TRUE null -1 32768".split(b" ")
ODD += [b"9" * 30, b"", b" ", b'"7"', b"\x00", b"7" * 70_000, b"0" * 40 + b"7"]


def field(lines, at, number, change, separator):
    """`change(field)` in place of one field of one line."""
    fields = lines[at].rstrip(b"\r\n").split(separator)
    k = number % len(fields)
    fields[k] = change(fields[k])
    lines[at] = separator.join(fields) + b"\n"


def scaled(text: bytes, factor: float) -> bytes:
    try:
        return repr(float(text) * factor).encode()
    except ValueError:
        return text + text


def shifted(lines, at, column, shift, separator):
    """The clock stands otherwise from this line on."""
    for k in range(at, len(lines)):
        fields = lines[k].rstrip(b"\r\n").split(separator)
        with contextlib.suppress(ValueError, IndexError, OverflowError):
            value = float(fields[column]) + shift
            fields[column] = (b"%d" % value) if b"." not in fields[column] else b"%.3f" % value
            lines[k] = separator.join(fields) + b"\n"


def damage(lines: list[bytes], how: str, at: int, number: int, noise: bytes, separator: bytes, clock: int) -> None:
    """Damage `lines` in place. `clock`: the column with the time."""
    if not lines:
        lines.append(noise)
        return
    at %= len(lines)
    line = lines[at]
    cut = number % (len(line) + 1)
    match how:
        case "noise line":
            lines[at] = noise + b"\n"
        case "noise inside":
            lines[at] = line[:cut] + noise + line[cut:]
        case "torn":
            lines[at] = line[:cut] + b"\n"
        case "torn and glued":
            lines[at] = line[:cut]
        case "doubled":
            lines[at:at] = lines[at : at + 1 + number % 5]
        case "lost":
            del lines[at : at + 1 + number % 5]
        case "late":
            lines.insert(number % len(lines), lines.pop(at))
        case "columns swapped":
            fields = line.rstrip(b"\r\n").split(separator)
            lines[at] = separator.join(fields[1:] + fields[:1]) + b"\n"
        case "columns of all swapped":
            for k, one in enumerate(lines):
                fields = one.rstrip(b"\r\n").split(separator)
                lines[k] = separator.join(fields[::-1]) + b"\n"
        case "unit":
            field(lines, at, number, lambda text: scaled(text, (1e3, 1e-3, 1e6, -1.0)[number % 4]), separator)
        case "unit of all":
            for k in range(len(lines)):
                field(lines, k, number, lambda text: scaled(text, (1e3, 1e-3, 1e6, -1.0)[number % 4]), separator)
        case "odd number":
            field(lines, at, number, lambda text: ODD[number % len(ODD)], separator)
        case "clock back":
            shifted(lines, at, clock, -(10.0 ** (number % 10)), separator)
        case "clock ahead":
            shifted(lines, at, clock, 10.0 ** (number % 14), separator)
        case "reset":
            lines[at:at] = [b"ready, 5 x 5\r\n", *lines[: number % len(lines)]]
        case "CRLF":
            lines[:] = [one.rstrip(b"\n") + b"\r\n" for one in lines]
        case "CR":
            lines[:] = [one.rstrip(b"\n") + b"\r" for one in lines]
        case "no last line end":
            lines[-1] = lines[-1].rstrip(b"\r\n")
        case "byte order mark":
            lines[at * (number % 2)] = b"\xef\xbb\xbf" + lines[at * (number % 2)]
        case "UTF-16":
            lines[:] = [b"".join(lines).decode("latin-1").encode("utf-16")]
        case "long line":
            lines[at] = line[:cut] + (noise or b"8") * 10_000 + line[cut:]
        case "empty lines":
            lines[at:at] = [b"\n", b" \t\n", b"\r\n"][: 1 + number % 3]
        case "end":
            del lines[at:]
        case _:
            raise AssertionError(how)


HOW = "noise line,noise inside,torn,torn and glued,doubled,lost,late,columns swapped,columns of all swapped,unit".split(
    ","
)
HOW += "unit,unit of all,odd number,clock back,clock ahead,reset,CRLF,CR,no last line end,byte order mark".split(",")
HOW += ["UTF-16", "long line", "empty lines", "end"]
DAMAGE = st.lists(
    st.tuples(st.sampled_from(HOW), st.integers(0, 400), st.integers(0, 9999), st.binary(max_size=8)), max_size=6
)


def damaged(lines: list[bytes], damages, separator: bytes = b",", clock: int = 0) -> bytes:
    lines = list(lines)
    for how, at, number, noise in damages:
        damage(lines, how, at, number, noise, separator, clock)
    return b"".join(lines)


# Logs, line by line.


def array_of(rows: int, cols: int) -> dict:
    """What the format of a touch array depends on, as params.yaml has it."""
    return {"sensor": {"rows": rows, "cols": cols}, "ingest": {"highest_count": 1023}}


FORMATS = {
    "touch array": touch.array_format(array_of(5, 5)),
    "touch load cell": touch.LOAD_CELL,
    "touch cnc": touch.CNC,
    "strain daq": strain.formats({"sensor": {"channels": 6}})["daq.log"],
    "strain robot": strain.formats({"sensor": {"channels": 6}})["robot.log"],
    "glove scanner": glove.scanner_format({"sensor": {}}),
}


@functools.cache
def valid_lines(fmt: parse.Format, count: int) -> list[bytes]:
    """Lines that all are rows, 20 ms apart."""
    found = []
    for k in range(count):
        values = []
        for number, column in enumerate(fmt.columns):
            if column.name == fmt.time:
                value = max(column.low, 0) + (20_000 * k if column.integer else 0.02 * k)
            else:
                value = min(column.high, 100.0) * ((7 * k + 3 * number) % 10) / 10
            values.append(f"{value:.0f}" if column.integer else f"{value:.3f}")
        found.append((fmt.separator.join(values) + "\n").encode())
    return found


def lines_of(content: bytes) -> list[bytes]:
    lines = content.removeprefix(b"\xef\xbb\xbf").split(b"\n")
    return lines[:-1] if not lines[-1] else lines


def held_to_its_promise(content: bytes, fmt: parse.Format, path: Path, pieces: int) -> None:
    """rows + rejects (+ header) = lines, each with its number and values; the same in any pieces; or one sentence."""
    path.write_bytes(content)
    lines = lines_of(content)
    try:
        with in_time():
            rows, rejects = parse.read_log(path, fmt)
    except InputError as error:
        assert one_sentence(error).startswith(f"{path}: ")
        if damaged_header := re.search(r": line (\d+) names ", str(error)):
            assert re.fullmatch(rb"[^0-9].*[a-z].*", lines[int(damaged_header[1]) - 1].strip())
            return
        printed_format = parse.printed_format(path, fmt)
        header = bool(lines) and parse.is_header(lines[0], printed_format)
        other = re.search(r": lasts \d+ s, more than|: the device was reset more than \d+ times", str(error))
        assert other or all(parse._reason(line, printed_format) for line in lines[header:])
        return
    printed_format = parse.printed_format(path, fmt)
    header = bool(lines) and parse.is_header(lines[0], printed_format)
    numbers = rejects["line"].to_pylist()
    assert sorted(rows["line"].to_pylist() + numbers) == list(range(1 + header, len(lines) + 1))
    assert numbers == sorted(numbers)
    assert set(rejects["reason"].to_pylist()) <= set(parse.REASONS)
    texts, kept = rejects["text"].to_pylist(), Counter()
    for reason, text in zip(rejects["reason"].to_pylist(), texts, strict=True):
        kept[reason] += 1
        assert (text is None) == (kept[reason] > parse.TEXTS)
    assert all(len(text) <= parse.TEXT_LENGTH and "\n" not in text for text in texts if text is not None)
    printed = [lines[number - 1].split(fmt.separator.encode()) for number in rows["line"].to_pylist()]
    for k, column in enumerate(printed_format.columns):
        values = rows[column.name].to_pylist()
        assert values == [float(fields[k]) for fields in printed]
        assert all(math.isfinite(value) and column.low <= value <= column.high for value in values)
    segment, clock = rows["segment"].to_numpy(), rows[fmt.time].to_numpy()
    assert segment[0] == 0 and set(np.diff(segment)) <= {0, 1}
    assert (np.diff(clock)[np.diff(segment) == 0] > 0).all()
    lost = rejects.num_rows - rejects["reason"].to_pylist().count(parse.DUPLICATE)  # with copies nothing is
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(parse, "PIECE", len(content) // pieces + 1)
        for one, other in zip((rows, rejects), parse.read_log(path, fmt), strict=True):
            assert one.to_pydict() == other.to_pydict()
        try:
            parse.read_log(path, fmt, limit=0.1, key="a.limit")
        except InputError as error:
            assert "cannot be used" in one_sentence(error) and lost > 0.1 * (rows.num_rows + lost)
        else:
            assert lost <= 0.1 * (rows.num_rows + lost)


@pytest.mark.parametrize("name", FORMATS)
@fuzz(50, len(FORMATS))
@given(damages=DAMAGE, header=st.booleans(), long=st.booleans(), pieces=st.sampled_from([1, 2, 7]))
def test_every_line_of_a_damaged_log_is_accounted_for(name, damages, header, long, pieces, tmp_path):
    fmt = FORMATS[name]
    lines = valid_lines(fmt, (8 if name == "glove scanner" else 130) if long else 4)
    lines = [fmt.header.encode() + b"\n"] * header + lines
    content = damaged(lines, damages, fmt.separator.encode(), fmt.names.index(fmt.time))
    held_to_its_promise(content, fmt, tmp_path / "device.log", pieces)


@pytest.mark.parametrize("name", FORMATS)
@fuzz(40, len(FORMATS))
@given(content=st.binary(max_size=300), pieces=st.sampled_from([1, 2, 300]))
def test_noise_is_no_log(name, content, pieces, tmp_path):
    held_to_its_promise(content, FORMATS[name], tmp_path / "device.log", pieces)


def test_a_megabyte_of_digits_and_a_letter_takes_no_hours(tmp_path):
    content = b"".join(valid_lines(touch.LOAD_CELL, 3)) + b"60000," + b"8" * 1_000_000 + b"x\n"
    held_to_its_promise(content, touch.LOAD_CELL, tmp_path / "device.log", 1)


@pytest.mark.parametrize("name", ["touch load cell", "strain daq"])
def test_a_wrong_time_in_the_last_line_is_named(name, tmp_path):
    """Aligned on a grid of 10 ms, years would fill any memory."""
    fmt = FORMATS[name]
    lines = valid_lines(fmt, 9)
    lines[-1] = b"41198000" + (b"0000" if fmt.names[0] == "t_us" else b"") + b"," + lines[-1].partition(b",")[2]
    (tmp_path / "device.log").write_bytes(b"".join(lines))
    with pytest.raises(InputError, match=r"device\.log: lasts \d{6,8} s, more .* in line 9; remove that line"):
        parse.read_log(tmp_path / "device.log", fmt)


def test_a_device_that_boots_again_and_again(tmp_path):
    """40,000 resets, more than an int16 counts: each is a segment of its own, or one sentence."""
    boot = b"ready\n" + b"".join(valid_lines(touch.LOAD_CELL, 4))
    held_to_its_promise(boot * 40_000, touch.LOAD_CELL, tmp_path / "device.log", 1)


# Recordings: all logs of one, aligned.


def accounted_for(recording, name: str, content: bytes, header: bytes | None) -> None:
    """Lines of the damaged file = accepted + rejected (+ header), by the report and by the rejects table.

    header None: of a log with a layout, which also ends lines at CR and does not count those that belong to no row.
    """
    _, rejects, report = recording
    lines = lines_of(content)
    lines = lines[1:] if lines and lines[0].strip() == header else lines
    assert report[name]["accepted"] + sum(report[name]["rejects"].values()) == report[name]["lines"]
    if header is not None:
        assert report[name]["lines"] == len(lines)
    else:
        assert 0 < report[name]["accepted"] <= report[name]["lines"] <= len(re.findall(rb"[^\r\n]+", content))
    for file, log in report.items():
        own = rejects.filter(np.array(rejects["file"].to_pylist()) == file) if rejects.num_rows else rejects
        assert own.num_rows == sum(log["rejects"].values())
        assert own["line"].to_pylist() == sorted(own["line"].to_pylist())
    json.dumps(report, allow_nan=False)


def finite(table) -> None:
    for name in table.column_names:
        values = table[name].combine_chunks()
        values = values.flatten() if hasattr(values, "flatten") and name not in ("condition", "recording") else values
        if values.type in ("double", "float"):
            assert np.isfinite(values.to_numpy(zero_copy_only=False)).all(), name


TOUCH = {name: [f"{line}\n".encode() for line in lines] for name, lines in touch_logs.logs_of(12.0).items()}
TOUCH_TWO = {
    name: [f"{line}\n".encode() for line in lines]
    for name, lines in touch_logs.logs_of(12.0, touches=2, shared=False).items()
}
LENIENT = {"max_reject_fraction": 0.9}


def spread(damages):
    """The places of DAMAGE, which are for short files, spread over a long one."""
    return [(how, at * 37, number, noise) for how, at, number, noise in damages]


@fuzz(25)
@given(name=st.sampled_from(sorted(TOUCH_TWO)), damages=DAMAGE, two=st.booleans())
@example(name="array.log", damages=[("CR", 0, 0, b""), ("clock back", 11, 0, b"")], two=True)  # no segment placed
@example(name="array.log", damages=[("clock ahead", 1, 4139, b"")], two=False)  # an hour of silence in the middle
@example(name="cnc.log", damages=[("end", 1, 0, b"")], two=False)
@example(name="load_cell_2.log", damages=[("end", 1, 0, b"")], two=True)
def test_a_damaged_touch_recording_is_accounted_for(name, damages, two, tmp_path_factory):
    files = TOUCH_TWO if two else TOUCH
    name = name if two else name.replace("_2", "")
    fmt = {"array": touch.array_format(array_of(2, 3)), "load_cell": touch.LOAD_CELL, "cnc": touch.CNC}[
        name.split(".")[0].removesuffix("_2")
    ]
    content = damaged(files[name], spread(damages))
    folder = tmp_path_factory.mktemp("touch") / "single" / "run"
    folder.mkdir(parents=True)
    for other, lines in files.items():
        (folder / other).write_bytes(content if other == name else b"".join(lines))
    settings = touch_logs.SETTINGS | {"ingest": touch_logs.SETTINGS["ingest"] | LENIENT}
    try:
        with in_time():
            found = touch.read_recording(folder, settings)
    except InputError as error:
        one_sentence(error)
    else:
        accounted_for(found, name, content, fmt.header.encode())
        assert found[0].num_rows == found[2]["array.log"]["accepted"] > 0
        assert (np.diff(found[0]["t_s"].to_numpy())[np.diff(found[0]["segment"].to_numpy()) == 0] > 0).all()


@pytest.fixture(scope="module")
def strain_recording():
    """Settings, and file -> lines of a simulated recording of task 1 of 400 s."""
    settings = copy.deepcopy(params.load(ROOT / "params.yaml")["strain"])
    settings["simulate"]["samples"] = 2000
    settings["ingest"] |= LENIENT
    recording = next(one for one in strain_scene.recordings(settings["simulate"]) if one.condition == "task_1")
    written = strain_scene.logs_of(recording, settings["simulate"], 6)
    return settings, {name: [f"{line}\n".encode() for line in lines] for name, (lines, _) in written.items()}


@fuzz(25)
@given(name=st.sampled_from(["daq.log", "robot.log"]), damages=DAMAGE)
@example(name="daq.log", damages=[("clock back", 229, 153, b""), ("clock ahead", 153, 467, b"")])  # 27 hours: 14 s
@example(name="daq.log", damages=[("clock ahead", 1, 3, b""), ("end", 2, 0, b"")])  # 15 s of samples in 17 minutes
@example(name="daq.log", damages=[*[("UTF-16", 0, 0, b"")] * 4, *[("doubled", 0, 0, b"")] * 2])  # 5 MB, no line good
def test_a_damaged_strain_recording_is_accounted_for(name, damages, strain_recording, tmp_path_factory):
    settings, files = strain_recording
    content = damaged(files[name], spread(damages))
    folder = tmp_path_factory.mktemp("strain") / "task_1" / "run"
    folder.mkdir(parents=True)
    for other in strain.formats(settings):
        (folder / other).write_bytes(content if other == name else b"".join(files[other]))
    try:
        with in_time():
            found = strain.read_recording(folder, settings)
    except InputError as error:
        one_sentence(error)
    else:
        accounted_for(found, name, content, strain.formats(settings)[name].header.encode())
        finite(found[0].select(["t_s", "v", "y_mm"]))


@fuzz(60)
@given(damages=DAMAGE)
@example(damages=[("odd number", 0, 0, b""), ("long line", 0, 0, b"")])  # 10,000 digits and a letter took seconds
def test_a_damaged_glove_session_is_accounted_for(damages, tmp_path_factory):
    lines = valid_lines(glove.scanner_format({"sensor": {}}), 20)
    content = damaged(lines, damages)
    folder = tmp_path_factory.mktemp("glove") / "mug" / "session"
    folder.mkdir(parents=True)
    (folder / glove.LOG).write_bytes(content)
    try:
        with in_time():
            found = glove.read_recording(folder, {"ingest": LENIENT, "sensor": {}})
    except InputError as error:
        one_sentence(error)
    else:
        accounted_for(found, glove.LOG, content, glove.scanner_format({"sensor": {}}).header.encode())
        assert found[0].num_rows == found[2][glove.LOG]["accepted"] > 0


@fuzz(60)
@given(device=st.sampled_from(["velostat_data", "futek_data"]), damages=DAMAGE)
@example(device="futek_data", damages=[("end", 1, 0, b"")])  # one force: nothing to interpolate
def test_a_damaged_velostat_recording_is_accounted_for(device, damages, tmp_path_factory):
    root = tmp_path_factory.mktemp("velostat")
    settings = params.load(ROOT / "params.yaml")["velostat_recorded"]
    settings |= {"ingest": settings["ingest"] | LENIENT}
    for name, first in (("velostat_data", 900.0), ("futek_data", 1.0)):
        path = root / name / "pike1" / "exp_pike1_sensor1_exp1.txt"
        path.parent.mkdir(parents=True)
        lines = [f"{first + k:.4f} {1.6e9 + k / 100:.6f}\n".encode() for k in range(60)]
        path.write_bytes(damaged(lines, damages, b" ", 1) if name == device else b"".join(lines))
    content = (root / device / "pike1" / path.name).read_bytes()
    try:
        with in_time():
            found = velostat_recorded.read_recording(root / "velostat_data" / "pike1" / path.name, settings)
    except InputError as error:
        one_sentence(error)
    else:
        accounted_for(found, f"{device}/{path.name}", content, None)
        finite(found[0].select(["t_s", "v", "force_n"]))


# Recorded sources: MATLAB workspaces, and compressed XML.

WEIRD = {
    "nothing": np.zeros((0, 0)),
    "one": np.ones((1, 1)),
    "NaN": np.full((3, 3), np.nan),
    "infinite": np.full((2, 20), np.inf),
    "far": np.full((800, 6), 1e308),
    "complex": np.ones((800, 6), complex),
    "cube": np.ones((4, 4, 4)),
    "flags": np.ones((800, 6), bool),
    "bytes": np.ones((800, 6), np.int8),
    "text": "t",
    "texts": np.array(["mug", "can"]),
    "cells": np.array(["a", "bc"], dtype=object),
    "struct": {"a": 1.0, "b": np.ones(3)},
    "sparse": scipy.sparse.csc_matrix(np.eye(6)),
    "one column": np.ones((800, 1)),
    "no columns": np.ones((800, 0)),
    "largest": np.full((2, 20), 2**64 - 1, np.uint64),
}
BYTES = st.lists(st.tuples(st.integers(0, 2**31), st.binary(min_size=1, max_size=8), st.booleans()), max_size=5)


def overwritten(content: bytes, changes, cut: int) -> bytes:
    """`content` with some bytes replaced or inserted, cut at a thousandth of its length."""
    content = bytearray(content)
    for at, new, inserted in changes:
        # Half of the changes go to the first 2 kB, where a file says what it holds.
        at = at // 2 % ((len(content) if at % 2 else min(len(content), 2000)) or 1)
        content[at : at if inserted else at + len(new)] = new
    return bytes(content[: len(content) * cut // 1000])


CUT = st.one_of(st.just(1000), st.integers(0, 1000))


@pytest.fixture(scope="module")
def workspaces(tmp_path_factory):
    """Plain and compressed bytes of a valid file of each kind."""
    folder, found = tmp_path_factory.mktemp("workspaces"), {}
    for name, content in (("strain_recorded", strain_workspaces.workspace()),):
        for compress in (False, True):
            scipy.io.savemat(folder / "file.mat", content, do_compression=compress)
            found[name, compress] = (folder / "file.mat").read_bytes()
    return found


def read_strain_recorded(path: Path) -> None:
    try:
        with in_time():
            frames, rejects, report = strain_recorded.read_recording(path, {"ingest": {"every": 3} | LENIENT})
    except InputError as error:
        assert path.name in one_sentence(error)
        return
    log = report[path.name]
    samples = len(scipy.io.loadmat(path, variable_names=["voltage"])["voltage"])
    assert log["accepted"] + rejects.num_rows == log["lines"] == samples
    assert rejects["line"].to_pylist() == sorted(rejects["line"].to_pylist())
    assert set(rejects["line"].to_pylist()) <= set(range(1, samples + 1))
    assert 0 < frames.num_rows <= log["accepted"]


MATLAB = {
    "strain_recorded": (read_strain_recorded, "para5_long.mat", strain_workspaces.workspace, strain_recorded.VARIABLES),
}


@pytest.mark.parametrize("name", MATLAB)
@fuzz(150)
@given(changes=BYTES, cut=CUT, compress=st.booleans())
@example(changes=[(286, bytes(2), False)], cut=1000, compress=False)  # an UnboundLocalError of scipy's
def test_a_damaged_workspace_is_one_sentence_or_whole(name, changes, cut, compress, workspaces, tmp_path):
    read, file, _, _ = MATLAB[name]
    path = tmp_path / file
    path.write_bytes(overwritten(workspaces[name, compress], changes, cut))
    read(path)


@pytest.mark.parametrize("name", MATLAB)
@fuzz(100)
@given(data=st.data())
def test_a_workspace_with_other_contents_is_one_sentence_or_whole(name, data, tmp_path):
    read, file, whole, variables = MATLAB[name]
    content = whole()
    for variable in data.draw(st.lists(st.sampled_from(sorted(variables)), min_size=1, max_size=2, unique=True)):
        how = data.draw(st.sampled_from(["turned", "cut", "mixed", *WEIRD]))
        value = np.array(content[variable])
        if how == "turned":
            content[variable] = value.T
        elif how == "cut":
            content[variable] = np.atleast_1d(value)[: value.size // 2]
        elif how == "mixed":
            flat = value.copy().reshape(-1)
            if flat.dtype.kind in "fiu":
                flat = flat.astype(float)
                flat[:: 1 + data.draw(st.integers(3, 50))] = data.draw(
                    st.sampled_from([np.nan, -np.inf, 1e308, -1, 1e6])
                )
            content[variable] = flat.reshape(value.shape)
        else:
            content[variable] = WEIRD[how]
    path = tmp_path / file
    scipy.io.savemat(path, content)
    read(path)


GRASP = grasps.xml(grasps.grasp()).encode().replace(b"><", b">\n<").splitlines(keepends=True)


@fuzz(150)
@given(damages=DAMAGE, changes=BYTES, cut=CUT, packed=st.booleans())
def test_a_damaged_grasp_is_one_sentence_or_accounted_for(damages, changes, cut, packed, tmp_path):
    content = damaged(GRASP, damages)
    if not packed:  # damage the XML, else the compressed file
        content = overwritten(content, changes, cut)
    compressed = bz2.compress(content)
    path = tmp_path / grasps.NAME
    path.write_bytes(overwritten(compressed, changes, cut) if packed else compressed)
    try:
        with in_time():
            frames, rejects, report = glove_recorded.read_recording(path, {"ingest": LENIENT})
    except InputError as error:
        assert path.name in one_sentence(error)
        return
    root = glove_recorded._parsed(path)
    for name, entries in ((path.name, "data/frame"), (f"{path.name}: joint angles", "joint_angles/angle")):
        own = rejects.filter(np.array(rejects["file"].to_pylist(), dtype=object) == name)
        assert report[name]["accepted"] + own.num_rows == report[name]["lines"] == len(root.findall(entries))
        assert own["line"].to_pylist() == sorted(set(own["line"].to_pylist()))
    finite(frames.select(["t_s", "pressure", "strain"]))


# Settings and results.

WHOLE = params.load(ROOT / "params.yaml")
SETTINGS = yaml.safe_dump({"touch": WHOLE["touch"]}, sort_keys=False).encode().splitlines(keepends=True)


@fuzz(40)
@given(damages=DAMAGE, changes=BYTES)
def test_a_damaged_params_file_is_one_sentence_or_read(damages, changes, tmp_path):
    path = tmp_path / "params.yaml"
    path.write_bytes(overwritten(damaged(SETTINGS, damages, b": "), changes, 1000))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(params, "Params", pydantic.create_model("TouchAlone", __base__=Block, touch=(Touch, ...)))
        try:
            params.load(path)
        except InputError as error:
            assert one_sentence(error).startswith(("params.yaml", "params/"))


VALUES = [None, True, -1, 0, 1.5, float("nan"), float("inf"), 10**400, "", "five", "1e-3"]
VALUES += [[], [1, [2]], [{}], {}, {"a": 1}]
VALUES += [{1: 2}, {None: 1}, [None], ["a", "a"], b"bytes", "x" * 100_000, [0] * 100_000]


@fuzz(300)
@given(data=st.data())
def test_a_setting_of_another_kind_is_one_sentence_or_taken(data):
    values = copy.deepcopy(WHOLE)
    block = values
    while True:
        key = data.draw(st.sampled_from(sorted(block, key=str)))
        if not isinstance(block[key], dict) or not block[key] or data.draw(st.integers(0, 3)) == 0:
            break
        block = block[key]
    block[key] = copy.deepcopy(data.draw(st.sampled_from(VALUES)))
    try:
        params.check(values)
    except InputError as error:
        assert one_sentence(error).startswith(("params.yaml", "params/"))


SCORES = [b"protocol,condition,model,seed,metric,unit,value\n"]
SCORES += [b"press,single,lomp,%d,rmse,kPa,%.3f\n" % (k, k + 0.5) for k in range(8)]


@fuzz(150)
@given(damages=DAMAGE, changes=BYTES)
def test_a_damaged_table_is_one_sentence_or_has_its_columns(damages, changes, tmp_path):
    columns = ["protocol", "seed", "value"]
    path = tmp_path / "scores.csv"
    path.write_bytes(overwritten(damaged(SCORES, damages, b",", 3), changes, 1000))
    try:
        table = estimates.read_csv(path, columns, "python -m tactile.stages.evaluate touch")
    except InputError as error:
        assert one_sentence(error).startswith(str(path))
    else:
        assert set(columns) <= set(table.columns)


FIT = json.dumps({"stop_reason": "completed", "best_epoch": 3, "epochs": 5, "parameters": 7, "run": True}).encode()


@fuzz(150)
@given(changes=BYTES, cut=CUT)
@example(changes=[], cut=0)
def test_a_damaged_json_file_is_one_sentence_or_read(changes, cut, tmp_path):
    check_json(tmp_path, overwritten(FIT, changes, cut))


@pytest.mark.parametrize("content", [b"[]", b"3", b"null", b'"run"', b"{}", b"\xff\xfe", b"[" * 100_000, b"9" * 5000])
def test_json_of_another_kind_is_one_sentence(content, tmp_path):
    assert not check_json(tmp_path, content)


def check_json(folder: Path, content: bytes) -> bool:
    """Whether the content is read as a fit; it must be by all readers of JSON, or be one sentence."""
    workspace = Workspace(folder)
    run = folder / "data" / "touch" / "models" / "lomp" / "press-0"
    run.mkdir(parents=True, exist_ok=True)
    (run / "history.csv").write_text("epoch,train_loss,validation_loss\n1,2.0,3.0\n")
    for path in (run / "fit.json", folder / "data" / "touch" / "ingest.json"):
        path.write_bytes(content)
    good = True
    readers = (
        lambda: estimates.read_fit(workspace, "touch", "lomp", "press", 0),
        lambda: availability.why_not_run(workspace, "touch"),
        lambda: fits.read(run, "dvc repro train"),
    )
    for read in readers:
        try:
            read()
        except InputError as error:
            one_sentence(error)
            good = False
    return good


SPEC = Spec(2, 2, 2, 4, 4)
SAVED = {
    "linear": {},
    "tree": {"each": "element", "min_samples_leaf": 2, "max_features": 1.0},
    "rnn": {"layers": 1, "hidden": 3, "training": WHOLE["touch"]["models"]["rnn"]["training"] | {"epochs": 1}},
    "esn": {"units": 5, "spectral_radius": 0.9, "leak": 0.3, "input_scale": 0.5, "ridge": 1e-6},
    "lstm_direct": {"units": 4, "training": WHOLE["strain"]["models"]["lstm_direct"]["training"] | {"epochs": 1}},
    "lstm_highpass": {
        "filters": 2,
        "taps": 2,
        "units": 3,
        "training": WHOLE["strain"]["models"]["lstm_highpass"]["training"] | {"epochs": 1, "length": 9, "warm_up": 1},
    },
}


def built(name: str):
    return models.build(name, SPEC, SAVED[name], "test")


@pytest.fixture(scope="module", params=SAVED)
def saved_model(request, tmp_path_factory):
    """Name of a model, and name and bytes of the one file that it is saved in."""
    folder, rng = tmp_path_factory.mktemp(request.param), np.random.default_rng(0)
    model = built(request.param)
    if hasattr(model, "step"):
        n = 100
        x, y = rng.normal(size=(n, 4)).astype(np.float32), rng.normal(size=(n, 16)).astype(np.float32)
        counted, training = np.ones(n, bool), np.arange(n) < 80
        model.fit([series.Record(x, y, counted, training, np.full(n, -1))], seed=0, device="cpu", base=None)
    else:
        part = rng.normal(size=(20, 2, 4)).astype(np.float32), rng.normal(size=(20, 16)).astype(np.float32)
        model.fit(part, part, seed=0, device="cpu")
    model.save(folder)
    (path,) = folder.iterdir()
    return request.param, path.name, path.read_bytes()


@fuzz(60)
@given(changes=BYTES, cut=CUT)
@example(changes=[], cut=0)
@example(changes=[], cut=500)
@example(changes=[(266, b"\x00\x00\x00\x00\x03", False)], cut=1000)
def test_a_damaged_model_is_one_sentence_or_loaded(saved_model, changes, cut, tmp_path):
    name, file, content = saved_model
    (tmp_path / file).write_bytes(overwritten(content, changes, cut))
    model = built(name)
    try:
        with in_time():
            model.load(tmp_path)
    except InputError as error:
        assert str(tmp_path) in one_sentence(error)


def test_a_network_of_another_kind_is_one_sentence(saved_model, tmp_path):
    name, file, content = saved_model
    (tmp_path / file).write_bytes(content)
    for other in SAVED.keys() - {name, "linear", "tree"}:
        with pytest.raises(InputError, match="other settings|train the model first") as error:
            built(other).load(tmp_path)
        one_sentence(error.value)


@fuzz(150)
@given(changes=BYTES, cut=CUT)
@example(changes=[], cut=0)
@example(changes=[], cut=500)
@example(changes=[(1372, b"\x00", False)], cut=1000)
@example(changes=[(62982, b"\x80", False)], cut=1000)
def test_a_damaged_dataset_is_one_sentence_or_read(changes, cut, tmp_path):
    path = tmp_path / "dataset.parquet"
    columns = {name: schemas.lists(np.ones((50, 4)), pa.float32()) for name in "xy"}
    table = pa.table(columns | {"condition": pa.array(["single"] * 50).dictionary_encode()})
    schemas.write(path, table.schema, [table])
    path.write_bytes(overwritten(path.read_bytes(), changes, cut))
    try:
        with in_time():
            read_dataset(path, 2, 2)
    except InputError as error:
        assert one_sentence(error).startswith(str(path))


def test_a_table_of_another_stage_is_one_sentence(tmp_path):
    table = pa.table({"v": [1.0]})
    schemas.write(tmp_path / "dataset.parquet", table.schema, [table])
    with pytest.raises(InputError, match="dataset.parquet: has no column 'x'; delete it and run `dvc repro`"):
        read_dataset(tmp_path / "dataset.parquet", 2, 2)
