"""Read frames of a capacitive array of 41 x 72 elements under fingers, with masks of where they touch it.

A frame is an .npz file of readings and of a mask of 8 x 8 pixels an element, taken through the glass by frustrated
total internal reflection (Streli and Holz, CHI 2021, doi 10.1145/3411764.3445621). Ten persons touched the array in
three sessions each; in a session frames stand in no order and have no times.

A model sees a square of the array that holds all contacts, at a place drawn by the frame's name, and is asked what
share of each cell is in contact, in percent. That is where fingers touch, not how hard they press: no force was
recorded.
"""

import re
from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pyarrow as pa
from scipy import ndimage

from tactile.base import foreign
from tactile.base.errors import InputError
from tactile.base.facts import Facts, Source, Twin
from tactile.datasets import schemas
from tactile.datasets.seeding import generator
from tactile.logs import parse
from tactile.logs.report import log_report

KIND = "windows"
SCORES = "contact"
STRESSED = ("one", "two", "three")
FACTS = Facts(
    label="Recorded capacitive array",
    unit="counts",
    output_unit="% contact",
    metric="rmse",
    compared=("fold_0",),
    score="main/two.rmse",
    sheet="",
    stream=False,
    first_tested=("fold_0", "two"),
    drawn=("fold_0",),
    tested={("fold_0", "one"): "one contact", ("fold_0", "two"): "two contacts", ("fold_0", "three"): "three contacts"},
    subject="person",
    twin=Twin(
        "array_recorded",
        "Touch: the recorded capacitive array and the scene's",
        scene="touch",
        said=(
            "The recorded array is of another principle: what counts here is how two contacts differ from one.\n\n"
            "**What the scene's two touches have and the recorded ones have not.** The reading of one of two tips "
            "of a column differs by {in_column[simulated]:.2f} in log from that of tips on different lines "
            "(recorded {in_column[recorded]:.3f}). A single tip changes what the elements of its row and column "
            "read far away by {along_line[simulated]:.3f} of its own reading (recorded "
            "{along_line[recorded]:.4f}).\n\n"
            "**What it lacks.** Where the row of one finger crosses the column of the other, the recorded array "
            "reads {crossing[recorded]:.3f} of what it reads under the fingers, beyond what each does on its "
            "lines (simulated {crossing[simulated]:.3f}). A recorded contact reaches further, with "
            "{beside[recorded]:.2f} of its reading 10 to 14 mm from its centre (simulated "
            "{beside[simulated]:.3f}). Recorded elements differ less, by {gain_spread[recorded]:.3f} in log "
            "(simulated {gain_spread[simulated]:.2f}).\n\n"
            "**What could be missed.** A difference within the recorded range is not seen, as persons differ by "
            "as much. So two contacts on different lines may change each other's reading by "
            "{two_over_one[recorded_low]:.2f} to {two_over_one[recorded_high]:.2f} in log unnoticed, and two of a"
            " row by {in_row[recorded_low]:.2f} to {in_row[recorded_high]:.2f}. Recorded contacts are matched by "
            "area, which is no force. The scene's ranges are over quarters of the recordings of one array, not "
            "over arrays; which lines of the recorded array are driven is not known."
        ),
    ),
    source=Source(
        repository="eth-siplab/CapContact",
        commit="ccc3298962cd2dc086c470892719b402ee75eff0",
        folder="CapContact-dataset",
        licence="CC BY-NC-SA 4.0",
        size=150_553_304,
    ),
)

ROWS, COLS, PITCH_MM = 41, 72, 4.8  # elements, and the distance of their centres
PIXELS = 8  # of the mask, along an element
MOST_PIXELS = 255  # of a cell, whose count is kept in a byte
CONDITIONS = ("one", "two", "three", "four_or_more")  # contacts of a frame, from 1 on
NO_CONTACT, TOO_MANY, TOO_WIDE = "no contact", "more contacts than are asked for", "contacts do not fit into the crop"
PROTOCOL = re.compile(r"(fold|two_too)_([0-9]+)")
TRAINED = {"fold": 1, "two_too": 2}  # most contacts of frames that train


class Sizes(NamedTuple):
    """Sizes of the crop that the settings ask for."""

    averaged: int  # elements of the array along one of the crop
    rows: int  # of the array's elements
    cols: int
    cell_rows: int  # of a cell, in pixels
    cell_cols: int


def sizes(settings: Mapping) -> Sizes:
    """Return the sizes of the crop; InputError where elements or cells of it are no whole number of the array's."""
    sensor, label = settings["sensor"], settings["label"]
    averaged = round(sensor["pitch_mm"] / PITCH_MM)
    if averaged < 1 or not np.isclose(averaged * PITCH_MM, sensor["pitch_mm"]):
        raise InputError(
            f"params/array_recorded.yaml, array_recorded.sensor.pitch_mm: {sensor['pitch_mm']:g} mm is no multiple of "
            f"the array's {PITCH_MM} mm; set {PITCH_MM * max(1, averaged):g}"
        )
    sides = [sensor["rows"] * averaged, sensor["cols"] * averaged]
    cells = []
    for side, elements, most in zip(("rows", "cols"), sides, (ROWS, COLS), strict=True):
        number, pixels = label[f"map_{side}"], elements * PIXELS
        if elements > most:
            raise InputError(
                f"params/array_recorded.yaml, array_recorded.sensor.{side}: {sensor[side]} of {sensor['pitch_mm']:g} "
                f"mm are {elements} {side} of the array, which has {most}; set {most // averaged} or fewer"
            )
        if pixels % number:
            raise InputError(
                f"params/array_recorded.yaml, array_recorded.label.map_{side}: {number} cells do not divide the "
                f"{pixels} pixels of the crop's mask; set a divisor such as {elements}"
            )
        cells.append(pixels // number)
    if cells[0] * cells[1] > MOST_PIXELS:
        raise InputError(
            f"params/array_recorded.yaml, array_recorded.label: cells of {cells[0]} x {cells[1]} pixels are larger "
            f"than the {MOST_PIXELS} that are counted; set map_rows {sides[0]} and map_cols {sides[1]}"
        )
    return Sizes(averaged, *sides, *cells)


def frames_schema(settings: Mapping) -> pa.Schema:
    """Return the schema of the frames table; settings: the block `array_recorded` of params.yaml.

    v: readings of the crop, row by row; contact_px: pixels in contact of each cell of the map; contacts: how many
    there are; their centres, in mm from the crop's corner, and areas: NaN where there are fewer.
    """
    sensor, label = settings["sensor"], settings["label"]
    per_contact = pa.list_(pa.float32(), settings["ingest"]["most_contacts"])
    return pa.schema(
        {
            "condition": schemas.NAME,  # the person
            "recording": schemas.NAME,  # person and session
            "segment": pa.int16(),
            "t_s": pa.float64(),  # the frame's number: there is no clock
            "gap_before": pa.bool_(),  # always: frames do not follow one another
            "v": pa.list_(pa.float32(), sensor["rows"] * sensor["cols"]),
            "contact_px": pa.list_(pa.uint8(), label["map_rows"] * label["map_cols"]),
            "person": schemas.NAME,
            "contacts": pa.int8(),
            "x_mm": per_contact,
            "y_mm": per_contact,
            "area_mm2": per_contact,
        }
    )


def recordings(folder: Path) -> list[Path]:
    """Return the folders `<person>/<session>` in `folder`, sorted. Raises InputError where there is none."""
    found = sorted({path.parents[1] for path in folder.glob("P*/*/npz/*.npz")})
    if not found:
        raise InputError(f"{folder}: no recordings; run `tactile fetch array_recorded`")
    return found


def read_recording(path: Path, settings: Mapping) -> tuple[pa.Table, pa.Table, dict]:
    """Read the frames of one session as `(frames, rejects, report)`.

    settings: the block `array_recorded` of params.yaml. frames: a table of `frames_schema`, in the order of the files'
    names. rejects: a row for each frame that is not used, with its reason. Raises InputError for a file that is no
    frame, and for a session of which no frame is left.
    """
    files, of, person = sorted(path.glob("npz/*.npz")), sizes(settings), path.parent.name
    most = settings["ingest"]["most_contacts"]
    kept, reasons = [], []
    for file in files:
        cap, touched = read_frame(file)
        contacts = found_contacts(touched)
        reason = NO_CONTACT if not len(contacts.area) else TOO_MANY if len(contacts.area) > most else ""
        corner = None if reason else crop_corner(contacts, of, f"{person}/{path.name}/{file.stem}")
        reasons.append(reason or ("" if corner else TOO_WIDE))
        if corner:
            kept.append(_cropped(cap, touched, contacts, corner, of))
    if not kept:
        raise InputError(
            f"{path}: none of its {len(files)} frames is used ({dict(Counter(reasons))}); remove the folder"
        )
    left = np.array(reasons) == ""
    out = [(file.name, reason) for file, reason in zip(files, reasons, strict=True) if reason]
    columns = [[name for name, _ in out], [1] * len(out), [reason for _, reason in out], [""] * len(out)]
    rejects = pa.table([pa.array(column) for column in columns] if out else [[]] * 4, parse.REJECTS)
    number = np.flatnonzero(left).astype(float)
    values = {name: np.array([getattr(frame, name) for frame in kept]) for name in ("v", "contact_px")}
    n, schema = len(kept), frames_schema(settings)
    table = {
        "condition": schemas.repeated(person, n),
        "recording": schemas.repeated(f"{person}/{path.name}", n),
        "person": schemas.repeated(person, n),
        "segment": np.zeros(n, np.int16),
        "t_s": number,
        "gap_before": np.ones(n, bool),
        "contacts": np.array([len(frame.area_mm2) for frame in kept], np.int8),
        **{name: schemas.lists(each, schema.field(name).type.value_type) for name, each in values.items()},
    }
    for name in ("x_mm", "y_mm", "area_mm2"):
        padded = np.full((n, most), np.nan)
        for row, frame in enumerate(kept):
            padded[row, : len(frame.area_mm2)] = getattr(frame, name)
        table[name] = schemas.lists(padded, pa.float32())
    report = log_report(n, rejects, number, np.zeros(n)) | {"rate_hz": None, "gaps": 0}
    return pa.table(table).select(schema.names).cast(schema), rejects, {"npz": report}


def read_frame(file: Path) -> tuple[np.ndarray, np.ndarray]:
    """Return readings (ROWS, COLS) in counts and where there is contact (ROWS * PIXELS, COLS * PIXELS), bool.

    Of a mask's two values contact is the one of fewer pixels; there readings are higher than elsewhere. Raises
    InputError where they are not, and for a file that is no such frame.
    """
    with foreign.reading(file, "a frame of the array", "fetch it again"), np.load(file) as content:
        cap, mask = content["cap"].astype(np.float32), content["ftir"]
    shapes = cap.shape, mask.shape
    if shapes != ((ROWS, COLS), (ROWS * PIXELS, COLS * PIXELS)) or not np.isfinite(cap).all():
        raise InputError(
            f"{file}: readings {cap.shape} and mask {mask.shape} are not {ROWS} x {COLS} numbers and {PIXELS} x "
            f"{PIXELS} pixels of each; fetch it again"
        )
    dark = mask == 0
    if not (dark | (mask == 255)).all():
        raise InputError(f"{file}: its mask has other values than 0 and 255; fetch it again")
    touched = dark if dark.mean() < 0.5 else ~dark
    row, col = np.nonzero(touched)
    if len(row) and not cap[row // PIXELS, col // PIXELS].mean() > cap.mean():
        raise InputError(
            f"{file}: readings under its {len(row)} pixels of contact are not higher than the others; fetch it again"
        )
    return cap, touched


class Contacts(NamedTuple):
    """The contacts of a mask, in pixels."""

    row: np.ndarray  # (contacts,) of the centre
    col: np.ndarray
    area: np.ndarray
    first: tuple[int, int]  # row and column of the rectangle around all
    last: tuple[int, int]  # one beyond


def found_contacts(touched: np.ndarray) -> Contacts:
    """Return the contacts of a mask: connected pixels, over edges."""
    rows, cols = (np.flatnonzero(touched.any(axis=axis)) for axis in (1, 0))
    if not len(rows):
        return Contacts(*np.zeros((3, 0)), (0, 0), (0, 0))
    first, last = (int(rows[0]), int(cols[0])), (int(rows[-1]) + 1, int(cols[-1]) + 1)
    number, _ = ndimage.label(touched[first[0] : last[0], first[1] : last[1]])
    row, col = np.nonzero(number)
    of = number[row, col]
    area = np.bincount(of)[1:]
    centres = (np.bincount(of, place + 0.5)[1:] / area for place in (row, col))
    return Contacts(*(start + centre for start, centre in zip(first, centres, strict=True)), area, first, last)


def crop_corner(contacts: Contacts, of: Sizes, name: str) -> tuple[int, int] | None:
    """Return row and column of the first element of a crop that holds all contacts, drawn by the frame's name.

    None where no crop holds them.
    """
    rng, corner = generator(0, "array_recorded", name), []
    for first, last, side, whole in zip(contacts.first, contacts.last, (of.rows, of.cols), (ROWS, COLS), strict=True):
        least, most = max(0, -(-last // PIXELS) - side), min(first // PIXELS, whole - side)
        if least > most:
            return None
        corner.append(int(rng.integers(least, most + 1)))
    return corner[0], corner[1]


class Cropped(NamedTuple):
    """One frame as its models see it; see `frames_schema`."""

    v: np.ndarray
    contact_px: np.ndarray
    x_mm: np.ndarray
    y_mm: np.ndarray
    area_mm2: np.ndarray


def _cropped(cap: np.ndarray, touched: np.ndarray, contacts: Contacts, corner: tuple[int, int], of: Sizes) -> Cropped:
    row, col = corner
    readings = cap[row : row + of.rows, col : col + of.cols]
    averaged = readings.reshape(of.rows // of.averaged, of.averaged, -1, of.averaged).mean(axis=(1, 3))
    pixels = touched[row * PIXELS : (row + of.rows) * PIXELS, col * PIXELS : (col + of.cols) * PIXELS]
    cells = pixels.reshape(len(pixels) // of.cell_rows, of.cell_rows, -1, of.cell_cols).sum(axis=(1, 3))
    pixel_mm = PITCH_MM / PIXELS
    x, y = contacts.col * pixel_mm - col * PITCH_MM, contacts.row * pixel_mm - row * PITCH_MM
    return Cropped(averaged.ravel(), cells.ravel(), x, y, contacts.area * pixel_mm**2)


def conditions(windows: pa.Table) -> pa.Array:
    """Return how many contacts each window has, (n,) of CONDITIONS: that, not the person, is what scores are of."""
    number = np.minimum(windows["contacts"].to_numpy(), len(CONDITIONS)) - 1
    return pa.DictionaryArray.from_arrays(number.astype(np.int32), list(CONDITIONS))


def labels(windows: pa.Table, settings: Mapping) -> np.ndarray:
    """Return what share of each cell is in contact, (n, map_rows * map_cols) in percent, which is no pressure."""
    of = sizes(settings)
    return schemas.matrix(windows["contact_px"]) * np.float32(100 / (of.cell_rows * of.cell_cols))


def split(windows: pa.Table, settings: Mapping, protocol: str, seed: int) -> np.ndarray:
    """Return the part of each window, (n,): no person is of two parts. The same for every seed.

    Fold k tests on persons, those of number k * split.test on in the order of their names, validates on the
    split.validation that follow, the first after the last, and trains on the others. Frames of more contacts than the
    protocol trains on (TRAINED) are used in tests alone. Raises InputError for another protocol, or too few persons.
    """
    if not windows.num_rows:
        return np.zeros(0, dtype=object)
    person, contacts = schemas.names(windows["person"]), windows["contacts"].to_numpy()
    persons, test, validation = np.unique(person), settings["split"]["test"], settings["split"]["validation"]
    asked = PROTOCOL.fullmatch(protocol)
    if len(persons) <= test + validation:
        raise InputError(
            f"params/array_recorded.yaml, array_recorded.split: {test} persons test and {validation} validate, which "
            f"leaves none of the {len(persons)} that there are to train on; lower them"
        )
    if not asked or (int(asked[2]) + 1) * test > len(persons):
        raise InputError(
            f"params/array_recorded.yaml, array_recorded.protocols: there is no '{protocol}'; of {len(persons)} "
            f"persons there are fold_0 to fold_{len(persons) // test - 1}, and two_too_0 and so on likewise"
        )
    order = np.roll(persons, -int(asked[2]) * test)
    part = np.full(len(person), "train", dtype=object)
    part[np.isin(person, order[:test])] = "test"
    part[np.isin(person, order[test : test + validation])] = "validation"
    part[(part != "test") & (contacts > TRAINED[asked[1]])] = "unused"
    return part
