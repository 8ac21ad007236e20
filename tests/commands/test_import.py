"""Files of columns become logs that are read as those of the product's own recorder, and guesses are marked."""

import argparse

import h5py
import numpy as np
import pandas as pd
import pytest
import scipy.io
import yaml
from builders.project import ROOT

from tactile.base.errors import InputError
from tactile.base.paths import Workspace
from tactile.commands import import_logs
from tactile.experiments import strain, touch
from tactile.logs import parse
from tactile.own import settings as own_settings

ROWS = 300
T = 5 + 0.01 * np.arange(ROWS)
COUNTS = np.random.default_rng(0).integers(0, 1024, (ROWS, 6))
FORCE = np.round(10 * np.sin(T) ** 2, 3)
X, Y, Z = (np.round(20 + 10 * np.sin(T / k), 3) for k in (1, 2, 3))
ARRAY = touch.array_format({"sensor": {"rows": 2, "cols": 3}, "ingest": {"highest_count": 1023}})
SENSOR = {"touch.sensor": {"rows": 2, "cols": 3, "pitch_mm": 10.0, "element_mm": 9.0, "order": []}}
SENSOR |= {"touch.label.map_rows": 8, "touch.label.map_cols": 9}


@pytest.fixture(scope="module")
def of_touch(tmp_path_factory):
    """The settings of an array of 2 x 3 elements, which take a second to read."""
    folder = tmp_path_factory.mktemp("finger")
    (folder / "settings.yaml").write_text(yaml.safe_dump(SENSOR))
    return own_settings.of_logs(Workspace(ROOT), "touch", folder)


@pytest.fixture
def run0(tmp_path, monkeypatch, of_touch):
    """The folder of a recording of an array of 2 x 3 elements."""
    sensor = tmp_path / "finger"
    sensor.mkdir()
    monkeypatch.setattr(own_settings, "of_logs", lambda *_: of_touch)
    return sensor / "single" / "run0"


def imported(*words):
    """Run the command with these words."""
    parser = argparse.ArgumentParser()
    import_logs.add_arguments(parser)
    import_logs.main(Workspace(ROOT), parser.parse_args(list(map(str, words))))


def logs_of(folder):
    """The rows of the array, the load cell and the CNC."""
    formats = {"array": ARRAY, "load_cell": touch.LOAD_CELL, "cnc": touch.CNC}
    return {name: parse.read_log(folder / f"{name}.log", fmt)[0] for name, fmt in formats.items()}


def matrix(rows):
    """The values of the columns of a log, without its time."""
    names = [name for name in rows.column_names if name not in ("t_us", "line", "segment")]
    return np.column_stack([rows[name].to_numpy() for name in names])


def as_numpy(folder):
    np.savez(folder / "a.npz", t_ms=1e3 * T, taxels=COUNTS.reshape(ROWS, 2, 3), force_N=FORCE, x=X, y=Y, z=Z, fs=100.0)
    return "a.npz"


def as_matlab(folder):
    """Structures, arrays whose last axis is the time, and a device of another rate."""
    frames = {"time": T, "adc": np.moveaxis(COUNTS.reshape(ROWS, 2, 3), 0, -1)}
    stage = {"t": T[::2], "X": X[::2], "Y": Y[::2], "Z": Z[::2]}
    scipy.io.savemat(folder / "a.mat", {"frames": frames, "stage": stage, "load": {"t": T[:-1], "Fz": FORCE[:-1]}})
    return "a.mat"


def as_text(folder):
    """As Excel writes it where commas are decimal signs."""
    stamps = [f"12:00:{t:09.6f}" for t in T]
    table = pd.DataFrame({"Time": stamps} | {f"ch{k}": COUNTS[:, k] for k in range(6)})
    table = table.assign(Force=FORCE, x=X, y=Y, z=Z)
    (folder / "a.csv").write_text("Recorded on Tuesday\n" + table.to_csv(sep=";", decimal=",", index=False))
    return "a.csv"


def as_workbook(folder):
    """A sheet of each device, with a title above its columns."""
    columns = {"Time (s)": T} | {f"ch{k}": COUNTS[:, k] for k in range(6)}
    sheets = {"mat": pd.DataFrame(columns), "cell": pd.DataFrame({"t_s": T[:-1], "Force": FORCE[:-1]})}
    sheets["stage"] = pd.DataFrame({"t_s": T[::2], "x": X[::2], "y": Y[::2], "z": Z[::2]})
    with pd.ExcelWriter(folder / "a.xlsx", engine="openpyxl") as book:
        for name, table in sheets.items():
            table.to_excel(book, sheet_name=name, index=False, startrow=1)
            book.sheets[name]["A1"] = "Recorded on Tuesday"
    return "a.xlsx"


def as_parquet(folder):
    """As robots' data sets have it: lists of readings, a structure, words that are no reading."""
    columns = {"timestamp": T, "observation.state": COUNTS.tolist(), "task": ["hold"] * ROWS}
    columns |= {"stage": [{"x": x, "y": y, "z": z} for x, y, z in zip(X, Y, Z, strict=True)], "force_N": FORCE}
    pd.DataFrame(columns).to_parquet(folder / "a.parquet")
    return "a.parquet"


def as_hdf5(folder):
    """Groups, a scalar, a text, and links to another file, which are not followed."""
    with h5py.File(folder / "other.h5", "w") as file:
        file["ch0"] = np.full(ROWS, 7)
    with h5py.File(folder / "a.h5", "w") as file:
        file["mat/time_s"], file["mat/adc"] = T, COUNTS.reshape(ROWS, 2, 3)
        file["cell/t_s"], file["cell/force"], file["rate"] = T[:-1], FORCE[:-1], 100.0
        file["stage/t_s"] = T[::2]
        for name, values in (("x", X), ("y", Y), ("z", Z)):
            file[f"stage/{name}"] = values[::2]
        file["note"] = "recorded on Tuesday"
        file["outside"] = h5py.ExternalLink("other.h5", "ch0")
        layout = h5py.VirtualLayout((ROWS,), "i8")
        layout[:] = h5py.VirtualSource("other.h5", "ch0", (ROWS,))
        file.create_virtual_dataset("virtual", layout)
    return "a.h5"


SEVERAL = (as_matlab, as_workbook, as_hdf5)  # devices of rates of their own


@pytest.mark.parametrize("write", [as_numpy, as_matlab, as_text, as_workbook, as_parquet, as_hdf5])
def test_files_of_columns_are_read_as_logs(write, run0, tmp_path, capsys):
    imported(tmp_path / write(tmp_path), run0, "--of", "touch")
    read, every = logs_of(run0), slice(None, None, 2 if write in SEVERAL else 1)
    assert np.array_equal(matrix(read["array"]), COUNTS)
    assert np.array_equal(matrix(read["load_cell"])[:, 0], FORCE[: read["load_cell"].num_rows])
    assert np.array_equal(matrix(read["cnc"]), np.column_stack([X, Y, Z])[every])
    times = read["array"]["t_us"].to_numpy()
    assert times - times[0] == pytest.approx(1e6 * (T - T[0]), abs=1)
    said = capsys.readouterr().out
    assert ("write touch.ingest.clock: shared" in said) == (write not in SEVERAL)
    origin = yaml.safe_load((run0 / "origin.yaml").read_text())
    assert set(origin["logs"]) == {"array.log", "load_cell.log", "cnc.log"} and len(origin["sha256"]) == 1


def test_a_file_of_many_recordings_is_divided(run0, tmp_path, capsys):
    """As a data set of robots' episodes: each has its own time; the one of the highest readings sets the scale."""
    state = COUNTS / 1024 * np.repeat([0.2, 1.0, 0.5], ROWS // 3)[:, None]
    columns = {"episode_index": np.repeat([0, 1, 2], ROWS // 3), "timestamp": np.tile(T[: ROWS // 3] - T[0], 3)}
    file = tmp_path / "file-000.parquet"
    pd.DataFrame(columns | {"observation.state": state.tolist(), "force_N": FORCE}).to_parquet(file)
    imported(file, run0.parent, "--trial", "episode_index", "--of", "touch")
    said = capsys.readouterr().out
    assert f"next: `tactile check {run0.parents[1]}`" in said and "touch.ingest.clock: shared" in said
    counts = []
    for k in range(3):
        folder, rows = run0.parent / f"episode_index-{k}", slice(k * ROWS // 3, (k + 1) * ROWS // 3)
        assert np.array_equal(matrix(logs_of_cell(folder))[:, 0], FORCE[rows])
        read = parse.read_log(folder / "array.log", ARRAY)[0]
        assert np.ptp(read["t_us"].to_numpy()) == pytest.approx(1e6 * (T[ROWS // 3 - 1] - T[0]), abs=1)
        counts.append(matrix(read))
    seen, told = np.concatenate(counts).ravel(), state.ravel()
    scale, offset = np.polyfit(told, seen, 1)
    assert np.abs(seen - scale * told - offset).max() < 0.6  # one scale for all, to the rounding of a count


def test_trials_that_cannot_be_told_apart_are_refused(run0, tmp_path):
    file = tmp_path / "day.csv"
    pd.DataFrame({"run": ["a b", "a_b"] * 50, "time_s": T[:100]}).to_csv(file, index=False)
    with pytest.raises(InputError, match="no column trial; the columns are run, time_s"):
        imported(file, run0.parent, "--trial", "trial", "--of", "touch")
    with pytest.raises(InputError, match="a b and a_b of run are both run-a_b; rename one"):
        imported(file, run0.parent, "--trial", "run", "--of", "touch")


def test_a_guess_is_marked_and_can_be_corrected(run0, tmp_path, capsys):
    file = tmp_path / "day.csv"
    pd.DataFrame({"time_s": T, "weight": np.round(100 * FORCE), "temperature": 20 + 0 * T}).to_csv(file, index=False)
    imported(file, run0, "--of", "touch")
    origin = run0 / "origin.yaml"
    assert "guessed: that 'weight' is fz_n" in capsys.readouterr().out
    assert "# guessed is that 'weight' is fz_n" in origin.read_text()
    assert matrix(logs_of_cell(run0))[:, 0] == pytest.approx(np.round(100 * FORCE))
    first = origin.read_text()
    imported(file, run0, "--of", "touch")
    assert origin.read_text() == first  # who corrects nothing has confirmed nothing
    origin.write_text(first.replace("separator:", "scale: 0.01, separator:"))
    imported(file, run0, "--of", "touch")
    assert matrix(logs_of_cell(run0))[:, 0] == pytest.approx(np.round(100 * FORCE) / 100)
    origin.write_text(origin.read_text().replace("scale:", "scael:"))
    with pytest.raises(InputError, match=r"origin.yaml, load_cell.log: unknown key 'scael'; did you mean 'scale'"):
        imported(file, run0, "--of", "touch")


def logs_of_cell(folder):
    return parse.read_log(folder / "load_cell.log", touch.LOAD_CELL)[0]


def test_rows_without_times_need_a_rate(run0, tmp_path):
    file = tmp_path / "a.npz"
    np.savez(file, adc=COUNTS)
    with pytest.raises(InputError, match="a.npz: has no times; say by --rate-hz"):
        imported(file, run0, "--of", "touch")
    imported(file, run0, "--of", "touch", "--rate-hz", "50")
    assert parse.read_log(run0 / "array.log", ARRAY)[0]["t_us"].to_pylist()[:3] == [0, 20_000, 40_000]


@pytest.mark.parametrize("step_s", [0.02, 0.1])
def test_times_of_a_workbook_at_whole_seconds(step_s, run0, tmp_path, capsys):
    """Cells of times have no fraction of a second there."""
    times = [pd.Timestamp("2024-01-12 12:00:00") + pd.Timedelta(seconds=round(step_s * k, 3)) for k in range(ROWS)]
    columns = {"time": times} | {f"ch{k}": COUNTS[:, k] for k in range(6)}
    pd.DataFrame(columns).to_excel(tmp_path / "book.xlsx", index=False)
    imported(tmp_path / "book.xlsx", run0, "--of", "touch")
    rows, _ = parse.read_log(run0 / "array.log", ARRAY)
    assert np.array_equal(matrix(rows), COUNTS) and "left out" not in capsys.readouterr().out
    assert np.diff(rows["t_us"].to_numpy()) == pytest.approx(1e6 * step_s)


def test_rows_that_are_left_out_are_counted_with_their_reason_and_limited(run0, tmp_path, capsys):
    lines = [f"{t:.2f},{','.join(map(str, v))}" for t, v in zip(T, COUNTS, strict=True)]
    header = "time_s," + ",".join(f"ch{k}" for k in range(6))
    for wrong, row in ((1, ",1,2"), (20, "x,1,2,3,4,5,6")):
        file = tmp_path / f"{wrong}.csv"
        file.write_text("\n".join([header, *lines[:100], *[row] * wrong, *lines[100:]]) + "\n")
        if wrong == 1:
            imported(file, run0, "--of", "touch")
            said = capsys.readouterr().out
            assert f"{ROWS} lines from {file}; 1 rows are left out (column count 1; first: row 102, ',1,2')" in said
            continue
        with pytest.raises(InputError, match=r"6\.2% .*'not a number' \(20 lines\).*touch.ingest.max_reject_fraction"):
            imported(file, run0.with_name("run1"), "--of", "touch")
        assert not run0.with_name("run1").exists()


def test_nothing_is_written_over_and_what_cannot_be_read_is_said(run0, tmp_path):
    run0.mkdir(parents=True)
    (run0 / "array.log").write_text("kept")
    with pytest.raises(InputError, match="array.log: exists already"):
        imported(tmp_path / as_numpy(tmp_path), run0, "--of", "touch")
    assert [path.name for path in run0.iterdir()] == ["array.log"] and (run0 / "array.log").read_text() == "kept"
    (run0 / "array.log").unlink()
    np.savez(tmp_path / "words.npz", note=np.array(["a"]))
    np.savez(tmp_path / "few.npz", t=T, adc=COUNTS[:, :5])
    for name, content, words in (
        ("a.xlsx", b"PK", r"a.xlsx: not a whole workbook"),
        ("a.xls", b"\xd0\xcf", r"a.xls: a workbook of this kind is not read; save it as .xlsx"),
        ("a.mat", b"\x89HDF\r\n", "a.mat: not a whole HDF5 file"),
        ("a.parquet", b"PAR1", "a.parquet: not a whole Parquet file"),
        ("a.npy", b"\x93NUMPY", "a.npy: not a whole file of numpy"),
        ("a.npz", b"PK\x03\x04", r"a.npz: not a whole file of numpy's save or savez"),
        ("words.npz", None, r"words.npz: holds no columns of numbers \(note\)"),
        ("few.npz", None, r"few.npz: .*not as many readings as touch.sensor"),
        ("none.csv", None, r"none.csv: file not found"),
    ):
        if content:
            (tmp_path / name).write_bytes(content)
        with pytest.raises(InputError, match=words):
            imported(tmp_path / name, run0, "--of", "touch")
    assert not list(run0.iterdir())


def test_logs_of_strain_from_two_files(tmp_path):
    """Which file is of which device is told by its columns."""
    sensor = tmp_path / "skin"
    sensor.mkdir()
    (sensor / "settings.yaml").write_text(
        yaml.safe_dump({"strain.sensor.channels": 3, "strain.sensor.tasks": {"pull": ["x"]}})
    )
    volts = np.round(2 + 0.3 * np.sin(np.arange(ROWS * 3).reshape(ROWS, 3)), 5)
    np.savez(tmp_path / "daq.npz", time=T, v=volts)
    (tmp_path / "arm.txt").write_text("".join(f"{t:.2f} {x / 1000:.6f}\n" for t, x in zip(T, X, strict=True)))
    imported(tmp_path / "arm.txt", tmp_path / "daq.npz", sensor / "pull" / "run0")
    formats = strain.formats({"sensor": {"channels": 3, "tasks": {"pull": ["x"]}}})
    daq, robot = (
        parse.read_log(sensor / "pull" / "run0" / name, formats[name])[0] for name in ("daq.log", "robot.log")
    )
    assert np.array_equal(np.column_stack([daq[f"u{k}"].to_numpy() for k in range(3)]), volts)
    assert robot["x_mm"].to_numpy() == pytest.approx(X, abs=1e-3)
    assert "# guessed is that places are in metres" in (sensor / "pull" / "run0" / "origin.yaml").read_text()


@pytest.mark.parametrize(("unit", "newtons"), [("kN", 1e3), ("mN", 1e-3), ("lbf", 4.4482216152605), ("kPa", None)])
def test_a_unit_in_a_header_is_converted_or_refused(unit, newtons, run0, tmp_path, capsys):
    file = tmp_path / "day.csv"
    columns = {"time (s)": T} | {f"ch{k}": COUNTS[:, k] for k in range(6)} | {f"Force ({unit})": FORCE / (newtons or 1)}
    pd.DataFrame(columns | {"x (in)": X / 25.4, "y (in)": Y / 25.4, "z (in)": Z / 25.4}).to_csv(file, index=False)
    imported(file, run0, "--of", "touch")
    said, origin = capsys.readouterr().out, (run0 / "origin.yaml").read_text()
    assert "the header says in\n" in said and "# the header says in\n" in origin
    assert matrix(parse.read_log(run0 / "cnc.log", touch.CNC)[0]) == pytest.approx(np.column_stack([X, Y, Z]))
    if newtons is None:
        assert f"load_cell.log: {file}: line 1 names the column 'Force (kPa)'" in said
        assert not (run0 / "load_cell.log").exists()
    else:
        assert f"the header says {unit}\n" in said
        assert matrix(logs_of_cell(run0))[:, 0] == pytest.approx(FORCE)


def test_of_several_files_a_refused_unit_is_named(run0, tmp_path, capsys):
    """What is wrong with a log's own table is said, not that no table holds it."""
    readings, cell = tmp_path / "array.csv", tmp_path / "cell.csv"
    pd.DataFrame({"time (s)": T} | {f"ch{k}": COUNTS[:, k] for k in range(6)}).to_csv(readings, index=False)
    pd.DataFrame({"time (s)": T, "Force (kPa)": FORCE}).to_csv(cell, index=False)
    imported(readings, cell, run0, "--of", "touch")
    said = capsys.readouterr().out
    assert f"load_cell.log: {cell}: line 1 names the column 'Force (kPa)'" in said
    assert "load_cell.log: not found" not in said and "cnc.log: not found in " in said


@pytest.mark.parametrize("first", ["skin", "cell"])
@pytest.mark.parametrize("stamp", [lambda t: t, lambda t: f"12:00:{t:09.6f}"], ids=["seconds", "time of day"])
def test_a_sensor_is_not_its_own_truth(first, stamp, tmp_path, capsys):
    """Of two files of one column each, the one whose column is called so is the load cell's; the other is a guess."""
    sensor = tmp_path / "taxel"
    sensor.mkdir()
    one = {"touch.sensor": SENSOR["touch.sensor"] | {"rows": 1, "cols": 1}}
    (sensor / "settings.yaml").write_text(yaml.safe_dump(one | {"touch.label.map_rows": 1, "touch.label.map_cols": 1}))
    times = list(map(stamp, T))
    pd.DataFrame({"Time": times, "Reading": COUNTS[:, 0]}).to_csv(tmp_path / "skin.csv", index=False)
    pd.DataFrame({"Time": times, "Force": FORCE}).to_csv(tmp_path / "cell.csv", index=False)
    both = sorted((tmp_path / "skin.csv", tmp_path / "cell.csv"), key=lambda path: path.stem != first)
    imported(*both, sensor / "single" / "run0", "--of", "touch")
    assert "guessed: that 'Reading' is v0" in capsys.readouterr().out
    fmt = touch.array_format({"sensor": {"rows": 1, "cols": 1}, "ingest": {"highest_count": 1023}})
    counts = parse.read_log(sensor / "single" / "run0" / "array.log", fmt)[0]
    assert np.array_equal(matrix(counts)[:, 0], COUNTS[:, 0])
    assert matrix(logs_of_cell(sensor / "single" / "run0"))[:, 0] == pytest.approx(FORCE)
    imported(tmp_path / "skin.csv", sensor / "single" / "run1", "--of", "touch")
    assert "load_cell.log: not found in" in capsys.readouterr().out
    assert not (sensor / "single" / "run1" / "load_cell.log").exists()


def test_recordings_of_one_sensor_have_one_gain(run0, tmp_path, capsys):
    """Files of one sensor in volts, of unlike peaks: a volt is worth the same counts in all, or the file is refused."""

    def written(name, factor):
        volts = {f"ch{k}": np.round(factor * COUNTS[:, k], 5) for k in range(6)}
        pd.DataFrame({"time_s": T} | volts | {"fz_n": FORCE}).to_csv(tmp_path / name, index=False)
        return tmp_path / name

    def scale(run):
        return yaml.safe_load((run / "origin.yaml").read_text())["logs"]["array.log"]["scale"]

    high, low, millivolts = written("a.csv", 2.1e-3), written("b.csv", 0.7e-3), written("c.csv", 2.1)
    run1, run2 = run0.with_name("run1"), run0.with_name("run2")
    imported(high, run0, "--of", "touch")
    imported(low, run1, "--of", "touch")
    assert f"may be rounded at the scale and offset of {run0 / 'origin.yaml'}" in capsys.readouterr().out
    assert scale(run0) == scale(run1)
    with pytest.raises(InputError, match="c.csv: readings are no counts of 0 to 1023 at the scale and offset of"):
        imported(millivolts, run2, "--of", "touch")


def test_places_are_from_the_file_that_names_them(tmp_path):
    sensor = tmp_path / "skin"
    sensor.mkdir()
    settings = {"strain.sensor.channels": 2, "strain.sensor.tasks": {"press": ["z"]}}
    (sensor / "settings.yaml").write_text(yaml.safe_dump(settings))
    columns = {"daq": {"u0": X / 10, "u1": Y / 10}, "cell": {"Force": FORCE}, "arm": {"Z": Z}}
    for name, of_device in columns.items():
        pd.DataFrame({"Time": T} | of_device).to_csv(tmp_path / f"{name}.csv", index=False)
    imported(*(tmp_path / f"{name}.csv" for name in columns), sensor / "press" / "run0", "--of", "strain")
    fmt = strain.formats({"sensor": {"channels": 2, "tasks": {"press": ["z"]}}})["robot.log"]
    robot = parse.read_log(sensor / "press" / "run0" / "robot.log", fmt)[0]
    assert robot["z_mm"].to_numpy() == pytest.approx(Z)


@pytest.mark.parametrize(
    ("names", "taken"),
    [
        (("force_x", "force_y", "force_z", "pos_x", "pos_y", "pos_z"), ("force_z", "pos_x", "pos_y", "pos_z")),
        (("Fx", "Fz", "x", "y", "z"), ("Fz", "x", "y", "z")),
        (("force_setpoint", "force", "x", "y", "z"), ("force", "x", "y", "z")),
        (("force_left", "force_right", "x", "y", "z"), None),
    ],
)
def test_of_several_columns_of_a_kind_the_right_one_is_taken(names, taken, run0, tmp_path, capsys):
    """Each column is another number throughout."""
    columns = {"time_s": T} | {f"ch{k}": COUNTS[:, k] for k in range(6)}
    columns |= {name: k + 0.001 * np.arange(ROWS) - 9 for k, name in enumerate(names)}
    pd.DataFrame(columns).to_csv(tmp_path / "a.csv", index=False)
    imported(tmp_path / "a.csv", run0, "--of", "touch")
    if taken is None:
        assert "force_left, force_right could each be fz_n; rename the others" in capsys.readouterr().out
        assert not (run0 / "load_cell.log").exists()
        return
    read = np.hstack([matrix(logs_of(run0)[log]) for log in ("load_cell", "cnc")])
    assert read == pytest.approx(np.column_stack([columns[name] for name in taken]))


@pytest.mark.parametrize(("moves_mm", "scale"), [(5.0, 1), (0.08, 1000)])
def test_an_arm_that_rests_at_first_is_not_in_metres(moves_mm, scale, run0, tmp_path):
    """Of 4000 lines the first 1500 are at rest, but for noise; less than 0.2 in the whole log is in metres."""
    time = 0.01 * np.arange(4000)
    places = np.where(time < 15, 0.0, moves_mm * np.sin(time - 15)) + 0.002 * np.sin(7 * time)
    columns = {"time_s": time} | {axis: np.round(places, 3) for axis in "xyz"}
    pd.DataFrame(columns).to_csv(tmp_path / "a.csv", index=False)
    imported(tmp_path / "a.csv", run0, "--of", "touch")
    assert matrix(parse.read_log(run0 / "cnc.log", touch.CNC)[0])[:, 0] == pytest.approx(scale * columns["x"])
