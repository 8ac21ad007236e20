"""Read glove recordings (SP-ResNet paper): the scanner's log as frames, and tactile images by equations 1 to 6."""

from collections import Counter
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pyarrow as pa

from pipeline.base.errors import InputError
from pipeline.datasets import images as tactile
from pipeline.datasets import schemas, specimens
from pipeline.datasets.seeding import generator
from pipeline.logs import parse
from pipeline.logs.parse import Column, Format
from pipeline.logs.report import log_report

KIND = "images"
SETTINGS = "Glove"

PRESSURE = (slice(0, 15), slice(0, 18))  # area (a) of the 32 x 32 scan: rows, columns
STRAIN = (slice(17, 32), slice(23, 32))  # area (b)
PRESSURE_CELLS, STRAIN_CELLS = 15 * 18, 15 * 9
LEVELS = 1024  # of the scanner's converter, equation 2
JOINT = 3  # cells of a joint's sensor in each direction
LOG = "scanner.log"
FORMAT = Format(
    (
        Column("t_us", "us", 0, 2**53, integer=True),
        *(Column(f"p{k}", "1", 0, LEVELS - 1, integer=True) for k in range(PRESSURE_CELLS)),
        *(Column(f"s{k}", "1", 0, LEVELS - 1, integer=True) for k in range(STRAIN_CELLS)),
    ),
    time="t_us",
)
SCHEMA = tactile.frames(PRESSURE_CELLS, STRAIN_CELLS, pa.int16())

CONSTANT = "constant frame"  # of one area: equation 6 would divide by zero
SPLITS = ("session", "random_frames")


def frames_schema(settings: Mapping) -> pa.Schema:
    """Return the schema of the frames table: the glove is given, whatever `settings` say."""
    return SCHEMA


def recordings(folder: Path) -> list[Path]:
    """Return the folders `<object>/<session>` in `folder`, sorted.

    Raises InputError for fewer than two objects, and for an object without a session.
    """
    objects = sorted(path for path in folder.glob("*") if path.is_dir())
    if len(objects) < 2:
        raise InputError(f"{folder}: {len(objects)} objects found; expected two or more as <object>/<session>/{LOG}")
    sessions = []
    for grasped in objects:
        folders = sorted(path for path in grasped.glob("*") if path.is_dir())
        if not folders:
            raise InputError(f"{grasped}: no session of this object; add <session>/{LOG} or remove the folder")
        sessions += folders
    parse.check_names(sessions)
    return sessions


def read_recording(folder: Path, settings: Mapping) -> tuple[pa.Table, pa.Table, dict]:
    """Read the log of one session as `(frames, rejects, report)`; settings: the block `glove` of params.yaml.

    frames: a table of SCHEMA. Lines of the file = accepted + rejected (+ header). Raises InputError for a missing
    log, too many rejects, or a session without a usable frame.
    """
    limit, key = settings["ingest"]["max_reject_fraction"], "glove.ingest.max_reject_fraction"
    rows, rejects = parse.read_log(folder / LOG, FORMAT, limit=limit, key=key)
    cells = np.column_stack([rows[name].to_numpy() for name in FORMAT.names[1:]])
    pressure, strain = cells[:, :PRESSURE_CELLS], cells[:, PRESSURE_CELLS:]
    constant = (np.ptp(pressure, axis=1) == 0) | (np.ptp(strain, axis=1) == 0)
    reasons = Counter(rejects["reason"].to_pylist()) + Counter({CONSTANT: int(constant.sum())})
    parse.check_rejects(folder / LOG, rejects.num_rows + rows.num_rows, reasons, limit, key)
    rejects = parse.add_rejects(rejects, folder / LOG, rows["line"].to_numpy()[constant], CONSTANT)
    kept = np.flatnonzero(~constant)
    if not len(kept):
        raise InputError(f"{folder / LOG}: no usable frame is left, most often '{max(reasons, key=reasons.get)}'")

    time_s, segment = rows["t_us"].to_numpy()[kept] / 1e6, rows["segment"].to_numpy()[kept]
    columns = {
        "condition": [folder.parent.name] * len(kept),
        "recording": [folder.name] * len(kept),
        "segment": segment,
        "t_s": time_s,
        "gap_before": schemas.gaps_before(time_s, segment),
        "pressure": schemas.lists(pressure[kept], pa.int16()),
        "strain": schemas.lists(strain[kept], pa.int16()),
    }
    frames = pa.table(columns).select(SCHEMA.names).cast(SCHEMA)
    return frames, rejects, {LOG: log_report(len(kept), rejects, time_s, segment)}


def chosen(frames: pa.Table, settings: Mapping) -> np.ndarray:
    """Return the row numbers of the frames that become images: every `window.stride`-th frame of each session.

    Differs from paper: it uses all 950 frames of an object. At laptop scale every 10th of a session becomes an image,
    95 of an object, so that neighbours in a random split are 1 s apart and less alike; `tactile scale paper` takes all.
    """
    return np.flatnonzero(places(frames) % settings["window"]["stride"] == 0)


def places(frames: pa.Table) -> np.ndarray:
    """Return the number of each frame within its session, (n,), from 0; frames: in the order of the log."""
    names = np.char.add(np.char.add(schemas.names(frames["condition"]), "/"), schemas.names(frames["recording"]))
    starts = np.flatnonzero(np.concatenate([[True], names[1:] != names[:-1]]))
    return np.arange(len(names)) - np.repeat(starts, np.diff([*starts, len(names)]))


def images(frames: pa.Table, settings: Mapping) -> dict[str, np.ndarray]:
    """Return the three datasets of tactile images, each (n, 32, 32) uint8; areas that are not scanned are null.

    A joint's nine pixels all show their mean conductance (equation 5). `combined` is normalised as one matrix.
    Differs from paper: the paper does not say where in the image a joint's mean lies; here it fills the joint's 3 x 3
    cells.
    """
    ohm = settings["sensor"]["reference_ohm"]
    pressure = conductance(schemas.matrix(frames["pressure"]), ohm).reshape(-1, 15, 18)
    joints = joint_means(conductance(schemas.matrix(frames["strain"]), ohm).reshape(-1, 15, 9))
    strain = joints.repeat(JOINT, axis=1).repeat(JOINT, axis=2)
    pictures = {}
    for modality in tactile.MODALITIES:
        matrix = np.zeros((frames.num_rows, tactile.SIDE, tactile.SIDE))
        if modality != "strain":
            matrix[:, *PRESSURE] = pressure
        if modality != "pressure":
            matrix[:, *STRAIN] = strain
        pictures[modality] = tactile.normalised(matrix)
    return pictures


def conductance(counts: np.ndarray, reference_ohm: float) -> np.ndarray:
    """Return siemens for ADC counts 0 .. 1023 (any shape), G = V / (R_ref (1024 - V)) (equations 1 to 4)."""
    counts = counts.astype(float)
    return counts / (reference_ohm * (LEVELS - counts))


def joint_means(strain: np.ndarray) -> np.ndarray:
    """Return the mean of each joint's 3 x 3 cells, (n, 5, 3), for conductances of area (b), (n, 15, 9) (equation 5)."""
    n, rows, cols = strain.shape
    return strain.reshape(n, rows // JOINT, JOINT, cols // JOINT, JOINT).mean(axis=(2, 4))


def split(frames: pa.Table, settings: Mapping, protocol: str, seed: int) -> np.ndarray:
    """Return the part of each image, (n,); the same for the three datasets of one seed. frames: the chosen frames.

    `session`: whole sessions of every object, drawn by the seed; `random_frames`: frames, as the paper seems to
    have done. Images of other gloves than the seed's are unused. Raises InputError for another name or an object with
    fewer sessions than parts.
    Differs from paper: it means 10 runs of a model, which differ in an unknown way; here a run is a seed, of the glove,
    the split and the start. At laptop scale there is 1 on each split.
    """
    name = tactile.split_name(protocol)
    if name not in SPLITS:
        raise InputError(f"params.yaml, glove.protocols: no split '{name}'; there are {', '.join(SPLITS)}")
    share = settings["split"]
    objects, sessions = schemas.names(frames["condition"]), schemas.names(frames["recording"])
    here = specimens.of_seed(sessions, seed)
    part = np.full(frames.num_rows, "unused", dtype=object)
    for grasped in np.unique(objects):
        inside = here & (objects == grasped)
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
