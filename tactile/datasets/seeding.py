"""Start every random number of the project: one generator per seed and names."""

import zlib

import numpy as np


def generator(seed: int, *names: str | int) -> np.random.Generator:
    """Return a generator for (seed, names), independent of all others, so that adding one never shifts another."""
    words = [seed, *(zlib.crc32(str(name).encode()) for name in names)]
    return np.random.default_rng(np.random.SeedSequence(words))
