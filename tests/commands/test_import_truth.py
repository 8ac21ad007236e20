"""A table with readings and a truth becomes logs of a sensor with a target, to the precision that is written in it."""

import numpy as np
import pandas as pd
import pytest
import yaml
from builders.project import ROOT

from tactile.base.paths import Workspace
from tactile.commands import targets
from tactile.commands.targets import Effort
from tactile.own import settings as own_settings
from tactile.targets import read

ROWS, STEP_S = 400, 0.05
AT = STEP_S * np.arange(ROWS)
START = pd.Timestamp("2024-03-13 10:00:00.25")


def made(seed, rest=0.0):
    """Return the truth (n,) and three readings (n, 3) that follow it, as they are written: with four decimals."""
    rng = np.random.default_rng(seed)
    angle = np.round(40 * np.sin(2 * np.pi * AT / 3.1) + 5 * np.sin(2 * np.pi * AT / 0.9 + seed), 4)
    return angle, np.round(rest + np.outer(angle, [0.02, -0.01, 0.015]) + rng.normal(0, 0.02, (ROWS, 3)), 4)


def table(readings, **columns):
    """A table of columns with what is no reading: a counter, a constant, a word."""
    beside = {"frame": np.arange(ROWS), "gain": 4.0, "note": "left"}
    return pd.DataFrame(columns | {f"R_{name}": v for name, v in zip("ABC", readings.T, strict=True)} | beside)


def data(folder):
    """All that is read of the folder by the settings that the command wrote."""
    values = own_settings.of_logs(Workspace(ROOT), "strain", folder)["strain"]
    return {one.name: one for one in read.own("strain", folder, values, own_settings.asked(folder)).series}


def written(folder):
    return yaml.safe_load((folder / "settings.yaml").read_text())


def test_iso_times_and_a_truth_that_is_known_now_and_then(workspace, called, tmp_path, monkeypatch):
    """The truth comes in every fourth row; the times of the readings and the truth are those of the file."""
    angle, readings = made(1)
    known = np.arange(ROWS) % 4 == 2
    file = tmp_path / "walk.csv"
    stamps = [(START + pd.Timedelta(milliseconds=50 * k)).isoformat() for k in range(ROWS)]
    table(readings, Time=stamps, angle=np.where(known, angle, np.nan)).to_csv(file, index=False)
    folder = workspace.root / "data" / "own" / "joint"
    said = called("import", file, folder, "--truth", "angle", "--unit", "deg")
    assert "3 readings: R_A, R_B, R_C" in said and "no reading: 'frame' counts the lines" in said
    assert "no reading: 'gain' is 4 throughout" in said and "no reading: 'note' is of words" in said
    assert "no reading: 'Time' is the time" in said and f"{ROWS} lines of readings, {known.sum()} of the truth" in said
    target = {"name": "angle", "unit": "deg", "kind": "continuous", "file": "truth.log", "column": 2}
    settings = {"strain.sensor.channels": 3, "strain.sensor.unit": "any", "target": target, "split": {"by": "time"}}
    assert written(folder) == settings
    (one,) = data(folder).values()
    assert np.array_equal(one.reading, readings)
    assert one.time_s - START.timestamp() == pytest.approx(AT, abs=1e-6)
    rows = np.loadtxt(folder / tmp_path.name / "walk" / "truth.log", delimiter=",", skiprows=1)
    assert np.array_equal(rows[:, 1], angle[known]) and rows[:, 0] - START.timestamp() == pytest.approx(AT[known])
    assert one.truth[known] == pytest.approx(angle[known], abs=1e-6)
    assert "\nready: " in called("check", folder)
    monkeypatch.setattr(targets, "LOOK", Effort(200, 5))
    called("try", folder)
    scores = pd.read_csv(workspace.reports / "own" / "joint" / "scores.csv")
    chosen = scores[(scores["model"] == "chosen on the other groups") & (scores["metric"] == "RMSE")]["value"]
    assert len(chosen) == 5 and chosen.max() < 6, "of angles of 45 degrees; the mean misses by 28"


def test_trials_of_one_file_keep_their_own_times(called, tmp_path):
    """In milliseconds; a reading that is missing is the one before, and rows without any reading are left out."""
    several = {k: made(k) for k in (3, 4, 5)}
    parts = [table(v, t_ms=1000 * AT + 7, load=a).assign(run=f"r{k}") for k, (a, v) in several.items()]
    rows = pd.concat(parts, ignore_index=True)
    rows.loc[5:ROWS:3, "R_B"] = np.nan
    rows.loc[ROWS + 8 : ROWS + 9, ["R_A", "R_B", "R_C"]] = np.nan
    rows.to_csv(tmp_path / "day.csv", index=False)
    folder = tmp_path / "skin"
    said = called("import", tmp_path / "day.csv", folder, "--truth", "load", "--trial", "run")
    assert "guessed: that a reading which is missing, in 33% of the rows, is the one before" in said
    assert "left out are 2 without a reading" in said and "no unit is said" in said
    assert written(folder)["target"]["unit"] == "a.u." and written(folder)["split"] == {"by": "recording"}
    found = data(folder)
    assert list(found) == [f"day/run-r{k}" for k in several]
    for k, (load, readings) in several.items():
        one, kept = found[f"day/run-r{k}"], np.ones(ROWS, bool)
        if k == 3:
            readings = readings.copy()
            readings[5:ROWS:3, 1] = readings[4 : ROWS - 1 : 3, 1]
        if k == 4:
            kept[8:10] = False
        assert np.array_equal(one.reading, readings[kept])
        assert one.time_s == pytest.approx(AT[kept] + 0.007, abs=1e-9)
        assert one.truth == pytest.approx(load[kept], abs=1e-9)
    assert "\nready: " in called("check", folder)


def test_files_of_several_persons_are_tested_by_person(called, tmp_path):
    several = {f"P{k}/walk{run}": made(10 * k + run, rest=k) for k in (1, 2) for run in (1, 2)}
    for name, (angle, readings) in several.items():
        path = tmp_path / "walks" / f"{name}.csv"
        path.parent.mkdir(parents=True, exist_ok=True)
        made_of = table(readings, time=AT).assign(**{"angle [deg]": angle})
        made_of.to_csv(path, index=False, sep=";", decimal=",")
    folder = tmp_path / "joint"
    called("import", tmp_path / "walks", folder, "--truth", "angle [deg]", "--group", r"(P\d)/")
    assert written(folder)["split"] == {"by": "session", "pattern": r"(P\d)/"}
    assert (written(folder)["target"]["name"], written(folder)["target"]["unit"]) == ("angle", "deg")
    found = data(folder)
    assert list(found) == list(several)
    for name, (angle, readings) in several.items():
        assert np.array_equal(found[name].reading, readings) and np.array_equal(found[name].truth, angle)
        assert set(found[name].group) == {name[:2]} and np.array_equal(found[name].time_s, AT)
    assert "\nready: " in called("check", folder)
    before = (folder / "settings.yaml").read_bytes()
    said = called("import", tmp_path / "walks", folder, "--truth", "angle [deg]", "--leave-out", "R_C")
    assert "is left as it is, but these logs need other lines in it: strain.sensor.channels: 2" in said
    assert (folder / "settings.yaml").read_bytes() == before


KINDS = {  # truth -> how it is written and read
    "class": (np.repeat(["cup", "none", "ball, red", "cup"], ROWS // 4), "there are 3 different words"),
    "event": (np.repeat([False, True, False, True], ROWS // 4), "values are true and false"),
    "whole": (np.repeat([3, 1, 7, 3], ROWS // 4), "there are 3 whole numbers; of a quantity say --unit"),
}


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("suffix", ["csv", "parquet", "xlsx"])
def test_classes_and_events_without_times(kind, suffix, called, tmp_path):
    truth, why = KINDS[kind]
    file, folder = tmp_path / f"hold.{suffix}", tmp_path / "hand"
    made_of = table(made(2)[1], what=truth)
    {"csv": made_of.to_csv, "parquet": made_of.to_parquet, "xlsx": made_of.to_excel}[suffix](file, index=False)
    with pytest.raises(SystemExit, match="has no times; say by --rate-hz how many rows a second there are"):
        called("import", file, folder, "--truth", "what")
    assert not folder.exists()
    called("import", file, folder, "--truth", "what", "--rate-hz", 50)
    target = {"name": "what", "kind": "event" if kind == "event" else "class", "file": "truth.log", "column": 2}
    assert written(folder)["target"] == target
    assert f"# guessed is the kind, {target['kind']}: {why}\n" in (folder / "settings.yaml").read_text()
    (one,) = data(folder).values()
    assert np.array_equal(one.reading, made(2)[1]) and one.time_s == pytest.approx(np.arange(ROWS) / 50)
    assert np.array_equal(one.truth, truth if kind == "event" else truth.astype(str))
    assert "\nready: " in called("check", folder)


@pytest.mark.parametrize("write", [np.save, np.savez])
def test_arrays_without_names(write, called, tmp_path):
    """Columns by their numbers; the first is the time as it rises."""
    angle, readings = made(6)
    file, folder = tmp_path / ("a.npy" if write is np.save else "a.npz"), tmp_path / "joint"
    columns = np.column_stack([AT, readings, angle])
    np.save(file, columns) if write is np.save else np.savez(file, arm=columns)
    called("import", file, folder, "--truth", "5", "--unit", "deg")
    (one,) = data(folder).values()
    assert np.array_equal(one.reading, readings) and np.array_equal(one.time_s, AT)
    assert np.array_equal(one.truth, angle)


def test_a_unit_of_time_is_a_guess_that_can_be_corrected(called, tmp_path):
    angle, readings = made(7)
    file, folder = tmp_path / "a.csv", tmp_path / "joint"
    table(readings, time=np.arange(ROWS) * 50.0 + 3, angle=angle).to_csv(file, index=False)
    said = called("import", file, folder, "--truth", "angle", "--unit", "deg")
    assert "guessed: the unit of the time, ms: then there are 20 lines a second" in said
    (one,) = data(folder).values()
    assert one.time_s == pytest.approx(AT + 0.003)
    origin = next(folder.rglob("origin.yaml"))
    assert "guessed is the unit of the time, ms" in origin.read_text()
    origin.write_text(origin.read_text().replace("time_unit: ms", "time_unit: s"))
    called("import", file, folder, "--truth", "angle", "--unit", "deg")
    assert next(iter(data(folder).values())).time_s == pytest.approx(50 * np.arange(ROWS) + 3)


def test_a_reading_that_is_the_truth_is_named(called, tmp_path):
    angle, readings = made(8)
    file, folder = tmp_path / "a.csv", tmp_path / "joint"
    table(readings, time=AT, angle=angle, knee=180 - 2 * angle).to_csv(file, index=False)
    said = called("import", file, folder, "--truth", "angle", "--unit", "deg")
    assert "'knee' follows the truth (|r| 1.0000): if it is no reading, say --leave-out 'knee'" in said
    said = called("import", file, tmp_path / "other", "--truth", "angle", "--unit", "deg", "--leave-out", "knee")
    assert "3 readings: R_A, R_B, R_C" in said and "no reading: 'knee' is named by --leave-out" in said


WRONG = {
    "no such column": (["--truth", "angel"], "--truth 'angel' is no column; did you mean 'angle'"),
    "a number beyond": (["--truth", "99"], "--truth '99' is no column; known: time, angle, R_A"),
    "constant": (["--truth", "gain"], "--truth 'gain': is 4 throughout; a target has two values or more"),
    "constant word": (["--truth", "note"], "--truth 'note': is left throughout"),
    "unit of words": (
        ["--truth", "who", "--unit", "N"],
        "--unit N: is of numbers, but 'who' has words, such as 'anna'",
    ),
    "unit alone": (["--unit", "deg"], "--unit goes with --truth, which names the column of the truth"),
    "group alone": (["--group", "(a)"], "--group goes with --truth"),
    "no brackets": (["--truth", "angle", "--group", "P1"], "'P1': has 0 pairs of brackets; put one around"),
    "no pattern": (["--truth", "angle", "--group", "("], "'\\(' is no regular expression"),
    "no match": (["--truth", "angle", "--group", "(P.)"], r"'\(P.\)': finds nothing in the path 'in/a'"),
    "no trial": (["--truth", "angle", "--trial", "whom"], "--trial 'whom' is no column; did you mean 'who'"),
    "no readings": (["--truth", "angle", "--readings", "x*"], "--readings x.: names no column; these are time, angle"),
    "of touch": (["--truth", "angle", "--of", "touch"], "leave --of out"),
}


@pytest.mark.parametrize("case", WRONG)
def test_wrong_use_is_one_sentence(case, called, tmp_path):
    words, sentence = WRONG[case]
    angle, readings = made(9)
    file, folder = tmp_path / "in" / "a.csv", tmp_path / "joint"
    file.parent.mkdir()
    who = np.repeat(["anna", "ben"], ROWS // 2)
    table(readings, time=AT, angle=angle).assign(who=who).to_csv(file, index=False)
    with pytest.raises(SystemExit, match=sentence) as refused:
        called("import", file, folder, *words)
    assert "\n" not in str(refused.value) and not folder.exists()


def test_files_of_other_columns_are_refused(called, tmp_path):
    angle, readings = made(10)
    table(readings, time=AT, angle=angle).to_csv(tmp_path / "a.csv", index=False)
    table(readings, time=AT, angle=angle).rename(columns={"R_B": "R_X"}).to_csv(tmp_path / "b.csv", index=False)
    with pytest.raises(SystemExit, match=r"b.csv: its columns are not those of .*a.csv, unlike in 'R_X'"):
        called("import", tmp_path / "a.csv", tmp_path / "b.csv", tmp_path / "joint", "--truth", "angle")
    called("import", tmp_path / "a.csv", tmp_path / "joint", "--truth", "angle", "--unit", "deg")
    with pytest.raises(SystemExit, match=r"a: was made of other columns than .*, unlike in 'R_X'"):
        called("import", tmp_path / "b.csv", tmp_path / "joint", "--truth", "angle", "--unit", "deg")


def test_columns_are_told_by_their_names_in_whatever_order(called, tmp_path):
    """--leave-out takes a pattern, too: the second truth of the other leg is no reading."""
    (tmp_path / "in").mkdir()
    for seed, name in ((11, "a"), (12, "b")):
        angle, readings = made(seed)
        rows = table(readings, time=AT, angle=angle, L_angle=angle[::-1], L_other=angle * 2)
        rows = rows[rows.columns[::-1]] if name == "b" else rows
        rows.to_csv(tmp_path / "in" / f"{name}.csv", index=False)
    folder = tmp_path / "joint"
    said = called("import", tmp_path / "in", folder, "--truth", "angle", "--unit", "deg", "--leave-out", "L_*")
    assert "3 readings: R_A, R_B, R_C" in said
    other = called(
        "import", tmp_path / "in", tmp_path / "knee", "--truth", "angle", "--unit", "deg", "--readings", "R_*"
    )
    assert "3 readings: R_A, R_B, R_C" in other and "no reading: 'L_other' is not named by --readings" in other
    found = data(folder)
    for seed, name in ((11, "in/a"), (12, "in/b")):
        assert np.array_equal(found[name].reading, made(seed)[1])
        assert found[name].truth == pytest.approx(made(seed)[0], abs=1e-6)


def test_rows_of_two_devices_one_below_the_other(called, tmp_path):
    """As tables are that were joined by their times: the truth, in the last column, has rows of its own."""
    angle, readings = made(11)
    one, other = table(readings, time=AT), pd.DataFrame({"time": AT[::3] + 0.02, "angle": angle[::3]})
    both = pd.concat([one.drop(columns=["gain", "note", "frame"]), other]).sort_values("time")
    both.to_csv(tmp_path / "a.csv", index=False)
    called("import", tmp_path / "a.csv", tmp_path / "joint", "--truth", "angle", "--unit", "deg")
    (found,) = data(tmp_path / "joint").values()
    assert np.array_equal(found.reading, readings) and np.array_equal(found.time_s, AT)
    between = np.interp(AT, AT[::3] + 0.02, angle[::3])
    assert found.truth[1:-1] == pytest.approx(between[1:-1], abs=1e-6)


def test_a_table_of_several_recordings_asks_for_the_column_that_tells_them_apart(called, tmp_path):
    parts = [table(made(k)[1], time=AT, angle=made(k)[0]).assign(run=k) for k in (1, 2)]
    pd.concat(parts).to_csv(tmp_path / "a.csv", index=False)
    sentence = "the time begins anew in row 401 of 800; .* tells them apart, such as --trial 'run'"
    with pytest.raises(SystemExit, match=sentence):
        called("import", tmp_path / "a.csv", tmp_path / "joint", "--truth", "angle", "--unit", "deg")
    assert not (tmp_path / "joint").exists()


def test_a_truth_in_another_table_than_the_times_is_refused(called, tmp_path):
    angle, readings = made(12)
    np.savez(tmp_path / "a.npz", t_s=AT, readings=readings, place=angle[:40])
    with pytest.raises(
        SystemExit, match="columns of 40: 'place' has no times beside it, but .*, columns of 400; write"
    ):
        called("import", tmp_path / "a.npz", tmp_path / "joint", "--truth", "place", "--rate-hz", "10")


def test_a_log_of_named_columns_is_told_of_this_command(called, tmp_path):
    """Its names are listed, not the digits of its times counted."""
    angle, readings = made(13)
    stamps = [(START + pd.Timedelta(milliseconds=50 * k)).isoformat() for k in range(ROWS)]
    place = tmp_path / "joint" / "bend" / "a"
    place.mkdir(parents=True)
    rows = table(readings, Time=stamps).drop(columns=["frame", "note"]).assign(knee=angle)
    rows.to_csv(place / "daq.log", index=False)
    (tmp_path / "joint" / "settings.yaml").write_text("strain.sensor.channels: 2\n")
    sentence = (
        r"daq.log: 5 columns beside the time, R_A, R_B, R_C, gain, knee, but 2 readings are set; .* --truth 'knee'`"
    )
    with pytest.raises(SystemExit, match=sentence):
        called("check", tmp_path / "joint")
    with pytest.raises(SystemExit, match=r"columns \(Time, R_A, R_B, R_C, gain, knee\) is the truth .* --truth COLUMN"):
        called("import", place / "daq.log", tmp_path / "new" / "bend" / "a", "--of", "strain")
