"""Read touch recordings (LoMP paper): the formats of the devices' logs, and a recording as frames with ground truth."""

import os
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pyarrow as pa
from scipy.ndimage import median_filter

from tactile.base.errors import InputError
from tactile.base.facts import Facts, Finding, Panel, Paper, Twin
from tactile.datasets import labels as labels_kpa
from tactile.datasets import schemas, specimens, windowing
from tactile.datasets.seeding import generator
from tactile.logs import alignment, elements, layout, parse
from tactile.logs.formats import Column, Format
from tactile.logs.report import log_report

KIND = "windows"
SCORES = "touch"
STRESSED = ("single", "double")
FACTS = Facts(
    label="Touch",
    unit="counts",
    output_unit="kPa",
    metric="rmse",
    compared=("random_window", "press"),
    score="main/double.rmse",
    first_tested=("press", "double"),
    drawn=("press",),
    seeds="arrays",
    sheet="array",
    tested={
        ("press", "single"): "one touch",
        ("press", "double"): "two touches",
        ("press", "single_anew"): "one touch, at new places",
        ("press", "several"): "several touches at once",
    },
    log="array.log",
    truth=("load_cell.log", "cnc.log"),
    layout=(
        *("sensor.order", "ingest.max_reject_fraction", "ingest.clock", "ingest.max_clock_offset_s"),
        *("ingest.min_correlation", "ingest.max_touches"),
    ),
    sensor=("sensor.rows", "sensor.cols", "ingest.highest_count"),
    panels=(
        Panel("Force (N)", r"load_cell.*", r"fz_n"),
        Panel(
            "Array, sum above\nrest (counts)",
            r"array",
            r"v\d+",
            lambda cells: sum(map(alignment.strength_above_rest, cells.T)),
        ),
        Panel("Place (mm)", r"cnc.*", r"[xy]_mm"),
    ),
    quick=("constant", "window_ridge", "window_trees", "rbf", "lomp"),
    paper=Paper(
        *("lomp", "rmse", "RMSE", 1),
        conditions={"single": "One touch", "double": "Two touches"},
        splits={"random_window": "random windows, the paper's split", "press": "split by press"},
    ),
    twin=Twin("velostat_recorded", "Touch: the recorded Velostat taxel and the array's element"),
    purpose={"line_faults": "ingest is there for torn, doubled, missing and swapped lines and resets"},
    shown={
        "places": "place_spread",
        "creep": "gain_from_past",
        "slow_creep": "creep_long",
        "hysteresis": "loading_loop",
        "release": "overshoot",
        "noise": "noise",
    },
)

# Ranges are what no such device can exceed: time since its start or since 1970, below 0 where micros() is printed
# with a sign, a 1 kN load cell, a 2 m CNC.
CLOCK = Column("t_us", "us", -(2.0**31), 4e15, integer=True)
LOAD_CELL = Format((CLOCK, Column("fz_n", "N", -1e3, 1e3)), time="t_us")
CNC = Format((CLOCK, *(Column(name, "mm", -2e3, 2e3) for name in ("x_mm", "y_mm", "z_mm"))), time="t_us")

NO_GROUND_TRUTH = "no ground truth at this time"
TOO_SHORT = "segment too short to align"
SPIKE = "spike"  # of a load cell: a single reading far from both of its neighbours
PULLED = "pressing makes fz_n negative; write it positive"
RESISTANCE = "highest_resistance"  # the setting that says that readings fall when pressed, and are no counts
PART = 1 << 18  # frames made at once: an hour of a recording at 70 Hz
# A spike is further from both neighbours than 4 times the steps of the log, of which 99.5 % are smaller. Spikes of
# 100 N among presses of 30 N are 5 times as far and more, even at 10 Hz and with 5 % of spikes. Clean logs, simulated
# and recorded, stay below 2.4 times, but for two recordings of presses of 1 N with jumps of up to 2 N: what is below
# 3 N is noise.
LEAP, LEAST_LEAP_N = 4.0, 3.0
CALM = 0.25  # of the leap: so near are neighbours to each other, and readings before or after; fast presses move them
# A slower log may have but one reading of a press. A spike is beyond twice the forces that stay, if these are presses.
SLOWEST_PRESS_HZ, LEAST_PRESS_N = 40.0, 1.0
PRESSED = 0.1  # of a strong press: force above it is a press, to measure clocks by
FEWEST_PRESSES = 5  # to measure clocks by: fewer agree by chance
SHIFTED = 0.1  # of a press; a larger offset of logs said to be of one clock is named
OUTSIDE = 0.02  # share of contacts that may lie beside the array
MOST_KPA = 5000  # ten times the pressure on soft sensors
SMALL = 0.12  # share of the array's sides; contacts that stay within are given in centimetres, or in one place
TARED = 0.03  # of the highest force, the most that a load cell shows at rest; recorded ones have 0.017, simulated 0.009
SAME_CLOCK = 0.5  # share of a log's times that occur in another log: by chance about one in 10,000 does


class Falls(InputError):
    """The array's counts fall when it is pressed."""


def shows_loading(path: Path, settings: Mapping) -> bool:
    """Tell whether a recording has one load cell, so that the data sheet can be made of it."""
    return not (path / "load_cell_2.log").exists()


def array_format(settings: Mapping) -> Format:
    """Return the format of the array's lines: time, then readings row by row from the bottom; settings: block `touch`.

    Readings are counts, or resistances with decimals where `ingest.highest_resistance` is there.
    """
    sensor, ingest = settings["sensor"], settings["ingest"]
    whole = RESISTANCE not in ingest
    kind = ("counts", 0, ingest["highest_count"]) if whole else ("1", 0, ingest[RESISTANCE])
    readings = (Column(f"v{k}", *kind, integer=whole) for k in range(sensor["rows"] * sensor["cols"]))
    return Format((CLOCK, *readings), time="t_us")


def formats(settings: Mapping, folder: Path | None = None) -> dict[str, Format]:
    """Return log -> format of its lines; folder: of a recording, whose further load cells and CNCs have logs, too."""
    found = {"array.log": array_format(settings)}
    for device, fmt in (("load_cell", LOAD_CELL), ("cnc", CNC)):
        further = sorted(path.name for path in folder.glob(f"{device}_*.log")) if folder else []
        found |= dict.fromkeys([f"{device}.log", *further], fmt)
    if settings["sensor"]["rows"] * settings["sensor"]["cols"] == 1 and not (folder and (folder / "cnc.log").is_file()):
        del found["cnc.log"]  # one element cannot tell a place
    return found


def in_order(counts: np.ndarray, settings: Mapping) -> np.ndarray:
    """Return counts (..., elements) as printed in the order of the elements, row by row from the bottom.

    settings: the block `touch` of params.yaml, whose `sensor.order` names the printed column of each element. Raises
    InputError where it does not name each of them once.
    """
    order, elements = settings["sensor"].get("order", []), counts.shape[-1]
    if not order:
        return counts
    if sorted(order) != list(range(elements)):
        raise InputError(
            f"params/touch.yaml, touch.sensor.order: names {len(order)} columns; it has to name each of 0 to "
            f"{elements - 1} once, in the order of the elements, or none ([])"
        )
    return counts[..., order]


def frames_schema(settings: Mapping) -> pa.Schema:
    """Return the schema of the frames table; `settings` is the block `touch` of params.yaml."""
    sensor, ingest = settings["sensor"], settings["ingest"]
    counts = pa.int16() if ingest.get("highest_count", 0) < 2**15 else pa.int32()
    kind = pa.float32() if RESISTANCE in ingest else counts
    return schemas.frames(sensor["rows"] * sensor["cols"], ingest["max_touches"], kind)


def recordings(folder: Path) -> list[Path]:
    """Return the folders `<condition>/<recording>` in `folder`, sorted.

    Raises InputError where there is none, or for a name that is no line of text.
    """
    folders = parse.folders(folder, "*/*")
    if not folders:
        raise InputError(f"{folder}: no recordings found; expected <condition>/<recording>/array.log in it")
    parse.check_names(folders)
    return folders


def read_recording(folder: Path, settings: Mapping) -> tuple[pa.Table, pa.Table, dict]:
    """Read a recording as `read_in_parts` does, with all frames as one table."""
    parts, rejects, report = read_in_parts(folder, settings)
    return pa.concat_tables(parts), rejects, report


def read_in_parts(folder: Path, settings: Mapping) -> tuple[Iterator[pa.Table], pa.Table, dict]:
    """Read the logs of one folder as frames on the first load cell's clock: `(parts, rejects, report)`.

    `settings`: the block `touch` of params.yaml. `parts` are tables of the schema `frames_schema`, each made when it is
    asked for: all frames of a log take more memory than the log. `rejects` has the columns of `parse.REJECTS`, `report`
    the numbers of each file. Lines of a file = accepted + rejected (+ header).

    Raises InputError for a missing or unknown log, more than `max_touches` touches, too many rejects, counts or depths
    with the wrong sign, clocks that cannot be aligned, and clocks that are said to be shared and are not.
    """
    elements = settings["sensor"]["rows"] * settings["sensor"]["cols"]
    touches = _touches(folder, settings["ingest"]["max_touches"], placeless=elements == 1)
    logs = [f"{device}{suffix}.log" for suffix in touches for device in ("load_cell", "cnc")]
    there = {name: folder / name for name in ("array.log", *logs) if elements > 1 or (folder / name).is_file()}
    return read_logs(there, (folder.parent.name, folder.name), settings)


def read_logs(
    logs: Mapping[str, Path], names: tuple[str, str], settings: Mapping, block: str = "touch"
) -> tuple[Iterator[pa.Table], pa.Table, dict]:
    """Read the logs of one recording as `read_in_parts` does, from any place.

    logs: `array.log`, `load_cell.log` and so on -> where it lies; names: the condition and the recording; block: the
    name of the block of settings, for sentences.
    """
    ingest, limit = settings["ingest"], f"{block}.ingest.max_reject_fraction"
    elements = settings["sensor"]["rows"] * settings["sensor"]["cols"]
    touches = [name.removeprefix("load_cell").removesuffix(".log") for name in logs if name.startswith("load_cell")]
    kinds = {"array": array_format(settings), "load_cell": LOAD_CELL, "cnc": CNC}
    formats = {name: next(fmt for kind, fmt in kinds.items() if name.startswith(kind)) for name in logs}
    rows, rejects = {}, {}
    for name, fmt in formats.items():
        rows[name], rejects[name] = parse.read_log(
            logs[name], fmt, limit=ingest["max_reject_fraction"], key=limit, layout=layout.of(ingest, name)
        )
        if fmt is LOAD_CELL:
            lines = rows[name].num_rows + rejects[name].num_rows
            rows[name], rejects[name] = without_spikes(logs[name], rows[name], rejects[name])
            reasons = Counter(rejects[name]["reason"].to_pylist())
            parse.check_rejects(logs[name], lines, reasons, ingest["max_reject_fraction"], limit)

    _check_signs(logs, rows, ingest)
    who = "/".join(names)
    clocks = _clocks(rows, touches, ingest, who, block)
    measured = _measured(rows, touches, ingest, who, block) if ingest.get("clock") == "shared" else {}
    time = {}
    for name in formats:
        placed = np.array([clock is not None for clock in clocks[name]])[rows[name]["segment"].to_numpy()]
        if not placed.all():
            unplaced = rows[name]["line"].to_numpy()[~placed]
            rejects[name] = parse.add_rejects(rejects[name], logs[name], unplaced, TOO_SHORT)
            rows[name] = rows[name].filter(pa.array(placed))
        time[name] = _reference_time(rows[name], clocks[name])

    array, at = rows["array.log"], time["array.log"]
    pitch_mm = settings["sensor"].get("pitch_mm", np.nan)
    middle = np.array([settings["sensor"][side] * pitch_mm / 2 for side in ("cols", "rows")])
    truth, known = _ground_truth(rows, time, touches, middle)
    if not known.any() and ingest.get("clock") == "shared":
        spans = ", ".join(f"{name} {time_s[0]:.10g} to {time_s[-1]:.10g} s" for name, time_s in time.items())
        raise alignment.NotOneClock(
            f"{logs['array.log']}: the logs have no time in common ({spans}), so they do not share a clock; set "
            f"{block}.ingest.clock: own"
        )
    if not known.any():
        raise InputError(f"{logs['array.log']}: no frame falls into the time of load cell and CNC; record again")
    # The devices start and stop up to max_clock_offset_s apart, so frames without truth are expected there.
    inner = (at > at[0] + ingest["max_clock_offset_s"]) & (at < at[-1] - ingest["max_clock_offset_s"])
    missed = {NO_GROUND_TRUTH: int((inner & ~known).sum())}
    parse.check_rejects(logs["array.log"], len(at), missed, ingest["max_reject_fraction"], limit)
    unknown = array["line"].to_numpy()[~known]
    rejects["array.log"] = parse.add_rejects(rejects["array.log"], logs["array.log"], unknown, NO_GROUND_TRUTH)

    segment = array["segment"].to_numpy()
    gap_before = np.empty(len(at), dtype=bool)
    gap_before[known] = schemas.gaps_before(at[known], segment[known])

    def parts() -> Iterator[pa.Table]:
        for first in range(0, len(at), PART):
            block = slice(first, first + PART)
            kept = known[block]
            if kept.any():
                counts = in_order(_matrix(array.slice(first, PART), [f"v{k}" for k in range(elements)]), settings)
                yield schemas.frame_rows(
                    frames_schema(settings),
                    *names,
                    segment=segment[block][kept],
                    t_s=at[block][kept],
                    v=counts[kept],
                    **{name: values[block][kept] for name, values in truth.items()},
                    gap_before=gap_before[block][kept],
                )

    report = {}
    for name in formats:
        accepted = int(known.sum()) if name == "array.log" else rows[name].num_rows
        report[name] = log_report(accepted, rejects[name], time[name], rows[name]["segment"].to_numpy())
        report[name]["clocks"] = [clock and clock.report() for clock in clocks[name]]
        report[name] |= measured.get(name, {})
    file = parse.REJECTS.field("file")
    named = [table.set_column(0, file, pa.repeat(name, table.num_rows)) for name, table in rejects.items()]
    return parts(), pa.concat_tables(named), report


def _ground_truth(
    rows: Mapping[str, pa.Table], time: Mapping[str, np.ndarray], touches: list[str], middle_mm: np.ndarray
) -> tuple[dict[str, np.ndarray], np.ndarray]:
    """Return force_n, x_mm and y_mm at the array's frames, (frames, touches), and where all are known, (frames,) bool.

    time: log -> reference time of its rows in s; middle_mm: (x, y) of touches that have no cnc log.
    """
    at = time["array.log"]
    truth = {name: np.empty((len(at), len(touches)), np.float32) for name in ("force_n", "x_mm", "y_mm")}
    known = np.ones(len(at), dtype=bool)
    for k, suffix in enumerate(touches):
        cell, cnc = f"load_cell{suffix}.log", f"cnc{suffix}.log"
        force = rows[cell]["fz_n"].to_numpy()
        if cnc in rows:
            placed_s, place = time[cnc], _matrix(rows[cnc], ["x_mm", "y_mm"])
        else:
            placed_s, place = time[cell], np.tile(middle_mm, (len(force), 1))
        cell_s, cnc_s = (alignment.longest_interval_s(time_s) for time_s in (time[cell], placed_s))
        for first in range(0, len(at), 4 * PART):
            block = slice(first, first + 4 * PART)
            truth["force_n"][block, k], in_cell = alignment.interpolated(at[block], time[cell], force, longest_s=cell_s)
            # Further touches are held by hand: their cnc log tells the operator each place until the next one.
            there, in_cnc = alignment.interpolated(at[block], placed_s, place, held=k > 0, longest_s=cnc_s)
            truth["x_mm"][block, k], truth["y_mm"][block, k] = there.T
            known[block] &= in_cell & in_cnc
    return truth, known


def _touches(folder: Path, most: int, placeless: bool) -> list[str]:
    """Return the suffixes of the touches' logs ('', '_2', '_3', ...).

    placeless: the sensor is one element, which cannot tell a place, so that a touch needs no cnc log. Raises InputError
    for a touch without its logs, for a log of another name, and for more than `most` touches.
    """
    present = {path.name for path in folder.glob("*.log")}
    count = max(1, sum(name.startswith("load_cell") for name in present))
    suffixes = ["", *(f"_{k}" for k in range(2, count + 1))]
    wanted = {
        "array.log",
        *(f"{device}{suffix}.log" for suffix in suffixes for device in ("load_cell", "cnc")),
    }
    optional = {name for name in wanted if placeless and name.startswith("cnc")}
    if missing := sorted(wanted - optional - present):
        raise InputError(
            f"{folder / missing[0]}: log not found; a recording needs array.log, load_cell.log and cnc.log, "
            "and load_cell_2.log with cnc_2.log (and so on) for each further touch"
        )
    if strange := sorted(present - wanted):
        raise InputError(f"{folder / strange[0]}: no such log is known; name it like load_cell_2.log or remove it")
    if count > most:
        raise InputError(f"{folder}: {count} touches are more than touch.ingest.max_touches ({most}); raise it")
    return suffixes


def _clocks(
    rows: Mapping[str, pa.Table], touches: list[str], ingest: Mapping, who: str, block: str
) -> dict[str, list[alignment.Clock | None]]:
    """Return a clock per segment of each log; the first load cell's clock is the reference.

    `ingest.clock: shared` of the block says that there is but one clock.

    The array answers to the sum of all touches. Load cells printed by one computer share its clock, which
    shows in equal times; they are summed from the start. The others are separate: `_force_clocks` places them.
    """
    if ingest.get("clock") == "shared":
        for name, table in rows.items():
            if table["segment"][-1].as_py() > 0:
                raise InputError(
                    f"{who}/{name}: its time steps back, which a clock that all logs share does not; set "
                    f"{block}.ingest.clock: own"
                )
        return {name: [alignment.Clock(0.0)] for name in rows}
    limits = {"max_offset_s": ingest["max_clock_offset_s"], "min_correlation": ingest["min_correlation"]}
    first, *further = (f"load_cell{suffix}.log" for suffix in touches)
    forces = {name: _signals(rows[name], alignment.strength_above_rest, ["fz_n"]) for name in (first, *further)}
    array = _readings(rows["array.log"], alignment.strength_above_rest, ingest)
    ticks = rows[first]["t_us"].to_numpy()
    shared = [
        name
        for name in further
        if np.isin(rows[name]["t_us"].to_numpy(), ticks).mean() > SAME_CLOCK and len(forces[name]) == len(forces[first])
    ]
    together = [_plus(piece, [forces[name][k] for name in shared]) for k, piece in enumerate(forces[first])]
    separate = {name: forces[name] for name in further if name not in shared}
    reference, placed, clocks = _force_clocks(together, array, separate, limits, who)
    clocks |= dict.fromkeys((first, *shared), reference)
    clocks["array.log"] = placed

    if "cnc.log" in rows:
        depth = _signals(rows["cnc.log"], alignment.depth_strength, ["z_mm"])
        force = alignment.joined(forces[first], reference)
        clocks["cnc.log"] = alignment.place_all(depth, force, who=f"{who}, cnc.log against load_cell.log", **limits)
    for cell, suffix in zip(further, touches[1:], strict=True):
        cnc = f"cnc{suffix}.log"
        if cnc not in rows:
            continue
        if rows[cnc]["segment"][-1].as_py() + 1 != len(clocks[cell]):
            raise InputError(f"{who}: {cnc} and {cell} share a clock, but only one of them was reset; record again")
        clocks[cnc] = clocks[cell]
    return clocks


def without_spikes(path: Path, rows: pa.Table, rejects: pa.Table) -> tuple[pa.Table, pa.Table]:
    """Return the rows and rejects of a load cell's log, its spikes moved from the one to the other."""
    wrong = spikes(_seconds(rows), rows["fz_n"].to_numpy())
    if not wrong.any():
        return rows, rejects
    rejects = parse.add_rejects(rejects, path, rows["line"].to_numpy()[wrong], SPIKE)
    return rows.filter(pa.array(~wrong)), rejects


def spikes(time_s: np.ndarray, force: np.ndarray) -> np.ndarray:
    """Find single readings that no press explains, as HX711 boards print them: (n,) bool, for times and forces (n,).

    Such a reading is above, or below, both of its neighbours by more than `LEAP` steps of the log and `LEAST_LEAP_N`,
    while its neighbours, and those on one side of it, stay where they were.
    """
    if len(force) < 5:
        return np.zeros(len(force), dtype=bool)
    usual, wide = median_filter(force, 5, mode="nearest"), np.pad(force, 2, mode="reflect")
    far, near, after, beyond = wide[:-4], wide[1:-3], wide[3:-1], wide[4:]
    leap = np.maximum(np.minimum(force - near, force - after), np.minimum(near - force, after - force))
    least = max(LEAP * np.quantile(np.abs(np.diff(usual)), 0.995), LEAST_LEAP_N)
    calm = np.maximum(np.abs(after - near), np.minimum(np.abs(near - far), np.abs(beyond - after)))
    found = (leap > least) & (calm < CALM * leap)
    if (len(force) - 1) / max(np.ptp(time_s), 1e-9) < SLOWEST_PRESS_HZ:
        low, high = usual.min(), usual.max()
        found &= (high - low > LEAST_PRESS_N) & ((force > 2 * high - low) | (force < 2 * low - high))
    return found


def _check_signs(logs: Mapping[str, Path], rows: Mapping[str, pa.Table], ingest: Mapping) -> None:
    """Raise InputError where counts fall, resistances or z rise, when the force does, or the force is reversed."""
    limits = {"one_clock": ingest.get("clock") == "shared", "min_correlation": ingest["min_correlation"]}
    force = _longest(_signals(rows["load_cell.log"], np.asarray, ["fz_n"]))
    falls = alignment.direction(_longest(_readings(rows["array.log"], np.asarray, ingest)), force, **limits) < 0
    depth = _longest(_signals(rows["cnc.log"], np.asarray, ["z_mm"])) if "cnc.log" in rows else None
    rises = depth is not None and alignment.direction(depth, force, **limits) > 0
    low, high = np.percentile(rows["load_cell.log"]["fz_n"].to_numpy(), [0.5, 99.5])
    if (falls or rises) and -low > high:
        raise InputError(f"{logs['load_cell.log']}: {PULLED}")
    if rises:
        raise InputError(
            f"{logs['cnc.log']}: z_mm seems to rise when pressed; write it negative when pressed, 0 at the surface"
        )
    if falls and RESISTANCE in ingest:
        raise InputError(f"{logs['array.log']}: the resistances seem to rise when pressed; they should fall")
    if falls:
        highest = ingest["highest_count"]
        raise Falls(
            f"{logs['array.log']}: the counts seem to fall when pressed; write {highest} minus the count, "
            "which rises, or set rises_when_pressed: false in its format"
        )


def _longest(pieces: list[alignment.Signal]) -> alignment.Signal:
    """Return the longest segment of a log."""
    return max(pieces, key=lambda piece: piece.duration_s)


def _readings(array: pa.Table, strength: Callable, ingest: Mapping) -> list[alignment.Signal]:
    """Return one signal per segment of the array's log, the sum of its elements, which rises when they are pressed."""
    columns = [name for name in array.column_names if name.startswith("v")]
    return _signals(array, (lambda values: strength(-values)) if RESISTANCE in ingest else strength, columns)


def _measured(
    rows: Mapping[str, pa.Table], touches: list[str], ingest: Mapping, who: str, block: str
) -> dict[str, dict]:
    """Return log -> what its report says of a clock that is said to be shared: `clocks` and `warnings`.

    The array is measured against the sum of all forces, the CNC against the first, and further load cells against the
    array. The first load cell is what others are measured against, and targets of further touches tell no depth: they
    have no numbers. Raises InputError for clocks that are not shared.
    """
    limits = {"reach_s": ingest["max_clock_offset_s"], "min_correlation": ingest["min_correlation"]}
    names = [f"load_cell{suffix}.log" for suffix in touches]
    forces = {name: _signals(rows[name], alignment.strength_above_rest, ["fz_n"])[0] for name in names}
    first = forces[names[0]]
    total = _plus(first, [forces[name] for name in names[1:]])
    array = _readings(rows["array.log"], alignment.strength_above_rest, ingest)[0]
    pairs = {"array.log": (array, total, None)}
    if "cnc.log" in rows:
        pairs["cnc.log"] = (_signals(rows["cnc.log"], alignment.depth_strength, ["z_mm"])[0], first, None)
    for name in names[1:]:
        pairs[name] = (forces[name], array, _plus(first, [forces[other] for other in names[1:] if other != name]))
    reports = {name: {"clocks": [{"offset_ms": 0.0, "drift_ppm": 0.0}]} for name in rows}
    strangers = []  # said last: where one log is shifted, others seem to follow nothing
    for name, (piece, against, beside) in pairs.items():
        lasts, other = _presses_s(forces.get(name, first)), "array.log" if name in names else names[0]
        found = alignment.agreement(piece, against, beside=beside, **limits) if len(lasts) >= FEWEST_PRESSES else None
        reports[name]["clocks"][0] |= found.report() if found else alignment.UNMEASURED
        if found and not found.best >= ingest["min_correlation"]:
            strangers.append(
                f"{who}, {name} against {other}: the signals do not follow each other (best correlation "
                f"{max(found.best, 0.0):.2f}, {block}.ingest.min_correlation {ingest['min_correlation']:g}); check "
                "that the logs belong to one capture"
            )
        elif found and abs(found.offset_s) > SHIFTED * np.median(lasts):
            said = found.said(name, other)
            if found.refuted:
                raise InputError(
                    f"{who}: {said}, so they do not share a clock; set {block}.ingest.clock: own, or add "
                    f"{found.offset_s:+.2f} s to the times of {name}"
                )
            reports[name]["warnings"] = [f"{said}; a press lasts {np.median(lasts):.1f} s: look at what delays one"]
    if strangers:
        raise InputError(strangers[0])
    return reports


def _presses_s(force: alignment.Signal) -> np.ndarray:
    """Return how long each press of a force above rest lasts, (presses,) in s."""
    threshold = PRESSED * np.percentile(force.value, 99)
    pressed = force.value > threshold
    number, time_s = windowing.presses(force.value, force.time_s, threshold)[pressed], force.time_s[pressed]
    starts = np.flatnonzero(np.diff(number, prepend=-1))
    return time_s[np.append(starts[1:] - 1, len(number) - 1)] - time_s[starts] if len(number) else np.zeros(0)


def _force_clocks(
    together: list[alignment.Signal],
    array: list[alignment.Signal],
    separate: Mapping[str, list[alignment.Signal]],
    limits: Mapping,
    who: str,
) -> tuple[list[alignment.Clock | None], list[alignment.Clock | None], dict[str, list[alignment.Clock | None]]]:
    """Return the clocks of the reference, of the array, and of each separate load cell, one per segment.

    together: the sum of the forces on the reference clock. A separate load cell is placed against the array once that
    is placed roughly; then reference and array are placed again with all forces known. Two such sweeps: while forces
    are missing from the sum, it explains only a part of the array's response, so the first asks for less correlation.
    """
    if not separate:
        return *alignment.place_pair(together, array, who=f"{who}, array.log against load_cell.log", **limits), {}
    partly = {**limits, "min_correlation": limits["min_correlation"] / 2}
    reference, placed = alignment.place_pair(together, array, who=f"{who}, array.log against load_cell.log", **partly)
    clocks = {}
    for sweep in (partly, limits):
        for name, pieces in separate.items():
            others = [alignment.joined(separate[other], clocks[other]) for other in clocks if other != name]
            beside = _plus(alignment.joined(together, reference), others)
            against = alignment.joined(array, placed)
            clocks[name] = alignment.place_all(
                pieces, against, beside=beside, who=f"{who}, {name} against array.log", **sweep
            )
        others = [alignment.joined(pieces, clocks[name]) for name, pieces in separate.items()]
        everything = [
            _plus(piece, others, clock) if clock else piece for piece, clock in zip(together, reference, strict=True)
        ]
        reference, placed = alignment.place_pair(
            everything, array, who=f"{who}, array.log against all load cells", **sweep
        )
    return reference, placed, clocks


def _signals(rows: pa.Table, strength: Callable, columns: list[str]) -> list[alignment.Signal]:
    """Return one signal per segment of a log: the sum of the strengths of these columns."""
    segment, time = rows["segment"].to_numpy(), _seconds(rows)
    edges = np.flatnonzero(np.diff(segment)) + 1
    averages = [alignment.averager(piece, alignment.STEP_S) for piece in np.split(time, edges)]
    times = [average(piece) for average, piece in zip(averages, np.split(time, edges), strict=True)]
    sums = [np.zeros(len(piece)) for piece in times]

    def strengths(name: str) -> list[np.ndarray]:
        pieces = np.split(rows[name].to_numpy(), edges)
        return [strength(average(piece)) for average, piece in zip(averages, pieces, strict=True)]

    with ThreadPoolExecutor(threads := os.cpu_count() or 1) as pool:
        for first in range(0, len(columns), threads):  # so few, because a column of a long log takes 100 MB
            for column in pool.map(strengths, columns[first : first + threads]):
                for total, values in zip(sums, column, strict=True):
                    total += values
    return [alignment.Signal(*pair) for pair in zip(times, sums, strict=True)]


def _plus(
    piece: alignment.Signal, others: list[alignment.Signal], clock: alignment.Clock | None = None
) -> alignment.Signal:
    """Add other signals to a signal, all on the same clock (the others in reference time, if a clock is given)."""
    at = clock(piece.time_s) if clock else piece.time_s
    total = sum((np.interp(at, other.time_s, other.value) for other in others), piece.value)
    return alignment.Signal(piece.time_s, total)


def _seconds(rows: pa.Table) -> np.ndarray:
    """Return the device's time in s, (n,)."""
    return rows["t_us"].to_numpy() / 1e6


def _reference_time(rows: pa.Table, clocks: list[alignment.Clock | None]) -> np.ndarray:
    """Return the reference time in s, (n,), of rows whose segments all have a clock."""
    segment, time = rows["segment"].to_numpy(), _seconds(rows)
    for number in np.unique(segment):
        time[segment == number] = clocks[number](time[segment == number])
    return time


def _matrix(rows: pa.Table, columns: list[str]) -> np.ndarray:
    """Return columns of one type as (n, columns)."""
    return np.column_stack([rows[name].to_numpy() for name in columns])


def _tared(path: Path, at_rest: float, settings: Mapping) -> str:
    """Return what to write into the settings of a load cell that rests at a force, in N, by those settings."""
    offset = settings["ingest"].get("format", {}).get(path.name, {}).get("offset", 0.0) - at_rest
    return f"write `offset: {offset:.4g}` for {path.name} into touch.ingest.format of settings.yaml"


def log_problems(path: Path, rows: pa.Table, settings: Mapping) -> Iterator[str]:
    """Yield problems of a log that can be read: wrong units and signs of force and depth."""
    if "fz_n" in rows.column_names:
        force = rows["fz_n"].to_numpy()
        low, at_rest, high = np.percentile(force, [0.5, 10, 99.5])
        threshold = settings["window"]["contact_threshold_n"]
        tared = max(TARED * max(high - at_rest, threshold), 2 * (at_rest - low))  # beyond the noise, too
        if -low > high:
            yield f"{path}: {PULLED}"
        elif at_rest <= threshold and abs(at_rest) > min(threshold, tared):
            yield (
                f"{path}: fz_n rests at {at_rest:.2g} N, not at 0, so that every force is {abs(at_rest):.2g} N too "
                f"{'high' if at_rest > 0 else 'low'}; {_tared(path, at_rest, settings)}"
            )
        elif at_rest > threshold:
            yield (
                f"{path}: fz_n rests at {at_rest:.2g} N, above touch.window.contact_threshold_n ({threshold:g} N), so "
                f"that presses never end; {_tared(path, at_rest, settings)}"
            )
    if path.name == "cnc.log" and not (rows["z_mm"].to_numpy() < 0).any():
        yield f"{path}: z_mm is never below 0; z is 0 at the sensor's surface and negative when pressed"


def findings(frames: pa.Table, windows: pa.Table, settings: Mapping) -> Iterator[Finding]:
    """Yield what all recordings show: presses, forces and places, and whether elements answer where pressed."""
    names = schemas.names(windows["condition"])
    for condition in np.unique(names):
        inside = names == condition
        presses = len(np.unique(windows["press"].to_numpy()[inside]))
        yield Finding(f"{condition}: {presses} presses, {inside.sum()} windows")
    if absent := [name for name in settings["split"].get("train_on", ["single"]) if name not in names]:
        yield Finding(
            f"no folder '{absent[0]}': models learn from the conditions of touch.split.train_on; all others are "
            "test data",
            wrong=True,
        )
    force, x, y = (schemas.matrix(frames[name]) for name in ("force_n", "x_mm", "y_mm"))
    contact = np.nansum(force, axis=1) > settings["window"]["contact_threshold_n"]
    if not contact.any():
        threshold = settings["window"]["contact_threshold_n"]
        yield Finding(
            f"no force above {threshold:g} N (the highest is {np.nanmax(force):.2g} N): write fz_n in newtons, "
            "or lower touch.window.contact_threshold_n",
            wrong=True,
        )
        return
    sensor = settings["sensor"]
    size = sensor["cols"] * sensor["pitch_mm"], sensor["rows"] * sensor["pitch_mm"]
    highest = float(np.nanmax(force))
    kpa = float(np.nanmax(labels_kpa.pressure_kpa(force, labels_kpa.tip_radius_mm(frames, settings["label"]))))
    if kpa > MOST_KPA:
        yield Finding(
            f"force up to {highest:.0f} N, {kpa:.0f} kPa under the tip (touch.label.tip_radius_mm "
            f"{settings['label']['tip_radius_mm']:g}): write fz_n in newtons (grams times 0.00981), or fix the radius",
            wrong=True,
        )
    yield Finding(
        f"force up to {highest:.1f} N ({kpa:.0f} kPa), "
        f"x {np.nanmin(x[contact]):.1f} to {np.nanmax(x[contact]):.1f} mm, "
        f"y {np.nanmin(y[contact]):.1f} to {np.nanmax(y[contact]):.1f} mm; the array is {size[0]:g} x {size[1]:g} mm"
    )
    touching = force > settings["window"]["contact_threshold_n"]
    within = np.ptp(x[touching]), np.ptp(y[touching])
    if sensor["rows"] * sensor["cols"] > 1 and within[0] < SMALL * size[0] and within[1] < SMALL * size[1]:
        yield Finding(
            f"all contacts are within {within[0]:.2g} x {within[1]:.2g} mm of an array of {size[0]:g} x {size[1]:g}: "
            "write x_mm and y_mm in millimetres, or press in other places too",
            wrong=True,
        )
        return
    outside = touching & ((x < 0) | (x > size[0]) | (y < 0) | (y > size[1]))
    exchanged = touching & ((y < 0) | (y > size[0]) | (x < 0) | (x > size[1]))
    if outside.sum() > OUTSIDE * touching.sum() and exchanged.sum() <= OUTSIDE * touching.sum():
        yield Finding(
            f"{100 * outside.sum() / touching.sum():.0f} % of the contacts are beside the array, and none would be if "
            "x_mm and y_mm changed places: write x, to the right, before y, to the top",
            wrong=True,
        )
    elif outside.sum() > OUTSIDE * touching.sum():
        yield Finding(
            f"{100 * outside.sum() / touching.sum():.0f} % of the contacts are beside the array; x_mm and y_mm are 0 "
            "at its bottom left corner and rise to the right and to the top: shift them, or fix touch.sensor.pitch_mm",
            wrong=True,
        )
    else:
        said, wrong = elements.order_of_elements(frames, force, x, y, settings)
        yield from (Finding(text) for text in said)
        yield from (Finding(text, wrong=True) for text in wrong)
    yield from (Finding(text) for text in elements.moved_rest(frames, contact))


def map_size_problems(settings: Mapping) -> Iterator[str]:
    """Yield problems: sizes of maps that do not fit this array, each with the key to change."""
    try:
        labels_kpa.check_cells(settings["sensor"], settings["label"])
    except InputError as error:
        yield str(error)
    for side in ("rows", "cols") if "lomp" in settings["models"] else ():
        cells, count = settings["label"][f"map_{side}"], settings["sensor"][side]
        if cells % count:
            yield (
                f"params/touch.yaml, touch.label.map_{side}: {cells} is no multiple of touch.sensor.{side} ("
                f"{count}), which lomp needs; set {max(1, round(cells / count)) * count}"
            )


def labels(windows: pa.Table, settings: Mapping) -> np.ndarray:
    """Return pressure maps (eq. 1) at each window's last frame, (n, map_rows * map_cols) in kPa, float32.

    Errors as labels.check_cells.
    """
    labels_kpa.check_cells(settings["sensor"], settings["label"])
    x, y = schemas.matrix(windows["x_mm"]), schemas.matrix(windows["y_mm"])
    peak = labels_kpa.peaks_kpa(windows, settings)
    radius = labels_kpa.tip_radius_mm(windows, settings["label"])
    maps = labels_kpa.pressure_maps(peak, x, y, settings["sensor"], settings["label"], radius)
    return maps.reshape(len(maps), -1)


def split(windows: pa.Table, settings: Mapping, protocol: str, seed: int) -> np.ndarray:
    """Return the part of each window in one run, (n,) of 'train', 'validation', 'test', 'unused'.

    Only single touches, or the conditions that `touch.split.train_on` names, are divided, 8:1:1, anew for every seed.
    `press` divides presses, whose windows are those
    `touch.window.stride` apart. `random_window` divides windows that slide frame by frame and overlap, as the paper
    did, so that test windows hold frames that were trained on. All other conditions are test data: models never see
    more than one touch (section IV-A); of these, both protocols test the windows that are apart. Windows of other
    arrays than the seed's are unused.
    Differs from paper: the eight frames of a window are `touch.window.frame_step` apart, 5 frames or 0.1 s, so that a
    window spans 0.7 s; the paper's are consecutive, at a rate that it does not give.

    Differs from paper: every seed has another array, other presses and another split, so that an interval over seeds
    covers all of these; the paper has one of each and no interval.

    Differs from paper: `random_window` takes a share of the sliding windows (`touch.window.sliding`; 1 is the paper's),
    in stretches of windows that all overlap, so that training takes minutes and a test window still has neighbours in
    the training part. The conditions of test data, and `press`, take the windows `touch.window.stride` frames apart.
    """
    single = np.isin(schemas.names(windows["condition"]), settings["split"].get("train_on", ["single"]))
    here = specimens.of_seed(schemas.names(windows["recording"]), seed)
    by_press, apart = protocol == "press", here & windows["apart"].to_numpy()
    divided = single & (apart if by_press else here & windows["sliding"].to_numpy())
    unit = windows["press"].to_numpy() if by_press else np.arange(windows.num_rows)
    units = np.unique(unit[divided])
    shares = settings["split"]
    order = generator(shares["seed"], "split", protocol, seed).permutation(units)
    edges = np.round(np.cumsum([shares["train"], shares["validation"]]) * len(units)).astype(int)
    part = np.where(divided | (apart & ~single), "test", "unused").astype(object)
    for name, chosen in zip(("train", "validation"), np.split(order, edges)[:2], strict=True):
        part[divided & np.isin(unit, chosen)] = name
    return part
