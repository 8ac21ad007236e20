"""What `check` proposes for logs of other layouts and other ranges reads them once it is pasted into settings.yaml."""

import argparse
import errno
import os
import re
import shutil
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest
import yaml
from builders import free_targets
from builders import own_logs as written
from builders.project import ROOT

from tactile.base import params
from tactile.base.errors import InputError
from tactile.commands import check, own
from tactile.datasets import schemas
from tactile.drawing import check as check_figures
from tactile.experiments import strain
from tactile.logs import elements, layout
from tactile.logs.sniff import Proposal
from tactile.own import findings, recordings, summary
from tactile.own import logs as own_logs
from tactile.own import settings as own_settings
from tactile.targets import read as targets_read

PARAMS = params.load(ROOT / "params.yaml")
SENSOR = {"touch.sensor": {"rows": 2, "cols": 3, "pitch_mm": 10.0, "element_mm": 9.0, "order": []}}
SENSOR |= {"touch.label.map_rows": 8, "touch.label.map_cols": 9}


@pytest.fixture(autouse=True)
def undrawn(monkeypatch):
    """Without the picture, most of the time of a check."""
    monkeypatch.setattr(check_figures, "draw", lambda *arguments: None)


def values_of(folder, experiment):
    """The settings of a folder of logs, as `check`, `try` and `own` make them."""
    made = own_settings.write(ROOT / "params.yaml", folder.parent / "made", experiment, folder, [0], None)
    return params.load(made)


def checked(workspace, experiment, folder, capsys):
    """What `check` says first, and the lines of settings that it prints."""
    first = check.check(workspace, experiment, folder, values_of(folder, experiment))
    said = capsys.readouterr().out
    block = said.partition("settings.yaml:\n")[2].partition("\n\n")[0]
    return first, yaml.safe_load(block)


def pasted(folder, block):
    """Put lines of settings beside the logs."""
    given = own_settings.read(folder) | block
    (folder / own_settings.FILE).write_text(yaml.safe_dump(given))


@pytest.fixture(scope="module")
def touch_logs(tmp_path_factory):
    folder = tmp_path_factory.mktemp("touch") / "logs"
    written.touch(folder, 2, 3, 40.0, seconds=30.0, recordings=1, conditions=())
    pasted(folder, SENSOR)
    return folder


def edited(source, target, **edits):
    """A copy of logs in which each edit has changed the lines of the log that is called so."""
    for path in source.rglob("*"):
        if path.is_file():
            copy = target / path.relative_to(source)
            copy.parent.mkdir(parents=True, exist_ok=True)
            lines = path.read_text(errors="replace").splitlines()
            edit = edits.get(path.stem, lambda lines: lines)
            copy.write_text("\n".join(edit(lines)) + "\n")
    return target


def test_a_block_that_is_proposed_reads_the_logs_once_pasted(workspace, touch_logs, tmp_path, capsys):
    """Counts that fall, separated otherwise, and a load cell in words: found one after the other."""

    def turned(lines):
        for line in lines:
            time, *counts = line.split(",")
            yield "\t".join([time, *(str(1023 - int(v)) if v.isdigit() else v for v in counts)])

    def in_words(lines):
        return [line.replace(",", ", load ") for line in lines if line[:1].isdigit()]

    logs = edited(touch_logs, tmp_path / "logs", array=turned, load_cell=in_words)
    first, block = checked(workspace, "touch", logs, capsys)
    assert "array.log: is laid out in another way; paste the block" in first
    assert block == {"touch.ingest.format": {"array.log": {"separator": "\t"}, "load_cell.log": {"separator": "text"}}}
    pasted(logs, block)
    first, block = checked(workspace, "touch", logs, capsys)
    assert "the counts seem to fall when pressed" in first
    assert block["touch.ingest.format"]["array.log"] == {"separator": "\t", "rises_when_pressed": False}
    pasted(logs, block)
    assert checked(workspace, "touch", logs, capsys)[0] is None
    usual, other = (
        recordings.checked("touch", folder / "single" / "day1_0", values_of(folder, "touch")["touch"]).frames
        for folder in (touch_logs, logs)
    )
    assert np.array_equal(schemas.matrix(usual["v"]), schemas.matrix(other["v"]))
    assert schemas.matrix(other["force_n"]) == pytest.approx(schemas.matrix(usual["force_n"]), abs=1e-5, nan_ok=True)


def test_what_is_in_another_unit_keeps_its_sentence_beside_the_block(workspace, touch_logs, tmp_path, capsys):
    grams = edited(touch_logs, tmp_path / "logs", load_cell=lambda lines: [
        f"{line.split(',')[0]},{102 * float(line.split(',')[1]):.1f}" for line in lines if line.count(",") == 1
        and line[:1].isdigit() and line.split(",")[1].strip("-.0123456789") == "" and len(line.split(",")[1]) > 2
    ])  # fmt: skip
    first, block = checked(workspace, "touch", grams, capsys)
    assert "outside -1000 to 1000 N; write newtons" in first and first.endswith(f"; or {own_logs.PASTE}")
    assert block["touch.ingest.format"] == {"load_cell.log": {"scale": 0.00981, "separator": ","}}


@pytest.mark.parametrize(("shift", "said"), [(-5, "-5 N, not at 0.*5 N too low"), (-1.1, "too low"), (1.1, "too high")])
def test_a_load_cell_that_is_not_tared_is_named_on_both_sides_of_zero(
    workspace, touch_logs, tmp_path, capsys, shift, said
):
    def shifted(lines):
        whole = re.compile(r"(\d+),(-?\d+\.\d{3})")
        return [f"{m[1]},{float(m[2]) + shift:.3f}" if (m := whole.fullmatch(line)) else line for line in lines]

    logs = edited(touch_logs, tmp_path / "logs", load_cell=shifted)
    first, _ = checked(workspace, "touch", logs, capsys)
    wanted = r"write `offset: (\S+)` for load_cell.log into touch.ingest.format of settings.yaml"
    offset = float(re.search(rf"load_cell.log: fz_n rests at .*{said}; {wanted}", first)[1])
    assert offset == pytest.approx(-shift, abs=0.1)
    pasted(logs, {"touch.ingest.format": {"load_cell.log": {"offset": offset}}})
    assert checked(workspace, "touch", logs, capsys)[0] is None


@pytest.mark.parametrize(("volt", "rest"), [(3.3, 0.0), (1.0, 0.02)])
def test_readings_with_decimals_get_a_scale(workspace, touch_logs, tmp_path, capsys, volt, rest):
    """Of volts, also below 0: the block reads them as counts that differ from the device's by their rounding alone."""

    def volts(lines):
        for line in lines:
            time, *counts = line.split(",")
            good = counts and all(map(str.isdigit, counts))
            yield ",".join([time, *(f"{int(v) * volt / 1023 - rest:.4f}" for v in counts)]) if good else line

    logs = edited(touch_logs, tmp_path / "logs", array=volts)
    first, block = checked(workspace, "touch", logs, capsys)
    assert "is no whole number; write the converter's counts" in first and first.endswith(f"; or {own_logs.PASTE}")
    (layout_of,) = block["touch.ingest.format"].values()
    pasted(logs, block)
    assert checked(workspace, "touch", logs, capsys)[0] is None
    usual, other = (
        schemas.matrix(
            recordings.checked("touch", folder / "single" / "day1_0", values_of(folder, "touch")["touch"]).frames["v"]
        )
        for folder in (touch_logs, logs)
    )
    wanted = (usual * volt / 1023 - rest) * layout_of["scale"] + layout_of.get("offset", 0)
    assert ("offset" in layout_of) == (rest > 0) and np.abs(other - wanted).max() < 1 and other.max() > 0.3 * 1023


@pytest.mark.parametrize(
    ("change", "mended"),
    [
        (lambda v: v * 4, {"glove.sensor.areas": {"pressure": {"rows": 4, "cols": 4, "highest": 4095}}}),
        (
            lambda v: v - 20,
            {
                "glove.sensor.areas": {"pressure": {"rows": 4, "cols": 4, "lowest": -21, "highest": 1100}},
                "glove.sensor.scale": "range",
            },
        ),
        (
            lambda v: 1023 - v,
            {"glove.ingest.format": {"scanner.log": {"separator": ",", "rises_when_pressed": False}}},
        ),
    ],
    ids=["12 bits", "rest subtracted", "pull-ups"],
)
def test_a_mat_needs_its_areas_and_nothing_more(workspace, change, mended, tmp_path, capsys):
    """The manual's own kind of sensor: no protocols, no models; what its range should be is proposed."""
    rng, folder = np.random.default_rng(0), tmp_path / "logs"
    for name in ("ball", "cup"):
        for session in range(3):
            readings = np.clip(rng.normal(20, 5, (12, 16)), 0, None)
            readings[:, :3] = 980
            lines = [
                f"{50_000 * k}," + ",".join(map(str, change(np.rint(v)).astype(int))) for k, v in enumerate(readings)
            ]
            (folder / name / f"day{session}").mkdir(parents=True)
            (folder / name / f"day{session}" / "scanner.log").write_text("\n".join(lines) + "\n")
    (folder / "__MACOSX" / "._x").mkdir(parents=True)
    (folder / ".ipynb_checkpoints").mkdir()
    pasted(folder, {"glove.sensor.areas": {"pressure": {"rows": 4, "cols": 4}}})
    first, block = checked(workspace, "glove", folder, capsys)
    assert "readings of 'pressure' are" in first and block == mended
    pasted(folder, block)
    assert checked(workspace, "glove", folder, capsys)[0] is None
    assert list(values_of(folder, "glove")["glove"]["protocols"]) == ["session_pressure"]


def test_tasks_of_ones_own_are_run_without_a_word_of_protocols(tmp_path):
    folder = tmp_path / "logs"
    folder.mkdir()
    pasted(folder, {"strain.sensor.tasks": {"stretch": ["x"]}})
    assert values_of(folder, "strain")["strain"]["protocols"] == {"stretch": {"seeds": [0]}}


def test_a_log_without_times_takes_its_rate_from_the_others(tmp_path):
    (tmp_path / "array.log").write_text("1\n" * 401)
    beside = {"load_cell.log": own_logs.Log(pa.table({"time_s": np.linspace(3, 11.03, 500)}), None, {})}
    fmt = strain.Format((strain.CLOCK, strain.Column("v0", "V", -10, 10)), "t_s")
    found = own_logs.with_rate(tmp_path / "array.log", fmt, Proposal({"rate_hz": None}, []), beside)
    assert found.layout == {"rate_hz": 50.0} and "from how long the other logs last" in found.guesses[0]
    lines = own_logs.format_block("touch", {"array.log": [found]}, {"ingest": {"clock": "shared"}})
    assert lines[-1].startswith("touch.ingest.clock: own")


def test_elements_are_dead_by_the_step_of_their_own_kind():
    """A range of 0.7 V is no dead channel, and a mat in kPa has steps of 0.05."""

    def said(columns):
        rows = pa.table(columns)
        log = own_logs.Log(rows, None, {})
        return findings.stuck_elements("strain", [recordings.Checked(None, {"daq.log": log}, None, {}, [], {}, False)])

    moves, flickers = np.linspace(2.1, 2.8, 50).round(3), np.where(np.arange(50) % 9, 2.5, 2.5 + 0.014)
    assert said({"u0": moves, "u1": moves + 0.5}) == []
    (finding,) = said({"u0": np.linspace(2, 2.7, 51)[:50].round(3), "u1": flickers, "u2": np.full(50, 5.0)})
    assert finding == "2 of 3 elements never change (dead, or never touched): daq.log u1, daq.log u2"


def test_a_bridge_in_mv_per_v_is_not_dead():
    readings = -4e-4 + 2e-4 * np.sin(np.arange(400)[:, None] / [7, 11])
    assert strain._step(readings, "V") < 1e-6 and strain._step(1000 * readings, "V") == strain.STEP_V
    dead = np.where(np.arange(400)[:, None] % [5, 7], 2.5, 2.5 + 3.05e-4)
    assert strain._step(dead, "V") == pytest.approx(3.05e-4)


def test_a_checkout_that_cannot_be_written_is_checked_all_the_same(workspace, touch_logs, monkeypatch, capsys):
    def refused(*_):
        raise OSError(errno.EROFS, os.strerror(errno.EROFS))

    monkeypatch.setattr(check_figures, "draw", refused)
    values = values_of(touch_logs, "touch")
    assert check.check(workspace, "touch", touch_logs, values) is None
    assert "check.png cannot be written (Read-only file system)" in capsys.readouterr().out


def test_problems_of_one_kind_are_one_line():
    alike = [f"a/{k}/array.log: line {k} is '{k},2': v0 is {k}, outside 0 to 1" for k in range(5)]
    assert check.of_each_kind([*alike, "x.log: empty"]) == [f"{alike[0]} (and 4 more like this)", "x.log: empty"]


def test_the_kind_of_a_folder_is_told_by_its_logs_or_its_settings(tmp_path):
    (tmp_path / "a" / "b").mkdir(parents=True)
    with pytest.raises(InputError, match="no log of a sensor"):
        check.experiment_of(tmp_path)
    pasted(tmp_path, {"strain.sensor.channels": 3})
    assert check.experiment_of(tmp_path) == "strain"
    (tmp_path / "a" / "b" / "array.log").touch()
    assert check.experiment_of(tmp_path) == "touch"
    with pytest.raises(InputError, match="holds no scanner.log, but array.log; leave 'glove' out"):
        check.experiment_of(tmp_path, "glove")
    with pytest.raises(InputError, match="array.log: is a file; name the folder"):
        check.main(None, argparse.Namespace(experiment="touch", folder=tmp_path / "a" / "b" / "array.log"))


def test_centres_of_rbf_are_fewer_than_the_windows(workspace, capsys):
    """500 centres would need 500 windows; the paper's are far more."""
    values = params.load(workspace.params)
    values["touch"]["protocols"] = {"press": {"seeds": [0]}}
    part = pa.array(["train"] * 120 + ["test"] * 900).dictionary_encode()
    table = pa.table({schemas.split_column("press", 0): part})
    workspace.dataset("touch").parent.mkdir(parents=True)
    schemas.write(workspace.dataset("touch"), table.schema, [table])
    own.fit_centres(workspace, "touch", values)
    assert params.load(workspace.params)["touch"]["models"]["rbf"]["centres"] == 60
    assert "rbf: 120 windows train, fewer than 500 centres; it has 60" in capsys.readouterr().out


def test_whole_seconds_are_asked_for(tmp_path):
    """Times of 2 ms steps without decimals are one line a second; what the settings say of them is believed."""
    folder = tmp_path / "stretch" / "run0"
    folder.mkdir(parents=True)
    times = np.arange(0, 60_000, 2)
    for name in ("daq", "robot"):
        values = np.sin(times / 3e3)
        lines = [f"{t},{v:.4f}" for t, v in zip(times, values, strict=True)]
        (folder / f"{name}.log").write_text("\n".join(lines) + "\n")
    block = {
        "sensor": {"channels": 1, "tasks": {"stretch": ["x"]}},
        "ingest": {"max_reject_fraction": 0.01, "clock": "shared", "rate_hz": 5, "max_gap_s": 5.0, "format": {}},
    }
    block["ingest"] |= {"max_clock_offset_s": 5.0, "min_correlation": 0.5}
    (first, _) = recordings.checked("strain", folder, block).problems
    assert "daq.log: all times are whole numbers, 2 apart: are these milliseconds?" in first
    for unit, rate in (("ms", 500), ("s", 0.5)):
        block["ingest"]["format"] = {f"{name}.log": {"time_unit": unit} for name in ("daq", "robot")}
        recording = recordings.checked("strain", folder, block)
        assert not recording.problems and recording.logs["daq.log"].report["rate_hz"] == pytest.approx(rate)


def test_a_rate_that_changes_within_a_log_is_named():
    """Jitter and a device's restart are no change."""
    interval = np.repeat([0.01, 0.02], [300, 700]) + np.tile([-1e-3, 0, 1e-3, 0], 250)

    def of(interval, segment=0):
        time = np.cumsum(interval)
        columns = {"time_s": time, "segment": np.zeros(len(time), int) + segment, "line": np.arange(1, len(time) + 1)}
        return findings.changed_rate(pa.table(columns))

    assert of(interval).startswith("about 50 lines a second from line 301 on, 100 before: ")
    assert of(interval[:300]) is None and of(interval[300:]) is None and of(interval[250:310]) is None
    assert of(np.where(np.arange(700) == 350, 9.0, interval[300:]), np.arange(700) >= 350) is None


def test_logs_that_share_no_time_are_said_not_to_share_a_clock(tmp_path):
    folder = tmp_path / "stretch" / "run"
    folder.mkdir(parents=True)
    (folder / "daq.log").write_text("".join(f"{0.05 * k:.2f},{2 + k % 7 / 10}\n" for k in range(400)))
    (folder / "robot.log").write_text("".join(f"{1.7e9 + 0.05 * k:.2f},{k % 9}\n" for k in range(400)))
    block = PARAMS["strain"] | {"sensor": {"channels": 1, "tasks": {"stretch": ["x"]}}}
    block["ingest"] = block["ingest"] | {"clock": "shared"}
    recording = recordings.checked("strain", folder, block)
    assert "are none of daq.log's, 0 to 19.95 s, so they do not share a clock" in recording.problems[0]
    assert recording.clock_own and layout.of(block["ingest"], "daq.log") is None


def test_a_recording_that_is_there_twice_is_no_second_one(workspace, touch_logs, tmp_path, capsys):
    """Nor is one that does not change, or of half the rate, left without a word."""
    logs = edited(touch_logs, tmp_path / "logs")
    one = logs / "single" / "day1_0"
    shutil.copytree(one, logs / "single" / "day2")
    first, _ = checked(workspace, "touch", logs, capsys)
    assert first == (
        f"{logs}: single/day1_0 and single/day2 have the same array.log, byte for byte; keep one of them and remove "
        "the others, as training and test would share it"
    )
    asked = own_settings.Asked.model_validate(
        {"target": {"name": "object", "kind": "class", "folder": 1}, "split": {"by": "recording"}}
    )
    with pytest.raises(InputError, match="have the same array.log"):
        targets_read.own("touch", logs, values_of(logs, "touch")["touch"], asked)
    half = (one / "array.log").read_text().splitlines()[::2]
    (logs / "single" / "day2" / "array.log").write_text("\n".join(half) + "\n")
    check.check(workspace, "touch", logs, values_of(logs, "touch"))
    assert "single/day2 has 20 lines a second, single/day1_0 40: windows" in capsys.readouterr().out


def test_recordings_that_were_imported_with_unlike_gains_are_not_ready(workspace, touch_logs, tmp_path, capsys):
    logs = edited(touch_logs, tmp_path / "logs")
    one, other = logs / "single" / "day1_0", logs / "single" / "day2"
    edited(one, other, array=lambda lines: lines[:-9])
    for folder, scale in ((one, 100), (other, 500)):
        (folder / "origin.yaml").write_text(f"logs:\n  array.log: {{from: a.csv, scale: {scale}}}\n")
    first, _ = checked(workspace, "touch", logs, capsys)
    assert first.startswith(f"{other / 'origin.yaml'}: array.log was imported with {{scale: 500, offset: 0}}, but in ")


@pytest.mark.parametrize(("gain", "zero"), [(1.0, 40), (0.5, 0)])
def test_a_sensor_that_is_zeroed_or_scaled_on_the_way_is_named(workspace, touch_logs, tmp_path, capsys, gain, zero):
    def half_way(lines):
        rows = [line.split(",") for line in lines]
        for row in rows[len(rows) // 2 :]:
            row[1:] = [str(max(0, round(gain * int(count)) - zero)) if count.isdigit() else count for count in row[1:]]
        return [",".join(row) for row in rows]

    check.check(workspace, "touch", touch_logs, values_of(touch_logs, "touch"))
    assert "at rest read" not in capsys.readouterr().out
    logs = edited(touch_logs, tmp_path / "logs", array=half_way)
    check.check(workspace, "touch", logs, values_of(logs, "touch"))
    (line,) = [line for line in capsys.readouterr().out.splitlines() if "at rest read" in line]
    assert "single/day1_0: from 21.6 s of load_cell.log on" in line and line.endswith("make two recordings of it")


def test_a_recording_in_which_nothing_changes_is_named():
    def recording(name, values):
        log = own_logs.Log(pa.table({"p0": values, "p1": values}), None, {})
        return recordings.Checked(Path("logs", "cup", name), {"scanner.log": log}, None, {}, [], {}, False)

    read = [recording("a", np.arange(9)), recording("b", np.zeros(9))]
    assert findings.stuck_elements("glove", read)[0].startswith("no element changes in cup/b: ")
    assert not findings.stuck_elements("glove", read[:1])


def test_an_order_is_proposed_only_where_it_is_one_for_every_recording():
    """Of 3 elements in a row: 0 is never pressed, and 1 answers in its column."""
    settings = {"sensor": {"rows": 1, "cols": 3, "pitch_mm": 10.0}, "window": {"contact_threshold_n": 1.0}}
    pressed = np.tile([1] * 2 + [2] * 10, 21)
    force = np.where(np.arange(2 * len(pressed)) % 2, 0.0, 9.0)[:, None]
    at = np.repeat(pressed, 2)

    def said(of_days, stuck=()):
        day = np.arange(len(at)) * len(of_days) // len(at)
        high = 400 + 20 * (np.arange(len(at)) % 5)[:, None]
        v = np.where(force > 0, high * np.eye(3)[np.array(of_days)[day, at]], 5)
        if stuck:
            v[stuck] = 900
        names = {"condition": np.full(len(at), "single"), "recording": np.char.add("day", day.astype(str))}
        columns = {name: pa.array(values).dictionary_encode() for name, values in names.items()}
        frames, x = pa.table(columns | {"v": schemas.lists(v, pa.float32())}), 10.0 * at[:, None] + 5
        return elements.order_of_elements(frames, force, x, np.full_like(x, 5), settings)[1]

    plain, swapped = [0, 1, 2], [1, 0, 2]
    assert said([plain] * 3) == []
    assert said([swapped] * 3)[0].endswith("set touch.sensor.order: [1, 0, 2]")
    (some,) = said([plain, swapped, swapped])
    assert "where v1 should be, but not in single/day0, and no one order mends that" in some
    (one,) = said(
        [plain] * 3, stuck=(np.flatnonzero(at == 1), 0)
    )  # while element 1 is pressed, and between its presses
    assert one.startswith("v0 is high in 17 % of the time without a press") and "it is stuck" in one


def printed_by(workspace, experiment, folder, capsys):
    """What `check` prints of a folder of logs, and what it says first."""
    first = check.check(workspace, experiment, folder, values_of(folder, experiment))
    return first, capsys.readouterr().out


def test_lines_of_each_log_are_shown_once_with_what_is_read_from_them(workspace, touch_logs, tmp_path, capsys):
    """Also by a block that is only proposed: pounds are seen to become newtons there."""

    def in_words(lines):
        return [line.replace(",", ",Reading: ") + " lbs" for line in lines if re.fullmatch(r"\d+,-?[\d.]+", line)]

    logs = edited(touch_logs, tmp_path / "logs", load_cell=in_words)
    shutil.copytree(logs / "single/day1_0", logs / "single/day1_1")
    text = (logs / "single/day1_0/load_cell.log").read_text().splitlines()
    largest = max(range(len(text)), key=lambda k: abs(float(text[k].split()[1])))
    _, said = printed_by(workspace, "touch", logs, capsys)
    assert said.count("lines of it as printed") == 3  # array, load cell, cnc; not six
    block = said.partition("load_cell.log of single/day1_0: ")[2].splitlines()
    assert block[0] == "lines of it as printed, and what the block below would read from them"
    at = block.index(f"    line {largest + 1} (largest): {text[largest]}")
    time, force = text[largest].removesuffix(" lbs").split(",Reading: ")
    assert block[at + 1].startswith(f"    -> t_us {time} us = {int(time) / 1e6:.3f} s, ")
    assert f"; fz_n {float(force) * 4.4482216152605:.6g} N (printed times 4.44822)" in block[at + 1]


def every(lines, change):
    """The lines of an array with their counts changed by `change(number of the frame, counts)`; banners as they are."""
    number = 0
    for line in lines:
        time, *counts = line.split(",")
        if time.isdigit() and len(counts) == 6 and all(map(str.isdigit, counts)):
            counts = change(number, list(map(int, counts)))
            number += 1
        yield ",".join([time, *map(str, counts)])


def held(times):
    """What prints each frame `times` times."""
    kept = []

    def change(number, counts):
        kept[:] = kept if number % times else counts
        return kept.copy()

    return change


UNMEASURED = {
    "zeros": (
        lambda lines: every(lines, lambda k, counts: [0] * 6 if k % 3 == 2 else counts),
        r"33 % of the frames \(\d+\) read 0 in all 6 elements, far from the frames beside them \(single/day1_0 from",
    ),
    "frames printed 4 times": (
        lambda lines: every(lines, held(4)),
        r"each frame is printed (about )?4 times \(single/day1_0 from line \d+ on\): 10 frames a second are measured",
    ),
    "a stuck element": (
        lambda lines: every(lines, lambda k, c: [*c[:3], 77, *c[4:]] if k > 800 else c),
        r"v3 reads 77 for 7\.\d+ s without a change \(single/day1_0 from line 8\d\d on\)",
    ),
    "clipped": (
        lambda lines: every(lines, lambda k, counts: [min(count, 400) for count in counts]),
        r"the readings of \d of the elements are clipped at 400 \((v\d, )*v\d\): beyond that nothing is measured",
    ),
    "copies": (
        lambda lines: [line for line in lines for _ in range(2)],
        r"array.log: each line is there 2 times, with its time \(the first: line \d+ of single/day1_0; 1 of 1 "
        r"recordings\): copies are left out, and 40 lines a second count",
    ),
}


@pytest.mark.parametrize("kind", UNMEASURED)
def test_readings_that_are_no_measurement_are_found(kind, workspace, touch_logs, tmp_path, capsys):
    change, sentence = UNMEASURED[kind]
    text = (touch_logs / "single/day1_0/array.log").read_text(errors="replace")
    assert "\n" in text
    first, said = printed_by(workspace, "touch", edited(touch_logs, tmp_path / "logs", array=change), capsys)
    assert first is None or "copies" not in first
    assert len(re.findall(sentence, said)) == 1, said
    assert "re-zeroed" not in said  # which a stuck element looks like
    others = {name: one for name, (_, one) in UNMEASURED.items() if name != kind}
    assert [name for name, one in others.items() if re.search(one, said)] == []


def test_nothing_is_found_in_readings_that_are_measured(workspace, touch_logs, capsys):
    _, said = printed_by(workspace, "touch", touch_logs, capsys)
    assert [name for name, (_, one) in UNMEASURED.items() if re.search(one, said)] == []
    assert "stuck" not in said and "of the frames" not in said and "clipped" not in said and "copies" not in said


@pytest.mark.parametrize("mark", ["its own times", "times of milliseconds, semicolons"])
def test_a_block_for_doubled_lines_spreads_no_copies(mark, workspace, touch_logs, tmp_path, capsys):
    def doubled(lines):
        for line in lines:
            time, _, rest = line.partition(",")
            if time.isdigit() and mark != "its own times":
                line = f"{int(time) // 1000};{rest.replace(',', ';')}"
            yield from (line, line)

    logs = edited(touch_logs, tmp_path / "logs", array=doubled)
    _, block = checked(workspace, "touch", logs, capsys)
    if mark == "its own times":
        assert block is None
        return
    assert block["touch.ingest.format"]["array.log"] == {"separator": ";", "time_unit": "ms"}
    pasted(logs, block)
    _, said = printed_by(workspace, "touch", logs, capsys)
    assert "40.00 Hz" in said and "each line is there 2 times" in said


def iso(line):
    """A line with its seconds as a date."""
    seconds, _, rest = line.partition(",")
    return f"2024-05-01 12:00:{float(seconds):09.6f},{rest}"


TARGET_LAYOUTS = {
    "daq.log": {"daq": lambda line: line.replace(",", ";").replace(".", ",")},
    "arm.log": {"arm": lambda line: line.replace(",", ";").replace(".", ",")},
    "daq.log, arm.log": {"daq": iso, "arm": iso},
    "arm.log of milliseconds": {"arm": lambda line: f"{float(line.split(',')[0]) * 1e3:.0f}\t" + line.split(",", 1)[1]},
}


@pytest.mark.parametrize("kind", TARGET_LAYOUTS)
def test_with_a_target_check_proposes_how_logs_are_read(kind, tmp_path, capsys):
    """And once that is pasted, the target is what it was."""
    plain = free_targets.angles(tmp_path / "plain", people=("anna", "ben"), seconds=30)
    edits = {
        name: (lambda lines, change=change: [change(line) for line in lines])
        for name, change in TARGET_LAYOUTS[kind].items()
    }
    if "milliseconds" in kind:
        edits["arm"] = lambda lines: [
            f"{float(t) * 1e3:.0f};{a};{b}" for t, a, b in (line.split(",") for line in lines)
        ]
    logs, asked = edited(plain, tmp_path / "logs", **edits), own_settings.asked(plain)
    shutil.copy(plain / own_settings.FILE, logs / own_settings.FILE)
    first = check.check_target("strain", logs, values_of(logs, "strain")["strain"], asked, summary.Shown())
    said = capsys.readouterr().out
    assert "is laid out in another way; paste the block" in first
    assert said.count("lines of it as printed") == 2 and "-> t_s " in said and "; angle " in said
    pasted(logs, yaml.safe_load(said.partition("settings.yaml:\n")[2].partition("\n\n")[0]))
    settings = values_of(logs, "strain")["strain"]
    assert check.check_target("strain", logs, settings, asked) is None
    read, true = (
        targets_read.own("strain", folder, values_of(folder, "strain")["strain"], asked).series
        for folder in (logs, plain)
    )
    for one, other in zip(read, true, strict=True):
        assert one.truth == pytest.approx(other.truth, abs=1e-3) and one.reading == pytest.approx(other.reading)


def test_columns_that_are_no_readings_are_not_counted_as_such(workspace, touch_logs, tmp_path, capsys):
    """A checksum of a kind that is not known and a temperature are named, and no size of the array counts them."""
    noise = np.random.default_rng(0).normal(25, 1, 10**5)
    folder = edited(
        touch_logs, tmp_path / "logs", array=lambda lines: [f"{line},{noise[k]:.2f}" for k, line in enumerate(lines)]
    )
    first, _ = checked(workspace, "touch", folder, capsys)
    assert "column 8 has decimals, unlike the others" in first and "columns: [2, 3, 4, 5, 6, 7], width: 8" in first
    assert "1 x 7" not in first


@pytest.mark.parametrize(
    ("encoding", "unit"),
    [(lambda us: 638_406_720_000_000_000 + 10 * us, "100ns"), (lambda us: 10**18 + 1000 * us, "ns")],
)
def test_times_of_another_encoding_at_a_plausible_rate(encoding, unit, workspace, touch_logs, tmp_path, capsys):
    """Ticks read as microseconds would be a log of a tenth of its rate, which is possible, too."""

    def stamped(lines):
        fields = (line.partition(",") for line in lines if line[:1].isdigit())
        return [f"{encoding(int(t))},{rest}" for t, _, rest in fields]

    folder = edited(touch_logs, tmp_path / "logs", array=stamped, load_cell=stamped, cnc=stamped)
    first, block = checked(workspace, "touch", folder, capsys)
    assert first is not None and block["touch.ingest.format"]["array.log"]["time_unit"] == unit
    pasted(folder, block)
    again, _ = checked(workspace, "touch", folder, capsys)
    before, _ = checked(workspace, "touch", touch_logs, capsys)
    assert again == before


def test_two_days_are_told_from_two_months_by_the_logs_together(workspace, touch_logs, tmp_path, capsys):
    def stamped(lines):
        fields = (line.partition(",") for line in lines if line[:1].isdigit())
        begin = np.datetime64("2024-01-12T23:59:40")
        at = ((begin + np.timedelta64(int(t), "us"), rest) for t, _, rest in fields)
        return [f"{t.item():%m/%d/%Y %H:%M:%S.%f},{rest}" for t, rest in at]

    folder = edited(touch_logs, tmp_path / "logs", array=stamped, load_cell=stamped, cnc=stamped)
    _, block = checked(workspace, "touch", folder, capsys)
    pasted(folder, block)
    before, _ = checked(workspace, "touch", touch_logs, capsys)
    again, _ = checked(workspace, "touch", folder, capsys)
    assert again == before
