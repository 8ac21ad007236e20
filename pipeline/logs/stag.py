"""Read the STAG data set: frames of a tactile glove that grasps everyday objects (Sundaram et al., Nature 569, 2019).

Its file `classification/metadata.mat` (stag.csail.mit.edu; for research only, so not part of this repository) holds
one value per frame of `pressure` (n, 32, 32), `objectId`, `recordingId`, `splitId`, `hasValidLabel` and `isBalanced`,
and the names `objects`, `recordings` and `splits`, into which the numbers point, from 0.
"""

from pathlib import Path
from typing import NamedTuple

import numpy as np

from pipeline.base.errors import InputError
from pipeline.base.paths import Workspace
from pipeline.datasets.images import HIGHEST, SIDE
from pipeline.logs import matlab, own_data

LOWEST_ADC, HIGHEST_ADC = 500, 650  # the authors' own models scale these to 0 and 1, and clip beyond
NAMES = {"objectId": "objects", "recordingId": "recordings", "splitId": "splits"}
FLAGS = ("hasValidLabel", "isBalanced")
VARIABLES = ("pressure", *NAMES, *NAMES.values(), *FLAGS)
PARTS = ("train", "test")

LARGEST_FILE = 1 << 30  # bytes
MOST_FRAMES = 1e9


class Stag(NamedTuple):
    """The frames that have a valid label, in the order of the file."""

    images: np.ndarray  # (n, 1, SIDE * SIDE) float32, 0 .. 255, row by row
    label: np.ndarray  # (n,) place in `objects`
    objects: list[str]  # names of all objects, also of those without a frame here
    recording: np.ndarray  # (n,) name
    part: np.ndarray  # (n,) 'train' or 'test': whole recordings, as the authors split them


def read(workspace: Workspace, path: Path, balanced: bool = True) -> Stag:
    """Read `metadata.mat`, saved by MATLAB as version 5 to 7.

    `balanced`: only the frames that the authors picked so that every object has as many. Raises InputError for a file
    that is missing, outside data/own, cut, of version 7.3, lacks a variable, has variables that do not belong together,
    or has no frame left.
    """
    if not path.is_file():
        raise InputError(f"{path}: not found; download the classification data of STAG and name its metadata.mat")
    if problem := own_data.unnoticed(workspace, path):
        raise InputError(f"params/glove.yaml, glove.stag.file: {problem}")
    variables = matlab.read(path, VARIABLES, LARGEST_FILE)
    pressure = variables["pressure"]
    if pressure.ndim != 3 or pressure.shape[1:] != (SIDE, SIDE) or pressure.dtype.kind not in "fiu":
        raise InputError(f"{path}: 'pressure' is {pressure.shape}, not frames of {SIDE} x {SIDE} numbers")
    names = {name: _names(path, name, variables[name]) for name in NAMES.values()}
    if not set(names["splits"]) <= set(PARTS):
        raise InputError(f"{path}: 'splits' are {', '.join(names['splits'])}; {' and '.join(PARTS)} are known")
    number = {name: _numbers(path, name, variables[name], len(pressure)) for name in (*NAMES, *FLAGS)}
    kept = number["hasValidLabel"] != 0
    if balanced:
        kept &= number["isBalanced"] != 0
    if not kept.any():
        raise InputError(f"{path}: none of its {len(pressure)} frames has a valid label; check the file")
    if not np.isfinite(pressure[kept]).all():
        raise InputError(f"{path}: 'pressure' holds values that are no numbers; get the file again")
    for name, target in NAMES.items():
        low, high = number[name][kept].min(), number[name][kept].max()
        if low < 0 or high >= len(names[target]):
            raise InputError(
                f"{path}: '{name}' is {low} to {high}, but '{target}' has {len(names[target])} names, numbered from 0"
            )
    counts = np.clip(pressure[kept], LOWEST_ADC, HIGHEST_ADC).astype(np.float32)
    share = (counts - LOWEST_ADC) / (HIGHEST_ADC - LOWEST_ADC)
    return Stag(
        images=(HIGHEST * share).reshape(-1, 1, SIDE * SIDE),
        label=number["objectId"][kept],
        objects=names["objects"],
        recording=np.array(names["recordings"])[number["recordingId"][kept]],
        part=np.array(names["splits"])[number["splitId"][kept]],
    )


def _names(path: Path, name: str, value: np.ndarray) -> list[str]:
    """Return the texts of a cell array, or of a character matrix, whose rows are padded with spaces."""
    texts = [cell.item() if isinstance(cell, np.ndarray) and cell.size == 1 else cell for cell in value.ravel()]
    if not texts or not all(isinstance(text, str) for text in texts):
        raise InputError(f"{path}: '{name}' must be a cell array of names")
    return [text.strip() for text in texts]


def _numbers(path: Path, name: str, value: np.ndarray, n: int) -> np.ndarray:
    """Return a variable as (n,) whole numbers; raise InputError where its values are others."""
    flat = value.ravel()
    small = flat.dtype.kind in "fiub" and (np.abs(flat.astype(float)) < MOST_FRAMES).all()  # False for NaN
    if not small or len(flat) != n or (flat % 1).any():
        raise InputError(f"{path}: '{name}' must be {n} whole numbers, one per frame of 'pressure'")
    return flat.astype(np.int64)
