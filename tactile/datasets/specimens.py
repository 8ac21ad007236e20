"""Number the specimens of a scene: which array or glove, of several of the same make, a recording is of.

Simulated recordings say it in their names, `specimen2-run000`; nothing is trained on those named `specimen2-test00`.
Recorded ones do not: all are of specimen 0. Seed s of a protocol trains and tests on specimen s, or on the specimens in
turn where there are fewer.
"""

import re
from collections.abc import Mapping

import numpy as np

NAMED = re.compile(r"specimen(\d+)-.")
ONLY_TESTED = re.compile(r"specimen\d+-test\d+")


def named(specimen: int, name: str) -> str:
    """Return the name of a simulated recording of a specimen."""
    return f"specimen{specimen}-{name}"


def number(name: str) -> int:
    """Return the specimen that a recording is of, by its name."""
    match = NAMED.match(name)
    return int(match[1]) if match else 0


def of_seed(names: np.ndarray, seed: int) -> np.ndarray:
    """Return which rows belong to the specimen of a seed, (n,) bool; names: (n,) of their recordings."""
    known, place = np.unique(names, return_inverse=True)
    numbers = np.array([number(name) for name in known], dtype=int)
    return numbers[place] == seed % (numbers.max(initial=0) + 1)


def only_tested(names: np.ndarray) -> np.ndarray:
    """Return which rows are of simulated recordings that are for tests alone, (n,) bool; names: (n,) of recordings."""
    known, place = np.unique(names, return_inverse=True)
    return np.array([ONLY_TESTED.fullmatch(name) is not None for name in known], dtype=bool)[place]


def drawn(scene: Mapping, specimen: int) -> dict:
    """Return the settings of the scene (block `simulate`) of a specimen: it differs in all that is drawn by chance."""
    return {**scene, **{name: scene[name] + specimen for name in ("seed", "specimen") if name in scene}}
