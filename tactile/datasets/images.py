"""Make and read the tables of experiments whose input is one tactile image (glove).

A sensor of images scans one area or several, `sensor.areas`; each area gives a dataset of images, and all of them
together another, `combined`.
"""

import re
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pyarrow as pa

from tactile.base.errors import InputError
from tactile.datasets import schemas

SIDE = 32  # pixels of the side of the papers' images
MODALITIES = ("pressure", "strain", "combined")  # the three datasets of the SP-ResNet paper
COMBINED = "combined"
HIGHEST = 255.0
PARTS = ("train", "validation", "test")
SHAPE = "shape"  # metadata of a dataset's column of images: rows and columns


class Area(NamedTuple):
    """One area of a sensor: where its readings lie in an image, and what they can be."""

    rows: int
    cols: int
    top: int = 0  # row and column of the image
    left: int = 0
    joint: int = 1  # cells of the side of a joint's sensor, which shows its mean; 1: every cell shows itself
    lowest: float = 0  # of a reading
    highest: float = 1023

    @property
    def cells(self) -> int:
        """Return the number of readings per frame."""
        return self.rows * self.cols

    @property
    def place(self) -> tuple[slice, slice]:
        """Return the area's rows and columns of the image."""
        return slice(self.top, self.top + self.rows), slice(self.left, self.left + self.cols)


# Areas (a) and (b) of the paper's glove (section 1.3): palm and joints, counts of 10 bits.
GLOVE = {"pressure": Area(15, 18), "strain": Area(15, 9, top=17, left=23, joint=3)}


def areas(settings: Mapping) -> dict[str, Area]:
    """Return the areas of a sensor by name, in the order of the log's columns; settings: an experiment's block.

    Without `sensor.areas`, those of the paper's glove. An area without a place lies to the right of the one before.
    Raises InputError for names that cannot be told apart in a log's header or in a protocol, and for areas that
    overlap, have no range, or are no whole number of joints.
    """
    described = settings.get("sensor", {}).get("areas")
    if not described:
        return dict(GLOVE)
    known: dict[str, Area] = {}
    for name, block in described.items():
        key = f"glove.sensor.areas.{name}"
        beside = max((area.left + area.cols for area in known.values()), default=0)
        area = Area(**{"left": beside} | dict(block))
        if not re.fullmatch("[a-z]+", name) or name == COMBINED:
            raise InputError(f"{key}: name areas by small letters alone, and not '{COMBINED}'")
        if name[0] in {other[0] for other in known}:
            raise InputError(f"{key}: begins like another area; columns are named by the first letter, so rename one")
        if area.highest <= area.lowest:
            raise InputError(f"{key}: highest ({area.highest:g}) must be above lowest ({area.lowest:g})")
        if area.rows % area.joint or area.cols % area.joint:
            raise InputError(f"{key}: {area.rows} x {area.cols} cells are no whole number of joints of {area.joint}")
        for other, there in known.items():
            if _overlap(area, there):
                raise InputError(f"{key}: overlaps '{other}' in the image; set top and left, or leave both out")
        known[name] = area
    return known


def _overlap(one: Area, other: Area) -> bool:
    """Tell whether two areas share a pixel."""
    return all(a.start < b.stop and b.start < a.stop for a, b in zip(one.place, other.place, strict=True))


def shape(settings: Mapping) -> tuple[int, int]:
    """Return rows and columns of the images of a sensor: the smallest image that holds all of its areas."""
    places = [area.place for area in areas(settings).values()]
    return max(rows.stop for rows, _ in places), max(cols.stop for _, cols in places)


def modalities(settings: Mapping) -> tuple[str, ...]:
    """Return the names of a sensor's datasets of images: its areas, and `combined` where there are several."""
    names = tuple(areas(settings))
    return names if len(names) == 1 else (*names, COMBINED)


def frames(cells: Mapping[str, int], value: pa.DataType) -> pa.Schema:
    """Return the schema of frames, in the order of time within a recording.

    cells: area -> readings per frame; value: type of a reading.
    """
    return pa.schema(
        {
            "condition": schemas.NAME,  # the object, which the models must name
            "recording": schemas.NAME,
            "segment": pa.int16(),  # a new one after every reset of the device
            "t_s": pa.float64(),
            "gap_before": pa.bool_(),  # frames are missing before this one; also the first frame of a segment
            **{name: pa.list_(value, count) for name, count in cells.items()},
        }
    )


def reading_columns(schema: pa.Schema) -> list[str]:
    """Return the names of the columns of a frames table that hold readings, in the order of the log."""
    return [field.name for field in schema if pa.types.is_fixed_size_list(field.type)]


def normalised(matrix: np.ndarray) -> np.ndarray:
    """Stretch each matrix of (n, rows, cols) linearly to 0 .. 255, uint8 (equation 6 of the SP-ResNet paper).

    X = 255 (C - min C) / (max C - min C); 0 everywhere where max = min: a sensor at rest, of which equation 6 says
    nothing.
    """
    low, high = (edge(matrix, axis=(1, 2), keepdims=True) for edge in (np.min, np.max))
    return np.round(HIGHEST * (matrix - low) / np.where(high > low, high - low, 1)).astype(np.uint8)


def dataset_rows(chosen: pa.Table, pictures: Mapping[str, np.ndarray]) -> pa.Table:
    """Return the dataset: condition, recording, t_s, label (int16, place of the object in the sorted names), images.

    chosen: a table of the schema `frames`; pictures: modality -> (n, rows, cols) uint8.
    """
    names = schemas.names(chosen["condition"])
    _, label = np.unique(names, return_inverse=True)
    table = chosen.select(["condition", "recording", "t_s"]).append_column("label", pa.array(label.astype(np.int16)))
    return with_pictures(table, pictures)


def with_pictures(table: pa.Table, pictures: Mapping[str, np.ndarray]) -> pa.Table:
    """Return the table with a column of images per modality, each with their shape; pictures: as for dataset_rows."""
    for name, picture in pictures.items():
        n, rows, cols = picture.shape
        flat = schemas.lists(picture.reshape(n, rows * cols), pa.uint8())
        table = table.append_column(pa.field(name, flat.type, metadata={SHAPE: f"{rows} {cols}"}), flat)
    return table


def shares(units: np.ndarray, split: Mapping) -> list[np.ndarray]:
    """Divide shuffled sessions, grasps or frames into three groups, in the order of PARTS, none of them empty.

    units: three or more; split: the shares `train` and `validation`, the rest is the test.
    """
    wanted = np.cumsum([split["train"], split["validation"]]) * len(units)
    first = int(np.clip(round(wanted[0]), 1, len(units) - 2))
    second = int(np.clip(round(wanted[1]), first + 1, len(units) - 1))
    return np.split(units, [first, second])


def modality(protocol: str) -> str:
    """Return the modality of a protocol, named <split>_<modality>: `pressure` for session_pressure."""
    return protocol.rsplit("_", 1)[-1]


def checked_split(experiment: str, protocol: str, splits: tuple[str, ...], settings: Mapping) -> str:
    """Return the split of a protocol; InputError for none of `splits`, and for images that the sensor does not have."""
    name, key = split_name(protocol), f"params/{experiment}.yaml, {experiment}.protocols"
    if name not in splits:
        raise InputError(f"{key}: no split '{name}'; there are {', '.join(splits)}")
    if modality(protocol) not in (known := modalities(settings)):
        raise InputError(f"{key}: '{protocol}' must end in one of {', '.join('_' + each for each in known)}")
    return name


def split_name(protocol: str) -> str:
    """Return the split of a protocol: `session` for session_pressure."""
    return protocol.rsplit("_", 1)[0]


class Images(NamedTuple):
    """One protocol's images, as models of windows take them: a window of one frame, and a one-hot label."""

    x: np.ndarray  # (n, 1, pixels) float32, 0 .. 255
    y: np.ndarray  # (n, classes) float32, 1 at the object
    part: np.ndarray  # (n,) 'train', 'validation', 'test', 'unused'
    objects: list[str]  # (classes,) names in the order of labels
    shape: tuple[int, int]  # rows and columns of an image


def read(path: Path, protocol: str, seed: int) -> Images:
    """Read the images and labels of one run from the dataset that the stage `dataset` wrote."""
    wanted = ["condition", "label", modality(protocol), schemas.split_column(protocol, seed)]
    table = schemas.read(path, columns=wanted)
    objects = classes(table)
    x = schemas.matrix(table[modality(protocol)]).astype(np.float32)[:, None]
    y = np.eye(len(objects), dtype=np.float32)[table["label"].to_numpy()]
    rows, cols = map(int, table.schema.field(modality(protocol)).metadata[SHAPE.encode()].split())
    return Images(x, y, schemas.names(table[schemas.split_column(protocol, seed)]), objects, (rows, cols))


def classes(table: pa.Table) -> list[str]:
    """Return the names of the objects in the order of their labels."""
    return sorted(set(schemas.names(table["condition"])))
