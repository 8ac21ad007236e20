"""Describe the scene's array under one and two tips, and the recorded capacitive array under fingers; see __init__.

The two share no physics, no unit and no pitch: 41 x 72 capacitive elements at 4.8 mm under glass, 5 x 5 resistive ones
at 12 mm. Their contacts are of about one size (a finger's mask of 89 mm2 in the median, a tip of 79 mm2 at its full
load), so that distances are in millimetres and readings over those under a contact. The recorded array's controller
subtracts its rest, so that how rests differ between elements is not compared. A frame of the scene is one press, less
what the elements read before the first press of the recording: the middle of the time for which all tips press with
HELD of their peaks. Its places are those that the CNC and the operator aimed at; the response to the tip held by hand
is not compared, as that tip has another radius and lands beside the place.

What a contact would read alone is a polynomial of second degree of the log of its size, fitted to single contacts:
recorded, to those of the session by area, as no finger touches a place twice; simulated, to those at the same place by
force.
"""

from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd
import pyarrow as pa

from tactile.base import paths
from tactile.base.paths import Workspace
from tactile.datasets import schemas, specimens
from tactile.experiments import array_recorded
from tactile.logs import sources
from tactile.sheet import cycles

EXPERIMENT = "array_recorded"
SETS = 4  # of the scene's recordings, in their order
MOST = 2  # contacts of a frame
HELD = 0.9  # of the peak of a press
BRIEF_S = 0.3
AWAY_MM = 24.0  # from the centre of a contact: two pitches of the scene, five of the recorded array
SAME_MM = 6.0  # elements so near across rows, or across columns, are under both contacts: a finger is 10 mm wide
APART_MM = 12.0  # of rows or columns that share no contact
BESIDE_MM = (10.0, 14.0)  # from the centre of a contact: the scene's neighbours
MIDDLE = 0.25  # of a pitch: so near the middle of an element it is compared with others
FEWEST = 10  # frames or contacts that a number is of
DEGREE = 2  # of the log reading in the log size

STATISTICS: dict[str, tuple[str, str]] = {
    "gain_spread": (
        "log",
        "Standard deviation between elements of the log reading under a contact in the middle of an element, given its "
        "size: what persons (simulated: places within an element) agree on.",
    ),
    "noise": (
        "1",
        "Standard deviation of an element's readings away from contacts in a recording, over the reading under a "
        "contact.",
    ),
    "beside": ("1", "Reading 10 to 14 mm from the centre of a single contact, over the reading under the contact."),
    "along_line": (
        "1",
        "Reading on the row and on the column of a single contact, more than 24 mm away, less that as far away on "
        "other rows and columns, over the reading under the contact.",
    ),
    "crossing": (
        "1",
        "Reading where the row of one of two contacts crosses the column of the other, more than 24 mm from both, less "
        "what this row and this column read elsewhere, over the mean reading under the contacts: 0 where effects of "
        "the two add up.",
    ),
    "two_over_one": (
        "log",
        "Log reading under one of two contacts on different rows and columns, less that of a single contact of its "
        "size: 0 where contacts do not disturb each other.",
    ),
    "in_row": ("log", "Log reading under one of two contacts of one row, less that of two on different lines."),
    "in_column": ("log", "Log reading under one of two contacts of one column, less that of two on different lines."),
}
NOTES: dict[str, str] = {
    "gain_spread": "Left as it is: the film of the scene differs from place to place as that of the recorded Velostat "
    "taxel does, and a capacitive array has no film.",
    "noise": "Left as it is: the scene has the converter of the paper.",
    "beside": "Left as it is: a capacitive element feels a finger that does not touch it, a film only what presses it.",
    "along_line": "Left as it is: elements of a column load one divider in the paper's circuit; the recorded array has "
    "another one.",
    "crossing": "Left as it is: what joins two fingers' lines in the recorded array is not known; in the scene only "
    "drivers of rows do, whose voltage sags.",
    "in_column": "Left as it is: a second tip of a column takes part of the divider's voltage in the paper's circuit.",
}


class Frames(NamedTuple):
    """Frames of one recording, each of one contact or two."""

    unit: str  # of whom a value is
    rise: np.ndarray  # (n, rows, cols) readings above rest
    place_mm: np.ndarray  # (n, MOST, 2) of contacts' centres, across rows and across columns; NaN: no contact
    size: np.ndarray  # (n, MOST) area or force; NaN where the response to a contact is not to be compared
    pitch_mm: float


def recorded(workspace: Workspace, settings: Mapping) -> pd.DataFrame:
    """Return the statistics of the recorded array: columns recording, statistic, value; a recording is a person.

    Raises InputError for files that are no frames.
    """
    return statistics(recorded_frames(workspace), by_place=False)


def simulated(workspace: Workspace, settings: Mapping) -> pd.DataFrame:
    """Return the statistics of the scene, as `recorded`; raises InputError where its logs have not been read.

    A recording is a quarter of those of the first array; of gain_spread, it is a place within all elements.
    """
    path = paths.require(workspace.frames("touch"), "python -m tactile.stages.ingest touch")
    return statistics(simulated_frames(path, settings["touch"]), by_place=True)


def recorded_frames(workspace: Workspace) -> Iterator[Frames]:
    """Yield the frames of each session, without those of more than MOST contacts."""
    pixel = array_recorded.PITCH_MM / array_recorded.PIXELS
    for session in array_recorded.recordings(sources.folder(workspace, EXPERIMENT)):
        rise, place, size = [], [], []
        for file in sorted(session.glob("npz/*.npz")):
            readings, touched = array_recorded.read_frame(file)
            found = array_recorded.found_contacts(touched)
            if not 1 <= (number := len(found.area)) <= MOST:
                continue
            at = np.full((MOST, 2), np.nan)
            at[:number] = np.column_stack([found.row, found.col]) * pixel
            area = np.full(MOST, np.nan)
            area[:number] = np.where(covered(touched, found), found.area * pixel**2, np.nan)
            rise.append(readings)
            place.append(at)
            size.append(area)
        yield Frames(session.parent.name, *map(np.array, (rise, place, size)), array_recorded.PITCH_MM)


def covered(touched: np.ndarray, found: array_recorded.Contacts) -> np.ndarray:
    """Return which contacts cover all of the element at their centre, (contacts,) bool."""
    pixels = array_recorded.PIXELS
    corners = [(int(row // pixels) * pixels, int(col // pixels) * pixels) for row, col in zip(*found[:2], strict=True)]
    return np.array([touched[row : row + pixels, col : col + pixels].all() for row, col in corners], dtype=bool)


def simulated_frames(path: Path, settings: Mapping) -> Iterator[Frames]:
    """Yield one frame a press of each single and double recording; settings: the block `touch`."""
    sensor, threshold = settings["sensor"], settings["window"]["contact_threshold_n"]
    table = schemas.read(path)
    table = table.filter(pa.array(specimens.of_seed(schemas.names(table["recording"]), 0)))
    conditions, names = schemas.names(table["condition"]), schemas.names(table["recording"])
    readings = schemas.matrix(table["v"]).reshape(-1, sensor["rows"], sensor["cols"])
    force, x, y = (schemas.matrix(table[name])[:, :MOST] for name in ("force_n", "x_mm", "y_mm"))
    time_s = table["t_s"].to_numpy()
    for condition in ("single", "double"):
        listed = np.unique(names[conditions == condition])
        for number, name in enumerate(listed):
            rows = np.flatnonzero((conditions == condition) & (names == name))
            of, total = force[rows], np.nansum(force[rows], axis=1)
            found = cycles.presses(time_s[rows], total, threshold, BRIEF_S)
            if not found or found[0].first < FEWEST:
                continue
            picked = [at for press in found if (at := held(of, press)) is not None]
            rest = readings[rows[: found[0].first]].mean(axis=0)
            chosen = rows[picked]
            size = of[picked].astype(float)
            size[:, 1:] = np.nan  # held by hand
            place = np.stack([y[chosen], x[chosen]], axis=2)
            unit = f"set {number * SETS // len(listed)}"
            yield Frames(unit, readings[chosen] - rest, place, size, sensor["pitch_mm"])


def held(force: np.ndarray, press: cycles.Press) -> int | None:
    """Return the middle of the time for which all tips press with HELD of their peaks; None where there is none.

    force: (n, MOST) of a recording, NaN where there is no tip.
    """
    part = force[press.first : press.stop]
    part = part[:, np.isfinite(part).all(axis=0)]
    together = np.flatnonzero((part >= HELD * np.percentile(part, 95, axis=0)).all(axis=1))
    return press.first + int(together[len(together) // 2]) if len(together) else None


def statistics(recordings: Iterable[Frames], by_place: bool) -> pd.DataFrame:
    """Return a row per unit and statistic, the mean over its recordings, weighted by what their values are of.

    by_place: whether places are pressed again, so that a contact is compared with others at its place.
    """
    rows, found = [], []
    for number, frames in enumerate(recordings):
        found.append(contacts(frames).assign(unit=frames.unit, session=number))
        rows += [(frames.unit, *row) for row in of_frames(frames, found[-1])]
    table = pd.concat(found, ignore_index=True)
    rows += list(together(table, by_place))
    rows += list(gains(table, by_place))
    result = pd.DataFrame(rows, columns=["recording", "statistic", "value", "weight"])
    result["value"] *= result["weight"]
    sums = result.groupby(["recording", "statistic"], sort=False)[["value", "weight"]].sum()
    sums = sums[sums["weight"] >= FEWEST]
    sums = sums["value"].div(sums["weight"]).rename("value").reset_index()
    order = {name: place for place, name in enumerate(STATISTICS)}
    return sums.sort_values("statistic", key=lambda column: column.map(order), kind="stable", ignore_index=True)


def contacts(frames: Frames) -> pd.DataFrame:
    """Return one row per contact: frame, number of contacts in it, element, how far off its middle, reading, size.

    row, col, other_col: of elements; same_row, same_col: whether contacts share one; off_row, off_col: in pitches;
    across_row, across_col: how far the other contact is across rows and across columns in mm, NaN of a single one.
    """
    n, (rows, cols) = len(frames.rise), frames.rise.shape[1:]
    at = frames.place_mm / frames.pitch_mm - 0.5
    element = np.clip(np.rint(np.nan_to_num(at)).astype(int), 0, (rows - 1, cols - 1))
    there = np.isfinite(at[:, :, 0])
    parts = []
    for one in range(MOST):
        other = 1 - one
        apart = np.abs(frames.place_mm[:, one] - frames.place_mm[:, other])
        part = pd.DataFrame(
            {
                "frame": np.arange(n),
                "number": there.sum(axis=1),
                "row": element[:, one, 0],
                "col": element[:, one, 1],
                "off_row": (at - element)[:, one, 0],
                "off_col": (at - element)[:, one, 1],
                "across_row": apart[:, 0],
                "across_col": apart[:, 1],
                "other_col": element[:, other, 1],
                "same_row": np.abs(element[:, 0, 0] - element[:, 1, 0]) * frames.pitch_mm < SAME_MM,
                "same_col": np.abs(element[:, 0, 1] - element[:, 1, 1]) * frames.pitch_mm < SAME_MM,
                "reading": frames.rise[np.arange(n), element[:, one, 0], element[:, one, 1]],
                "size": frames.size[:, one],
                "place": [f"{y:.1f} {x:.1f}" for y, x in frames.place_mm[:, one]],
            }
        )
        parts.append(part[there[:, one]])
    return pd.concat(parts, ignore_index=True)


def of_frames(frames: Frames, found: pd.DataFrame) -> Iterator[tuple[str, float, int]]:
    """Yield (statistic, value, of how many frames) of elements away from contacts and beside them in one recording."""
    centres = [(np.arange(count) + 0.5) * frames.pitch_mm for count in frames.rise.shape[1:]]
    across = [np.abs(frames.place_mm[:, :, axis, None] - centres[axis]) for axis in (0, 1)]  # (n, MOST, rows or cols)
    distance = np.hypot(across[0][:, :, :, None], across[1][:, :, None, :])
    away = np.nanmin(distance, axis=1) > AWAY_MM
    other = [np.nanmin(each, axis=1) > APART_MM for each in across]
    free = away & other[0][:, :, None] & other[1][:, None, :]
    under = found.groupby("frame")["reading"].mean().reindex(range(len(frames.rise))).to_numpy()
    seen = free.sum(axis=0)
    level = np.where(free, frames.rise, 0).sum(axis=0) / np.maximum(seen, 1)
    variance = np.where(free, (frames.rise - level) ** 2, 0).sum(axis=0) / np.maximum(seen - 1, 1)
    often = seen >= FEWEST
    if often.any():
        yield "noise", float(np.sqrt(variance[often].mean()) / np.median(under)), int(seen[often].sum())

    single = found[(found["number"] == 1) & np.isfinite(found["size"])]
    of = single["frame"].to_numpy()
    row = lines(single["row"], frames.rise.shape[1])[:, :, None]
    col = lines(single["col"], frames.rise.shape[2])[:, None, :]
    rest = mean_where(frames.rise[of], free[of])
    for line in (row, col):
        shares = (mean_where(frames.rise[of], away[of] & line) - rest) / under[of]
        yield "along_line", *mean_of(shares)
    middle = (single[["off_row", "off_col"]].abs() <= MIDDLE).all(axis=1).to_numpy()
    near = (distance[of, 0] > BESIDE_MM[0]) & (distance[of, 0] < BESIDE_MM[1]) & middle[:, None, None]
    yield "beside", *mean_of(mean_where(frames.rise[of], near) / under[of])

    pairs = found[(found[["across_row", "across_col"]] > AWAY_MM).all(axis=1)]
    of = pairs["frame"].to_numpy()
    row = lines(pairs["row"], frames.rise.shape[1])[:, :, None]
    col = lines(pairs["other_col"], frames.rise.shape[2])[:, None, :]
    parts = (row & col, row & other[1][of][:, None, :], col & other[0][of][:, :, None], free[of])
    both, of_row, of_col, rest = (mean_where(frames.rise[of], away[of] & part) for part in parts)
    yield "crossing", *mean_of((both - of_row - of_col + rest) / under[of])


def lines(number: pd.Series, count: int) -> np.ndarray:
    """Return where the row, or the column, of each contact is, (contacts, count) bool."""
    return np.arange(count) == number.to_numpy()[:, None]


def mean_of(values: np.ndarray) -> tuple[float, int]:
    """Return the mean of the values that are there, and how many these are; 0 and 0 of none."""
    there = values[np.isfinite(values)]
    return (float(there.mean()), len(there)) if len(there) else (0.0, 0)


def mean_where(values: np.ndarray, where: np.ndarray) -> np.ndarray:
    """Return the mean of the values (n, rows, cols) that are asked for, (n,); NaN where none is."""
    count = where.sum(axis=(1, 2))
    return np.where(where, values, 0).sum(axis=(1, 2)) / np.where(count, count, np.nan)


def together(table: pd.DataFrame, by_place: bool) -> Iterator[tuple[str, str, float, int]]:
    """Yield (unit, statistic, value, of how many contacts) of what two contacts read over what each reads alone.

    Medians over contacts: areas of some masks are off, and with them what is expected.
    """
    table = table[np.isfinite(table["size"]) & (table["reading"] > 0)]
    size, reading = np.log(table["size"]), np.log(table["reading"])
    alone = pd.Series(np.nan, index=table.index)
    for _, of in table.groupby("place" if by_place else "session"):
        single, two = (of.index[of["number"] == number] for number in (1, 2))
        if len(single) > DEGREE + 1 and len(two):
            fitted = np.polynomial.Polynomial.fit(size[single], reading[single], DEGREE)
            within = np.clip(size[two], size[single].min(), size[single].max())
            alone[two] = fitted(within.to_numpy())
    table = table.assign(more=reading - alone)[np.isfinite(alone)]
    apart = [table["across_row"] > APART_MM, table["across_col"] > APART_MM]
    for unit, of in table.groupby("unit"):
        whole = (apart[0] & apart[1], table["same_row"] & apart[1], table["same_col"] & apart[0])
        free, row, column = (of["more"][which.loc[of.index]] for which in whole)
        yield unit, "two_over_one", float(free.median()), len(free)
        for name, more in (("in_row", row), ("in_column", column)):
            yield unit, name, float(more.median() - free.median()), min(len(more), len(free))


def gains(table: pd.DataFrame, by_place: bool) -> Iterator[tuple[str, str, float, int]]:
    """Yield (person or place, gain_spread, value, of how many contacts).

    The variance between elements is the mean product of a contact's log reading, less what its size explains, and of
    the mean of the others' on the same element: what two persons (or places) do not share averages out.
    """
    near = (table[["off_row", "off_col"]].abs() <= MIDDLE).all(axis=1)
    table = table[near & np.isfinite(table["size"]) & (table["reading"] > 0)]
    size, reading = np.log(table["size"]), np.log(table["reading"])
    left = pd.Series(np.nan, index=table.index)
    for _, of in table.groupby("number" if by_place else ["session", "number"]):
        if len(of) >= FEWEST:
            fitted = np.polynomial.Polynomial.fit(size[of.index], reading[of.index], DEGREE)
            left[of.index] = reading[of.index] - fitted(size[of.index].to_numpy())
    within = "place " + table["off_row"].round(1).astype(str) + " " + table["off_col"].round(1).astype(str)
    table = table.assign(left=left, of=within if by_place else table["unit"])[np.isfinite(left)]
    means = table.groupby(["row", "col", "of"])["left"].agg(["mean", "size"]).reset_index()
    for name, own in means.groupby("of"):
        others = means[means["of"] != name].groupby(["row", "col"])["mean"].mean()
        pairs = own.merge(others.rename("others").reset_index(), on=["row", "col"])
        if len(pairs):
            shared = np.average(pairs["mean"] * pairs["others"], weights=pairs["size"])
            yield name, "gain_spread", float(np.sqrt(max(shared, 0))), int(pairs["size"].sum())
