"""Read the logs of a sensor of your own one by one, and propose the settings that read those of another layout."""

import io
import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pyarrow as pa
from ruamel.yaml import YAML

from tactile.base import params
from tactile.base.errors import InputError
from tactile.datasets import images
from tactile.experiments import glove, sensor_format, touch
from tactile.logs import layout, parse, sniff, units
from tactile.logs.formats import DUPLICATE, REPEATED, Column
from tactile.logs.report import log_report
from tactile.logs.sniff import Proposal

PLAIN = {"separator": ","}  # the layout of the product's logs, without empty lines and with counts such as 12.0
PASTE = "paste the block `format` above into settings.yaml"
SPREAD = "that lines of one time"  # so a guess of `sniff` begins
LAID_OUT = f"is laid out in another way; {PASTE}"
HIGH_REST = 0.75  # of the range of an area; a mat whose usual reading is beyond falls when it is pressed
DIM = 0.25  # of the range of an area; images of readings that reach no further are dark
STEPS_MOVED = 20  # finest steps, by more of which an arm moves and does not only rest
MARGIN = 1.1  # of the largest reading, where that is no converter's
RARE = 0.01  # of the frames, whose extremes are noise; of the lines, whose times are of late or torn ones
STEPS = [step * 10.0**power for power in range(-4, 7) for step in (1, 2, 5) if (step, power) != (1, 0)]  # of a scale
ROUNDED = "that readings may be rounded"
ORIGIN = "origin.yaml"  # beside logs that were imported: what each was made from
ANY = 1e15  # largest reading in any unit
BITS = (1023, 4095, 16383, 65535)  # largest counts of converters


class Log(NamedTuple):
    """One file as it was read."""

    rows: pa.Table
    rejects: pa.Table
    report: dict  # as `log_report` returns it, and `filled` as `layout.filled` does, where readings that miss are


def read_one(path: Path, fmt: parse.Format, laid_out: Mapping | None) -> Log:
    """Read one log, whatever share of its lines is rejected; errors as parse.read_log."""
    rows, rejects = parse.read_log(path, fmt, layout=laid_out)
    if fmt is touch.LOAD_CELL:
        rows, rejects = touch.without_spikes(path, rows, rejects)
    time = rows[fmt.time].to_numpy() / parse.second(fmt)
    report = log_report(rows.num_rows, rejects, time, rows["segment"].to_numpy())
    if (laid_out or {}).get("missing") == "previous":
        report["filled"] = layout.filled(path, laid_out, fmt)
    return Log(rows.append_column("time_s", pa.array(time)), rejects, report)


def read_in_any_unit(
    experiment: str, path: Path, names: Sequence[str], settings: Mapping, rate_hz: float = 1.0
) -> tuple[Log, Proposal]:
    """Return a log with columns of those names in the unit in which they are printed, and how it is laid out.

    rate_hz: of a log without times. Raises InputError where the log cannot be read.
    """
    clock = sensor_format(experiment, settings).columns[0]
    fmt = parse.Format((clock, *(Column(name, "any", -ANY, ANY) for name in names)), time=clock.name)
    found = proposed(experiment, path, fmt, settings, None)
    if isinstance(found, str):
        raise InputError(found)
    found = found or Proposal(dict(PLAIN), [])
    without = {"rate_hz": rate_hz} if found.layout.get("rate_hz", 0) is None else {}
    return read_one(path, fmt, found.layout | without), found


def check_rejects(experiment: str, path: Path, log: Log, settings: Mapping) -> None:
    """Raise InputError where more lines of a log are rejected than may be."""
    limit, key = settings["ingest"]["max_reject_fraction"], f"{experiment}.ingest.max_reject_fraction"
    parse.check_rejects(path, log.report["lines"], log.report["rejects"], limit, key)


def proposed(
    experiment: str, path: Path, fmt: parse.Format, settings: Mapping, laid_out: Mapping | None
) -> Proposal | str | None:
    """Return how a log can be read, as `sniff.proposed`; None also where it could not be read so.

    The sentence also says of a layout that is found that too many lines are none of it.
    """
    found = sniff.proposed(path, fmt)
    if not isinstance(found, Proposal):
        return found
    try:
        if sniff.METRES in found.guesses and not _is_in_metres(path, fmt, found):
            found.guesses.remove(sniff.METRES)
            del found.layout["scale"]
        found = whole(path, fmt, found, settings["ingest"]["max_reject_fraction"])
        log = read_one(path, fmt, trial(found))
        if log.report["rejects"].get(DUPLICATE):
            found = without_copies(path, fmt, found, log)
        if found.layout == laid_out:
            return None
    except units.Unit as error:  # as it changes in the course of the log
        return str(error)
    except InputError:
        return None
    try:
        check_rejects(experiment, path, log, settings)
    except InputError as error:
        return None if found.layout == PLAIN else str(error)
    return found


def without_copies(path: Path, fmt: parse.Format, found: Proposal, log: Log) -> Proposal:
    """Return a proposal for a log with copies of its lines: its rate without them, and no more spread than it needs.

    log: as it is read by the proposal.
    """
    rate = f"there are {log.report['rate_hz'] or np.nan:.3g} lines"
    guesses = [re.sub(r"there are \S+ lines", rate, guess) for guess in found.guesses]
    once = {key: value for key, value in found.layout.items() if key != "repeats"}
    bare = read_one(path, fmt, trial(found._replace(layout=once))).report
    if once == found.layout or bare["rejects"].get(REPEATED, 0) > RARE * bare["lines"]:
        return found._replace(guesses=guesses)
    return found._replace(layout=once, guesses=[guess for guess in guesses if not guess.startswith(SPREAD)])


def _is_in_metres(path: Path, fmt: parse.Format, found: Proposal) -> bool:
    """Tell whether an arm moves as little in the whole log as at its start, and by more than the digits' steps."""
    unscaled = found._replace(layout={key: value for key, value in found.layout.items() if key != "scale"})
    rows, _ = parse.read_log(path, fmt, layout=trial(unscaled))
    places = [rows[column.name].to_numpy() for column in fmt.columns if column.name != fmt.time]
    moves, step = max(map(np.ptp, places)), min(map(parse.finest_step, places))
    return STEPS_MOVED * step < moves < sniff.SMALL_M


def whole(path: Path, fmt: parse.Format, found: Proposal, limit: float) -> Proposal:
    """Return a proposal with the scale, and offset, at which readings with decimals are counts; else as it is.

    limit: share of lines with decimals that may be rejected instead. Raises InputError where no line can be read.
    """
    readings = [column for column in fmt.columns if column.name != fmt.time]
    if not all(column.integer for column in readings):
        return found
    any_number = {column.name: replace(column, low=-1e9, high=1e9, integer=False) for column in readings}
    columns = tuple(any_number.get(column.name, column) for column in fmt.columns)
    rows, _ = parse.read_log(path, replace(fmt, columns=columns), layout=trial(found))
    values = np.column_stack([rows[name].to_numpy() for name in any_number])
    if np.mean((values != np.rint(values)).any(axis=1)) <= limit:
        return found
    highest, low = min(column.high for column in readings), min(0.0, values.min())
    most = highest / (MARGIN * (max(0.0, values.max()) - low))
    scale = max(step for step in STEPS if step <= most) if most >= STEPS[0] else most
    laid_out = found.layout | {"scale": int(scale) if scale >= 1 else scale}
    if low < 0:
        laid_out["offset"] = int(np.ceil(-low * scale))
    said = f"{ROUNDED} once they are multiplied by {scale:g}, and are counts of 0 to {highest:g} then"
    return found._replace(layout=laid_out, guesses=[*found.guesses, said])


def imported(folder: Path) -> dict:
    """Return log -> its block of a recording's origin.yaml; {} where there is none, InputError for another text."""
    path = folder / ORIGIN
    if not path.is_file():
        return {}
    value = params.parsed(path)
    logs = value.get("logs") if isinstance(value, dict) else None
    if not isinstance(logs, dict) or not all(isinstance(block, dict) for block in logs.values()):
        raise InputError(f"{path}: expected `logs:` with a block for each log; fix it, or remove it to guess anew")
    return logs


def gain(laid_out: Mapping) -> dict:
    """Return the scale and the offset of a layout."""
    return {"scale": laid_out.get("scale", 1), "offset": laid_out.get("offset", 0)}


def unlike_gains(folders: Sequence[Path]) -> dict[str, str]:
    """Return log -> what is to be said where recordings were imported with unlike scales or offsets; {} where none."""
    first: dict[str, tuple[Path, dict]] = {}
    said: dict[str, str] = {}
    for folder in folders:
        for name, block in imported(folder).items():
            place, usual = first.setdefault(name, (folder / ORIGIN, gain(block)))
            if gain(block) != usual:
                said[name] = (
                    f"{folder / ORIGIN}: {name} was imported with {on_a_line(gain(block))}, but in {place} with "
                    f"{on_a_line(usual)}: right only for files in two units; else write one scale and offset into "
                    "both, and import both again"
                )
    return said


def trial(proposal: Proposal) -> dict:
    """Return the layout of a proposal, with a rate in place of one that the log does not tell."""
    return proposal.layout | ({"rate_hz": 1.0} if proposal.layout.get("rate_hz", 0) is None else {})


def with_rate(path: Path, fmt: parse.Format, proposal: Proposal, read: Mapping[str, Log]) -> Proposal:
    """Return the proposal for a log without times with its rate, where logs beside it say how long it lasts."""
    others = (log for name, log in read.items() if name != path.name)  # its own times count its lines
    lasts = max((np.ptp(log.rows["time_s"].to_numpy()) for log in others), default=0)
    if not lasts:
        return proposal
    rows, _ = parse.read_log(path, fmt, layout=proposal.layout | {"rate_hz": 1.0})
    rate = float(f"{rows.num_rows / lasts:.2g}")
    guesses = [*proposal.guesses, "the rate, from how long the other logs last: write the device's own"]
    return proposal._replace(layout=proposal.layout | {"rate_hz": rate}, guesses=guesses)


class Ranges(NamedTuple):
    """What is to be said of the readings of a scanner's areas."""

    findings: list[str]
    problems: list[str]
    settings: list[str]  # lines that mend them
    falls: bool  # when pressed


def of_areas(scanner_logs: Mapping[Path, Mapping | None], settings: Mapping) -> Ranges:
    """Return what there is to say of readings outside of their area's range, that use little of it, or rest high in it.

    scanner_logs: path -> layout; settings: the block `glove`.
    """
    areas = images.areas(settings)
    read: dict[str, list[list[float]]] = {name: [] for name in areas}
    for path, laid_out in scanner_logs.items():
        try:
            rows, _ = parse.read_log(path, glove.any_readings(settings), layout=laid_out)
        except InputError:  # which the check of this log says
            continue
        for name, area in areas.items():
            columns = [column for column in rows.column_names if re.fullmatch(rf"{name[0]}\d+", column)]
            values = np.column_stack([rows[column].to_numpy() for column in columns])
            least, most = values.min(axis=1), values.max(axis=1)
            beyond = np.mean((least < area.lowest) | (most > area.highest))
            ends = (
                np.quantile(end, share, method=method)  # without single lines of noise
                for end, share, method in ((least, RARE, "lower"), (most, 1 - RARE, "higher"))
            )
            read[name].append([*ends, np.median(values), (values == np.rint(values)).all(), beyond])
    findings, problems, fitting, falls, counts = [], [], {}, False, True
    for name, area in areas.items():
        if not read[name]:
            continue
        key, span = f"glove.sensor.areas.{name}", area.highest - area.lowest
        lows, highs, rests, wholes, beyond = np.array(read[name], float).T
        low, high, rest, whole = lows.min(), highs.max(), np.median(rests), bool(wholes.all())
        lowest, highest = fitting_range(low, high, whole)
        if beyond.max() > settings["ingest"]["max_reject_fraction"]:
            counts &= low >= 0 and whole
            fitting[name] = {"highest": highest} | ({"lowest": lowest} if lowest else {})
            problems.append(
                f"readings of '{name}' are {low:g} to {high:g}, outside {area.lowest:g} to {area.highest:g}; set "
                f"{key}, as above"
            )
        elif rest > area.lowest + HIGH_REST * span:
            falls = True
            problems.append(
                f"readings of '{name}' are mostly near their highest ({rest:g} of {area.highest:g}), as with pull-ups; "
                "set rises_when_pressed: false in their format, or true where they do rise"
            )
        elif glove.scale(settings) == glove.PER_AREA and high - area.lowest < DIM * span:
            findings.append(
                f"readings of '{name}' reach {high:g} of {area.highest:g}, so images are dark: set {key}.highest to "
                f"{highest:g}"
            )
    lines = []
    if fitting and (given := settings["sensor"].get("areas")):
        described = {name: {**block, **fitting.get(name, {})} for name, block in given.items()}
        lines.append(f"glove.sensor.areas: {on_a_line(described)}")
        if not counts:
            lines.append("glove.sensor.scale: range")
    return Ranges(findings, problems, lines, falls)


def fitting_range(low: float, high: float, whole: bool) -> tuple[float, float]:
    """Return the range to set for readings from low to high: of a converter where they are whole, else two digits."""
    highest = next((most for most in BITS if whole and 0 <= low and high <= most), None)
    highest = highest or _outwards(MARGIN * high)
    return (0 if low >= 0 else -_outwards(-MARGIN * low)), highest


def _outwards(value: float) -> float:
    """Return the next number of two digits that is no less than a positive number."""
    digit = 10.0 ** (np.floor(np.log10(max(value, 1e-9))) - 1)
    rounded = float(f"{np.ceil(value / digit - 1e-9) * digit:.6g}")
    return int(rounded) if rounded.is_integer() else rounded


def format_block(experiment: str, found: Mapping[str, list[Proposal]], settings: Mapping) -> list[str]:
    """Return the lines of settings that read logs of another layout, with what is guessed; [] without such logs.

    found: log -> proposals, of which the one of the highest readings, that most recordings have, is taken.
    """
    if not found:
        return []
    best = {
        name: max(
            several,
            key=lambda one: (-np.max(one.layout.get("scale", 1)), sum(one.layout == other.layout for other in several)),
        )
        for name, several in found.items()
    }
    layouts = {**settings["ingest"].get("format", {}), **{name: proposal.layout for name, proposal in best.items()}}
    lines = [f"{experiment}.ingest.format:"]
    for name, described in layouts.items():
        guesses, said = (best[name].guesses, best[name].said) if name in best else ([], ())
        lines += [f"  # {name}: {sentence}" for sentence in said]
        lines += [f"  # {name}: guessed is {guess}" for guess in dict.fromkeys(guesses)]
        if described.get("rate_hz", 0) is None:
            lines.append(f"  # {name}: has no times; write how many frames a second the device prints")
        lines.append(f"  {name}: {on_a_line(described)}")
    timeless = [name for name in best if "rate_hz" in best[name].layout]
    if timeless and settings["ingest"].get("clock") == "shared":
        lines.append(f"{experiment}.ingest.clock: own  # in place of shared, since {timeless[0]} has no times")
    return lines


def on_a_line(block: Mapping) -> str:
    """Return a block of settings as YAML, on one line."""
    writer, text = YAML(typ="safe"), io.StringIO()
    writer.default_flow_style, writer.width, writer.sort_base_mapping_type_on_output = True, 1 << 20, False
    writer.dump(dict(block), text)
    return text.getvalue().strip()
