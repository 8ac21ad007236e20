"""Read a folder of your own logs as ingest would, say what was understood, and what to fix first.

The formats, the alignment and the splits are the experiment's own, with the values of the settings, and with what
FOLDER/settings.yaml sets for this sensor, where there is one, by dotted keys such as `touch.sensor.rows: 4`. Nothing is
changed but data/<experiment>/check.png, a picture of the first recordings. Ends with "ready" and status 0, or with the
first thing to fix and status 1.

Examples:

    tactile check data/own/finger
    tactile check touch data/sample
"""

import argparse
import re
import sys
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from tactile import experiments
from tactile.base import arguments, files
from tactile.base.errors import InputError
from tactile.base.paths import Workspace
from tactile.drawing import check as check_figures
from tactile.experiments import log_name, sensor_format
from tactile.logs import layout, own_data, parse, sniff
from tactile.logs.formats import Column
from tactile.logs.sniff import Proposal
from tactile.own import findings, summary
from tactile.own import logs as own_logs
from tactile.own import settings as own_settings
from tactile.own.recordings import Checked, Read, checked, read_one
from tactile.settings.targets import Asked, Target
from tactile.targets import read as target_logs

DRAWN = 3  # recordings in the picture
OTHER_NUMBERS = (2, 3, 6, 7, 8)  # of a line of a target's log that are no columns: a counter, a date, a zone


def check(workspace: Workspace, experiment: str, folder: Path, values: Mapping) -> str | None:
    """Print all that was understood, draw it, and return the first thing to fix, or None if ingest can read it all."""
    settings, log = values[experiment], log_name(experiment)
    module = experiments.module(experiment)
    recordings = module.recordings(folder)
    read, lines = [], summary.Shown()
    for path in recordings:
        one = checked(experiment, path, settings)
        read.append(one)
        print("\n".join(summary.recording_summary(one)))
        for name, fmt in module.formats(settings, path).items():
            proposal = one.proposals.get(name)
            laid_out = own_logs.trial(proposal) if proposal else layout.of(settings["ingest"], name)
            if (path / name).is_file():
                lines.show(path / name, fmt, Read(one.logs.get(name), [], proposal), laid_out)
    problems = [problem for recording in read for problem in recording.problems]
    usable = [recording for recording in read if recording.frames is not None]
    found: dict[str, list[Proposal]] = {}
    for recording in read:
        for name, proposal in recording.proposals.items():
            found.setdefault(name, []).append(proposal)
    of_images = module.KIND == "images"
    ranges = findings.area_ranges(experiment, read, settings) if of_images else own_logs.Ranges([], [], [], False)
    if ranges.falls:
        laid_out = layout.of(settings["ingest"], log) or own_logs.PLAIN
        found.setdefault(log, [Proposal({**laid_out, "rises_when_pressed": False}, [])])
    problems = [f"{folder}: {problem}" for problem in ranges.problems] + problems
    if copies := own_data.copied(recordings, log):
        problems.append(f"{folder}: {copies}")
    unlike = own_logs.unlike_gains(recordings)
    counts = sensor_format(experiment, settings).columns[-1].unit in ("counts", "1")
    if counts and log in unlike:  # counts have no unit that could differ
        problems.append(unlike.pop(log))
    print(f"\n{folder}: {len(usable)} of {len(read)} recordings can be used")
    said = findings.stuck_elements(experiment, read) + findings.rates(experiment, read)
    said += ranges.findings + list(unlike.values())
    said += findings.unmeasured(log, {one.name: one.logs for one in read})
    if usable:
        said += findings.clipped(experiment, folder, usable, settings)
        rows, together = findings.all_recordings(experiment, usable, settings)
        further = list(module.map_size_problems(settings)) if module.KIND == "windows" else []
        said += [finding.text for finding in together if not finding.wrong]
        problems += [finding.text for finding in together if finding.wrong] + further
        if not any(finding.wrong for finding in together):
            sizes, wrong = findings.split_sizes(experiment, rows, values)
            said, problems = said + sizes, problems + wrong
    print("\n".join(f"  {line}" for line in said))
    if drawn := [recording for recording in read if recording.logs][:DRAWN]:
        draw(workspace.check(experiment), experiment, drawn, settings)
    clock = [f"{experiment}.ingest.clock: own  # in place of shared"] * any(one.clock_own for one in read)
    return to_fix(experiment, folder, settings, found, problems, ranges.settings + clock)


def check_target(
    experiment: str, folder: Path, settings: Mapping, asked: Asked, lines: summary.Shown | None = None
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
        for finding in findings.unmeasured(log_name(experiment), read) if lines is not None else ():
            print(f"  {finding}")
        if problems:
            return to_fix(experiment, folder, settings, found, problems)
        sensor = {folder / name / log_name(experiment): logs[log_name(experiment)] for name, logs in read.items()}
        rows = {path: (log.rows, log.rejects) for path, log in sensor.items()}
        data = target_logs.own(experiment, folder, settings, asked, rows)
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
    parser.add_argument("experiment", nargs="?", **arguments.one_of("sensor", experiments.having("log")), help=kinds)
    parser.add_argument("folder", type=Path, metavar="FOLDER", help="such as data/own/finger")
    arguments.add_output(parser)


def main(workspace: Workspace, given: argparse.Namespace) -> None:
    """Check the folder named on the command line."""
    folder = given.folder
    check_folder(folder)
    experiment = given.experiment or experiment_of(folder)
    values = own_settings.of_logs(workspace, experiment, folder)
    if asked := own_settings.asked(folder):
        first = check_target(experiment, folder, values[experiment], asked, summary.Shown())
    else:
        own_settings.say_left_out(values[experiment], experiment)
        first = check(workspace, experiment, folder, values)
    first = first or own_data.linked(folder)
    result = {"experiment": experiment, "folder": str(folder), "ready": first is None, "fix_first": first}
    arguments.answer(given, result)
    if first is not None:
        sys.exit(f"fix first: {first}")
    words = own_data.argument(workspace, folder)
    print(f"ready: `tactile try {words}` for a quick look, `tactile own {words}` for all models")
    print(f"what the sensor itself is worth, before any model: `tactile sheet {words}`")
