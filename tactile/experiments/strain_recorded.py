"""Read recordings of soft strain sensors on an arm, on two days: MATLAB workspaces, see tactile/logs/sources.py.

The robot's program repeats a cycle of 40 samples: it lifts the finger off the surface (samples 0-9, still above
the last place), moves to a new random place (10-19) and presses there (20-39). Its random numbers start from the
same seed on both days, so the places of the second day are the first places of the first day, in the same order.
"""

from collections import Counter
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pyarrow as pa

from tactile.base.errors import InputError
from tactile.base.facts import Facts, Source
from tactile.datasets import schemas, series
from tactile.logs import matlab, parse
from tactile.logs.report import log_report

KIND = "series"
FACTS = Facts(
    label="Recorded strain sensors",
    unit="V",
    output_unit="mm",
    metric="error",
    compared=("across_days_xy",),
    score="main/day_2.error",
    first_tested=("across_days_xy", "day_2"),
    drawn=("within_day_xy", "across_days_xy", "new_places_xy", "days_swapped_xy", "failing_channel_xy"),
    sheet="recorded_strands",
    tested={("within_day_xy", "day_1"): "within a day", ("across_days_xy", "day_2"): "across days"},
    source=Source(
        repository="tomraven1/sensor_morphology",
        commit="30718094c8dbbb889c3207f4dc32394166c2821e",
        folder="experiment/UR5RobotControlV3.2",
        licence="none given: use the recordings, do not redistribute them",
        size=5_867_681,
    ),
    targets={"x": 0, "y": 1},
)

FILES = {"day_1": "new_test/para5_long.mat", "day_2": "para5_long_n.mat"}  # 30 and 31 July 2019
VARIABLES = ("voltage", "tim", "pos", "deformation")  # of the many in the workspace
CHANNELS = 7  # of day_2; day_1 has no c6
SCHEMA = series.frames(CHANNELS)

CYCLE, MOVED, PRESSED = 40, 10, 20  # samples of a cycle; the first above the new place; the first pressed
START_MM = np.zeros((1, 2))  # the program starts at the centre

LARGEST_FILE = 64 << 20  # bytes; the recordings have 2 and 4 MB
LOWEST_V, HIGHEST_V = 0.0, 5.0  # range of the board's supply
RAIL_V = 3.0  # the board reads up to 3.3 V; strands read 1.4 to 2.3 V, one that has come loose 3.15 V
STEP_V = 3.3 / 1023  # of its 10-bit converter: a channel that moves less all day is dead

NO_TIME = "no time"
INCOMPLETE = "incomplete cycle"

# A protocol is named <split>_<task>, like within_day_xy.
# Split -> day -> columns of v, in the order of the strands: c0..c4 of day_1 are c1..c5 of day_2.
SHARED = {"day_1": [0, 1, 2, 3, 4], "day_2": [1, 2, 3, 4, 5]}
SPLITS = {
    "within_day": {"day_1": [0, 1, 2, 3, 4, 5]},
    "within_day_five": {"day_1": SHARED["day_1"]},  # what the next day's error is compared with
    "across_days": SHARED,
    "new_places": SHARED,  # as across_days, trained without the cycles whose places day_2 repeats
    "days_swapped": dict(reversed(SHARED.items())),  # trained on the second day, tested on the first
    "failing_channel": {"day_2": [0, 1, 2, 3, 4, 5, 6]},
}
TASKS = {"xy": ((0, 1), True), "z": ((2,), False), "xyz": ((0, 1, 2), False)}  # columns of y_mm; pressed only
MODEL_ZERO_TASK = "xyz"


def frames_schema(settings: Mapping) -> pa.Schema:
    """Return the schema of the frames table: the sensors are given, whatever `settings` say."""
    return SCHEMA


def recordings(folder: Path) -> list[Path]:
    """Return the two recordings in `folder`, in the order of days. Raises InputError where one is missing."""
    files = [folder / name for name in FILES.values()]
    for path in files:
        if not path.is_file():
            raise InputError(f"{path}: recording not found; run `tactile fetch strain_recorded`")
    return files


def read_recording(path: Path, settings: Mapping) -> tuple[pa.Table, pa.Table, dict]:
    """Read one day as `(frames, rejects, report)`.

    `settings`: the block `strain_recorded` of params.yaml. frames: a table of SCHEMA with every
    `ingest.every`-th sample; v in V, y_mm the commanded place and -deformation while pressed (0 otherwise), press
    the number of the cycle in its pressed samples. rejects: one row per sample that is left out, numbered from 1 in
    `line`. report: as for logs, and `channels`: the fault of a channel, by its name. Raises InputError for
    a file that is no MATLAB workspace, lacks a variable, has variables that do not belong together, too many
    rejects or no living channel.
    """
    condition = _condition(path)
    voltage, time, place, deformation = _read(path)
    n = len(voltage)
    cycle, phase = np.divmod(np.arange(n), CYCLE)
    whole = n // CYCLE
    if not whole:
        raise InputError(f"{path}: {n} samples are less than one cycle of {CYCLE}; record longer")
    if place.shape[1] < whole:
        raise InputError(f"{path}: 'pos' has {place.shape[1]} places for {whole} cycles; the variables differ in age")

    reason = _reasons(voltage, time, cycle, whole)
    bad = np.flatnonzero(reason != "")
    texts = [",".join(f"{v:.4f}" for v in row) for row in voltage[bad]]
    rejects = pa.table([[path.name] * len(bad), bad + 1, reason[bad].tolist(), texts], parse.REJECTS)
    limit = settings["ingest"]["max_reject_fraction"]
    reasons = Counter(rejects["reason"].to_pylist())
    parse.check_rejects(path, n, reasons, limit, "strain_recorded.ingest.max_reject_fraction")

    good = np.flatnonzero(reason == "")
    kept = good[good % settings["ingest"]["every"] == 0]
    if not len(kept):
        raise InputError(f"{path}: no sample is left; lower strain_recorded.ingest.every")
    above = np.concatenate([START_MM, place.T])[cycle[kept] + (phase[kept] >= MOVED)]
    pressed = phase[kept] >= PRESSED
    v = np.full((len(kept), CHANNELS), np.nan)
    v[:, : voltage.shape[1]] = voltage[kept]
    segment = np.zeros(len(kept), dtype=np.int16)
    # The program numbers its samples itself; sending a command delays the next by 70 ms, which is no gap.
    gap = np.diff(kept, prepend=-np.inf) > settings["ingest"]["every"]
    columns = {
        "condition": [condition] * len(kept),
        "recording": [path.stem] * len(kept),
        "segment": segment,
        "t_s": time[kept],
        "gap_before": gap,
        "press": np.where(pressed, cycle[kept], -1),
        "v": schemas.lists(v, pa.float32()),
        "y_mm": schemas.lists(np.column_stack([above, np.where(pressed, -deformation, 0.0)]), pa.float32()),
    }
    report = log_report(len(good), rejects, time[kept], segment)
    report["gaps"] = int(gap[1:].sum())
    report["channels"] = _faults(path, voltage[good])
    return pa.table(columns).select(SCHEMA.names).cast(SCHEMA), rejects, {path.name: report}


def task(protocol: str, settings: Mapping) -> series.Task:
    """Return the task of a protocol; InputError for an unknown one. No setting changes it."""
    name, wanted = _parts(protocol)
    outputs, pressed_only = TASKS[wanted]
    return series.Task(outputs, SPLITS[name], pressed_only, f"{name}_{MODEL_ZERO_TASK}")


def channels(protocol: str, condition: str) -> list[int]:
    """Return the columns of v that models of a protocol see on one day; InputError for an unknown protocol or day."""
    days = task(protocol, {}).channels
    if condition not in days:
        raise InputError(f"strain_recorded, protocol {protocol}: has no {condition}, only {' and '.join(days)}")
    return days[condition]


def split(frames: pa.Table, settings: Mapping, protocol: str, seed: int) -> np.ndarray:
    """Return the part of each frame, (n,): whole cycles in the order of time, the same for every seed.

    `settings["split"]`: `train`, the share of a day before its test part, where the end of the day is the test;
    `validation`, the share of the training cycles, the last ones, that is the validation part. Where a protocol uses
    both days, the later one in SPLITS is the test. Cycles that a protocol does not use are 'unused'. Raises InputError
    for an unknown protocol.
    """
    name, _ = _parts(protocol)
    condition = schemas.names(frames["condition"])
    part = np.full(frames.num_rows, "unused", dtype=object)
    rows = {day: np.flatnonzero(condition == day) for day in SPLITS[name]}
    cycles = {day: _cycles(frames["press"].to_numpy()[rows[day]]) for day in rows}
    first, *later = SPLITS[name]
    for day in later:
        part[rows[day]] = "test"
    divided, cycle = rows[first], cycles[first]
    if name == "new_places":
        new = cycle > cycles["day_2"].max(initial=-1)
        divided, cycle = divided[new], cycle[new]
    numbers = np.unique(cycle)
    trained = len(numbers) if later else round(settings["split"]["train"] * len(numbers))
    fitted = round((1 - settings["split"]["validation"]) * trained)
    number = np.searchsorted(numbers, cycle)
    part[divided] = np.where(number < fitted, "train", np.where(number < trained, "validation", "test"))
    return part


def _parts(protocol: str) -> tuple[str, str]:
    """Return the split and the task of a protocol; InputError where it has not both."""
    name, _, wanted = protocol.rpartition("_")
    if name not in SPLITS or wanted not in TASKS:
        raise InputError(
            f"strain_recorded: no protocol '{protocol}'; a protocol is one of {', '.join(SPLITS)} and one of "
            f"{', '.join(TASKS)}, joined by '_'"
        )
    return name, wanted


def _cycles(press: np.ndarray) -> np.ndarray:
    """Return the cycle of each sample of one day, (n,): samples before a press belong to it, the last ones to the last.

    press: (n,), -1 outside presses.
    """
    at = np.flatnonzero(press >= 0)
    following = np.searchsorted(at, np.arange(len(press)))
    return press[at[np.minimum(following, len(at) - 1)]] if len(at) else np.zeros(len(press), dtype=int)


def _condition(path: Path) -> str:
    """Return the condition (day) of a recording; InputError for a file of another name."""
    for condition, name in FILES.items():
        if path.name == Path(name).name:
            return condition
    names = " and ".join(Path(name).name for name in FILES.values())
    raise InputError(f"{path}: not one of the recordings; they are called {names}")


def _read(path: Path) -> tuple[np.ndarray, np.ndarray, np.ndarray, float]:
    """Read voltage (n, channels) in V, time (n,) in s (NaN: none), place (2, presses) and deformation in mm."""
    variables = matlab.read(path, VARIABLES, LARGEST_FILE)
    for name in VARIABLES:
        value = variables[name]
        if value.dtype.kind not in "fiu" or value.ndim != 2:
            raise InputError(f"{path}: '{name}' is not a matrix of real numbers; it is not a recording of this kind")
        variables[name] = value.astype(np.float64)
    voltage, time, place, deformation = (variables[name] for name in VARIABLES)
    time = time.ravel()
    if not 1 <= voltage.shape[1] <= CHANNELS:
        raise InputError(f"{path}: 'voltage' has {voltage.shape[1]} columns; 1 to {CHANNELS} channels are known")
    if len(place) != 2 or not np.isfinite(place).all():
        raise InputError(f"{path}: 'pos' must have 2 rows of numbers (x, y in mm), not {len(place)} rows")
    if deformation.size != 1 or not np.isfinite(deformation).all():
        raise InputError(f"{path}: 'deformation' must be one number, the depth of all presses in mm")
    # The program stores the time after the voltage: stopped in between, the last sample has none.
    if len(voltage) - len(time) not in (0, 1):
        raise InputError(f"{path}: {len(time)} times for {len(voltage)} samples; the variables differ in age")
    time = np.append(time, [np.nan] * (len(voltage) - len(time)))
    return voltage, time, place, float(deformation[0, 0])


def _reasons(voltage: np.ndarray, time: np.ndarray, cycle: np.ndarray, whole: int) -> np.ndarray:
    """Return why a sample is left out, (n,), '' where it is not."""
    latest = np.fmax.accumulate(np.concatenate([[-np.inf], time[:-1]]))
    with np.errstate(invalid="ignore"):
        outside = ((voltage < LOWEST_V) | (voltage > HIGHEST_V)).any(1)
        late = time <= latest
    faults = [
        (~np.isfinite(voltage).all(1), parse.NOT_A_NUMBER),
        (outside, parse.OUT_OF_RANGE),
        (~np.isfinite(time), NO_TIME),
        (late, parse.OUT_OF_ORDER),
        (cycle >= whole, INCOMPLETE),
    ]
    return np.select([where for where, _ in faults], [reason for _, reason in faults], default="")


def _faults(path: Path, voltage: np.ndarray) -> dict[str, dict]:
    """Return channel -> fault and its share, for channels that have one; voltage (n, channels) of good samples."""
    faults = {}
    for k, v in enumerate(voltage.T):
        if np.ptp(v) < STEP_V:
            faults[f"c{k}"] = {"fault": "dead", "share": 1.0}
        elif share := float((v > RAIL_V).mean()):
            faults[f"c{k}"] = {"fault": "saturated", "share": share}
    if sum(fault["share"] == 1 for fault in faults.values()) == voltage.shape[1]:
        raise InputError(f"{path}: all {voltage.shape[1]} channels are dead or saturated; check the sensors' supply")
    return faults
