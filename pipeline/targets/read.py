"""Read recordings as series of readings with the truth of a target beside them, each in the group it is tested with.

Of a sensor of one's own only the sensor's log is needed, and the log that has the truth, if no folder tells it. Both
are stamped by one clock: nothing is known of a free target by which clocks could be aligned.
"""

import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pyarrow as pa

from pipeline import experiments
from pipeline.base.errors import InputError
from pipeline.datasets import schemas
from pipeline.experiments import glove, strain, strain_recorded, touch
from pipeline.logs import layout, own_data, parse, sniff
from pipeline.logs.formats import LOGS, Column, Format, second
from pipeline.settings.targets import Asked, Split, Target
from pipeline.sheet import cycles

NO_GROUP = np.empty(0, dtype=str)
PARTS = 5  # of a recording, or of the grasps of an object, where time divides
LARGEST = 1e12  # of a target; a larger number is none
FORMATS = {
    "touch": touch.array_format,
    "strain": lambda settings: strain.formats(settings)["daq.log"],
    "glove": glove.scanner_format,
}
NUMBER = re.compile(r"[-+]?\d+(\.\d+)?")
RECORDED = {  # target of a public recording -> experiment and, of places, the column of y_mm
    "x": ("strain_recorded", 0),
    "y": ("strain_recorded", 1),
    "object": ("glove_recorded", None),
}


class Series(NamedTuple):
    """One recording, n readings of it."""

    name: str  # its path below the folder of logs
    group: np.ndarray  # (n,) of text; one for all readings unless time divides
    time_s: np.ndarray  # (n,) rises within a segment
    segment: np.ndarray  # (n,) a window lies within one
    reading: np.ndarray  # (n, elements)
    truth: np.ndarray  # (n,) numbers; text of classes; bool of events
    press: np.ndarray  # (n,) number of the press or the recording that votes together; -1: not counted


class Data(NamedTuple):
    """All recordings, with what is asked of them."""

    target: Target
    by: str  # what a group is
    series: list[Series]


def own(experiment: str, folder: Path, settings: Mapping, asked: Asked) -> Data:
    """Return the recordings <1>/<2>/<log> of a sensor of one's own; settings: the block of its experiment.

    Raises InputError as the readers do, for a log that is there more than once, and for a path that names no group, a
    truth that is not there, is of another clock or, in the name of a folder, no number.
    """
    paths = [path for path in parse.folders(folder, "*/*") if (path / LOGS[experiment]).exists()]
    if not paths:
        raise InputError(f"{folder}: no recordings; expected <folder>/<recording>/{LOGS[experiment]} in it")
    parse.check_names(paths)
    if problem := own_data.copied(paths, LOGS[experiment]):
        raise InputError(f"{folder}: {problem}")
    series = []
    for path in paths:
        name = "/".join(path.parts[-2:])
        time_s, segment, reading, _ = sensor_log(path / LOGS[experiment], experiment, settings)
        truth, known = truth_of(path, asked.target, experiment, settings, time_s, segment)
        press = votes(path, asked.target, experiment, settings, time_s, segment, truth)
        counted = np.where(known, press, -1)
        series.append(grouped(Series(name, NO_GROUP, time_s, segment, reading, truth, counted), asked.split, folder))
    return Data(asked.target, asked.split.by, series)


class Readings(NamedTuple):
    """What a sensor's log says, n readings of it."""

    time_s: np.ndarray  # (n,) rises within a segment
    segment: np.ndarray  # (n,)
    reading: np.ndarray  # (n, elements)
    rejects: pa.Table  # lines that cannot be used, with their reasons


def sensor_log(path: Path, experiment: str, settings: Mapping) -> Readings:
    """Return the readings of a sensor's log; errors as `parse.read_log`."""
    fmt, name = FORMATS[experiment](settings), LOGS[experiment]
    rows, rejects = log(path, fmt, experiment, settings, layout.of(settings["ingest"], name))
    readings = [column for column in rows.column_names if column not in (fmt.time, "line", "segment")]
    reading = np.column_stack([rows[column].to_numpy() for column in readings])
    return Readings(rows[fmt.time].to_numpy() / second(fmt), rows["segment"].to_numpy(), reading, rejects)


def log(
    path: Path, fmt: Format, experiment: str, settings: Mapping, laid_out: Mapping | None
) -> tuple[pa.Table, pa.Table]:
    """Return the rows and the rejects of a log, read as ingest does."""
    limit, key = settings["ingest"]["max_reject_fraction"], f"{experiment}.ingest.max_reject_fraction"
    return parse.read_log(path, fmt, limit=limit, key=key, layout=laid_out)


def truth_of(
    path: Path, target: Target, experiment: str, settings: Mapping, time_s: np.ndarray, segment: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the truth (n,) at the sensor's times, and where it is known (n,) bool.

    Numbers are interpolated; a class or an event holds until the next line says another.
    """
    if target.folder is not None:
        name = path.parts[-3 + target.folder]
        if target.kind == "class":
            return np.full(len(time_s), name), np.full(len(time_s), True)
        if (number := NUMBER.search(name)) is None:
            raise InputError(f"{path}: the folder '{name}' names no number for the target '{target.name}'; rename it")
        return np.full(len(time_s), float(number[0])), np.full(len(time_s), True)
    if segment[-1] > 0:
        raise InputError(
            f"{path / LOGS[experiment]}: its clock begins anew, so the times of {target.file} are not its own; divide "
            "the recording there"
        )
    at, values = column_of(path / target.file, target, experiment, settings)
    known = (time_s >= at[0]) & (time_s <= at[-1])
    if not known.any():
        raise InputError(
            f"{path / target.file}: lasts from {at[0]:g} to {at[-1]:g} s, {LOGS[experiment]} from {time_s[0]:g} to "
            f"{time_s[-1]:g} s; stamp both by one clock, in one unit"
        )
    if target.kind == "continuous":
        return np.interp(time_s, at, values), known
    held = values[np.clip(np.searchsorted(at, time_s, side="right") - 1, 0, None)]
    return (held != 0) if target.kind == "event" else held, known


def column_of(path: Path, target: Target, experiment: str, settings: Mapping) -> tuple[np.ndarray, np.ndarray]:
    """Return times in s and values (m,) of the target's column in a log, text of a class; the first is the time."""
    clock = FORMATS[experiment](settings).columns[0]
    words: dict[str, int] | None = {} if target.kind == "class" else None
    fmt = Format((clock, Column(target.name, target.unit, -LARGEST, LARGEST, words=words)), time=clock.name)
    given = dict(layout.of(settings["ingest"], path.name) or {"separator": ","}) | {"columns": [target.column]}
    if isinstance(target.column, int) and path.is_file():
        given.setdefault("width", sniff.columns_a_line(path, given.get("separator", ",")))
    rows, _ = log(path, fmt, experiment, settings, given)
    if rows["segment"][-1].as_py() > 0:
        raise InputError(f"{path}: its clock begins anew; divide the recording there")
    values = rows[target.name].to_numpy()
    if words is not None:
        names = np.array([f"{float(word):g}" if layout.is_number(word) else word for word in words])
        values = names[values.astype(int)]
    return rows[clock.name].to_numpy() / second(fmt), values


def votes(
    path: Path,
    target: Target,
    experiment: str,
    settings: Mapping,
    time_s: np.ndarray,
    segment: np.ndarray,
    truth: np.ndarray,
) -> np.ndarray:
    """Return the number of what votes together, (n,); -1 outside.

    A class is that of a press, where a load cell of the same clock tells presses, else of a stretch of one class within
    a recording. Of other targets nothing votes, and all readings of a recording count.
    """
    load_cell = path / "load_cell.log"
    if target.kind != "class":
        return np.zeros(len(time_s), int)
    if experiment == "touch" and load_cell.exists() and settings["ingest"].get("clock") == "shared" and not segment[-1]:
        rows, _ = log(load_cell, touch.LOAD_CELL, experiment, settings, layout.of(settings["ingest"], load_cell.name))
        force = np.interp(time_s, rows["t_us"].to_numpy() / second(touch.LOAD_CELL), rows["fz_n"].to_numpy())
        found = cycles.presses(time_s, force, cycles.REST * force.max(), cycles.BRIEFEST_S)
        number = np.full(len(time_s), -1)
        for k, press in enumerate(found):
            number[press.first : press.stop] = k
        return number
    return np.cumsum(np.concatenate([[False], truth[1:] != truth[:-1]]))


def grouped(series: Series, split: Split, folder: Path) -> Series:
    """Return a recording with its group: what the pattern finds in its path, its path, or the part in time."""
    n = len(series.time_s)
    if split.by == "time":
        part = np.arange(n) * PARTS // n
        return series._replace(
            group=np.char.add("part ", (part + 1).astype(str)), segment=series.segment * PARTS + part
        )
    if split.by == "recording":
        return series._replace(group=np.full(n, series.name))
    found = re.search(split.pattern, series.name)
    if found is None or found[1] is None:
        raise InputError(
            f"{folder}: split.pattern '{split.pattern}' finds no {split.by} in the path '{series.name}'; mend it, or "
            "rename the folder"
        )
    return series._replace(group=np.full(n, found[1]))


def said(data: Data) -> Iterator[str]:
    """Yield a line for each group: recordings, readings that count, and what the target is in them."""
    for group in sorted({name for each in data.series for name in np.unique(each.group)}):
        chosen = [each for each in data.series if (each.group == group).any()]
        truth = np.concatenate([each.truth[(each.group == group) & (each.press >= 0)] for each in chosen])
        if data.target.kind == "continuous":
            what = f"{truth.min():g} to {truth.max():g} {data.target.unit}" if len(truth) else "never known"
        else:
            counts = zip(*np.unique(truth, return_counts=True), strict=True)
            what = ", ".join(f"{name} {count}" for name, count in counts)
        recordings = "1 recording" if len(chosen) == 1 else f"{len(chosen)} recordings"
        yield f"{group}: {recordings}, {len(truth)} readings; {data.target.name}: {what}"


def recorded(name: str, folder: Path, settings: Mapping) -> Data:
    """Return a target of the public recordings, one of RECORDED: a place of the arm by day, or the grasped object.

    Strands: the five that both days have, readings of presses count. Hand: its tactile matrices, without the angles of
    its joints, which tell the minute of a grasp (pipeline/experiments/glove_recorded.py); the grasps of each object, in
    the order of time, are five blocks, and the first blocks of all objects are tested together, then the second ones.
    settings: the block of the experiment.
    """
    experiment, column = RECORDED[name]
    module = experiments.module(experiment)
    paths, made = module.recordings(folder), []
    for path in paths:
        frames, _, _ = module.read_recording(path, settings)
        n, condition = frames.num_rows, frames["condition"][0].as_py()
        common = frames["t_s"].to_numpy(), frames["segment"].to_numpy()
        if column is not None:
            reading = schemas.matrix(frames["v"])[:, strain_recorded.SHARED[condition]]
            truth, press = schemas.matrix(frames["y_mm"])[:, column].astype(float), frames["press"].to_numpy()
            made.append(Series(path.stem, np.full(n, condition), *common, reading, truth, press))
            continue
        of_object = [other for other in paths if other.parent == path.parent]
        block = f"block {of_object.index(path) * PARTS // len(of_object) + 1}"
        reading = schemas.matrix(frames["pressure"])
        made.append(Series(path.stem, np.full(n, block), *common, reading, np.full(n, condition), np.zeros(n, int)))
    if column is None:
        return Data(Target(name=name, kind="class", folder=1), "block of each object's grasps", made)
    return Data(Target(name=name, kind="continuous", unit="mm", file="robot", column=name), "day", made)
