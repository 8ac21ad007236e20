"""Read recordings as series of readings with the truth of a target beside them, each in the group it is tested with.

Of a sensor of one's own only the sensor's log is needed, and the log that has the truth, if no folder tells it. Both
are stamped by one clock: nothing is known of a free target by which clocks could be aligned.
"""

import re
from collections.abc import Iterator, Mapping
from decimal import Decimal
from pathlib import Path
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
import pyarrow as pa

from tactile import experiments
from tactile.base.errors import InputError
from tactile.datasets import schemas
from tactile.experiments import log_name, sensor_format, strain, touch
from tactile.logs import alignment, layout, own_data, parse, sniff
from tactile.logs.formats import Column, Format, second
from tactile.settings import patterns
from tactile.settings.targets import Asked, Split, Target
from tactile.sheet import cycles

NO_GROUP = np.empty(0, dtype=str)
PARTS = 5  # of a recording, or of the grasps of an object, where time divides
LARGEST = 1e12  # of a target; a larger number is none
MOST_NAMED = 30  # classes of which each is named with its count, and groups that have a line
LEAST, MOST = 0.1, 2.0  # of the time that the sensor's log lasts; a log beside it that lasts less or more is not of it
# A number in a name: with a sign, or no 0 before its point, only where no letter or digit precedes: weight-100g is 100.
# A comma is a decimal one, but 1,500 is two numbers, as nobody knows whether it is 1.5.
NUMBER = re.compile(r"((?<![^\W_])[-+])?(\d+(\.\d+|,(?!\d{3}(?!\d))\d+)?|(?<![^\W_.])\.\d+)")
RECORDED = {  # target of a public recording -> experiment and, of places, the column of y_mm
    target: (experiment, column)
    for experiment, of in experiments.having("targets").items()
    for target, column in of.items()
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


def own(
    experiment: str,
    folder: Path,
    settings: Mapping,
    asked: Asked,
    read: Mapping[Path, tuple[pa.Table, pa.Table]] = MappingProxyType({}),
) -> Data:
    """Return the recordings <1>/<2>/<log> of a sensor of one's own; settings: the block of its experiment.

    read: path of a sensor's log -> its rows and rejects, of logs that need not be read once more.
    Raises InputError as the readers do, for a log that is there more than once, and for a path that names no group, a
    truth that is not there, is of another clock or, in the name of a folder, no number.
    """
    paths = recordings(folder, experiment)
    if problem := own_data.copied(paths, log_name(experiment)):
        raise InputError(f"{folder}: {problem}")
    series = []
    for path in paths:
        name = "/".join(path.parts[-2:])
        of_sensor = path / log_name(experiment)
        rows, _ = read.get(of_sensor) or sensor_rows(of_sensor, experiment, settings)
        time_s, segment, reading = readings(rows, sensor_format(experiment, settings))
        truth, known = truth_of(path, asked.target, experiment, settings, time_s, segment)
        press = votes(path, asked.target, experiment, settings, time_s, segment, truth)
        counted = np.where(known, press, -1)
        series.append(grouped(Series(name, NO_GROUP, time_s, segment, reading, truth, counted), asked.split, folder))
    return Data(asked.target, asked.split.by, series)


def recordings(folder: Path, experiment: str) -> list[Path]:
    """Return the folders <1>/<2> with a sensor's log; raises InputError without one, or for names that look alike."""
    paths = [path for path in parse.folders(folder, "*/*") if (path / log_name(experiment)).exists()]
    if not paths:
        raise InputError(f"{folder}: no recordings; expected <folder>/<recording>/{log_name(experiment)} in it")
    parse.check_names(paths)
    return paths


class Readings(NamedTuple):
    """What a sensor's log says, n readings of it."""

    time_s: np.ndarray  # (n,) rises within a segment
    segment: np.ndarray  # (n,)
    reading: np.ndarray  # (n, elements)
    rejects: pa.Table  # lines that cannot be used, with their reasons


def as_trained(readings: np.ndarray, here: Mapping, trained: Mapping) -> np.ndarray:
    """Return readings (n, columns) as printed, in the order of the columns of the logs of a model's training.

    For models that take columns as they are printed. here, trained: the blocks by which the logs are read.
    """
    orders = [reading["sensor"].get("order") or list(range(readings.shape[1])) for reading in (here, trained)]
    return readings[:, np.array(orders[0])[np.argsort(orders[1])]]


def sensor_log(path: Path, experiment: str, settings: Mapping) -> Readings:
    """Return the readings of a sensor's log; errors as `parse.read_log`."""
    rows, rejects = sensor_rows(path, experiment, settings)
    return Readings(*readings(rows, sensor_format(experiment, settings)), rejects)


def sensor_rows(path: Path, experiment: str, settings: Mapping) -> tuple[pa.Table, pa.Table]:
    """Return the rows and the rejects of a sensor's log; errors as `parse.read_log`."""
    fmt, name = sensor_format(experiment, settings), log_name(experiment)
    return log(path, fmt, experiment, settings, layout.of(settings["ingest"], name))


def readings(rows: pa.Table, fmt: Format) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return time (s) and segment, both (n,), and the readings (n, elements) of the rows of a sensor's log."""
    reading = np.column_stack([rows[column].to_numpy() for column in fmt.names[1:]])
    return rows[fmt.time].to_numpy() / second(fmt), rows["segment"].to_numpy(), reading


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

    Numbers are interpolated, but for holes of the log, as of ground truth in ingest; a class or an event holds until
    the next line says another.
    """
    if target.folder is not None:
        name = path.parts[-3 + target.folder]
        if target.kind == "class":
            return np.full(len(time_s), name), np.full(len(time_s), True)
        return np.full(len(time_s), number_in(name, path, target)), np.full(len(time_s), True)
    if segment[-1] > 0:
        raise InputError(
            f"{path / log_name(experiment)}: its clock begins anew, so the times of {target.file} are not its own; "
            "divide the recording there"
        )
    at, values = column_of(path / target.file, target, experiment, settings)
    check_lasts(path / target.file, at, experiment, settings, time_s)
    known = (time_s >= at[0]) & (time_s <= at[-1])
    if not known.any():
        raise InputError(
            f"{path / target.file}: lasts from {at[0]:g} to {at[-1]:g} s, {log_name(experiment)} from {time_s[0]:g} to "
            f"{time_s[-1]:g} s; stamp both by one clock, in one unit"
        )
    if target.kind == "continuous":
        return alignment.interpolated(time_s, at, values)
    held = values[np.clip(np.searchsorted(at, time_s, side="right") - 1, 0, None)]
    return (held != 0) if target.kind == "event" else held, known


def check_lasts(path: Path, at: np.ndarray, experiment: str, settings: Mapping, time_s: np.ndarray) -> None:
    """Raise InputError for a log with lines at `at` (m,) that does not last about as long as the sensor's, `time_s`."""
    lasts, sensor = float(np.ptp(at)), float(np.ptp(time_s))
    if not LEAST * sensor <= lasts <= MOST * sensor:
        unit = sensor_format(experiment, settings).columns[0].unit
        raise InputError(
            f"{path}: lasts {lasts:.6g} s, {log_name(experiment)} {sensor:.6g} s; are the times of both in {unit}? "
            "Write them so, or name the unit as time_unit in the log's format; if they are, both have to be of one "
            "recording"
        )


def number_in(name: str, path: Path, target: Target) -> float:
    """Return the one number in the name of a folder; raise InputError for none and for several."""
    numbers = [found[0] for found in NUMBER.finditer(name)]
    if len(numbers) != 1:
        names = f"names {len(numbers)} numbers ({' and '.join(numbers)})" if numbers else "names no number"
        raise InputError(
            f"{path}: the folder '{name}' {names} for the target '{target.name}'; rename it, with one number in it"
        )
    return float(numbers[0].replace(",", "."))


def column_format(path: Path, target: Target, experiment: str, settings: Mapping) -> tuple[Format, dict]:
    """Return the format of the log that has the target, a time and its column, and its layout."""
    clock = sensor_format(experiment, settings).columns[0]
    words: dict[str, int] | None = {} if target.kind == "class" else None
    taken = target.name in (clock.name, "line", "segment")  # columns of every table of a log
    name = f"{target.name} (target)" if taken else target.name
    fmt = Format((clock, Column(name, target.unit, -LARGEST, LARGEST, words=words)), time=clock.name)
    given = dict(layout.of(settings["ingest"], path.name) or {"separator": ","}) | {"columns": [target.column]}
    if isinstance(target.column, int) and path.is_file():
        width = sniff.columns_a_line(path, given.get("separator", ","))  # 0 of an empty file
        given.setdefault("width", width or target.column)
    return fmt, given


def column_of(path: Path, target: Target, experiment: str, settings: Mapping) -> tuple[np.ndarray, np.ndarray]:
    """Return times in s and values (m,) of the target's column in a log, text of a class; the first is the time."""
    fmt, given = column_format(path, target, experiment, settings)
    clock, words = fmt.columns[0], fmt.columns[1].words
    rows, _ = log(path, fmt, experiment, settings, given)
    strain.check_clock(path, rows)
    values = rows[fmt.columns[1].name].to_numpy()
    if words is not None:
        # Exact, because codes of 13 digits differ in their last; 3.0 is 3.
        names = np.array([f"{Decimal(word).normalize():f}" if layout.is_number(word) else word for word in words])
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
    pressed = load_cell.name in experiments.facts(experiment).truth and load_cell.exists()
    if pressed and settings["ingest"].get("clock") == "shared" and not segment[-1]:
        given = layout.of(settings["ingest"], load_cell.name)
        rows, rejects = log(load_cell, touch.LOAD_CELL, experiment, settings, given)
        strain.check_clock(load_cell, rows)
        rows, _ = touch.without_spikes(load_cell, rows, rejects)
        at = rows["t_us"].to_numpy() / second(touch.LOAD_CELL)
        check_lasts(load_cell, at, experiment, settings, time_s)
        force, known = alignment.interpolated(time_s, at, rows["fz_n"].to_numpy())
        force[~known] = 0.0
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
    found = patterns.compiled(split.pattern).search(series.name)
    if found is None or found[1] is None:
        raise InputError(
            f"{folder}: split.pattern '{split.pattern}' finds no {split.by} in the path '{series.name}'; mend it, or "
            "rename the folder"
        )
    return series._replace(group=np.full(n, found[1]))


def said(data: Data) -> Iterator[str]:
    """Yield a line for each group: recordings, readings that count, what the target is in them, and what is left out.

    data: of a sensor of one's own.
    """
    groups = sorted({name for each in data.series for name in np.unique(each.group)})
    for group in groups[:MOST_NAMED]:
        chosen = [each for each in data.series if (each.group == group).any()]
        truth = np.concatenate([each.truth[(each.group == group) & (each.press >= 0)] for each in chosen])
        if data.target.kind == "continuous":
            what = f"{truth.min():g} to {truth.max():g} {data.target.unit}" if len(truth) else "never known"
        else:
            names, counts = np.unique(truth, return_counts=True)
            what = ", ".join(f"{name} {count}" for name, count in zip(names, counts, strict=True))
            if len(names) > MOST_NAMED:
                what = f"{len(names)} classes, of {counts.min()} ({names[counts.argmin()]}) to {counts.max()} readings"
        left_out = sum(int(((each.group == group) & (each.press < 0)).sum()) for each in chosen)
        if left_out and data.target.kind != "class":  # readings between presses do not count for a class, either
            what += f"; {left_out} more are left out, as {data.target.file} tells nothing there"
        recordings = "1 recording" if len(chosen) == 1 else f"{len(chosen)} recordings"
        yield f"{group}: {recordings}, {len(truth)} readings; {data.target.name}: {what}"
    if len(groups) > MOST_NAMED:
        yield f"and {len(groups) - MOST_NAMED} more groups"


def lacking(data: Data, folder: Path) -> Iterator[str]:
    """Yield problems: groups of which no reading counts, and a target that is the same throughout."""
    target = data.target
    where = f"<{target.folder}> of the paths" if target.file is None else f"column {target.column} of {target.file}"
    counted = {name for each in data.series for name in np.unique(each.group[each.press >= 0])}
    for each in data.series:
        for group in np.unique(each.group):
            if group not in counted:
                yield (
                    f"{folder / each.name}: no reading of the {data.by} '{group}' counts, for want of a press or of a "
                    "truth; record it again, or remove it"
                )
    truth = np.unique(np.concatenate([each.truth[each.press >= 0] for each in data.series]))
    if len(truth) == 1:
        yield f"{folder}: the target '{target.name}' is {truth[0]} throughout, by {where}; record the other case, too"


def recorded(name: str, folder: Path, settings: Mapping) -> Data:
    """Return a target of the public recordings, one of RECORDED: a place of the arm by day, or the grasped object.

    Strands: the five that both days have, readings of presses count. Hand: its tactile matrices, without the angles of
    its joints, which tell the minute of a grasp (see its module in tactile/experiments); the grasps of each object, in
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
            reading = schemas.matrix(frames["v"])[:, module.SHARED[condition]]
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
