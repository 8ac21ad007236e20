"""Inputs of any size: a recording's logs with faults in them, a frames table, a strain series."""

import itertools
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.csv
import pyarrow.parquet

from tactile import tasks
from tactile.base import params
from tactile.base.params_file import copied, set_values
from tactile.base.paths import CODE
from tactile.datasets import schemas
from tactile.datasets.series import Record
from tactile.experiments import glove, touch

ROOT = CODE.parent
LOGS = Path("data", "own", "logs", "single")  # where measure.ingest looks for recordings
ARRAY_HZ, LOAD_CELL_HZ, CNC_HZ = 200, 100, 50  # 1 GB of 5x5 counts lasts 16 hours; 28 are the most that ingest takes
LINE_BYTES = 92  # of the array's log, about
BETWEEN_FAULTS = 2500  # lines
SLOWER = 4  # times: a press of a frames table and its rest last as long as the scene's, 3.5 s


def recording(folder: Path, megabytes: float, array_hz: int = ARRAY_HZ) -> Path:
    """Write array.log (about that large, faulty lines among the good), load_cell.log and cnc.log; returns `folder`."""
    folder.mkdir(parents=True)
    seconds = megabytes * 1e6 / LINE_BYTES / array_hz
    knots, heights = _presses(seconds)

    def force(t: np.ndarray) -> np.ndarray:
        return np.interp(t, knots, heights)

    gains = 1.5 * np.exp(-(np.linspace(-2, 2, 25) ** 2))
    noise = np.random.default_rng(1).integers(0, 3, (BETWEEN_FAULTS, 25))

    def counts(t: np.ndarray) -> list[np.ndarray]:
        return list((20 + gains * force(t)[:, None] ** 0.7 * 8 + noise[: len(t)]).astype(np.int64).T)

    with open(folder / "array.log", "wb") as file:
        file.write(b"tactile array 5x5 ready\n")
        kinds = itertools.cycle(["torn", "out of range", "duplicated"])  # all numbers: text would slow pandas down
        for chunk in _chunks(seconds, array_hz, BETWEEN_FAULTS):
            lines = _lines(chunk, counts(chunk), boot_us=5_000_000)
            last = lines[lines.rindex(b"\n", 0, -1) + 1 :]
            clock = last.split(b",")[0]
            fault = {"torn": clock + b",20,2\n", "out of range": clock + b",5000" * 25 + b"\n", "duplicated": last}
            file.write(lines + fault[next(kinds)])
    with open(folder / "load_cell.log", "wb") as file:
        for chunk in _chunks(seconds, LOAD_CELL_HZ, 100_000):
            file.write(_lines(chunk, [force(chunk).round(3)], boot_us=8_000_000))
    with open(folder / "cnc.log", "wb") as file:
        for chunk in _chunks(seconds, CNC_HZ, 100_000):
            place = [np.full(len(chunk), 30.0), np.full(len(chunk), 28.5), -(force(chunk) ** (2 / 3) / 10).round(3)]
            file.write(_lines(chunk, place, boot_us=2_000_000))
    return folder


def frames_file(path: Path, frames: int, settings: dict) -> Path:
    """A frames table of presses under a CNC, 10,000 frames a recording; settings: block `touch` of params.yaml."""
    schema = touch.frames_schema(settings)
    elements, rng = settings["sensor"]["rows"] * settings["sensor"]["cols"], np.random.default_rng(0)
    side = settings["sensor"]["cols"] * settings["sensor"]["pitch_mm"]

    def parts():
        for number, first in enumerate(range(0, frames, 10_000)):
            n = min(10_000, frames - first)
            t = np.arange(n) / 50
            knots, heights = _presses(t[-1] / SLOWER, seed=number)
            knots *= SLOWER
            which = np.searchsorted(knots[::4], t)
            x, y = (rng.uniform(0, side, which.max() + 1)[which, None] for _ in "xy")
            yield schemas.frame_rows(
                schema,
                "single" if number % 5 else "double",
                f"run{number:04d}",
                segment=np.zeros(n, np.int16),
                t_s=t,
                v=rng.integers(0, 1000, (n, elements)),
                force_n=np.interp(t, knots, heights)[:, None],
                x_mm=x,
                y_mm=y,
            )

    schemas.write(path, schema, parts())
    return path


def dataset(folder: Path, experiment: str, values: dict) -> Path:
    """Write the dataset of a small experiment on made frames, with the splits of params.yaml (`values`).

    Returns its path. The frames have nothing to learn from: what a training costs does not depend on them.
    """
    settings, path = values[experiment], folder / "dataset.parquet"
    if experiment == "touch":
        frames = pyarrow.parquet.read_table(frames_file(folder / "frames.parquet", 15_000, settings))
    else:
        frames = glove_frames(objects=4, sessions=5, frames=6 * settings["window"]["stride"])
    inputs = tasks.of(experiment).inputs(frames, settings)
    tasks.write_dataset(path, experiment, inputs, settings, params.runs(values, experiment))
    return path


def glove_frames(objects: int, sessions: int, frames: int) -> pa.Table:
    """Return a frames table of the glove: so many frames of every session of every object, counts of noise."""
    rng, count = np.random.default_rng(0), objects * sessions * frames
    session = np.arange(count) // frames
    columns = {
        "condition": [f"object{number // sessions}" for number in session],
        "recording": [f"session{number % sessions}" for number in session],
        "segment": np.zeros(count, np.int16),
        "t_s": np.arange(count) % frames / 10,
        "gap_before": np.arange(count) % frames == 0,
        "pressure": schemas.lists(rng.integers(0, 1000, (count, glove.PRESSURE_CELLS)).astype(np.int16), pa.int16()),
        "strain": schemas.lists(rng.integers(0, 1000, (count, glove.STRAIN_CELLS)).astype(np.int16), pa.int16()),
    }
    schema = glove.frames_schema({"sensor": {}})
    return pa.table(columns).select(schema.names).cast(schema)


def at_papers_amount(folder: Path) -> dict:
    """Return the settings with the amounts of touch of the paper; a copy in `folder` is what is changed."""
    copy = copied(ROOT / "params.yaml", folder)
    set_values(params.parsed(ROOT / "evidence" / "shards.yaml")["touch_random_window"]["set"], copy)
    return params.load(copy)


def touch_settings() -> dict:
    """The block `touch` of params.yaml."""
    return params.load(ROOT / "params.yaml")["touch"]


def series(samples: int, outputs: int = 2) -> Record:
    """A strain record of noise: the time of an epoch does not depend on the values."""
    rng = np.random.default_rng(0)
    all_of_it = np.ones(samples, dtype=bool)
    x, y = (rng.normal(size=(samples, width)).astype(np.float32) for width in (6, outputs))
    return Record(x, y, all_of_it, all_of_it, np.zeros(samples, np.int32))


def _presses(seconds: float, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Times in s and forces in N of the corners of trapezoid presses, irregular in depth and time."""
    rng = np.random.default_rng(seed)
    count = int(seconds / 0.7) + 2
    steps = np.array([0.3, 0.2, 0.2, 0.2]) * rng.uniform(0.8, 1.2, (count, 4))
    heights = rng.uniform(4, 30, count)[:, None] * [0, 1, 1, 0]
    return 1.5 + np.cumsum(steps), heights.ravel()


def _chunks(seconds: float, hz: int, lines: int):
    """Times in s at `hz`, at most so many lines at once."""
    total = int(seconds * hz)
    for first in range(0, total, lines):
        yield np.arange(first, min(first + lines, total)) / hz


def _lines(t: np.ndarray, columns: list[np.ndarray], boot_us: int) -> bytes:
    """What a device prints: its time in us and the columns."""
    arrays = [boot_us + (t * 1e6).round().astype(np.int64), *columns]
    table = pa.table(arrays, names=[str(k) for k in range(len(arrays))])
    sink = pa.BufferOutputStream()
    pyarrow.csv.write_csv(table, sink, pyarrow.csv.WriteOptions(include_header=False, quoting_style="none"))
    return sink.getvalue().to_pybytes()
