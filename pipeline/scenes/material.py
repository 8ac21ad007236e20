"""Model Velostat: the log resistance of a taxel from the history of the force on it, and nothing else.

The model is causal and starts from long rest. F is force in N, dt the step in s, r log resistance. The readings that
it was fitted to are all 1000 k / m with whole numbers k and m, k + m about 1645: a taxel's share of a divider's voltage
over the reference resistor's, times 1000, which is ohm if that resistor had 1 kohm.

1. Static law: a power law above a contact threshold,

       x = max(0, ln gain + a ln(F1 / F0) + a e ln(F / F1)),     r = r0 - x.

   x is the log conductance above rest. `gain` and exponent e are 1, or differ between places of a film; F1 = 10 N is
   the force at which places differ by their gain alone. Conductance as a power of pressure: Stassi et al., Sensors 14,
   5296 (2014). Two refinements were tried and add nothing once places differ: a second, steeper power law at high force
   (sum of squares of the fit 0.6 % lower, its exponent runs to any bound), and a knee ln(1 + g^k) / k in place of
   the maximum (the same to 0.02 % from k = 8 upwards).
2. Creep (fading memory) at three rates: contacts form within some 10 ms (`contact`), the film flows into them
   within some 100 ms (`creep`) and over seconds (`slow`). Contact needs time to form but none to break, so each
   relaxation can only hold conductance back:

       x <- x - sum_i w_i (x - min(x, L_i)),     L_i <- L_i + (1 - exp(-dt / T_i)) (x - L_i),

   exact for a force that is constant within a step.
3. Hysteresis, rate-independent: a Prandtl-Ishlinskii mean of play operators (Brokate and Sprekels, Hysteresis
   and Phase Transitions, 1996) on ln x, so that the loop closes at rest:

       p_j <- min(max(p_j, x), (1 + h j / 3) x),     x <- (p_1 + p_2 + p_3) / 3.

4. Release overshoot: after release r lies above its rest value and creeps back over seconds. A memory P of
   the largest x that leaks with time constant T adds c (P - x) to r: P <- max(x, exp(-dt / T) P).
   A second, slower memory for a drift of the rest value over minutes was tried; it did not improve the fit.

Numbers come from `velostat.json`, written by tools/fit_material.py.
"""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.signal import lfilter

FITTED = Path(__file__).with_name("velostat.json")
LEAST_FORCE_N = 1e-9  # stands for no force, so that logarithms exist; far below the threshold F0
PIVOT_N = 10.0  # F1, in the middle of the recorded 0.5 to 45 N on a logarithmic scale
PLAY_OPERATORS = 3


@dataclass(frozen=True)
class Material:
    """Parameters of the model; symbols as in the module's docstring."""

    rest: float  # r0, log of the reading
    onset_n: float  # F0
    exponent: float  # a
    contact_weight: float  # w and T of equation 2, the fastest relaxation; the weights' sum is below 1
    contact_time_s: float
    creep_weight: float
    creep_time_s: float
    slow_weight: float
    slow_time_s: float
    hysteresis_width: float  # h
    release_gain: float  # c
    release_time_s: float  # T of equation 4


class Places(NamedTuple):
    """How places of one taxel differ under one tip, measured at the places of the recordings."""

    gain_std: float  # of the log gain
    exponent_std: float  # of e
    neighbour_correlation: float  # of the log gain at places one step of the recorded raster apart
    raster: Sequence[int]  # rows and columns of the places of a recording
    step_mm: Sequence[float]  # between two rows, and between two places of a row


@cache
def load_material() -> Material:
    """Return the parameters fitted to the recordings (`velostat.json`)."""
    return Material(**json.loads(FITTED.read_text())["parameters"])


@cache
def load_places() -> Places:
    """Return how places differ in the recordings (`velostat.json`)."""
    places = json.loads(FITTED.read_text())["places"]
    return Places(*(places[name] for name in Places._fields))


def static_conductance(
    material: Material, force: np.ndarray, gain: np.ndarray | float = 1.0, exponent: np.ndarray | float = 1.0
) -> np.ndarray:
    """Return x of equation 1: log conductance above rest (>= 0) at each force (N), without any memory."""
    log_force = np.log(np.maximum(force, LEAST_FORCE_N))
    power = material.exponent * (exponent * (log_force - np.log(PIVOT_N)) + np.log(PIVOT_N / material.onset_n))
    return np.maximum(power + np.log(gain), 0)


def relaxed(x: np.ndarray, time_s: float, dt: float) -> np.ndarray:
    """Return L of equation 2, from rest: x (steps, ...) seen through an exponential memory of `time_s`."""
    keep = np.exp(-dt / time_s)
    return lfilter([1 - keep], [1, -keep], x, axis=0)


def play(x: np.ndarray, width: float) -> np.ndarray:
    """Return p of equation 3, from rest: the play operator on ln x, for x >= 0 of shape (steps, ...).

    Each step clamps p between x and (1 + width) x. Clamps compose to clamps, so a prefix scan of log2(steps)
    vectorised rounds replaces the loop over steps.
    """
    low, high = x.copy(), (1 + width) * x
    step = 1
    while step < len(x):
        last_low, last_high = low[step:].copy(), high[step:].copy()
        low[step:] = np.minimum(np.maximum(low[:-step], last_low), last_high)
        high[step:] = np.minimum(np.maximum(high[:-step], last_low), last_high)
        step *= 2
    return low


def leaking_peak(x: np.ndarray, time_s: float, dt: float) -> np.ndarray:
    """Return P of equation 4, from rest: the largest x so far, each x faded by exp(-age / time_s)."""
    age = (np.arange(len(x)) * (dt / time_s)).reshape(-1, *[1] * (x.ndim - 1))
    faded = np.log(np.maximum(x, np.finfo(float).tiny)) + age
    return np.exp(np.maximum.accumulate(faded, axis=0) - age)


def log_resistance(
    material: Material,
    force: np.ndarray,
    dt: float,
    *,
    gain: np.ndarray | float = 1.0,
    exponent: np.ndarray | float = 1.0,
    creep: bool = True,
    slow_creep: bool = True,
    hysteresis: bool = True,
    release: bool = True,
) -> np.ndarray:
    """Return the log resistance, same shape as `force`: (steps,) or (steps, elements), N, sampled every `dt` seconds.

    `gain` and `exponent`, numbers or arrays that broadcast against `force`, such as (elements,), multiply the
    pressed part of the conductance and the power-law exponents. Each of the four effects can be switched
    off (creep: its two faster rates); with all off only the static law is left.
    Conductance is exp(-log resistance), up to a scale.
    """
    x = static_conductance(material, np.asarray(force, dtype=float), gain, exponent)
    rates = [(material.contact_weight, material.contact_time_s), (material.creep_weight, material.creep_time_s)] * creep
    rates += [(material.slow_weight, material.slow_time_s)] * slow_creep
    x = x - sum(weight * (x - np.minimum(x, relaxed(x, time_s, dt))) for weight, time_s in rates)
    if hysteresis:
        widths = material.hysteresis_width * np.arange(1, PLAY_OPERATORS + 1) / PLAY_OPERATORS
        x = sum(play(x, width) for width in widths) / PLAY_OPERATORS
    result = material.rest - x
    if release:
        result += material.release_gain * (leaking_peak(x, material.release_time_s, dt) - x)
    return result
