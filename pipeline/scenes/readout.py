"""Model read-out circuits: from the conductance of the elements to the counts in a log."""

import numpy as np


def column_voltage(
    conductance: np.ndarray, *, reference_s: float, supply_v: float, crosstalk: bool, driver_ohm: float = 0.0
) -> np.ndarray:
    """Return the voltage over the reference resistor of each column while one row after the other is driven.

    Row i is driven to `supply_v`, all other rows are held at 0 V, and column j goes to ground through the
    reference resistor. Every row pin has the output resistance `driver_ohm`, g_d = 1 / driver_ohm, so the row nodes
    u sag (or rise) with the current. Kirchhoff's current law at all nodes is exact:

        row k:     g_d (supply [k = i] - u_k) = sum_j g_kj (u_k - V_j)
        column j:  sum_k g_kj (u_k - V_j) = g_ref V_j

    With u eliminated, D_k = g_d + sum_j g_kj:

        V_j (g_ref + sum_k g_kj) - sum_l V_l sum_k g_kj g_kl / D_k = supply g_d g_ij / D_i,

    one small linear system with a right-hand side per driven row. Without output resistance it is diagonal,

        V_j = supply * g_ij / (g_ref + sum_k g_kj).

    The sum is the crosstalk: every element of the column loads the divider. Without `crosstalk` every element is read
    alone, in series with its driver.

    conductance: (steps, rows, cols) in siemens; returns volts, same shape. Source: LoMP paper, figure 2c; output
    resistance of the ATmega32U4's pins: data sheet, typical characteristics (about 25 ohm at 5 V).
    """
    if not crosstalk:
        alone = conductance / (1 + conductance * driver_ohm)
        return supply_v * alone / (reference_s + alone)
    column = reference_s + conductance.sum(axis=1)
    if not driver_ohm:
        return supply_v * conductance / column[:, None, :]
    drivers = 1 / driver_ohm
    reached = conductance / (drivers + conductance.sum(axis=2, keepdims=True))  # g_kj / D_k
    system = -np.einsum("tkj,tkl->tjl", conductance, reached)
    diagonal = np.arange(conductance.shape[2])
    system[:, diagonal, diagonal] += column
    driven = supply_v * drivers * reached.transpose(0, 2, 1)  # (steps, cols, driven row)
    return np.linalg.solve(system, driven).transpose(0, 2, 1)


def counts(voltage: np.ndarray, *, supply_v: float, levels: int, noise: np.ndarray | float = 0.0) -> np.ndarray:
    """Convert voltages to counts, with additive noise in counts, clipped to 0 .. levels - 1; int16."""
    scaled = np.floor(voltage / supply_v * levels + noise)
    return np.clip(scaled, 0, levels - 1).astype(np.int16)
