"""Find what the recordings of a sensor of one's own show together: dead and clipped elements, rates, sizes of parts."""

import re
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from tactile import experiments
from tactile.base.errors import InputError
from tactile.base.facts import Finding
from tactile.datasets import schemas
from tactile.datasets.windowing import windows_of
from tactile.experiments import log_name, sensor_format
from tactile.inference import timing
from tactile.logs import layout, no_measurement, parse
from tactile.logs.formats import DUPLICATE
from tactile.own import logs as own_logs
from tactile.own.recordings import Checked
from tactile.sheet import quantities
from tactile.sheet import sources as sheet_sources

SHAPES = 8  # of an array that are listed
FEW_COPIES = 20  # lines of a log
FEW_TESTS = 50  # rows
OFTEN = 0.05  # share of a log's lines that have a gap before them
FEW_INTERVALS = 10  # in a tenth of a log, whose median says its rate
VERBS = {"train": "train on", "validation": "validate on", "test": "test on"}


def stuck_elements(experiment: str, read: list[Checked]) -> list[str]:
    """Return findings: elements and cells that change in no recording by more than their finest step, and recordings.

    The step is the finest of all columns of a kind, a count or a digit of the log. A recording is named in which no
    element changes at all.
    """
    lowest, highest, steps, constant = {}, {}, {}, []
    by_log = experiments.module(experiment).KIND == "series"  # a channel is called by its log, too
    for recording in read:
        log = recording.logs.get(log_name(experiment))
        elements = [c for c in log.rows.column_names if re.fullmatch(r"[a-z]\d+", c)] if log else []
        if elements and not any(np.ptp(log.rows[column].to_numpy()) > 0 for column in elements):
            constant.append(recording.name)
        for name, log in recording.logs.items():
            for column in log.rows.column_names:
                if re.fullmatch(r"[a-z]\d+", column):
                    values = log.rows[column].to_numpy()
                    key = f"{name} {column}" if by_log else column
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


def clipped(experiment: str, folder: Path, usable: Sequence[Checked], settings: Mapping) -> list[str]:
    """Return a finding where elements stand at a limit while they are pressed, by the definition of the data sheet."""
    frames, said = [recording.frames for recording in usable if recording.frames.num_rows], []
    columns = sensor_format(experiment, settings).names[1:]
    printed = settings["sensor"].get("order") or range(len(columns))  # number of the printed column of each element
    for sensor in sheet_sources.of_frames(experiment, folder.name, frames, settings) if frames else ():
        known = quantities.known(sensor)
        if known.limit:
            names = [columns[printed[k]] for k in known.clipped[:SHAPES]]
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


def all_recordings(experiment: str, read: Sequence[Checked], settings: Mapping) -> tuple[pa.Table, list[Finding]]:
    """Return all usable recordings as the stage dataset sees them, the rows to split, and what they show together."""
    module = experiments.module(experiment)
    schema = module.frames_schema(settings)
    frames = pa.concat_tables([recording.frames.select(schema.names).cast(schema) for recording in read])
    rows = frames = frames.unify_dictionaries().combine_chunks()
    if module.KIND == "windows":
        try:
            rows = windows_of(frames, settings["window"])
        except InputError as error:
            return frames, [Finding(f"{experiment}.window: {error}", wrong=True)]
    if module.KIND == "images":
        rows = frames.take(pa.array(module.chosen(frames, settings))).combine_chunks()
    return rows, list(module.findings(frames, rows, settings))


def split_sizes(experiment: str, rows: pa.Table, values: Mapping) -> tuple[list[str], list[str]]:
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


def area_ranges(experiment: str, read: Sequence[Checked], settings: Mapping) -> own_logs.Ranges:
    """Return what there is to say of the ranges of a scanner's readings; one that is said to rise is not doubted."""
    name = log_name(experiment)
    laid_out = layout.of(settings["ingest"], name)
    logs = {}
    for recording in read:
        proposal = recording.proposals.get(name)
        logs[recording.folder / name] = own_logs.trial(proposal) if proposal else laid_out
    ranges = own_logs.of_areas(logs, settings)
    if ranges.falls and "rises_when_pressed" in (laid_out or {}):
        return ranges._replace(problems=[p for p in ranges.problems if "rises_when_pressed" not in p], falls=False)
    return ranges
