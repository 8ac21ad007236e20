"""Write the logs of a recording, or of many, from files of columns: text, .xlsx, .mat, .npy, .npz, .h5, .parquet.

FOLDER is the recording's, such as data/own/finger/single/run0, and FILE one file or more. Which columns are the time,
the readings, the force and the places is told by their names, number and course, as by `tactile check`; how many
readings there are and in which unit says settings.yaml of the sensor (data/own/finger). FOLDER/origin.yaml says what
each log was made from, and what was guessed: to correct it, change it there and run the command again.

Where a file has many recordings, --trial names the column that tells them apart, such as episode_index: FOLDER is the
one of their condition then, and each gets a folder in it.

Where the truth is another number, class or event than a load cell or an arm says, such as an angle, --truth names its
column: FOLDER is the sensor's then, such as data/own/joint, each file (of a folder, each file in it) is a recording, or
each value of --trial, all other columns of numbers are its readings, and settings.yaml is written beside them. --group
is a regular expression whose brackets hold the person, day or session in a recording's path below FOLDER.

Examples:

    tactile import run0.mat data/own/finger/single/run0
    tactile import forces.csv array.csv data/own/array/single/run1 --of touch
    tactile import file-000.parquet data/own/hand/grasps --trial episode_index --of touch
    tactile import walks data/own/joint --truth angle --unit deg --group "/(.*)_"
"""

import argparse
import shutil
import tempfile
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from tactile import experiments
from tactile.base import arguments, files, params
from tactile.base.errors import InputError
from tactile.base.paths import Workspace
from tactile.commands import check
from tactile.experiments import log_name
from tactile.logs import layout, parse, sniff
from tactile.logs.diagnosis import QUOTED
from tactile.logs.formats import Format
from tactile.logs.sniff import Proposal
from tactile.own import logs as own_logs
from tactile.own import settings as own_settings
from tactile.own import tables, with_truth
from tactile.own.logs import ORIGIN

FEWEST = 20  # counts that readings span at the gain of another recording; fewer are in another unit
MOST_NAMED = 12  # columns in a sentence
FROM = "from"  # key of a log's block in it: the table


class Found(NamedTuple):
    """Where the lines of one log come from."""

    table: str
    text: Path
    proposal: Proposal
    sure: bool  # the name of the table or of its columns says so


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the files, the folder and what the logs are of to the parser of this command."""
    parser.add_argument("files", nargs="+", type=Path, metavar="FILE", help="such as run0.mat")
    parser.add_argument("folder", type=Path, metavar="FOLDER", help="such as data/own/finger/single/run0")
    kinds = "what the logs are of, where other logs of the sensor or its settings.yaml do not tell it"
    parser.add_argument("--of", **arguments.one_of("sensor", experiments.having("log")), help=kinds)
    parser.add_argument("--trial", default="", metavar="COLUMN", help="whose values tell recordings in one file apart")
    parser.add_argument("--truth", metavar="COLUMN", help="of a target of one's own, by its name or number from 1")
    parser.add_argument("--unit", metavar="UNIT", help="of that truth, where it is a number, such as deg")
    groups = "regular expression whose brackets hold the person, day or session in a path; with --truth"
    parser.add_argument("--group", metavar="PATTERN", help=groups)
    others = "that is no reading, such as a second truth, or a pattern such as 'L_*'; with --truth, may be repeated"
    parser.add_argument("--leave-out", action="append", default=[], metavar="COLUMN", help=others)
    shown = "that are readings, such as 'adc*', where not all are that could be; with --truth, may be repeated"
    parser.add_argument("--readings", action="append", default=[], metavar="PATTERN", help=f"columns {shown}")
    parser.add_argument("--rate-hz", type=float, metavar="HZ", help="rows a second of files without times")


def main(workspace: Workspace, given: argparse.Namespace) -> None:
    """Write the logs of the recordings named on the command line."""
    if given.truth is not None:
        of_target(workspace, given)
        return
    for option, value in (
        ("--unit", given.unit),
        ("--group", given.group),
        ("--leave-out", given.leave_out),
        ("--readings", given.readings),
    ):
        if value:
            raise InputError(
                f"{option} goes with --truth, which names the column of the truth; add it, or leave both out"
            )
    folder, above = given.folder, 0 if given.trial else 1
    sensor = folder.absolute().parents[above] if len(folder.absolute().parents) > above + 1 else folder
    experiment = given.of or check.experiment_of(sensor)
    settings = own_settings.of_logs(workspace, experiment, sensor)[experiment]
    with tempfile.TemporaryDirectory() as draft:
        texts = {}
        for number, path in enumerate(given.files):
            place = Path(draft, str(number))
            place.mkdir()
            texts |= tables.text_of(path, place, [given.trial])
        recordings = {folder: texts}
        if given.trial:
            divided = tables.trials(texts, given.trial, Path(draft)).items()
            divided = sorted(divided, key=lambda trial: _scale(experiment, settings, folder / trial[0], trial[1]))
            recordings = {folder / name: each for name, each in divided}
        shared = [
            write(place, sensor, experiment, settings, each, given.files, given.rate_hz)
            for place, each in recordings.items()
        ]
    if all(shared) and "clock" in settings["ingest"]:
        print(f"the logs have one time: write {experiment}.ingest.clock: shared into {sensor / own_settings.FILE}")
    shown = folder.parents[above] if len(folder.parents) > above else folder
    print(f"next: `tactile check {sensor if folder.is_absolute() else shown}`")


def of_target(workspace: Workspace, given: argparse.Namespace) -> None:
    """Write the logs of a sensor whose truth is a column beside its readings; FOLDER is that of the sensor."""
    if given.of not in (None, "strain"):
        raise InputError("--truth writes the logs of strands, which need the fewest settings; leave --of out")
    with_truth.check_group(given.group)
    settings = own_settings.of_logs(workspace, "strain", given.folder)["strain"]
    asked = with_truth.Asked(
        given.truth, given.unit, given.group, given.trial, given.rate_hz, given.leave_out, given.readings
    )
    with_truth.write(given.files, given.folder, settings, asked)
    print(f"next: `tactile check {given.folder}`")


def write(
    folder: Path,
    sensor: Path,
    experiment: str,
    settings: Mapping,
    texts: Mapping[str, Path],
    sources: Sequence[Path],
    rate_hz: float | None,
) -> bool:
    """Write the logs of one recording, and return whether those of several devices are from one table.

    sensor: the folder of its recordings; settings: the experiment's block; texts: as of `tables.text_of`; sources: the
    files that these are of; rate_hz: of rows without times. Raises InputError where the sensor's own log is not found.
    """
    origin, gains = own_logs.imported(folder), _gains_beside(sensor, folder, log_name(experiment))
    with tempfile.TemporaryDirectory() as draft:
        formats, ways, refused = experiments.module(experiment).formats(settings, folder), {}, {}
        for name, fmt in formats.items():
            ways[name], refused[name] = _sniffed(experiment, name, fmt, texts, settings)
            if known := origin.get(name):
                ways[name] = [_told(texts, name, known, folder, ways[name])]
        found = _assigned(ways)
        if (name := log_name(experiment)) in found and name not in origin and gains:
            _take_gain(found[name], formats[name], gains, settings["ingest"]["max_reject_fraction"])
        for name, fmt in formats.items():
            if name not in found:
                if refused[name] and name == log_name(experiment):
                    raise InputError("\n".join(refused[name]))
                for reason in refused[name] or [f"not found in {', '.join(texts)}, as columns of {fmt.shown}"]:
                    print(f"{name}: {reason}")
                continue
            one = found[name]
            if rate_hz and "rate_hz" in one.proposal.layout:
                one.proposal.layout["rate_hz"] = rate_hz
            if one.proposal.layout.get("rate_hz", 0) is None:
                reason = f"{one.table}: has no times; say by --rate-hz how many rows a second there are"
                if name == log_name(experiment):
                    raise InputError(reason)
                print(f"{name}: {reason}")
                del found[name]
                continue
            if (folder / name).exists() and name not in origin:
                raise InputError(f"{folder / name}: exists already, and {ORIGIN} does not say that it was imported")
        if not found:
            raise InputError(
                f"{sources[0]}: no column of it is known, or there are not as many readings as {experiment}.sensor "
                f"has; fix {sensor / own_settings.FILE}, or name the columns in {folder / ORIGIN}, such as logs: "
                f"{{{log_name(experiment)}: {{{FROM}: {next(iter(texts))}, separator: ',', time: 1, columns: 2..5}}}}; "
                f"if one of the columns{_named(texts)} is the truth of a target, add --truth COLUMN"
            )
        limit, key = settings["ingest"]["max_reject_fraction"], f"{experiment}.ingest.max_reject_fraction"
        said = {name: _write(Path(draft, name), one, formats[name], limit, key) for name, one in found.items()}
        with files.changing_folder(folder) as target:  # all logs and what they are of, or nothing
            for name in found:
                (target / name).unlink(missing_ok=True)  # a name of the former log
                shutil.copyfile(Path(draft, name), target / name)
            _write_origin(target / ORIGIN, sources, found)
        for name, one in found.items():
            print(f"{folder / name}: {said[name]}")
            for sentence in one.proposal.said:
                print(f"  {sentence}")
            for guess in one.proposal.guesses:
                print(f"  guessed: {guess}")
    return len(found) > 1 and len({one.table for one in found.values()}) == 1


def _named(texts: Mapping[str, Path]) -> str:
    """Return the names of the columns of all tables, in brackets; '' without."""
    heads = map(sniff.columns, texts.values())
    names = list(dict.fromkeys(name for head in heads if head is not None for name in head.names if name))
    return f" ({', '.join(names[:MOST_NAMED])}{', ...' * (len(names) > MOST_NAMED)})" if names else ""


def _sniffed(
    experiment: str, name: str, fmt: Format, texts: Mapping[str, Path], settings: Mapping
) -> tuple[list[Found], list[str]]:
    """Return how a log can be made from the tables, the likeliest first, and why it cannot be from others.

    First are tables with times, of these such as are called as the log, then those that name its columns, then those
    with the fewest guesses.
    """
    ways, refused = [], []
    for table, text in texts.items():
        proposal = own_logs.proposed(experiment, text, fmt, settings, None)
        if isinstance(proposal, Proposal):
            called = Path(table).stem == Path(name).stem
            found = Found(table, text, proposal, called or proposal.named)
            timeless = proposal.layout.get("rate_hz", 0) is None
            ways.append((timeless, not called, not proposal.named, len(proposal.guesses), len(ways), found))
        elif isinstance(proposal, str):
            refused.append(proposal.replace(str(text), table))
    return [found for *_, found in sorted(ways)], refused


def _scale(experiment: str, settings: Mapping, folder: Path, texts: Mapping[str, Path]) -> float:
    """Return counts a reading of a recording alone: of several, the one with the fewest has the scale that all need."""
    name = log_name(experiment)
    ways, _ = _sniffed(
        experiment, name, experiments.module(experiment).formats(settings, folder)[name], texts, settings
    )
    return own_logs.gain(ways[0].proposal.layout)["scale"] if ways else np.inf


def _assigned(ways: Mapping[str, list[Found]]) -> dict[str, Found]:
    """Return log -> where its lines come from: first for logs whose table says so, and no column for two of them.

    ways: log -> tables that it can be made from, the likeliest first. A sensor must not become its own truth.
    """
    found: dict[str, Found] = {}
    for name in sorted(ways, key=lambda name: not (ways[name] and ways[name][0].sure)):
        taken = [(one.table, one.proposal.layout.get("columns")) for one in found.values()]
        left = [one for one in ways[name] if (one.table, one.proposal.layout.get("columns")) not in taken]
        if left and len(ways[name]) > 1 and not left[0].sure:
            left[0].proposal.guesses.append(f"that it is in {left[0].table}, whose columns have other names or none")
        found |= {name: left[0]} if left else {}
    return {name: found[name] for name in ways if name in found}


def _gains_beside(sensor: Path, folder: Path, name: str) -> dict[Path, dict]:
    """Return origin.yaml -> scale and offset of a log in the other recordings of a sensor that were imported."""
    others = (
        path
        for path in sorted(files.finished(sensor.glob(f"*/*/{ORIGIN}")))
        if path.parent.absolute() != folder.absolute()
    )
    blocks = ((path, own_logs.imported(path.parent).get(name)) for path in others)
    return {path: own_logs.gain(block) for path, block in blocks if block is not None}


def _take_gain(one: Found, fmt: Format, gains: Mapping[Path, Mapping], limit: float) -> None:
    """Give counts the scale and offset that those of another recording have, so that a count is worth the same in both.

    gains: origin.yaml -> scale and offset; limit: share of rows that may be out of the counts' range then. Raises
    InputError where the readings do not fit.
    """
    (place, gain), layout_of = next(iter(gains.items())), one.proposal.layout
    if not all(column.integer for column in fmt.columns) or own_logs.gain(layout_of) == gain:
        return
    layout_of |= gain
    try:
        rows, rejects = parse.read_log(one.text, fmt, layout=own_logs.trial(one.proposal))
        counts = np.column_stack([rows[column.name].to_numpy() for column in fmt.columns if column.name != fmt.time])
        fits = rejects.num_rows <= limit * (len(counts) + rejects.num_rows) and np.ptp(counts) >= FEWEST
    except InputError:
        fits = False
    if not fits:
        raise InputError(
            f"{one.table}: readings are no counts of 0 to {fmt.columns[-1].high:g} at the scale and offset of {place} "
            f"({own_logs.on_a_line(gain)}), and one reading must not mean two; write a scale there that fits all "
            "recordings and import that again first, or the readings of all files in one unit"
        )
    kept = [guess for guess in one.proposal.guesses if not guess.startswith(own_logs.ROUNDED)]
    one.proposal.guesses[:] = [*kept, f"{own_logs.ROUNDED} at the scale and offset of {place}"]


def _told(texts: Mapping[str, Path], name: str, block: Mapping, folder: Path, ways: Sequence[Found]) -> Found:
    """Return what origin.yaml says of a log, with the guesses of `ways` that it repeats: they stay guesses."""
    table, described = block.get(FROM), {key: value for key, value in block.items() if key != FROM}
    if table not in texts:
        raise InputError(f"{folder / ORIGIN}: {FROM} is '{table}', but the files are {', '.join(texts)}")
    params.check_block(described, layout.Layout, name, {name: str(folder / ORIGIN)})
    same = [one.proposal for one in ways if (one.table, one.proposal.layout) == (table, described)]
    return Found(table, texts[table], same[0] if same else Proposal(described, []), True)


def _write(path: Path, found: Found, fmt: Format, limit: float, key: str) -> str:
    """Write one log in the product's own layout, and return what came of it.

    Raises InputError where more than the share `limit` of the rows, which the setting `key` has, is left out.
    """
    rows, first = 0, ""
    left_out: Counter[str] = Counter()
    with path.open("w", encoding="utf-8", newline="\n") as log:
        log.write(f"{fmt.header}\n")
        for lines in layout.lines(found.text, found.proposal.layout, fmt):
            kept = [line.text for line in lines if line.reason is None]
            rows += len(kept)
            left_out.update(line.reason for line in lines if line.reason is not None)
            first = first or next((f"{line.number}, {line.text[:QUOTED]!r}" for line in lines if line.reason), "")
            log.writelines(f"{text}\n" for text in kept)
    if not rows:
        raise InputError(f"{found.table}: no row is as its block in {ORIGIN} says; fix the block of {path.name}")
    parse.check_rejects(Path(found.table), rows + left_out.total(), left_out, limit, key)
    reasons = ", ".join(f"{reason} {count}" for reason, count in left_out.most_common())
    said = f"; {left_out.total()} rows are left out ({reasons}; first: row {first})" if left_out else ""
    return f"{rows} lines from {found.table}{said}"


def _write_origin(path: Path, sources: Sequence[Path], found: Mapping[str, Found]) -> None:
    """Write what each log was made from; guesses are comments."""
    lines = ["# Imported. To correct a guess, change the line below it and run the command again.", ""]
    lines += [f"sha256: {own_logs.on_a_line({str(source): files.sha256(source) for source in sources})}", "logs:"]
    for name, one in found.items():
        lines += [f"  # {sentence}" for sentence in one.proposal.said]
        lines += [f"  # guessed is {guess}" for guess in one.proposal.guesses]
        lines.append(f"  {name}: {own_logs.on_a_line({FROM: one.table} | one.proposal.layout)}")
    files.write_text(path, "\n".join(lines) + "\n")
