"""Lines as they arrive through a serial adapter, which hands them on in packets."""

import numpy as np


def arrived(printed_s: np.ndarray, packet_s: float, rng: np.random.Generator, late: float = 0.05) -> np.ndarray:
    """Return the times (n,) in s at which lines printed at `printed_s` (n,) are read.

    They come with the end of a packet, up to a millisecond late; a share `late` of packets with the next but one.
    """
    packet = np.ceil(printed_s / packet_s - 1e-9).astype(int)
    numbers, of_line = np.unique(packet, return_inverse=True)
    delay = rng.exponential(1e-4, len(numbers)).clip(max=1e-3) + (rng.random(len(numbers)) < late) * 2 * packet_s
    return np.maximum.accumulate(numbers * packet_s + delay)[of_line]


def stamps_us(arrived_s: np.ndarray) -> np.ndarray:
    """Return whole microseconds (n,) that rise strictly, as a computer stamps lines that arrive at `arrived_s` (n,)."""
    count = np.arange(len(arrived_s))
    return np.maximum.accumulate(np.round(1e6 * arrived_s).astype(np.int64) - count) + count
