"""Read recorded grasps of a three-finger robot hand: one bzip2-compressed XML file per grasp, see logs/sources.py.

The hand (Schunk SDH-2) bears a tactile matrix on both links of each finger. Here two fingers close against each other
and the third is folded away, so nearly all contact is on the distal matrices of the first and the last finger.

Two things the splits cannot show. All grasps of an object were recorded within 1 to 3 minutes, so none tests another
day. And joints 0, 3 and 4 never move during a grasp, but their resting angles differ by some 0.001 degrees between the
minutes of one object and another: extra trees name the object from these three alone
(pipeline/studies/joint_angles.py). Images, in steps of 0.2 degrees for joints that move and 0.7 for the others, hide
this difference; a model that takes the angles of `strain` themselves sees it.
"""

import bz2
import contextlib
import re
from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pyarrow as pa

from tactile.base import foreign
from tactile.base.errors import InputError
from tactile.base.facts import FOLDS, Facts, Source
from tactile.datasets import images as tactile
from tactile.datasets import schemas
from tactile.datasets.seeding import generator
from tactile.logs import parse
from tactile.logs.report import log_report

KIND = "images"
FACTS = Facts(
    label="Recorded grasps",
    unit="levels",
    output_unit="probability",
    metric="accuracy",
    compared=("grasp_combined",),
    first_tested=("grasp_combined", "combined"),
    drawn=("grasp_pressure", "grasp_strain", "grasp_combined"),
    seeds=FOLDS,
    score="errors/combined.macro_precision",
    sheet="hand",
    tested={
        ("grasp_pressure", "pressure"): "pressure",
        ("grasp_strain", "strain"): "bending",
        ("grasp_combined", "combined"): "pressure and bending",
    },
    source=Source(
        repository="peter-kiechle/tactile-sensors",
        commit="7bbb341b2db445653477b82b908e2ef0175cf926",
        folder="python/classification/training_grasp_profiles_thesis",
        licence="GPL-3",
        size=5_093_550,
    ),
    targets={"object": None},
)

MATRICES = ((14, 6), (13, 6)) * 3  # rows, columns: proximal and distal link of each finger
CELLS = sum(rows * cols for rows, cols in MATRICES)
FULL_SCALE = 4095  # of a cell
JOINTS = 7
SCHEMA = tactile.frames({"pressure": CELLS, "strain": JOINTS}, pa.float32())

# Places in an image: three fingers beside each other, fingertips on top.
# Matrix -> first row and column; distal matrices are within the paper's area a (rows 1-15, columns 1-18).
PLACES = ((13, 0), (0, 0), (13, 6), (0, 6), (13, 12), (0, 12))
# Joint -> first row and column of its 3 x 3 pixels, in the paper's area b (rows 18-32, columns 24-32). Joint 0 turns
# the first and the last finger about their own axes; then the proximal and the distal joint of each finger.
JOINT_PLACES = ((23, 26), (20, 23), (17, 23), (20, 26), (17, 26), (20, 29), (17, 29))
JOINT_SIDE = 3
# Range of each joint in an image: the stroke of joints that close, the whole reach of joints that hold the posture.
LOWEST_DEG = np.array([-90.0, -40, -10, -90, -90, -40, -10])
HIGHEST_DEG = np.array([90.0, 10, 40, 90, 90, 10, 40])

LARGEST_CONTENT = 16 << 20  # bytes after decompression; the longest grasp has 0.33 MB
IMPOSSIBLE_DEG = 180.0
LONGEST_TIME = 15  # digits; milliseconds since 1970 have 13

NO_TIME = "no time"
WORDS = "unreadable words"
CELL_COUNT = "number of cells"
CONSTANT = "constant frame"  # mostly the time before contact, when every cell is 0
NO_ANGLES = "no joint angles at this time"

SPLITS = ("grasp", "block", "random_frames")


def frames_schema(settings: Mapping) -> pa.Schema:
    """Return the schema of the frames table: the hand is given, whatever `settings` say."""
    return SCHEMA


def recordings(folder: Path) -> list[Path]:
    """Return the files `<object>/*.dsa` in `folder`, by object, then in the order of time; InputError without any."""
    files = sorted(folder.glob("*/*.dsa"), key=lambda path: (path.parent.name, _first_frame(path.stem), path.name))
    if not files:
        raise InputError(f"{folder}: no recordings; run `tactile fetch glove_recorded`")
    return files


def read_recording(path: Path, settings: Mapping) -> tuple[pa.Table, pa.Table, dict]:
    """Read one grasp as `(frames, rejects, report)`.

    `settings`: the block `glove_recorded` of params.yaml. frames: a table of SCHEMA; pressure in counts, 0 to
    FULL_SCALE, the matrices one after the other, each row by row; strain in degrees, interpolated at the frame's
    time. rejects: one row per frame that is left out, numbered from 1 in `line`, and, under `<file>: joint angles`, one
    row per entry of the joint angles that is left out. report: for both, as for logs. Constant frames are rejects too,
    but do not count against `ingest.max_reject_fraction`: a hand feels nothing before contact. Raises InputError for a
    file that is not whole, not such XML, of another sensor, with too many rejects or without a frame that is left.
    """
    root = _parsed(path)
    _check_layout(path, root)
    entries, angle_entries = root.findall("data/frame"), root.findall("joint_angles/angle")
    if not entries:
        raise InputError(f"{path}: has no frames; remove the file or fetch it again")
    limit, key = settings["ingest"]["max_reject_fraction"], "glove_recorded.ingest.max_reject_fraction"

    angle_time, angle, reason = _angles(angle_entries)
    angle_name = f"{path.name}: joint angles"
    angle_rejects = _rejects(angle_name, angle_entries, "angle_data", reason)
    reasons = Counter(angle_rejects["reason"].to_pylist())
    parse.check_rejects(path.with_name(angle_name), len(angle_entries), reasons, limit, key)
    angle_time, angle = angle_time[reason == ""], angle[reason == ""]
    if not len(angle):
        raise InputError(f"{path}: has no joint angles; remove the file or fetch it again")

    time, cells, reason = _frames(entries)
    outside = (reason == "") & ((time < angle_time[0]) | (time > angle_time[-1]))
    reason = np.where(outside, NO_ANGLES, reason)
    rejects = _rejects(path.name, entries, "frame_data", reason)
    reasons = Counter(rejects["reason"].to_pylist())
    constant = reasons.pop(CONSTANT, 0)
    parse.check_rejects(path, len(entries) - constant, reasons, limit, key)
    kept = np.flatnonzero(reason == "")
    if not len(kept):
        raise InputError(f"{path}: no frame is left, {constant} of {len(entries)} are constant; remove the recording")

    time = time[kept]
    segment = np.zeros(len(kept), dtype=np.int16)
    gap = (np.diff(kept, prepend=-np.inf) > 1) | schemas.gaps(time, segment)
    strain = np.column_stack([np.interp(time, angle_time, angle[:, joint]) for joint in range(JOINTS)])
    columns = {
        "condition": [path.parent.name] * len(kept),
        "recording": [path.stem] * len(kept),
        "segment": segment,
        "t_s": time,
        "gap_before": gap,
        "pressure": schemas.lists(cells[kept], pa.float32()),
        "strain": schemas.lists(strain, pa.float32()),
    }
    report = {path.name: log_report(len(kept), rejects, time, segment)}
    report[path.name]["gaps"] = int(gap[1:].sum())
    report[angle_name] = log_report(len(angle), angle_rejects, angle_time, np.zeros(len(angle)))
    frames = pa.table(columns).select(SCHEMA.names).cast(SCHEMA)
    return frames, pa.concat_tables([rejects, angle_rejects]), report


def chosen(frames: pa.Table, settings: Mapping) -> np.ndarray:
    """Return the row numbers of the frames that become images, (n,) rising.

    These are the last `window.frames` frames of each grasp, `window.stride` apart, up to its last frame (fewer where
    the grasp has fewer): at the end the hand is closed and at rest.
    """
    count, stride = settings["window"]["frames"], settings["window"]["stride"]
    rows = [grasp[::-1][::stride][:count][::-1] for grasp in _grasps(frames)]
    return np.sort(np.concatenate(rows)) if rows else np.zeros(0, dtype=int)


def images(frames: pa.Table, settings: Mapping) -> dict[str, np.ndarray]:
    """Return the tactile images of the chosen frames, (n, 32, 32) uint8 by modality; areas without a cell are 0.

    Differs from paper: recorded counts are scaled by their full scale and angles by their range, not every image by
    its own lowest and highest value (equation 6): counts and degrees have no common unit, and how hard the hand
    presses is kept. With equation 6 on the pressure, the validation parts of 10 seeds have accuracy .68 (support
    vector machine) and .63 (extra trees), with the full scale .71 and .68, with the root of the counts .70 and .68.
    Differs from paper: left open there and chosen here: batches of 32 images.
    """
    n = frames.num_rows
    cells = _levels(schemas.matrix(frames["pressure"]), 0, FULL_SCALE)
    joints = _levels(schemas.matrix(frames["strain"]), LOWEST_DEG, HIGHEST_DEG)

    pictures = {name: np.zeros((n, tactile.SIDE, tactile.SIDE), dtype=np.uint8) for name in tactile.MODALITIES}
    start = 0
    for (rows, cols), (row, col) in zip(MATRICES, PLACES, strict=True):
        matrix = cells[:, start : start + rows * cols].reshape(n, rows, cols)
        for name in ("pressure", "combined"):
            pictures[name][:, row : row + rows, col : col + cols] = matrix
        start += rows * cols
    for joint, (row, col) in enumerate(JOINT_PLACES):
        for name in ("strain", "combined"):
            pictures[name][:, row : row + JOINT_SIDE, col : col + JOINT_SIDE] = joints[:, joint, None, None]
    return pictures


def _levels(values: np.ndarray, low: float | np.ndarray, high: float | np.ndarray) -> np.ndarray:
    """Scale `low` to `high` to 0 to 255, uint8; values beyond them get the nearer end."""
    return np.round(tactile.HIGHEST * np.clip((values - low) / (high - low), 0, 1)).astype(np.uint8)


def split(frames: pa.Table, settings: Mapping, protocol: str, seed: int) -> np.ndarray:
    """Return the part of each image, (n,); the same for the three modalities of one seed. frames: the chosen frames.

    Seeds test on one fold after another, so that as many seeds as there are folds test on every grasp once; how many
    these are, the share of the test in `split` says, rounded to a whole number of folds.
    `grasp`: folds of whole grasps of every object, in an order that is drawn anew after the last fold; `block`: folds
    of grasps in a row in time, validated on those before them, the first ones on the last; `random_frames`: as `grasp`
    with single frames, so that frames of one grasp fall on all sides. Raises InputError for another name, or an object
    with fewer grasps (frames) than parts.
    """
    name = tactile.checked_split("glove_recorded", protocol, SPLITS, settings)
    part = np.empty(frames.num_rows, dtype=object)
    objects, grasps = schemas.names(frames["condition"]), _grasps(frames)
    kind = "frames" if name == "random_frames" else "grasps"
    repeat, fold = divmod(seed, folds(settings))
    for grasped in np.unique(objects):
        units = [grasp for grasp in grasps if objects[grasp[0]] == grasped]
        if name == "random_frames":
            units = [np.array([row]) for row in np.concatenate(units)]
        if len(units) < len(tactile.PARTS):
            raise InputError(
                f"glove_recorded, object '{grasped}': {len(units)} {kind}; at least {len(tactile.PARTS)} are needed to "
                "train, validate and test on different ones: record more, or remove the object"
            )
        order = np.arange(len(units))
        if name != "block":
            order = generator(repeat, "glove_recorded", name, grasped).permutation(order)
        for part_name, group in zip(tactile.PARTS, _divided(order, fold, settings), strict=True):
            part[np.concatenate([units[k] for k in group])] = part_name
    return part


def folds(settings: Mapping) -> int:
    """Return into how many folds grasps are divided, two at least; settings: the experiment's block."""
    return max(2, round(1 / (1 - settings["split"]["train"] - settings["split"]["validation"])))


def _divided(order: np.ndarray, fold: int, settings: Mapping) -> list[np.ndarray]:
    """Return which units train, validate and test, none of them empty; order: three units or more (n,)."""
    n, number = len(order), folds(settings)
    first, end = fold * n // number, (fold + 1) * n // number
    test = max(1, end - first)  # of fewer units than folds some are tested twice
    validation = min(max(1, round(n * settings["split"]["validation"])), n - test - 1)
    return np.split(np.roll(order, n - first - test), [n - test - validation, n - test])


def _grasps(frames: pa.Table) -> list[np.ndarray]:
    """Return the row numbers of every grasp, by object and then in the order of time."""
    if not frames.num_rows:
        return []
    objects, names = schemas.names(frames["condition"]), schemas.names(frames["recording"])
    starts = np.flatnonzero((objects[1:] != objects[:-1]) | (names[1:] != names[:-1])) + 1
    grasps = np.split(np.arange(frames.num_rows), starts)
    return sorted(grasps, key=lambda rows: (objects[rows[0]], _first_frame(names[rows[0]]), names[rows[0]]))


def _first_frame(stem: str) -> int:
    """Return 83 for aerosol_can_000083-000147: the grasp's first frame in the session that it was cut out of."""
    numbers = re.search(r"_([0-9]+)-[0-9]+$", stem)
    if not numbers:
        raise InputError(f"{stem}.dsa: the name must end in the grasp's first and last frame, like _000083-000147.dsa")
    return int(numbers.group(1))


class _Tree(ElementTree.TreeBuilder):
    """A builder that refuses a document type: only the entities of one can make a short text grow when it is read."""

    def doctype(self, name: str, public: str | None, system: str | None) -> None:
        raise ValueError("a document type is not read, a recording has none")


def _parsed(path: Path) -> ElementTree.Element:
    """Parse the file's XML. Raises InputError where the file is cut, damaged, too large or of another kind."""
    with foreign.reading(path, "a whole bzip2 file", "fetch it again"), bz2.open(path) as file:
        content = file.read(LARGEST_CONTENT + 1)
    if len(content) > LARGEST_CONTENT:
        raise InputError(f"{path}: more than the {LARGEST_CONTENT} bytes that a grasp can have; check the file")
    with foreign.reading(path, "whole XML", "fetch it again"):
        return ElementTree.fromstring(content.decode(), ElementTree.XMLParser(target=_Tree()))


def _check_layout(path: Path, root: ElementTree.Element) -> None:
    """Raise InputError unless the file is of a sensor with these matrices."""
    matrices = [
        tuple(matrix.findtext(name, "").strip() for name in ("cells_y", "cells_x", "fullscale"))
        for matrix in root.findall("sensor/matrix")
    ]
    if matrices != [(str(rows), str(cols), str(FULL_SCALE)) for rows, cols in MATRICES]:
        given = ", ".join(f"{rows} x {cols}" for rows, cols, _ in matrices) or "none"
        wanted = ", ".join(f"{rows} x {cols}" for rows, cols in MATRICES)
        raise InputError(f"{path}: its matrices are {given}, not {wanted} with a full scale of {FULL_SCALE}")


def _angles(entries: list[ElementTree.Element]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return time (m,) in s, angles (m, JOINTS) in degrees, and why an entry is left out (m,), '' where it is not."""
    time, angle, reasons = _times(entries), np.full((len(entries), JOINTS), np.nan), []
    for k, entry in enumerate(entries):
        fields = entry.findtext("angle_data", "").split(",")
        if len(fields) == JOINTS:
            with contextlib.suppress(ValueError):
                angle[k] = [float(field) for field in fields]
        if len(fields) != JOINTS:
            reasons.append(parse.COLUMNS)
        elif not np.isfinite(angle[k]).all():
            reasons.append(parse.NOT_A_NUMBER)
        else:
            reasons.append(parse.OUT_OF_RANGE if np.abs(angle[k]).max() > IMPOSSIBLE_DEG else "")
    return time, angle, _with_time(time, reasons)


def _frames(entries: list[ElementTree.Element]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return time (n,) in s, counts (n, CELLS), and why a frame is left out (n,), '' where it is not."""
    time, cells, reasons = _times(entries), np.zeros((len(entries), CELLS)), []
    for k, entry in enumerate(entries):
        counts, reason = _cells(entry.findtext("frame_data", ""))
        reasons.append(reason)
        if not reason:
            cells[k] = counts
    return time, cells, _with_time(time, reasons)


def _cells(text: str) -> tuple[np.ndarray, str]:
    """Return the cells of a frame (CELLS,) and why it cannot be used, '' where it can.

    A word is a big-endian float32 in eight hex digits; a value -n stands for n cells of 0.
    """
    try:
        values = np.frombuffer(bytes.fromhex("".join(text.split())), ">f4").astype(float)
    except ValueError:  # no hex digits, or half a word
        return np.zeros(0), WORDS
    if not np.isfinite(values).all():
        return values, parse.NOT_A_NUMBER
    number = np.where(values < 0, -values, 1)
    if (number % 1).any():
        return values, WORDS
    if number.sum() != CELLS:
        return values, CELL_COUNT
    values = np.repeat(np.maximum(values, 0), number.astype(int))
    if values.max() > FULL_SCALE:
        return values, parse.OUT_OF_RANGE
    return values, CONSTANT if np.ptp(values) == 0 else ""


def _times(entries: list[ElementTree.Element]) -> np.ndarray:
    """Return the unix times in s, (n,), NaN where there is none."""
    times = []
    for entry in entries:
        text = entry.findtext("time_stamp", "").strip()
        good = text.isascii() and text.isdigit() and len(text) <= LONGEST_TIME
        times.append(int(text) / 1000 if good else np.nan)
    return np.array(times)


def _with_time(time: np.ndarray, reasons: list[str]) -> np.ndarray:
    """Return the reasons, (n,), with those of an entry's time, (n,), added: no time, or one not after all before it."""
    latest = np.fmax.accumulate(np.concatenate([[-np.inf], time[:-1]])) if len(time) else time
    reason = np.array(reasons, dtype=object)
    usable = (reason == "") | (reason == CONSTANT)
    return np.where(np.isnan(time), NO_TIME, np.where(usable & (time <= latest), parse.OUT_OF_ORDER, reason))


def _rejects(name: str, entries: list[ElementTree.Element], data: str, reason: np.ndarray) -> pa.Table:
    """Return the entries with a reason as rejects of the file `name`; data: the element with an entry's readings."""
    bad = np.flatnonzero(reason != "")
    texts = []
    for k in bad:
        words = [*entries[k].findtext("time_stamp", "").split(), *entries[k].findtext(data, "").split()]
        texts.append(ascii(" ".join(words))[1:-1][: parse.TEXT_LENGTH])
    columns = [[name] * len(bad), bad + 1, reason[bad].tolist(), texts]
    return pa.table([pa.array(column) for column in columns] if len(bad) else [[]] * 4, parse.REJECTS)
