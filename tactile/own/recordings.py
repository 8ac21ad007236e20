"""Read the recordings of a sensor of one's own: what can be used, and the problems of what cannot."""

import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from tactile import experiments
from tactile.base.errors import InputError
from tactile.experiments import touch
from tactile.logs import alignment, diagnosis, layout, parse, sniff, units
from tactile.logs.sniff import Proposal
from tactile.own import logs as own_logs

LINES = 200  # of a log's start, in which the time has to rise
SHAPES = 8  # of an array that are listed
SLOWEST_HZ, FASTEST_HZ = 0.2, 5000  # every scan and every serial line is within this range
TIMES = {  # unit wanted, whether too fast -> advice on the unit that is probably there
    ("microseconds", True): " Multiply milliseconds by 1000",
    ("microseconds", False): " Divide nanoseconds by 1000",
    ("seconds", False): " Divide milliseconds by 1000",
}
WHOLE_TIMES = 20  # lines whose times in seconds have no decimals, from which on the unit is asked for


class Checked(NamedTuple):
    """One recording: its files as far as they can be read, and its frames, if ingest can make them."""

    folder: Path
    logs: dict[str, own_logs.Log]
    frames: pa.Table | None
    report: dict  # of ingest, file -> its numbers; {} where ingest refused the recording
    problems: list[str]
    proposals: dict[str, Proposal]  # log -> how it can be read, where it is laid out in another way
    clock_own: bool  # its logs are said to share a clock, and do not

    @property
    def name(self) -> str:
        """Return `<condition>/<recording>`."""
        return f"{self.folder.parent.name}/{self.folder.name}"


class Read(NamedTuple):
    """One log of a recording."""

    log: own_logs.Log | None  # as far as it can be read
    problems: list[str]
    proposal: Proposal | None  # where it is laid out in another way


def read_one(experiment: str, path: Path, fmt: parse.Format, settings: Mapping) -> Read:
    """Read one log, or find out how it can be read."""
    log, unusable, laid_out = None, False, layout.of(settings["ingest"], path.name)
    try:
        log = own_logs.read_one(path, fmt, laid_out)
        own_logs.check_rejects(experiment, path, log, settings)
        wrong = list(unit_and_sign_problems(experiment, path, log, settings))
    except InputError as error:
        wrong = [str(error)]
        unusable = True
        if laid_out is None:
            wrong = [unread(experiment, path, fmt, settings, log) or str(error)]
    if not wrong:
        return Read(log, [], None)
    found = own_logs.proposed(experiment, path, fmt, settings, laid_out)
    if isinstance(found, Proposal) and (unusable or found.layout != own_logs.PLAIN):
        if (
            found.layout != own_logs.PLAIN
            and found.layout.items() >= own_logs.PLAIN.items()
            and (found.layout.keys() <= {"separator", "scale", "offset", "time_unit"})
        ):
            return Read(log, [f"{wrong[0]}; or {own_logs.PASTE}"], found)
        return Read(log, [f"{path}: {own_logs.LAID_OUT}"], found)
    return Read(log, [found] if isinstance(found, str) else wrong, None)


def checked(experiment: str, folder: Path, settings: Mapping) -> Checked:
    """Read one recording; what cannot be used becomes a problem, not an exception."""
    read, problems, proposals = {}, [], {}
    expected = experiments.module(experiment).formats(settings, folder)
    for name, fmt in expected.items():
        path = folder / name
        if not path.is_file():
            problems.append(diagnosis.missing(path, fmt, expected))
            continue
        log, wrong, proposal = read_one(experiment, path, fmt, settings)
        read |= {name: log} if log else {}
        proposals |= {name: proposal} if proposal else {}
        problems += wrong
    for name, proposal in proposals.items():
        if proposal.layout.get("rate_hz", 0) is None:
            proposals[name] = own_logs.with_rate(folder / name, expected[name], proposal, read)
    frames, report, clock_own = None, {}, False
    if not problems:
        try:
            frames, _, report = experiments.module(experiment).read_recording(folder, settings)
        except InputError as error:
            problems.append(f"{error}{lengths(read, settings)}")
            if isinstance(error, touch.Falls):
                falls = {**(layout.of(settings["ingest"], "array.log") or own_logs.PLAIN), "rises_when_pressed": False}
                proposals["array.log"] = Proposal(falls, [])
            clock_own = isinstance(error, alignment.NotOneClock)
    return Checked(folder, read, frames, report, problems, proposals, clock_own)


def unread(experiment: str, path: Path, fmt: parse.Format, settings: Mapping, log: own_logs.Log | None) -> str | None:
    """Return the sentence for a log of which too few lines can be read, or None where its lines do not show why.

    log: its lines as far as they are read.
    """
    try:
        printed = parse.printed_format(path, fmt)
    except InputError as error:
        return str(error)
    if log is None:
        return diagnosis.unreadable(path, printed) or wrong_columns(path, printed, settings)
    beyond = log.rejects.filter(pc.equal(log.rejects["reason"], parse.OUT_OF_RANGE))
    lacking = log.rejects.filter(pc.equal(log.rejects["reason"], parse.NOT_A_NUMBER)).slice(0, 1).to_pylist()
    return (
        wrong_columns(path, printed, settings)
        or diagnosis.without_values(path, lacking, printed)
        or diagnosis.out_of_range(path, beyond.slice(0, parse.TEXTS).to_pylist(), printed)
        or diagnosis.unreadable(path, printed)
    )


def wrong_columns(path: Path, fmt: parse.Format, settings: Mapping) -> str | None:
    """Name the key to change where most lines of a log have another number of columns than the settings say."""
    values = sniff.numbers_a_line(path) - 1
    expected = len(fmt.columns) - 1
    if values == expected or values < 1:
        return None
    if said := _named_columns(path, expected):
        return said
    if values == expected - 1 and not _begins_with_time(path):
        return (
            f"{path}: {values + 1} values per line and no time before them; begin each line with "
            f"{fmt.columns[0].name}, the device's clock"
        )
    unlike, alike = sniff.unlike_columns(path) if values > expected else ([], [])
    if unlike:
        such = f", such as {path.name}: {{columns: {alike}, width: {values + 1}}}" if len(alike) == expected else ""
        listed = ", ".join(unlike[:SHAPES]) + ", ..." * (len(unlike) > SHAPES)
        return (
            f"{path}: {values + 1} columns per line, but a time and {expected} readings are {expected + 1}; {listed}, "
            "unlike the others. Say by `columns` in the block ingest.format of settings.yaml which are readings"
            f"{such}; if all are, set the sensor's size to {values}"
        )
    if path.name == "array.log":
        sensor = settings["sensor"]
        shapes = [f"{n} x {values // n}" for n in range(1, values + 1) if values % n == 0]
        shapes = " or ".join(shapes if len(shapes) <= SHAPES else [*shapes[: SHAPES - 1], "..."])
        return (
            f"{path}: {values} values per line, but touch.sensor in params/touch.yaml is {sensor['rows']} rows x "
            f"{sensor['cols']} cols = {expected}; set touch.sensor.rows and touch.sensor.cols ({shapes})"
        )
    if path.name == "daq.log":
        return (
            f"{path}: {values} voltages per line, but strain.sensor.channels in params/strain.yaml is {expected}; "
            f"set strain.sensor.channels: {values}"
        )
    return f"{path}: {values + 1} columns per line; expected {expected + 1}: {fmt.shown}"


def _named_columns(path: Path, expected: int) -> str | None:
    """Say which columns a header names, and how their logs are made, where the names are none of a log's own."""
    found = sniff.columns(path)
    names = list(filter(None, found.names)) if found else []
    if found is None or len(names) < 2 or all(re.fullmatch(r"t_u?s|[a-z]\d+|[xyz]_mm|fz_n", name) for name in names):
        return None
    time = found.times[0] if found.times else []
    left = [name for place, name in enumerate(found.names) if place not in time and name]
    listed = ", ".join(left[:SHAPES]) + ", ..." * (len(left) > SHAPES)
    return (
        f"{path}: {len(left)} columns beside the time, {listed}, but {expected} readings are set; if all are readings, "
        "set the sensor's size, if some are, name these by `columns` in the block ingest.format of settings.yaml; if "
        f"one is the truth of a target, such as '{left[-1]}', `tactile import {path} data/own/NAME --truth "
        f"'{left[-1]}'` writes logs and settings"
    )


def _begins_with_time(path: Path) -> bool:
    """Tell whether the first column of a log rises from line to line, as a clock does."""
    with path.open("rb") as file:
        fields = [line.split(b",")[0].strip() for line, _ in zip(file, range(LINES), strict=False)]
    times = np.array([float(field) for field in fields if field.replace(b".", b"").isdigit()])
    return len(times) > 1 and np.mean(np.diff(times) > 0) > diagnosis.USUAL


def unit_and_sign_problems(experiment: str, path: Path, log: own_logs.Log, settings: Mapping) -> Iterator[str]:
    """Yield problems of a log that can be read: wrong units of time, and what the experiment knows of its devices."""
    rate = log.report["rate_hz"]
    told = own_logs.imported(path.parent).get(path.name, {}) | (layout.of(settings["ingest"], path.name) or {})
    own_time = not {"time_unit", "time_pattern", "rate_hz"} & told.keys()
    unit = "us" if "t_us" in log.rows.column_names else "s"
    times = log.rows[f"t_{unit}"].to_numpy() if f"t_{unit}" in log.rows.column_names else np.zeros(0)
    absolute = units.absolute(float(np.median(times)), float(np.median(np.diff(times)))) if len(times) > 1 else {}
    if own_time and absolute and unit not in absolute:
        yield (
            f"{path}: the times are {' or '.join(absolute.values())}; write {path.name}: {{time_unit: "
            f"{' or '.join(absolute)}}} into the block ingest.format of settings.yaml"
        )
    elif rate and not SLOWEST_HZ <= rate <= FASTEST_HZ:
        unit = "microseconds" if unit == "us" else "seconds"
        advice = TIMES.get((unit, rate > FASTEST_HZ), "")
        yield f"{path}: {rate:g} lines per second; is the first column the time in {unit}?{advice}"
    if "t_s" in log.rows.column_names and own_time:
        if len(times) >= WHOLE_TIMES and (times == np.rint(times)).all():
            yield (
                f"{path}: all times are whole numbers, {np.median(np.diff(times)):g} apart: are these milliseconds? "
                f"Write {path.name}: {{time_unit: ms}} into the block ingest.format of settings.yaml, or, if they are "
                "seconds, {time_unit: s}"
            )
    yield from experiments.module(experiment).log_problems(path, log.rows, settings)


def lengths(read: Mapping[str, own_logs.Log], settings: Mapping) -> str:
    """Say how long each log lasts, where they differ by more than the devices may start apart; else ''."""
    lasts = {}
    for name, log in read.items():
        interval = np.diff(log.rows["time_s"].to_numpy())
        lasts[name] = interval[interval > 0].sum()
    apart = settings["ingest"].get("max_clock_offset_s", np.inf)
    if not lasts or max(lasts.values()) - min(lasts.values()) <= apart:
        return ""
    each = ", ".join(f"{name} lasts {seconds:.0f} s" for name, seconds in lasts.items())
    return f" ({each}; the logs of a recording start within {apart:g} s of each other)"
