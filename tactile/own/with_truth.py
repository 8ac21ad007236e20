"""Write the logs of a sensor and of the truth of a target from tables that have both, and the settings that read them.

The readings are the logs of strands, in any unit: a kind of sensor that needs nothing but how many there are.
"""

import csv
import fnmatch
import io
import re
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd

from tactile.base import files, params
from tactile.base.errors import InputError
from tactile.experiments import log_name, strain
from tactile.logs import layout, sniff, units
from tactile.logs.formats import Column, Format
from tactile.own import logs as own_logs
from tactile.own import settings as own_settings
from tactile.own import tables
from tactile.settings import patterns

SENSOR, TRUTH = log_name("strain"), "truth.log"
MOST = 1024  # readings of a line
FEW = 10  # whole numbers that name classes
LEAST_NUMBERS = 0.9  # share of a column's values that are numbers, else it is one of words
LEAST_KNOWN = 0.1  # share of the rows in which a reading is known
FOLLOWS = 0.999  # correlation of a reading with the truth beyond which it is likely a second truth
ANEW = 0.1  # of how long a recording lasts; a time that falls back by less is of a late line
SHOWN = 8  # names in a sentence
OF_TIME = ("time_unit", "time_pattern", "strip", "rate_hz", "repeats")  # keys that origin.yaml can correct
NO_CLASS = ("", "nan", "n/a", "na", "null")  # `none` may be the name of a class, such as no touch
NO_UNIT = "a.u."


class Asked(NamedTuple):
    """What the command says."""

    truth: str  # a column, by its name or its number from 1
    unit: str | None
    group: str | None
    trial: str | None
    rate_hz: float | None
    leave_out: Sequence[str]
    readings: Sequence[str]  # patterns of the columns that may be readings; [] of all


class Recording(NamedTuple):
    """The rows of one recording."""

    name: str  # its path <1>/<2> below the folder of the sensor
    source: Path
    table: str
    rows: pd.DataFrame  # of text, with a decimal point; the columns are called by their places


class Tables(NamedTuple):
    """All recordings, whose tables have the same columns, and what these are."""

    recordings: list[Recording]
    names: list[str]
    named: bool  # a header names them
    truth: int
    time: list[int]  # places that are the time together; [] without
    readings: list[int]
    left_out: list[str]  # why the other columns are none


class Times(NamedTuple):
    """The times of the rows of a recording."""

    layout: dict
    text: dict[int, str]  # row -> time in s, of the rows that have one
    guesses: list[str]
    said: Sequence[str]


def write(given: Sequence[Path], folder: Path, settings: Mapping, asked: Asked) -> None:
    """Write FOLDER/<1>/<2>/{daq,truth}.log of every recording, and settings.yaml where there is none.

    given: files and folders of files; settings: the block `strain`. Raises InputError for files that are no tables or
    have unlike columns, for a truth or a trial that is no column, and for a truth that is the same throughout.
    """
    check_group(asked.group)
    with tempfile.TemporaryDirectory() as draft:
        found = _tables(dict(_paths(given)), asked, Path(draft))
    _check_beside(folder, found)
    if asked.group is not None:
        _check_grouped([one.name for one in found.recordings], asked.group)
    truth = pd.concat([one.rows[found.truth] for one in found.recordings])
    name = found.names[found.truth]
    kind, why = _kind(truth, name, asked, own_settings.leaves(own_settings.read(folder)).get("target.kind"))
    print("\n".join([f"{len(found.readings)} readings: {_listed(found, found.readings)}", *found.left_out]))
    for sentence in _followers(found, kind):
        print(sentence)
    written = [
        one.name for one in found.recordings if _write(folder / one.name, one, found, kind, settings, asked.rate_hz)
    ]
    if not written:
        raise InputError(f"{given[0]}: no recording has two rows in which '{name}' is known")
    _say_settings(folder, given, found, kind, why, asked, written)


def check_group(pattern: str | None) -> None:
    """Raise InputError for a pattern that cannot name groups."""
    try:
        brackets = 1 if pattern is None else patterns.compiled(pattern).groups
    except ValueError as error:
        raise InputError(f"--group: {error}") from error
    if brackets != 1:
        raise InputError(
            f"--group '{pattern}': has {brackets} pairs of brackets; put one around what names a person, day or session"
        )


def _check_grouped(names: Sequence[str], pattern: str) -> None:
    """Raise InputError where a pattern finds no group in the path of a recording."""
    found = (patterns.compiled(pattern).search(name) for name in names)
    lacking = [name for name, one in zip(names, found, strict=True) if one is None or one[1] is None]
    if lacking:
        raise InputError(
            f"--group '{pattern}': finds nothing in the path '{lacking[0]}', as in {len(lacking)} of {len(names)}; its "
            "brackets have to hold the person, day or session of each"
        )


def _paths(given: Sequence[Path]) -> Iterator[tuple[Path, str]]:
    """Yield each file and its path <1>/<2>: folders below what they share, joined, and its name without suffix."""
    alone = [path.absolute() for path in given if not path.is_dir()]
    shared = (
        next((above for above in alone[0].parents if all(above in path.parents for path in alone)), None)
        if alone
        else None
    )
    of_folders = [(path.absolute(), each) for path in given if path.is_dir() for each in tables.inside(path)]
    if not alone and not of_folders:
        raise InputError(f"{given[0]}: no file in it is of a kind that is read ({', '.join(tables.KINDS)})")
    taken: dict[str, Path] = {}
    for base, path in [*((shared, path) for path in given if not path.is_dir()), *of_folders]:
        below = path.absolute().relative_to(base).parts[:-1] or (base.name or "recordings",)
        name = "/".join(re.sub(r"[^\w.-]+", "_", part).lstrip(".") or "_" for part in ("_".join(below), path.stem))
        if name in taken:
            raise InputError(f"{path}: becomes the recording {name}, as {taken[name]} does; rename one of them")
        taken[name] = path
        yield path, name


def _tables(paths: Mapping[Path, str], asked: Asked, draft: Path) -> Tables:
    """Read the tables of all files, and find out what their columns are."""
    recordings: list[Recording] = []
    first: tuple[list[str], sniff.Columns] | None = None
    where: dict[str, int] = {}
    for number, (path, name) in enumerate(paths.items()):
        place = draft / str(number)
        place.mkdir()
        texts = tables.text_of(path, place, [asked.truth, asked.trial or ""])
        table, names, head, rows = _table(path, texts, asked.truth)
        if first is None:
            first = names, head
            wanted = {"--truth": [asked.truth], "--trial": [asked.trial] if asked.trial else []}
            wanted["--leave-out"] = [one for each in asked.leave_out for one in fnmatch.filter(names, each) or [each]]
            where = {
                f"{option} {column}": _place(column, names, f"{path}: {option}")
                for option, columns in wanted.items()
                for column in columns
            }
        if names != first[0]:
            if sorted(names) != sorted(first[0]) or not all(head.names):
                unlike = (f"'{name}'" for name in [*names, *first[0]] if (name in names) != (name in first[0]))
                raise InputError(
                    f"{path}: its columns are not those of {next(iter(paths))}, unlike in {next(unlike, 'the order')}; "
                    "import files of one sensor with the same columns"
                )
            rows = rows[[names.index(name) for name in first[0]]].set_axis(range(len(names)), axis=1)
            names = first[0]
        if asked.trial:
            at = where[f"--trial {asked.trial}"]
            named: dict[str, str] = {}
            for value, of_trial in rows[rows[at] != ""].groupby(at, sort=False):
                trial = tables.trial_name(names[at], str(value))
                if named.setdefault(trial, str(value)) != value:
                    raise InputError(f"{table}: {named[trial]} and {value} of {names[at]} are both {trial}; rename one")
                one = f"{name.replace('/', '_') if len(paths) > 1 else name.split('/')[1]}/{trial}"
                recordings.append(Recording(one, path, table, of_trial.reset_index(drop=True)))
        else:
            recordings.append(Recording(name, path, table, rows))
    assert first is not None
    return _roles(recordings, *first, where, asked)


def _table(path: Path, texts: Mapping[str, Path], truth: str) -> tuple[str, list[str], sniff.Columns, pd.DataFrame]:
    """Return the table of a file that has the truth: what it is called, its columns and its rows of text."""
    heads = {table: head for table, text in texts.items() if (head := sniff.columns(text))}
    if not heads:
        raise InputError(f"{path}: no table of columns is found in it; write one row a line, with the names above")
    table = next((table for table, head in heads.items() if truth in head.names), next(iter(heads)))
    if len(heads) > 1 and truth not in heads[table].names:
        known = list(dict.fromkeys(name for head in heads.values() for name in head.names if name))
        raise InputError(f"{path}: no column is called '{truth}'; {params.hint(truth, known)}")
    timed = next((other for other, head in heads.items() if head.times), table)
    if not heads[table].times and timed != table:
        raise InputError(f"{table}: '{truth}' has no times beside it, but {timed}; write one table that has both")
    head, rows = heads[table], []
    with layout.opened(texts[table]) as file, io.TextIOWrapper(file, head.encoding, "replace") as lines:
        for number, line in enumerate(lines):
            if number >= head.first and line.strip():
                rows.append(layout.numbers(line.strip("\r\n\ufeff"), head.separator, head.decimal))
    width = len(head.names)
    names = [name if name and head.names.count(name) == 1 else f"column {k + 1}" for k, name in enumerate(head.names)]
    return table, names, head, pd.DataFrame([fields for fields in rows if len(fields) == width], columns=range(width))


def _place(column: str, names: Sequence[str], where: str) -> int:
    """Return the place of a column, by its name or its number from 1."""
    if column in names:
        return names.index(column)
    if column.isdecimal() and 1 <= int(column) <= len(names):
        return int(column) - 1
    raise InputError(f"{where} '{column}' is no column; {params.hint(column, names)}")


def _numbers(values: pd.Series) -> np.ndarray:
    """Return the numbers of a column of text, NaN where there is none."""
    numbers = pd.to_numeric(values, errors="coerce").to_numpy(float)
    return np.where(np.isfinite(numbers), numbers, np.nan)


def _roles(
    recordings: list[Recording], names: list[str], head: sniff.Columns, where: Mapping[str, int], asked: Asked
) -> Tables:
    """Tell the time and the readings from columns that are neither, by all rows of all recordings."""
    reasons = {place: f"is named by {option.split()[0]}" for option, place in where.items()}
    truth = where[f"--truth {asked.truth}"]
    reasons[truth] = "is the truth"
    time = next((each for each in head.times if not set(each) & set(reasons)), [])
    reasons |= {place: "is the time" for place in time}
    if asked.readings:
        named = {name for pattern in asked.readings for name in fnmatch.filter(names, pattern)}
        if not named:
            raise InputError(f"--readings {' '.join(asked.readings)}: names no column; these are {', '.join(names)}")
        reasons = {
            place: "is not named by --readings" for place, name in enumerate(names) if name not in named
        } | reasons
    for place, name in enumerate(names):
        if place not in reasons and (why := _no_reading(place, name, recordings, head)):
            reasons[place] = why
    readings = [place for place in range(len(names)) if place not in reasons]
    source = recordings[0].source
    if not readings:
        raise InputError(f"{source}: no column is a reading: {'; '.join(_left_out(reasons, names))}")
    if len(readings) > MOST:
        raise InputError(f"{source}: {len(readings)} columns are readings, and {MOST} are the most; leave some out")
    if not time and asked.rate_hz is None:
        raise InputError(f"{source}: has no times; say by --rate-hz how many rows a second there are")
    return Tables(recordings, names, any(head.names), truth, time, readings, _left_out(reasons, names))


def _left_out(reasons: Mapping[int, str], names: Sequence[str]) -> list[str]:
    return [f"no reading: '{names[place]}' {reasons[place]}" for place in sorted(reasons)]


def _no_reading(place: int, name: str, recordings: Sequence[Recording], head: sniff.Columns) -> str | None:
    """Say why a column is no reading; None for one that is."""
    text = [one.rows[place] for one in recordings]
    values = [_numbers(each) for each in text]
    known = sum(int(np.isfinite(each).sum()) for each in values)
    filled = sum(int((~each.map(layout.is_missing)).sum()) for each in text)
    if known < LEAST_NUMBERS * filled:
        return "is of words"
    if not known or known <= LEAST_KNOWN * sum(map(len, values)):
        return f"is empty in all but {known} of {sum(map(len, values))} rows"
    bare = [each[np.isfinite(each)] for each in values]
    least, most = min(each.min() for each in bare if len(each)), max(each.max() for each in bare if len(each))
    if least == most:
        return f"is {least:g} throughout"
    if place in head.counters:
        return "counts the lines"
    if all((np.diff(each) > 0).all() for each in bare):
        return "rises in every line, as a time does"
    return None


def _kind(truth: pd.Series, name: str, asked: Asked, known: object) -> tuple[str, str]:
    """Return the kind of a target, and from what it is guessed, '' where it is said; known: of settings.yaml."""
    filled = truth[~truth.str.lower().isin(NO_CLASS)]
    numbers = _numbers(filled)
    different = np.unique(numbers[np.isfinite(numbers)])
    of_words = np.isfinite(numbers).sum() < LEAST_NUMBERS * len(filled)
    if not len(filled):
        raise InputError(f"--truth '{name}': is empty in every row")
    if filled.nunique() == 1 or (not of_words and len(different) == 1):
        only = filled.iloc[0] if of_words else f"{different[0]:g}"
        raise InputError(f"--truth '{name}': is {only} throughout; a target has two values or more")
    if of_words and asked.unit is not None:
        raise InputError(f"--unit {asked.unit}: is of numbers, but '{name}' has words, such as '{filled.iloc[0]}'")
    if known in ("continuous", "class", "event"):
        return str(known), ""
    if of_words:
        logical = filled.str.lower().isin(["true", "false"]).all()
        many = f"{filled.nunique()} different words"
        return ("event", "values are true and false") if logical else ("class", f"there are {many}")
    if asked.unit is not None:
        return "continuous", ""
    if set(different) <= {0, 1}:
        return "event", "values are 0 and 1"
    if len(different) <= FEW and (different == np.rint(different)).all():
        return "class", f"there are {len(different)} whole numbers; of a quantity say --unit"
    return "continuous", f"there are {len(different)} different numbers"


def _truth(values: pd.Series, kind: str) -> pd.Series:
    """Return the truth as it is written, '' where it is unknown."""
    if kind == "class":
        return values.where(~values.str.lower().isin(NO_CLASS), "")
    if kind == "event":
        values = values.replace({r"(?i)true": "1", r"(?i)false": "0"}, regex=True)
    return values.where(np.isfinite(_numbers(values)), "")


def _followers(found: Tables, kind: str) -> Iterator[str]:
    """Yield a sentence for each reading that goes with the truth as no sensor does."""
    if kind != "continuous":
        return
    truth = _numbers(pd.concat([one.rows[found.truth] for one in found.recordings]))
    for place in found.readings:
        values = _numbers(pd.concat([one.rows[place] for one in found.recordings]))
        both = np.isfinite(values) & np.isfinite(truth)
        if both.sum() > 2 and np.ptp(values[both]) and np.ptp(truth[both]):
            along = abs(np.corrcoef(values[both], truth[both])[0, 1])
            if along > FOLLOWS:
                name = found.names[place]
                yield f"'{name}' follows the truth (|r| {along:.4f}): if it is no reading, say --leave-out '{name}'"


def _times(one: Recording, found: Tables, settings: Mapping, rate_hz: float | None, block: Mapping) -> Times:
    """Return the times of the rows of a recording; block: of its log in origin.yaml, which may correct a guess.

    The reader of logs takes them from a draft with the time and, beside it, a column without a meaning.
    """
    fmt = Format((strain.CLOCK, Column("flag", "any", 0, 1)), time=strain.CLOCK.name)
    stamps = list(one.rows[found.time].agg(" ".join, axis=1)) if found.time else [""] * len(one.rows)
    separator = ";" if any("," in stamp for stamp in stamps) else ","
    time = re.sub('[,;"]', " ", " ".join(found.names[place] for place in found.time))
    head = [f"{time}{separator}flag"] if found.time and found.named else []
    lines = [f"{stamp}{separator}{k % 2}".lstrip(separator) for k, stamp in enumerate(stamps)]
    with tempfile.TemporaryDirectory() as folder:
        draft = Path(folder, SENSOR)
        draft.write_text("\n".join([*head, *lines]) + "\n", "utf-8")
        proposal: sniff.Proposal | str | None = sniff.Proposal({"separator": separator, "rate_hz": None}, [])
        if found.time:
            proposal = own_logs.proposed("strain", draft, fmt, settings, None)
        if not isinstance(proposal, sniff.Proposal):
            reason = (proposal or "no unit and no pattern of times is found").replace(f"{draft}: ", "")
            raise InputError(f"{one.table}: the times in '{time}' cannot be read: {reason}")
        if rate_hz is not None and "rate_hz" in proposal.layout:
            proposal.layout["rate_hz"] = rate_hz
        told = {key: block[key] for key in OF_TIME if key in block and found.time}
        if told and told != _of_time(proposal):
            others = {key: value for key, value in proposal.layout.items() if key not in OF_TIME}
            proposal = sniff.Proposal(others | told, [])
        if proposal.layout.get("rate_hz", 0) is None:
            raise InputError(f"{one.table}: has no times; say by --rate-hz how many rows a second there are")
        taken = [line for lines in layout.lines(draft, proposal.layout, fmt) for line in lines]
    text = {line.number - 1 - len(head): line.text.rpartition(",")[0] for line in taken if line.reason is None}
    return Times(_of_time(proposal), text, proposal.guesses, proposal.said)


def _of_time(proposal: sniff.Proposal) -> dict:
    """Return what a layout says of the time, its unit in any case."""
    described = {key: value for key, value in proposal.layout.items() if key in OF_TIME}
    unit = {} if {"time_pattern", "rate_hz"} & described.keys() else {"time_unit": strain.CLOCK.unit}
    return unit | described


def _write(folder: Path, one: Recording, found: Tables, kind: str, settings: Mapping, rate_hz: float | None) -> bool:
    """Write the logs of one recording, and tell whether its truth is known in two rows, without which none is written.

    Rows without any reading are left out. Where more rows lack a reading than `ingest` may reject, it is the one
    before; else such rows are left out, too.
    """
    known = own_logs.imported(folder)
    for name in (SENSOR, TRUTH):
        if (folder / name).exists() and name not in known:
            raise InputError(
                f"{folder / name}: exists already, and {own_logs.ORIGIN} does not say that it was imported"
            )
    times = _times(one, found, settings, rate_hz, known.get(SENSOR, {}))
    rows = one.rows[one.rows.index.isin(list(times.text))]
    at = pd.Series(times.text).reindex(rows.index)
    _refuse_several(one, found, at)
    truth = _truth(rows[found.truth], kind)
    if (truth != "").sum() < 2:
        print(f"{one.table}: '{found.names[found.truth]}' is known in fewer than two rows; no recording is made of it")
        return False
    readings = rows[found.readings]
    readings = readings.where(readings.apply(lambda column: np.isfinite(_numbers(column))))
    filled = readings[readings.notna().any(axis=1)]
    lacking, guesses = filled.isna().any(axis=1), list(times.guesses)
    notes = [f"{len(one.rows) - len(rows)} rows without a time"] * (len(rows) < len(one.rows))
    notes += [f"{len(rows) - len(filled)} without a reading"] * (len(filled) < len(rows))
    if before := lacking.mean() > settings["ingest"]["max_reject_fraction"]:
        guesses.append(f"that a reading which is missing, in {lacking.mean():.0%} of the rows, is the one before")
        filled = filled.ffill()
    filled = filled.dropna()
    if not before and lacking.any():
        notes.append(f"{lacking.sum()} in which a reading is missing")
    stretches = int(((truth == "") & (truth.shift() != "")).sum())
    origin = {"from": one.table} | ({"time": [found.names[place] for place in found.time]} if found.time else {})
    with files.changing_folder(folder) as target:  # both logs and what they are of, or nothing
        for name, table in ((SENSOR, filled), (TRUTH, truth[truth != ""].to_frame())):
            heads = ["value"] if name == TRUTH else [f"u{k}" for k in range(len(found.readings))]
            text = io.StringIO()
            writer = csv.writer(text, lineterminator="\n")
            writer.writerow([strain.CLOCK.name, *heads])
            writer.writerows([time, *row] for time, row in zip(at[table.index], table.to_numpy(), strict=True))
            (target / name).unlink(missing_ok=True)  # a name of the former log
            files.write_text(target / name, text.getvalue())
        lines = ["# Imported. To correct a guess, change the line below it and run the command again.", ""]
        lines += [f"sha256: {own_logs.on_a_line({str(one.source): files.sha256(one.source)})}", "logs:"]
        lines += [f"  # {sentence}" for sentence in times.said] + [f"  # guessed is {guess}" for guess in guesses]
        columns = {SENSOR: found.readings, TRUTH: [found.truth]}
        lines += [
            f"  {name}: {own_logs.on_a_line(origin | times.layout | {'columns': [found.names[k] for k in places]})}"
            for name, places in columns.items()
        ]
        (target / own_logs.ORIGIN).unlink(missing_ok=True)
        files.write_text(target / own_logs.ORIGIN, "\n".join(lines) + "\n")
    said = f"; left out are {', '.join(notes)}" if notes else ""
    print(f"{folder}: {len(filled)} lines of readings, {(truth != '').sum()} of the truth, from {one.table}{said}")
    if kind != "continuous" and stretches:
        print(f"  the truth is unknown in {stretches} stretches: there the {kind} before it holds")
    for sentence in [*times.said, *(f"guessed: {guess}" for guess in guesses)]:
        print(f"  {sentence}")
    return True


def _refuse_several(one: Recording, found: Tables, at: pd.Series) -> None:
    """Raise InputError where the time begins anew, as it does where a table has several recordings; at: row -> time."""
    seconds = at.astype(float).to_numpy()
    falls = np.flatnonzero(np.diff(seconds) < -ANEW * np.ptp(seconds)) if len(seconds) else []
    if not len(falls):
        return
    rows = one.rows.loc[at.index]
    changes = {place: np.flatnonzero((rows[place] != rows[place].shift()).to_numpy()[1:]) for place in rows}
    likely = [found.names[place] for place, where in changes.items() if np.array_equal(where, falls)]
    such = f", such as --trial '{likely[0]}'" if likely else ""
    raise InputError(
        f"{one.table}: the time begins anew in row {at.index[falls[0] + 1] + 1} of {len(one.rows)}; if it has several "
        f"recordings, name the column that tells them apart{such}, else divide it there"
    )


def _check_beside(folder: Path, found: Tables) -> None:
    """Raise InputError where other recordings of the sensor were made of other columns: u0 must not mean two."""
    wanted = [found.names[place] for place in found.readings]
    here = {folder / one.name for one in found.recordings}
    for path in sorted(files.finished(folder.glob(f"*/*/{own_logs.ORIGIN}"))):
        columns = own_logs.imported(path.parent).get(SENSOR, {}).get("columns", wanted)
        if path.parent not in here and columns != wanted:
            odd = next((name for name in [*wanted, *columns] if (name in wanted) != (name in columns)), "their order")
            raise InputError(
                f"{path.parent}: was made of other columns than these files would be, unlike in '{odd}'; name such by "
                "--leave-out, or import into another folder"
            )


def _say_settings(
    folder: Path, given: Sequence[Path], found: Tables, kind: str, why: str, asked: Asked, written: Sequence[str]
) -> None:
    """Write settings.yaml, or say which of its lines are missing or other ones than the logs need."""
    name, unit = found.names[found.truth], asked.unit
    target = {"name": re.sub(r"[^\w.-]+", "_", re.sub(r"[\[(].*", "", name)).strip("_") or "truth"}
    comments = [f"guessed is the kind, {kind}: {why}"] if why else []
    if kind == "continuous":
        unit = unit or units.named(name, "any")
        if unit is None:
            comments.append("no unit is said: write it in place of a.u., or say it by --unit")
        target |= {"unit": unit or NO_UNIT}
    target |= {"kind": kind, "file": TRUTH}
    split = {"by": "recording" if len(written) > 1 else "time"}
    if asked.group is not None:
        split = {"by": "session", "pattern": asked.group}
    wanted = {"strain.sensor.channels": len(found.readings), "strain.sensor.unit": "any"}
    wanted |= {"target": target | {"column": 2}, "split": split}
    path = folder / own_settings.FILE
    lines = [own_logs.on_a_line({key: value})[1:-1] for key, value in wanted.items()]
    lines[2:2] = [f"# {comment}" for comment in comments]
    lines[-1] += "  # person and day are other words for a session" if asked.group is not None else ""
    if not path.exists():
        made = f"# Made by import from {', '.join(map(str, given[:SHOWN]))}{' and others' * (len(given) > SHOWN)}."
        files.write_text(path, "\n".join([made, "# To correct a guess, change the line below it.", *lines]) + "\n")
        print("\n".join([f"{path}:", *(f"  {line}" for line in lines)]))
        return
    present = own_settings.leaves(own_settings.read(folder))
    free = {"target.name", "target.unit"} - ({"target.unit"} if asked.unit else set())
    free |= set() if asked.group is not None else {"split.by", "split.pattern"}
    differing = {
        key: value
        for key, value in own_settings.leaves(wanted).items()
        if present.get(key) != value and not (key in free and key in present)
    }
    if differing:
        needed = "; ".join(f"{key}: {value}" for key, value in differing.items())
        print(f"{path}: is left as it is, but these logs need other lines in it: {needed}")


def _listed(found: Tables, places: Sequence[int]) -> str:
    return ", ".join(found.names[place] for place in places)
