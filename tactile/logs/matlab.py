"""Read MATLAB files of other people's recordings: only the variables asked for are decoded.

MATLAB objects are data to scipy; nothing in a file is executed. scipy reads in a process of its own, because some
damaged files crash it.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import scipy.io

from tactile.base import foreign
from tactile.base.errors import InputError

WHOLE, SECONDS = "a whole MATLAB file", 600


def read(path: Path, names: Sequence[str], largest: int) -> dict[str, np.ndarray]:
    """Read the variables `names`; errors as `variables`, and where one is missing."""
    found = variables(path, largest, variable_names=list(names))
    for name in names:
        if not isinstance(found.get(name), np.ndarray):
            raise InputError(f"{path}: has no variable '{name}'; it must hold {', '.join(names)}")
    return found


def structures(path: Path, largest: int) -> dict:
    """Read all variables, structures as dictionaries; errors as `variables`."""
    found = variables(path, largest, simplify_cells=True)
    return {name: value for name, value in found.items() if not name.startswith("__")}


def is_hdf5(path: Path, largest: int | None = None) -> bool:
    """Tell whether a file is of MATLAB's version 7.3; InputError for one that has more than `largest` bytes."""
    with foreign.reading(path, "the data", "check the file", largest), path.open("rb") as file:
        return file.read(16).startswith((b"MATLAB 7.3", b"\x89HDF"))


def variables(path: Path, largest: int, **options: object) -> dict:
    """Read a file of MATLAB's versions 4 to 7; options: of scipy.io.loadmat.

    Raises InputError for a file that has more than `largest` bytes, that takes more than twice as much memory to read
    (on Linux; reading takes three times the memory of the variables) or SECONDS, that is of version 7.3, cut or
    damaged.
    """
    if is_hdf5(path, largest):
        raise InputError(f"{path}: MATLAB version 7.3 (HDF5) is not read; load it and save it again with '-v7'")
    return foreign.apart(
        path, WHOLE, "get it again", scipy.io.loadmat, path, memory=2 * largest, seconds=SECONDS, **options
    )
