"""Read recordings of a Velostat taxel and a load cell: two serial logs with the host's clock, see logs/sources.py."""

import re
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pyarrow as pa

from pipeline.base.errors import InputError
from pipeline.base.facts import Facts, Source
from pipeline.datasets import schemas
from pipeline.logs import alignment, parse
from pipeline.logs.formats import Column, Format
from pipeline.logs.report import log_report

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

CLOCK = Column("unix_time_s", "s", 1e9, 4e9)  # the years 2001 to 2096
VELOSTAT = Format((Column("reading", "1", 0, 1e5), CLOCK), time="unix_time_s", separator=" ")
LOAD_CELL = Format((Column("fz_n", "N", -1e3, 1e3), CLOCK), time="unix_time_s", separator=" ")

POOLED = "repetition"  # the protocol that fits all recordings together
NO_GROUND_TRUTH = "no ground truth at this time"
SCHEMA = schemas.frames(1, 1, pa.float32())


def formats(settings: Mapping, folder: Path | None = None) -> dict[str, Format]:
    """Return device -> format of its lines: the sensors are given, whatever `settings` say."""
    return {"velostat_data": VELOSTAT, "futek_data": LOAD_CELL}


def frames_schema(settings: Mapping) -> pa.Schema:
    """Return the schema of the frames table: the sensors are given, whatever `settings` say."""
    return SCHEMA


def recordings(folder: Path) -> list[Path]:
    """Return the Velostat logs in `folder`/velostat_data, sorted. Raises InputError where there is none."""
    logs = sorted((folder / "velostat_data").glob("*/*.txt"))
    if not logs:
        raise InputError(f"{folder / 'velostat_data'}: no recordings; run `tactile fetch velostat_recorded`")
    return logs


def name_of(path: Path) -> str:
    """Return a recording's name: `pike1_force_5/exp1` for `pike1_force_5/exp_pike1_force_5_sensor1_exp1.txt`."""
    repetition = re.search(r"exp\d+$", path.stem)
    if not repetition:
        raise InputError(f"{path}: the file name must end in the repetition, like _exp1.txt")
    return f"{path.parent.name}/{repetition.group()}"


def read_recording(path: Path, settings: Mapping) -> tuple[pa.Table, pa.Table, dict]:
    """Read one Velostat log and the load cell's log of the same name as `(frames, rejects, report)`.

    `settings`: the block `velostat_recorded` of params.yaml. A frame is one reading of the taxel; the force
    is interpolated at its time. Tables and errors as in the touch experiment; x and y are unknown (NaN).
    """
    pair = {
        f"{device}/{path.name}": (path.parents[2] / device / path.parent.name / path.name, fmt)
        for device, fmt in formats(settings).items()
    }
    limit, key = settings["ingest"]["max_reject_fraction"], "velostat_recorded.ingest.max_reject_fraction"
    rows, rejects = {}, {}
    for name, (file, fmt) in pair.items():
        rows[name], rejects[name] = parse.read_log(file, fmt, name, limit, key)
        if rows[name]["segment"][-1].as_py() > 0:
            raise InputError(f"{file}: the time steps back for good; the host's clock was set during the recording")
    taxel, cell = rows
    at, segment = rows[taxel]["unix_time_s"].to_numpy(), rows[taxel]["segment"].to_numpy()
    force, known = alignment.interpolated(at, rows[cell]["unix_time_s"].to_numpy(), rows[cell]["fz_n"].to_numpy())
    missed = rows[taxel]["line"].to_numpy()[~known]
    rejects[taxel] = parse.add_rejects(rejects[taxel], path, missed, NO_GROUND_TRUTH, taxel)
    if not known.any():
        raise InputError(
            f"{path}: no reading falls into the time of the load cell's log; the two do not belong together"
        )
    unknown = np.full((int(known.sum()), 1), np.nan)
    frames = schemas.frame_rows(
        SCHEMA,
        path.parent.name,
        name_of(path),
        segment=segment[known],
        t_s=at[known],
        v=rows[taxel]["reading"].to_numpy()[known, None],
        force_n=force[known, None],
        x_mm=unknown,
        y_mm=unknown,
    )
    report = {}
    for name in pair:
        accepted = frames.num_rows if name == taxel else rows[name].num_rows
        time = rows[name]["unix_time_s"].to_numpy()
        report[name] = log_report(accepted, rejects[name], time, rows[name]["segment"].to_numpy())
    return frames, pa.concat_tables(rejects.values()), report


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
