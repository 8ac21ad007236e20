"""Model read-out circuits: from the conductance of the elements to the counts in a log."""

import numpy as np


def column_voltage(conductance: np.ndarray, *, reference_s: float, supply_v: float, crosstalk: bool) -> np.ndarray:
    """Return the voltage over the reference resistor of each column while one row after the other is driven.

    Row i is driven to `supply_v`, all other rows are held at 0 V, and column j goes to ground through the
    reference resistor. Kirchhoff's current law at the column node is exact:

        V_j = supply * g_ij / (g_ref + sum_k g_kj)

    The sum is the crosstalk: every element of the column loads the divider. Without `crosstalk` g_ij stands in its
    place.

    conductance: (steps, rows, cols) in siemens; returns volts, same shape. Source: LoMP paper, figure 2c.
    """
    load = conductance.sum(axis=1, keepdims=True) if crosstalk else conductance
    return supply_v * conductance / (reference_s + load)


def counts(voltage: np.ndarray, *, supply_v: float, levels: int, noise: np.ndarray | float = 0.0) -> np.ndarray:
    """Convert voltages to counts, with additive noise in counts, clipped to 0 .. levels - 1; int16."""
    scaled = np.floor(voltage / supply_v * levels + noise)
    return np.clip(scaled, 0, levels - 1).astype(np.int16)
