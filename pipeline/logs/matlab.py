"""Read MATLAB files of other people's recordings: only the variables asked for are decoded.

MATLAB objects are data to scipy; nothing in a file is executed. scipy reads in a process of its own, because some
damaged files crash it, with the process that it is in, and because a file of a megabyte may unpack to all memory.
"""

import functools
import multiprocessing
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path

import numpy as np
import scipy.io

from pipeline.base.errors import InputError
from pipeline.base.processes import die_with_parent


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


def variables(path: Path, largest: int, **options) -> dict:
    """Read a file of MATLAB's versions 4 to 7; options: of scipy.io.loadmat.

    Raises InputError for a file that has more than `largest` bytes, that takes more than twice as much memory to read
    (on Linux; reading takes three times the memory of the variables), that is of version 7.3, cut or damaged.
    """
    size = path.stat().st_size
    if size > largest:
        raise InputError(f"{path}: {size} bytes are more than the data can have ({largest}); check the file")
    with path.open("rb") as file:
        start = file.read(16)
    if start.startswith((b"MATLAB 7.3", b"\x89HDF")):
        raise InputError(f"{path}: MATLAB version 7.3 (HDF5) is not read; load it and save it again with '-v7'")
    try:
        return _process().submit(_within, 2 * largest, scipy.io.loadmat, path, **options).result()
    except MemoryError as error:
        _process.cache_clear()  # the process ends, and its memory is free again
        raise InputError(
            f"{path}: takes more than {2 * largest >> 20} MiB of memory to read, and the data cannot need that; "
            "get the file again"
        ) from error
    except BrokenProcessPool as error:
        _process.cache_clear()
        raise InputError(f"{path}: not a whole MATLAB file (it crashes scipy's reader); get it again") from error
    except Exception as error:  # scipy raises whatever a damaged file leads it to, UnboundLocalError for one
        raise InputError(f"{path}: not a whole MATLAB file ({error or 'it ends too early'}); get it again") from error


def _within(memory: int, function: Callable, *arguments, **named):
    """Call `function`; on Linux it may take `memory` bytes more than the process has, beyond that MemoryError."""
    size = Path("/proc/self/statm")
    if size.is_file():
        import resource  # Windows has no such module

        _, most = resource.getrlimit(resource.RLIMIT_AS)
        wanted = int(size.read_text().split()[0]) * resource.getpagesize() + memory
        resource.setrlimit(resource.RLIMIT_AS, (wanted if most == resource.RLIM_INFINITY else min(wanted, most), most))
    return function(*arguments, **named)


@functools.cache
def _process() -> ProcessPoolExecutor:
    """Return the process that reads, the same until a file crashes it."""
    return ProcessPoolExecutor(1, multiprocessing.get_context("spawn"), initializer=die_with_parent)
