"""Every random number of the project starts here."""

import zlib

import numpy as np


def generator(seed: int, *names: str | int) -> np.random.Generator:
    """A generator of its own for every (seed, names), so that adding one never shifts another."""
    words = [seed, *(zlib.crc32(str(name).encode()) for name in names)]
    return np.random.default_rng(np.random.SeedSequence(words))
