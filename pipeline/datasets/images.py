"""Make and read the tables of experiments whose input is one tactile image (glove)."""

from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pyarrow as pa

from pipeline.base.errors import InputError
from pipeline.datasets import schemas

SIDE = 32  # pixels of an image's side
MODALITIES = ("pressure", "strain", "combined")  # the three datasets of the SP-ResNet paper
HIGHEST = 255.0
PARTS = ("train", "validation", "test")


def frames(pressure: int, strain: int, value: pa.DataType) -> pa.Schema:
    """Return the schema of frames, in the order of time within a recording.

    pressure, strain: cells per frame; value: type of a reading.
    """
    return pa.schema(
        {
            "condition": schemas.NAME,  # the object, which the models must name
            "recording": schemas.NAME,
            "segment": pa.int16(),  # a new one after every reset of the device
            "t_s": pa.float64(),
            "gap_before": pa.bool_(),  # frames are missing before this one; also the first frame of a segment
            "pressure": pa.list_(value, pressure),
            "strain": pa.list_(value, strain),
        }
    )


def normalised(matrix: np.ndarray) -> np.ndarray:
    """Stretch each matrix of (n, rows, cols) linearly to 0 .. 255, uint8 (equation 6 of the SP-ResNet paper).

    X = 255 (C - min C) / (max C - min C). Raises InputError where max = min: ingest rejects such frames.
    """
    low, high = (edge(matrix, axis=(1, 2), keepdims=True) for edge in (np.min, np.max))
    if (constant := np.flatnonzero((high == low).ravel())).size:
        raise InputError(f"image {constant[0]}: all cells are equal, so it cannot be normalised; reject the frame")
    return np.round(HIGHEST * (matrix - low) / (high - low)).astype(np.uint8)


def dataset_rows(chosen: pa.Table, pictures: Mapping[str, np.ndarray]) -> pa.Table:
    """Return the dataset: condition, recording, t_s, label (int16, place of the object in the sorted names), images.

    chosen: a table of the schema `frames`; pictures: modality -> (n, SIDE, SIDE) uint8.
    """
    names = schemas.names(chosen["condition"])
    _, label = np.unique(names, return_inverse=True)
    table = chosen.select(["condition", "recording", "t_s"]).append_column("label", pa.array(label.astype(np.int16)))
    for modality in MODALITIES:
        flat = pictures[modality].reshape(len(names), SIDE * SIDE)
        table = table.append_column(modality, schemas.lists(flat, pa.uint8()))
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
    """Return the modality of a protocol, named <split>_<modality> (session_pressure); InputError for another name."""
    name = protocol.rsplit("_", 1)[-1]
    if name not in MODALITIES:
        raise InputError(f"protocol '{protocol}': must end in one of {', '.join('_' + known for known in MODALITIES)}")
    return name


def split_name(protocol: str) -> str:
    """Return the split of a protocol: `session` for session_pressure."""
    return protocol.rsplit("_", 1)[0]


class Images(NamedTuple):
    """One protocol's images, as models of windows take them: a window of one frame, and a one-hot label."""

    x: np.ndarray  # (n, 1, SIDE * SIDE) float32, 0 .. 255
    y: np.ndarray  # (n, classes) float32, 1 at the object
    part: np.ndarray  # (n,) 'train', 'validation', 'test', 'unused'
    objects: list[str]  # (classes,) names in the order of labels


def read(path: Path, protocol: str, seed: int) -> Images:
    """Read the images and labels of one run from the dataset that the stage `dataset` wrote."""
    wanted = ["condition", "label", modality(protocol), schemas.split_column(protocol, seed)]
    table = schemas.read(path, columns=wanted)
    objects = classes(table)
    x = schemas.matrix(table[modality(protocol)]).astype(np.float32)[:, None]
    y = np.eye(len(objects), dtype=np.float32)[table["label"].to_numpy()]
    return Images(x, y, schemas.names(table[schemas.split_column(protocol, seed)]), objects)


def classes(table: pa.Table) -> list[str]:
    """Return the names of the objects in the order of their labels."""
    return sorted(set(schemas.names(table["condition"])))
