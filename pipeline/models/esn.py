"""Echo state network (suggested in the latent-space paper, its reference 19): a random reservoir, a ridge read-out."""

import numpy as np
from scipy import sparse

from pipeline.fitting import Spec
from pipeline.seeding import generator
from pipeline.series_fitting import StateReadout

LINKS = 10  # connections a unit: makes a step cost units x 10 instead of units squared
PIECES, FORGOTTEN = 16, 1000  # of a long series, side by side; samples after which nothing is left of where it started


def build(spec: Spec, *, units: int, spectral_radius: float, leak: float, input_scale: float, ridge: float):
    """State s <- (1 - leak) s + leak tanh(W s + V tanh(x) + b); only the read-out is fitted.

    The inputs go through the same tanh as the LSTM's. `leak` is a sample's share of the state.
    """

    def make(channels: int, seed: int) -> dict[str, np.ndarray]:
        rng = generator(seed, "reservoir")
        reservoir = np.zeros((units, units), np.float32)
        for row in reservoir:
            row[rng.choice(units, min(LINKS, units), replace=False)] = rng.normal(size=min(LINKS, units))
        # All eigenvalues: the search for the largest alone (ARPACK) does not converge for every reservoir.
        reservoir *= spectral_radius / np.abs(np.linalg.eigvals(reservoir.astype(np.float64))).max()
        return {
            "reservoir": reservoir,
            "input": (input_scale * rng.uniform(-1, 1, (channels, units))).astype(np.float32),
            "bias": (input_scale * rng.uniform(-1, 1, units)).astype(np.float32),
        }

    def advance(system: dict, x: np.ndarray, state: np.ndarray | None) -> np.ndarray:
        links = sparse.csr_matrix(system["reservoir"])
        drive = np.tanh(x) @ system["input"] + system["bias"]  # (n, T, units)
        if state is not None or drive.shape[1] < 4 * FORGOTTEN:
            return sample_by_sample(links, drive, state)
        return np.stack([in_pieces(links, series) for series in drive])

    def sample_by_sample(links: sparse.csr_matrix, drive: np.ndarray, state: np.ndarray | None) -> np.ndarray:
        states = np.empty_like(drive)
        s = np.zeros((units, len(drive)), np.float32) if state is None else state.T
        for t in range(drive.shape[1]):
            s = (1 - leak) * s + leak * np.tanh(links @ s + drive[:, t].T)
            states[:, t] = s.T
        return states

    def in_pieces(links: sparse.csr_matrix, drive: np.ndarray) -> np.ndarray:
        """States (T, units) of one series from rest: its pieces side by side, each started FORGOTTEN samples early.

        The samples before the first are zero, which keeps it at rest; the others differ by rounding (a test says how
        little). Six times as fast as sample by sample.
        """
        length = -(-len(drive) // PIECES)
        padded = np.zeros((FORGOTTEN + PIECES * length, units), drive.dtype)
        padded[FORGOTTEN : FORGOTTEN + len(drive)] = drive
        pieces = np.stack([padded[k * length : (k + 1) * length + FORGOTTEN] for k in range(PIECES)])
        return sample_by_sample(links, pieces, None)[:, FORGOTTEN:].reshape(-1, units)[: len(drive)]

    macs = units * min(LINKS, units) + spec.elements * units + units * spec.outputs
    return StateReadout(spec, make, advance, ridge, macs)
