"""Recordings of a Velostat taxel and a load cell (see logs/sources.py): logs of touch, by folder and repetition."""

import re
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pyarrow as pa

from tactile.base.errors import InputError
from tactile.base.facts import Facts, Source
from tactile.datasets import schemas
from tactile.experiments import touch

KIND = "windows"
SCORES = "velostat_recorded"
STRESSED = ("all",)
FACTS = Facts(
    label="Recorded Velostat taxel",
    unit="counts",
    output_unit="N",
    metric="rmse",
    compared=("repetition",),
    score="main/all.rmse",
    first_tested=("repetition", "all"),
    drawn=("repetition",),
    sheet="taxel",
    tested={("repetition", "all"): "all recordings"},
    pooled=("all",),
    source=Source(
        repository="Lupasic/tactile-sensor-velostat",
        commit="c319860a13fcde964917329370ae31314024a96f",
        folder="src/experimental_data",
        licence="none given: use the recordings, do not redistribute them",
        size=16_927_854,
    ),
)

RASTER = (4, 4)  # places of a recording, rows and columns
STEP_MM = (3.75, 3.25)  # between two rows, and between two places of a row
POOLED = "repetition"  # the protocol that fits all recordings together

formats, frames_schema = touch.formats, touch.frames_schema


def recordings(folder: Path) -> list[Path]:
    """Return the taxel's logs in `folder`/velostat_data, sorted. Raises InputError where there is none."""
    logs = sorted((folder / "velostat_data").glob("*/*.txt"))
    if not logs:
        raise InputError(f"{folder / 'velostat_data'}: no recordings; run `tactile fetch velostat_recorded`")
    return logs


def logs(path: Path) -> dict[str, Path]:
    """Return the taxel's log and the load cell's of the same name, as touch calls them."""
    folders = {"array.log": "velostat_data", "load_cell.log": "futek_data"}
    return {log: path.parents[2] / folder / path.parent.name / path.name for log, folder in folders.items()}


def name_of(path: Path) -> str:
    """Return a recording's name: `pike1_force_5/exp1` for `pike1_force_5/exp_pike1_force_5_sensor1_exp1.txt`."""
    repetition = re.search(r"exp\d+$", path.stem)
    if not repetition:
        raise InputError(f"{path}: the file name must end in the repetition, like _exp1.txt")
    return f"{path.parent.name}/{repetition.group()}"


def read_recording(path: Path, settings: Mapping) -> tuple[pa.Table, pa.Table, dict]:
    """Read the logs of one recording as touch does: `(frames, rejects, report)`; x and y are unknown (NaN).

    settings: the block `velostat_recorded` of params.yaml. Rejects and report name a file with its device's folder.
    """
    files = logs(path)
    names = {log: "/".join((file.parents[1].name, file.name)) for log, file in files.items()}
    parts, rejects, report = touch.read_logs(files, (path.parent.name, name_of(path)), settings, "velostat_recorded")
    called = pa.array([names[log] for log in rejects["file"].to_pylist()], pa.string())
    report = {names[log]: numbers for log, numbers in report.items()}
    return pa.concat_tables(parts), rejects.set_column(0, rejects.schema.field("file"), called), report


def labels(windows: pa.Table, settings: Mapping) -> np.ndarray:
    """Return the force at each window's last frame, (n, 1) in N."""
    return schemas.matrix(windows["force_n"])


def split(windows: pa.Table, settings: Mapping, protocol: str, seed: int) -> np.ndarray:
    """Return the part of each window, (n,): all of exp2 is the test, the last presses of every exp1 the validation.

    Protocol `repetition` takes all recordings together; any other is named like the recording that it takes
    alone, with all others 'unused'. The same for every seed: the recordings decide. Raises InputError for a
    protocol without recordings.
    """
    recording, press = schemas.names(windows["recording"]), windows["press"].to_numpy()
    part = np.full(windows.num_rows, "test", dtype=object)
    for name in np.unique(recording):
        if not name.endswith("exp1"):
            continue
        rows = recording == name
        numbers = np.unique(press[rows])
        kept = max(1, round(len(numbers) * (1 - settings["split"]["validation"])))
        part[rows] = np.where(press[rows] <= numbers[kept - 1], "train", "validation")
    if protocol != POOLED and windows.num_rows:
        condition = schemas.names(windows["condition"])
        if protocol not in condition:
            raise InputError(
                f"params/velostat_recorded.yaml, velostat_recorded.protocols: there is no recording '{protocol}'; "
                f"there are {', '.join(sorted(set(condition)))}"
            )
        part[condition != protocol] = "unused"
    return part
