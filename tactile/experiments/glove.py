"""Read glove recordings (SP-ResNet paper): the scanner's log as frames, and tactile images by equations 1 to 6.

Any sensor that scans areas is read alike, a mat or a glove of a few sensors: `glove.sensor.areas`.
"""

from collections import Counter
from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np
import pyarrow as pa

from tactile.base.errors import InputError
from tactile.base.facts import Facts, Finding, Paper, Twin
from tactile.datasets import images as tactile
from tactile.datasets import schemas, specimens
from tactile.datasets.seeding import generator
from tactile.logs import layout, parse
from tactile.logs.formats import Column, Format
from tactile.logs.report import log_report

KIND = "images"
FACTS = Facts(
    label="Glove",
    unit="levels",
    output_unit="probability",
    metric="accuracy",
    compared=("random_frames_combined", "session_combined"),
    first_tested=("session_combined", "combined"),
    drawn=("session_pressure", "session_strain", "session_combined"),
    seeds="gloves",
    score="errors/combined.macro_precision",
    sheet="areas_of_glove",
    tested={
        ("session_pressure", "pressure"): "pressure",
        ("session_strain", "strain"): "bending",
        ("session_combined", "combined"): "pressure and bending",
    },
    log="scanner.log",
    layout=("ingest.max_reject_fraction",),
    sensor=("sensor.areas", "sensor.scale", "sensor.reference_ohm"),
    quick=("constant", "window_ridge", "window_trees", "naive_bayes", "tree", "sp_resnet"),
    paper=Paper(
        *("sp_resnet", "macro_precision", "precision", 100),
        conditions={"pressure": "Pressure", "strain": "Bending", "combined": "Pressure and bending"},
        splits={
            "session_{condition}": "split by session, 50 epochs",
            "random_frames_{condition}": "random frames",
        },  # the paper does not name its own
        variants={("random_frames_combined", "sp_resnet"): "epochs_50"},
        epochs=50,
    ),
    twin=Twin("glove_recorded", "Glove: recorded grasps of a robot hand and those of the glove"),
    purpose={"line_faults": "ingest is there for torn, doubled, missing and swapped lines"},
    shown={"session": "alike_within", "wander": "load_wander"},
)

CLOCK = Column("t_us", "us", -(2.0**31), 2**53, integer=True)

PRESSURE_CELLS, STRAIN_CELLS = (area.cells for area in tactile.GLOVE.values())  # of the paper's glove
LEVELS = 1024  # of its scanner's converter, equation 2
LOG = "scanner.log"
SPLITS = ("session", "random_frames")
PER_FRAME, PER_AREA = "frame", "range"  # what an image is scaled by, `glove.sensor.scale`


def scale(settings: Mapping) -> str:
    """Return what images are scaled by: PER_FRAME, equation 6, or PER_AREA, the range of their area's readings."""
    return settings["sensor"].get("scale", PER_FRAME)


def scanner_format(settings: Mapping) -> Format:
    """Return the format of the scanner's lines: time, then the areas one after the other, each row by row.

    Columns are named by the first letter of their area: p0, p1, ..., s0, ... With PER_FRAME they are counts of a
    converter, whole numbers; with PER_AREA any numbers within the area's range.
    """
    whole = scale(settings) == PER_FRAME
    for name, area in tactile.areas(settings).items():
        if whole and area.lowest != 0:
            raise InputError(
                f"glove.sensor.areas.{name}.lowest: is {area.lowest:g}, but counts begin at 0; "
                "set glove.sensor.scale: range"
            )
    cells = (
        Column(f"{name[0]}{k}", "1", area.lowest, area.highest, integer=whole)
        for name, area in tactile.areas(settings).items()
        for k in range(area.cells)
    )
    return Format((CLOCK, *cells), time="t_us")


def formats(settings: Mapping, folder: Path | None = None) -> dict[str, Format]:
    """Return log -> format of its lines, of any folder."""
    return {LOG: scanner_format(settings)}


def any_readings(settings: Mapping) -> Format:
    """Return `scanner_format` for readings of any size, to find out what they are."""
    cells = [
        Column(f"{name[0]}{k}", "1", area.lowest - 1e9, area.highest + 1e9)
        for name, area in tactile.areas(settings).items()
        for k in range(area.cells)
    ]
    return Format((CLOCK, *cells), time="t_us")


def frames_schema(settings: Mapping) -> pa.Schema:
    """Return the schema of the frames table for the sensor's areas."""
    areas = tactile.areas(settings)
    small = scale(settings) == PER_FRAME and all(area.highest < 2**15 for area in areas.values())
    return tactile.frames({name: area.cells for name, area in areas.items()}, pa.int16() if small else pa.float32())


def recordings(folder: Path) -> list[Path]:
    """Return the folders `<object>/<session>` in `folder`, sorted.

    Raises InputError for fewer than two objects, and for an object without a session.
    """
    objects = parse.folders(folder, "*")
    if len(objects) < 2:
        raise InputError(f"{folder}: {len(objects)} objects found; expected two or more as <object>/<session>/{LOG}")
    sessions = []
    for grasped in objects:
        folders = parse.folders(grasped, "*")
        if not folders:
            raise InputError(f"{grasped}: no session of this object; add <session>/{LOG} or remove the folder")
        sessions += folders
    parse.check_names(sessions)
    return sessions


def read_recording(folder: Path, settings: Mapping) -> tuple[pa.Table, pa.Table, dict]:
    """Read the log of one session as `(frames, rejects, report)`; settings: the block `glove` of params.yaml.

    frames: a table of frames_schema. Lines of the file = accepted + rejected (+ header). A frame of a sensor at rest,
    all of whose readings are alike, is a frame. Raises InputError for a missing log, too many rejects, or a session
    without a line that can be read.
    """
    limit, key, fmt = (
        settings["ingest"]["max_reject_fraction"],
        "glove.ingest.max_reject_fraction",
        scanner_format(settings),
    )
    laid_out = layout.of(settings["ingest"], LOG)
    rows, rejects = parse.read_log(folder / LOG, fmt, limit=limit, key=key, layout=laid_out)
    reasons = Counter(rejects["reason"].to_pylist())
    parse.check_rejects(folder / LOG, rejects.num_rows + rows.num_rows, reasons, limit, key)

    time_s, segment, schema = rows["t_us"].to_numpy() / 1e6, rows["segment"].to_numpy(), frames_schema(settings)
    columns = {
        "condition": [folder.parent.name] * rows.num_rows,
        "recording": [folder.name] * rows.num_rows,
        "segment": segment,
        "t_s": time_s,
        "gap_before": schemas.gaps_before(time_s, segment),
    }
    first = 1  # after the time
    for name, area in tactile.areas(settings).items():
        cells = np.column_stack([rows[column].to_numpy() for column in fmt.names[first : first + area.cells]])
        columns[name] = schemas.lists(cells, schema.field(name).type.value_type)
        first += area.cells
    frames = pa.table(columns).select(schema.names).cast(schema)
    return frames, rejects, {LOG: log_report(rows.num_rows, rejects, time_s, segment)}


def chosen(frames: pa.Table, settings: Mapping) -> np.ndarray:
    """Return the row numbers of the frames that become images: every `window.stride`-th frame of each session.

    Differs from paper: it uses all 950 frames of an object. Here every 10th of a session becomes an image,
    95 of an object, so that neighbours in a random split are 1 s apart and less alike; the evidence takes all, too.
    """
    return np.flatnonzero(places(frames) % settings["window"]["stride"] == 0)


def places(frames: pa.Table) -> np.ndarray:
    """Return the number of each frame within its session, (n,), from 0; frames: in the order of the log."""
    names = np.char.add(np.char.add(schemas.names(frames["condition"]), "/"), schemas.names(frames["recording"]))
    starts = np.flatnonzero(np.concatenate([[True], names[1:] != names[:-1]]))
    return np.arange(len(names)) - np.repeat(starts, np.diff([*starts, len(names)]))


def images(frames: pa.Table, settings: Mapping) -> dict[str, np.ndarray]:
    """Return the datasets of tactile images, modality -> (n, rows, cols) uint8; what is not scanned is 0.

    On the paper's glove these are three, each 32 x 32. The pixels of a joint all show its mean (equation 5). With
    PER_FRAME images show conductances, and each is stretched to its own range (equation 6), `combined` as one matrix;
    with PER_AREA readings are scaled by the range of their area, so that how hard the sensor is pressed is kept.
    Differs from paper: the paper does not say where in the image a joint's mean lies; here it fills the joint's 3 x 3
    cells.
    """
    areas, matrices = tactile.areas(settings), {}
    for name, area in areas.items():
        readings = schemas.matrix(frames[name])
        if scale(settings) == PER_FRAME:
            values = conductance(readings, settings["sensor"]["reference_ohm"], area.highest + 1)
        else:
            values = tactile.HIGHEST * (readings.astype(float) - area.lowest) / (area.highest - area.lowest)
        values = values.reshape(-1, area.rows, area.cols)
        if area.joint > 1:
            values = joint_means(values, area.joint).repeat(area.joint, axis=1).repeat(area.joint, axis=2)
        matrices[name] = values
    pictures = {}
    for modality in tactile.modalities(settings):
        matrix = np.zeros((frames.num_rows, *tactile.shape(settings)))
        for name, area in areas.items():
            if modality in (name, tactile.COMBINED):
                matrix[:, *area.place] = matrices[name]
        per_frame = scale(settings) == PER_FRAME
        pictures[modality] = tactile.normalised(matrix) if per_frame else np.round(matrix).astype(np.uint8)
    return pictures


def log_problems(path: Path, rows: pa.Table, settings: Mapping) -> Iterator[str]:
    """Yield problems of a log that can be read: what counts mean no log can say."""
    yield from ()


def findings(frames: pa.Table, pictures: pa.Table, settings: Mapping) -> Iterator[Finding]:
    """Yield what all recordings show: how many images of how many objects."""
    yield Finding(f"{pictures.num_rows} images of {len(set(schemas.names(pictures['condition'])))} objects")


def conductance(counts: np.ndarray, reference_ohm: float, levels: float = LEVELS) -> np.ndarray:
    """Return siemens for ADC counts 0 .. levels - 1 (any shape), G = V / (R_ref (levels - V)) (equations 1 to 4)."""
    counts = counts.astype(float)
    return counts / (reference_ohm * (levels - counts))


def joint_means(strain: np.ndarray, joint: int) -> np.ndarray:
    """Return the mean of the joint x joint cells of each joint, (n, rows / joint, cols / joint) (equation 5).

    strain: conductances (n, rows, cols); the paper's area (b) has 15 x 9 cells and joints of 3 x 3.
    """
    n, rows, cols = strain.shape
    return strain.reshape(n, rows // joint, joint, cols // joint, joint).mean(axis=(2, 4))


def split(frames: pa.Table, settings: Mapping, protocol: str, seed: int) -> np.ndarray:
    """Return the part of each image, (n,); the same for all datasets of one seed. frames: the chosen frames.

    `session`: whole sessions of every object, drawn by the seed; `random_frames`: frames, as the paper seems to
    have done. The simulated `test_sessions` are in the test of `session`. Images of other gloves than the seed's are
    unused. Raises InputError for another name or an object with fewer sessions than parts.
    Differs from paper: it means 10 runs of a model, which differ in an unknown way; here a run is a seed, of the glove,
    the split and the start. The evidence has one for each seed.
    """
    name = tactile.checked_split("glove", protocol, SPLITS, settings)
    share = settings["split"]
    objects, sessions = schemas.names(frames["condition"]), schemas.names(frames["recording"])
    here, further = specimens.of_seed(sessions, seed), specimens.only_tested(sessions)
    part = np.full(frames.num_rows, "unused", dtype=object)
    if name == "session":
        part[here & further] = "test"
    for grasped in np.unique(objects):
        inside = here & ~further & (objects == grasped)
        known = np.unique(sessions[inside])
        if len(known) < len(tactile.PARTS):
            raise InputError(
                f"glove, object '{grasped}': {len(known)} sessions; at least {len(tactile.PARTS)} are "
                "needed to train, validate and test on different ones: record more, or remove the object"
            )
        units = known if name == "session" else np.flatnonzero(inside)
        order = generator(seed, "glove", name, grasped).permutation(units)
        for part_name, group in zip(tactile.PARTS, tactile.shares(order, share), strict=True):
            part[inside & np.isin(sessions, group) if name == "session" else group] = part_name
    return part
