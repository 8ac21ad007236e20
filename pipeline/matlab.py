"""MATLAB files of other people's recordings: only the variables asked for are decoded.

MATLAB objects are data to scipy; nothing in a file is executed. scipy reads in a process of its own, because some
damaged files crash it, with the process that it is in.
"""

import functools
import multiprocessing
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path

import numpy as np
import scipy.io

from pipeline.errors import InputError
from pipeline.parent import die_with_parent


def read(path: Path, names: Sequence[str], largest: int) -> dict[str, np.ndarray]:
    """The variables `names` of a file of MATLAB's versions 4 to 7.

    Raises InputError for a file of more than `largest` bytes, of version 7.3, that is cut or damaged, or that lacks a
    variable.
    """
    size = path.stat().st_size
    if size > largest:
        raise InputError(f"{path}: {size} bytes are more than the data can have ({largest}); check the file")
    with path.open("rb") as file:
        start = file.read(16)
    if start.startswith((b"MATLAB 7.3", b"\x89HDF")):
        raise InputError(f"{path}: MATLAB version 7.3 (HDF5) is not read; load it and save it again with '-v7'")
    try:
        found = _process().submit(scipy.io.loadmat, path, variable_names=list(names)).result()
    except BrokenProcessPool as error:
        _process.cache_clear()
        raise InputError(f"{path}: not a whole MATLAB file (it crashes scipy's reader); get it again") from error
    except Exception as error:  # scipy raises whatever a damaged file leads it to, UnboundLocalError for one
        raise InputError(f"{path}: not a whole MATLAB file ({error or 'it ends too early'}); get it again") from error
    for name in names:
        if not isinstance(found.get(name), np.ndarray):
            raise InputError(f"{path}: has no variable '{name}'; it must hold {', '.join(names)}")
    return found


@functools.cache
def _process() -> ProcessPoolExecutor:
    """The process that reads, until one file crashes it."""
    return ProcessPoolExecutor(1, multiprocessing.get_context("spawn"), initializer=die_with_parent)
