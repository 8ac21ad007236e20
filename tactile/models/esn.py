"""Build an echo state network (the latent-space paper's reference 19): a random reservoir with a ridge read-out."""

import numpy as np
from pydantic import Field
from scipy import sparse

from tactile.datasets.seeding import generator
from tactile.learning.series_regressors import StateReadout
from tactile.learning.spec import Spec
from tactile.settings.shared import Block, NotNegative, Positive, Share, Width

LINKS = 10  # connections per unit: makes a step cost units x 10 instead of units squared
# A long series is cut into PIECES that run side by side, each started FORGOTTEN samples early from rest: nothing was
# left of the first state after 400 samples in 8 reservoirs.
PIECES, FORGOTTEN = 16, 500


class Settings(Block):
    """Settings of a model `esn` in params.yaml."""

    units: Width = Field(description="Units of the reservoir")
    spectral_radius: Positive = Field(description="Largest absolute eigenvalue of the reservoir")
    leak: Share = Field(description="Share of the state that a sample replaces")
    input_scale: Positive = Field(description="Largest weight of an input, and largest bias")
    ridge: NotNegative = Field(description="Penalty of the read-out against the mean squared error")


def build(
    spec: Spec, *, units: int, spectral_radius: float, leak: float, input_scale: float, ridge: float
) -> StateReadout:
    """Return the network with states s <- (1 - leak) s + leak tanh(W s + V tanh(x) + b); only the read-out is fitted.

    The inputs x go through the same tanh as the LSTM's. W (units, units) has LINKS numbers per row and the spectral
    radius `spectral_radius`; V and b are uniform in +-`input_scale`.
    """

    def make(channels: int, seed: int) -> dict[str, np.ndarray]:
        """Return W, V and b of the docstring above, drawn by `seed`."""
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
        """Return the states as `StateReadout` asks."""
        links = sparse.csr_matrix(system["reservoir"])
        drive = np.tanh(x) @ system["input"] + system["bias"]  # (n, T, units)
        if state is not None or drive.shape[1] < 4 * FORGOTTEN:
            return sample_by_sample(links, drive, state)
        return in_pieces(links, drive)

    def sample_by_sample(links: sparse.csr_matrix, drive: np.ndarray, state: np.ndarray | None) -> np.ndarray:
        """Return states (n, T, units) for drives (n, T, units) from a state (n, units), None at rest."""
        states = np.ascontiguousarray(drive.transpose(1, 2, 0))  # (T, units, n): the drive, replaced by the states
        s = np.zeros(states.shape[1:], np.float32) if state is None else state.T
        for step in states:
            pull = links @ s
            pull += step
            np.tanh(pull, out=pull)
            pull *= leak
            np.multiply(s, 1 - leak, out=step)
            step += pull
            s = step
        return states.transpose(2, 0, 1)

    def in_pieces(links: sparse.csr_matrix, drive: np.ndarray) -> np.ndarray:
        """Return states (n, T, units) from rest for drives (n, T, units), the pieces of each series side by side.

        The samples before the first piece are zero, which keeps its state at rest; states of the other pieces differ by
        rounding (a test says how little). Six times as fast as sample by sample.
        """
        length = -(-drive.shape[1] // PIECES)
        states = np.empty((len(drive), PIECES, length, units), np.float32)
        for series, its_states in zip(drive, states, strict=True):
            padded = np.zeros((FORGOTTEN + PIECES * length, units), np.float32)
            padded[FORGOTTEN : FORGOTTEN + len(series)] = series
            pieces = np.lib.stride_tricks.sliding_window_view(padded, FORGOTTEN + length, axis=0)[::length]
            its_states[:] = sample_by_sample(links, pieces.transpose(0, 2, 1), None)[:, FORGOTTEN:]
        return states.reshape(len(drive), -1, units)[:, : drive.shape[1]]

    macs = units * min(LINKS, units) + spec.elements * units + units * spec.outputs
    return StateReadout(spec, make, advance, ridge, macs)
