"""Read a folder of your own logs as ingest would, say what was understood, and what to fix first.

The formats, the alignment and the splits are the experiment's own, with the values of the settings, and with what
FOLDER/settings.yaml sets for this sensor, where there is one, by dotted keys such as `touch.sensor.rows: 4`. Nothing is
changed but data/<experiment>/check.png, a picture of the first recordings. Ends with "ready" and status 0, or with the
first thing to fix and status 1.
"""

import argparse
import os
import re
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from scipy.optimize import linear_sum_assignment

from pipeline import experiments
from pipeline.base import arguments, files
from pipeline.base.errors import InputError
from pipeline.base.paths import Workspace
from pipeline.datasets import labels, schemas
from pipeline.datasets.windowing import windows_of
from pipeline.experiments import log_name, sensor_format, touch
from pipeline.inference import timing
from pipeline.logs import alignment, diagnosis, layout, no_measurement, own_data, parse, rest, shown, sniff, units
from pipeline.logs.formats import DUPLICATE, Column
from pipeline.logs.sniff import Proposal
from pipeline.own import logs as own_logs
from pipeline.own import settings as own_settings
from pipeline.reporting.figures import check as check_figures
from pipeline.settings.targets import Asked, Target
from pipeline.sheet import quantities
from pipeline.sheet import sources as sheet_sources
from pipeline.targets import read as target_logs

DRAWN = 3  # recordings in the picture
LINES = 200  # of a log's start, in which the time has to rise
OTHER_NUMBERS = (2, 3, 6, 7, 8)  # of a line of a target's log that are no columns: a counter, a date, a zone
FEW_COPIES = 20  # lines of a log
SHAPES = 8  # of an array that are listed
OUTSIDE = 0.02  # share of contacts that may lie beside the array
SLOWEST_HZ, FASTEST_HZ = 0.2, 5000  # every scan and every serial line is within this range
TIMES = {  # unit wanted, whether too fast -> advice on the unit that is probably there
    ("microseconds", True): " Multiply milliseconds by 1000",
    ("microseconds", False): " Divide nanoseconds by 1000",
    ("seconds", False): " Divide milliseconds by 1000",
}
LEAST_MM = 0.2  # an arm that moves less is given in metres
MOST_KPA = 5000  # ten times the pressure on soft sensors
SMALL = 0.12  # share of the array's sides; contacts that stay within are given in centimetres, or in one place
BETTER = 0.2  # share of contacts that another order of the elements must explain beyond the expected one
LEAST_RIGHT = 0.6  # share of firm contacts in which the pressed element is the strongest; simulated arrays have 0.9
FEW_TESTS = 50  # rows
OFTEN = 0.05  # share of a log's lines that have a gap before them
SLOW_HZ = 25  # a touch device that is slower cannot be aligned to a press's rise of 0.1 s
FEW_INTERVALS = 10  # in a tenth of a log, whose median says its rate
WHOLE_TIMES = 20  # lines whose times in seconds have no decimals, from which on the unit is asked for
TARED = 0.03  # of the highest force, the most that a load cell shows at rest; recorded ones have 0.017, simulated 0.009
STUCK = 0.05  # share of the time without a press in which an element is high; simulated arrays have 0
FEW = 3  # firm contacts that tell which column answers at one place
ORDER = "row by row from the bottom row, each from left to right"


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
        wrong = list(conventions(path, log, settings))
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


def areas_of(read: list[Checked], settings: Mapping) -> own_logs.Ranges:
    """Return what there is to say of the ranges of a scanner's readings; one that is said to rise is not doubted."""
    laid_out = layout.of(settings["ingest"], log_name("glove"))
    logs = {}
    for recording in read:
        proposal = recording.proposals.get(log_name("glove"))
        logs[recording.folder / log_name("glove")] = own_logs.trial(proposal) if proposal else laid_out
    ranges = own_logs.of_areas(logs, settings)
    if ranges.falls and "rises_when_pressed" in (laid_out or {}):
        return ranges._replace(problems=[p for p in ranges.problems if "rises_when_pressed" not in p], falls=False)
    return ranges


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


def _begins_with_time(path: Path) -> bool:
    """Tell whether the first column of a log rises from line to line, as a clock does."""
    with path.open("rb") as file:
        fields = [line.split(b",")[0].strip() for line, _ in zip(file, range(LINES), strict=False)]
    times = np.array([float(field) for field in fields if field.replace(b".", b"").isdigit()])
    return len(times) > 1 and np.mean(np.diff(times) > 0) > diagnosis.USUAL


def conventions(path: Path, log: own_logs.Log, settings: Mapping) -> Iterator[str]:
    """Yield problems of a log that can be read: wrong units of time, force and place."""
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
    if "fz_n" in log.rows.column_names:
        force = log.rows["fz_n"].to_numpy()
        low, rest, high = np.percentile(force, [0.5, 10, 99.5])
        threshold = settings["window"]["contact_threshold_n"]
        tared = max(TARED * max(high - rest, threshold), 2 * (rest - low))  # beyond the noise, too
        if -low > high:
            yield f"{path}: {touch.PULLED}"
        elif rest <= threshold and abs(rest) > min(threshold, tared):
            yield (
                f"{path}: fz_n rests at {rest:.2g} N, not at 0, so that every force is {abs(rest):.2g} N too "
                f"{'high' if rest > 0 else 'low'}; subtract what the load cell shows at rest"
            )
        elif rest > threshold:
            yield (
                f"{path}: fz_n rests at {rest:.2g} N, above touch.window.contact_threshold_n ({threshold:g} N), so "
                "that presses never end; subtract what the load cell shows at rest"
            )
    if path.name == "cnc.log" and not (log.rows["z_mm"].to_numpy() < 0).any():
        yield f"{path}: z_mm is never below 0; z is 0 at the sensor's surface and negative when pressed"
    if path.name == "robot.log":
        axes = [name for name in log.rows.column_names if name.endswith("_mm")]
        moves = max(np.ptp(log.rows[axis].to_numpy()) for axis in axes)
        if moves < LEAST_MM:
            yield f"{path}: the arm moves by no more than {moves:g} mm; write {', '.join(axes)} in millimetres"


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


def understood(recording: Checked) -> Iterator[str]:
    """Yield lines of text about one recording."""
    yield f"\n{recording.name}"
    for name, log in recording.logs.items():
        report = recording.report.get(name, log.report)
        rejects = ", ".join(f"{reason} {count}" for reason, count in report["rejects"].items())
        first = rejects and f" (first: line {log.rejects['line'][0].as_py()})" if log.rejects.num_rows else ""
        yield (
            f"  {name:<16} {report['lines']} lines, {report['accepted']} accepted, "
            f"{sum(report['rejects'].values())} rejected{': ' if rejects else ''}{rejects}{first}"
        )
        rate = f"{report['rate_hz']:.2f} Hz" if report["rate_hz"] else "rate unknown"
        yield f"{'':19}{rate}, {report['gaps']} gaps, {report['segments']} segments; {ranges(log.rows)}"
        if packet_s := parse.packet_s(log.rows):
            yield (
                f"{'':19}times come in packets of {1e3 * packet_s:.0f} ms, or in such steps, as a serial adapter hands "
                "lines on: they were spread evenly"
            )
        if report["gaps"] > OFTEN * report["lines"]:
            yield (
                f"{'':19}gaps, times between lines of more than {schemas.LONG:g} usual ones, are in "
                f"{100 * report['gaps'] / report['lines']:.0f} % of them: no window goes over a gap, so few are left"
            )
        for reading, (count, longest) in log.report.get("filled", {}).items():
            lasts = f", or {longest / report['rate_hz']:.3g} s" if report["rate_hz"] else ""
            yield (
                f"{'':19}{reading}: missing in {100 * count / report['lines']:.2g} % of the lines, and taken from the "
                f"line before; in up to {longest} lines on end{lasts}"
            )
        if name == "array.log" and report["rate_hz"] and report["rate_hz"] < SLOW_HZ:
            yield f"{'':19}slower than {SLOW_HZ} Hz: presses may not be aligned well, and windows are few"
        for clock in filter(None, report.get("clocks", [report.get("clock")])):
            yield f"{'':19}clock: {of_clock(clock)}"
        yield from (f"{'':19}finding: {warning}" for warning in report.get("warnings", []))
        for channel, fault in report.get("channels", {}).items():
            yield f"{'':19}{channel}: {fault['fault']} in {100 * fault['share']:.0f} % of the time"
    yield from (f"  problem: {problem}" for problem in recording.problems)


class Shown:
    """Prints lines of each log, once for all recordings that are laid out alike."""

    def __init__(self):
        self._seen: set[tuple[str, str]] = set()

    def show(self, path: Path, fmt: parse.Format, one: Read, laid_out: Mapping | None) -> None:
        """Print lines of a log with what is read from them; laid_out: as the settings, or else a proposal, has it."""
        key = path.name, own_logs.on_a_line(one.proposal.layout if one.proposal else {"read": one.log is not None})
        if key in self._seen:
            return
        self._seen.add(key)
        heading, log = f"  {path.name} of {path.parent.parent.name}/{path.parent.name}: lines of it as printed", one.log
        if one.proposal is not None:
            log = own_logs.read_one(path, fmt, laid_out)
            rate = "" if one.proposal.layout.get("rate_hz", 0) is not None else ", at 1 line a second"
            print(f"{heading}, and what the block below would read from them{rate}")
        elif log is not None:
            print(f"{heading}, and what is read from them")
        else:
            print(f"{heading}, from which nothing is read")
        if log is None:
            said = shown.first_lines(path)
        else:
            said = shown.lines(path, log.rows, log.rejects, fmt, laid_out)
        print("\n".join(said))


def of_clock(clock: Mapping) -> str:
    """Return the numbers of a clock in words; clock: as ingest reports it."""
    if "correlation" not in clock:
        return "shared; the other logs are measured against this one"
    if clock["correlation"] is None:
        return "shared, not measured: too few presses, or too little motion, to tell"
    if "measured_offset_ms" in clock:
        return (
            f"shared, correlation {clock['correlation']:.2f}; best {clock['best_correlation']:.2f}, at an offset of "
            f"{clock['measured_offset_ms']:+.0f} ms, which is not applied"
        )
    return (
        f"offset {clock['offset_ms']:+.0f} ms, drift {clock['drift_ppm']:+.0f} ppm, "
        f"correlation {clock['correlation']:.2f}"
    )


def ranges(rows: pa.Table) -> str:
    """Return the smallest and largest value of each kind of column: v0 .. v24 are one kind, x_mm and y_mm are two."""
    kinds: dict[str, list[str]] = {}
    for name in rows.column_names:
        if name not in ("t_us", "t_s", "time_s", "line", "segment"):
            kinds.setdefault(re.sub(r"\d+$", "", name), []).append(name)
    parts = []
    for names in kinds.values():
        values = [rows[name].to_numpy() for name in names]
        low, high = min(v.min() for v in values) + 0.0, max(v.max() for v in values) + 0.0  # no -0
        columns = names[0] if len(names) == 1 else f"{names[0]} .. {names[-1]}"
        parts.append(f"{columns} {low:g} to {high:g}")
    return ", ".join(parts)


def whole(experiment: str, read: list[Checked], settings: Mapping) -> tuple[pa.Table, list[str], list[str]]:
    """Return all usable recordings as the stage dataset sees them: (rows to split, findings, problems)."""
    module = experiments.module(experiment)
    schema = module.frames_schema(settings)
    frames = pa.concat_tables([recording.frames.select(schema.names).cast(schema) for recording in read])
    frames = frames.unify_dictionaries().combine_chunks()
    if experiment == "strain":
        short = frames.num_rows < 10 * settings["window"]["frames"]
        return frames, [], ["the recordings are too short to learn from"] * short
    if experiment == "glove":
        images = frames.take(pa.array(module.chosen(frames, settings))).combine_chunks()
        return images, [f"{images.num_rows} images of {len(set(schemas.names(images['condition'])))} objects"], []
    try:
        windows = windows_of(frames, settings["window"])
    except InputError as error:
        return frames, [], [f"touch.window: {error}"]
    findings, problems = touch_findings(frames, windows, settings)
    return windows, findings, problems


def touch_findings(frames: pa.Table, windows: pa.Table, settings: Mapping) -> tuple[list[str], list[str]]:
    """Return findings and problems: presses, forces and places, and whether elements answer where they are pressed."""
    names = schemas.names(windows["condition"])
    said, problems = [], []
    for condition in np.unique(names):
        inside = names == condition
        presses = len(np.unique(windows["press"].to_numpy()[inside]))
        said.append(f"{condition}: {presses} presses, {inside.sum()} windows")
    if absent := [name for name in settings["split"].get("train_on", ["single"]) if name not in names]:
        problems.append(
            f"no folder '{absent[0]}': models learn from the conditions of touch.split.train_on; all others are "
            "test data"
        )
    force, x, y = (schemas.matrix(frames[name]) for name in ("force_n", "x_mm", "y_mm"))
    contact = np.nansum(force, axis=1) > settings["window"]["contact_threshold_n"]
    if not contact.any():
        threshold = settings["window"]["contact_threshold_n"]
        return said, [
            *problems,
            f"no force above {threshold:g} N (the highest is {np.nanmax(force):.2g} N): write fz_n in newtons, "
            "or lower touch.window.contact_threshold_n",
        ]
    sensor = settings["sensor"]
    size = sensor["cols"] * sensor["pitch_mm"], sensor["rows"] * sensor["pitch_mm"]
    highest = float(np.nanmax(force))
    kpa = float(np.nanmax(labels.pressure_kpa(force, labels.tip_radius_mm(frames, settings["label"]))))
    if kpa > MOST_KPA:
        problems.append(
            f"force up to {highest:.0f} N, {kpa:.0f} kPa under the tip (touch.label.tip_radius_mm "
            f"{settings['label']['tip_radius_mm']:g}): write fz_n in newtons (grams times 0.00981), or fix the radius"
        )
    said.append(
        f"force up to {highest:.1f} N ({kpa:.0f} kPa), "
        f"x {np.nanmin(x[contact]):.1f} to {np.nanmax(x[contact]):.1f} mm, "
        f"y {np.nanmin(y[contact]):.1f} to {np.nanmax(y[contact]):.1f} mm; the array is {size[0]:g} x {size[1]:g} mm"
    )
    touching = force > settings["window"]["contact_threshold_n"]
    within = np.ptp(x[touching]), np.ptp(y[touching])
    if sensor["rows"] * sensor["cols"] > 1 and within[0] < SMALL * size[0] and within[1] < SMALL * size[1]:
        return said, [
            *problems,
            f"all contacts are within {within[0]:.2g} x {within[1]:.2g} mm of an array of {size[0]:g} x {size[1]:g}: "
            "write x_mm and y_mm in millimetres, or press in other places too",
        ]
    outside = touching & ((x < 0) | (x > size[0]) | (y < 0) | (y > size[1]))
    exchanged = touching & ((y < 0) | (y > size[0]) | (x < 0) | (x > size[1]))
    if outside.sum() > OUTSIDE * touching.sum() and exchanged.sum() <= OUTSIDE * touching.sum():
        problems.append(
            f"{100 * outside.sum() / touching.sum():.0f} % of the contacts are beside the array, and none would be if "
            "x_mm and y_mm changed places: write x, to the right, before y, to the top"
        )
    elif outside.sum() > OUTSIDE * touching.sum():
        problems.append(
            f"{100 * outside.sum() / touching.sum():.0f} % of the contacts are beside the array; x_mm and y_mm are 0 "
            "at its bottom left corner and rise to the right and to the top: shift them, or fix touch.sensor.pitch_mm"
        )
    else:
        more, wrong = order_of_elements(frames, force, x, y, settings)
        said, problems = said + more, problems + wrong
    return said + moved_rest(frames, contact), problems


def moved_rest(frames: pa.Table, contact: np.ndarray) -> list[str]:
    """Return findings: recordings in which the array's rest takes a step; contact: (n,) whether a tip touches it."""
    condition, recording = (np.asarray(schemas.names(frames[name]), str) for name in ("condition", "recording"))
    names = np.char.add(np.char.add(condition, "/"), recording)
    readings, time, said = schemas.matrix(frames["v"]), frames["t_s"].to_numpy(), []
    for name in dict.fromkeys(names.tolist()):
        here = names == name
        if no_measurement.stuck_channels(time[here], readings[here]):
            continue  # whose level is no rest
        resting = np.flatnonzero(here & ~contact)
        if found := rest.step(readings[resting], readings[here]):
            said.append(
                f"{name}: from {time[resting[found.first]]:.1f} s of load_cell.log on, elements at rest read "
                f"{found.after:.4g} on average, before {found.before:.4g}: the sensor was re-zeroed, or its gain "
                "changed; make two recordings of it"
            )
    return said


def order_of_elements(
    frames: pa.Table, force: np.ndarray, x: np.ndarray, y: np.ndarray, settings: Mapping
) -> tuple[list[str], list[str]]:
    """Return findings and problems: whether the pressed element is the strongest in firm contacts.

    A contact is firm in a single touch with more than half the highest force. force, x, y: (n, touches).
    """
    sensor = settings["sensor"]
    rows, cols = sensor["rows"], sensor["cols"]
    firm = (np.isfinite(force).sum(axis=1) == 1) & (force[:, 0] > np.nanmax(force[:, 0]) / 2)
    if not firm.any() or rows * cols == 1:
        return [], []
    counts = schemas.matrix(frames["v"]).astype(float)
    response = counts[firm] - np.median(counts, axis=0)
    at_row = np.clip(y[firm, 0] // sensor["pitch_mm"], 0, rows - 1).astype(int)
    at_col = np.clip(x[firm, 0] // sensor["pitch_mm"], 0, cols - 1).astype(int)
    pressed, strongest = at_row * cols + at_col, response.argmax(axis=1)
    row, col = np.divmod(np.arange(rows * cols), cols)
    orders = {  # column that is printed for each element
        ORDER: row * cols + col,
        "row by row from the top row, each from left to right": (rows - 1 - row) * cols + col,
        "row by row from the bottom row, each from right to left": row * cols + cols - 1 - col,
        "row by row from the top row, each from right to left": (rows - 1 - row) * cols + cols - 1 - col,
        "column by column from the left, each from the bottom": col * rows + row,
        "in another order": strongest_columns(response, pressed),
    }
    right = {name: float(np.mean(order[pressed] == strongest)) for name, order in orders.items()}
    said = [f"the pressed element is the strongest in {100 * right[ORDER]:.0f} % of firm contacts"]
    best = max(right, key=right.get)  # the first of those that are equal, which has a name in words
    printed = np.array(sensor.get("order") or range(rows * cols))
    if right[best] >= right[ORDER] + BETTER:
        return said, [
            f"v0, v1, ... seem to be printed {best} (the pressed element would be the strongest in "
            f"{100 * right[best]:.0f} %, not {100 * right[ORDER]:.0f} % of firm contacts); set touch.sensor.order: "
            f"{printed[orders[best]].tolist()}, or put the CNC's zero at the bottom left corner"
        ]
    if right[ORDER] < LEAST_RIGHT:
        return said, [
            f"the pressed element is the strongest in {100 * right[ORDER]:.0f} % of firm contacts, and no order of the "
            "elements explains many more: check the wiring, x_mm and y_mm of cnc.log, and touch.sensor.pitch_mm"
        ]
    answers = orders["in another order"]
    if moved := [k for k in range(rows * cols) if is_elsewhere(k, answers, pressed, strongest)]:
        exchanged = set(moved)
        for k in moved:  # and the elements that were not pressed, whose columns they have
            while (k := answers[k]) not in exchanged and (pressed == k).sum() < FEW:
                exchanged.add(k)
        idle = ~(np.nansum(force, axis=1) > settings["window"]["contact_threshold_n"])
        above = counts > (counts.min() + counts.max()) / 2  # of all: what hardly moves is not stuck high
        stuck = [k for k in sorted({*moved, *answers[moved]}) if np.mean(above[idle, k]) > STUCK]
        of = schemas.names(frames["condition"])[firm] + "/" + schemas.names(frames["recording"])[firm]
        unlike = [
            (k, name)
            for k in moved
            for name in np.unique(of[pressed == k])
            if np.mean(strongest[(pressed == k) & (of == name)] == answers[k]) < LEAST_RIGHT
        ]
        if stuck:
            high = ", ".join(f"v{printed[k]}" for k in stuck)
            return said, [
                f"{high} is high in {100 * np.mean(above[idle][:, stuck]):.0f} % of the time without a press, so that "
                "it is stronger than the pressed element: it is stuck; check its wiring and record again"
            ]
        if unlike or not exchanged.issuperset(answers[sorted(exchanged)]):
            names = ", ".join(f"v{printed[k]}" for k in moved)
            where = f", but not in {unlike[0][1]}" if unlike else ""
            return said, [
                f"another element is the strongest where {names} should be{where}, and no one order mends that: "
                "elements were exchanged in some recordings only, or one is stuck; check the wiring and record again"
            ]
        moved, order = sorted(exchanged), printed.copy()
        order[moved] = printed[answers[moved]]
        names = ", ".join(f"v{printed[k]}" for k in moved)
        return said, [
            f"{names} seem to have changed places: where one is pressed, another of them is the strongest; set "
            f"touch.sensor.order: {order.tolist()}"
        ]
    return said, []


def strongest_columns(response: np.ndarray, pressed: np.ndarray) -> np.ndarray:
    """Return for each element the column that answers where it is pressed, each column once, (elements,).

    response: (contacts, elements) in counts above rest; pressed: (contacts,) number of the element under the tip. An
    element that was not pressed keeps its column, where that is left.
    """
    answers = response / np.maximum(response.max(axis=0), 1)
    means = np.zeros((response.shape[1],) * 2)
    for element in np.unique(pressed):
        means[element] = answers[pressed == element].mean(axis=0)
    return linear_sum_assignment(means + 1e-6 * np.eye(len(means)), maximize=True)[1]


def is_elsewhere(element: int, order: np.ndarray, pressed: np.ndarray, strongest: np.ndarray) -> bool:
    """Tell whether another column than an element's own is mostly the strongest where the element is pressed."""
    here = strongest[pressed == element]
    return order[element] != element and len(here) >= FEW and np.mean(here == order[element]) >= LEAST_RIGHT


def parts(experiment: str, rows: pa.Table, values: Mapping) -> tuple[list[str], list[str]]:
    """Return findings and problems: how many rows train, validate and test in the first run of every protocol."""
    module, said, problems = experiments.module(experiment), [], []
    for protocol, block in values[experiment]["protocols"].items():
        if not block["seeds"]:
            continue
        try:
            part = module.split(rows, values[experiment], protocol, block["seeds"][0])
        except InputError as error:
            problems.append(str(error))
            continue
        counts = {name: int((part == name).sum()) for name in schemas.PARTS[:3]}
        said.append(f"{protocol}: " + ", ".join(f"{count} {name}" for name, count in counts.items()))
        if protocol == "press" and module.KIND == "windows":
            said[-1] += f"; these are the windows, of {rows.num_rows}, that are touch.window.stride frames apart"
        if 0 < counts["test"] < FEW_TESTS:
            said[-1] += f"; fewer than {FEW_TESTS} to test on say little: record more"
        if empty := [name for name, count in counts.items() if not count]:
            problems.append(f"{protocol}: nothing to {' and '.join(VERBS[name] for name in empty)}; record more")
    return said, problems


VERBS = {"train": "train on", "validation": "validate on", "test": "test on"}


def unfit(experiment: str, settings: Mapping) -> list[str]:
    """Return problems: settings that do not fit this sensor, each with the key to change."""
    problems = []
    if experiment == "touch":
        try:
            labels.check_cells(settings["sensor"], settings["label"])
        except InputError as error:
            problems.append(str(error))
    for side in ("rows", "cols") if experiment == "touch" and "lomp" in settings["models"] else ():
        cells, elements = settings["label"][f"map_{side}"], settings["sensor"][side]
        if cells % elements:
            problems.append(
                f"params/touch.yaml, touch.label.map_{side}: {cells} is no multiple of touch.sensor.{side} ("
                f"{elements}), which lomp needs; set {max(1, round(cells / elements)) * elements}"
            )
    return problems


def still(experiment: str, read: list[Checked]) -> list[str]:
    """Return findings: elements and cells that change in no recording by more than their finest step, and recordings.

    The step is the finest of all columns of a kind, a count or a digit of the log. A recording is named in which no
    element changes at all.
    """
    lowest, highest, steps, constant = {}, {}, {}, []
    for recording in read:
        log = recording.logs.get(log_name(experiment))
        elements = [c for c in log.rows.column_names if re.fullmatch(r"[a-z]\d+", c)] if log else []
        if elements and not any(np.ptp(log.rows[column].to_numpy()) > 0 for column in elements):
            constant.append(recording.name)
        for name, log in recording.logs.items():
            for column in log.rows.column_names:
                if re.fullmatch(r"[a-z]\d+", column):
                    values = log.rows[column].to_numpy()
                    key = column if name == "array.log" or experiment == "glove" else f"{name} {column}"
                    lowest[key] = min(lowest.get(key, np.inf), values.min())
                    highest[key] = max(highest.get(key, -np.inf), values.max())
                    kind = re.sub(r"\d+$", "", key)
                    steps[kind] = min(steps.get(kind, np.inf), parse.finest_step(values))
    moves = {key: highest[key] - lowest[key] for key in lowest}
    dead = [key for key in moves if not moves[key] > 1.001 * steps[re.sub(r"\d+$", "", key)]]
    listed = ", ".join(dead[:10]) + (", ..." if len(dead) > 10 else "")
    said = [f"{len(dead)} of {len(lowest)} elements never change (dead, or never touched): {listed}"] if dead else []
    if constant:
        said.append(
            f"no element changes in {', '.join(constant)}: remove such a recording, unless the sensor reads so at rest"
        )
    return said


def unmeasured(name: str, read: Mapping[str, Mapping[str, own_logs.Log]]) -> list[str]:
    """Return findings: frames and channels of the sensor's log, `name`, that are no measurement, and copies of lines.

    read: recording -> log -> what was read of it.
    """
    logs, names, found = {one: logs[name] for one, logs in read.items() if name in logs}, [], {}
    for one, log in logs.items():
        names = [column for column in log.rows.column_names if re.fullmatch(r"[^\W\d_]\d+", column)]
        readings = np.column_stack([log.rows[column].to_numpy() for column in names])
        here = no_measurement.found(log.rows["time_s"].to_numpy(), readings)
        found[one] = no_measurement.Recording(here, log.rows["line"].to_numpy(), log.report["rate_hz"] or np.nan)
    said = no_measurement.said(found, names)
    for file in dict.fromkeys(file for each in read.values() for file in each):
        said += copied_lines({one: each[file] for one, each in read.items() if file in each}, file)
    return said


def copied_lines(logs: Mapping[str, own_logs.Log], file: str) -> list[str]:
    """Return a finding where more than a few lines of a file are exact copies of others; logs: by recording."""
    count = {name: log.report["rejects"].get(DUPLICATE, 0) for name, log in logs.items()}
    many = [name for name in logs if count[name] > max(FEW_COPIES, OFTEN * logs[name].report["lines"])]
    if not many:
        return []
    first = logs[many[0]]
    line = first.rejects.filter(pc.equal(first.rejects["reason"], DUPLICATE))["line"][0]
    times = first.report["lines"] / first.report["accepted"]
    each = f"each line is there {times:.0f} times" if abs(times - round(times)) < OFTEN and times > 1.5 else ""
    share = each or f"{100 * count[many[0]] / first.report['lines']:.2g} % of the lines are copies of others"
    return [
        f"{file}: {share}, with its time (the first: line {line} of {many[0]}; {len(many)} of {len(logs)} recordings): "
        f"copies are left out, and {first.report['rate_hz']:.3g} lines a second count; print each line once"
    ]


def clipped(experiment: str, folder: Path, usable: list[Checked], settings: Mapping) -> list[str]:
    """Return a finding where elements stand at a limit while they are pressed, by the definition of the data sheet."""
    frames, said = [recording.frames for recording in usable if recording.frames.num_rows], []
    printed = settings["sensor"].get("order") or range(1 << 20)  # number of the printed column of each element
    for sensor in sheet_sources.MAKERS[experiment](folder.name, frames, settings, False) if frames else ():
        known = quantities.known(sensor)
        if known.limit:
            names = [f"{'v' if experiment == 'touch' else 'u'}{printed[k]}" for k in known.clipped[:SHAPES]]
            which = ", ".join(names + ["..."] * (len(known.clipped) > SHAPES))
            said.append(
                f"{known.limit}{f' ({which})' if which else ''}: beyond that nothing is measured; lower the gain of "
                "the circuit, or press less"
            )
    return said


def rates(experiment: str, read: list[Checked]) -> list[str]:
    """Return a finding where the sensor's logs have rates that differ by more than `predict` takes as one rate.

    Series are resampled to one rate, and an image has no time in it, so that windows alone depend on it.
    """
    logs = {one.name: one.logs[log_name(experiment)] for one in read if log_name(experiment) in one.logs}
    known = {name: log.report["rate_hz"] for name, log in logs.items() if log.report["rate_hz"]}
    if experiments.module(experiment).KIND != "windows" or not known:
        return []
    said = [f"{name}: {changed}" for name, log in logs.items() if (changed := changed_rate(log.rows))]
    low, high = min(known, key=known.get), max(known, key=known.get)
    if known[high] > timing.TOLERANCE * known[low]:
        said.append(
            f"{low} has {known[low]:.3g} lines a second, {high} {known[high]:.3g}: windows of frames last unlike times "
            "in them; record all at one rate"
        )
    return said


def changed_rate(rows: pa.Table) -> str | None:
    """Return a finding where the rate of a log's tenths differs by more than `predict` takes as one rate; else None."""
    time_s, segment = rows["time_s"].to_numpy(), rows["segment"].to_numpy()
    within = np.flatnonzero(segment[1:] == segment[:-1])
    if len(within) < 10 * FEW_INTERVALS:
        return None
    tenths = np.array_split(within, 10)
    rate = np.array([1 / np.median(np.diff(time_s)[tenth]) for tenth in tenths])
    if rate.max() <= timing.TOLERANCE * rate.min():
        return None
    unlike = abs(np.log(rate / rate[0]))
    k = int(np.argmax(unlike > unlike.max() / 2))
    return (
        f"about {rate[k]:.3g} lines a second from line {rows['line'][int(tenths[k][0])]} on, {rate[0]:.3g} before: "
        "windows of frames last unlike times; divide the log where the rate changes, and record at one"
    )


def check(workspace: Workspace, experiment: str, folder: Path, values: Mapping) -> str | None:
    """Print all that was understood, draw it, and return the first thing to fix, or None if ingest can read it all."""
    settings = values[experiment]
    module = experiments.module(experiment)
    recordings = module.recordings(folder)
    read, lines = [], Shown()
    for path in recordings:
        one = checked(experiment, path, settings)
        read.append(one)
        print("\n".join(understood(one)))
        for name, fmt in module.formats(settings, path).items():
            log, proposal = one.logs.get(name), one.proposals.get(name)
            laid_out = own_logs.trial(proposal) if proposal else layout.of(settings["ingest"], name)
            if (path / name).is_file():
                lines.show(path / name, fmt, Read(log, [], proposal), laid_out)
    problems = [problem for recording in read for problem in recording.problems]
    usable = [recording for recording in read if recording.frames is not None]
    found: dict[str, list[Proposal]] = {}
    for recording in read:
        for name, proposal in recording.proposals.items():
            found.setdefault(name, []).append(proposal)
    ranges = areas_of(read, settings) if experiment == "glove" else own_logs.Ranges([], [], [], False)
    if ranges.falls:
        laid_out = layout.of(settings["ingest"], log_name("glove")) or own_logs.PLAIN
        found.setdefault(log_name("glove"), [Proposal({**laid_out, "rises_when_pressed": False}, [])])
    problems = [f"{folder}: {problem}" for problem in ranges.problems] + problems
    if copies := own_data.copied(recordings, log_name(experiment)):
        problems.append(f"{folder}: {copies}")
    unlike = own_logs.unlike_gains(recordings)
    if experiment != "strain" and log_name(experiment) in unlike:  # counts have no unit that could differ
        problems.append(unlike.pop(log_name(experiment)))
    print(f"\n{folder}: {len(usable)} of {len(read)} recordings can be used")
    said = still(experiment, read) + rates(experiment, read) + ranges.findings + list(unlike.values())
    said += unmeasured(log_name(experiment), {one.name: one.logs for one in read})
    if usable:
        said += clipped(experiment, folder, usable, settings)
        rows, findings, wrong = whole(experiment, usable, settings)
        said, problems = said + findings, problems + wrong + unfit(experiment, settings)
        if not wrong:
            findings, wrong = parts(experiment, rows, values)
            said, problems = said + findings, problems + wrong
    print("\n".join(f"  {line}" for line in said))
    if drawn := [recording for recording in read if recording.logs][:DRAWN]:
        draw(workspace.check(experiment), experiment, drawn, settings)
    clock = [f"{experiment}.ingest.clock: own  # in place of shared"] * any(one.clock_own for one in read)
    return to_fix(experiment, folder, settings, found, problems, ranges.settings + clock)


def check_target(
    experiment: str, folder: Path, settings: Mapping, asked: Asked, lines: Shown | None = None
) -> str | None:
    """Say what each group holds of a target of one's own, and return what to fix first; None where nothing is.

    settings: the block of the experiment; lines: where lines of the logs are to be shown.
    """
    problems, read = [], {}
    found: dict[str, list[Proposal]] = {}
    try:
        for path in target_logs.recordings(folder, experiment):
            fmt, laid_out = sensor_format(experiment, settings), layout.of(settings["ingest"], log_name(experiment))
            one = read_one(experiment, path / log_name(experiment), fmt, settings)
            logs = {log_name(experiment): (one, fmt, own_logs.trial(one.proposal) if one.proposal else laid_out)}
            if asked.target.file is not None and (path / asked.target.file).is_file():
                file = path / asked.target.file
                logs[file.name] = read_truth(experiment, file, settings, asked.target)
            for name, (one, fmt, laid_out) in logs.items():
                problems += one.problems
                if one.proposal is not None:
                    found.setdefault(name, []).append(one.proposal)
                if lines is not None:
                    lines.show(path / name, fmt, one, laid_out)
            read["/".join(path.parts[-2:])] = {name: one.log for name, (one, *_) in logs.items() if one.log}
        for finding in unmeasured(log_name(experiment), read) if lines is not None else ():
            print(f"  {finding}")
        if problems:
            return to_fix(experiment, folder, settings, found, problems)
        data = target_logs.own(experiment, folder, settings, asked)
        print("\n".join(target_logs.said(data)))
    except InputError as error:
        return str(error)
    return next(target_logs.lacking(data, folder), None)


def read_truth(experiment: str, path: Path, settings: Mapping, target: Target) -> tuple[Read, parse.Format, dict]:
    """Read the log that has a target's column, or find out how it can be read; with its format and its layout."""

    def read_as(values: Mapping) -> tuple[own_logs.Log, parse.Format, dict]:
        target_logs.column_of(path, target, experiment, values)
        fmt, laid_out = target_logs.column_format(path, target, experiment, values)
        return own_logs.read_one(path, fmt, laid_out), fmt, laid_out

    try:
        log, fmt, laid_out = read_as(settings)
        return Read(log, [], None), fmt, laid_out
    except InputError as error:
        problem = str(error)
    fmt, laid_out = target_logs.column_format(path, target, experiment, settings)
    numbers = sniff.numbers_a_line(path)
    for count in dict.fromkeys(numbers - less for less in (1, *OTHER_NUMBERS) if numbers > less):
        others = (Column(f"c{k}", "any", -target_logs.LARGEST, target_logs.LARGEST) for k in range(count))
        every = replace(fmt, columns=(fmt.columns[0], *others))
        found = own_logs.proposed(experiment, path, every, settings, None)
        if not isinstance(found, Proposal):
            continue
        bare = {key: value for key, value in found.layout.items() if key not in ("columns", "width")}
        for tried in [bare | {"time": 1}] * ("time_pattern" in bare) + [bare]:
            try:
                log, *described = read_as(settings | {"ingest": settings["ingest"] | {"format": {path.name: tried}}})
            except InputError:
                continue
            guesses = [guess for guess in found.guesses if "time" in guess]
            return Read(log, [f"{path}: {own_logs.LAID_OUT}"], Proposal(tried, guesses)), *described
    return Read(None, [problem], None), fmt, laid_out


def to_fix(
    experiment: str,
    folder: Path,
    settings: Mapping,
    found: Mapping[str, list[Proposal]],
    problems: list[str],
    further: Sequence[str] = (),
) -> str | None:
    """Print the lines of settings that read logs of another layout, and all problems; return the first problem.

    further: other lines of settings.
    """
    for name, several in found.items():
        ways = {own_logs.on_a_line(one.layout | {"rate_hz": 1.0}) for one in several}
        if len(ways) > 1:
            problems.append(f"{folder}: {name} is laid out in {len(ways)} ways; bring all to that of the block above")
    if block := [*own_logs.format_block(experiment, found, settings), *further]:
        print(f"\nfor {folder / own_settings.FILE}:", *block, sep="\n")
    if len(problems) > 1:
        print("\nto fix:", *of_each_kind(problems), sep="\n  ")
    return problems[0] if problems else None


def draw(target: Path, experiment: str, recordings: list[Checked], settings: Mapping) -> None:
    """Draw recordings to a file, or say why that cannot be written: what was found counts without it."""
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        check_figures.draw(target, experiment, recordings, settings)
    except OSError as error:
        print(f"no picture: {target} cannot be written ({error.strerror})")
    else:
        print(f"picture: {target}")


def of_each_kind(problems: list[str]) -> list[str]:
    """Return the first problem of each kind, with how many more there are that differ in files and numbers alone."""
    kinds: dict[str, list[str]] = {}
    for problem in dict.fromkeys(problems):
        words = re.sub(r"^.*?\.log: |'[^']*'|[-+.\d]+", "", problem)
        kinds.setdefault(words, []).append(problem)
    more = {several[0]: len(several) - 1 for several in kinds.values()}
    return [f"{first} (and {count} more like this)" if count else first for first, count in more.items()]


def experiment_of(folder: Path, named: str | None = None) -> str:
    """Return the experiment that the logs in a folder are of, by their names, or by the keys of settings.yaml.

    named: the one that the user names. Raises InputError where neither is clear, and where it is another.
    """
    check_folder(folder)
    if named is not None and kinds_of(folder) not in ([named], []):
        held = log_name(kinds_of(folder)[0])
        raise InputError(f"{folder}: holds no {log_name(named)}, but {held}; leave '{named}' out")
    present = kinds_of(folder)
    if len(present) != 1:
        keys = {str(key).partition(".")[0] for key in own_settings.read(folder)}
        present = [experiment for experiment in experiments.having("log") if experiment in keys] or present
    if len(present) != 1:
        wanted = ", ".join(f"{log} ({experiment})" for experiment, log in experiments.having("log").items())
        held = "logs of several kinds" if present else "no log of a sensor"
        raise InputError(f"{folder}: {held} in <folder>/<recording>/; expected one of {wanted}")
    return present[0]


def check_folder(folder: Path) -> None:
    """Raise InputError for a path that is no folder."""
    if folder.is_file():
        raise InputError(f"{folder}: is a file; name the folder of the sensor, with <folder>/<recording>/ in it")
    if not folder.is_dir():
        raise InputError(f"{folder}: there is no such folder")
    if folder.resolve().parent == folder.resolve():
        raise InputError(f"{folder}: is the whole disk; name a sensor's folder, with <folder>/<recording>/ in it")


def kinds_of(folder: Path) -> list[str]:
    """Return the experiments of which a folder holds logs, each in <folder>/<recording>/."""
    logs = experiments.having("log").items()
    return [experiment for experiment, log in logs if next(files.finished(folder.glob(f"*/*/{log}")), None)]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the experiment and the folder of logs to the parser of this command."""
    kinds = "what the logs are of, where their names or settings.yaml do not tell it"
    parser.add_argument("experiment", nargs="?", choices=tuple(experiments.having("log")), help=kinds)
    parser.add_argument("folder", type=Path, metavar="FOLDER", help="such as data/own/finger")
    arguments.add_output(parser)


def main(workspace: Workspace, given: argparse.Namespace) -> None:
    """Check the folder named on the command line."""
    folder = given.folder
    check_folder(folder)
    experiment = given.experiment or experiment_of(folder)
    place = Path(os.path.abspath(folder))  # without ..
    values = own_settings.of_logs(workspace, experiment, folder)
    if asked := own_settings.asked(folder):
        first = check_target(experiment, folder, values[experiment], asked, Shown())
    else:
        own_settings.say_left_out(values[experiment], experiment)
        first = check(workspace, experiment, folder, values)
    first = first or own_data.unnoticed(workspace, place)
    result = {"experiment": experiment, "folder": str(folder), "ready": first is None, "fix_first": first}
    arguments.answer(given, result)
    if first is not None:
        sys.exit(f"fix first: {first}")
    place = own_data.setting(workspace, place)
    print(f"ready: `tactile try {place}` for a quick look, `tactile own {place}` for all models")
    print(f"what the sensor itself is worth, before any model: `tactile sheet {place}`")
